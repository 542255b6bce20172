"""Artefacts of several balls, holes or cylinders that keep their places to each other: a plate, a triangle.

All three coordinates of every point are observations, along the artefact's own axes; the six freedoms of each placing are
projected out exactly. That is the same as observing every distance between points with the covariance that follows from
shared points, without having to write that covariance down.
"""

from __future__ import annotations

from abc import abstractmethod

import numpy as np
from numpy.typing import NDArray

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.messages import Text, Verbatim, say
from cmm_uq.base.points import AXES, Floats, Points
from cmm_uq.machine.model.artefact import Artefact, Placings
from cmm_uq.machine.model.recorded import place
from cmm_uq.maths.geometry.feature import nearest_rotations
from cmm_uq.maths.inference.linear_model import Freedoms

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
        self.measurement, self.repeat = points.measurement[self.rows[:, 0]], points.repeat[self.rows[:, 0]]
        self.noise_scale = np.ones(3 * len(points))

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
                where=place(self.points, self.points.measurement == number, where), fix=fix,
            )  # fmt: skip
