"""Positions a known distance apart, by the distance equations of US 4,437,151: a second way to the six factors.

    d² = (1+e1)dX² + 2e2 dXdY + 2e3 dXdZ + (1+e4)dY² + 2e5 dYdZ + (1+e6)dZ²                     (100), (110)

Beside the measurement model: to first order e1, e4 and e6 are twice the scale errors, and e2, e3, e5 the squareness errors XY,
ZX, YZ with the opposite sign. The patent solves normal equations, whose condition number is the square; here they are solved
by an orthogonal factorisation.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.messages import Text, commas, plural, say
from cmm_uq.base.points import Floats
from cmm_uq.base.units import ARCSECOND, MICROMETRE, PPM, unit
from cmm_uq.base.values import dataclass, field
from cmm_uq.certificate.result import AtLeast, as_evaluated
from cmm_uq.machine.physics.effects.rigid_body import SCALE, SQUARENESS
from cmm_uq.maths.uncertainty.type_a import coverage_factor

UNKNOWNS = 6

# effects that the equations give, with their parameters
FACTORS = tuple((effect.name, "ppm") for effect in SCALE.values()) + tuple(
    (effect.name, "angle_arcsec") for effect in SQUARENESS.values()
)

# ratio of singular values of the equations for unit distances below which a factor hangs on set-up and noise
POORLY_POSED = 1e-3

PLACINGS: dict[Text, tuple[int, int, int]] = {
    say("along X"): (1, 0, 0), say("along Y"): (0, 1, 0), say("along Z"): (0, 0, 1),
    say("along a diagonal of X and Y"): (1, 1, 0), say("along the other diagonal of X and Y"): (1, -1, 0),
    say("along a diagonal of Y and Z"): (0, 1, 1), say("along the other diagonal of Y and Z"): (0, 1, -1),
    say("along a diagonal of Z and X"): (1, 0, 1), say("along the other diagonal of Z and X"): (1, 0, -1),
}  # fmt: skip


@dataclass(frozen=True, eq=False)
class DistanceSolution:
    """What the distance equations say of a machine."""

    e: Floats  # (6,) e1 … e6
    covariance: Floats  # (6, 6) of them, from the residuals
    residuals: Floats  # (m,) calibrated distance minus the one that e1 … e6 make of the readings, mm
    residual_sd: float  # mm; 0 without degrees of freedom
    relative_length_u: float = 0.0  # of the distance, where it is certified; 0 where it is taken as known
    # (6,) what the way to the distances makes of the scales, ppm, and squarenesses, ″; it counts as a standard uncertainty
    bias: Floats = field(default_factory=lambda: np.zeros(UNKNOWNS))
    open_scales: bool = False  # whether nothing says the distance, so that scales are not determined

    @property
    def factors(self) -> Floats:
        """(6,) scale errors of X, Y, Z, ppm, and squareness X–Y, Y–Z, Z–X, ″; see :func:`factors_of`."""
        return factors_of(self.e)

    def expanded(self, at_least: AtLeast = as_evaluated) -> tuple[tuple[float, float], ...] | None:
        """U and k of each of the six factors for 95 %; ``None`` where the residuals have no degrees of freedom.

        k is Student's t with the effective degrees of freedom (JCGM 100, G.4).
        """
        freedom, residual = len(self.residuals) - UNKNOWNS, self._u_of_residuals
        if freedom < 1 or not np.all(residual > 0):
            return None
        factors = map(float, coverage_factor(freedom * (self.u / residual) ** 4, 0.95))
        return tuple(
            at_least(f"distance_equations.{effect}.{parameter}", k * u, k, unit("ppm" if parameter == "ppm" else "″"))
            for (effect, parameter), k, u in zip(FACTORS, factors, self.u.tolist(), strict=True)
        )

    def as_data(self, at_least: AtLeast = as_evaluated) -> dict[str, Any]:
        """For results.json: e1 … e6 with their covariance, the six factors and the angles that they give."""
        values, angles = self.factors.tolist(), np.degrees(np.arccos(_cosines(self.e)))
        stated = self.expanded(at_least) or [(None, None)] * UNKNOWNS
        factors = {}
        for (effect, parameter), *figures in zip(
            FACTORS, values, self.u.tolist(), *zip(*stated, strict=True), strict=True
        ):
            open_ = self.open_scales and parameter == "ppm"
            figures = [None] * len(figures) if open_ else figures
            factors[effect] = {parameter: dict(zip(("value", "u", "U", "k"), figures, strict=True))}
        return {
            "e": self.e.tolist(), "e_covariance": self.covariance.tolist(), "factors": factors,
            "angles_deg": dict(zip(SQUARENESS, angles.tolist(), strict=True)),
            "residual_sd_um": self.residual_sd / MICROMETRE,
        }  # fmt: skip

    @property
    def u(self) -> Floats:
        """(6,) standard uncertainties of the three scales, ppm, and the three squarenesses, ″, distance and bias included."""
        of_distance = self.relative_length_u / PPM * np.array([1.0, 1.0, 1.0, 0.0, 0.0, 0.0])
        return np.hypot(np.hypot(self._u_of_residuals, of_distance), self.bias)

    @property
    def _u_of_residuals(self) -> Floats:
        """(6,) of these, from the residuals alone."""
        step = 1e-6
        steps = step * np.eye(UNKNOWNS)
        jacobian = np.column_stack([(factors_of(self.e + d) - factors_of(self.e - d)) / (2 * step) for d in steps])
        return np.asarray(np.sqrt(np.einsum("ij,jk,ik->i", jacobian, self.covariance, jacobian)), dtype=np.float64)


def solve_distances(differences: Floats, distance: float | Floats) -> DistanceSolution:
    """Solve equation 100 for e1 … e6 by least squares.

    ``differences`` (m, 3) readings of one position minus those of the other, mm; ``distance`` the known distance, one
    or (m,), mm.
    """
    differences = np.asarray(differences, dtype=np.float64)
    d = np.broadcast_to(np.asarray(distance, dtype=np.float64), len(differences))
    refuse_poor_placings(differences)
    # divided by 2d, an equation is one of lengths: its noise is that of a length, the same for all
    A = quadratic_terms(differences) / (2 * d)[:, None]
    b = (d**2 - np.sum(differences**2, axis=1)) / (2 * d)
    Q, R = np.linalg.qr(A)
    e = np.asarray(np.linalg.solve(R, Q.T @ b), dtype=np.float64)
    residuals = b - A @ e
    freedom = len(b) - UNKNOWNS
    sd = float(np.sqrt(residuals @ residuals / freedom)) if freedom else 0.0
    inverse = np.linalg.inv(R)
    return DistanceSolution(e, sd**2 * inverse @ inverse.T, residuals, sd)


def quadratic_terms(differences: Floats) -> Floats:
    """Coefficients (m, 6) of e1 … e6 in equation 100."""
    x, y, z = differences.T
    return np.column_stack([x * x, 2 * x * y, 2 * x * z, y * y, 2 * y * z, z * z])


def missing_placings(differences: Floats) -> tuple[Text, ...]:
    """Placings, in words and as few as possible, that determine what these (m, 3) leave open; none when they leave nothing."""
    directions = differences / np.linalg.norm(differences, axis=1, keepdims=True)
    candidates = np.array(list(PLACINGS.values()), dtype=np.float64)
    candidates /= np.linalg.norm(candidates, axis=1, keepdims=True)
    _, s, Vt = np.linalg.svd(quadratic_terms(directions), full_matrices=len(directions) < UNKNOWNS)
    open_space = Vt[np.append(s, np.zeros(UNKNOWNS))[:UNKNOWNS] < POORLY_POSED * s[0]].T
    wanted = []
    while open_space.shape[1]:
        seen = quadratic_terms(candidates) @ open_space
        best = int(np.argmax(np.round(np.linalg.norm(seen, axis=1), 6)))
        wanted.append(list(PLACINGS)[best])
        open_space = open_space @ np.linalg.svd(seen[best : best + 1])[2][1:].T
    return tuple(wanted)


def refuse_poor_placings(differences: Floats) -> None:
    apart = np.linalg.norm(differences, axis=1)
    if np.any(apart == 0):
        raise CmmUqError(
            say("distance {number} is zero: both positions are the same", number=int(np.argmin(apart)) + 1),
            where="recording",
            fix=say("Record two different positions"),
        )
    wanted = missing_placings(differences)
    if not wanted:
        return
    spread, count = np.linalg.svd(differences / apart[:, None], compute_uv=False), len(differences)
    if len(differences) < UNKNOWNS:
        problem = say("{count} distances are too few for the six factors of scale and squareness", count=count)
    elif spread[1] < POORLY_POSED * spread[0]:
        problem = say("all {count} distances are parallel, so they tell the scale in one direction only", count=count)
    elif spread[2] < POORLY_POSED * spread[0]:
        problem = say("all {count} distances lie in one plane, so they tell nothing of the axis across it", count=count)
    else:
        problem = say("the directions of the {count} distances leave a factor of scale or squareness open", count=count)
    one = say("Add {count} set-up: {wanted}", count=len(wanted), wanted=commas(wanted))
    many = say("Add {count} set-ups: {wanted}", count=len(wanted), wanted=commas(wanted))
    raise CmmUqError(problem, where="recording", fix=plural(len(wanted), one=one, many=many))


def _cosines(e: Floats) -> Floats:
    x, y, z = np.sqrt(1 + e[[0, 3, 5]])
    return np.array([e[1] / (x * y), e[4] / (y * z), e[2] / (x * z)])


def factors_of(e: Floats) -> Floats:
    """(6,) of e1 … e6: SE = √(1+e) − 1 (102)–(104), ppm, and what angles between axes (105)–(107) have beyond 90°, ″."""
    scales = (np.sqrt(1 + e[[0, 3, 5]]) - 1) / PPM
    return np.concatenate([scales, (np.arccos(_cosines(e)) - np.pi / 2) / ARCSECOND])
