"""What every analysis of shifted artefacts found, along an axis or in a plane."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Protocol

from cmm_uq.jobs.job import Job
from cmm_uq.points import Floats
from cmm_uq.uncertainty.quantity import Quantity
from cmm_uq.units import MICROMETRE


class Estimated(Protocol):
    """All that the readings say."""

    @property
    def sigma(self) -> Floats:
        """(N,) draws of the standard uncertainty of one reading, mm."""
        ...

    @property
    def residuals(self) -> tuple[Floats, Floats]:
        """What does not fit, mm: with no error of the machine but its scale, and with what was estimated."""
        ...


@dataclass(frozen=True, eq=False)
class ShiftFound:
    """What was found.

    Parameters
    ----------
    job : what was analysed.
    estimate : of the machine and the artefact, with its posterior.
    """

    job: Job
    estimate: Estimated

    @cached_property
    def disagreement_um(self) -> tuple[float, float]:
        """Root mean square of what the placings disagree by, without and with the machine's errors, µm."""
        without, with_errors = (_rms_um(values) for values in self.estimate.residuals)
        return without, with_errors

    @property
    def repeatability(self) -> Quantity:
        """Standard uncertainty of one reading, µm."""
        return Quantity.of_draws(self.estimate.sigma / MICROMETRE, "µm")


def _rms_um(values: Floats) -> float:
    """Root mean square of mm, in µm."""
    return float((values**2).mean() ** 0.5) / MICROMETRE
