"""Explanations together: closed form against the density written out, and combinations found where they were put."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from scipy import special, stats

from cmm_uq.mismatch.combinations import EFFECTS, UNKNOWNS, explore, log_evidence_together, log_prior
from cmm_uq.mismatch.evidence import AMPLITUDES, Comparison, Version
from cmm_uq.mismatch.explanations import EFFECT, UNKNOWN, Explanation, Member
from cmm_uq.mismatch.noise import kinds, sigma_grid
from cmm_uq.points import Floats

M = 30


def rivals(random: np.random.Generator, effects: int = 8) -> list[Explanation]:
    known = [Explanation(f"effect {i}", EFFECT, (Member(random.standard_normal((M, 1))),)) for i in range(effects)]
    strange = Explanation("unknown", UNKNOWN, (Member(random.standard_normal((M, 4))),))
    return [*known, strange]


def comparison(observed: Floats, explanations: list[Explanation]) -> Comparison:
    noise = kinds(np.repeat(np.arange(M // 2), 2), np.arange(M, dtype=np.float64))
    sigma, log_sigma = sigma_grid(0.01, 0.02)
    return Comparison(observed, np.ones((M, 1)), noise, sigma, log_sigma, explanations, np.full(M, np.sqrt(2)), 0.01)


def amplitudes(c: Comparison, member: Member) -> Floats:
    F = c.rest.T @ (member.columns / c.noise_scale[:, None])
    return np.geomspace(1 / c.least_noise, min(0.4 / np.sqrt(np.sum(F**2) / len(F)), 1 / c.least_noise), AMPLITUDES)


def direct(c: Comparison, chosen: tuple[int, ...]) -> float:
    """Sum over noise and the sizes of all explanations together, each a multivariate normal density."""
    members = [c.explanations[i].members[0] for i in chosen]
    grids = [amplitudes(c, member) for member in members]
    total = []
    for kind in c.kinds:
        noise = c.rest.T @ kind.correlation @ c.rest
        for sizes in itertools.product(*grids):
            covariance = noise.copy()
            for a, member in zip(sizes, members, strict=True):
                F = a * c.rest.T @ (member.columns / c.noise_scale[:, None])
                covariance += F @ F.T
            normal = stats.multivariate_normal(np.zeros(len(noise)), covariance)
            # density of left/σ under the unit covariance, summed over σ
            log = [
                normal.logpdf(c.left / s) - len(noise) * np.log(s) + p
                for s, p in zip(c.sigma, c.log_sigma, strict=True)
            ]
            weight = np.log(kind.probability) - len(members) * np.log(AMPLITUDES)
            total.append(special.logsumexp(log) + weight)
    return float(special.logsumexp(total)) + 0.5 * len(c.left) * np.log(2 * np.pi)


def test_the_evidence_of_two_together_is_that_of_a_multivariate_normal() -> None:
    """Their sizes summed one at a time about the joint best, against every pair of sizes: to a tenth in the logarithm."""
    random = np.random.default_rng(1)
    explanations = rivals(random)
    observed = explanations[0].members[0].columns[:, 0] * 0.02 - explanations[1].members[0].columns[:, 0] * 0.015
    c = comparison(observed / np.sqrt(2) + 0.01 * random.standard_normal(M), explanations)
    evidence, versions = log_evidence_together(c, (Version(0, 0, 1.0), Version(1, 0, 1.0)))
    assert {v.explanation for v in versions} == {0, 1}
    assert evidence == pytest.approx(direct(c, (0, 1)), abs=0.1)


def test_the_evidence_of_one_alone_is_exact() -> None:
    random = np.random.default_rng(2)
    c = comparison(0.02 * random.standard_normal(M), rivals(random))
    alone, _ = log_evidence_together(c, (Version(3, 0, 0.5),))
    _, something = c.log_evidence()
    assert alone == pytest.approx(float(something[3, 0]), abs=1e-9)


def test_what_is_granted_is_as_good_as_noise_of_that_covariance() -> None:
    random = np.random.default_rng(3)
    explanations = rivals(random)
    c = comparison(0.02 * random.standard_normal(M), explanations)
    granted = Version(2, 0, 1.7)
    F = 1.7 * explanations[2].members[0].columns / c.noise_scale[:, None]
    noisier = [type(k)(k.name, k.size, k.correlation + F @ F.T, k.probability) for k in c.kinds]
    other = Comparison(
        c.observed, c.baseline, noisier, c.sigma, c.log_sigma, explanations, c.noise_scale, c.least_noise
    )
    (alone, beside), (nothing, something) = c.log_evidence(granted=[granted]), other.log_evidence()
    assert alone == pytest.approx(nothing, abs=1e-8)
    assert np.delete(beside, 2) == pytest.approx(np.delete(something, 2), abs=1e-8)


@pytest.mark.parametrize("hidden", [(0,), (1, 4), (2, 3, 6)])
def test_what_is_hidden_is_the_most_probable_combination(hidden: tuple[int, ...]) -> None:
    random = np.random.default_rng(5)
    explanations = rivals(random)
    observed = sum(explanations[i].members[0].columns[:, 0] * 0.04 for i in hidden) / np.sqrt(2)
    found = explore(comparison(observed + 0.01 * random.standard_normal(M), explanations))
    best = max(found.of_effects, key=lambda key: found.of_effects[key])
    assert best == frozenset(hidden)
    assert sum(found.probability.values()) == pytest.approx(1.0)
    assert all(found.of(i) > 0.9 for i in hidden)


def test_two_that_are_one_and_the_same_share_their_probability() -> None:
    random = np.random.default_rng(6)
    explanations = rivals(random)
    twin = Explanation("twin", EFFECT, explanations[0].members)
    observed = explanations[0].members[0].columns[:, 0] * 0.05 / np.sqrt(2) + 0.01 * random.standard_normal(M)
    found = explore(comparison(observed, [*explanations, twin]))
    first, last = frozenset({0}), len(explanations)
    assert found.of(0) == pytest.approx(found.of(last), rel=0.05)
    assert found.instead(first, 0)[last] == pytest.approx(1.0, rel=0.05)


def test_prior_probabilities_of_all_combinations_sum_to_one() -> None:
    random = np.random.default_rng(7)
    explanations = rivals(random, 5)
    keys = [
        set(key) for r in range(len(explanations) + 1) for key in itertools.combinations(range(len(explanations)), r)
    ]
    total = sum(np.exp(log_prior(explanations, key)) for key in keys)
    assert total == pytest.approx(sum(EFFECTS) * sum(UNKNOWNS[:2]))
