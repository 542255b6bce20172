"""Jobs that hardly any command can serve, because nothing is measured yet."""

from __future__ import annotations

from cmm_uq.base.errors import CmmUqError
from cmm_uq.jobs.job import Job

OVERFLOW_FIX = (
    "Look for a number that no measurement gives: in the columns of the recording, u_coordinate_um, u_um or travel_mm"
)
"""Where figures leave the range of numbers."""


def refuse_planned(job: Job) -> None:
    """Refuse a recording that only holds the coordinates of a plan; it can be simulated, and nothing else.

    Raises
    ------
    CmmUqError : it does.
    """
    if job.planned:
        raise CmmUqError("holds planned coordinates: nothing is measured", where=f"{job.recording_path} line 1",
                         fix="Put in what the machine indicated, then remove that line")  # fmt: skip


def refuse_unmeasured(job: Job) -> None:
    """Refuse a job of which nothing is measured: a plan's coordinates, or no recording at all where its kind has one.

    Raises
    ------
    CmmUqError : nothing is.
    """
    refuse_planned(job)
    if job.facts.artefact.with_recording and not len(job.points):
        raise CmmUqError("is not there: nothing is measured", where=job.recording_path,
                         fix="Record what the machine indicated; cmm-uq plan says where")  # fmt: skip
