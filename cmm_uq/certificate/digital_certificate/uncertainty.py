"""Uncertainties of results.json in D-SI: U with k and 95 %, coverage intervals, and those of a column."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from decimal import Decimal
from typing import Any

from cmm_uq.certificate.digital_certificate.shapes import decimal
from cmm_uq.jobs.dcc.quantities import Expanded, ExpandedList, Interval, IntervalList

P95 = Decimal("0.95")
P_STANDARD = Decimal("0.6827")
"""Probability of a normal distribution within one standard deviation."""

POSTERIOR = "posterior"
"""In place of a named distribution: that of the draws in posterior.npz."""


def expanded_of(data: Mapping[str, Any]) -> Expanded | None:
    """U with k and 95 %; where only u is known, that with k = 1; None where there is none that D-SI takes."""
    u, U, k = data["u"], data.get("U"), data.get("k")
    if not u:
        return None
    if U is None:
        return Expanded(uncertainty=decimal(u), factor=Decimal(1), probability=P_STANDARD, distribution="normal")
    if k is None or k < 1:
        return None
    distribution = POSTERIOR if "interval95" in data else None
    return Expanded(uncertainty=decimal(U), factor=decimal(k), probability=P95, distribution=distribution)


def interval_of(data: Mapping[str, Any]) -> Interval | None:
    """The 95 % coverage interval."""
    if not data.get("interval95") or data["u"] is None:
        return None
    low, high = data["interval95"]
    return Interval(
        standard=decimal(data["u"]), low=decimal(low), high=decimal(high), probability=P95, distribution=POSTERIOR
    )


def symmetric(data: Mapping[str, Any]) -> bool:
    """Whether both sides of the interval are the same to the two digits that are printed of U."""
    value, (low, high), U = data["value"], data["interval95"], data.get("U")
    if not U:
        return bool(U == 0)
    step = 10.0 ** (math.floor(math.log10(U)) - 1)
    return bool(round((high - value) / step) == round((value - low) / step))


def spread_of(values: Sequence[Mapping[str, Any]]) -> ExpandedList | IntervalList | None:
    """Uncertainties of a column: U with k of each, or the interval of each; None where neither is known of all."""
    none = Expanded(uncertainty=Decimal(0), factor=Decimal(1), probability=P95)  # of what is known without one
    stated = [expanded_of(value) or (none if not value["u"] else None) for value in values]
    found = [one for one in stated if one is not None]
    if len(found) == len(stated):
        return ExpandedList(
            uncertainties=tuple(one.uncertainty for one in found), factors=tuple(one.factor for one in found),
            probabilities=tuple(one.probability for one in found),
        )  # fmt: skip
    return intervals_of(values)


def intervals_of(values: Sequence[Mapping[str, Any]]) -> IntervalList | None:
    """The interval of each; None where it is not known of all. What has no uncertainty is an interval of no width."""
    intervals = [one for one in map(interval_of, values) if one is not None]
    if len(intervals) < len(values):
        return None
    return IntervalList(
        standards=tuple(one.standard for one in intervals), lows=tuple(one.low for one in intervals),
        highs=tuple(one.high for one in intervals), probabilities=(P95,),
    )  # fmt: skip
