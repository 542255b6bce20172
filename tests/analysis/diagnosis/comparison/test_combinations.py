"""Explanations together: closed form against the density written out, and combinations found where they were put."""

from __future__ import annotations

import itertools
from dataclasses import replace

import numpy as np
import pytest
from scipy import special, stats

from cmm_uq.analysis.diagnosis.comparison.combinations import (
    EFFECTS,
    Combination,
    Combinations,
    explore,
    log_evidence_together,
)
from cmm_uq.analysis.diagnosis.comparison.conditional import AMPLITUDES, Version
from cmm_uq.analysis.diagnosis.comparison.evidence import CandidateComparison
from cmm_uq.analysis.diagnosis.comparison.explanations import EFFECT, UNKNOWN, Explanation, Member
from cmm_uq.analysis.diagnosis.noise import sigma_grid
from cmm_uq.base.points import Floats
from tests.analysis.diagnosis.dense_noise import covariance, rest, some_kinds

M = 30


def rivals(random: np.random.Generator, effects: int = 8) -> list[Explanation]:
    known = [Explanation(f"effect {i}", EFFECT, (Member(random.standard_normal((M, 1))),)) for i in range(effects)]
    strange = Explanation("unknown", UNKNOWN, (Member(random.standard_normal((M, 4))),))
    return [*known, strange]


def comparison(observed: Floats, explanations: list[Explanation]) -> CandidateComparison:
    noise = some_kinds(np.full(M, np.sqrt(2)))
    sigma, log_sigma = sigma_grid(0.01, 0.02)
    return CandidateComparison(
        observed, np.ones((M, 1)), noise, sigma, log_sigma, explanations, np.full(M, np.sqrt(2)), 0.01
    )


def amplitudes(c: CandidateComparison, member: Member) -> Floats:
    F = rest(c).T @ (member.columns / c.noise_scale[:, None])
    return np.geomspace(1 / c.least_noise, min(0.4 / np.sqrt(np.sum(F**2) / len(F)), 1 / c.least_noise), AMPLITUDES)


def direct(c: CandidateComparison, chosen: tuple[int, ...]) -> float:
    """Sum over noise and the sizes of all explanations together, each a multivariate normal density."""
    members = [c.explanations[i].members[0] for i in chosen]
    grids = [amplitudes(c, member) for member in members]
    total, Q = [], rest(c)
    for kind in c.kinds:
        noise = Q.T @ covariance(kind) @ Q
        for sizes in itertools.product(*grids):
            whole = noise.copy()
            for a, member in zip(sizes, members, strict=True):
                F = a * Q.T @ (member.columns / c.noise_scale[:, None])
                whole += F @ F.T
            normal = stats.multivariate_normal(np.zeros(len(noise)), whole)
            # density of left/σ under the unit covariance, summed over σ
            log = [
                normal.logpdf(Q.T @ c.observed / s) - len(noise) * np.log(s) + p
                for s, p in zip(c.sigma, c.log_sigma, strict=True)
            ]
            weight = np.log(kind.probability) - len(members) * np.log(AMPLITUDES)
            total.append(special.logsumexp(log) + weight)
    return float(special.logsumexp(total)) + 0.5 * Q.shape[1] * np.log(2 * np.pi)


@pytest.mark.long
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


def test_what_is_granted_is_as_good_as_what_a_certificate_leaves_open() -> None:
    random = np.random.default_rng(3)
    explanations = rivals(random)
    c = comparison(0.02 * random.standard_normal(M), explanations)
    given = Version(2, 0, 1.7)
    F = 1.7 * explanations[2].members[0].columns / c.noise_scale[:, None]
    other = replace(c, certified=F)
    (alone, beside), (nothing, something) = c.log_evidence(conditions=[given]), other.log_evidence()
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


def of_sets(probability: dict[tuple[int, ...], float]) -> Combinations:
    explanations = rivals(np.random.default_rng(8), 4)
    made = {frozenset(k): Combination((), np.log(p)) for k, p in probability.items()}
    return Combinations(explanations, made)


def test_one_that_explains_what_two_do_is_in_the_place_of_each() -> None:
    found = of_sets({(0, 1): 0.5, (2,): 0.25, (0, 3): 0.15, (0,): 0.1})
    both = frozenset({0, 1})
    assert found.instead(both, 0) == pytest.approx({2: 0.5})
    assert found.instead(both, 1) == pytest.approx({2: 0.5, 3: 0.3})


def test_one_in_the_place_of_another_is_not_in_that_of_a_third_that_is_merely_left_out() -> None:
    found = of_sets({(0, 1): 0.4, (0,): 0.3, (2,): 0.1, (1, 2): 0.2})
    both = frozenset({0, 1})
    assert found.instead(both, 0) == pytest.approx({2: 0.75})
    assert found.instead(both, 1) == {}


@pytest.mark.long
def test_beside_a_set_that_was_never_compared_something_unknown_acts() -> None:
    """As where one of several effects is left out, since least squares of all gives a size that no machine has."""
    found = of_sets({(): 0.2, (0,): 0.3, (0, 1): 0.5})
    assert found.unknown_beside(frozenset({0, 1})) == 0.0
    assert found.unknown_beside(frozenset({1})) == 1.0


@pytest.mark.parametrize("count", [2, 5, 7])
def test_as_many_effects_are_found_as_act(count: int) -> None:
    """More than four are looked for where four are the most probable; where fewer are, nothing is otherwise than before."""
    random = np.random.default_rng(12)
    explanations = rivals(random, 10)
    observed = random.normal(0, 0.02, M) + sum(e.members[0].columns[:, 0] * 0.5 for e in explanations[:count])
    found = explore(comparison(np.asarray(observed), explanations))
    assert found.most_probable == frozenset(range(count))
    assert found.of_effects[found.most_probable] > 0.5
    assert len(found.counts) == (len(EFFECTS) if count < 4 else len(EFFECTS) + 2 * -(-(count - 3) // 2))
    assert found.counts[: len(EFFECTS)] == EFFECTS
    assert np.allclose(np.divide(found.counts[5:], found.counts[4:-1]), 0.5)


def test_two_that_together_are_as_one_are_tried_in_its_place() -> None:
    """The first is the sum of two others, as a bar that sags is as two scales: no single exchange leads there."""
    random = np.random.default_rng(21)
    explanations = rivals(random, 8)
    a, b = (explanations[i].members[0].columns for i in (3, 6))
    explanations[0] = replace(explanations[0], members=(Member(a + b),))
    observed = (
        random.normal(0, 0.02, M) + 0.5 * (a + b)[:, 0] + sum(e.members[0].columns[:, 0] for e in explanations[1:3])
    )
    found = explore(comparison(np.asarray(observed), explanations))
    assert found.most_probable == {0, 1, 2}
    both = found.of_effects[frozenset({1, 2, 3, 6})]
    assert 1e-6 < both < found.of_effects[frozenset({0, 1, 2})]
