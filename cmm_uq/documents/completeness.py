"""What ISO/IEC 17025:2017, 7.8 asks for and the job does not state, with the key that would mend it; dates out of their order.

A recording that nobody measured has no certificate, so nothing is asked of it.
"""

from __future__ import annotations

from cmm_uq.jobs.chain import certified_on_this_machine, dates_out_of_order
from cmm_uq.jobs.job import Job, JobFile
from cmm_uq.jobs.origin import MEASURED
from cmm_uq.messages import Text, Verbatim, say, semicolons

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
    return (*_circular(job.facts), *dates_out_of_order(job))


def unstated(facts: JobFile) -> list[tuple[Text, str]]:
    """What the certificate should state and the job does not, each with the key that mends it."""
    wanted: tuple[tuple[object, Text, str], ...] = (
        (facts.laboratory.name, say("name of the laboratory (7.8.2.1 b)"), "[laboratory] name"),
        (facts.laboratory.address, say("address of the laboratory (7.8.2.1 b)"), "[laboratory] address"),
        (facts.job.place, say("place of the measurement (7.8.2.1 c)"), "[job] place"),
        (facts.job.customer, say("customer (7.8.2.1 e)"), "[job] customer"),
        (facts.job.address, say("how to reach the customer (7.8.2.1 e)"), "[job] address"),
        (facts.job.procedure, say("method (7.8.2.1 f)"), "[job] procedure"),
        (facts.machine.serial, say("serial number of the machine (7.8.2.1 g)"), "[machine] serial"),
        (facts.job.issued, say("date of issue (7.8.2.1 j)"), "[job] issued"),
        (facts.laboratory.signatory, say("who authorises it (7.8.2.1 o)"), "[laboratory] signatory"),
        (facts.job.conditions, say("conditions (7.8.4.1 b)"), "[job] conditions"),
        *_of_the_artefact(facts),
        *_of_the_short_gauge(facts),
    )
    return [(what, key) for given, what, key in wanted if not given]


def _missing(facts: JobFile) -> list[Text]:
    missing = [say("{what}: {key}", what=what, key=Verbatim(key)) for what, key in unstated(facts)]
    if not missing:
        return []
    return [say("Not complete by ISO/IEC 17025:2017; the job does not state: {missing}.", missing=semicolons(missing))]


def _of_the_artefact(facts: JobFile) -> tuple[tuple[object, Text, str], ...]:
    """What makes the results traceable, of an artefact of which something is certified."""
    if not facts.artefact.traced or facts.recording.earlier:
        return ()
    chain = facts.artefact.certificate
    return (
        (chain and chain.number, say("certificate of the artefact (7.8.4.1 c)"), "[artefact.certificate] number"),
        (
            chain and chain.laboratory, say("who certified the artefact (7.8.4.1 c)"), "[artefact.certificate] laboratory",
        ),
    )  # fmt: skip


def _of_the_short_gauge(facts: JobFile) -> tuple[tuple[object, Text, str], ...]:
    """What makes a short gauge beside the artefact traceable."""
    if facts.short_gauge is None:
        return ()
    chain = facts.short_gauge.certificate
    return (
        (
            chain and chain.number, say("certificate of the short gauge (7.8.4.1 c)"), "[short_gauge.certificate] number",
        ),
        (
            chain and chain.laboratory, say("who certified the short gauge (7.8.4.1 c)"),
            "[short_gauge.certificate] laboratory",
        ),
    )  # fmt: skip


def _circular(facts: JobFile) -> list[Text]:
    if not certified_on_this_machine(facts):
        return []
    return [
        say(
            "The artefact was certified on the machine that it now tests ([artefact.certificate] machine): errors that both "
            "measurements have in common are not seen here."
        )
    ]
