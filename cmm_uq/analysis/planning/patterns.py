"""What of an artefact several kinds plan by."""

from __future__ import annotations

from cmm_uq.base.errors import CmmUqError
from cmm_uq.jobs.artefact import ArtefactFacts
from cmm_uq.jobs.plan import PlanFacts


def length_of(facts: ArtefactFacts, plan: PlanFacts) -> float:
    """Length, mm, by which a bar is planned.

    Raises
    ------
    CmmUqError : neither its certificate nor the plan gives one.
    """
    length = facts.length_mm or plan.length_mm
    if length is None:
        raise CmmUqError("the length of the artefact is needed", where="job.toml [plan] length_mm",
                         fix="Give it roughly, in mm; it is not taken as certified")  # fmt: skip
    return length
