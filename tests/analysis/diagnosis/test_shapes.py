"""Shapes of the noise: what is known of all sizes together says nothing of their proportions."""

from __future__ import annotations

import numpy as np
import pytest

from cmm_uq.analysis.diagnosis.noise_shapes import _Density, _determined, _with_rivals, _without_rivals, drawn_shapes
from cmm_uq.base.units import unit
from cmm_uq.maths.inference.least_squares import solve
from cmm_uq.maths.inference.linear_model import LinearModel, Unknown
from cmm_uq.maths.inference.marginal import Marginal
from tests.maths.inference.test_noise import M, components


def linear(rivals: int, sd: float) -> tuple[LinearModel, np.ndarray]:
    """Twelve observations of a constant, 1 µm of white noise, and columns of what could be missing."""
    random = np.random.default_rng(4)
    model = LinearModel(
        1e-3 * random.standard_normal(M), np.ones((M, 1)), (Unknown(("one", "mm"), unit("mm"), 0.0, np.inf, 1.0),),
        np.zeros((M, 0)), np.ones(M), None,
    )  # fmt: skip
    return model, sd * random.standard_normal((M, rivals))


@pytest.mark.parametrize("rivals", [0, 1, 5])
def test_shapes_that_differ_in_all_sizes_alike_are_equally_probable(rivals: int) -> None:
    """Their size is integrated out: with rivals that may be far larger it does not matter from where it is counted."""
    model, columns = linear(rivals, 1e3)
    estimate, noise = solve(model), components()
    taken = _determined(model, columns, estimate.sigma_of_residuals)
    assert taken == pytest.approx(rivals, abs=1e-6)
    marginal = Marginal(_with_rivals(model, columns), noise, _without_rivals(estimate, rivals))
    density = _Density.of(marginal, taken, noise)
    latent = drawn_shapes(noise)[:40]
    larger = latent + np.array([np.log(20.0), *np.zeros(latent.shape[1] - 1)])
    one, other = (density.log_probability(shapes) for shapes in (latent, larger))
    np.testing.assert_allclose(other - one, 0.0, atol=1e-3)
