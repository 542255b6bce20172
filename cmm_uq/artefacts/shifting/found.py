"""What every analysis of shifted artefacts found, along an axis or in a plane."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Protocol

import numpy as np

from cmm_uq.base.points import Floats
from cmm_uq.base.units import MICROMETRE, unit
from cmm_uq.certificate.result import StatedUncertainty
from cmm_uq.jobs.job import Job
from cmm_uq.maths.inference.draws import Draws, by_ensemble
from cmm_uq.maths.inference.ensembles import Chains
from cmm_uq.maths.uncertainty.correlation import Covariance
from cmm_uq.maths.uncertainty.quantity import Quantity

Reported = Mapping[str, tuple[Floats, str]]
"""Draws (N,) of something that is reported, and its unit, by its name."""


_STILL = 1e-9
"""Part of the largest spread in a list up to which an item does not move but for rounding."""


class Estimated(Protocol):
    """All that the readings say."""

    @property
    def chains(self) -> Chains:
        """Of which the draws were kept."""
        ...

    @property
    def sigma(self) -> Floats:
        """(N,) draws of the standard uncertainty of one reading, mm."""
        ...

    @property
    def residuals(self) -> tuple[Floats, Floats]:
        """What does not fit, mm: with no error of the machine but its scale, and with what was estimated."""
        ...


class Along(Protocol):
    """A curve over the positions of an axis."""

    @property
    def position(self) -> Floats:
        """(m,) mm."""
        ...

    @property
    def expanded(self) -> Floats:
        """(m,) U as evaluated."""
        ...


@dataclass(frozen=True, eq=False)
class ShiftFound(ABC):
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
    @abstractmethod
    def reported(self) -> Reported:
        """Draws of every estimate, by its name in results.json without ``estimates``."""

    @property
    @abstractmethod
    def listed(self) -> Reported:
        """Draws of what results.json has in lists, by its place there, such as ``curves.linearity_x.error_um[3]``."""

    @cached_property
    def covariance(self) -> Covariance:
        """Of every estimate."""
        return Covariance.of_draws(self.reported)

    @cached_property
    def draws(self) -> Draws:
        """The posterior of every estimate, of the noise where it is estimated, and of what is listed.

        What is zero by definition, as a curve at its first position, is left out.
        """
        found = dict(self.reported)
        if self.job.facts.recording.u_coordinate_um is None:
            found["noise.coordinate_um"] = self.estimate.sigma / MICROMETRE, unit("µm")
        found |= self.listed
        chains = self.estimate.chains
        values = np.column_stack([draws for draws, _ in found.values()])
        return Draws(
            {name: unit for name, (_, unit) in found.items()}, by_ensemble(values, chains.steps, len(chains.draws))
        )

    @cached_property
    def stating(self) -> StatedUncertainty:
        """How quantities are stated: not below the laboratory's capability."""
        return StatedUncertainty.of(self.job)

    def stated_along(self, curve: Along, size: float = MICROMETRE, symbol: str = "µm") -> Floats:
        """(m,) U of a curve by position, in its own unit, not below the laboratory's capability of that travel.

        Parameters
        ----------
        curve : where it is zero by definition it stays so.
        size, symbol : unit in which the capability is given.
        """
        capability = self.stating.capability
        if capability is None:
            return curve.expanded
        travelled = np.abs(curve.position - curve.position[0])
        least = size * np.array([capability.least(symbol, float(length)) for length in travelled])
        return np.where(
            curve.expanded > _STILL * curve.expanded.max(), np.maximum(curve.expanded, least), curve.expanded
        )

    @property
    def repeatability(self) -> Quantity:
        """Standard uncertainty of one reading, µm."""
        return Quantity.of_draws(self.estimate.sigma / MICROMETRE, unit("µm"))


def _rms_um(values: Floats) -> float:
    """Root mean square of mm, in µm."""
    return float((values**2).mean() ** 0.5) / MICROMETRE


def listed_draws(place: str, draws: Floats, unit: str) -> Reported:
    """Draws (N, m) of the items of a list of results.json, but those that do not move: they are zero by definition.

    Parameters
    ----------
    place : of the list.
    draws, unit : in that unit.
    """
    spread = np.ptp(draws, axis=0)
    moving = np.flatnonzero(spread > _STILL * spread.max(initial=0.0))
    return {f"{place}[{i}]": (draws[:, i], unit) for i in moving.tolist()}
