"""The residuals of a model as a field of vectors in the machine's volume: what each observation shows of it, and no more.

A length between two points shows how far they are apart: half of its residual at either end, along the line. An observation of
one point shows the displacement along its own direction; those of one point together, in as many directions as they have.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import special

from cmm_uq.base.points import Floats, Ints
from cmm_uq.base.units import MICROMETRE
from cmm_uq.machine.model import MeasurementModel
from cmm_uq.machine.model.artefact import Artefact
from cmm_uq.maths.uncertainty.quantity import Quantity

_SEEN = 1e-6


@dataclass(frozen=True, eq=False)
class ResidualField:
    """Residuals where they lie.

    Parameters
    ----------
    place : (q, 3) readings of the scales, mm.
    before, after : (q, 3) µm, indicated minus modelled, by the job's model and by that with what was left out.
    scale : (q,) standard uncertainty of each vector's length, per unit of that of one coordinate.
    dimensions : (q,) in how many directions it is seen.
    lengths : whether they are the two ends of lengths, one after the other.
    """

    place: Floats
    before: Floats
    after: Floats
    scale: Floats
    dimensions: Ints
    lengths: bool

    def expanded(self, noise: Quantity) -> Floats:
        """(q,) length that noise of this standard deviation of a coordinate exceeds in 5 % of cases, in its unit."""
        d, nu = np.maximum(self.dimensions, 1).astype(np.float64), max(noise.degrees_of_freedom, 1.0)
        squares = special.chdtri(d, 0.05) if np.isinf(nu) else d * special.fdtri(d, nu, 0.95)
        return np.asarray(np.sqrt(squares) * self.scale * noise.value, dtype=np.float64)


def residual_field(before: MeasurementModel, after: MeasurementModel) -> ResidualField | None:
    """The residuals of two models of one recording as vectors; ``None`` where an observation is of more than two points."""
    artefact, used = before.artefact, before.used
    rows = artefact.rows[used]
    left = np.column_stack([
        model.residuals(model.estimate().least_squares.value)[used] / MICROMETRE for model in (before, after)
    ])  # fmt: skip
    noise = artefact.noise_scale[used]
    readings = artefact.points.machine_xyz
    if rows.shape[1] == 1:
        return _of_points(rows[:, 0], _directions(artefact, used), left, noise, readings)
    if rows.shape[1] == 2:
        return _of_lengths(rows, left, noise, readings)
    return None


def _directions(artefact: Artefact, used: NDArray[np.bool_]) -> Floats:
    """(m, 3) in which each observation sees its point move."""
    points = artefact.points
    every = np.broadcast_to(np.eye(3), (len(points), 3, 3))
    return artefact.project(points.xyz, every)[used]


def _of_points(point: Ints, directions: Floats, left: Floats, noise: Floats, readings: Floats) -> ResidualField:
    """Shortest vectors that show, along the directions of each point's observations, what these leave."""
    vectors, scale, dimensions, owners = [], [], [], np.unique(point)
    order = np.argsort(point, kind="stable")
    for own in np.split(order, np.flatnonzero(np.diff(point[order])) + 1):
        inverse = np.linalg.pinv(directions[own], rcond=_SEEN)
        vectors.append(inverse @ left[own])
        scale.append(float(noise[own].mean()))
        dimensions.append(int(np.linalg.matrix_rank(directions[own], tol=_SEEN)))
    field = np.array(vectors)
    return ResidualField(
        readings[owners], field[:, :, 0], field[:, :, 1], np.array(scale), np.array(dimensions, dtype=np.int64), False
    )  # fmt: skip


def _of_lengths(rows: Ints, left: Floats, noise: Floats, readings: Floats) -> ResidualField:
    """Half of what each length leaves at either end, away from the other one where it was found too long."""
    ends = readings[rows]
    along = ends[:, 1] - ends[:, 0]
    along = along / np.linalg.norm(along, axis=1, keepdims=True)
    half = 0.5 * left[:, :, None] * along[:, None, :]
    both = np.stack([-half, half], axis=1)  # (m, end, model, 3)
    count = 2 * len(rows)
    return ResidualField(
        ends.reshape(count, 3), both[:, :, 0].reshape(count, 3), both[:, :, 1].reshape(count, 3),
        np.repeat(0.5 * noise, 2), np.ones(count, dtype=np.int64), True,
    )  # fmt: skip
