"""What of a job's dates and of its artefact's certificate contradicts itself: the chain of traceability on its day."""

from __future__ import annotations

import datetime as dt

from cmm_uq.jobs.artefact import Traceability
from cmm_uq.jobs.as_found import KEY
from cmm_uq.jobs.job import Job, JobFile
from cmm_uq.messages import Text, Verbatim, day, say


def certified_on_this_machine(facts: JobFile) -> bool:
    """Whether the artefact's certificate comes from the machine that the artefact now tests."""
    chain, machine = facts.artefact.certificate, facts.machine
    own = {name.strip().casefold() for name in (machine.name, machine.serial) if name.strip()}
    return chain is not None and chain.machine.strip().casefold() in own


def dates_out_of_order(of: Job) -> tuple[Text, ...]:
    """Dates of which one must not be earlier than the other and is, among them an artefact that was due on the day."""
    job, chain = of.facts.job, of.facts.artefact.certificate or Traceability()
    found = None if of.as_found is None else of.as_found.job.date
    ordered: tuple[tuple[dt.date | None, dt.date | None, Text, str], ...] = (
        (job.issued, job.date, say("issued before it was measured"), "[job] issued"),
        (job.date, chain.date, say("the artefact was certified after it was measured with"), "[artefact.certificate] date"),
        (chain.due, job.date, say("the artefact was due for calibration before this"), "[artefact.certificate] due"),
        (chain.due, chain.date, say("the artefact's certificate was due before its date"), "[artefact.certificate] due"),
        (job.date, job.received, say("it was measured before it was received"), "[job] received"),
        (
            job.issued, None if job.replaces is None else job.replaces.date,
            say("issued before the certificate that it replaces"), "[job.replaces] date",
        ),
        (job.date, found, say("the machine was found as it was after it was left"), KEY),
        (
            job.recalibration_agreed, job.date, say("the next calibration is agreed for a day before this one"),
            "[job] recalibration_agreed",
        ),
    )  # fmt: skip
    return tuple(
        say("Dates out of order: {what}, {first} against {second} ({key}).", what=what, first=day(first), second=day(second),
            key=Verbatim(key))
        for first, second, what, key in ordered if first and second and first < second
    )  # fmt: skip
