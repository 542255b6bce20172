"""What a certificate leaves open of the places of an artefact: of each distance between two, and of all together.

A certificate states U of every length as a number or a formula of it, or of each place by itself, or with covariances. Without
these nobody knows whether the errors of several lengths have one cause or each their own: figures of several lengths are taken
with either, and the larger uncertainty stands.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cmm_uq.jobs.artefact import ReferencedFacts
from cmm_uq.model.recorded import stated_sd
from cmm_uq.points import AXES, Floats, Ints, Points
from cmm_uq.units import MICROMETRE

_SAME_MM = 1e-6
"""Certified distances closer than this are of one place."""

_LEAST_MM = 1e-12
"""A standard uncertainty that is none."""


@dataclass(frozen=True, eq=False)
class CertifiedPlaces:
    """Places as certified, and how well.

    Parameters
    ----------
    facts : what the job says of the artefact.
    places : (n, j) certified, mm: distances from the first face, or coordinates.
    u : (n, j) standard uncertainty of each by itself, mm; ``None`` where none is stated of single places.
    covariance : (n, n) for each of the j coordinates, mm²; ``None`` where none is stated.
    """

    facts: ReferencedFacts
    places: Floats
    u: Floats | None = None
    covariance: tuple[Floats, ...] | None = None

    @classmethod
    def of(cls, facts: ReferencedFacts, points: Points, places: Floats) -> CertifiedPlaces:
        """Of a recording: by its columns, or by the points of the artefact's digital certificate."""
        count = places.shape[1]
        names = [f"reference_u_{axis}_um" for axis in AXES] if count > 1 else ["reference_u_um"]
        common = points.columns.get("reference_u_um")
        columns = [points.columns.get(name, common) for name in names]
        stated = [column for column in columns if column is not None]
        u = np.column_stack(stated) * MICROMETRE if len(stated) == count else None
        if u is not None and count == 1:
            u = np.where(np.abs(places) <= _SAME_MM, 0.0, u)  # distances count from there
        found = tuple(MICROMETRE**2 * covariance for covariance in facts.covariances_at(points.point))
        return cls(facts, places, u, found if len(found) == count else None)

    @property
    def plain(self) -> bool:
        """Whether a number, or nothing, is stated of all lengths alike."""
        return (
            self.u is None
            and self.covariance is None
            and (self.facts.u_um is None or isinstance(self.facts.u_um, float))
        )

    def u_um(self, sd_mm: float) -> float | None:
        """Standard uncertainty of the longest length, µm, as stated; ``None`` where nothing is.

        Parameters
        ----------
        sd_mm : the same in mm, by what is stated of single places or lengths.
        """
        if not self.plain:
            return sd_mm / MICROMETRE
        return None if self.facts.u_um is None else float(self.facts.u_of(0.0))

    def u_between(self, first: Ints, last: Ints) -> Floats:
        """Standard uncertainty of the certified distance between two places, (m,) mm.

        By the covariance; else the larger of what is stated of such a length and of the places, each independent.
        """
        apart = self.places[last] - self.places[first]
        lengths = np.sqrt(np.sum(apart**2, axis=1))
        along = np.divide(apart, lengths[:, None], out=np.zeros_like(apart), where=lengths[:, None] > 0)
        stated = self.facts.u_of(lengths) * MICROMETRE
        if self.covariance is not None:
            each = [c[first, first] + c[last, last] - 2 * c[first, last] for c in self.covariance]
            own = np.sqrt(np.maximum(np.sum(along**2 * np.column_stack(each), axis=1), 0.0))
            return np.asarray(np.maximum(stated, own), dtype=np.float64)
        if self.u is None:
            return np.asarray(stated, dtype=np.float64)
        own = np.sqrt(np.sum(along**2 * (self.u[first] ** 2 + self.u[last] ** 2), axis=1))
        return np.asarray(np.maximum(stated, own), dtype=np.float64)

    def sd(self, length_mm: float, first: int, last: int) -> float:
        """Standard uncertainty of the artefact's length, mm; infinite where its places are nominal.

        Parameters
        ----------
        length_mm : of the artefact.
        first, last : the places that are farthest apart.
        """
        if self.facts.nominal:
            return float(np.inf)
        if self.plain:
            return stated_sd(self.facts, length_mm)
        found = float(self.u_between(np.array([first]), np.array([last]))[0])
        return max(found, stated_sd(self.facts, length_mm))

    def together(self, about: Floats, sd_mm: float, last: int) -> Floats:
        """Errors of the places, (n, j) mm, for one mm of the error of the longest length, if all have one cause.

        Parameters
        ----------
        about : (n, j) places from where distances count, mm: the first face, or the middle of the balls.
        sd_mm : standard uncertainty of the longest length.
        last : place at its end.
        """
        away = np.linalg.norm(about, axis=1)
        along = np.divide(about, away[:, None], out=np.zeros_like(about), where=away[:, None] > _SAME_MM)
        if self.covariance is not None and about.shape[1] == 1 and sd_mm > 0:
            first = int(np.argmin(away))
            c = self.covariance[0]
            return np.asarray((c[:, last] - c[:, first] - c[first, last] + c[first, first])[:, None] / sd_mm**2)
        ends = 1.0 if about.shape[1] == 1 else 2.0  # of a length through the middle, half belongs to either end
        u = self.facts.u_of(ends * away) * MICROMETRE / ends
        if self.u is not None:
            u = np.maximum(u, np.linalg.norm(along * self.u, axis=1))
        return np.asarray(along * u[:, None] / max(sd_mm, _LEAST_MM), dtype=np.float64)
