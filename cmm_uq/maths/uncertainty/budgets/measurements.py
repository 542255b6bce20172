"""Budgets of measurements: ballbar, triangle, sphere, lengths and temperature.

Harris 2004 (sections 6.2.3 and 6.4.1) adds the digitizer's specification and the rms residual of the sphere fit as
standard uncertainties of a centre, and worst-case scale errors as standard uncertainties of the length. A fit to
thousands of points leaves far less scatter in the centre, limits are not standard uncertainties, and what all positions
share does not average out. :func:`ballbar_length` keeps these apart.

The covariance of a least-squares fit of a sphere is σ²(JᵀJ)⁻¹ and shrinks with the number of points. The form of the ball
does not: seen from the same side it moves the centre in the same way every time. It is a line of its own.

Near 20 °C the product of expansion coefficient and temperature is flat in one or the other, so that first order loses
what second order or Monte Carlo keeps (JCGM 100:2008 H.1.7): evaluate these models with method ``auto``.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import inf, sqrt
from typing import Any

import numpy as np

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.messages import Text, Verbatim, foreign, say
from cmm_uq.base.points import Floats
from cmm_uq.base.units import MICROMETRE, REFERENCE_TEMPERATURE, unit
from cmm_uq.base.values import dataclass, field, replace
from cmm_uq.maths.uncertainty.budget import CERTIFICATE, JUDGEMENT, REPEATS, Budget, BudgetLine, joint_line
from cmm_uq.maths.uncertainty.distributions import Distribution, constant
from cmm_uq.maths.uncertainty.measurement_model import MeasurementModel
from cmm_uq.maths.uncertainty.type_a import Correlations

SPECIFICATION = say("specification")  # where a figure comes from


@dataclass(frozen=True, eq=False)
class BallbarPosition:
    length_mm: float  # distance of the centres
    direction: Floats  # (3,) unit vector along the bar
    centre_covariance_mm2: Floats  # (3, 3) of one fitted centre, from the scatter of its points
    form_shift_mm: float = 0.0  # how far, at most, a ball's form moves its centre along the bar
    probe_mm: float = 0.0  # limits of what the probing system may shift a ball by, systematically
    probe_common: float = 0.0  # correlation of that shift between the balls; one when both are seen the same way
    scale_mm: Sequence[float] = (0.0, 0.0, 0.0)  # (3,) limits of the scale errors of x, y, z over the full length
    u_squareness_rad: Sequence[float] = (0.0, 0.0, 0.0)  # (3,) standard uncertainties of the squarenesses xy, yz, zx
    u_temperature_k: float = 0.0  # of the bar, where its length at 20 °C is asked for
    cte_per_k: float = 0.0  # of the bar
    origins: dict[str, str] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if abs(np.linalg.norm(self.direction) - 1) > 1e-6:
            raise CmmUqError("the bar's direction is no unit vector", fix="Divide it by its length")


def ballbar_length(position: BallbarPosition) -> Budget:
    """Budget of the length from one position, mm.

    A limit a enters as a rectangular distribution, u = a/√3. Along a bar of direction w the scales contribute wᵢ² of
    their error over the full length, the squarenesses wᵢwⱼ of theirs times the length.
    """
    w, length = np.asarray(position.direction), position.length_mm
    scatter = float(w @ position.centre_covariance_mm2 @ w)
    lines = [_line(say("scatter of the points, ball {ball}", ball=ball), sqrt(scatter), REPEATS) for ball in (1, 2)]
    lines += [_limit(say("form of ball {ball}", ball=ball), position.form_shift_mm, CERTIFICATE) for ball in (1, 2)]
    lines += [
        _limit(say("probing system at ball {ball}", ball=ball), position.probe_mm, SPECIFICATION) for ball in (1, 2)
    ]
    if position.probe_mm and position.probe_common:
        # the length is a difference, so what shifts both balls alike cancels
        alike = -2 * position.probe_common * position.probe_mm**2 / 3
        lines.append(replace(joint_line(say("both balls shifted alike by the probing system"), alike), shared=True))
    lines += [
        _limit(say("scale {axis}", axis=Verbatim(axis)), position.scale_mm[k], CERTIFICATE, float(w[k] ** 2))
        for k, axis in enumerate("xyz")
    ]
    for name, (i, j), u in zip(("xy", "yz", "zx"), ((0, 1), (1, 2), (2, 0)), position.u_squareness_rad, strict=True):
        words, slope = say("squareness {name}", name=Verbatim(name)), float(abs(w[i] * w[j])) * length
        lines.append(BudgetLine(words, u, CERTIFICATE, unit=unit("rad"), sensitivity=slope, shared=True))
    words, warm, slope = say("temperature of the bar"), position.u_temperature_k, position.cte_per_k * length
    lines.append(BudgetLine(words, warm, JUDGEMENT, unit=unit("K"), sensitivity=slope, shared=True))
    lines = [replace(line, origin=foreign(position.origins.get(line.name, line.origin))) for line in lines if line.part]
    return Budget(say("length of the ballbar, one position"), lines, length, unit("mm"))


def _line(name: Text, u_mm: float, origin: Text) -> BudgetLine:
    return BudgetLine(name, u_mm, origin, unit=unit("mm"))


def _limit(name: Text, limit_mm: float, origin: Text, sensitivity: float = 1.0) -> BudgetLine:
    u = limit_mm / sqrt(3)
    return BudgetLine(name, u, origin, 0.0, unit("mm"), "rectangular", sensitivity=sensitivity, shared=True)


def _harris_point() -> list[BudgetLine]:
    return [
        _line(say("digitizer point accuracy"), 9 * MICROMETRE, SPECIFICATION),
        _line(say("rms residual of the sphere fit"), 10 * MICROMETRE, say("residuals")),
    ]


def harris_compensated() -> Budget:
    """Harris 2004 section 6.2.3: one length from compensated points, as printed (± 20 µm, 19 before rounding)."""
    centre = Budget(say("centre of a sphere"), _harris_point(), unit=unit("mm"))
    lines = [centre.as_line(say("centre of ball 1")), centre.as_line(say("centre of ball 2"))]
    measurand = say("length of the ballbar, as printed in Harris 2004 section 6.2.3")
    return Budget(measurand, lines, unit=unit("mm"), statement=_PRINTED)


def harris_uncompensated(scale_um: Sequence[float] = (12.0, 18.0, 6.0)) -> Budget:
    """Harris 2004 section 6.4.1: one length from uncompensated points, as printed.

    ``scale_um``: (3,) largest scale errors of x, y, z; those of 20 °C, or (21, 30, 12) at 25 °C and (26, 38, 20) at 30 °C.
    """
    scales = [
        _line(say("largest scale error of {axis}", axis=Verbatim(axis)), limit * MICROMETRE, say("error map"))
        for axis, limit in zip("xyz", scale_um, strict=True)
    ]
    measurand = say("length of the ballbar, as printed in Harris 2004 section 6.4.1")
    return Budget(measurand, [*_harris_point(), *scales], unit=unit("mm"), statement=_PRINTED)


_PRINTED = say(
    "As printed. It takes a specification and largest errors for standard uncertainties, the rms residual of a fit to "
    "thousands of points for the uncertainty of its centre, counts one ball of the two in section 6.4.1, and divides what "
    "all positions share by the root of their number."
)


def triangle_angles(
    a_mm: Distribution, b_mm: Distribution, c_mm: Distribution, correlation: Correlations | None = None
) -> MeasurementModel:
    """Angles alpha, beta, gamma (rad) opposite to the sides a, b, c.

    ``correlation``: of sides that share a part, such as the cylinder at a corner: pairs of ``a_mm``, ``b_mm``, ``c_mm``.
    """
    longest, *others = sorted((np.asarray(side.mean) for side in (a_mm, b_mm, c_mm)), key=np.max, reverse=True)
    if np.any(longest >= others[0] + others[1]):
        raise CmmUqError(
            f"sides of {np.max(longest):g} mm and {np.max(others[0]):g} + {np.max(others[1]):g} mm close to no triangle",
            fix="Check which side is which",
        )

    def angles(a_mm: Any, b_mm: Any, c_mm: Any) -> dict[str, Any]:
        def opposite(side: Any, p: Any, q: Any) -> Any:
            return np.arccos((p * p + q * q - side * side) / (2.0 * p * q))

        sides = {"alpha": (a_mm, b_mm, c_mm), "beta": (b_mm, c_mm, a_mm), "gamma": (c_mm, a_mm, b_mm)}
        return {name: opposite(*of) for name, of in sides.items()}

    inputs = {"a_mm": a_mm, "b_mm": b_mm, "c_mm": c_mm}
    return MeasurementModel(angles, inputs, ("alpha", "beta", "gamma"), correlation or {})


PARAMETERS = ("x", "y", "z", "radius")


def sphere_covariance(directions: Floats, u_point_mm: float) -> Floats:
    """Covariance (4, 4) of centre and radius from points in the given directions, mm².

    ``directions``: (n, 3) unit vectors from the centre to the points, n ≥ 4. ``u_point_mm``: standard uncertainty of one
    point along its direction, mm.
    """
    jacobian = -np.column_stack([directions, np.ones(len(directions))])
    singular = np.linalg.svd(jacobian, compute_uv=False)
    if len(directions) < 4 or singular[-1] < 1e-9 * singular[0]:
        raise CmmUqError("the points do not determine a sphere", fix="Probe four or more that are not on one circle")
    _, r = np.linalg.qr(jacobian)
    inverse = np.linalg.inv(r)
    return np.asarray(u_point_mm**2 * inverse @ inverse.T)


def sphere_budgets(
    estimate_mm: Sequence[float] | Floats, covariance_mm2: Floats, form_shift_mm: Sequence[float] | Floats, *,
    dof: float = inf, form_origin: Text = say("certificate of the ball"), further: Sequence[BudgetLine] = (),
) -> dict[str, Budget]:  # fmt: skip
    """Budgets of x, y, z and radius.

    ``estimate_mm``: (4,) centre and radius. ``covariance_mm2``: (4, 4) of the fit. ``form_shift_mm``: (4,) how far, at most,
    the form of the ball can move each of them. ``dof``: degrees of freedom of the covariance (points minus four where σ
    comes from the residuals).
    """
    budgets = {}
    for k, name in enumerate(PARAMETERS):
        variance = float(np.asarray(covariance_mm2)[k, k])
        if not variance > 0:
            raise CmmUqError(f"a variance of {variance} mm² of {name}", fix="Give the covariance matrix of the fit")
        lines = [BudgetLine(say("scatter of the points"), sqrt(variance), REPEATS, unit=unit("mm"), dof=dof)]
        if shift := float(form_shift_mm[k]):
            u = shift / sqrt(3)
            lines.append(BudgetLine(say("form of the ball"), u, form_origin, 0.0, unit("mm"), "rectangular"))
        budgets[name] = Budget(Verbatim(name), [*lines, *further], float(estimate_mm[k]), unit("mm"))
    return budgets


UNITS: Mapping[str, str] = {
    **dict.fromkeys(("indicated_mm", "reference_mm", "length"), "mm"),
    **dict.fromkeys(("workpiece_c", "scale_c"), "degC"),
    **dict.fromkeys(("workpiece_cte_per_k", "scale_cte_per_k"), "1/K"),
    "scale_error": "1",
}


def _stretch(cte_per_k: Any, temperature_c: Any) -> Any:
    return 1.0 + cte_per_k * (temperature_c - REFERENCE_TEMPERATURE)


def length_at_20(
    indicated_mm: Distribution, workpiece_c: Distribution, workpiece_cte_per_k: Distribution,
    scale_c: Distribution | None = None, scale_cte_per_k: Distribution | None = None,
    correlation: Correlations | None = None,
) -> MeasurementModel:  # fmt: skip
    """Length at 20 °C (ISO 1) of a workpiece measured warm by a scale that may be warm too.

    ``correlation``: such as that of the two temperatures, which one thermometer may have measured.
    """
    names = ("indicated_mm", "workpiece_c", "workpiece_cte_per_k", "scale_c", "scale_cte_per_k")
    scale = scale_c or constant(REFERENCE_TEMPERATURE), scale_cte_per_k or constant(0.0)
    inputs = dict(zip(names, (indicated_mm, workpiece_c, workpiece_cte_per_k, *scale), strict=True))

    def length(**q: Any) -> Any:
        stretched = q["indicated_mm"] * _stretch(q["scale_cte_per_k"], q["scale_c"])
        return stretched / _stretch(q["workpiece_cte_per_k"], q["workpiece_c"])

    return MeasurementModel(length, inputs, ("length",), correlation or {})


def scale_error(
    indicated_mm: Distribution, reference_mm: Distribution, workpiece_c: Distribution,
    workpiece_cte_per_k: Distribution, correlation: Correlations | None = None,
) -> MeasurementModel:  # fmt: skip
    """Relative scale error s, true = indicated · (1 + s), from a reference length calibrated at 20 °C."""
    names = ("indicated_mm", "reference_mm", "workpiece_c", "workpiece_cte_per_k")
    inputs = dict(zip(names, (indicated_mm, reference_mm, workpiece_c, workpiece_cte_per_k), strict=True))

    def error(**q: Any) -> Any:
        return q["reference_mm"] * _stretch(q["workpiece_cte_per_k"], q["workpiece_c"]) / q["indicated_mm"] - 1.0

    return MeasurementModel(error, inputs, ("scale_error",), correlation or {})
