"""What is proposed: t distributions, mixtures, and sets of components present."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import sparse, special, stats

from cmm_uq.base.points import Floats
from cmm_uq.maths.inference.noise import ABSENT, AXES, GROWTH, PLACING, SLOW, WALK, Components
from cmm_uq.maths.inference.presence import Numbers, beginning, present
from cmm_uq.maths.inference.proposals import Proposal, chosen, cumulative, refined, tempered, worth

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


def part(density: Floats, proposal: Proposal, z: Floats) -> float:
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
    assert part(density(x), found, z) > 0.2
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


NAMES = ("log_sigma", "spread", "first", "second", PLACING, GROWTH, SLOW, "rate")
ALL = Numbers(NAMES)


def latent(count: int = 20_000, seed: int = 1) -> Floats:
    return np.random.default_rng(seed).standard_normal((count, len(NAMES)))


def components() -> Components:
    """Whose sizes depend on every number."""
    shares = np.column_stack([np.eye(3), np.ones((3, 3))])
    slow = np.ones((3, 1))
    return Components(sparse.csr_array(np.eye(3)), shares, slow, np.zeros(1), (AXES, PLACING, GROWTH, SLOW), gap=0.1)


def test_slow_noise_that_is_absent_has_no_rate() -> None:
    assert len(ALL.sets) == 2 * 2 * 2 * 3
    assert not np.any(ALL.sets[:, 4] & ~ALL.sets[:, 3])


def test_a_set_is_present_as_often_as_the_prior_says() -> None:
    number, _ = ALL.of(latent())
    wanted = np.exp(ALL.log_prior)
    assert wanted.sum() == pytest.approx(1.0, rel=1e-12)
    assert wanted[(~ALL.sets).all(axis=1)] == pytest.approx(
        ABSENT[AXES] * ABSENT[PLACING] * ABSENT[GROWTH] * ABSENT[SLOW]
    )
    assert stats.chisquare(np.bincount(number, minlength=24), 20_000 * wanted).pvalue > 1e-4


def test_what_matters_is_standard_normal_beforehand() -> None:
    """Kolmogorov and Smirnov's test of each coordinate, and the correlation of the two of the axes."""
    number, found = ALL.of(latent())
    for i in range(1, found.shape[1]):
        own = found[ALL.matters[number, i], i]
        assert len(own) > 2000
        assert stats.kstest(own, "norm").pvalue > 1e-4
    both = ALL.matters[number, 1]
    assert abs(np.corrcoef(found[both, 1], found[both, 2])[0, 1]) < 4 / np.sqrt(both.sum())


@pytest.mark.long
def test_sizes_depend_on_nothing_else() -> None:
    """What does not matter is drawn anew: the sizes of the noise stay."""
    before = latent()
    number, coordinates = ALL.of(before)
    random = np.random.default_rng(2)
    absent, uniform = random.standard_normal(before.shape), random.random((len(before), len(ALL.switches)))
    after = ALL.latent(number, coordinates, absent, uniform)
    assert np.mean(before == after) < 0.2
    one, two = components().sizes(before), components().sizes(after)
    for name in ("placing", "growth", "slow"):
        assert getattr(two, name) / one.coordinate == pytest.approx(
            getattr(one, name) / one.coordinate, rel=1e-6, abs=1e-9
        )
    assert np.where(one.slow > 0, two.rate, 0) == pytest.approx(np.where(one.slow > 0, one.rate, 0), rel=1e-6)
    apart = [np.log(each.reading) - np.log(each.coordinate)[:, None] for each in (one, two)]
    assert apart[1] == pytest.approx(apart[0], abs=1e-6)


def test_the_density_is_that_of_the_draws() -> None:
    """Weighted by the prior over it, the draws of each set have its prior probability in sum."""
    proposal = beginning(NAMES, log_sigma=-6.0, width=0.3)
    z = proposal.draws(40_000, np.random.RandomState(3))
    log = stats.norm(-6.0, 0.3).logpdf(z[:, 0]) + stats.norm.logpdf(z[:, 1:]).sum(axis=1)
    weight, number = np.exp(log - proposal.log_density(z)), ALL.of(z)[0]
    for s, wanted in enumerate(np.exp(ALL.log_prior)):
        each = np.where(number == s, weight, 0.0)
        assert each.mean() == pytest.approx(wanted, abs=4.5 * each.std() / 200)


def known(z: Floats) -> Floats:
    """A density of which half is a walk that is known well, and half a noisy axis."""
    found = -0.5 * np.sum(z[:, 1:] ** 2, axis=1) + stats.norm(-7.0, 0.05).logpdf(z[:, 0])
    walk = (z[:, 6] > special.ndtri(ABSENT[SLOW])) & (z[:, 7] < special.ndtri(WALK)) & (z[:, 1] < 0)
    axes = (z[:, 6] < special.ndtri(ABSENT[SLOW])) & (z[:, 1] > 0)
    beyond = special.ndtri(1 - special.ndtr(-z[:, 6]) / (1 - ABSENT[SLOW]))
    narrow = stats.norm(1.5, 0.1).logpdf(beyond) - stats.norm.logpdf(beyond)
    with np.errstate(invalid="ignore"):
        each = np.where(walk, narrow - np.log((1 - ABSENT[SLOW]) * WALK * ABSENT[AXES]), -np.inf)
    return np.asarray(found + np.where(axes, -np.log(ABSENT[SLOW] * (1 - ABSENT[AXES])), each))


def test_what_is_present_is_found_with_its_probability() -> None:
    found = present(known, beginning(NAMES, -6.0, 1.0), 1)
    of = dict(zip(found.numbers.switches, found.numbers.sets.T, strict=True))
    assert found.probability[of[SLOW] & ~of["rate"] & ~of["spread"]].sum() == pytest.approx(0.5, abs=0.06)
    assert found.probability[~of[SLOW] & of["spread"]].sum() == pytest.approx(0.5, abs=0.06)
    z = found.draws(4000, np.random.RandomState(4))
    assert worth(known(z) - found.log_density(z)) > 0.6 * 4000


def test_draws_made_together_are_those_made_one_after_another() -> None:
    proposal, together, alone = beginning(NAMES), np.random.RandomState(6), np.random.RandomState(6)
    numbers = [proposal.numbers_of(5, together) for _ in range(4)]
    whole = proposal.made(tuple(np.concatenate(each) for each in zip(*numbers, strict=True)))
    np.testing.assert_array_equal(whole, np.vstack([proposal.draws(5, alone) for _ in range(4)]))
