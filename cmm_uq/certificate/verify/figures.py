"""Whether the figures of a ``results.json`` agree with each other.

Whether the figures of ``results.json`` agree with each other: U with its interval, k with U and u, u with the covariance.

Numbers there have ten digits, and each rule is kept to what these allow.

Whether the figures of a part's ``results.json`` agree with each other: intervals, U, k, covariances, shares, margins.

Numbers there have ten digits, and each rule is kept to what these allow.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import Any

from cmm_uq.certificate.verify.found import Inquiry
from cmm_uq.jobs.part.characteristic import ASKS
from cmm_uq.jobs.verdicts import Verdict, Verdicts

QUANTITY = frozenset({"value", "u", "interval95", "U", "k"})  # keys of a quantity
_DIGITS = 2e-9  # of numbers of ten digits: what a difference of two of them may be off, of the larger
_ROOT = 1e-8


def quantities(data: Any, path: str = "") -> Iterator[tuple[str, Mapping[str, Any]]]:
    """Every quantity of plain data with its path."""
    if isinstance(data, Mapping):
        if data.keys() >= QUANTITY:
            yield path, data
            return
        for key, value in data.items():
            yield from quantities(value, f"{path}.{key}" if path else str(key))
    elif isinstance(data, list):
        for i, value in enumerate(data):
            yield from quantities(value, f"{path}[{i}]")


def check_figures(inquiry: Inquiry, data: Mapping[str, Any], file: str) -> None:
    """Keep every figure that another one contradicts."""
    for path, one in quantities(data):
        inquiry.looked("figures")
        try:
            for key, problem, stands, should in _quantity(one):
                inquiry.wrong("figures", file, f"{path}.{key}", problem, stands, should)
        except (TypeError, ValueError):
            inquiry.wrong("figures", file, path, "is no quantity", dict(one))
    _check_covariance(inquiry, data, file)
    _check_accuracy(inquiry, data, file)
    _check_tolerances(inquiry, data, file)
    _check_sampling(inquiry, data, file)


def _quantity(one: Mapping[str, Any]) -> Iterator[tuple[str, str, object, object]]:
    value, u, expanded, factor = one["value"], one["u"], one["U"], one["k"]
    if value is None:
        return
    low, high = one["interval95"]
    most = max(abs(value), abs(low), abs(high))
    if u < 0:
        yield "u", "is an uncertainty below zero", u, ""
    if not low - _DIGITS * most <= value <= high + _DIGITS * most:
        yield "interval95", "does not contain the value", one["interval95"], value
    should = max(high - value, value - low)
    if abs(expanded - should) > _DIGITS * most:
        yield "U", "is not the larger distance from the value to an end of its interval", expanded, f"{should:.10g}"
    if u > 0 and (factor is None or abs(factor - expanded / u) > 2 * _DIGITS * abs(expanded / u)):
        yield "k", "is not U over u", factor, f"{expanded / u:.10g}"
    if u == 0 and factor is not None:
        yield "k", "is U over u of nothing uncertain", factor, None


def _check_covariance(inquiry: Inquiry, data: Mapping[str, Any], file: str) -> None:
    """Symmetric, with the squares of the standard uncertainties."""
    covariance = data.get("covariance")
    if not covariance:
        return
    names, matrix = covariance["parameters"], covariance["matrix"]
    if len(matrix) != len(names) or any(len(row) != len(names) for row in matrix):
        inquiry.wrong("figures", file, "covariance.matrix", "has not a row and a column for each parameter")
        return
    raised = bool((data.get("cmc") or {}).get("raised"))
    for i, name in enumerate(names):
        inquiry.looked("figures")
        owner, _, parameter = name.partition(".")
        group = data.get("artefact", {}) if owner == "artefact" else data.get("estimates", {}).get(owner, {})
        quantity = group.get(parameter) if isinstance(group, Mapping) else None
        of = math.sqrt(max(matrix[i][i], 0.0))
        if isinstance(quantity, Mapping) and quantity.get("u") is not None and not raised:
            u = quantity["u"]
            if abs(of - u) > _ROOT * max(u, of):
                inquiry.wrong("figures", file, f"covariance.matrix[{i}][{i}]", f"is not the square of u of {name}",
                              matrix[i][i], f"{u**2:.10g}")  # fmt: skip
        for j in range(i):
            if matrix[i][j] != matrix[j][i]:
                inquiry.wrong(
                    "figures", file, f"covariance.matrix[{i}][{j}]", "is not symmetric", matrix[i][j], matrix[j][i]
                )
            if abs(matrix[i][j]) > math.sqrt(max(matrix[i][i] * matrix[j][j], 0.0)) * (1 + _ROOT):
                inquiry.wrong("figures", file, f"covariance.matrix[{i}][{j}]", "is larger than a covariance can be",
                              matrix[i][j])  # fmt: skip


def _check_accuracy(inquiry: Inquiry, data: Mapping[str, Any], file: str) -> None:
    """The figures of performance stand in two places."""
    plain, uncertain = data.get("accuracy") or {}, data.get("accuracy_uncertainty") or {}
    if list(plain) != list(uncertain):
        inquiry.wrong("figures", file, "accuracy", "names other figures than accuracy_uncertainty", list(plain),
                      list(uncertain))  # fmt: skip
    for name, value in plain.items():
        inquiry.looked("figures")
        if name in uncertain and uncertain[name]["value"] != value:
            inquiry.wrong("figures", file, f"accuracy.{name}", "is not the value in accuracy_uncertainty", value,
                          uncertain[name]["value"])  # fmt: skip


def _check_tolerances(inquiry: Inquiry, data: Mapping[str, Any], file: str) -> None:
    """In or out where the whole interval is."""
    for effect, said in (data.get("tolerances") or {}).items():
        verdict = said.get("verdict")
        for parameter, tolerance in said.items():
            quantity = (data.get("estimates", {}).get(effect) or {}).get(parameter)
            if parameter == "verdict" or quantity is None:
                continue
            inquiry.looked("decisions")
            low, high = quantity["interval95"]
            inside, outside = -tolerance <= low and high <= tolerance, low > tolerance or high < -tolerance
            should = "in" if inside else "out" if outside else "open"
            if verdict != should:
                inquiry.wrong("decisions", file, f"tolerances.{effect}.verdict", "does not follow from the interval",
                              verdict, should)  # fmt: skip


def check_verdicts(inquiry: Inquiry, data: Mapping[str, Any], file: str) -> None:
    """The list of verdicts, where there is one: what standards, tolerances and limits decided, and the gravest of these."""
    if "verdicts" not in data:
        return
    stated = Verdicts.of_results(data)
    decided = Verdicts.of_results({key: value for key, value in data.items() if key != "verdicts"})
    inquiry.looked("decisions", 1 + len(stated))
    # a parameter that the recording does not determine stands in this list alone
    left = [one for one in stated if one.by or one.value is not None or one.outcome != "undecided"]
    lacking = all(  # beside what a standard lacks stands the key that would state it
        len(one.missing) == len(should.missing) and all(map(str.startswith, should.missing, one.missing))
        for one, should in zip(left, decided, strict=False)
    )
    if [_said(one) for one in left] != [_said(one) for one in decided] or not lacking:
        inquiry.wrong("decisions", file, "verdicts.statements", "are not what was decided", [_said(one) for one in left],
                      [_said(one) for one in decided])  # fmt: skip
    for i, (one, should) in enumerate(zip(left, decided, strict=False)):
        if one.U != should.U and not math.isclose(one.U or 0.0, should.U or 0.0, rel_tol=_DIGITS):
            inquiry.wrong(
                "figures", file, f"verdicts.statements[{i}].U", "is not that of what was decided", one.U, should.U
            )
    if data["verdicts"]["overall"] != stated.overall:
        inquiry.wrong("decisions", file, "verdicts.overall", "is not the gravest", data["verdicts"]["overall"],
                      stated.overall)  # fmt: skip


def _said(one: Verdict) -> tuple[object, ...]:
    return one.called, one.outcome, one.value, one.limit


def _check_sampling(inquiry: Inquiry, data: Mapping[str, Any], file: str) -> None:
    """Numbers of draws that can be."""
    sampling = data.get("sampling") or {}
    for key in ("ess_min", "rhat_max", "draws", "steps"):
        value = sampling.get(key)
        if value is not None and not value > 0:
            inquiry.wrong("figures", file, f"sampling.{key}", "is not above zero", value)
    inquiry.looked("figures")


DIGITS = 2e-9  # of numbers of ten digits: what a difference of two of them may be off, of the larger


Wrong = tuple[str, str, object, object]  # key, problem, what stands there, what should


def is_zone(one: Mapping[str, Any]) -> bool:
    """Whether a characteristic is the width of a zone, which is never negative."""
    return ASKS[one["what"]].limits == "zone"


def check_part_figures(inquiry: Inquiry, data: Mapping[str, Any], file: str) -> None:
    """Keep every figure that another one contradicts."""
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
