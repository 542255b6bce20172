"""The probability of "nothing is missing": against Fisher's F, and with outliers."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy import special, stats

from cmm_uq.analysis.diagnosis.comparison.evidence import CandidateComparison
from cmm_uq.analysis.diagnosis.comparison.explanations import EFFECT, Explanation, Member
from cmm_uq.analysis.diagnosis.comparison.lack_of_fit import (
    DRAWS,
    lack_of_fit,
    log_prior,
    robust_statistic_of,
    statistic_of,
    under_heavy_tails,
)
from cmm_uq.analysis.diagnosis.noise import sigma_grid
from cmm_uq.base.points import Floats
from tests.analysis.diagnosis.dense_noise import some_kinds

ROWS = 14


def one_effect(p: float, often: float = 0.0, lever: float = 0.0) -> CandidateComparison:
    """White noise of 0.05 mm and one effect of one column, of a size at which the F test has this p-value.

    The first reading sees ``lever`` mm more of the effect.
    """
    random = np.random.default_rng(31)
    column, baseline = random.standard_normal((ROWS, 1)), random.standard_normal((ROWS, 2))
    column[0] += lever
    Q = np.linalg.qr(baseline)[0]
    seen = column - Q @ (Q.T @ column)
    noise = 0.05 * random.standard_normal((ROWS, 1))
    noise -= seen * (seen.T @ noise) / float((seen.T @ seen).item())
    noise -= Q @ (Q.T @ noise)
    along = np.sqrt(stats.f.isf(p, 1, ROWS - 3) / (ROWS - 3)) * np.linalg.norm(noise)
    observed = noise + along * seen / np.linalg.norm(seen)
    (white, *_) = some_kinds(np.ones(ROWS))
    explanation = Explanation("one", EFFECT, (Member(column),))
    return CandidateComparison(observed[:, 0], baseline, [white], *sigma_grid(None, 0.05), [explanation], np.ones(ROWS), 1e-3,
                      often_heavy=often)  # fmt: skip


@pytest.mark.parametrize("p", [0.005, 0.01, 0.015])
def test_near_the_false_alarm_rate_a_probability_is_that_of_the_f_test(p: float) -> None:
    """The odds of one effect in white noise grow with F. As many as exceed them scatter binomially."""
    c = one_effect(p)
    found = [lack_of_fit(c, seed, 0.01)[0] for seed in range(20)]
    assert np.mean(found) == pytest.approx(p, abs=3 * np.sqrt(p / (20 * 5 * DRAWS)))


def test_far_from_the_false_alarm_rate_a_probability_stays_as_200_draws_have_it() -> None:
    for p in (0.5, 1e-6):
        c = one_effect(p, 0.25)
        first = lack_of_fit(c, 1)
        assert not 0.001 < first[0] < 0.1
        assert lack_of_fit(c, 1, 0.01)[0] == first[0]


def outliers(c: CandidateComparison, off: float) -> Floats:
    """What the baseline leaves of normal noise (m, m), each with another reading off, mm."""
    noise = 0.05 * np.random.default_rng(33).standard_normal((ROWS, 1))
    return c.rest(noise + off * np.eye(ROWS))


def test_log_odds_with_tails_are_those_of_the_evidence_of_both_kinds_of_noise() -> None:
    c = one_effect(0.02, 0.25)
    data = np.column_stack([c.left, outliers(c, 0.4)])
    found = robust_statistic_of(c, data, -np.inf)
    plain, something = c.log_evidence(data)
    own = dict(under_heavy_tails(c, data))
    assert len(own) > ROWS / 2
    prior = log_prior(c.explanations)[0]
    for j, log_odds in enumerate(found):
        nothing, anything = [np.log(0.75) + plain[j]], [np.log(0.75) + something[0, j]]
        if j in own:
            both = own[j].log_evidence()
            nothing, anything = [*nothing, both[0][0]], [*anything, both[1][0, 0]]
        assert log_odds == pytest.approx(prior + special.logsumexp(anything) - special.logsumexp(nothing), abs=1e-9)


def test_an_outlier_raises_odds_under_normal_noise_and_not_under_tails() -> None:
    """An effect that all readings show keeps its odds, but for the part of the probability that tails have."""
    c = one_effect(1e-4, 0.25)
    plain, robust = statistic_of(c, c.left[:, None])[0][0], robust_statistic_of(c, c.left[:, None], -np.inf)[0]
    assert robust == pytest.approx(plain, abs=0.5)
    c = one_effect(1e-4, 0.25, lever=5.0)
    data = outliers(c, 2.0)[:, [0]]
    plain, robust = statistic_of(c, data)[0][0], robust_statistic_of(c, data, -np.inf)[0]
    assert robust < plain - 1.0


def test_low_odds_stay_as_they_are_under_normal_noise() -> None:
    c = one_effect(0.02, 0.25)
    data = outliers(c, 0.4)
    plain = statistic_of(c, data)[0]
    least = float(np.median(plain))
    found, every = (robust_statistic_of(c, data, limit) for limit in (least, -np.inf))
    np.testing.assert_allclose(found[plain <= least], plain[plain <= least], rtol=1e-12)
    np.testing.assert_allclose(found[plain > least], every[plain > least], rtol=1e-12)
    assert np.array_equal(robust_statistic_of(replace(c, often_heavy=0.0), data, -np.inf), plain)
