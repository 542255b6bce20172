"""Proposals: densities and draws of mixtures, and whether they find what they are to approximate."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats

from cmm_uq.base.points import Floats
from cmm_uq.maths.inference.proposals import Proposal, chosen, cumulative, refined, tempered

WEIGHTS, CENTRES = np.array([0.3, 0.7]), np.array([[0.0, 0.0], [3.0, -1.0]])
FACTORS = np.array([[[1.0, 0.0], [0.0, 1.0]], [[0.5, 0.0], [0.2, 0.3]]])


def two() -> Proposal:
    return Proposal(np.array([10.0, 20.0]), np.diag([2.0, 3.0]), WEIGHTS, CENTRES, FACTORS)


def test_the_density_of_a_mixture_is_that_of_scipy_s_t_distributions() -> None:
    z = np.random.default_rng(1).normal(size=(50, 2)) * 3
    wanted = np.log(
        sum(
            w * stats.multivariate_t(c, f @ f.T, df=6).pdf(z) for w, c, f in zip(WEIGHTS, CENTRES, FACTORS, strict=True)
        )
    )
    assert np.ptp(two().log_density(z) - wanted) < 1e-12


def test_the_density_of_parameters_has_its_constant() -> None:
    """The same of x = centre + factor·z: divided by the determinant of the factor."""
    x = np.random.default_rng(1).normal(size=(50, 2)) * 3 + [10.0, 20.0]
    z = (x - [10.0, 20.0]) / [2.0, 3.0]
    wanted = sum(
        w * stats.multivariate_t(c, f @ f.T, df=6).pdf(z) for w, c, f in zip(WEIGHTS, CENTRES, FACTORS, strict=True)
    )
    assert two().log_probability(x) == pytest.approx(np.log(wanted / 6), rel=1e-10)


def test_draws_of_a_mixture_have_its_mean_and_covariance() -> None:
    """A t distribution with six degrees of freedom has 6/4 of its scale's covariance."""
    z = two().draws(400_000, np.random.RandomState(2))
    mean = WEIGHTS @ CENTRES
    each = [1.5 * f @ f.T + np.outer(c - mean, c - mean) for c, f in zip(CENTRES, FACTORS, strict=True)]
    assert z.mean(axis=0) == pytest.approx(mean, abs=0.02)
    assert np.cov(z.T) == pytest.approx(np.tensordot(WEIGHTS, each, 1), rel=0.02, abs=0.02)
    assert two().parameters(z[:3]) == pytest.approx(np.array([10.0, 20.0]) + z[:3] * [2.0, 3.0])


def worth(density: Floats, proposal: Proposal, z: Floats) -> float:
    weight = np.exp(density - proposal.log_density(z) - np.max(density - proposal.log_density(z)))
    return float(weight.sum() ** 2 / np.sum(weight**2) / len(z))


def test_one_distribution_finds_a_mode_far_from_where_the_search_begins() -> None:
    """Normal about (4, −3) with a thousandth of the variance that the search begins with."""

    def density(x: Floats) -> Floats:
        return np.asarray(-0.5 * np.sum(((x - [4.0, -3.0]) / 0.03) ** 2, axis=1))

    found = tempered(density, np.zeros(2), 2 * np.eye(2), 1)
    assert len(found.weights) == 1
    assert found.centre == pytest.approx([4.0, -3.0], abs=0.01)
    assert np.sqrt(np.diag(found.factor @ found.factor.T)) == pytest.approx([0.03, 0.03], rel=0.15)


def test_a_component_that_is_there_or_not_takes_a_mixture_that_holds_both_with_their_masses() -> None:
    """Absent where x₀ < 0; where it is there, the likelihood rises to e⁴ at 2.5, and x₁ becomes narrow and slanted with it.

    Standard normal beforehand in six dimensions; the masses are those of a sum over x₀.
    """

    def gain(first: Floats) -> Floats:
        return np.where(first < 0, 0.0, 4.0 * (1 - ((first - 2.5) / 2.5) ** 2))

    def density(x: Floats) -> Floats:
        size = np.maximum(x[:, 0], 0.0)
        second = stats.norm.logpdf(x[:, 1], 1.5 * size, np.exp(-1.2 * size))
        others = np.delete(x, 1, axis=1)
        return np.asarray(gain(x[:, 0]) + second + stats.norm.logpdf(others).sum(axis=1))

    found = tempered(density, np.zeros(6), np.eye(6), 1)
    z = found.draws(40_000, np.random.RandomState(4))
    x = found.parameters(z)
    log = density(x) - found.log_density(z)
    weight = np.exp(log - log.max())
    places = np.linspace(-8, 8, 16_001)
    mass = np.exp(gain(places)) * stats.norm.pdf(places)
    assert len(found.weights) > 1
    assert worth(density(x), found, z) > 0.2
    assert weight[x[:, 0] > 0].sum() / weight.sum() == pytest.approx(mass[places > 0].sum() / mass.sum(), abs=0.02)


def test_a_skewed_density_is_refined_to_its_moments() -> None:
    """Gamma with shape 9 in one dimension: mean 9, standard deviation 3; the search begins at the mode's curvature."""

    def density(x: Floats) -> Floats:
        with np.errstate(invalid="ignore", divide="ignore"):
            return np.where(x[:, 0] > 0, 8 * np.log(np.maximum(x[:, 0], 1e-300)) - x[:, 0], -np.inf)

    found = refined(density, np.array([8.0]), np.array([[np.sqrt(8.0)]]), 3)
    assert found.centre == pytest.approx([9.0], abs=0.6)
    assert found.factor[0, 0] == pytest.approx(3.0, rel=0.2)


def test_parts_are_chosen_as_numpy_chooses_them() -> None:
    weights = np.array([0.2, 0.0, 0.5, 0.3])
    found = chosen(cumulative(weights), 1000, np.random.RandomState(5))
    np.testing.assert_array_equal(found, np.random.RandomState(5).choice(4, size=1000, p=weights))
