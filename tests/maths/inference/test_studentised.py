"""Residuals in units of their own standard deviations, against dense algebra."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from cmm_uq.maths.inference.least_squares import studentised
from cmm_uq.maths.inference.linear_model import Freedoms, LinearModel, Unknown
from cmm_uq.maths.inference.noise import AXES, GROWTH, PLACING
from tests.maths.inference.test_noise import M, components, covariance


def model(placing: np.ndarray) -> LinearModel:
    """A slope that is fitted and a certified bow that is not."""
    design = np.column_stack([np.linspace(-1, 1, M), np.linspace(-1, 1, M) ** 2])
    unknowns = (Unknown(("a", "a"), "1", 0.0, 3.0, 3.0), Unknown(("b", "b"), "1", 1.0, 0.5, 0.1, known=True))
    return LinearModel(np.zeros(M), design, unknowns, placing, np.ones(M), None)


@pytest.mark.parametrize("blocks", [0, 1, 2])
def test_each_has_the_variance_of_a_reading_whatever_the_fit_takes_of_it(blocks: int) -> None:
    """The same factors for every recording: of the noise' covariance Σ the rows of the matrix A leave diag(A·Σ·Aᵀ) = σ²."""
    noise = components((AXES, PLACING, GROWTH))
    sizes = noise.sizes(np.full((1, noise.dimension), 0.7))
    half = (np.arange(M) < M // 2).astype(float)
    linear = model(np.column_stack([half, 1 - half])[:, :blocks])
    A = np.column_stack([studentised(linear, noise, sizes, each) for each in np.eye(M)])
    assert len(A) == M
    assert np.diag(A @ covariance(noise, sizes) @ A.T) == pytest.approx(np.full(M, sizes.coordinate[0] ** 2), rel=1e-9)
    fitted = np.column_stack([linear.design[:, 0], linear.placing])
    assert np.allclose(A @ fitted, 0, atol=1e-9)
    assert not np.allclose(A @ linear.design[:, 1], 0, atol=0.1)


def test_the_mean_of_repeats_that_are_a_placing_by_themselves_says_nothing() -> None:
    """Its placing takes all of it; what differs between the two repeats stays."""
    noise = components(())
    sizes = noise.sizes(np.zeros((1, noise.dimension)))
    placed = Freedoms(np.ones((M, 1)), (np.arange(M) > 1).astype(np.int64), 2)
    linear = replace(model(np.zeros((M, 0))), placing=placed)
    own = np.arange(M) == 0
    assert len(studentised(linear, noise, sizes, np.zeros(M))) == M - 1
    assert np.abs(studentised(linear, noise, sizes, own.astype(float))).max() > 0.5
