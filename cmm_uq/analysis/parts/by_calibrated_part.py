"""The uncertainty of a part by a calibrated one like it, measured again and again: the method of ISO 15530-3:2011.

Its text was not at hand; followed is how it is described in public. The repeats show what varies between them; the machine's
errors, which they keep, show as a systematic error b at the place where the calibrated part lay:

    U = k √(u_cal² + u_p² + u_b² + u_w²), k = 2, for results that are corrected by b; else |b| is added (ISO/TS 15530-3:2004).

The budget itself is that of :func:`cmm_uq.maths.uncertainty.budgets.machine.use_by_calibrated_workpiece`.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cmm_uq.analysis.parts.by_method import Figure
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.points import Floats, Ints
from cmm_uq.base.units import REFERENCE_TEMPERATURE
from cmm_uq.maths.uncertainty.budgets.machine import FEWEST_READINGS, use_by_calibrated_workpiece

FEWEST_CYCLES = 10
"""Set-ups of the calibrated part that descriptions of the method ask for."""


@dataclass(frozen=True)
class Calibrated:
    """A characteristic of the calibrated part, mm or rad.

    Parameters
    ----------
    value, u : by its certificate.
    u_part : of what differs between parts: form, roughness, elasticity.
    expanding_mm : length whose expansion counts; 0 of a form or an angle.
    angle : whether it is one.
    """

    value: float
    u: float
    u_part: float = 0.0
    expanding_mm: float = 0.0
    angle: bool = False


@dataclass(frozen=True)
class Warmth:
    """Mean temperature of the repeats, and standard uncertainties of coefficients of expansion, 1/K."""

    temperature_c: float = REFERENCE_TEMPERATURE
    u_cte_calibrated_per_k: float = 0.0
    u_cte_part_per_k: float = 0.0


def by_calibrated_part(
    name: str, readings: Floats, cycle: Ints, calibrated: Calibrated, warmth: Warmth | None = None,
    *, measured: float | None = None, corrected: bool = True,
) -> Figure:  # fmt: skip
    """One characteristic by the repeats of a calibrated part.

    Parameters
    ----------
    name : of the characteristic.
    readings : (n,) of the calibrated part, mm or rad.
    cycle : (n,) number of the set-up of each.
    measured : value of the part itself; ``None`` where it was not measured.
    corrected : whether that is corrected by the systematic error.

    Raises
    ------
    CmmUqError : too few readings or set-ups, or no uncertainty of the calibration.
    """
    cycles = len(np.unique(cycle))
    if cycles < FEWEST_CYCLES or len(readings) < FEWEST_READINGS:
        raise CmmUqError(
            f"{name!r} has {len(readings)} measurements in {cycles} set-ups of the calibrated part, which are too few",
            fix=f"Measure {FEWEST_READINGS} times at least, in {FEWEST_CYCLES} set-ups at least",
        )
    if not calibrated.u > 0:
        raise CmmUqError(f"{name!r} of the calibrated part has no uncertainty", fix="Give that of its certificate")
    warm = warmth or Warmth()
    budget = use_by_calibrated_workpiece(
        readings, calibrated.value, calibrated.u, temperature_c=warm.temperature_c,
        u_cte_calibrated_per_k=warm.u_cte_calibrated_per_k, u_cte_workpieces_per_k=warm.u_cte_part_per_k,
        u_form_mm=calibrated.u_part, expanding_mm=calibrated.expanding_mm, angle=calibrated.angle,
    )  # fmt: skip
    bias = float(np.mean(readings)) - calibrated.value
    value = None if measured is None else measured - (bias if corrected else 0.0)
    scatter = float(np.std(readings, ddof=1))
    return Figure(name, budget, value, bias, corrected, scatter=scatter, scatter_dof=len(readings) - 1.0)
