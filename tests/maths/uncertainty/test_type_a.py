"""Type A evaluation: JCGM 100:2008 4.4.3, H.2 and H.3."""

from __future__ import annotations

import numpy as np
import pytest

from cmm_uq.base.errors import CmmUqError
from cmm_uq.maths.uncertainty.measurement_model import MeasurementModel
from cmm_uq.maths.uncertainty.propagation import first_order
from cmm_uq.maths.uncertainty.type_a import multivariate_normal, repeated_readings, simultaneous_readings, straight_line

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
