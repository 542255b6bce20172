"""Recordings drawn from the priors, their ranks, and the page that is written of them."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import sparse, stats

from benchmarks.ranks.drawn import Design, drawn, latent
from benchmarks.ranks.measuring import Case, ranked
from benchmarks.ranks.ranking import DRAWS
from cmm_uq.base.units import unit
from cmm_uq.maths.inference.linear_model import LinearModel, Unknown
from cmm_uq.maths.inference.noise import AXES, GROWTH, PLACING, Components


def components(*possible: str) -> Components:
    """Four observations, two along x and two along y, of a coordinate whose noise is stated as 2 µm."""
    shares = np.repeat([[1.0, 0, 0, 1, 0.5, 1], [0, 1.0, 0, 1, 1, 1]], 2, axis=0)
    return Components(sparse.eye_array(4, format="csr"), shares, np.zeros((4, 0)), np.zeros(0), possible, stated=2e-3)


def test_the_noise_of_a_coordinate_is_drawn_from_the_density_that_the_sampler_takes_it_to_have() -> None:
    """A Kolmogorov–Smirnov test of ln σ against the package's prior, integrated; the first number of all may differ."""
    noise, random = components(AXES, PLACING, GROWTH), np.random.default_rng(1)
    sizes = noise.sizes(np.vstack([latent(noise, random) for _ in range(4000)]))
    at = np.log(2e-3) + np.linspace(-8, 8, 20_001)
    density = np.exp(noise.log_prior_of_sigma(at))
    distribution = np.cumsum(density) / density.sum()
    assert stats.kstest(np.log(sizes.coordinate), lambda x: np.interp(x, at, distribution)).pvalue > 1e-3
    # the moment that docs/noise.md gives, nine tenths of 0.2² and a tenth of 1², within four standard errors
    assert np.mean(np.log(sizes.coordinate / 2e-3) ** 2) == pytest.approx(0.9 * 0.2**2 + 0.1, abs=0.035)
    assert np.mean(sizes.placing == 0) == pytest.approx(0.5, abs=0.04)  # five standard errors


def test_parameters_are_drawn_from_their_priors_and_stay_where_nothing_is_known() -> None:
    known = Unknown(("scale_x", "ppm"), unit("ppm"), 3.0, 2.0, 1.0)
    anywhere = Unknown(("artefact", "length_mm"), unit("mm"), 400.0, np.inf, 1.0)
    linear = LinearModel(np.zeros(4), np.ones((4, 2)), (known, anywhere), np.zeros((4, 0)), np.ones(4), 2e-3)
    random = np.random.default_rng(2)
    made = [drawn(Design(linear, components()), random) for _ in range(4000)]
    values = np.array([each.values for each in made])
    assert stats.kstest((values[:, 0] - 3) / 2, "norm").pvalue > 1e-3
    assert np.all(values[:, 1] == 400)
    noise = [(each.linear.observed - each.values.sum()) / each.sizes.coordinate[0] for each in made]
    assert stats.kstest(np.ravel(noise), "norm").pvalue > 1e-3


def test_a_recording_is_drawn_and_every_parameter_and_size_ranked() -> None:
    found = ranked((Case("gauge blocks"), 1, 0))
    assert "fault" not in found
    assert set(found["ranks"]) == {
        *(f"scale_{a}.ppm" for a in "xyz"), "probe_radius.um", "artefact.length_mm", "noise.ln_sigma", "noise.likelihood",
        *(f"noise.axis_{a}" for a in "xyz"), "noise.placing", "noise.growth",
    }  # fmt: skip
    assert all(0 <= rank <= DRAWS for rank in found["ranks"].values())
    assert found == ranked((Case("gauge blocks"), 1, 0)) | {"seconds": found["seconds"]}
