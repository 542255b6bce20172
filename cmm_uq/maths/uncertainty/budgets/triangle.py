"""Angles of a triangle from its three sides by the cosine rule, with the covariance between them."""

from __future__ import annotations

from typing import Any

import numpy as np

from cmm_uq.base.errors import CmmUqError
from cmm_uq.maths.uncertainty.correlation import Correlations
from cmm_uq.maths.uncertainty.distributions import Distribution
from cmm_uq.maths.uncertainty.measurement_model import MeasurementModel


def triangle_angles(
    a_mm: Distribution, b_mm: Distribution, c_mm: Distribution, correlation: Correlations | None = None
) -> MeasurementModel:
    """Angles alpha, beta, gamma (rad) opposite to the sides a, b, c.

    Parameters
    ----------
    correlation : of sides that share a part, such as the cylinder at a corner: pairs of ``a_mm``, ``b_mm``, ``c_mm``.

    Raises
    ------
    CmmUqError : the sides do not close to a triangle.
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

        return {
            "alpha": opposite(a_mm, b_mm, c_mm),
            "beta": opposite(b_mm, c_mm, a_mm),
            "gamma": opposite(c_mm, a_mm, b_mm),
        }

    inputs = {"a_mm": a_mm, "b_mm": b_mm, "c_mm": c_mm}
    return MeasurementModel(angles, inputs, ("alpha", "beta", "gamma"), correlation or {})
