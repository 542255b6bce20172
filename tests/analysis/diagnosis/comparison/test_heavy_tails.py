"""Odds under Student's t, each data with tails of its own, against densities and likelihoods written out."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy import optimize, special, stats

from cmm_uq.analysis.diagnosis.comparison.evidence import CandidateComparison
from cmm_uq.analysis.diagnosis.comparison.explanations import EFFECT, Explanation, Member
from cmm_uq.analysis.diagnosis.comparison.lack_of_fit import under_heavy_tails
from cmm_uq.analysis.diagnosis.noise import OFTEN, NoiseKind, sigma_grid, with_tails
from cmm_uq.base.points import Floats
from tests.analysis.diagnosis.dense_noise import covariance, rest, some_kinds

ROWS = 14


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
