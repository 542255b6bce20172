"""Methods beside each other: Eₙ by its definition, and sentences that change with the figures."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from cmm_uq.analysis.parts.budget import VarianceShares as Shares
from cmm_uq.analysis.parts.methods.method import MethodComparison, MethodFigure, MethodResult
from cmm_uq.analysis.parts.methods.of_job import compare_methods, family_shares, small
from cmm_uq.analysis.parts.result import StatedCharacteristic
from cmm_uq.base.messages import say
from cmm_uq.base.units import ARCSECOND, unit
from cmm_uq.maths.uncertainty.budget import REPEATS, Budget, BudgetLine

NAME = "d"
STATED = StatedCharacteristic(NAME, 20.001, 0.0, 5e-3, (19.991, 20.011), 2.0)
CAUSES = ("machine: scale_x", "machine: squareness_xy", "noise: reading", "form: form of bore")
TOTAL = np.array([[0.30], [0.34], [0.32], [0.04]])
# virtual measurements: u = 5 µm, 64 % of the variance from the machine, 32 % from noise, 4 % from form
SHARES = Shares((NAME,), CAUSES, TOTAL, TOTAL, (), np.zeros((0, 1)), np.array([5e-3]))


def figure(**changes: object) -> MethodFigure:
    """U = 2 · 1.5 µm; what varied scattered by 5 µm · √0.32 = 2.83 µm."""
    budget = Budget(say("b"), [BudgetLine(say("all"), 1.5e-3, REPEATS, unit=unit("mm"))], 2e-3, unit("mm"), factor=2.0)
    given = {"value": 19.999, "systematic": 2e-3, "scatter": 2.83e-3, "scatter_dof": 19.0}
    return MethodFigure(NAME, budget, **{**given, **changes})  # type: ignore[arg-type]


def method(one: MethodFigure, **seen: str) -> MethodResult:
    return MethodResult("calibrated_part", (one,), (), {"machine": "systematic", "noise": "varied", **seen})  # type: ignore[dict-item]


def found(*methods: MethodResult) -> MethodComparison:
    comparison = compare_methods((STATED,), SHARES, methods)
    assert comparison is not None
    return comparison


def why(one: MethodFigure, **seen: str) -> str:
    return " ".join(found(method(one, **seen)).characteristics[0].why)


def test_families_add_up_their_lines() -> None:
    assert family_shares(SHARES, NAME) == pytest.approx({"machine": 0.64, "noise": 0.32, "form": 0.04})
    doubled = replace(SHARES, total=2 * TOTAL)
    assert family_shares(doubled, NAME) == pytest.approx({"machine": 0.64, "noise": 0.32, "form": 0.04})


def test_e_n_is_the_difference_over_both_expanded_uncertainties() -> None:
    (pair,) = found(method(figure())).characteristics[0].pairs
    assert (pair.one, pair.other) == ("virtual", "calibrated_part")
    assert pair.normalised == pytest.approx(2e-3 / np.hypot(10e-3, 3e-3))


def test_each_two_methods_have_one() -> None:
    other = MethodResult("orientations", (figure(value=20.004),), (), {})
    pairs = found(method(figure()), other).characteristics[0].pairs
    assert [(pair.one, pair.other) for pair in pairs] == [
        ("virtual", "calibrated_part"), ("virtual", "orientations"), ("calibrated_part", "orientations"),
    ]  # fmt: skip
    assert pairs[2].normalised == pytest.approx(-5e-3 / np.hypot(3e-3, 3e-3))


def test_without_a_value_there_is_none() -> None:
    assert found(method(figure(value=None))).characteristics[0].pairs == ()


def test_what_is_not_tested_is_not_compared() -> None:
    assert compare_methods((STATED,), SHARES, ()) is None
    assert found(MethodResult("orientations", (), (), {})).characteristics == ()


def test_the_sentences_say_what_is_systematic_and_what_scatters() -> None:
    told = why(figure())
    assert "u is 0.30 times that of the virtual measurements" in told
    assert (
        "errors of the machine, 64 % of the variance of the virtual measurements, in its systematic error of 2.0 µm"
        in told
    )
    assert "What varied between its measurements would scatter by 2.8 µm by the virtual measurements" in told
    assert "it scattered by 2.8 µm, which chance explains" in told
    assert "form" not in told  # 4 % matter too little
    assert "differ by more" not in told


def test_what_it_does_not_see_is_named_with_its_share() -> None:
    told = why(figure(), machine="unseen")
    assert "does not show errors of the machine: 68 % of the variance" in told
    assert "systematic error" not in told


def test_a_systematic_error_that_stays_is_said_to_stay() -> None:
    assert "not corrected, and is added to U" in why(figure(corrected=False))
    assert "not corrected" not in why(figure())


def test_what_standards_correct_is_named() -> None:
    assert "Standards correct the calibrated part for errors of the machine, 64 %" in why(figure(), machine="corrected")


@pytest.mark.parametrize(
    ("scatter", "words"), [(4.5e-3, "more than chance"), (1.5e-3, "less than chance"), (3e-3, "which chance")]
)
def test_scatter_is_judged_by_its_degrees_of_freedom(scatter: float, words: str) -> None:
    """χ² of 19: a standard deviation within 0.68 and 1.31 of the true one, 19 times of 20."""
    assert words in why(figure(scatter=scatter))


def test_with_few_degrees_of_freedom_chance_explains_more() -> None:
    assert "which chance" in why(figure(scatter=4.5e-3, scatter_dof=3.0))


def test_values_that_contradict_are_said_to() -> None:
    assert "differ by more than their uncertainties allow (Eₙ = 1.05)" in why(figure(value=19.990))


def test_one_measurement_alone_is_told_beside_the_mean() -> None:
    assert "one of them alone would have 4.1 µm" in why(figure(single=4.1e-3))


def test_small_figures_are_in_micrometres_or_seconds() -> None:
    assert small(2.04e-3, angle=False) == "2.0 µm"
    assert small(3 * ARCSECOND, angle=True) == "3.0″"
    assert small(0.0, angle=False).endswith("µm")


def test_a_systematic_error_beyond_what_the_machine_is_known_by_is_told() -> None:
    """U of the virtual measurements is 10 µm about a mean error of nothing."""
    assert "more than their U" in why(figure(systematic=10.5e-3))
    assert "more than their U" not in why(figure(systematic=-9.5e-3))


def test_a_zone_that_is_nearly_nothing_is_told_to_be_too_large() -> None:
    def by_orientations(**changes: object) -> str:
        return " ".join(found(MethodResult("orientations", (figure(**changes),), (), {})).characteristics[0].why)

    assert "d is the width of a zone" in by_orientations(zone=True, value=8e-3)
    assert "width of a zone" not in by_orientations(zone=True, value=9e-3)
    assert "width of a zone" not in by_orientations(value=8e-3)


@pytest.mark.parametrize("systematic", [2e-3, -2e-3])
def test_a_zone_s_systematic_error_is_told_to_be_of_one_direction(systematic: float) -> None:
    """Where it is larger than u, 1.5 µm."""
    assert "deviates as the calibrated part does, in size and direction" in why(
        figure(zone=True, systematic=systematic)
    )
    assert "width of a zone" not in why(figure(zone=True, systematic=0.7 * systematic, value=1e-3))
    assert "width of a zone" not in why(figure(systematic=systematic))


@pytest.mark.parametrize(("error", "told"), [(-3e-3, True), (3e-3, False)])
def test_it_is_the_mean_error_from_which_a_systematic_error_differs(error: float, told: bool) -> None:
    """8 µm are 11 µm from −3 µm, beyond U = 10 µm, and 5 µm from 3 µm."""
    comparison = compare_methods((replace(STATED, error=error),), SHARES, (method(figure(systematic=8e-3)),))
    assert comparison is not None
    assert any("by 11 µm, more than their U" in text for text in comparison.characteristics[0].why) is told
