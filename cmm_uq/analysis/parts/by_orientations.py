"""The uncertainty of a part by measuring it in several orientations, with a length standard and standards of the tips.

The method of ISO/DTS 15530-2, "Use of multiple workpiece orientations and calibrated simple standards", of which only the
public summary was at hand: several orientations and repetitions, evaluated by analysis of variance; standards of length;
standards for the error of the probe's qualification. How these go together here follows from the model

    y_ij = y + a E + Σ b δ + g_i + e_ij

with the machine's errors in orientation i as one random g_i, the scale E common to all orientations, taken from the length
standard, and the error δ of a tip's effective diameter, taken from a ring or sphere; a and b are derivatives of the
characteristic. Errors that no orientation changes (the part's form at its points, a temperature common to all) are not seen.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from cmm_uq.analysis.parts.by_method import Figure
from cmm_uq.base.messages import Text, Verbatim, say
from cmm_uq.base.points import Floats, Ints
from cmm_uq.base.units import REFERENCE_TEMPERATURE, unit
from cmm_uq.maths.uncertainty.analysis_of_variance import OneWay, one_way
from cmm_uq.maths.uncertainty.budget import CERTIFICATE, JUDGEMENT, Budget, Line

STATEMENT = say(
    "Uncertainty of the mean over all orientations, by a description of the method of ISO/DTS 15530-2; the text of the "
    "standard was not at hand."
)

_ORIENTATIONS, _REPEATS = say("between orientations"), say("between repeats in one orientation")


@dataclass(frozen=True, eq=False)
class Standard:
    """A standard as it was measured beside the part.

    Parameters
    ----------
    calibrated, u : length or diameter by its certificate, mm.
    readings : (n,) of it, mm.
    orientation : (n,) number of the orientation of each.
    inner : of a ring, whose diameter a large tip makes small.
    temperature_c, u_cte_per_k : while it was measured; uncertainty of its coefficient of expansion.
    """

    calibrated: float
    u: float
    readings: Floats
    orientation: Ints
    inner: bool = False
    temperature_c: float = REFERENCE_TEMPERATURE
    u_cte_per_k: float = 0.0

    @property
    def u_expansion(self) -> float:
        """Standard uncertainty of its length by its expansion, mm."""
        return self.calibrated * abs(self.temperature_c - REFERENCE_TEMPERATURE) * self.u_cte_per_k

    @property
    def variances(self) -> OneWay:
        """Of its errors, mm."""
        return one_way(np.asarray(self.readings) - self.calibrated, self.orientation)


@dataclass(frozen=True, eq=False)
class Standards:
    """What was measured beside the part.

    Parameters
    ----------
    length : standard of length; ``None`` where there was none, and the common scale is then not known.
    tips : standard of each tip, by stylus.
    """

    length: Standard | None = None
    tips: Mapping[str, Standard] = field(default_factory=dict)

    @property
    def scale(self) -> float:
        """Error of the common scale, 1."""
        return 0.0 if self.length is None else self.length.variances.mean / self.length.calibrated

    def tip(self, stylus: str) -> float:
        """By how much a tip is effectively larger than thought, mm."""
        one = self.tips[stylus]
        return _sign(one) * (one.variances.mean - self.scale * one.calibrated)


@dataclass(frozen=True)
class Slopes:
    """Derivatives of a characteristic: by the scale, mm or rad; by the diameter of each tip, by stylus."""

    scale: float
    tips: Mapping[str, float]


@dataclass(frozen=True)
class PartWarmth:
    """Mean temperature of the part, its coefficient of expansion, and standard uncertainties of both."""

    temperature_c: float = REFERENCE_TEMPERATURE
    u_temperature_k: float = 0.0
    cte_per_k: float = 0.0
    u_cte_per_k: float = 0.0


def by_orientations(
    name: str, readings: Floats, orientation: Ints, slopes: Slopes, standards: Standards, warmth: PartWarmth | None = None,
    *, angle: bool = False,
) -> Figure:  # fmt: skip
    """One characteristic by measurements of the part in several orientations.

    Parameters
    ----------
    name : of the characteristic.
    readings : (n,) of it, mm or rad; as many in each orientation.
    orientation : (n,) number of the orientation of each.
    angle : whether it is one.

    Raises
    ------
    CmmUqError : fewer than two orientations, or two measurements in each, or not as many in each.
    """
    own, found = unit("rad" if angle else "mm"), one_way(readings, orientation)
    used = [stylus for stylus in standards.tips if slopes.tips.get(stylus, 0.0)]
    error = slopes.scale * standards.scale + sum(slopes.tips[stylus] * standards.tip(stylus) for stylus in used)
    lines = [found.line(say("measurements of the part"), _ORIENTATIONS, _REPEATS, own)]
    if standards.length is not None:
        # a tip is compared with its standard by the same scale, which so far takes itself out of what the tip finds
        by_scale = slopes.scale - sum(
            slopes.tips[stylus] * _sign(standards.tips[stylus]) * standards.tips[stylus].calibrated for stylus in used
        )
        lines += _of_standard(standards.length, say("length standard"), by_scale / standards.length.calibrated)
    for stylus in used:
        which = say("standard of the tip of {stylus}", stylus=Verbatim(stylus))
        lines += _of_standard(standards.tips[stylus], which, slopes.tips[stylus])
    lines += _of_warmth(slopes.scale, warmth or PartWarmth())
    budget = Budget(say("mean over all orientations"), lines, found.mean - error, own, statement=STATEMENT)
    return Figure(name, budget, found.mean - error, error, single=_single(budget, found), scatter=found.u_single,
                  scatter_dof=found.dof_single)  # fmt: skip


def _single(budget: Budget, found: OneWay) -> float:
    """Standard uncertainty of one measurement in one orientation, corrected as the mean is."""
    return float(np.sqrt(budget.variance - found.u_mean**2 + found.u_single**2))


def _sign(tip: Standard) -> float:
    return -1.0 if tip.inner else 1.0


def _of_standard(one: Standard, name: Text, slope: float) -> list[Line]:
    mm = unit("mm")
    return [
        Line(say("{standard}: calibration", standard=name), one.u, CERTIFICATE, unit=mm, sensitivity=slope),
        one.variances.line(say("{standard}: measurements", standard=name), _ORIENTATIONS, _REPEATS, mm, slope),
        Line(say("{standard}: expansion", standard=name), one.u_expansion, JUDGEMENT, unit=mm, sensitivity=slope),
    ]


def _of_warmth(scale: float, warm: PartWarmth) -> list[Line]:
    away = abs(warm.temperature_c - REFERENCE_TEMPERATURE)
    return [
        Line(say("expansion coefficient of the part"), warm.u_cte_per_k, JUDGEMENT, unit=unit("1/K"),
             sensitivity=abs(scale) * away),
        Line(say("temperature of the part"), warm.u_temperature_k, JUDGEMENT, unit=unit("K"),
             sensitivity=abs(scale * warm.cte_per_k)),
    ]  # fmt: skip
