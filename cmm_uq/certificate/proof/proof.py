"""What a proof of the diagnosis on a job's own set-ups found, for its page."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

from cmm_uq.jobs.job import Job
from cmm_uq.laboratory.proving.accepted import MISSED, Accepted, accepted
from cmm_uq.laboratory.proving.design import Design
from cmm_uq.laboratory.proving.judged import Judgement
from cmm_uq.laboratory.proving.reach import FaultReach, Reach, fault_reaches, reaches
from cmm_uq.laboratory.proving.sealed import canonical, sha256_of


@dataclass(frozen=True, eq=False)
class Proof:
    """A job whose diagnosis was tried on sealed cases.

    Parameters
    ----------
    job : with the set-ups that cases were drawn on.
    design : these, with the job's own errors and noise.
    seed, alpha : of the cases, and rate of false alarms that the diagnosis was asked for.
    truth : contents of the sealed file.
    records : what was said of each case, by number.
    judgement : of all.
    """

    job: Job
    design: Design
    seed: int
    alpha: float
    truth: bytes
    records: tuple[Mapping[str, Any], ...]
    judgement: Judgement

    @property
    def sha256(self) -> str:
        """Of the truth."""
        return sha256_of(self.truth)

    @property
    def answers(self) -> bytes:
        """All that was said, a line of JSON a case."""
        return b"".join(canonical(record) for record in self.records)

    @cached_property
    def accepted(self) -> tuple[Accepted, ...]:
        """The figures that the laboratory accepts the method by."""
        return accepted(self.judgement, self.job.facts.prove)

    @cached_property
    def reaches(self) -> tuple[Reach, ...]:
        """What the set-ups show of every effect."""
        return reaches(self.design)

    @cached_property
    def faults(self) -> tuple[FaultReach, ...]:
        """What they show of the artefact's faults."""
        return tuple(fault_reaches(self.design))

    @property
    def conforming(self) -> bool:
        """Whether the cases show of no figure that it is missed."""
        return all(one.standing != MISSED for one in self.accepted)
