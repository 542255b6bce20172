"""Artefacts whose placing is projected out exactly: points at one distance from a free centre, and rigid bodies of points.

All three coordinates of every point of a rigid body are observations, along its own axes. That is the same as observing every
distance between points with the covariance that follows from shared points, without having to write that covariance down.
"""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import replace
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.messages import Text, Verbatim, say
from cmm_uq.base.points import AXES, Floats, Points
from cmm_uq.base.units import unit
from cmm_uq.jobs.tables.artefact import ArtefactFacts
from cmm_uq.machine.model.artefact import Artefact, Placings, Size
from cmm_uq.machine.model.recorded import length_of, place
from cmm_uq.machine.physics.effects.own_states import NORMAL
from cmm_uq.maths.geometry.feature import nearest_rotations
from cmm_uq.maths.inference.linear_model import Freedoms

# between a recorded normal and the direction away from the centre; beyond it the normals belong to something else
LARGEST_ANGLE = np.radians(20.0)
LEAST_POINTS = 4  # points that a centre and a distance need, not all in one plane
_FLAT = 1e-3  # extent across a plane over the extent in it below which the side that the centre lies on is a guess


class Radial(Artefact):
    """Points at one distance from a free centre: n observations of n points."""

    per_size: ClassVar[float]  # distance from the centre over the size that the certificate gives (a diameter: ½)
    # size_title, size_what: of that size, with and without whose
    size_title: ClassVar[Text]
    size_what: ClassVar[Text]
    plural: ClassVar[str]  # what is measured, for messages
    outward: float = 1.0  # sense of a normal out of the material along that away from the centre
    # what normals of the wrong sense point into, where right ones point, and what else may be wrong
    normal_words: ClassVar[tuple[str, str, str]] = ("the sphere", "away from the centre", "")

    def __init__(
        self, facts: ArtefactFacts, points: Points, centred: Placings, expansion: Floats, where: str | None
    ) -> None:
        self.points, self.centred, self.expansion = points, centred, expansion
        self.rows = np.arange(len(points))[:, None]
        self._normals: Floats | None = None
        self._refuse_flat(where)
        mean = float(np.mean(self.distances(points.xyz, None) / expansion)) / self.per_size
        length, sd = length_of(facts, mean, self.plural, where)
        self.sizes = (Size("length_mm", self.size_title, unit("mm"), length, sd, self.size_what),)

    def fit(self, true_xyz: Floats, sizes: Floats) -> Floats:
        away = self.away(true_xyz, sizes[0])
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
        away = self.away(xyz, None)
        return np.asarray(away / np.linalg.norm(away, axis=1, keepdims=True), dtype=np.float64)

    def distances(self, xyz: Floats, size: float | None) -> Floats:
        """Distance of every point from its centre, (n,) mm; see :meth:`centres` for ``size``."""
        return np.asarray(np.linalg.norm(self.away(xyz, size), axis=1), dtype=np.float64)

    def away(self, xyz: Floats, size: float | None) -> Floats:
        """Of every point from its centre, (n, 3) mm."""
        return np.asarray(xyz - self.centres(xyz, size)[self.centred.index])

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

    def take_normals(self, where: str | None) -> None:
        """Normals as recorded, brought to unit length: the probe's errors act along them, and so they are seen exactly."""
        if not all(name in self.points.columns for name in NORMAL):
            return
        normals = np.column_stack([self.points.columns[name] for name in NORMAL])
        length = np.linalg.norm(normals, axis=1)
        along = self.outward * np.einsum("ni,ni->n", normals, self.directions(self.points.xyz))
        if np.any(rows := (along < length * np.cos(LARGEST_ANGLE)) | (length == 0)):
            inward, (into, off, else_) = np.all(along < 0), self.normal_words
            problem = f"nx, ny, nz point into {into}" if inward else f"nx, ny, nz does not point {off}"
            fix = "Give the outward normal at each probed point" + (f": turn all signs round{else_}" if inward else "")
            raise CmmUqError(problem, where=place(self.points, rows, where), fix=fix)
        normals = normals / length[:, None]
        columns = {name: normals[:, i] for i, name in enumerate(NORMAL)}
        self._normals, self.points = (
            self.outward * normals,
            replace(self.points, columns={**self.points.columns, **columns}),
        )

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


_ANOTHER_SHAPE = 0.05  # rms misfit over the extent from which on a recording cannot be of this artefact


class Rigid(Artefact):
    """A rigid artefact as recorded: 3n observations (three coordinates of each point in turn) of n points.

    ``placings``: which points stand in one placing.
    """

    # (n, 3) nominal positions about the middle of each placing, in the artefact's axes and at its temperature, mm
    body: Floats

    def __init__(self, points: Points) -> None:
        self.points = points
        self.placings = Placings.of(points.measurement)
        self.rows = np.repeat(np.arange(len(points)), 3)[:, None]

    @abstractmethod
    def shape(self, sizes: Floats) -> Floats:
        """Positions (n, 3) about the middle of each placing for these sizes, in the artefact's axes, mm."""

    def fit(self, true_xyz: Floats, sizes: Floats) -> Floats:
        shape = self.shape(sizes)
        turned = np.einsum("nij,nj->ni", self.attitudes(true_xyz, shape), shape)
        return np.asarray(self.placings.means(true_xyz) + turned, dtype=np.float64)

    def project(self, xyz: Floats, displacement: Floats) -> Floats:
        own = np.einsum("nij,nik->njk", self.attitudes(xyz), displacement)
        return np.asarray(own.reshape(3 * len(xyz), displacement.shape[2]), dtype=np.float64)

    def placing(self, xyz: Floats) -> Freedoms:
        turns = np.cross(np.eye(3)[None, :, :], self.body[:, None, :])
        freedoms = np.concatenate([np.broadcast_to(np.eye(3), turns.shape), turns], axis=1).transpose(0, 2, 1)
        return self.placings.columns(freedoms)

    def attitudes(self, xyz: Floats, shape: Floats | None = None) -> Floats:
        """Rotation (n, 3, 3) from the artefact's axes to the machine's, by least squares in each placing (Kabsch 1976).

        ``xyz``: (n, 3) where the points were found, mm. ``shape``: (n, 3) about the middle of each placing, mm; the nominal
        one by default.
        """
        body = self.body if shape is None else shape
        moment = self.placings.sums(np.einsum("ni,nj->nij", xyz - self.placings.means(xyz), body))
        return np.asarray(nearest_rotations(moment)[self.placings.index], dtype=np.float64)

    def words_of(self, observation: int) -> Text:
        return say(
            "the coordinate along the {title:small}'s {axis} of {what}",
            title=self.title, axis=Verbatim(AXES[observation % 3]), what=super().words_of(observation),
        )  # fmt: skip

    def unread(self) -> NDArray[np.bool_]:
        return self.placings.unread(self.points.xyz, self.attitudes(self.points.xyz)).ravel()

    def deviations(self) -> Floats:
        """Found minus certified position of each point after placing the artefact, (n, 3) mm, in the machine's axes."""
        return self.points.xyz - self.fit(self.points.xyz, np.array([size.nominal for size in self.sizes]))

    def extents(self) -> tuple[Floats, Floats]:
        """Root sum of squares of the nominal and of the found positions about the middle of each placing, (q,) mm."""
        about = self.points.xyz - self.placings.means(self.points.xyz)
        nominal, found = (np.sqrt(self.placings.sums(np.sum(v**2, axis=1))) for v in (self.body, about))
        return nominal, found

    def refuse_another_shape(self, fix: str, where: str | None) -> None:
        misfit = np.sqrt(self.placings.sums(np.sum(self.deviations() ** 2, axis=1))) / self.extents()[0]
        if np.all(misfit > _ANOTHER_SHAPE):
            number = self.placings.numbers[0]
            raise CmmUqError(
                f"the recorded positions do not have the shape of this {self.title.lower()}: in measurement {number} they "
                f"miss it by {100 * misfit[0]:.2g} % of its extent",
                where=place(self.points, self.points.measurement == number, where),
                fix=fix,
            )
