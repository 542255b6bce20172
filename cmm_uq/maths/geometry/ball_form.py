"""What the form error of a ball does to its fitted centre: a systematic line of the budget.

A ball that is slightly oblate or prolate does not show its centre to a sensor that sees only one side of it (Harris
2004 appendix A), and more points do not help. The deviation of the surface is radial, so to first order the centre
and the radius move by its least-squares projection on n·δc + δr.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.points import Floats


@dataclass(frozen=True)
class BallForm:
    """A ball whose largest and smallest diameters differ, as an ellipsoid of revolution does.

    Parameters
    ----------
    sphericity : largest less smallest diameter, mm (200 µin, that is 5.08e-3 mm, for a ball of grade 200).
    """

    sphericity: float

    def __post_init__(self) -> None:
        if not (np.isfinite(self.sphericity) and self.sphericity >= 0):
            raise CmmUqError(
                f"a sphericity of {self.sphericity} mm", fix="Give the difference of two diameters, mm, ≥ 0"
            )

    def shift(self, directions: Floats, axis: Floats) -> Floats:
        """(4,) shift of the fitted x, y, z and r, mm, for a ball prolate by the sphericity along ``axis`` (3,).

        The oblate ball gives the opposite.

        Parameters
        ----------
        directions : (n, 3) unit vectors from the centre to the points measured.
        """
        k = axis / np.linalg.norm(axis)
        return np.asarray(_projection(directions) @ (0.5 * self.sphericity * (directions @ k) ** 2))

    def covariance(self, directions: Floats) -> Floats:
        """(4, 4) covariance of the fitted x, y, z and r, mm², when the ball's axis may point anywhere.

        Over all axes k the deviations s/2·((n·k)² − 1/3) at two points are correlated as (s/2)²·(4/45)·P₂(n₁·n₂), P₂
        the Legendre polynomial. What the same form does to the mean radius is left to the calibration of the
        diameter.
        """
        # P₂(n·m) = 3/2 (n·m)² − 1/2, and (n·m)² is a product of the second-order components of n and m
        x, y, z = directions.T
        root2 = np.sqrt(2.0)
        components = np.array([x * x, y * y, z * z, root2 * x * y, root2 * x * z, root2 * y * z])
        P = _projection(directions)
        seconds, mean = P @ components.T, P @ np.ones(len(directions))
        spread = 1.5 * seconds @ seconds.T - 0.5 * np.outer(mean, mean)
        return np.asarray((0.5 * self.sphericity) ** 2 * 4 / 45 * spread)


def _projection(directions: Floats) -> Floats:
    """(4, n) of the least-squares fit of n·δc + δr to radial deviations.

    Raises
    ------
    CmmUqError : the directions do not determine centre and radius.
    """
    if len(directions) < 4 or np.linalg.matrix_rank(np.column_stack([directions, np.ones(len(directions))])) < 4:
        raise CmmUqError("the directions do not determine a sphere", fix="Give at least four, not all in one plane")
    return np.asarray(np.linalg.pinv(np.column_stack([directions, np.ones(len(directions))])))
