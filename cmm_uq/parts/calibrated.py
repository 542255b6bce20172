"""The other way to an uncertainty: a calibrated part, like those that are measured, measured again and again.

The method of ISO 15530-3:2011 by its published descriptions; its text was not at hand, so that nothing here says that a test
is complete by it. What the repeats vary (set-ups, operators, time of day, qualifications) is seen; what they keep (the place
on the table, this part's form) is seen only as it is there.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cmm_uq.errors import CmmUqError
from cmm_uq.points import Floats, Ints

FEWEST_CYCLES, FEWEST = 10, 20
"""Set-ups, and measurements in all, that descriptions of the method ask for."""


@dataclass(frozen=True)
class ByCalibratedPart:
    """Uncertainty of one characteristic, mm or rad.

    Parameters
    ----------
    bias : mean of the repeats less the calibrated value.
    u_calibration : of the calibrated value.
    u_procedure : standard deviation of a measurement in the repeats.
    u_part : of what differs between parts: form, expansion, elasticity.
    u_bias : of the bias as a correction: of the expansion of the calibrated part.
    corrected : whether results are corrected by the bias.
    k : coverage factor.
    """

    bias: float
    u_calibration: float
    u_procedure: float
    u_part: float
    u_bias: float
    corrected: bool
    k: float = 2.0

    @property
    def u(self) -> float:
        """Standard uncertainty, without a bias that is not corrected."""
        return float(np.sqrt(self.u_calibration**2 + self.u_procedure**2 + self.u_part**2 + self.u_bias**2))

    @property
    def U(self) -> float:  # noqa: N802
        """Expanded uncertainty; a bias that is not corrected is added with its size (ISO/TS 15530-3:2004)."""
        return self.k * self.u + (0.0 if self.corrected else abs(self.bias))


def by_calibrated_part(
    repeats: Floats, cycle: Ints, calibrated: float, u_calibration: float,
    *, u_part: float = 0.0, u_bias: float = 0.0, corrected: bool = True,
) -> ByCalibratedPart:  # fmt: skip
    """Uncertainty from repeated measurements of a calibrated part.

    Parameters
    ----------
    repeats : (n,) measured values of the characteristic.
    cycle : (n,) number of the set-up in which each was measured.
    calibrated, u_calibration : value and standard uncertainty of the certificate.

    Raises
    ------
    CmmUqError : too few measurements or set-ups, or no uncertainty of the calibration.
    """
    cycles = len(np.unique(cycle))
    if cycles < FEWEST_CYCLES or len(repeats) < FEWEST:
        raise CmmUqError(
            f"{len(repeats)} measurements in {cycles} set-ups are too few", where="the repeats of the calibrated part",
            fix=f"Measure {FEWEST} times at least, in {FEWEST_CYCLES} set-ups at least",
        )  # fmt: skip
    if not u_calibration > 0:
        raise CmmUqError(
            "the calibrated part has no uncertainty", where="the calibrated part", fix="Give that of its certificate"
        )
    spread = float(np.std(repeats, ddof=1))
    return ByCalibratedPart(float(np.mean(repeats)) - calibrated, u_calibration, spread, u_part, u_bias, corrected)
