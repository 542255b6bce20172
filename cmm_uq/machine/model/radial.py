"""Artefacts whose points lie at one distance from a centre that nobody measures: a sphere, a swept bar.

The observation is the distance from the centre; the centre is free, and its three freedoms are projected out exactly.
"""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.messages import Text
from cmm_uq.base.points import Floats, Points
from cmm_uq.base.units import unit
from cmm_uq.jobs.tables.artefact import ArtefactFacts
from cmm_uq.machine.model.artefact import Artefact, Placings, Size
from cmm_uq.machine.model.recorded import check_length, place, stated_sd
from cmm_uq.maths.inference.linear_model import Freedoms

LEAST_POINTS = 4  # points that a centre and a distance need, not all in one plane
_FLAT = 1e-3  # extent across a plane over the extent in it below which the side that the centre lies on is a guess


class Radial(Artefact):
    """Points at one distance from a free centre: n observations of n points."""

    per_size: ClassVar[float]  # distance from the centre over the size that the certificate gives (a diameter: ½)
    # size_title, size_what: of that size, with and without whose
    size_title: ClassVar[Text]
    size_what: ClassVar[Text]
    plural: ClassVar[str]  # what is measured, for messages

    def __init__(
        self, facts: ArtefactFacts, points: Points, centred: Placings, expansion: Floats, where: str | None
    ) -> None:
        self.points = points
        self.centred = centred
        self.expansion = expansion
        self.measurement, self.repeat = points.measurement, points.repeat
        self.rows = np.arange(len(points))[:, None]
        self.noise_scale = np.ones(len(points))
        self._normals: Floats | None = None
        self._refuse_flat(where)
        mean = float(np.mean(self.distances(points.xyz, None) / expansion)) / self.per_size
        if facts.length_mm is None:
            self.sizes = (Size("length_mm", self.size_title, unit("mm"), mean, np.inf, self.size_what),)
        else:
            check_length(mean, facts.length_mm, self.plural, where)
            self.sizes = (
                Size(
                    "length_mm",
                    self.size_title,
                    unit("mm"),
                    facts.length_mm,
                    stated_sd(facts, facts.length_mm),
                    self.size_what,
                ),
            )

    def fit(self, true_xyz: Floats, sizes: Floats) -> Floats:
        away = true_xyz - self.centres(true_xyz, sizes[0])[self.centred.index]
        squares = np.einsum("ni,ni->n", away, away)
        directions = away / np.sqrt(squares)[:, None] if self._normals is None else self._normals
        along = np.einsum("ni,ni->n", away, directions)
        missing = self._radii(sizes[0]) ** 2 - squares
        step = missing / (along + np.sqrt(np.maximum(along**2 + missing, 0.0)))
        return np.asarray(true_xyz + step[:, None] * directions, dtype=np.float64)

    def project(self, xyz: Floats, displacement: Floats) -> Floats:
        return np.asarray(np.einsum("ni,nik->nk", self.directions(xyz), displacement), dtype=np.float64)

    def size_change(self) -> Floats:
        return np.asarray(self.per_size * self.expansion[:, None], dtype=np.float64)

    def placing(self, xyz: Floats) -> Freedoms:
        return self.centred.columns(self.directions(xyz))

    def directions(self, xyz: Floats) -> Floats:
        """Outward unit normals, (n, 3): as recorded, or from the centre."""
        if self._normals is not None:
            return self._normals
        away = xyz - self.centres(xyz, None)[self.centred.index]
        return np.asarray(away / np.linalg.norm(away, axis=1, keepdims=True), dtype=np.float64)

    def distances(self, xyz: Floats, size: float | None) -> Floats:
        """Distance of every point from its centre, (n,) mm; see :meth:`centres` for ``size``."""
        away = xyz - self.centres(xyz, size)[self.centred.index]
        return np.asarray(np.linalg.norm(away, axis=1), dtype=np.float64)

    def centres(self, xyz: Floats, size: float | None) -> Floats:
        """Centres (q, 3), mm, of the points (n, 3) nearest to the distance that ``size`` says.

        Without a size, from |p|² = 2c·p + r² − |c|², which is linear in centre and radius and exact for exact points.
        """
        centred = self.centred
        about = xyz - centred.means(xyz)
        squares = np.einsum("ni,ni->n", about, about)
        spread = centred.sums(np.einsum("ni,nj->nij", about, about))
        moment = centred.sums(0.5 * squares[:, None] * about)
        offset = np.asarray(np.linalg.solve(spread, moment[:, :, None])[:, :, 0], dtype=np.float64)
        if size is not None:
            offset = self._nearer(about, offset, self._radii(size))
        return np.asarray(offset + centred.sums(xyz) / centred.sizes[:, None], dtype=np.float64)

    def _nearer(self, about: Floats, offset: Floats, radii: Floats) -> Floats:
        """Gauss–Newton on the distances from the centre, all centres at once."""
        for _ in range(20):
            away = about - offset[self.centred.index]
            distance = np.linalg.norm(away, axis=1)
            directions = away / distance[:, None]
            normal = self.centred.sums(np.einsum("ni,nj->nij", directions, directions))
            right = self.centred.sums((distance - radii)[:, None] * directions)
            step = np.linalg.solve(normal, right[:, :, None])[:, :, 0]
            offset = offset + step
            if np.abs(step).max(initial=0.0) < 1e-12 * radii.max():
                break
        return offset

    def _radii(self, size: float) -> Floats:
        return np.asarray(self.per_size * size * self.expansion, dtype=np.float64)

    def _refuse_flat(self, where: str | None) -> None:
        centred = self.centred
        about = self.points.xyz - centred.means(self.points.xyz)
        extents = np.linalg.eigvalsh(centred.sums(np.einsum("ni,nj->nij", about, about)))
        flat = (centred.sizes < LEAST_POINTS) | (extents[:, 0] <= _FLAT**2 * extents[:, 2])
        if not flat.any():
            return
        which = int(np.argmax(flat))
        rows = centred.index == which
        count = int(centred.sizes[which])
        whose = f"measurement {self.points.measurement[np.argmax(rows)]}" if len(flat) > 1 else "the recording"
        told = f"{whose}: {count} points"
        if count < LEAST_POINTS:
            raise CmmUqError(f"{told} are too few for a centre and a distance", where=place(self.points, rows, where),
                             fix=f"Record at least {LEAST_POINTS}")  # fmt: skip
        raise CmmUqError(f"{told} lie in one plane, so it stays open on which side of it the centre lies",
                         where=place(self.points, rows, where), fix="Record points out of that plane too")  # fmt: skip
