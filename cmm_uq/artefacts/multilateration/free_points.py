"""Targets that four stations see, found from their distances alone: no error model, no coordinates but as a first guess.

Of a frame nothing is known: what a common motion of targets and stations would be, and without a stated scale a common growth
too, is taken to be none (least squares with inner constraints; Hughes et al. 2000).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cmm_uq.artefacts.multilateration.artefact import Multilateration
from cmm_uq.base.messages import Text, say
from cmm_uq.base.points import Floats, Ints
from cmm_uq.base.units import METRE, MICROMETRE
from cmm_uq.machine.physics.effects.rigid_body import tip_offsets
from cmm_uq.maths.uncertainty.type_a import coverage_factor

STATIONS, MOST = 4, 250  # that a target needs; targets that are solved
_SAME_MM, _SETTLED, _ROUNDS, _SINGULAR = 0.5, 1e-9, 6, 1e-7


@dataclass(frozen=True, eq=False)
class FreePoints:
    point: Ints  # (t,) numbers of the targets
    errors: Floats  # (t, 3) true minus indicated, mm, but for a motion of all
    covariance: Floats  # (3t, 3t) mm², of the readings' noise and of the scale as stated
    rows: tuple[Ints, ...]  # readings of each
    residual_sd: float  # mm
    degrees_of_freedom: int
    gauge: Floats  # (3t, 6 or 7) what is taken to be none, orthonormal

    @property
    def factor(self) -> float:
        """Coverage factor for 95 %: Student's t of the residuals."""
        return float(coverage_factor(self.degrees_of_freedom, 0.95))

    @property
    def expanded(self) -> Floats:
        """U (t, 3), mm."""
        return np.asarray(self.factor * np.sqrt(np.diag(self.covariance)).reshape(-1, 3))

    def without_motion(self, errors: Floats) -> Floats:
        """Errors (t, 3) of these targets but for a motion, as the readings have them."""
        flat = errors.ravel()
        return np.asarray((flat - self.gauge @ (self.gauge.T @ flat)).reshape(-1, 3))


def free_points(
    artefact: Multilateration, u_scale_um_per_m: float | None, used: NDArray[np.bool_] | None = None
) -> FreePoints | Text:
    """The targets, or why they cannot be found so; of readings (n,) that are used, by default all."""
    targets = _targets(artefact, np.ones(len(artefact.rows), dtype=bool) if used is None else used)
    if not targets:
        return say("No target was read from {count} stations.", count=STATIONS)
    count, rows = len(targets), np.concatenate(targets)
    of, station = np.repeat(np.arange(count), [len(each) for each in targets]), artefact.stations.index[rows]
    xyz, drift = artefact.points.xyz[rows], artefact.drift[rows]
    stations, own = np.unique(station, return_inverse=True)
    j, q = artefact.found.shape[1], len(stations)
    mean = np.array([artefact.points.xyz[each].mean(axis=0) for each in targets])
    gauge = _motions(mean, scale=u_scale_um_per_m is None)
    error, places, m = np.zeros((count, 3)), artefact.found[stations] * ([1, 1, 1] + [0] * (j - 3)), len(rows)
    for _ in range(_ROUNDS):
        away = xyz + error[of] - places[own, :3]
        distance = np.linalg.norm(away, axis=1)
        off = artefact.distances[rows] + places[own, 3] + np.sum(drift * places[own, 4:], axis=1) - distance
        beam, design = away / distance[:, None], np.zeros((m, 3 * count + j * q))
        for k in range(3):
            design[np.arange(m), 3 * of + k] = beam[:, k]
        for k, column in enumerate(np.column_stack([-beam, -np.ones(m), -drift]).T):
            design[np.arange(m), 3 * count + j * own + k] = column
        whole = np.vstack([design, np.hstack([gauge.T, np.zeros((gauge.shape[1], j * q))])])
        freedom = m + gauge.shape[1] - whole.shape[1]
        U, s, Vt = np.linalg.svd(whole, full_matrices=False)
        if freedom < 1 or s[-1] < _SINGULAR * s[0]:
            return say("{count} targets and {stations} stations do not determine each other.", count=count, stations=q)
        inverse = (Vt.T / s) @ U[:m].T
        step = inverse @ off
        error, places = error + step[: 3 * count].reshape(-1, 3), places + step[3 * count :].reshape(-1, j)
        if np.abs(step).max() < _SETTLED:
            break
    sd = float(np.sqrt(np.sum((off - design @ step) ** 2) / freedom))
    covariance = sd**2 * inverse[: 3 * count] @ inverse[: 3 * count].T
    if u_scale_um_per_m is not None:
        growth = (MICROMETRE / METRE * u_scale_um_per_m * (mean - mean.mean(axis=0))).ravel()
        covariance += np.outer(growth, growth)
    numbers = artefact.points.point[[each[0] for each in targets]]
    return FreePoints(numbers, error, covariance, tuple(targets), sd, freedom, gauge)


def _targets(artefact: Multilateration, used: NDArray[np.bool_]) -> list[Ints]:
    """Readings of each target that enough stations read with one reflector at one place, evenly chosen where they are many."""
    points = artefact.points
    key = np.column_stack([points.point, tip_offsets(points).round(3)])
    index = np.unique(key, axis=0, return_inverse=True)[1].ravel()
    found = [np.flatnonzero((index == i) & used) for i in range(index.max() + 1)]
    seen = [
        rows
        for rows in found
        if len(np.unique(points.measurement[rows])) >= STATIONS and np.ptp(points.xyz[rows], axis=0).max() < _SAME_MM
    ]
    return [seen[i] for i in np.unique(np.linspace(0, len(seen) - 1, min(MOST, len(seen))).round().astype(int))]


def _motions(xyz: Floats, *, scale: bool) -> Floats:
    """Orthonormal columns (3t, 6 or 7) of what a motion, and a growth, does to places (t, 3)."""
    about = xyz - xyz.mean(axis=0)
    columns = [*(np.tile(axis, (len(xyz), 1)) for axis in np.eye(3)), *(np.cross(axis, about) for axis in np.eye(3))]
    columns += [about] if scale else []
    return np.asarray(np.linalg.qr(np.column_stack([column.ravel() for column in columns]))[0])
