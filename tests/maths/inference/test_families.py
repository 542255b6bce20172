"""Families of errors beside a linear model: their exact density, exact draws, and sizes that the observations say."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import scipy
from scipy.stats import halfnorm

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.points import Floats
from cmm_uq.base.units import unit
from cmm_uq.maths.inference import family_sizes as room
from cmm_uq.maths.inference.families import FieldErrors, FieldModel
from cmm_uq.maths.inference.family_sizes import log_evidence, sample_sizes, size_of
from cmm_uq.maths.inference.linear_model import Freedoms, LinearModel, Unknown, solve
from cmm_uq.maths.inference.noise import Components, Sizes

PLACINGS, EACH = 6, 5
M = PLACINGS * EACH
RANDOM = np.random.default_rng(5)
DESIGN = RANDOM.standard_normal((M, 2))
CURVES = RANDOM.standard_normal((M, 12))
SIGMA = 0.3


def linear(observed: Floats, *, last: float = 2.0) -> LinearModel:
    """Two parameters, six placings with an offset each."""
    unknowns = (Unknown(("a", "one"), unit("1"), 0.0, 3.0, 1.0), Unknown(("b", "two"), unit("1"), 0.5, last, 1.0))
    placing = Freedoms(np.ones((M, 1)), np.repeat(np.arange(PLACINGS), EACH), PLACINGS)
    return LinearModel(observed, DESIGN, unknowns, placing, np.ones(M), None)


def normal(columns: Floats, family: str | None) -> FieldErrors:
    return FieldErrors(family, columns, lambda random, n: random.standard_normal((n, columns.shape[1])))


def model(observed: Floats, *errors: FieldErrors, last: float = 2.0) -> FieldModel:
    shares = np.zeros((M, 6))
    shares[:, 0] = 1.0
    components = Components(scipy.sparse.csr_array(np.eye(M)), shares, np.zeros((M, 0)), np.zeros(0), ())
    about = linear(observed, last=last)
    return FieldModel(about, components, solve(about), errors)


def white(sigma: Floats | float, count: int = 1) -> Sizes:
    each = np.broadcast_to(np.asarray(sigma, dtype=np.float64), (count,))
    none = np.zeros(count)
    return Sizes(np.repeat(each[:, None], 3, axis=1), none, none, none, none + 1)


def observed(sizes: tuple[float, float], seed: int) -> Floats:
    random = np.random.default_rng(seed)
    curves = np.repeat(sizes, 6) * random.standard_normal(12)
    offsets = np.repeat(10 * random.standard_normal(PLACINGS), EACH)
    return DESIGN @ [1.0, -1.0] + CURVES @ curves + offsets + SIGMA * random.standard_normal(M)


def families(y: Floats) -> FieldModel:
    return model(y, normal(CURVES[:, :6], "one"), normal(CURVES[:, 6:], "other"))


def test_the_density_is_that_of_differences_within_placings() -> None:
    """Offsets of placings are eliminated by differences from each one's first observation (Harville 1974, Biometrika 61: any
    full set of error contrasts has the same likelihood but for a constant)."""
    y = observed((0.2, 1.0), 1)
    contrast = np.eye(M)[np.arange(M) % EACH > 0] - np.eye(M)[np.arange(M)[np.arange(M) % EACH > 0] // EACH * EACH]
    sizes, scales = white(np.array([0.2, 0.4, 0.3]), 3), np.array([[0.1, 1.0], [0.5, 0.2], [0.01, 2.0]])
    direct = []
    for sigma, (one, other) in zip((0.2, 0.4, 0.3), scales, strict=True):
        spread = np.repeat([one, other], 6) ** 2
        whole = sigma**2 * np.eye(M) + (CURVES * spread) @ CURVES.T + (DESIGN * [9.0, 4.0]) @ DESIGN.T
        inside = contrast @ whole @ contrast.T
        left = contrast @ (y - DESIGN @ [0.0, 0.5])
        direct.append(-0.5 * (np.linalg.slogdet(inside)[1] + left @ np.linalg.solve(inside, left)))
    found = families(y).log_likelihood(sizes, scales)
    np.testing.assert_allclose(np.diff(found), np.diff(direct), rtol=1e-6)


def test_slopes_are_those_of_the_density() -> None:
    """By differences of it; a family of columns and one whose covariance is that of its columns."""
    found = families(observed((0.2, 1.0), 1))
    scale = np.array([[0.4, 1.3]])
    by_steps = []
    for step in 1e-5 * np.eye(2):
        up, down = (found.log_likelihood(white(SIGMA), np.sqrt(scale**2 + way * step))[0] for way in (1, -1))
        by_steps.append((up - down) / 2e-5)
    assert found.slopes(white(SIGMA), scale) == pytest.approx(by_steps, rel=1e-5)


@pytest.mark.filterwarnings("error")
def test_a_step_to_noise_that_no_machine_has_has_no_slopes_but_the_priors() -> None:
    found = families(observed((0.2, 1.0), 1))
    density, sizes, d, begin = room._density(found, None)
    z = np.full(len(found.families), 0.3)
    value, slopes = room._fall(found, density, sizes, d)(np.append(np.full_like(begin, 800.0), z))
    assert np.isfinite(value)
    np.testing.assert_array_equal(slopes[d:], z)


def test_sizes_by_slopes_are_those_by_steps() -> None:
    found = families(observed((0.2, 1.0), 3))
    by_slopes, by_steps = (
        sample_sizes(
            found, 4000, 2, white(SIGMA), replace(room.Effort(worth=2000.0, held=4000), slopes=slopes)
        ).families
        for slopes in (True, False)
    )
    assert by_slopes.mean(axis=0) == pytest.approx(by_steps.mean(axis=0), rel=0.06)
    assert by_slopes.std(axis=0) == pytest.approx(by_steps.std(axis=0), rel=0.12)


def test_draws_are_those_of_the_normal_distribution_given_all_sizes() -> None:
    """By the other algebra, in the space of coefficients with the offsets among them: (Σ⁻¹ + XᵀX/σ²)⁻¹. 200 000 draws."""
    y, scale = observed((0.2, 1.0), 2), np.array([0.3, 0.9])
    offsets = np.repeat(np.eye(PLACINGS), EACH, axis=0)
    X = np.hstack([DESIGN, CURVES, offsets])
    prior = np.diag(np.concatenate([[1 / 9, 1 / 4], np.repeat(scale, 6) ** -2.0, np.zeros(PLACINGS)]))
    mean = np.concatenate([[0.0, 0.5], np.zeros(12 + PLACINGS)])
    covariance = np.linalg.inv(prior + X.T @ X / SIGMA**2)
    expected = (covariance @ (X.T @ y / SIGMA**2 + prior @ mean))[:14]
    whole = families(y)
    exact, spread = whole.normal(white(SIGMA), scale)
    np.testing.assert_allclose(exact, expected, rtol=1e-8, atol=1e-10)
    np.testing.assert_allclose(spread, covariance[:14, :14], rtol=1e-7, atol=1e-10)
    count = 200_000
    drawn = whole.draw(white(SIGMA, count), np.tile(scale, (count, 1)), np.random.default_rng(3))
    sd = np.sqrt(np.diagonal(spread))
    assert np.abs((drawn.mean(axis=0) - expected) / sd).max() < 5 / np.sqrt(count)
    np.testing.assert_allclose(
        np.cov(drawn.T) / np.outer(sd, sd), spread / np.outer(sd, sd), atol=5 * np.sqrt(2 / count)
    )


def test_sizes_have_their_posterior() -> None:
    """By a sum over 160 × 160 sizes: half-normal priors times the density. 4000 draws, of which 250 are different."""
    whole = families(observed((0.2, 1.0), 4))
    grid = (np.arange(160) + 0.5) / 40
    one, other = (each.ravel() for each in np.meshgrid(grid, grid, indexing="ij"))
    log = whole.log_likelihood(white(SIGMA, len(one)), np.column_stack([one, other])) - 0.5 * (one**2 + other**2)
    weight = np.exp(log - log.max())
    weight /= weight.sum()
    mean = np.array([weight @ one, weight @ other])
    sd = np.sqrt([weight @ (one - mean[0]) ** 2, weight @ (other - mean[1]) ** 2])
    found = sample_sizes(whole, 4000, 1, white(SIGMA))
    assert found.chains is None
    assert found.worth > 200
    assert np.abs((found.families.mean(axis=0) - mean) / sd).max() < 5 / np.sqrt(200)
    np.testing.assert_allclose(found.families.std(axis=0), sd, rtol=0.25)


def test_a_sampler_draws_them_where_the_approximation_is_not_good_enough(monkeypatch: pytest.MonkeyPatch) -> None:
    whole = families(observed((0.2, 1.0), 4))
    weighed = sample_sizes(whole, 4000, 1, white(SIGMA))
    monkeypatch.setattr(room, "_LEAST_WORTH", np.inf)
    sampled = sample_sizes(whole, 4000, 1, white(SIGMA))
    assert sampled.chains is not None
    sd = weighed.families.std(axis=0)
    assert np.abs((sampled.families.mean(axis=0) - weighed.families.mean(axis=0)) / sd).max() < 5 * np.sqrt(2 / 200)


def test_a_family_of_which_nothing_is_seen_keeps_its_prior() -> None:
    """One that acts along the offsets of the placings alone: half-normal, of which 250 even draws have the quantiles."""
    offsets = np.repeat(np.eye(PLACINGS), EACH, axis=0)
    whole = model(observed((0.0, 0.0), 6), normal(offsets, "unseen"), normal(CURVES, "seen"))
    found = sample_sizes(whole, 4000, 2, white(SIGMA))
    unseen, seen = found.families.T
    np.testing.assert_allclose(np.quantile(unseen, [0.25, 0.5, 0.75]), halfnorm.ppf([0.25, 0.5, 0.75]), rtol=0.25)
    assert np.quantile(seen, 0.9) < 0.2
    drawn = whole.draw(found.noise, found.families, np.random.default_rng(1))
    np.testing.assert_allclose(drawn[:, 2 : 2 + PLACINGS].std(axis=0), np.sqrt(np.mean(unseen**2)), rtol=0.1)


def test_noise_is_found_beside_families() -> None:
    whole = families(observed((0.2, 1.0), 7))
    found = sample_sizes(whole, 1000, 3)
    low, high = np.quantile(found.noise.coordinate, [0.005, 0.995])
    assert low < SIGMA < high


def test_latent_numbers_are_half_normal_sizes() -> None:
    np.testing.assert_allclose(
        size_of(np.array([-1.0, 0.0, 2.0])), halfnorm.ppf(scipy.special.ndtr([-1.0, 0.0, 2.0])), rtol=1e-9
    )


def test_a_size_of_which_nothing_is_known_is_projected_out_and_refused_where_nothing_shows_it() -> None:
    y = observed((0.2, 1.0), 8)
    whole = model(y, normal(CURVES, "one"), last=np.inf)
    drawn = whole.draw(white(SIGMA, 10), np.ones((10, 1)), np.random.default_rng(2))
    assert np.isnan(drawn[:, 1]).all()
    assert np.isfinite(np.delete(drawn, 1, axis=1)).all()
    hidden = replace(linear(y, last=np.inf), design=np.column_stack([DESIGN[:, 0], np.ones(M)]))
    with pytest.raises(CmmUqError, match="leaves a size of its artefact open"):
        FieldModel(hidden, whole.noise, whole.estimate, ()).log_likelihood(white(SIGMA), np.zeros((1, 0)))


def test_the_evidence_is_the_density_of_the_observations_with_all_sizes_integrated_out() -> None:
    """By quadrature over the half-normal sizes; as a ratio to that of a model with no families, whose constant it shares."""
    y, known = observed((0.2, 1.0), 1), white(SIGMA)
    both, none = families(y), model(y, normal(np.zeros((M, 6)), None))
    at = (np.arange(120) + 0.5) / 30  # sizes up to 4
    one, other = (each.ravel() for each in np.meshgrid(at, at))
    logs = both.log_likelihood(white(SIGMA, len(one)), np.column_stack([one, other]))
    weight = halfnorm.pdf(one) * halfnorm.pdf(other) / 30**2
    expected = np.log(np.sum(weight * np.exp(logs - logs.max()))) + logs.max()
    assert log_evidence(both, 1, known) == pytest.approx(expected, abs=0.1)
    assert log_evidence(none, 1, known) == pytest.approx(
        float(none.log_likelihood(known, np.zeros((1, 0)))[0]), abs=1e-9
    )
