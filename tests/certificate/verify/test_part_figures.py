"""Figures of a part that contradict each other, decisions that do not follow: each is named with its place."""

from __future__ import annotations

import json
from typing import Any

import pytest

from cmm_uq.certificate.verify.again import beyond_sampling, differences
from cmm_uq.certificate.verify.decisions import check_part_decisions
from cmm_uq.certificate.verify.figures import check_part_figures, check_verdicts
from tests.certificate.verify import test_figures
from tests.certificate.verify.test_figures import places
from tests.part_reports import plate_report


def data() -> dict[str, Any]:
    found: dict[str, Any] = json.loads(plate_report()["results.json"])
    return found


def changed(path: str, value: Any) -> dict[str, Any]:
    return test_figures.changed(data(), path, value)


def test_the_figures_of_a_report_agree() -> None:
    assert not places(check_part_figures, data())
    assert not places(check_part_decisions, data())
    assert not places(check_verdicts, data())


@pytest.mark.parametrize(("path", "value", "place"), [
    ("characteristics.0.U", lambda U: U * (1 + 1e-4), "characteristics[0].U"),
    ("characteristics.0.k", 2.5, "characteristics[0].k"),
    ("characteristics.0.value", lambda value: value + 1e-6, "characteristics[0].value"),
    ("characteristics.0.mean_error", lambda error: error + 1e-6, "characteristics[0].value"),
    ("characteristics.0.interval95.1", lambda end: end - 0.1, "characteristics[0].interval95"),
    ("characteristics.0.decision.margin_u", lambda margin: margin * 1.001, "characteristics[0].decision.margin_u"),
    ("characteristics.0.worst_cause", "the moon", "characteristics[0].worst_cause"),
    ("covariance.matrix.0.0", lambda value: value * 1.001, "covariance.matrix[0][0]"),
    ("correlation.matrix.0.0", 0.9, "correlation.matrix[0][0]"),
    ("budget.causes.0.total", [], "budget.causes[0].total"),
])  # fmt: skip
def test_a_figure_that_another_contradicts_is_named(path: str, value: Any, place: str) -> None:
    assert place in places(check_part_figures, changed(path, value))


@pytest.mark.parametrize(("path", "value", "place"), [
    ("characteristics.4.decision.outcome", "fail", "characteristics[4].decision.outcome"),
    ("decision.outcome", "conditional fail", "decision.outcome"),
    ("characteristics.4.limits.accepted.0", lambda end: end - 1.0, "characteristics[4].limits.accepted"),
    ("characteristics.4.limits.accepted.1", 39.99, "characteristics[4].limits.accepted"),
    ("characteristics.4.decision.probability_conforming", 0.4, "characteristics[4].decision.probability_conforming"),
    ("decision.probability_all_conform", 0.01, "decision.probability_all_conform"),
    ("characteristics.4.decision", None, "characteristics[4].decision"),
])  # fmt: skip
def test_a_decision_that_does_not_follow_is_named(path: str, value: Any, place: str) -> None:
    assert data()["characteristics"][4]["decision"]["outcome"] == "pass"
    assert place in places(check_part_decisions, changed(path, value))


def test_what_a_guard_band_accepts_follows_from_u() -> None:
    """So far inside of the limits as U = 2 u times the factor of the band."""
    found = data()
    found["decision"]["rule"] = "guard_band = 0.5"
    for one in found["characteristics"]:
        limits = one["limits"]
        if one["unit"] == "mm" and limits["lower"] is not None:
            limits["accepted"] = [limits["lower"] + one["u"], limits["upper"] - one["u"]]
    assert not [place for place in places(check_part_decisions, found) if "accepted" in place]
    found["characteristics"][4]["limits"]["accepted"][1] += 0.1 * found["characteristics"][4]["u"]
    assert "characteristics[4].limits.accepted" in places(check_part_decisions, found)


def test_a_probability_that_no_distribution_with_this_u_has_is_named() -> None:
    """Cantelli: m standard deviations inside of a limit, at most 1/(1 + m²) lies beyond it."""
    found = data()
    one = found["characteristics"][4]
    margin = one["decision"]["margin_u"]
    assert margin > 2
    one["decision"] |= {"probability_conforming": 0.5, "probability_beyond": 0.5}
    assert "characteristics[4].decision.probability_beyond" in places(check_part_decisions, found)


def test_figures_of_other_kernels_are_held_to_what_draws_and_digits_allow() -> None:
    """All a little off is another processor; what is off by half of its u besides is a finding."""
    drawn, should = data(), data()
    for one in drawn["characteristics"]:
        for key in ("value", "u", "U", "mean_error", "k", "measured"):
            one[key] *= 1 + 1e-10
    drawn["budget"]["causes"][0]["total"][0] += 1e-3
    drawn["characteristics"][0]["value"] += 0.5 * drawn["characteristics"][0]["u"]
    found = [path for path, _, _ in beyond_sampling(drawn, should, differences(drawn, should))]
    assert found == ["characteristics[0].value"]
