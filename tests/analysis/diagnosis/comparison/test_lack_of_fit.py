"""The probability of "nothing is missing": against Fisher's F, and with outliers.

Odds under Student's t, each data with tails of its own, against densities and likelihoods written out.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy import optimize, special, stats

from cmm_uq.analysis.diagnosis.comparison.evidence import CandidateComparison
from cmm_uq.analysis.diagnosis.comparison.explanations import EFFECT, Explanation, Member
from cmm_uq.analysis.diagnosis.comparison.lack_of_fit import (
    DRAWS,
    by_rearrangement,
    lack_of_fit,
    log_prior,
    robust_statistic_of,
    statistic_of,
    under_heavy_tails,
)
from cmm_uq.analysis.diagnosis.noise import OFTEN, NoiseKind, sigma_grid, with_tails
from cmm_uq.base.points import Floats
from tests.analysis.diagnosis.dense_noise import covariance, rest, some_kinds

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


@pytest.mark.parametrize("p", [0.02, 0.1])
def test_what_is_left_and_rearranged_exceeds_an_effect_as_often_as_the_f_test_says(p: float) -> None:
    """Fisher (1935) found the same of Darwin's maize: 0.053 by signs, 0.050 by t."""
    found = [by_rearrangement(one_effect(p), seed) for seed in range(8)]
    assert np.mean(found) == pytest.approx(p, rel=0.25)


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


def normal_kinds(explanations: int = 2) -> CandidateComparison:
    random = np.random.default_rng(21)
    found = [Explanation(str(i), EFFECT, (Member(random.standard_normal((ROWS, 1 + i))),)) for i in range(explanations)]
    observed, baseline = 0.05 * random.standard_normal(ROWS), random.standard_normal((ROWS, 2))
    kinds = some_kinds(np.full(ROWS, 1.4))
    return CandidateComparison(observed, baseline, kinds, *sigma_grid(None, 0.25), found, np.full(ROWS, 1.4), 0.01)


def with_outliers(c: CandidateComparison, count: int) -> Floats:
    """What the baseline leaves of white noise (m, count) with one reading off by twenty of its standard deviations."""
    random = np.random.default_rng(22)
    data = 0.05 * random.standard_normal((ROWS, count))
    data[random.integers(ROWS, size=count), np.arange(count)] += 1.0
    return c.rest(data)


def of_nothing(c: CandidateComparison, data: Floats, kinds: list[NoiseKind]) -> Floats:
    """Log density (k, b) of data under kinds of noise, σ integrated, written out."""
    Q = rest(c)
    found = np.empty((len(kinds), data.shape[1]))
    for row, kind in zip(found, kinds, strict=True):
        white = Q.T @ covariance(kind) @ Q
        squares = np.einsum("mb,mb->b", Q.T @ data, np.linalg.solve(white, Q.T @ data))
        log = -0.5 * squares[:, None] / c.sigma**2 - Q.shape[1] * np.log(c.sigma) + c.log_sigma
        row[:] = special.logsumexp(log, axis=1) - 0.5 * np.linalg.slogdet(white)[1] + np.log(kind.probability)
    return found


def test_the_evidence_of_tails_is_below_that_of_student_s_t_and_meets_it_at_the_tangent_whatever_the_kind_is_otherwise() -> (
    None
):
    random = np.random.default_rng(23)
    kind = some_kinds(np.full(ROWS, 1.4))[1]
    residual = 1.5 * random.standard_t(4, ROWS)
    found = with_tails(kind, residual, 0.25)
    assert (found.name, found.probability) == ("tails", 0.25)
    for white, tangent in ((residual, True), (1.5 * random.standard_t(4, ROWS), False)):
        data = kind.coloured(white[:, None])[:, 0]
        bound = stats.multivariate_normal(np.zeros(ROWS), covariance(found)).logpdf(data) + found.log_factor
        exact = stats.t.logpdf(white, 4, scale=np.sqrt(0.5)).sum() + np.linalg.slogdet(kind.white(np.eye(ROWS)))[1]
        assert bound <= exact + 1e-9
        assert (bound == pytest.approx(exact, abs=1e-9)) == tangent


def test_tails_touch_where_students_t_fits_best() -> None:
    """Its coefficients and its size by maximum likelihood, the size restricted to the degrees of freedom that are left."""
    c = replace(normal_kinds(), kinds=some_kinds(np.full(ROWS, 1.4))[:1])
    data = with_outliers(c, 5)
    white, base = (c.kinds[0].white(columns) for columns in (data, c.baseline))
    found = dict(under_heavy_tails(c, data))
    assert sorted(found) == list(range(5))
    for j, own in found.items():
        fit = optimize.minimize(
            lambda x, y=white[:, j]: (
                len(c.left) - 2) * x[2] - stats.t.logpdf((y - base @ x[:2]) / np.exp(x[2]), 4).sum(),
            np.array([0.0, 0.0, np.log(0.05)]), method="BFGS", options={"gtol": 1e-9},
        )  # fmt: skip
        residual = (white[:, j] - base @ fit.x[:2]) / np.exp(fit.x[2])
        roots = own.kinds[0].whitening.diagonal() / c.kinds[0].whitening.diagonal()
        np.testing.assert_allclose(roots**2, 2 * 5 / (4 + residual**2), rtol=0.02)


def test_tails_are_as_probable_beside_the_likeliest_kind_as_beside_all() -> None:
    c = normal_kinds()
    data = with_outliers(c, 8)
    plain = of_nothing(c, data, list(c.kinds))
    for j, own in under_heavy_tails(c, data):
        (kind,) = own.kinds
        likeliest = int(plain[:, j].argmax())
        part = np.exp(plain[likeliest, j] - special.logsumexp(plain[:, j]))
        assert kind.probability == pytest.approx(OFTEN * c.kinds[likeliest].probability / part, rel=1e-3)
        log = of_nothing(c, data[:, [j]], [kind])[0, 0] + kind.log_factor
        assert own.log_evidence_of(())[0] == pytest.approx(log, abs=2e-3)


def test_tails_are_left_out_where_they_are_twenty_times_less_probable() -> None:
    c = normal_kinds()
    even = 0.05 * stats.norm.ppf((np.arange(ROWS) + 0.5) / ROWS)
    data = np.column_stack([c.rest(np.random.default_rng(24).permutation(even)[:, None]), with_outliers(c, 1)])
    assert [j for j, _ in under_heavy_tails(replace(c, kinds=c.kinds[:1], often_heavy=0.01), data)] == [1]


def test_of_some_kinds_the_evidence_is_that_of_a_comparison_of_these_alone() -> None:
    c = normal_kinds()
    fresh = replace(c, kinds=c.kinds[1:3])
    for got, wanted in zip(c.only([1, 2]).log_evidence(), fresh.log_evidence(), strict=True):
        np.testing.assert_allclose(got, wanted, rtol=1e-12)
    data = with_outliers(c, 1)
    for got, wanted in zip(c.under(c.kinds[:1], data[:, 0]).log_evidence(),
                           replace(c, kinds=c.kinds[:1]).log_evidence(data), strict=True):  # fmt: skip
        np.testing.assert_allclose(got, wanted, rtol=1e-12)
