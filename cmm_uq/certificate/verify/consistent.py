"""Whether the figures of ``results.json`` agree with each other: U with its interval, k with U and u, u with the covariance.

Numbers there have ten digits, and each rule is kept to what these allow.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import Any

from cmm_uq.certificate.verify.found import Inquiry
from cmm_uq.jobs.verdicts import Verdict, Verdicts

QUANTITY = frozenset({"value", "u", "interval95", "U", "k"})
"""Keys of a quantity."""

_DIGITS = 2e-9
"""Of numbers of ten digits: what a difference of two of them may be off, of the larger."""

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
    """Keep every figure that another one contradicts.

    Parameters
    ----------
    data : of results.json.
    file : its name.
    """
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
