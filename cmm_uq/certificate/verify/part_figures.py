"""Whether the figures of a part's ``results.json`` agree with each other: intervals, U, k, covariances, shares, margins.

Numbers there have ten digits, and each rule is kept to what these allow.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import Any

from cmm_uq.certificate.verify.found import Inquiry
from cmm_uq.jobs.part.characteristic import ASKS

DIGITS = 2e-9
"""Of numbers of ten digits: what a difference of two of them may be off, of the larger."""

_ROOT = 1e-8

Wrong = tuple[str, str, object, object]
"""Key, problem, what stands there, what should."""


def is_zone(one: Mapping[str, Any]) -> bool:
    """Whether a characteristic is the width of a zone, which is never negative."""
    return ASKS[one["what"]].limits == "zone"


def check_part_figures(inquiry: Inquiry, data: Mapping[str, Any], file: str) -> None:
    """Keep every figure that another one contradicts.

    Parameters
    ----------
    data : of results.json.
    file : its name.
    """
    causes = [one["cause"] for one in data["budget"]["causes"]] + [one["factor"] for one in data["budget"]["factors"]]
    for i, one in enumerate(data["characteristics"]):
        inquiry.looked("figures", 6)
        for key, problem, stands, should in _characteristic(one):
            inquiry.wrong("figures", file, f"characteristics[{i}].{key}", problem, stands, should)
        if causes and one["worst_cause"] not in causes:
            inquiry.wrong(
                "figures", file, f"characteristics[{i}].worst_cause", "is no line of the budget", one["worst_cause"]
            )
    _check_matrices(inquiry, data, file)
    _check_budget(inquiry, data, file)


def _characteristic(one: Mapping[str, Any]) -> Iterator[Wrong]:
    u, expanded, k, (low, high) = one["u"], one["U"], one["k"], one["interval95"]
    median = one.get("value_is") == "median"  # before 0.9.0 no value was
    zone, most = is_zone(one), max(abs(low), abs(high), abs(one["mean_error"]), abs(one["measured"] or 0.0))
    if u < 0:
        yield "u", "is an uncertainty below zero", u, ""
    if low > high:
        yield "interval95", "ends before it begins", one["interval95"], ""
    if u > 0 and (k is None or abs(k - expanded / u) > 2 * DIGITS * abs(expanded / u)):
        yield "k", "is not U over u", k, f"{expanded / u:.10g}"
    half = 0.5 * (high - low)
    if not zone and not median and abs(expanded - half) > DIGITS * most:
        yield "U", "is not half of its interval", expanded, f"{half:.10g}"
    if (one["measured"] is None) != (one["value"] is None):
        yield "value", "is stated of nothing measured, or not of what was", one["value"], one["measured"]
    elif one["value"] is not None:
        should = one["measured"] - one["mean_error"]
        should = max(0.0, should) if zone else should
        if not median and abs(one["value"] - should) > DIGITS * most:
            yield "value", "is not what was measured less the mean error", one["value"], f"{should:.10g}"
        if median and one["value"] < 0:
            yield "value", "is less than zero", one["value"], "0"
        if (median or not zone) and not low - DIGITS * most <= one["value"] <= high + DIGITS * most:
            yield "interval95", "does not contain the value", one["interval95"], one["value"]
    yield from _margin(one, most)


def _margin(one: Mapping[str, Any], most: float) -> Iterator[Wrong]:
    """From the value to the nearest limit, in standard uncertainties."""
    decision, limits = one["decision"], one["limits"]
    if decision is None or limits is None or decision["margin_u"] is None or not one["u"]:
        return
    sides = [limits["upper"] - one["value"]] if limits["upper"] is not None else []
    sides += [one["value"] - limits["lower"]] if limits["lower"] is not None else []
    should = min(sides) / one["u"]
    if abs(decision["margin_u"] - should) > 2 * DIGITS * (abs(should) + most / one["u"]):
        yield (
            "decision.margin_u",
            "is not the distance to the nearest limit over u",
            decision["margin_u"],
            f"{should:.10g}",
        )


def _check_matrices(inquiry: Inquiry, data: Mapping[str, Any], file: str) -> None:
    """Covariances with the squares of u, symmetric; correlations that are theirs."""
    every = data["characteristics"]
    names = [one["name"] for one in every]
    covariance, correlation = data["covariance"], data["correlation"]
    for group, key in ((covariance, "covariance"), (correlation, "correlation")):
        inquiry.looked("figures")
        matrix = group["matrix"]
        if group["characteristics"] != names or [len(row) for row in matrix] != [len(names)] * len(names):
            inquiry.wrong("figures", file, f"{key}.matrix", "has not a row and a column for each characteristic")
            return
    if covariance["units"] != [one["unit"] for one in every]:
        inquiry.wrong("figures", file, "covariance.units", "are not those of the characteristics", covariance["units"])
    for i, one in enumerate(every):
        inquiry.looked("figures", i + 1)
        own = covariance["matrix"][i][i]
        if abs(math.sqrt(max(own, 0.0)) - one["u"]) > _ROOT * one["u"]:
            inquiry.wrong("figures", file, f"covariance.matrix[{i}][{i}]", f"is not the square of u of {one['name']}", own,
                          f"{one['u'] ** 2:.10g}")  # fmt: skip
        for j in range(i + 1):
            a, b = covariance["matrix"][i][j], covariance["matrix"][j][i]
            size = one["u"] * every[j]["u"]
            r = correlation["matrix"][i][j]
            should = 1.0 if i == j else a / size if size else 0.0
            if abs(a - b) > DIGITS * size or correlation["matrix"][j][i] != r:
                inquiry.wrong("figures", file, f"covariance.matrix[{i}][{j}]", "is not symmetric", a, b)
            if abs(r - should) > 10 * DIGITS:
                inquiry.wrong("figures", file, f"correlation.matrix[{i}][{j}]", "is not that of the covariances", r,
                              f"{should:.10g}")  # fmt: skip


def _check_budget(inquiry: Inquiry, data: Mapping[str, Any], file: str) -> None:
    """A share of each cause and factor for each characteristic; what is not seen stands in a line of it."""
    budget = data["budget"]
    names = [one["name"] for one in data["characteristics"]]
    inquiry.looked("figures")
    if budget["characteristics"] != names:
        inquiry.wrong(
            "figures", file, "budget.characteristics", "are not those of the part", budget["characteristics"], names
        )
    rows = [(f"causes[{i}].{key}", one[key]) for i, one in enumerate(budget["causes"]) for key in ("first", "total")]
    rows += [(f"factors[{i}].share", one["share"]) for i, one in enumerate(budget["factors"])]
    for place, shares in rows:
        if len(shares) != len(names):
            inquiry.wrong(
                "figures", file, f"budget.{place}", "has not a share for each characteristic", len(shares), len(names)
            )
    for i, one in enumerate(data["unseen"]):
        inquiry.looked("figures")
        if one["characteristic"] not in names or not one["share"] <= 1.0 + 0.05:
            inquiry.wrong("figures", file, f"unseen[{i}]", "is no share of a characteristic", one["share"])
