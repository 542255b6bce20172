"""Plate: balls or holes at reference positions, placed rigidly and anyhow in each measurement.

All three coordinates of every ball are observations; the six freedoms of each placing are projected out exactly. The
certificate's uncertainty is taken as common to all positions and proportional to them (one scale of the plate). Nominal
positions leave that scale free.
"""

from __future__ import annotations

import numpy as np

from cmm_uq.artefacts.artefact import Artefact, Indications, Size
from cmm_uq.artefacts.placings import Placings
from cmm_uq.artefacts.recorded import certified_sd, check_length, columns_needed, expansion, place
from cmm_uq.errors import CmmUqError
from cmm_uq.jobs.job import ArtefactFacts
from cmm_uq.points import Floats, Points

REFERENCES = ("reference_x_mm", "reference_y_mm", "reference_z_mm")

_ANOTHER_SHAPE = 0.05
"""rms misfit over the plate's extent from which on the recording cannot be of this plate."""


class Plate(Artefact):
    """A plate as recorded: 3n observations (x, y, z of each ball in turn) of n points.

    Parameters
    ----------
    facts : what the job says of the plate; ``u_um`` belongs to ``length_mm``, or to the farthest ball from the first.
    points : the recording, with ``reference_x_mm``, ``reference_y_mm``, ``reference_z_mm``.
    noise_scale : of every coordinate; √2 when the references are themselves one recording.

    Raises
    ------
    CmmUqError : no reference positions, a placing with one ball, or positions that are not those of this plate.
    """

    kind = "plate"
    title = "Plate"

    def __init__(
        self, facts: ArtefactFacts, points: Points, *, where: str | None = None, noise_scale: float = 1.0
    ) -> None:
        self.points = points
        self.reference = columns_needed(points, REFERENCES, self.kind, where)
        self.placings = Placings.of(points.measurement)
        self.expansion = expansion(facts, points)
        self.rows = np.repeat(np.arange(len(points)), 3)[:, None]
        self.measurement, self.repeat = points.measurement[self.rows[:, 0]], points.repeat[self.rows[:, 0]]
        self.noise_scale = np.full(3 * len(points), noise_scale)
        longest = float(np.linalg.norm(self.reference - self.reference[0], axis=1).max())
        length = facts.length_mm or longest
        body = self.reference * self.expansion[:, None]
        self._body = body - self.placings.means(body)
        self.sizes = (Size("length_mm", "Length of the plate", "mm", length, certified_sd(facts)),)
        self._refuse_another_plate(where)

    def fit(self, true_xyz: Floats, sizes: Floats) -> Floats:
        """See :meth:`Artefact.fit`: the plate turned and moved by least squares."""
        body = self._body * (sizes[0] / self.sizes[0].nominal)
        turned = np.einsum("nij,nj->ni", self.attitudes(true_xyz), body)
        return np.asarray(self.placings.means(true_xyz) + turned, dtype=np.float64)

    def project(self, xyz: Floats, displacement: Floats) -> Floats:
        """See :meth:`Artefact.project`: every coordinate, along the plate's own axes."""
        own = np.einsum("nij,nik->njk", self.attitudes(xyz), displacement)
        return np.asarray(own.reshape(-1, displacement.shape[2]), dtype=np.float64)

    def size_change(self) -> Floats:
        """See :meth:`Artefact.size_change`: away from the middle of each placing, in proportion."""
        return self._body.reshape(-1, 1) / self.sizes[0].nominal

    def placing(self, xyz: Floats) -> Floats:
        """See :meth:`Artefact.placing`: three translations and three rotations of each placing."""
        turns = np.cross(np.eye(3)[None, :, :], self._body[:, None, :])
        freedoms = np.concatenate([np.broadcast_to(np.eye(3), turns.shape), turns], axis=1).transpose(0, 2, 1)
        return self.placings.columns(freedoms).reshape(3 * len(xyz), -1)

    def attitudes(self, xyz: Floats) -> Floats:
        """Rotation (n, 3, 3) from the plate's axes to the machine's, by least squares in each placing (Kabsch 1976)."""
        moment = self.placings.sums(np.einsum("ni,nj->nij", xyz - self.placings.means(xyz), self._body))
        U, _, Vt = np.linalg.svd(moment)
        U[:, :, 2] *= np.sign(np.linalg.det(U @ Vt))[:, None]
        return np.asarray((U @ Vt)[self.placings.index], dtype=np.float64)

    def indications(self) -> Indications | None:
        """Distances between every two balls of a (measurement, repeat), against the certified ones."""
        size = self.sizes[0]
        if not size.certified:
            return None
        runs = Placings.of(self.points.group)
        found, certified = [], []
        for run in range(len(runs.numbers)):
            rows = np.flatnonzero(runs.index == run)
            a, b = rows[np.array(np.triu_indices(len(rows), 1))]
            ratio = 0.5 * (self.expansion[a] + self.expansion[b])
            found.append(np.linalg.norm(self.points.xyz[b] - self.points.xyz[a], axis=1) / ratio)
            certified.append(np.linalg.norm(self.reference[b] - self.reference[a], axis=1))
        lengths = np.concatenate(certified)
        return Indications(np.concatenate(found) - lengths, lengths, size.sd * lengths / size.nominal,
                           len(np.unique(np.round(lengths, 1))))  # fmt: skip

    def deviations(self) -> Floats:
        """Found minus certified position of each ball after placing the plate, (n, 3) mm, in the machine's axes."""
        return self.points.xyz - self.fit(self.points.xyz, np.array([self.sizes[0].nominal]))

    def _refuse_another_plate(self, where: str | None) -> None:
        points, placings = self.points, self.placings
        about = points.xyz - placings.means(points.xyz)
        extents = [np.sqrt(placings.sums(np.sum(v**2, axis=1))) for v in (self._body, about)]
        if np.any(lost := (extents[0] == 0) | (extents[1] == 0)):
            number = placings.numbers[np.argmax(lost)]
            raise CmmUqError(
                f"measurement {number} has no two different balls, so it tells no length of the plate",
                where=place(points, points.measurement == number, where),
                fix="Record at least three balls of different reference positions in each measurement, or leave it out",
            )  # fmt: skip
        scale = float(extents[1].sum() / extents[0].sum())
        check_length(scale * self.sizes[0].nominal, self.sizes[0].nominal, "the recorded plates", where)
        misfit = np.sqrt(placings.sums(np.sum(self.deviations() ** 2, axis=1))) / extents[0]
        if np.all(wrong := misfit > _ANOTHER_SHAPE):
            number = placings.numbers[np.argmax(wrong)]
            raise CmmUqError(
                f"the recorded positions do not have the shape that the references say: in measurement {number} they "
                f"miss it by {100 * misfit[0]:.2g} % of its extent",
                where=place(points, points.measurement == number, where),
                fix="Check the numbering of the balls and their reference positions",
            )  # fmt: skip
