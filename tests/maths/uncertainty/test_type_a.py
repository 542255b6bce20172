"""Repeated readings, lines, effective degrees of freedom and coverage factors."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.units import unit
from cmm_uq.maths.uncertainty.measurement_model import MeasurementModel
from cmm_uq.maths.uncertainty.propagation import first_order
from cmm_uq.maths.uncertainty.quantity import Quantity
from cmm_uq.maths.uncertainty.type_a import (
    check_coverage,
    coverage_factor,
    effective_dof,
    factor_of_noise,
    multivariate_normal,
    repeated_readings,
    simultaneous_readings,
    straight_line,
)

THERMOMETER = [21.521, 22.012, 22.512, 23.003, 23.507, 23.999, 24.513, 25.002, 25.503, 26.010, 26.511]
CORRECTION = [-0.171, -0.169, -0.166, -0.159, -0.164, -0.165, -0.156, -0.157, -0.159, -0.161, -0.160]


def test_twenty_temperatures() -> None:
    # 4.4.3, table 1: mean 100.14 °C, s = 1.49 °C, s/√20 = 0.33 °C
    t = [96.90, 98.18, 98.25, 98.61, 99.03, 99.49, 99.56, 99.74, 99.89, 100.07]
    t += [100.33, 100.42, 100.68, 100.95, 101.11, 101.20, 101.57, 101.84, 102.36, 102.72]
    found = repeated_readings(t)
    assert found.mean == pytest.approx(100.145, abs=5e-4)
    assert found.u == pytest.approx(0.333, abs=5e-4)
    assert (found.dof, found.kind) == (19, "t")


def test_simultaneous_readings_of_annex_h2(readings: dict[str, list[float]]) -> None:
    # table H.2: means, u and correlation coefficients of voltage, current and phase
    joint = simultaneous_readings(readings)
    given = joint.inputs
    assert [float(given[n].mean) for n in ("V", "I", "phi")] == pytest.approx([4.9990, 19.6610e-3, 1.04446])
    assert given["V"].u == pytest.approx(0.0032, abs=5e-5)
    assert given["I"].u == pytest.approx(0.0095e-3, abs=5e-8)
    assert given["phi"].u == pytest.approx(0.00075, abs=5e-6)
    assert joint.correlation["V", "I"] == pytest.approx(-0.36, abs=5e-3)
    assert joint.correlation["V", "phi"] == pytest.approx(0.86, abs=5e-3)
    assert joint.correlation["I", "phi"] == pytest.approx(-0.65, abs=5e-3)


def test_thermometer_line_of_annex_h3() -> None:
    line = straight_line(THERMOMETER, CORRECTION, reference=20.0)
    assert (line.intercept, line.slope) == pytest.approx((-0.1712, 0.00218), abs=5e-5)
    assert np.sqrt(np.diagonal(line.covariance)) == pytest.approx([0.0029, 0.00067], abs=5e-5)
    assert line.covariance[0, 1] / np.sqrt(np.prod(np.diagonal(line.covariance))) == pytest.approx(-0.930, abs=5e-4)
    assert line.residual_sd == pytest.approx(0.0035, abs=5e-5)
    assert line.dof == 9
    b, u = line.at(30.0)
    assert (float(b), float(u)) == pytest.approx((-0.1494, 0.0041), abs=5e-5)


def test_a_line_goes_into_a_model_with_its_correlation() -> None:
    line = straight_line(THERMOMETER, CORRECTION, reference=20.0)
    joint = line.inputs("y1", "y2")
    model = MeasurementModel(lambda y1, y2: y1 + y2 * 10.0, joint.inputs, correlation=joint.correlation)
    found = first_order(model)
    assert found.u[0] == pytest.approx(float(line.at(30.0)[1]), rel=1e-12)
    assert found.dof[0] == pytest.approx(9)


def test_the_line_does_not_depend_on_its_reference() -> None:
    near, far = straight_line(THERMOMETER, CORRECTION, 24.0), straight_line(THERMOMETER, CORRECTION, 0.0)
    x = np.array([10.0, 24.0, 30.0])
    np.testing.assert_allclose(near.at(x), far.at(x), rtol=1e-9)


def test_a_covariance_matrix_becomes_inputs_and_comes_back() -> None:
    V = np.array([[4.0, -1.0, 0.0], [-1.0, 1.0, 0.2], [0.0, 0.2, 9.0]])
    joint = multivariate_normal(["a", "b", "c"], np.array([1.0, 2.0, 3.0]), V)
    model = MeasurementModel(lambda a, b, c: {"a": a, "b": b, "c": c}, joint.inputs, ("a", "b", "c"), joint.correlation)
    np.testing.assert_allclose(first_order(model).covariance, V, rtol=1e-14, atol=1e-15)


@pytest.mark.parametrize(
    ("readings", "problem"),
    [
        ({"x": [1.0]}, "1 reading of x"),
        ({"x": [1.0, 1.0]}, "all readings of x are the same"),
        ({"x": [1.0, np.nan]}, "not finite"),
        ({"x": [1.0, 2.0], "y": [1.0, 2.0, 3.0]}, "x 2, y 3"),
    ],
)
def test_readings_that_say_nothing_are_refused(readings: dict[str, list[float]], problem: str) -> None:
    with pytest.raises(CmmUqError, match=problem):
        simultaneous_readings(readings)


def test_impossible_lines_and_matrices_are_refused() -> None:
    with pytest.raises(CmmUqError, match="three points"):
        straight_line([1.0, 2.0], [1.0, 3.0])
    with pytest.raises(CmmUqError, match="not symmetric"):
        multivariate_normal(["a", "b"], np.zeros(2), np.array([[1.0, 0.5], [0.4, 1.0]]))
    with pytest.raises(CmmUqError, match="not positive"):
        multivariate_normal(["a", "b"], np.zeros(2), np.diag([1.0, 0.0]))


INDEPENDENT = np.eye(3)
PAIR = np.array([[1.0, 0.5, 0.0], [0.5, 1.0, 0.0], [0.0, 0.0, 1.0]])


@pytest.mark.parametrize("size", [1.0, 1e-90, 1e90])
def test_independent_contributions_by_the_formula(size: float) -> None:
    """Contributions 3, −4 and 12 with 5, 10 and ∞: 169²/(3⁴/5 + 4⁴/10), whatever the unit."""
    found = effective_dof(
        size * np.array([[3.0, -4.0, 12.0]]), INDEPENDENT, [5.0, 10.0, np.inf], size**2 * np.array([169.0])
    )
    assert found == pytest.approx([169**2 / (81 / 5 + 256 / 10)])


def test_of_known_contributions_alone_they_are_infinite() -> None:
    found = effective_dof(
        np.array([[3.0, -4.0, 12.0], [0.0, 0.0, 2.0]]), INDEPENDENT, [np.inf, np.inf, 7.0], np.array([25.0, 4.0])
    )
    assert found[1] == pytest.approx(7.0)
    assert np.isinf(effective_dof(np.array([[3.0, 4.0]]), np.eye(2), [np.inf, np.inf], np.array([25.0]))).all()
    assert np.isinf(effective_dof(np.array([[0.0, 4.0]]), np.eye(2), [3.0, np.inf], np.array([16.0]))).all()


def test_a_correlated_set_is_one_contribution_with_the_degrees_of_freedom_of_its_readings() -> None:
    """3² + 4² − 2·0.5·3·4 = 13 with 6, beside 12² with 9: variance 157."""
    found = effective_dof(np.array([[3.0, -4.0, 12.0]]), PAIR, [6.0, 6.0, 9.0], np.array([157.0]))
    assert found == pytest.approx([157**2 / (13**2 / 6 + 144**2 / 9)])
    alone = effective_dof(np.array([[3.0, -4.0, 0.0]]), PAIR, [6.0, 6.0, 9.0], np.array([13.0]))
    assert alone == pytest.approx([6.0])


def test_where_a_set_has_several_the_smallest_counts_for_all_that_are_not_known() -> None:
    found = effective_dof(np.array([[3.0, 4.0, 12.0]]), PAIR, [8.0, 3.0, np.inf], np.array([181.0]))
    assert found == pytest.approx([181**2 / (37**2 / 3)])
    known = effective_dof(np.array([[3.0, 4.0, 12.0]]), PAIR, [8.0, np.inf, np.inf], np.array([181.0]))
    assert known == pytest.approx([181**2 / (9**2 / 8)])


def test_from_point_to_point_each_has_its_own() -> None:
    contributions = np.array([[[3.0, 1.0], [4.0, 2.0]]])
    dof = [np.array([5.0, np.inf]), 10.0]
    found = effective_dof(contributions, np.eye(2), dof, np.array([[25.0, 5.0]]))
    assert found[0] == pytest.approx([625 / (81 / 5 + 256 / 10), 25 / (16 / 10)])


def test_what_rests_on_nothing_is_known() -> None:
    assert np.isinf(effective_dof(np.zeros((1, 0)), np.zeros((0, 0)), [], np.zeros(1))).tolist() == [True]


@pytest.mark.parametrize("coverage", [0.5, 0.6827, 0.95, 0.99])
def test_the_factor_is_the_quantile_of_t(coverage: float) -> None:
    dof = np.array([1.0, 2.9, 3.999999999, 17.0, 1e6, 1e12, np.inf])
    peers = [stats.t.ppf((1 + coverage) / 2, nu) for nu in (1, 2, 4, 17, 1e6)]
    expected = [*peers, *[stats.norm.ppf((1 + coverage) / 2)] * 2]
    np.testing.assert_allclose(coverage_factor(dof, coverage), expected, rtol=1e-9)


@pytest.mark.parametrize("dof", [0.99, 0.0, np.nan, [5.0, 0.9], [np.nan, 5.0]])
def test_less_than_one_degree_of_freedom_supports_no_interval(dof: float | list[float]) -> None:
    with pytest.raises(CmmUqError, match="support no coverage interval"):
        coverage_factor(np.array(dof), 0.95)


@pytest.mark.parametrize("coverage", [0.0, 1.0, -0.5, 95.0, np.nan])
def test_no_other_number_is_a_probability(coverage: float) -> None:
    with pytest.raises(CmmUqError, match="a coverage probability of"):
        check_coverage(coverage)
    check_coverage(1e-6)
    check_coverage(1 - 1e-6)


def test_a_noise_from_few_residuals_widens_what_it_makes_uncertain() -> None:
    """u(s)/s = (2ν)^−½ (JCGM 100, E.4.3): 0.1890 for 14, of which t is 2.14 (table G.2); 2.36 for 7."""
    for freedom, k in ((14, 2.14), (7, 2.36)):
        noise = Quantity(3.0, 3.0 / np.sqrt(2 * freedom), (2.0, 4.0), unit("µm"))
        assert noise.degrees_of_freedom == pytest.approx(freedom)
        assert factor_of_noise(noise) == pytest.approx(k, abs=0.005)


def test_what_is_known_well_beside_the_noise_brings_k_towards_the_normal() -> None:
    """ν·(u_c/u_noise)⁴ (G.2b): equal parts make four times 14, 56, whose t is 2.00; without noise it is 1.96."""
    noise = Quantity(3.0, 3.0 / np.sqrt(28), (2.0, 4.0), unit("µm"))
    assert factor_of_noise(noise, 2.0, 2.0) == pytest.approx(stats.t.ppf(0.975, 56), rel=1e-9)
    assert factor_of_noise(noise, 0.0, 2.0) == pytest.approx(1.95996, abs=1e-5)
    assert factor_of_noise(Quantity(3.0, 0.0, (3.0, 3.0), unit("µm"))) == pytest.approx(1.95996, abs=1e-5)
