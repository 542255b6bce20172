"""What of a shift job is refused before anything is estimated."""

from __future__ import annotations

from cmm_uq.artefacts.shift_axis.analysis import checked_series
from cmm_uq.artefacts.shift_plate.analysis import checked_plate
from cmm_uq.artefacts.shifting.kind import shift_facts
from cmm_uq.jobs.job import Job


def refuse_unfit(job: Job) -> None:
    if shift_facts(job).plane is not None:
        checked_plate(job)
    else:
        checked_series(job)
