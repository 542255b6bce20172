"""Jobs that some commands cannot serve, because nothing in them is a list of effects acting on points."""

from __future__ import annotations

from cmm_uq.errors import CmmUqError
from cmm_uq.jobs.job import ERROR_MAP, SHIFT, Job

_REASONS = {
    SHIFT: ("a shift job cannot be {}: its machine error is a free function, no list of effects",
            "cmm-uq report JOB estimates it"),
    ERROR_MAP: ("error maps cannot be {}: they are free functions, no points of an artefact",
                "cmm-uq diagnose JOB compares them with each other"),
}  # fmt: skip


def refuse(job: Job, what: str, *, but: str = "") -> None:
    """A clear error where a job of free functions cannot be served; ``but`` names the kind that can.

    A recording that only holds the coordinates of a plan can be simulated, and nothing else.

    Raises
    ------
    CmmUqError : the job is of such a kind, or not measured yet.
    """
    if job.planned and what != "simulated":
        raise CmmUqError("holds planned coordinates: nothing is measured", where=f"{job.recording_path} line 1",
                         fix="Put in what the machine indicated, then remove that line")  # fmt: skip
    kind = job.facts.artefact.kind
    if kind in _REASONS and kind != but:
        problem, fix = _REASONS[kind]
        raise CmmUqError(problem.format(what), where="job.toml [artefact] kind", fix=fix)
