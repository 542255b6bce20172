"""What a fitted robot leaves at each pose: more where its joints reach far, and with tails, for no two poses are alike.

All coordinates of a pose share one scale. Its square is normal noise times what the joints reach, and a factor of the pose's
own: multivariate t (Lange, Little, Taylor, J. Am. Stat. Assoc. 84 (1989) 881),

    residual ~ t_ν(0, s²·I),   s² = σ²·(1 − a + a·r²/mean r²),   r² = Σ |joint axis × (tool − joint)|²

so that a is the part, at the mean reach, of an angular scatter of the joints. Flat priors: a from 0 to 1, 1/ν from 0 to 0.45;
the likeliest values are taken.
"""

from __future__ import annotations

import numpy as np
from scipy.optimize import minimize
from scipy.special import gammaln

from cmm_uq.base.arm import THETA, Arm
from cmm_uq.base.points import Floats, Points
from cmm_uq.base.values import dataclass

_LEAST, _MOST = 1e-4, 0.45  # of 1/ν
_START = (0.3, 0.1)


@dataclass(frozen=True, eq=False)
class PoseNoise:
    sigma: float  # at the mean reach, mm
    growing: float  # a
    degrees: float  # ν, with what of σ is not known
    reach: float  # root mean square of r, mm

    def scale(self, reach: Floats) -> Floats:
        """(n,) s over σ at reaches (n,)."""
        return np.asarray(np.sqrt(1 - self.growing + self.growing * (reach / self.reach) ** 2))


def reaches(points: Points) -> Floats:
    """(n,) mm: root of the sum of squares of what each joint moves of the tool for a rad; 1 where no joints are known."""
    machine = points.machine
    if not isinstance(machine, Arm) or not machine.joints:
        return np.ones(len(points))
    pose = machine.posed(points.columns)
    turned = np.cross(pose.axes[:, :, THETA], pose.tool[:, None] - pose.origins[:, :, THETA])[:, machine.revolute]
    return np.asarray(np.sqrt(np.sum(turned**2, axis=(1, 2))), dtype=np.float64)


def pose_noise(residuals: Floats, reach: Floats, freedom: float) -> PoseNoise:
    """Of residuals (n, 3), mm, with so many degrees of freedom in all."""
    n, mean = len(residuals), float(np.mean(reach**2))
    squares = np.sum(residuals**2, axis=1) * residuals.size / freedom
    grown, start = reach**2 / mean, max(float(np.mean(squares) / 3), np.finfo(np.float64).tiny)

    def surprise(x: Floats) -> float:
        variance, nu = start * np.exp(x[0]) * (1 - x[1] + x[1] * grown), 1 / x[2]
        constant = gammaln((nu + 3) / 2) - gammaln(nu / 2) - 1.5 * np.log(nu)
        each = 1.5 * np.log(variance) + (nu + 3) / 2 * np.log1p(squares / (nu * variance))
        return float(np.sum(each) - n * constant)

    most = 1.0 if np.ptp(grown) > 0 else 0.0
    bounds = [(-6.0, 3.0), (0.0, 0.999 * most), (_LEAST, _MOST)]
    found = minimize(surprise, [0.0, _START[0] * most, _START[1]], method="L-BFGS-B", bounds=bounds).x
    degrees = 1 / (found[2] + 1 / freedom)
    return PoseNoise(float(np.sqrt(start * np.exp(found[0]))), float(found[1]), float(degrees), float(np.sqrt(mean)))
