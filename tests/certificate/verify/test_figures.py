"""Figures that contradict each other, decisions that do not follow, dates out of order: each is named with its place."""

from __future__ import annotations

import copy
import json
import math
from pathlib import Path
from typing import Any

import pytest

from cmm_uq.certificate.verify.decisions import check_decisions
from cmm_uq.certificate.verify.figures import check_figures, check_verdicts
from cmm_uq.certificate.verify.given import Inquiry


@pytest.fixture
def data(made: Path) -> dict[str, Any]:
    """Of results.json."""
    found: dict[str, Any] = json.loads((made / "results.json").read_bytes())
    return found


def places(check: Any, data: dict[str, Any]) -> list[str]:
    inquiry = Inquiry()
    check(inquiry, data, "results.json")
    return [one.place for one in inquiry.findings]


def changed(data: dict[str, Any], path: str, value: Any) -> dict[str, Any]:
    """A copy with one value in place of another; a function is given the old one."""
    new = copy.deepcopy(data)
    *way, last = [int(key) if key.isdigit() else key for key in path.split(".")]
    inner: Any = new
    for key in way:
        inner = inner[key]
    inner[last] = value(inner[last]) if callable(value) else value
    return new


def test_the_figures_of_a_certificate_agree(data: dict[str, Any]) -> None:
    assert not places(check_figures, data)
    assert not places(check_decisions, data)
    assert not places(check_verdicts, data)


@pytest.mark.parametrize(("path", "value", "place"), [
    ("verdicts.overall", "pass", "verdicts.overall"),
    ("verdicts.statements.0.value", 33.9, "verdicts.statements"),
    ("verdicts.statements.0.missing", [], "verdicts.statements"),
    ("verdicts.statements.0.U", lambda U: U * (1 + 1e-6), "verdicts.statements[0].U"),
    ("verdicts.statements", [], "verdicts.statements"),
    ("tolerances", {"scale_x": {"ppm": 900.0, "verdict": "in"}}, "verdicts.statements"),
])  # fmt: skip
def test_a_verdict_that_was_not_decided_is_named(data: dict[str, Any], path: str, value: Any, place: str) -> None:
    assert place in places(check_verdicts, changed(data, path, value))


@pytest.mark.parametrize(("path", "value", "place"), [
    ("estimates.scale_x.ppm.U", lambda U: U * (1 + 1e-6), "estimates.scale_x.ppm.U"),
    ("estimates.scale_x.ppm.k", 2.0, "estimates.scale_x.ppm.k"),
    ("accuracy_uncertainty.b89_range_um.interval95.1", 300.0, "accuracy_uncertainty.b89_range_um.interval95"),
    ("accuracy.b89_range_um", lambda value: value + 1.0, "accuracy.b89_range_um"),
    ("covariance.matrix.1.1", lambda value: value * 1.001, "covariance.matrix[1][1]"),
    ("covariance.matrix.0.1", lambda value: -value, "covariance.matrix[1][0]"),
    ("sampling.ess_min", -1.0, "sampling.ess_min"),
])  # fmt: skip
def test_a_figure_that_another_contradicts_is_named(data: dict[str, Any], path: str, value: Any, place: str) -> None:
    assert place in places(check_figures, changed(data, path, value))


def test_a_verdict_on_a_tolerance_follows_from_the_interval(data: dict[str, Any]) -> None:
    """The interval of the squareness XY is −190″ to −159″: out of ±100″, inside ±200″, across −160″."""
    for tolerance, verdict in ((100.0, "out"), (200.0, "in"), (160.0, "open")):
        said = {"squareness_xy": {"angle_arcsec": tolerance, "verdict": verdict}}
        assert not places(check_figures, data | {"tolerances": said})
        other = {"squareness_xy": {"angle_arcsec": tolerance, "verdict": "open" if verdict == "in" else "in"}}
        assert places(check_figures, data | {"tolerances": other}) == ["tolerances.squareness_xy.verdict"]


@pytest.mark.parametrize(("path", "value", "place"), [
    ("conformity.0.decision", "pass", "conformity[0].decision"),
    ("conformity.0.errors.0.outcome", "pass", "conformity[0].errors[0].outcome"),
    ("conformity.0.limit_um", 600.0, "conformity[0]"),
    ("conformity.0.value_um", 33.9, "conformity[0]"),
    ("conformity.0.errors.0.U_um", lambda U: U / 2, "conformity[0].errors[0].U_um"),
    ("conformity.0.errors.0.probability_conforming", 0.5, "conformity[0].errors[0].probability_conforming"),
    ("conformity.0.errors.0.guard_band_um", lambda band: band + 1, "conformity[0].errors[0].guard_band_um"),
    ("conformity.0.scope", "complete", "conformity[0].scope"),
    ("conformity.0.rule", "guard_band = 5", "conformity[0].errors[0].guard_band_um"),
    ("conformity.0.missing", [], "conformity[0].scope"),
])  # fmt: skip
def test_a_decision_that_does_not_follow_is_named(data: dict[str, Any], path: str, value: Any, place: str) -> None:
    assert place in places(check_decisions, changed(data, path, value))


def statement(error: float, *, outcome: str, probability: float, band: float, mpe: Any = None) -> dict[str, Any]:
    """A statement of one length by ISO 14253-1, u = 1 µm, limit 3 µm."""
    one = {"measurement": 1, "repeat": None, "length_mm": 300.0, "error_um": error, "u_um": 1.0, "U_um": 2.0, "limit_um": 3.0,
           "probability_conforming": probability, "outcome": outcome, "guard_band_um": band, "position": None,
           "standing": "counts"}  # fmt: skip
    return {"standard": "ISO 10360-2:2009", "characteristic": "E0", "quantity": "", "value_um": abs(error), "limit_um": 3.0,
            "u_um": 1.0, "rule": "ISO 14253-1", "guard_band_um": band, "decision": outcome,
            "probability_conforming": probability, "scope": "complete", "missing": [], "remarks": [],
            "probability_all_conform": None, "mpe": mpe, "prior": None, "global_risks": None, "test_uncertainty": None,
            "errors": [one]}  # fmt: skip


def normal(x: float) -> float:
    return 0.5 * math.erfc(-x / math.sqrt(2))


def band() -> float:
    """Guard band of u = 1 and ±3, by bisection: at 3 less it 5 % lie beyond either limit."""
    low, high = 0.0, 3.0
    for _ in range(60):
        middle = (low + high) / 2
        beyond = 1 - normal(middle) + normal(middle - 6.0)
        low, high = (middle, high) if beyond > 0.05 else (low, middle)
    return low


@pytest.mark.parametrize(
    ("error", "outcome"), [(-1.2, "pass"), (-2.5, "undecided"), (3.5, "undecided"), (-5.0, "fail")]
)
def test_a_length_is_decided_as_the_normal_distribution_says(error: float, outcome: str) -> None:
    """By the error function of the standard library: pass from 95 %, fail from 5 % (ISO 14253-1:2017)."""
    probability = normal(3.0 - error) - normal(-3.0 - error)
    said = statement(error, outcome=outcome, probability=probability, band=band())
    assert not places(check_decisions, {"conformity": [said]})
    other = "fail" if outcome == "pass" else "pass"
    assert "conformity[0].decision" in places(check_decisions, {"conformity": [said | {"decision": other}]})


def test_a_limit_follows_from_its_formula() -> None:
    """2 + 300/300 = 3; with K = 200 it were 3.5."""
    said = statement(-1.2, outcome="pass", probability=normal(4.2) - normal(-1.8), band=band())
    right = said | {"mpe": {"a_um": 2.0, "k": 300.0, "b_um": None}}
    assert not places(check_decisions, {"conformity": [right]})
    wrong = said | {"mpe": {"a_um": 2.0, "k": 200.0, "b_um": None}}
    assert places(check_decisions, {"conformity": [wrong]}) == ["conformity[0].errors[0].limit_um"]
