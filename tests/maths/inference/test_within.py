"""What limits say of normal quantities, against draws that keep them among very many that do not."""

from __future__ import annotations

import numpy as np
import pytest
import scipy
from scipy.stats import halfnorm, multivariate_normal, norm

from cmm_uq.base.points import Floats
from cmm_uq.base.units import unit
from cmm_uq.maths.inference.families import FieldErrors, FieldModel, normal
from cmm_uq.maths.inference.family_sizes import sample_sizes
from cmm_uq.maths.inference.linear_model import Freedoms, LinearModel, Unknown, solve
from cmm_uq.maths.inference.noise import Components, Sizes
from cmm_uq.maths.inference.within import WithinLimits, truncated

COUNT = 400_000


def lengths(seed: int) -> tuple[Floats, Floats, Floats]:
    """Mean, covariance and limits of errors of five lengths on each of three lines: scales, play, noise."""
    random, along = np.random.default_rng(seed), np.tile(np.linspace(0.1, 1.0, 5), 3)
    scales, play = (
        along[:, None] * random.standard_normal((15, 3)),
        np.repeat(random.standard_normal((3, 3)), 5, axis=0),
    )
    covariance = 4 * scales @ scales.T + play @ play.T + 0.05 * np.eye(15)
    return random.standard_normal(15), covariance, 1.5 + 2 * along


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_probability_mean_and_covariance_are_those_of_draws_that_keep_the_limits(seed: int) -> None:
    mean, covariance, limit = lengths(seed)
    within = WithinLimits(mean[None], covariance[None], limit)
    random = np.random.default_rng(seed)
    every = random.multivariate_normal(mean, covariance, COUNT)
    kept = every[np.all(np.abs(every) <= limit, axis=1)]
    sd, scatter = kept.std(axis=0), np.sqrt(1 / len(kept))
    drawn, log = within.draw(random, COUNT // 10)
    weight = np.exp(log[0])
    assert np.log(weight.mean()) == pytest.approx(np.log(len(kept) / COUNT), abs=5 * scatter)
    assert within.log_probability[0] == pytest.approx(np.log(weight.mean()), abs=0.1)
    weight /= weight.sum()
    worth = np.sqrt(scatter**2 + np.sum(weight**2))
    assert np.all(np.abs(drawn) <= limit)
    np.testing.assert_allclose((weight @ drawn[0] - kept.mean(axis=0)) / sd, 0, atol=5 * worth)
    about = drawn[0] - weight @ drawn[0]
    np.testing.assert_allclose((about.T * weight) @ about / np.outer(sd, sd), np.corrcoef(kept.T), atol=5 * worth)


@pytest.mark.parametrize(("mean", "sd"), [(0.0, 1.0), (-3.0, 1.0), (0.3, 50.0), (9.0, 0.7)])
def test_one_component_has_the_moments_of_a_truncated_normal_distribution(mean: float, sd: float) -> None:
    log, at, variance = truncated(np.array(mean), np.array(sd), 1.0)
    peak = norm.logpdf(np.clip(mean, -1, 1), mean, sd)
    moments = [
        scipy.integrate.quad(lambda x, k=k: x**k * np.exp(norm.logpdf(x, mean, sd) - peak), -1, 1)[0] for k in range(3)
    ]
    first, second = moments[1] / moments[0], moments[2] / moments[0]
    assert (log, at, variance) == pytest.approx((np.log(moments[0]) + peak, first, second - first**2), rel=1e-6)


def test_a_field_with_limits_is_that_of_machines_that_keep_them() -> None:
    """Sizes and coefficients against draws of the priors: weighed by what was observed, kept by what keeps its limits.

    Of two families the observations see one, the limits both.
    """
    random, count, sigma = np.random.default_rng(4), 6, 0.4
    seen, unseen, beta = (
        random.standard_normal((12, 5)),
        random.standard_normal((12, 4)),
        random.standard_normal((12, 1)),
    )
    unseen[:count] = 0.0
    seen[count:], beta[count:] = 0.4 * seen[count:], 0.4 * beta[count:]
    observed = np.append(1.5 * random.standard_normal(count), np.zeros(12 - count))
    doubt, limit = np.vstack([np.zeros((count, 6)), 0.2 * np.eye(6)]), np.full(6, 1.0)
    unknowns = (Unknown(("a", "one"), unit("1"), 0.3, 1.0, 1.0),)
    linear = LinearModel(observed, beta, unknowns, Freedoms.of(np.zeros((12, 0))), np.ones(12), None)
    shares = np.repeat([1.0, 1e-12], count)[:, None] * np.eye(6)[0]
    noise = Components(scipy.sparse.csr_array(np.eye(12)), shares, np.zeros((12, 0)), np.zeros(0), ())
    families = (("seen", seen), ("unseen", unseen), (None, doubt))
    errors = tuple(FieldErrors(name, columns, normal(columns.shape[1])) for name, columns in families)
    model = FieldModel(linear, noise, solve(linear), errors, limit)
    known = Sizes(np.full((1, 3), sigma), np.zeros(1), np.zeros(1), np.zeros(1), np.ones(1))
    found = sample_sizes(model, 20_000, 1, known)
    ours = np.hstack([found.families, model.draw(found.noise, found.families, random, found.within)[:, :10]])

    sizes = halfnorm.rvs(size=(COUNT, 2), random_state=random)
    columns = np.hstack([beta, seen, unseen, doubt])
    kept, weights = list[Floats](), list[float]()
    for own in sizes[:4000]:
        sd = np.concatenate([[1.0], np.repeat(own, [5, 4]), np.ones(6)])
        prior, mean = columns * sd, beta[:, 0] * 0.3
        covariance = prior[:count] @ prior[:count].T + sigma**2 * np.eye(count)
        drawn = random.standard_normal((100, 16))
        left = observed[:count] - mean[:count] - drawn @ prior[:count].T - sigma * random.standard_normal((100, count))
        drawn += left @ np.linalg.solve(covariance, prior[:count])
        keeps = np.all(np.abs(mean[count:] + drawn @ prior[count:].T) <= limit, axis=1)
        density = float(multivariate_normal.pdf(observed[:count], mean[:count], covariance))
        kept += [np.concatenate([own, [0.3 + one[0]], (one * sd)[1:10]]) for one in drawn[keeps]]
        weights += [density] * int(keeps.sum())
    assert len(kept) > 10_000
    theirs, weight = np.array(kept), np.array(weights) / np.sum(weights)
    about = weight @ theirs
    sd = np.sqrt(weight @ (theirs - about) ** 2)
    worth = np.sqrt(np.sum(weight**2) + 1 / found.worth)
    np.testing.assert_allclose((ours.mean(axis=0) - about) / sd, 0, atol=5 * worth)
    np.testing.assert_allclose(ours.std(axis=0) / sd, 1, atol=5 * worth)
    assert sd[1] < 0.5  # of the unseen family: 0.6 beforehand
