"""What a certificate leaves open of the places of an artefact: of each distance between two, and of all together.

A certificate states U of every length as a number or a formula of it, or of each place by itself, or with covariances. Without
these nobody knows whether the errors of several lengths have one cause or each their own: figures of several lengths are taken
with either, and the larger uncertainty stands.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from cmm_uq.base.messages import say
from cmm_uq.base.points import AXES, Floats, Ints, Points
from cmm_uq.base.units import MICROMETRE
from cmm_uq.jobs.tables.artefact import ReferencedFacts
from cmm_uq.machine.model.artefact import Size
from cmm_uq.machine.model.recorded import stated_sd
from cmm_uq.maths.inference.doubt import Cause
from cmm_uq.maths.inference.linear_model import Freedoms

CALIBRATION = say("calibration of the artefact")  # name of this cause
_SAME_MM = 1e-6  # certified distances closer than this are of one place
_LEAST_MM = 1e-12  # A standard uncertainty that is none


@dataclass(frozen=True, eq=False)
class CertifiedPlaces:
    """Places as certified, and how well."""

    facts: ReferencedFacts  # what the job says of the artefact
    places: Floats  # (n, j) certified, mm: distances from the first face, or coordinates
    # (n, j) standard uncertainty of each by itself, mm; ``None`` where none is stated of single places
    u: Floats | None = None
    # (f, f) of all certified places for each of the j coordinates, mm²; ``None`` where none is stated
    covariance: tuple[Floats, ...] | None = None
    index: Ints = field(default_factory=lambda: np.zeros(0, dtype=np.int64))  # (n,) which of these each place is

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
        rows, covariances = facts.covariances_at(points.point)
        if len(covariances) != count:
            return cls(facts.of_other_points if u is None else facts, places, u)
        return cls(facts, places, u, tuple(MICROMETRE**2 * covariance for covariance in covariances), rows)

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

        ``sd_mm``: the same in mm, by what is stated of single places or lengths.
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
            a, b = self.index[first], self.index[last]
            each = [c[a, a] + c[b, b] - 2 * c[a, b] for c in self.covariance]
            own = np.sqrt(np.maximum(np.sum(along**2 * np.column_stack(each), axis=1), 0.0))
            return np.asarray(np.maximum(stated, own), dtype=np.float64)
        if self.u is None:
            return np.asarray(stated, dtype=np.float64)
        own = np.sqrt(np.sum(along**2 * (self.u[first] ** 2 + self.u[last] ** 2), axis=1))
        return np.asarray(np.maximum(stated, own), dtype=np.float64)

    def sd(self, length_mm: float, first: int, last: int) -> float:
        """Standard uncertainty of the artefact's length, mm; infinite where its places are nominal."""
        if self.facts.nominal:
            return float(np.inf)
        if self.plain:
            return stated_sd(self.facts, length_mm)
        found = float(self.u_between(np.array([first]), np.array([last]))[0])
        return max(found, stated_sd(self.facts, length_mm))

    def together(self, about: Floats, sd_mm: float, first: int, last: int) -> Floats:
        """Errors of the places, (n, j) mm, for one mm of the error of the longest length, if all have one cause.

        With a covariance those that go with that error; what it has beside them is in :meth:`beyond`.

        ``about``: (n, j) places from where distances count, mm: the first face, or the middle of the balls.
        """
        if self.covariance is not None:
            return self._with_the_longest(sd_mm, first, last)[self.index]
        away = np.linalg.norm(about, axis=1)
        along = np.divide(about, away[:, None], out=np.zeros_like(about), where=away[:, None] > _SAME_MM)
        ends = 1.0 if about.shape[1] == 1 else 2.0  # of a length through the middle, half belongs to either end
        u = self.facts.u_of(ends * away) * MICROMETRE / ends
        if self.u is not None:
            u = np.maximum(u, np.linalg.norm(along * self.u, axis=1))
        return np.asarray(along * u[:, None] / max(sd_mm, _LEAST_MM), dtype=np.float64)

    def beyond(self, size: Size, first: int, last: int, change: Floats, expansion: Floats) -> Cause | None:
        """What the certificate leaves open of the places beyond one common error; ``None`` where nothing is stated.

        ``change``: (n·j,) of the observations for one mm of that length. ``expansion``: (n,) size of the artefact at each
        place over that at 20 °C.
        """
        if not size.certified or size.sd <= 0:
            return None
        count = self.places.shape[1]
        if self.covariance is not None:
            known = self._with_the_longest(size.sd, first, last).ravel() * size.sd
            whole = np.zeros((len(known), len(known)))
            for axis, covariance in enumerate(self.covariance):
                whole[axis::count, axis::count] = covariance
            values, vectors = np.linalg.eigh(whole - np.outer(known, known))
            root = (vectors * np.sqrt(np.maximum(values, 0.0))).reshape(-1, count, len(known))[self.index]
            return Cause(CALIBRATION, (root * expansion[:, None, None]).reshape(-1, len(known)))
        u = self._each_its_own() * expansion[:, None]
        columns = (u[:, :, None] * np.eye(count)).reshape(-1, count)
        _, place = np.unique(np.round(self.places / _SAME_MM), axis=0, return_inverse=True)
        index = np.repeat(place.ravel(), count)
        own = Freedoms(columns, index, int(index.max()) + 1)
        return Cause(CALIBRATION, np.zeros((len(columns), 1)), own, change * size.sd)

    def _each_its_own(self) -> Floats:
        """Standard uncertainty of each coordinate, (n, j) mm, if none has to do with another."""
        if self.places.shape[1] == 1:
            away = np.abs(self.places)
            stated = np.where(away > _SAME_MM, self.facts.u_of(away) * MICROMETRE, 0.0)
        else:
            there = np.unique(self.places, axis=0)
            farthest = np.array([np.linalg.norm(there - place, axis=1).max() for place in self.places])
            stated = np.repeat(
                self.facts.u_of(farthest)[:, None] * MICROMETRE / np.sqrt(2.0), self.places.shape[1], axis=1
            )
        return np.asarray(stated if self.u is None else np.maximum(stated, self.u), dtype=np.float64)

    def _with_the_longest(self, sd_mm: float, first: int, last: int) -> Floats:
        """Covariance of all certified places with the longest length, over its variance, (f, j)."""
        along = self.places[last] - self.places[first]
        along = along / np.linalg.norm(along)
        a, b = self.index[first], self.index[last]
        columns = [part * (c[:, b] - c[:, a]) for part, c in zip(along, self.covariance or (), strict=True)]
        return np.asarray(np.column_stack(columns) / max(sd_mm, _LEAST_MM) ** 2, dtype=np.float64)
