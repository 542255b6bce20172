"""From a measurement model to a stated result, and the self-test."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from cmm_uq.base.errors import CmmUqError
from cmm_uq.maths.uncertainty.budget import Labels
from cmm_uq.maths.uncertainty.distributions import normal, rectangular, student_t
from cmm_uq.maths.uncertainty.evaluation import Request, compare, evaluate, one_at_a_time
from cmm_uq.maths.uncertainty.measurement_model import MeasurementModel
from cmm_uq.maths.uncertainty.reference.jcgm import ReferenceCase
from cmm_uq.maths.uncertainty.reference.selftest import HEADINGS, REFERENCE_CASES, as_text, run


def test_a_linear_model_of_normal_inputs_is_stated_by_first_order() -> None:
    model = MeasurementModel(lambda a, b: 2.0 * a - b, {"a": normal(1.0, 0.1), "b": normal(0.0, 0.2)})
    stated = evaluate(model).stated["y"]
    assert stated.method == "first"
    assert "First order is confirmed" in stated.reason
    assert "clause 8" in stated.reason
    assert stated.coverage_factor == pytest.approx(1.95996, abs=1e-5)
    assert stated.u == pytest.approx(np.hypot(0.2, 0.2))


def test_mass_is_stated_by_second_order_to_one_digit_and_by_monte_carlo_to_two(mass: MeasurementModel) -> None:
    # 9.3.2.6: first order fails (d ≈ 0.044 against δ = 0.005); with higher-order terms d ≈ 0.003
    one, two = (evaluate(mass, Request(digits=digits, seed=3)) for digits in (1, 2))
    assert one.stated["y"].method == "second"
    assert two.stated["y"].method == "monte_carlo"
    assert one.ways.first is not None
    assert one.ways.simulated is not None
    assert one.ways.second is not None
    assert two.ways.simulated is not None
    first = compare(one.ways.first, one.ways.simulated, 0, 1)
    assert (first.low, first.high) == pytest.approx((0.044, 0.044), abs=0.003)
    assert first.tolerance == 0.005
    assert not first.agrees
    second = compare(one.ways.second, two.ways.simulated, 0, 2)
    assert max(second.low, second.high) == pytest.approx(0.003, abs=0.001)
    assert second.tolerance == 0.0005


def test_a_flat_model_is_stated_by_monte_carlo_and_the_reason_says_so(loss: Callable[..., MeasurementModel]) -> None:
    evaluation = evaluate(loss(0.0, 0.0))
    stated = evaluation.stated["y"]
    assert stated.method == "monte_carlo"
    assert "First order gives u = 0, since the model is flat" in stated.reason
    assert stated.u == pytest.approx(50e-6, rel=0.01)
    assert evaluation.ways.first is not None
    assert evaluation.ways.first.u[0] == 0


def test_a_flat_model_is_refused_by_first_order_alone(loss: Callable[..., MeasurementModel]) -> None:
    with pytest.raises(CmmUqError, match="first order gives u = 0 for y although its inputs are uncertain"):
        evaluate(loss(0.0, 0.0), Request(method="first"))
    with pytest.raises(CmmUqError, match="gives u = 0"):  # flat but for rounding
        evaluate(MeasurementModel(lambda x: np.cos(x * np.pi), {"x": normal(1.0, 0.1)}), Request(method="first"))


def test_a_method_asked_for_is_used_and_what_it_leaves_out_is_told(end_gauge: MeasurementModel) -> None:
    first = evaluate(end_gauge, Request(method="first", coverage=0.99)).stated["y"]
    assert first.u == pytest.approx(31.66, abs=0.01)
    assert first.reason == "Asked for; not confirmed by Monte Carlo. Second order gives u = 34."
    second = evaluate(end_gauge, Request(method="second", coverage=0.99)).stated["y"]
    assert second.u == pytest.approx(33.81, abs=0.01)
    simulated = evaluate(end_gauge, Request(method="monte_carlo", coverage=0.99, digits=1)).stated["y"]
    assert simulated.method == "monte_carlo"


def test_what_has_no_derivative_is_stated_by_monte_carlo() -> None:
    inputs = {"x1": normal(0.0, 0.01), "x2": normal(0.0, 0.01)}
    stated = evaluate(MeasurementModel(lambda x1, x2: np.sqrt(x1**2 + x2**2), inputs)).stated["y"]
    assert stated.method == "monte_carlo"
    assert "derivative of y by x1 is not finite" in stated.reason
    assert stated.u == pytest.approx(0.01 * np.sqrt(2 - np.pi / 2), rel=0.01)  # Rayleigh


def test_where_monte_carlo_cannot_draw_the_law_of_propagation_stands_unconfirmed() -> None:
    model = MeasurementModel(lambda x, y: x + y, {"x": student_t(0.0, 1.0, 2.0), "y": normal(0.0, 1.0)})
    stated = evaluate(model).stated["y"]
    assert stated.method == "first"
    assert "Not confirmed by Monte Carlo, which is impossible here: x has too few degrees of freedom" in stated.reason
    bent = MeasurementModel(lambda x, y: x + y + x * y, {"x": student_t(0.0, 1.0, 2.0), "y": normal(0.0, 1.0)})
    assert evaluate(bent).stated["y"].method == "second"


def test_each_output_has_its_own_method_and_all_share_a_correlation() -> None:
    inputs = {"x": normal(0.0, 1.0), "y": normal(0.0, 2.0)}
    model = MeasurementModel(lambda x, y: {"sum": x + y, "square": x * x}, inputs, ("sum", "square"))
    evaluation = evaluate(model)
    assert [stated.method for stated in evaluation.stated.values()] == ["first", "monte_carlo"]
    assert evaluation.correlation.shape == (2, 2)
    assert abs(evaluation.correlation[0, 1]) < 0.02


def test_contributions_by_monte_carlo_are_those_of_each_input_alone(loss: Callable[..., MeasurementModel]) -> None:
    # annex B: alone, x2 ~ N(0, u²) gives u(x2²) = √2 u²
    alone = one_at_a_time(loss(0.0, 0.0), seed=2)
    assert np.sqrt(alone[0]) == pytest.approx(np.sqrt(2) * 25e-6, rel=0.02)
    budget = evaluate(loss(0.0, 0.9)).stated["y"].budget
    assert sum(budget.shares) == pytest.approx(1.0)
    assert [line.name for line in budget.lines] == ["x1", "x2", "together"]
    assert budget.u == pytest.approx(67.3e-6, rel=0.01)


def test_an_input_that_has_no_effect_alone_is_counted_with_the_others() -> None:
    # with a held at 0 the model has no value for b alone
    model = MeasurementModel(lambda a, b: np.log(a**2) + b, {"a": normal(0.0, 1.0), "b": normal(0.0, 1.0)})
    alone = one_at_a_time(model)
    assert alone[0, 1] == 0
    assert alone[0, 0] > 0
    assert sum(evaluate(model).stated["y"].budget.shares) == pytest.approx(1)


def test_labels_reach_the_budget() -> None:
    model = MeasurementModel(lambda x: x, {"x": rectangular(-1.0, 1.0)})
    labels = Labels({"x": "mm", "y": "mm"}, {"x": "specification"})
    budget = evaluate(model, Request(method="first"), labels).stated["y"].budget
    assert (budget.unit, budget.lines[0].unit, budget.lines[0].origin) == ("mm", "mm", "specification")


def test_what_monte_carlo_cannot_decide_is_neither_confirmed_nor_refuted() -> None:
    model = MeasurementModel(lambda x: x, {"x": normal(0.0, 0.999)})
    stated = evaluate(model, Request(digits=3, largest=200_000)).stated["y"]
    assert stated.method == "first"
    assert "neither confirmed nor refuted" in stated.reason
    assert "not stable to 3 digits after 200000 trials" in stated.reason


def test_the_spread_of_a_quantity_without_standard_deviation_confirms_nothing() -> None:
    # a ratio whose denominator comes near zero: the standard deviation of its draws grows without end
    model = MeasurementModel(lambda x, y: x / y, {"x": normal(1.0, 0.1), "y": normal(1.0, 0.3)})
    stated = evaluate(model, Request(largest=300_000, seed=5)).stated["y"]
    assert stated.method == "monte_carlo"
    assert "not stable" in stated.reason


def test_a_coverage_that_needs_too_many_trials_leaves_the_law_of_propagation_unconfirmed() -> None:
    model = MeasurementModel(lambda x: x, {"x": normal(0.0, 1.0)})
    stated = evaluate(model, Request(coverage=0.999999)).stated["y"]
    assert (stated.method, stated.coverage_factor) == ("first", pytest.approx(4.8916, abs=1e-4))
    assert "needs too many trials" in stated.reason
    with pytest.raises(CmmUqError, match="one look at the tails"):
        evaluate(model, Request(method="monte_carlo", coverage=0.999999))


def test_an_evaluation_is_of_one_point() -> None:
    model = MeasurementModel(lambda x: x, {"x": normal(np.zeros(3), 1.0)})
    with pytest.raises(CmmUqError, match="x has several values"):
        evaluate(model, Request(method="first"))


@pytest.mark.parametrize(
    ("wrong", "problem"),
    [
        ({"method": "firts"}, "Did you mean 'first'"),
        ({"digits": 0}, "0 significant digits"),
        ({"coverage": 95.0}, "coverage probability of 95"),
        ({"seed": -1}, "seed of -1"),
    ],
)
def test_impossible_requests_are_refused(wrong: dict[str, object], problem: str) -> None:
    with pytest.raises(CmmUqError, match=problem):
        Request(**wrong)


@pytest.mark.parametrize("case", REFERENCE_CASES, ids=lambda case: case.title)
def test_the_published_figures_come_out(case: ReferenceCase) -> None:
    failed = [outcome for outcome in run([case]) if not outcome.passed]
    assert failed == []


def test_a_wrong_figure_or_none_is_noticed() -> None:
    case = ReferenceCase("sum", "arithmetic", {"a": (2.0, 0.1), "b": (2.0, 0.1), "c": (2.0, 0.1)}, wrong)
    assert [outcome.passed for outcome in run([case])] == [True, False, False]


def wrong() -> list[float]:
    return [2.05, 2.2, float("nan")]


def test_every_row_has_its_source() -> None:
    case = ReferenceCase("sum", "arithmetic", {"a": (2.0, 0.1), "b": (-2.0, 1e-12)}, lambda: [2.05, -2.0])
    rows = as_text(run([case]))
    assert rows == [
        ("sum: a", "2", "0.1", "2.05", "arithmetic", "pass"),
        ("sum: b", "−2", "1e−12", "−2", "arithmetic", "pass"),
    ]
    assert all(len(row) == len(HEADINGS) for row in rows)
