"""Uncertainty budgets: what contributes, how much, and where each figure comes from.

A budget is a list of lines; a line may itself be the result of a budget (nested). Correlations and terms of second order
are lines of their own, so that the shares always add up to one; a share is negative where a correlation takes away.

Readings in groups, as many in each, say what varies within them and what between: :func:`one_way` (JCGM 100:2008, annex H.5).
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from math import copysign, inf, isfinite, sqrt
from typing import TYPE_CHECKING, Literal

import numpy as np

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.messages import NOTHING, Number, Text, Verbatim, foreign, say, signed
from cmm_uq.base.points import Floats, Ints
from cmm_uq.base.units import unit_as_written
from cmm_uq.base.values import dataclass, field, replace
from cmm_uq.maths.uncertainty.quantity import figure, rounded, significant
from cmm_uq.maths.uncertainty.type_a import coverage_factor

if TYPE_CHECKING:
    import pandas as pd

    from cmm_uq.maths.uncertainty.distributions import Distribution
    from cmm_uq.maths.uncertainty.measurement_model import MeasurementModel
    from cmm_uq.maths.uncertainty.propagation import Propagated

# where a figure comes from, in the fewest words; a line may say more (``"certificate 4711"``)
REPEATS, JUDGEMENT, CERTIFICATE = say("repeats"), say("judgement"), say("certificate")
_ROUNDING = 1e-10
Method = Literal["first", "second", "monte_carlo"]
NAMES: Mapping[Method, Text] = {
    "first": say("first order"),
    "second": say("second order"),
    "monte_carlo": say("Monte Carlo"),
}


@dataclass(frozen=True, eq=False)
class BudgetLine:
    name: Text  # the quantity
    u: float | None  # its standard uncertainty, in ``unit``; None for a line that is no quantity (a correlation)
    origin: Text  # where the figure comes from
    value: float | None = None  # its estimate, where it has one
    unit: Text = NOTHING  # of value and u, as text
    distribution: str = "normal"  # by its name in JCGM 101 table 1
    dof: float = inf  # degrees of freedom of u
    # change of the measurand by a change of the quantity; None where there is no single one
    sensitivity: float | None = 1.0
    # what the line adds to the variance of the measurand, where that is not (sensitivity × u)²
    variance: float | None = None
    parts: Budget | None = None  # the budget that ``u`` comes from
    shared: bool = False  # whether repetitions share it, so that it does not average out

    def __post_init__(self) -> None:
        if self.u is not None and not (isfinite(self.u) and self.u >= 0):
            raise CmmUqError(f"a standard uncertainty of {self.u}", where=f"budget line {self.name!r}")
        if not self.dof >= 1:
            raise CmmUqError(f"{self.dof} degrees of freedom", where=f"budget line {self.name!r}", fix="At least 1")

    @property
    def part(self) -> float:
        """What the line adds to the variance of the measurand; negative for some correlations."""
        return self.variance if self.variance is not None else ((self.sensitivity or 0.0) * (self.u or 0.0)) ** 2

    @property
    def contribution(self) -> float:
        """Square root of :attr:`part`, with its sign."""
        return copysign(sqrt(abs(self.part)), self.part)


@dataclass(frozen=True)
class Labels:
    units: Mapping[str, str] = field(default_factory=dict)
    origins: Mapping[str, str] = field(default_factory=dict)

    def unit(self, name: str) -> Text:
        return unit_as_written(self.units.get(name, ""))


def line_of(name: str, given: Distribution, labels: Labels, sensitivity: float = 1.0) -> BudgetLine:
    origin = foreign(labels.origins.get(name, say("not stated")))
    u, mean, dof = float(given.u), float(given.mean), float(given.dof)
    return BudgetLine(Verbatim(name), u, origin, mean, labels.unit(name), given.kind, dof, sensitivity)


@dataclass(frozen=True, eq=False)
class Budget:
    """What is known of a measurand, line by line."""

    measurand: Text
    lines: Sequence[BudgetLine]  # its sources of uncertainty
    value: float | None = None  # estimate; None where the budget is of an uncertainty alone
    unit: Text = NOTHING  # of the measurand, as text
    coverage: float = 0.95  # probability of the expanded uncertainty
    effective_dof: float | None = None  # where the lines alone do not tell them (correlated inputs)
    # coverage factor where a standard prescribes one; None takes that of the degrees of freedom
    factor: float | None = None
    statement: Text = NOTHING  # what kind of uncertainty this is and what it is not, for the reader

    @property
    def variance(self) -> float:
        total = sum(line.part for line in self.lines)
        # correlations can cancel the rest completely; what rounding leaves then is nothing
        return total if total > 1e-14 * sum(abs(line.part) for line in self.lines) else 0.0

    @property
    def u(self) -> float:
        return sqrt(self.variance)

    @property
    def dof(self) -> float:
        """Effective degrees of freedom (JCGM 100:2008 G.4.1)."""
        if self.effective_dof is not None:
            return self.effective_dof
        denominator = sum(line.part**2 / line.dof for line in self.lines)
        return self.variance**2 / denominator if denominator else inf

    @property
    def k(self) -> float:
        return self.factor if self.factor is not None else float(coverage_factor(self.dof, self.coverage))

    @property
    def expanded(self) -> float:
        """Expanded uncertainty U = k u."""
        return self.k * self.u

    @property
    def shares(self) -> list[float]:
        """Part of each line in the variance; they add up to one (all zero where nothing contributes)."""
        variance = self.variance
        return [line.part / variance if variance else 0.0 for line in self.lines]

    def of(self, value: float) -> Budget:
        return replace(self, value=value)

    def as_line(self, name: Text, sensitivity: float = 1.0) -> BudgetLine:
        origin = say("budget")
        return BudgetLine(name, self.u, origin, self.value, self.unit, "normal", self.dof, sensitivity, parts=self)

    def mean_of(self, repetitions: int, measurand: Text) -> Budget:
        """Budget of the mean of repetitions: what they do not share is divided by √n."""
        lines = [line if line.shared else replace(line, variance=line.part / repetitions) for line in self.lines]
        return replace(self, measurand=measurand, lines=lines)

    def flat(self, depth: int = 0, weight: float = 1.0) -> Iterator[tuple[int, BudgetLine, float]]:
        """Every line with its depth and its share in this budget, nested lines after the line they make up."""
        for line, share in zip(self.lines, self.shares, strict=True):
            yield depth, line, weight * share
            if line.parts is not None:
                yield from line.parts.flat(depth + 1, weight * share)

    def as_dataframe(self) -> pd.DataFrame:
        """A table of pandas with a row a line, nested lines included."""
        import pandas as pd

        attributes = ("value", "u", "unit", "distribution", "dof", "sensitivity", "contribution")
        rows = []
        for depth, line, share in self.flat():
            own = {name: getattr(line, name) for name in attributes}
            rows.append({"quantity": line.name, "depth": depth, **own, "share": share, "origin": line.origin})
        return pd.DataFrame(rows)

    def as_text(self) -> list[tuple[Text, ...]]:
        return [_text(depth, line, share) for depth, line, share in self.flat()]


HEADINGS = (
    say("Quantity"), say("Estimate"), say("Standard uncertainty"), say("Unit"), say("Distribution"), say("ν"),
    say("Sensitivity"), say("Contribution"), say("Share"), say("Origin"),
)  # fmt: skip


def _text(depth: int, line: BudgetLine, share: float) -> tuple[Text, ...]:
    value, u = NOTHING, (NOTHING if line.u is None else significant(line.u))
    if line.value is not None and line.u is not None:
        value, u = rounded(line.value, line.u)
    return (
        say("{indent}{name}", indent=Verbatim("\u2003" * depth), name=line.name), value, u,
        NOTHING if line.unit == "1" else line.unit, _DISTRIBUTIONS.get(line.distribution, NOTHING),
        NOTHING if line.u is None else figure(line.dof, 3) if isfinite(line.dof) else Number("∞"),
        NOTHING if line.sensitivity is None else figure(line.sensitivity),
        Number(("−" if line.contribution < 0 else "") + significant(abs(line.contribution))),
        say("{share} %", share=signed(100 * share, ".1f")), line.origin,
    )  # fmt: skip


_BELL_AND_LIMITS = (say("normal"), say("t"), say("rectangular"), say("rectangular uncertain"), say("trapezoidal"))
_OTHER_SHAPES = (say("triangular"), say("arcsine"), say("exponential"), say("gamma"))
# by the names of JCGM 101 table 1 as model files write them
_DISTRIBUTIONS: Mapping[str, Text] = {name.replace(" ", "_"): name for name in (*_BELL_AND_LIMITS, *_OTHER_SHAPES)}


def budget_of(
    model: MeasurementModel, propagated: Propagated, output: int = 0, *, labels: Labels | None = None,
    coverage: float = 0.95,
) -> Budget:  # fmt: skip
    """Budget of one output of a model propagated at a single point: inputs, correlations, terms of second order."""
    labels, name = labels or Labels(), propagated.outputs[output]
    slopes = propagated.sensitivity[output].tolist()
    lines = [
        line_of(key, given, labels, slope) for (key, given), slope in zip(model.inputs.items(), slopes, strict=True)
    ]
    inputs, contribution = [Verbatim(key) for key in propagated.inputs], propagated.contribution[output]
    joint = 2 * np.triu(np.outer(contribution, contribution) * propagated.correlation, 1)
    for i, j in zip(*np.nonzero(joint), strict=True):
        words = say("correlation of {one}, {other}", one=inputs[i], other=inputs[j])
        lines.append(joint_line(words, float(joint[i, j])))
    rounding = _ROUNDING * float(propagated.covariance[output, output])
    bending = propagated.bending[output]
    for i, j in zip(*np.nonzero(np.abs(bending) > rounding), strict=True):
        if i == j:
            words = say("second order: {one} squared", one=inputs[i])
        else:
            words = say("second order: {one}, {other}", one=inputs[i], other=inputs[j])
        lines.append(joint_line(words, float(bending[i, j])))
    cubic = float(propagated.cubic[output])
    if abs(cubic) > rounding:
        lines.append(joint_line(say("third derivatives"), cubic))
    value, dof = float(propagated.value[output]), float(propagated.dof[output])
    return Budget(Verbatim(name), lines, value, labels.unit(name), coverage, dof)


def joint_line(name: Text, variance: float) -> BudgetLine:
    """Line that is no quantity but what several of them add to, or take from, the variance together."""
    return BudgetLine(name, None, say("model"), distribution="", sensitivity=None, variance=variance)


@dataclass(frozen=True)
class OneWay:
    """Of the model x_ij = µ + g_i + e_ij, with groups g (days, set-ups, orientations) as random as the readings in them."""

    groups: int
    repeats: int  # readings in each group
    mean: float  # of all readings
    between: float  # mean square, of ``groups − 1`` degrees of freedom
    within: float  # mean square, of ``groups · (repeats − 1)`` degrees of freedom

    @property
    def s_repeat(self) -> float:
        return sqrt(self.within)

    @property
    def s_group(self) -> float:
        """Standard deviation of the groups themselves; 0 where readings within them explain all that lies between."""
        return sqrt(max(0.0, (self.between - self.within) / self.repeats))

    @property
    def F(self) -> float:  # noqa: N802
        """Ratio of the mean squares; around 1 where groups do not differ."""
        return self.between / self.within if self.within else inf

    @property
    def u_single(self) -> float:
        """Standard deviation of one reading in a group of its own."""
        return float(np.hypot(self.s_group, self.s_repeat))

    @property
    def dof_single(self) -> float:
        """Effective degrees of freedom of :attr:`u_single` (JCGM 100:2008, G.4.1)."""
        if self.between <= self.within:
            return float(self.groups * (self.repeats - 1))
        between, within = self.between / self.repeats, self.within * (1 - 1 / self.repeats)
        whole = between**2 / (self.groups - 1) + within**2 / (self.groups * (self.repeats - 1))
        return (between + within) ** 2 / whole

    @property
    def u_mean(self) -> float:
        """Standard uncertainty of the mean of all readings."""
        return sqrt(max(self.between, self.within) / (self.groups * self.repeats))

    @property
    def dof_mean(self) -> float:
        """Degrees of freedom of :attr:`u_mean`: those of the larger mean square."""
        return self.groups - 1.0 if self.between >= self.within else float(self.groups * (self.repeats - 1))

    def line(self, name: Text, group: Text, repeat: Text, unit: Text, sensitivity: float = 1.0) -> BudgetLine:
        """The uncertainty of the mean as a line of a budget, made up of that by groups and that by readings within them.

        Both come from the same mean square, so that its degrees of freedom are those of the sum, not of the parts.
        """
        u_repeat, within = self.s_repeat / sqrt(self.groups * self.repeats), float(self.groups * (self.repeats - 1))
        lines = [
            BudgetLine(group, self.s_group / sqrt(self.groups), REPEATS, unit=unit, dof=self.groups - 1.0),
            BudgetLine(repeat, u_repeat, REPEATS, unit=unit, dof=within),
        ]
        parts = Budget(name, lines, unit=unit, effective_dof=self.dof_mean)
        return replace(parts.as_line(name, sensitivity), origin=REPEATS)


def one_way(readings: Sequence[float] | Floats, group: Sequence[int] | Ints) -> OneWay:
    """Analysis of variance of readings (n,) by the group of each (n,)."""
    values, of = np.asarray(readings, dtype=np.float64), np.asarray(group)
    names, counts = np.unique(of, return_counts=True)
    if len(names) < 2 or counts.min() < 2 or counts.min() != counts.max():
        fix = "Give two groups at least, and as many readings in each, two at least"
        raise CmmUqError(f"{len(names)} groups with {', '.join(map(str, counts.tolist()))} readings", fix=fix)
    table = np.array([values[of == name] for name in names])
    groups, repeats = table.shape
    means = table.mean(axis=1)
    within = float(np.sum((table - means[:, None]) ** 2)) / (groups * (repeats - 1))
    return OneWay(groups, repeats, float(values.mean()), float(repeats * means.var(ddof=1)), within)
