"""Other methods for the uncertainty of a part beside the virtual measurement, whose texts were not at hand.

By a calibrated part like it, measured again and again: the method of ISO 15530-3:2011, as it is described in public. The
repeats show what varies between them; the machine's errors, which they keep, show as a systematic error b at the place where
the calibrated part lay:

    U = k √(u_cal² + u_p² + u_b² + u_w²), k = 2, for results that are corrected by b; else |b| is added (ISO/TS 15530-3:2004).

The budget itself is that of :func:`cmm_uq.maths.uncertainty.budgets.machine.use_by_calibrated_workpiece`.

By measuring it in several orientations: the method of ISO/DTS 15530-2, "Use of multiple workpiece orientations and calibrated
simple standards", by its public summary: several orientations and repetitions, evaluated by analysis of variance; standards of
length; standards for the error of the probe's qualification. How these go together here follows from the model

    y_ij = y + a E + Σ b δ + g_i + e_ij

with the machine's errors in orientation i as one random g_i, the scale E common to all orientations, taken from the length
standard, and the error δ of a tip's effective diameter, taken from a ring or sphere; a and b are derivatives of the
characteristic. Errors that no orientation changes (the part's form at its points, a temperature common to all) are not seen.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Literal

import numpy as np

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.messages import Text, Verbatim, say
from cmm_uq.base.points import Floats, Ints
from cmm_uq.base.units import REFERENCE_TEMPERATURE, unit
from cmm_uq.base.values import dataclass, field
from cmm_uq.maths.uncertainty.budget import CERTIFICATE, JUDGEMENT, Budget, BudgetLine, OneWay, one_way
from cmm_uq.maths.uncertainty.budgets.machine import FEWEST_READINGS, use_by_calibrated_workpiece

# virtual measurements; a calibrated part measured again and again; the part itself in several orientations
Method = Literal["virtual", "calibrated_part", "orientations"]
# how a method takes hold of a cause: *drawn* from what is known of it; as scatter, because it *varied* between repeats; in
# the *systematic* error that was found; *corrected* by a standard, with the standard's uncertainty; *stated* from
# descriptions; or *unseen*
Seen = Literal["drawn", "varied", "systematic", "corrected", "stated", "unseen"]


@dataclass(frozen=True)
class TestCondition:
    """What a method asks of its test."""

    text: Text  # of what is asked, in words
    met: bool | None  # whether it is met; ``None`` where the job does not say


@dataclass(frozen=True, eq=False)
class MethodFigure:
    """One characteristic by one method, mm or rad."""

    name: str  # of the characteristic
    budget: Budget  # of the method, with its k
    value: float | None  # of the part; ``None`` where the part was not measured
    systematic: float | None = None  # error that the method found and takes off; ``None`` where it looks for none
    corrected: bool = True  # whether it is taken off; where not, its size is added to U
    # standard uncertainty of one measurement in one orientation, where ``budget`` is of the mean of all
    single: float | None = None
    zone: bool = False  # whether it is the width of a zone, which errors make larger on average where it is small
    # scatter, scatter_dof: standard deviation of one measurement among the repeats, and its degrees of freedom
    scatter: float = 0.0
    scatter_dof: float = 1.0

    @property
    def angle(self) -> bool:
        """Whether it is one, in rad."""
        return self.budget.unit == "rad"

    @property
    def u(self) -> float:
        """Standard uncertainty, without a systematic error that is not corrected."""
        return self.budget.u

    @property
    def U(self) -> float:  # noqa: N802
        """Expanded uncertainty; a systematic error that is not corrected is added with its size."""
        return self.budget.expanded + (0.0 if self.corrected else abs(self.systematic or 0.0))


@dataclass(frozen=True, eq=False)
class MethodResult:
    """All that a method says of a part."""

    method: Method
    figures: tuple[MethodFigure, ...]  # one a characteristic; those that were not tested are missing
    conditions: tuple[TestCondition, ...]  # of the test
    # by family of causes (:data:`cmm_uq.analysis.parts.budget.FAMILIES`), how the method takes hold of it.
    seen: Mapping[str, Seen]

    def of(self, name: str) -> MethodFigure | None:
        """The figure of a characteristic; ``None`` where it was not tested."""
        return next((one for one in self.figures if one.name == name), None)


@dataclass(frozen=True)
class MethodStatement:
    """What one method states of a characteristic, mm or rad."""

    method: Method
    value: float | None  # where there is one
    # u, U: its uncertainty
    u: float
    U: float
    error: float = 0.0  # mean error that is taken off, of virtual measurements


@dataclass(frozen=True)
class MethodPair:
    """Two methods on one characteristic: Eₙ = (x₁ − x₂)/√(U₁² + U₂²) (ISO/IEC 17043:2023)."""

    one: Method
    other: Method
    normalised: float


@dataclass(frozen=True)
class ComparedCharacteristic:
    """One characteristic by all methods."""

    name: str  # of the characteristic
    stated: tuple[MethodStatement, ...]  # by each method that says something of it, the virtual measurement first
    pairs: tuple[MethodPair, ...]  # Eₙ of each two that have a value
    why: tuple[Text, ...]  # they differ, in sentences that follow from the figures


@dataclass(frozen=True, eq=False)
class MethodComparison:
    """The methods beside each other; what a part's page and its ``results.json`` say of them."""

    methods: tuple[MethodResult, ...]  # the others, not the virtual measurement
    characteristics: tuple[ComparedCharacteristic, ...]  # those that another method tested, in the order of the plan


FEWEST_CYCLES = 10  # set-ups of the calibrated part that descriptions of the method ask for


@dataclass(frozen=True)
class CalibratedCharacteristic:
    """A characteristic of the calibrated part, mm or rad."""

    # value, u: by its certificate
    value: float
    u: float
    u_part: float = 0.0  # of what differs between parts: form, roughness, elasticity
    expanding_mm: float = 0.0  # length whose expansion counts; 0 of a form or an angle
    angle: bool = False  # whether it is one


@dataclass(frozen=True)
class Warmth:
    """Mean temperature of the repeats, and standard uncertainties of coefficients of expansion, 1/K."""

    temperature_c: float = REFERENCE_TEMPERATURE
    u_cte_calibrated_per_k: float = 0.0
    u_cte_part_per_k: float = 0.0


def by_calibrated_part(
    name: str, readings: Floats, cycle: Ints, calibrated: CalibratedCharacteristic, warmth: Warmth | None = None,
    *, measured: float | None = None, corrected: bool = True,
) -> MethodFigure:  # fmt: skip
    """One characteristic by the repeats of a calibrated part.

    ``readings``: (n,) of the calibrated part, mm or rad. ``cycle``: (n,) number of the set-up of each. ``measured``: value
    of the part itself; ``None`` where it was not measured. ``corrected``: whether that is corrected by the systematic error.
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
    return MethodFigure(name, budget, value, bias, corrected, scatter=scatter, scatter_dof=len(readings) - 1.0)


_STATEMENT = say(
    "Uncertainty of the mean over all orientations, by a description of the method of ISO/DTS 15530-2; the text of the "
    "standard was not at hand."
)
_ORIENTATIONS, _REPEATS = say("between orientations"), say("between repeats in one orientation")


@dataclass(frozen=True, eq=False)
class CalibratedStandard:
    """A standard as it was measured beside the part."""

    # calibrated, u: length or diameter by its certificate, mm
    calibrated: float
    u: float
    readings: Floats  # (n,) of it, mm
    orientation: Ints  # (n,) number of the orientation of each
    inner: bool = False  # of a ring, whose diameter a large tip makes small
    # temperature_c, u_cte_per_k: while it was measured; uncertainty of its coefficient of expansion
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
class CalibratedStandards:
    """What was measured beside the part."""

    # standard of length; ``None`` where there was none, and the common scale is then not known
    length: CalibratedStandard | None = None
    tips: Mapping[str, CalibratedStandard] = field(default_factory=dict)  # standard of each tip, by stylus

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
    name: str, readings: Floats, orientation: Ints, slopes: Slopes, standards: CalibratedStandards,
    warmth: PartWarmth | None = None, *, angle: bool = False,
) -> MethodFigure:  # fmt: skip
    """One characteristic by measurements of the part in several orientations.

    ``readings``: (n,) of it, mm or rad; as many in each orientation. ``orientation``: (n,) number of the orientation of
    each. ``angle``: whether it is one.
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
    value = found.mean - error
    budget = Budget(say("mean over all orientations"), lines, value, own, statement=_STATEMENT)
    # of one measurement in one orientation, corrected as the mean is
    single = float(np.sqrt(budget.variance - found.u_mean**2 + found.u_single**2))
    return MethodFigure(name, budget, value, error, single=single, scatter=found.u_single, scatter_dof=found.dof_single)


def _sign(tip: CalibratedStandard) -> float:
    return -1.0 if tip.inner else 1.0


def _of_standard(one: CalibratedStandard, name: Text, slope: float) -> list[BudgetLine]:
    mm = unit("mm")
    return [
        BudgetLine(say("{standard}: calibration", standard=name), one.u, CERTIFICATE, unit=mm, sensitivity=slope),
        one.variances.line(say("{standard}: measurements", standard=name), _ORIENTATIONS, _REPEATS, mm, slope),
        BudgetLine(say("{standard}: expansion", standard=name), one.u_expansion, JUDGEMENT, unit=mm, sensitivity=slope),
    ]


def _of_warmth(scale: float, warm: PartWarmth) -> list[BudgetLine]:
    away = abs(warm.temperature_c - REFERENCE_TEMPERATURE)
    return [
        BudgetLine(say("expansion coefficient of the part"), warm.u_cte_per_k, JUDGEMENT, unit=unit("1/K"),
             sensitivity=abs(scale) * away),
        BudgetLine(say("temperature of the part"), warm.u_temperature_k, JUDGEMENT, unit=unit("K"),
             sensitivity=abs(scale * warm.cte_per_k)),
    ]  # fmt: skip
