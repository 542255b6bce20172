"""Proposals by what is present: their numbers against the prior of the noise, their density against what it draws."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import sparse, special, stats

from cmm_uq.base.points import Floats
from cmm_uq.maths.inference.noise import ABSENT, AXES, GROWTH, PLACING, SLOW, WALK, Components
from cmm_uq.maths.inference.presence import Numbers, beginning, present
from cmm_uq.maths.inference.proposals import worth

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
