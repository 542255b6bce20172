"""Centre and radius of a fitted sphere: what the scatter of the points leaves open, and what the ball's form adds.

The covariance of a least-squares fit is σ²(JᵀJ)⁻¹ and shrinks with the number of points. The form of the ball does not:
seen from the same side it moves the centre in the same way every time. It is a line of its own.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import inf, sqrt

import numpy as np

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.messages import Text, Verbatim, say
from cmm_uq.base.points import Floats
from cmm_uq.base.units import unit
from cmm_uq.maths.uncertainty.budget import REPEATS, Budget, Line

PARAMETERS = ("x", "y", "z", "radius")


def sphere_covariance(directions: Floats, u_point_mm: float) -> Floats:
    """Covariance (4, 4) of centre and radius from points in the given directions, mm².

    Parameters
    ----------
    directions : (n, 3) unit vectors from the centre to the points, n ≥ 4.
    u_point_mm : standard uncertainty of one point along its direction, mm.

    Raises
    ------
    CmmUqError : the points do not determine a sphere (fewer than four, or all on one circle).
    """
    jacobian = -np.column_stack([directions, np.ones(len(directions))])
    singular = np.linalg.svd(jacobian, compute_uv=False)
    if len(directions) < 4 or singular[-1] < 1e-9 * singular[0]:
        raise CmmUqError("the points do not determine a sphere", fix="Probe four or more that are not on one circle")
    _, r = np.linalg.qr(jacobian)
    inverse = np.linalg.inv(r)
    return np.asarray(u_point_mm**2 * inverse @ inverse.T)


def sphere_budgets(
    estimate_mm: Sequence[float] | Floats,
    covariance_mm2: Floats,
    form_shift_mm: Sequence[float] | Floats,
    *,
    dof: float = inf,
    form_origin: Text = say("certificate of the ball"),
    further: Sequence[Line] = (),
) -> dict[str, Budget]:
    """Budgets of x, y, z and radius.

    Parameters
    ----------
    estimate_mm : (4,) centre and radius.
    covariance_mm2 : (4, 4) of the fit.
    form_shift_mm : (4,) how far, at most, the form of the ball can move each of them.
    dof : degrees of freedom of the covariance (points minus four where σ comes from the residuals).
    further : lines that all four share, such as a probe or a scale.
    """
    budgets = {}
    for k, name in enumerate(PARAMETERS):
        variance = float(np.asarray(covariance_mm2)[k, k])
        if not variance > 0:
            raise CmmUqError(f"a variance of {variance} mm² of {name}", fix="Give the covariance matrix of the fit")
        lines = [Line(say("scatter of the points"), sqrt(variance), REPEATS, unit=unit("mm"), dof=dof)]
        shift = float(form_shift_mm[k])
        if shift:
            lines.append(Line(say("form of the ball"), shift / sqrt(3), form_origin, 0.0, unit("mm"), "rectangular"))
        budgets[name] = Budget(Verbatim(name), [*lines, *further], float(estimate_mm[k]), unit("mm"))
    return budgets
