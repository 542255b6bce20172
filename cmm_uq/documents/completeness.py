"""What ISO/IEC 17025:2017, 7.8 asks for and the job does not state, with the key that would mend it; dates out of their order.

A recording that nobody measured has no certificate, so nothing is asked of it.
"""

from __future__ import annotations

import datetime as dt

from cmm_uq.documents.clauses import missing
from cmm_uq.documents.traceability_section import certified_on_this_machine
from cmm_uq.jobs.artefact import Traceability
from cmm_uq.jobs.as_found import KEY
from cmm_uq.jobs.job import Job, JobFile
from cmm_uq.jobs.origin import MEASURED
from cmm_uq.messages import Text, Verbatim, day, foreign, say, semicolons

_INTERIM = say("An interim check ([job] interim): no calibration certificate, whatever the title says.")


def formal_warnings(job: Job) -> tuple[Text, ...]:
    """What an assessor would hold against a certificate of this job, whatever was measured."""
    if job.origin != MEASURED:
        return ()
    if job.facts.job.interim:
        return (_INTERIM, *contradictions(job))
    return (*contradictions(job), *_missing(job.facts))


def contradictions(job: Job) -> tuple[Text, ...]:
    """Dates out of their order, and an artefact that was certified on the machine which it tests."""
    found = None if job.as_found is None else job.as_found.job.date
    return (*_circular(job.facts), *_dates(job.facts, found))


def _missing(facts: JobFile) -> list[Text]:
    wanted = [
        say("{what} ({clause}): {key}", what=foreign(one.asks), clause=Verbatim(one.clause), key=Verbatim(one.key))
        for one in missing(facts)
    ]
    if not wanted:
        return []
    return [say("Not complete by ISO/IEC 17025:2017; the job does not state: {missing}.", missing=semicolons(wanted))]


def _circular(facts: JobFile) -> list[Text]:
    if not certified_on_this_machine(facts):
        return []
    return [
        say(
            "The artefact was certified on the machine that it now tests ([artefact.certificate] machine): errors that both "
            "measurements have in common are not seen here."
        )
    ]


def _dates(facts: JobFile, found: dt.date | None) -> list[Text]:
    """Pairs of dates of which the first must not be earlier than the second."""
    job = facts.job
    chain = facts.artefact.certificate or Traceability()
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
    return [
        say("Dates out of order: {what}, {first} against {second} ({key}).", what=what, first=day(first), second=day(second),
            key=Verbatim(key))
        for first, second, what, key in ordered if first and second and first < second
    ]  # fmt: skip
