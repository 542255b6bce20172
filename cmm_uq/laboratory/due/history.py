"""The history of one machine: every value over its certificates, what it changed by, and when it will cross its limit.

A straight line goes through the values since the last adjustment (generalised least squares): they are as uncertain as their
certificates say, and what comes from the artefact is common to all that were made with it. A common error shifts the line
and does not tilt it. Where the values scatter about the line by more than their uncertainties allow, the line is as much
more uncertain (Birge ratio).
"""

from __future__ import annotations

import datetime as dt
from bisect import bisect_left, bisect_right
from collections.abc import Mapping, Sequence
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.messages import Text, day, plural, say
from cmm_uq.base.points import Floats
from cmm_uq.base.values import dataclass, replace
from cmm_uq.jobs.verdicts import BEYOND, NONE
from cmm_uq.laboratory.due.doubt import DoubtfulPeriod, doubtful_periods
from cmm_uq.laboratory.due.rule import ComparedValue, ValueChange, change, common_part, is_of_machine
from cmm_uq.laboratory.records.facts import STANDING, MeasuredPart, RecordedCertificate, RecordedMachine, Series

if TYPE_CHECKING:
    from cmm_uq.laboratory.due.crossing import Crossing
    from cmm_uq.laboratory.due.drift import DriftPrior as Prior
    from cmm_uq.laboratory.due.steps import DatedStep

YEAR = 365.2425  # days
_LEAST = 1e-9  # standard uncertainty of a value that is stated without one, as a part of the largest value


@dataclass(frozen=True)
class TrendLine:
    """The line; ``excess`` is the Birge ratio, 1 where the scatter is no more than the uncertainties allow."""

    count: int  # values that it was fitted to
    day: int  # ordinal, at which ``value`` stands: that of the last of them
    value: float  # and slope: then, and its change a year
    slope: float
    covariance: Floats  # (2, 2) of both
    excess: float

    def at(self, day: Floats) -> tuple[Floats, Floats]:
        """Value and standard uncertainty (n,) on days (n,), ordinals."""
        years = (np.asarray(day, dtype=np.float64) - self.day) / YEAR
        terms = np.column_stack([np.ones_like(years), years])
        u = np.sqrt(np.maximum(np.einsum("ij,jk,ik->i", terms, self.covariance, terms), 0))
        return self.value + self.slope * years, u

    @property
    def u_slope(self) -> float:
        return float(np.sqrt(self.covariance[1, 1]))


def epochs(series: Series) -> list[slice]:
    """Rows between adjustments, in turn."""
    starts = np.flatnonzero(np.diff(series.adjusted_since, prepend=-1))
    return [slice(int(a), int(b)) for a, b in zip(starts, [*starts[1:], len(series.day)], strict=True)]


def trend(series: Series) -> TrendLine | None:
    """The line through the values since the last adjustment; ``None`` where they are of fewer than two days."""
    rows = epochs(series)[-1] if len(series.day) else slice(0, 0)
    day, value = series.day[rows], series.value[rows]
    if len(np.unique(day)) < 2:
        return None
    u, artefact = series.u[rows], series.artefact[rows]
    common = np.array([common_part(*pair) for pair in zip(u.tolist(), series.u_artefact[rows].tolist(), strict=True)])
    # what the artefact contributes is common to all with the same one
    same = (artefact[:, None] == artefact) & (artefact != "")
    covariance = np.where(same, np.outer(common, common), 0.0)
    np.fill_diagonal(covariance, u**2 + (_LEAST * max(float(np.abs(value).max()), 1e-30)) ** 2)
    terms = np.column_stack([np.ones(len(day)), (day - day[-1]) / YEAR])
    weighed = np.linalg.solve(covariance, terms)
    spread = np.linalg.inv(terms.T @ weighed)
    found = spread @ (weighed.T @ value)
    left = value - terms @ found
    freedoms = len(day) - 2
    chi2 = float(left @ np.linalg.solve(covariance, left))
    excess = max(1.0, float(np.sqrt(chi2 / freedoms))) if freedoms else 1.0
    return TrendLine(len(day), int(day[-1]), float(found[0]), float(found[1]), excess**2 * spread, excess)


@dataclass(frozen=True)
class ValueHistory:
    series: Series  # its values, none of them after the day asked about
    change: ValueChange | None  # since the recording before the last; ``None`` where there is one only
    adjusted: bool  # whether the machine was adjusted between the two
    line: TrendLine | None  # through the values since the last adjustment; ``None`` where they do not give one
    adjusted_after: int | None = None  # ordinal of the machine's newest adjustment; ``None`` where none is known
    prior: Prior | None = None  # what the machine's fleet taught of this value; ``None`` for the default one
    outcome: str = ""  # of the newest certificate's statement on it; empty where it states none

    @cached_property
    def _drift(self) -> tuple[Crossing | None, tuple[DatedStep, ...]]:
        from cmm_uq.laboratory.due import crossing, drift, steps

        try:
            known = steps.followed(drift.history(self.series, self.adjusted_after), self.series.limit, self.prior)
        except CmmUqError:
            return None, ()
        return crossing.crossing_of(known, self.series.limit) if self.series.limit else None, steps.dated_steps(known)

    @cached_property
    def crossing(self) -> Crossing | None:
        """By the drift model, ``None`` without a limit or a history that it takes; worked out when first asked for."""
        return self._drift[0]

    @property
    def steps(self) -> tuple[DatedStep, ...]:
        """Those that the drift model finds more probable than not."""
        return self._drift[1]

    @property
    def beyond(self) -> bool:
        """Whether the last certificate finds it so; where that states nothing, whether the last value is beyond its limit."""
        if self.outcome:
            return self.outcome in BEYOND
        return self.series.limit is not None and abs(float(self.series.value[-1])) > self.series.limit

    def probably_beyond(self, on: dt.date) -> bool:
        """Whether the limit has more probably been crossed by a day than not, although the last value was within it."""
        return not self.beyond and self.crossing is not None and self.crossing.by(on) >= 0.5


@dataclass(frozen=True)
class MachineHistory:
    """All of a machine; certificates and interim checks by day, those withdrawn or replaced too."""

    machine: RecordedMachine  # and on: which, and up to which day
    on: dt.date
    certificates: tuple[RecordedCertificate, ...]
    values: tuple[ValueHistory, ...]  # in the order of the newest certificate
    remarks: tuple[Text, ...]  # what is to be known, a sentence each
    doubtful: tuple[DoubtfulPeriod, ...] = ()  # when what was measured on it is in doubt
    parts: tuple[MeasuredPart, ...] = ()  # whose reports the records have, by day

    @property
    def decision(self) -> str:
        """Of the newest certificate that counts, the gravest of its statements of conformity; ``none`` without any."""
        standing = [one for one in self.certificates if one.state in STANDING and not one.interim]
        return standing[-1].decision if standing else NONE

    def in_doubt(self, value: ValueHistory, step: DatedStep) -> tuple[RecordedCertificate, ...]:
        """Certificates that were relied on when a step came: the last one before, if it still held then, and those since."""
        issued = [one for one in self.certificates if one.state in STANDING and not one.interim]
        day = [one.day.toordinal() for one in issued]
        held = bool(np.isin(step.after, value.series.day))  # else it is the day of an adjustment
        first = max(bisect_right(day, step.after) - held, 0)
        return tuple(issued[first : bisect_left(day, step.by)])

    def significant(self, value: ValueHistory) -> bool:
        """Whether a value changed by more than chance among all that are compared."""
        compared = sum(one.change is not None and not one.adjusted for one in self.values)
        return value.change is not None and not value.adjusted and value.change.significant(compared)


def machine_history(
    machine: RecordedMachine,
    certificates: Sequence[RecordedCertificate],
    series: Mapping[str, Series],
    on: dt.date,
    priors: Mapping[str, Prior] | None = None,
    outcomes: Mapping[int, Mapping[str, str]] | None = None,
) -> MachineHistory:
    """The history up to a day; outcomes of values by certificate's entry and value's name."""
    known = tuple(one for one in certificates if one.day <= on)
    by_name = say("The machine has no serial number and is recognised by its name alone.")
    remarks: list[Text] = [by_name] if machine.by_name else []
    if late := len(certificates) - len(known):
        remarks.append(plural(
            late,
            one=say("One certificate is dated after {on} and does not count: a clock or a date is wrong.", on=day(on)),
            many=say("{count} certificates are dated after {on} and do not count: a clock or a date is wrong.",
                     count=late, on=day(on)),
        ))  # fmt: skip
    adjusted = max((one.toordinal() for one in machine.adjusted if one <= on), default=None)
    cut = [one for one in (_until(one, on) for one in series.values()) if len(one.day) and is_of_machine(one.unit)]
    stated = [(outcomes or {}).get(int(one.entry[-1]), {}).get(one.name, "") for one in cut]
    values = tuple(_value(one, adjusted, (priors or {}).get(one.name), outcome)
                   for one, outcome in zip(cut, stated, strict=True))  # fmt: skip
    if values and not any(one.series.limit is not None for one in values):
        remarks.append(say("No certificate has limits, so that none can be met."))
    if known and len({one.day for one in known}) == 1:
        remarks.append(say("There is one day of recordings only: a trend needs two."))
    doubtful = doubtful_periods([one for one in known if one.state in STANDING])
    return MachineHistory(machine, on, known, values, tuple(remarks), doubtful)


def _until(series: Series, on: dt.date) -> Series:
    rows = series.day <= on.toordinal()
    names = ("day", "value", "u", "u_artefact", "artefact", "entry", "adjusted_since", "interim")
    return series if rows.all() else replace(series, **{name: getattr(series, name)[rows] for name in names})


def _value(series: Series, adjusted_after: int | None, prior: Prior | None, outcome: str) -> ValueHistory:
    changed, adjusted = None, False
    if len(series.day) > 1:
        columns = zip(
            series.value.tolist(), series.u.tolist(), series.u_artefact.tolist(), series.artefact.tolist(), strict=True
        )
        changed = change(*(ComparedValue(*row) for row in list(columns)[-2:]))
        adjusted = bool(series.adjusted_since[-2] != series.adjusted_since[-1])
    return ValueHistory(series, changed, adjusted, trend(series), adjusted_after, prior, outcome)
