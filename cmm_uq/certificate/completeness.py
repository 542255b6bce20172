"""What ISO/IEC 17025:2017, 7.8 asks for and the job does not state, with the key that would mend it; dates out of their order.

A recording that nobody measured has no certificate, so nothing is asked of it.
"""

from __future__ import annotations

from collections.abc import Iterable

from cmm_uq.base.messages import Key, Text, Verbatim, at_key, foreign, say, semicolons
from cmm_uq.certificate.clauses import Clause, missing
from cmm_uq.jobs.chain import certified_on_this_machine, dates_out_of_order
from cmm_uq.jobs.job import Job, JobFile
from cmm_uq.jobs.origin import MEASURED

_INTERIM = say(
    "An interim check{key}: no calibration certificate, whatever the title says.", key=at_key("[job] interim")
)


def formal_warnings(job: Job) -> tuple[Text, ...]:
    """What an assessor would hold against a certificate of this job, whatever was measured."""
    if job.origin != MEASURED:
        return ()
    if job.facts.job.interim:
        return (_INTERIM, *contradictions(job))
    return (*contradictions(job), *not_stated(missing(job)))


def contradictions(job: Job) -> tuple[Text, ...]:
    """Dates out of their order, and an artefact that was certified on the machine which it tests."""
    return (*_circular(job.facts), *dates_out_of_order(job))


def not_stated(lacking: Iterable[Clause]) -> list[Text]:
    """That a certificate is not complete, and by which keys it would be; nothing of one that is."""
    wanted = [
        say("{what} ({clause}){key}", what=foreign(one.asks), clause=Verbatim(one.clause), key=Key(f": {one.key}"))
        for one in lacking
    ]
    if not wanted:
        return []
    return [say("Not complete by ISO/IEC 17025:2017; the job does not state: {missing}.", missing=semicolons(wanted))]


def _circular(facts: JobFile) -> list[Text]:
    if not certified_on_this_machine(facts):
        return []
    return [
        say(
            "The artefact was certified on the machine that it now tests{key}: errors that both "
            "measurements have in common are not seen here.",
            key=at_key("[artefact.certificate] machine"),
        )
    ]
