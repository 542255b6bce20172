"""Budgets of coordinate metrology: closed forms, printed figures, and Monte Carlo as the second way."""

from __future__ import annotations

import numpy as np
import pytest

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.units import ARCSECOND
from cmm_uq.maths.uncertainty.budget import JUDGEMENT, BudgetLine
from cmm_uq.maths.uncertainty.budgets.machine import (
    expanded_without_correction,
    length_test_uncertainty,
    probing_test_uncertainty,
    use_by_calibrated_workpiece,
    use_by_simulation,
)
from cmm_uq.maths.uncertainty.budgets.measurements import (
    UNITS,
    BallbarPosition,
    ballbar_length,
    harris_compensated,
    harris_uncompensated,
    length_at_20,
    scale_error,
    sphere_budgets,
    sphere_covariance,
    triangle_angles,
)
from cmm_uq.maths.uncertainty.distributions import constant, normal, rectangular
from cmm_uq.maths.uncertainty.evaluation import evaluate
from cmm_uq.maths.uncertainty.propagation import first_order, simulate


def hemisphere(n: int) -> np.ndarray:
    """Directions spread evenly over the upper hemisphere (equal areas, golden angle)."""
    z = (np.arange(n) + 0.5) / n
    angle = np.pi * (3 - np.sqrt(5)) * np.arange(n)
    radius = np.sqrt(1 - z * z)
    return np.column_stack([radius * np.cos(angle), radius * np.sin(angle), z])


def test_seventeen_thousand_points_on_a_hemisphere() -> None:
    # information matrix N [1/3, 1/3, [1/3, 1/2; 1/2, 1]]: u = 9 µm √(3, 3, 12, 4 / 17000)
    covariance = sphere_covariance(hemisphere(17_000), 9e-3)
    assert np.sqrt(np.diagonal(covariance)) * 1e3 == pytest.approx([0.120, 0.120, 0.240, 0.138], abs=1e-3)
    assert covariance[2, 3] / np.sqrt(covariance[2, 2] * covariance[3, 3]) == pytest.approx(-0.866, abs=1e-3)


def test_the_sphere_s_covariance_is_what_repeated_fits_scatter() -> None:
    rng, directions, u = np.random.default_rng(8), hemisphere(200), 0.01
    jacobian = np.column_stack([directions, np.ones(200)])
    fits = np.linalg.lstsq(jacobian, u * rng.standard_normal((200, 20_000)), rcond=None)[0]
    expected = sphere_covariance(directions, u)
    variances = np.diagonal(expected)
    error = np.sqrt((np.outer(variances, variances) + expected**2) / 20_000)  # Wishart
    assert np.all(np.abs(np.cov(fits) - expected) < 5 * error)


def test_form_of_the_ball_does_not_shrink_with_the_number_of_points() -> None:
    # appendix A of Harris 2004: a sphericity of 5.08 µm moves a centre by up to 3 µm
    form = [1e-3, 1e-3, 3e-3, 1e-3]
    few, many = (
        sphere_budgets([0, 0, 0, 38.125], sphere_covariance(hemisphere(n), 9e-3), form) for n in (1_000, 100_000)
    )
    assert few["z"].lines[0].part / many["z"].lines[0].part == pytest.approx(100, rel=1e-2)
    assert few["z"].lines[1].u == many["z"].lines[1].u == pytest.approx(3e-3 / np.sqrt(3))
    assert many["z"].u == pytest.approx(1.73e-3, rel=0.01)


def test_points_that_determine_no_sphere_are_refused() -> None:
    circle = hemisphere(50)
    circle[:, 2] = 0.5
    circle[:, :2] *= np.sqrt(0.75) / np.linalg.norm(circle[:, :2], axis=1, keepdims=True)
    for directions in (circle, hemisphere(3)):
        with pytest.raises(CmmUqError, match="do not determine a sphere"):
            sphere_covariance(directions, 0.01)


def test_the_printed_budgets_of_harris_2004() -> None:
    # 6.2.3: 14 and 20 µm (13.5 and 19.0 before rounding), mean of eight 7 µm; 6.4.1: 26, 41, 52 µm
    compensated = harris_compensated()
    assert compensated.lines[0].u == pytest.approx(13.5e-3, abs=5e-5)
    assert compensated.u == pytest.approx(19.0e-3, abs=5e-5)
    assert compensated.mean_of(8, "mean").u == pytest.approx(7e-3, abs=5e-4)
    for limits, printed in (((12, 18, 6), 26), ((21, 30, 12), 41), ((26, 38, 20), 52)):
        assert harris_uncompensated(limits).u * 1e3 == pytest.approx(printed, abs=0.5)


def position(**changes: object) -> BallbarPosition:
    given: dict[str, object] = {
        "length_mm": 404.2,
        "direction": np.array([0.6, 0.8, 0.0]),
        "centre_covariance_mm2": np.diag([3.0, 3.0, 12.0]) * 0.01**2 / 12_000,
    }
    return BallbarPosition(**{**given, **changes})


def test_scatter_of_thousands_of_points_is_a_fraction_of_a_micrometre() -> None:
    assert ballbar_length(position()).u * 1e3 == pytest.approx(np.sqrt(2 * 3 / 12_000) * 10)


def test_each_effect_enters_the_length_by_its_geometry() -> None:
    scale = ballbar_length(position(scale_mm=(0.012, 0.018, 0.006)))
    part = {line.name: line.contribution for line in scale.lines}
    assert part["scale x"] == pytest.approx(0.012 / np.sqrt(3) * 0.36)
    assert part["scale y"] == pytest.approx(0.018 / np.sqrt(3) * 0.64)
    assert "scale z" not in part
    square = ballbar_length(position(u_squareness_rad=(1 * ARCSECOND,) * 3))
    assert square.lines[-1].contribution == pytest.approx(404.2 * 0.48 * ARCSECOND)
    warm = ballbar_length(position(u_temperature_k=0.1, cte_per_k=12e-6))
    assert warm.lines[-1].contribution == pytest.approx(404.2 * 12e-7)


def test_what_shifts_both_balls_alike_cancels_in_their_distance() -> None:
    apart = ballbar_length(position(probe_mm=0.009)).u
    alike = ballbar_length(position(probe_mm=0.009, probe_common=1.0)).u
    assert apart == pytest.approx(0.009 * np.sqrt(2 / 3), rel=1e-3)
    assert alike == pytest.approx(ballbar_length(position()).u, rel=1e-9)


def test_only_scatter_averages_out_over_positions() -> None:
    one = ballbar_length(position(form_shift_mm=0.003, scale_mm=(0.012, 0.018, 0.006)))
    mean = one.mean_of(20, "mean of 20")
    scatter = sum(line.part for line in one.lines if not line.shared)
    assert one.variance - mean.variance == pytest.approx(scatter * 19 / 20)


def test_a_direction_must_have_unit_length() -> None:
    with pytest.raises(CmmUqError, match="unit vector"):
        position(direction=np.array([1.0, 1.0, 0.0]))


def test_a_warm_length_is_brought_to_20_degrees() -> None:
    model = length_at_20(normal(1000.0, 1e-3), normal(22.0, 0.1), rectangular(10.5e-6, 12.5e-6))
    found = first_order(model)
    assert found.value[0] == pytest.approx(1000 / (1 + 11.5e-6 * 2), rel=1e-15)
    part = dict(zip(found.inputs, np.abs(found.contribution[0]), strict=True))
    assert part["workpiece_c"] == pytest.approx(1000 * 11.5e-6 * 0.1, rel=1e-4)
    assert part["workpiece_cte_per_k"] == pytest.approx(1000 * 2 * 1e-6 / np.sqrt(3), rel=1e-4)
    assert UNITS["workpiece_cte_per_k"] == "1/K"


def test_scale_and_workpiece_of_the_same_steel_expand_together() -> None:
    # the same temperature, measured by one thermometer: only the difference of the coefficients counts
    both = normal(25.0, 0.5), constant(11.5e-6)
    model = length_at_20(constant(1000.0), *both, *both, correlation={("workpiece_c", "scale_c"): 1.0})
    assert first_order(model).u[0] == pytest.approx(0, abs=1e-9)


def test_at_20_degrees_the_coefficient_still_counts_by_second_order() -> None:
    # L u(α) u(t): H.1.7's effect; first order alone would lose it
    model = length_at_20(constant(1000.0), normal(20.0, 0.5), normal(11.5e-6, 2e-6))
    evaluation = evaluate(model)
    assert evaluation.ways.second is not None
    assert evaluation.ways.first is not None
    lost = evaluation.ways.second.u[0] ** 2 - evaluation.ways.first.u[0] ** 2
    assert lost == pytest.approx((1000 * 0.5 * 2e-6) ** 2, rel=1e-4)


def test_scale_error_from_a_calibrated_length() -> None:
    model = scale_error(normal(500.010, 5e-4), normal(500.0, 1e-4), normal(20.0, 0.1), constant(11.5e-6))
    found = first_order(model)
    assert found.value[0] == pytest.approx(-20e-6, rel=1e-4)
    assert found.u[0] == pytest.approx(np.sqrt(1e-6**2 + 0.2e-6**2 + 1.15e-6**2), rel=1e-4)


def test_angles_of_a_triangle_add_up_to_pi_whatever_the_sides() -> None:
    model = triangle_angles(normal(300.0, 1e-3), normal(400.0, 1e-3), normal(500.0, 2e-3))
    found = first_order(model)
    assert found.value == pytest.approx([np.arcsin(0.6), np.arcsin(0.8), np.pi / 2])
    assert found.covariance.sum() == pytest.approx(0, abs=1e-18)
    # right angle: γ changes by da/(c·sin α …) as −c/(ab) dc etc.: dγ = (c dc − a da − b db)/(a b)
    assert found.u[2] == pytest.approx(np.sqrt((500 * 2e-3) ** 2 + (300e-3) ** 2 + (400e-3) ** 2) / 120_000)
    drawn = simulate(model, 50_000, seed=4)
    assert drawn.u == pytest.approx(found.u, rel=5 / np.sqrt(2 * 50_000))


def test_sides_that_do_not_close_are_refused() -> None:
    with pytest.raises(CmmUqError, match="close to no triangle"):
        triangle_angles(normal(300.0, 1e-3), normal(400.0, 1e-3), normal(800.0, 2e-3))


def test_the_test_uncertainty_leaves_the_machine_out_and_says_so() -> None:
    budget = length_test_uncertainty(
        500.0, 0.2e-3, temperature_c=21.0, cte_per_k=11.5e-6, u_cte_per_k=1e-6, u_temperature_k=0.05
    )
    expected = np.sqrt(0.2e-3**2 + (500 * 1 * 1e-6) ** 2 + (500 * 11.5e-6 * 0.05) ** 2)
    assert budget.u == pytest.approx(expected)
    assert budget.expanded == pytest.approx(2 * expected)
    assert "not the uncertainty of a measurement made with the machine" in budget.statement
    assert probing_test_uncertainty(0.2e-3, 0.05e-3).u == pytest.approx(np.hypot(0.1e-3, 0.05e-3))


def test_use_of_the_machine_by_a_calibrated_workpiece() -> None:
    readings = 100.0042 + 1e-3 * np.sin(np.arange(20.0) * 7)
    budget = use_by_calibrated_workpiece(
        readings, 100.0, 0.5e-3, temperature_c=22.0, u_cte_workpieces_per_k=1e-6, u_form_mm=0.3e-3
    )
    u_p = readings.std(ddof=1)
    assert budget.value == pytest.approx(readings.mean() - 100.0)
    assert budget.expanded == pytest.approx(2 * np.sqrt(0.5e-3**2 + u_p**2 + (2 * 1e-6 * 100) ** 2 + 0.3e-3**2))
    assert expanded_without_correction(budget) == pytest.approx(budget.expanded + abs(readings.mean() - 100.0))
    assert "not the test uncertainty" in budget.statement
    with pytest.raises(CmmUqError, match="19 readings"):
        use_by_calibrated_workpiece(readings[:19], 100.0, 0.5e-3)


def test_use_of_the_machine_by_simulation() -> None:
    errors = np.random.default_rng(1).normal(1e-3, 2e-3, 1000)
    budget = use_by_simulation(errors, [BudgetLine("workpiece temperature", 1e-3, JUDGEMENT, unit="mm")])
    assert budget.u == pytest.approx(np.hypot(errors.std(ddof=1), 1e-3))
    assert budget.value == pytest.approx(errors.mean())
    with pytest.raises(CmmUqError, match="99 simulated"):
        use_by_simulation(errors[:99])
