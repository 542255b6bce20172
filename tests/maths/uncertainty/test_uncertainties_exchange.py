"""Exchange with the package uncertainties, and its propagation as a second way."""

from __future__ import annotations

import numpy as np
import pytest

from cmm_uq.maths.uncertainty.distributions import normal
from cmm_uq.maths.uncertainty.evaluation import Request, evaluate
from cmm_uq.maths.uncertainty.measurement_model import MeasurementModel
from cmm_uq.maths.uncertainty.propagation import first_order
from cmm_uq.maths.uncertainty.type_a import multivariate_normal
from cmm_uq.maths.uncertainty.uncertainties_exchange import (
    evaluation_to_uncertainties,
    from_uncertainties,
    to_uncertainties,
)

pytest.importorskip("uncertainties")

V = np.array([[0.04, 0.01, 0.0], [0.01, 0.09, -0.02], [0.0, -0.02, 0.01]])


def test_both_packages_propagate_alike() -> None:
    from uncertainties import covariance_matrix, umath

    x, y, z = to_uncertainties(np.array([1.0, 2.0, 0.5]), V)
    theirs = [umath.sqrt(x * y) + umath.sin(z), x / y - z**3]
    joint = multivariate_normal(["x", "y", "z"], np.array([1.0, 2.0, 0.5]), V)
    ours = first_order(
        MeasurementModel(
            lambda x, y, z: {"a": np.sqrt(x * y) + np.sin(z), "b": x / y - z**3},
            joint.inputs,
            ("a", "b"),
            joint.correlation,
        )
    )
    np.testing.assert_allclose(ours.value, [t.nominal_value for t in theirs], rtol=1e-14)
    np.testing.assert_allclose(ours.covariance, covariance_matrix(theirs), rtol=1e-12)


def test_there_and_back_again() -> None:
    x, y, z = to_uncertainties(np.array([1.0, 2.0, 0.5]), V)
    back = from_uncertainties({"x": x, "y": y, "c": 3.0 + (x - x), "z": z})
    assert list(back.inputs) == ["x", "y", "c", "z"]
    assert back.inputs["c"].kind == "constant"
    assert [float(back.inputs[n].u) for n in "xyz"] == pytest.approx(np.sqrt(np.diagonal(V)))
    assert back.correlation["x", "y"] == pytest.approx(0.01 / 0.06)


def test_an_evaluation_keeps_its_correlation() -> None:
    from uncertainties import correlation_matrix

    model = MeasurementModel(
        lambda a, b: {"s": a + b, "d": a - b}, {"a": normal(1.0, 0.1), "b": normal(2.0, 0.2)}, ("s", "d")
    )
    found = evaluation_to_uncertainties(evaluate(model, Request(method="first")))
    assert found["s"].std_dev == pytest.approx(np.hypot(0.1, 0.2))
    assert correlation_matrix([found["s"], found["d"]])[0, 1] == pytest.approx((0.01 - 0.04) / 0.05)
