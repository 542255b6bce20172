"""The closed-form evidence against the density of a multivariate normal distribution, written out."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy import special, stats

from cmm_uq.diagnosis.comparison.evidence import Comparison
from cmm_uq.diagnosis.comparison.explanations import EFFECT, Explanation, Member
from cmm_uq.diagnosis.comparison.lack_of_fit import tail_probability
from cmm_uq.diagnosis.noise import kinds, sigma_grid, tails
from cmm_uq.points import Floats
from tests.diagnosis.dense_noise import covariance, rest


def comparison(seed: int = 1) -> Comparison:
    random = np.random.default_rng(seed)
    m = 14
    rivals = [
        Explanation("one column", EFFECT, (Member(random.standard_normal((m, 1))),)),
        Explanation("two versions", EFFECT, tuple(Member(0.3 * random.standard_normal((m, 3))) for _ in range(2))),
    ]
    noise = kinds(np.repeat(np.arange(7), 2), np.arange(m, dtype=np.float64), np.zeros((m, 3)))
    sigma, log_sigma = sigma_grid(None, 0.02)
    observed, baseline = 0.05 * random.standard_normal(m), random.standard_normal((m, 2))
    return Comparison(observed, baseline, noise, sigma, log_sigma, rivals, np.full(m, 1.4), 0.01)


def direct(c: Comparison, members: tuple[Member, ...] | None) -> float:
    """Sum over noise, amplitude and version of the density of what the baseline leaves."""
    total, Q = [], rest(c)
    for kind in c.kinds:
        white = Q.T @ covariance(kind) @ Q
        for signal, weight in _signals(c, members):
            for sigma, log_p in zip(c.sigma, c.log_sigma, strict=True):
                density = stats.multivariate_normal(np.zeros(len(white)), sigma**2 * (white + signal))
                total.append(density.logpdf(Q.T @ c.observed) + log_p + np.log(kind.probability * weight))
    return float(special.logsumexp(total)) + 0.5 * Q.shape[1] * np.log(2 * np.pi)


def _signals(c: Comparison, members: tuple[Member, ...] | None) -> list[tuple[Floats, float]]:
    """Covariances of the signal over the variance of the noise, with their probabilities."""
    Q, signals = rest(c), []
    if members is None:
        return [(np.zeros((Q.shape[1], Q.shape[1])), 1.0)]
    for member in members:
        F = Q.T @ (member.columns / c.noise_scale[:, None])
        largest = 1 / c.least_noise
        smallest = min(0.4 / np.sqrt(np.sum(F**2) / len(F)), largest)
        amplitudes = np.geomspace(largest, smallest, 7)
        signals += [(a**2 * F @ F.T, 1 / (len(members) * len(amplitudes))) for a in amplitudes]
    return signals


def test_the_evidence_is_that_of_a_multivariate_normal() -> None:
    c = comparison()
    nothing, something = c.log_evidence()
    assert float(nothing[0]) == pytest.approx(direct(c, None), abs=2e-4)
    for i, explanation in enumerate(c.explanations):
        assert something[i, 0] == pytest.approx(direct(c, explanation.members), abs=2e-4)


def singles(c: Comparison, member: Member) -> dict[float, float]:
    """Log evidence of one version at each size that is tried, by its size, the choice between them included."""
    Q, found = rest(c), {}
    y, n = Q.T @ c.observed, Q.shape[1]
    for (signal, _), amplitude in zip(_signals(c, (member,)), _amplitudes(c, member), strict=True):
        total = []
        for kind in c.kinds:
            white = Q.T @ covariance(kind) @ Q + signal
            log = -0.5 * (y @ np.linalg.solve(white, y) / c.sigma**2 + np.linalg.slogdet(white)[1]) - n * np.log(
                c.sigma
            )
            total.append(log + c.log_sigma + np.log(kind.probability))
        found[amplitude] = float(special.logsumexp(total))
    return found


def _amplitudes(c: Comparison, member: Member) -> list[float]:
    F = rest(c).T @ (member.columns / c.noise_scale[:, None])
    largest = 1 / c.least_noise
    return list(np.geomspace(largest, min(0.4 / np.sqrt(np.sum(F**2) / len(F)), largest), 7))


def test_the_best_version_of_each_explanation_is_the_one_of_most_evidence() -> None:
    """Of explanations with one column and several versions, at seven sizes each, one by one."""
    c = comparison(5)
    random = np.random.default_rng(6)
    several = [
        Explanation(f"{count} versions", EFFECT, tuple(Member(random.standard_normal((14, 1))) for _ in range(count)))
        for count in (3, 1, 2)
    ]
    c = replace(c, explanations=several)
    _, something = c.log_evidence()
    for i, (log, version) in c.beside().items():
        assert log == pytest.approx(float(something[i, 0]), abs=1e-9)
        tried = {
            (j, amplitude): value
            for j, member in enumerate(several[i].members) for amplitude, value in singles(c, member).items()
        }  # fmt: skip
        j, amplitude = max(tried, key=lambda key: tried[key])
        assert (version.explanation, version.member) == (i, j)
        assert version.amplitude == pytest.approx(amplitude)


def test_kind_and_size_of_the_noise_are_as_probable_as_the_observations_make_them() -> None:
    c, found = comparison(2), []
    Q = rest(c)
    for kind in c.kinds:
        white = Q.T @ covariance(kind) @ Q
        log = [stats.multivariate_normal(np.zeros(len(white)), s**2 * white).logpdf(Q.T @ c.observed) for s in c.sigma]
        found.append(np.array(log) + c.log_sigma + np.log(kind.probability))
    expected = np.exp(np.array(found) - special.logsumexp(found))
    np.testing.assert_allclose(c.noise_posterior(), expected, rtol=1e-6, atol=1e-12)


def test_a_baseline_takes_as_many_observations_as_its_columns_differ() -> None:
    """Columns of any length, one of nothing, and one that is the sum of two others."""
    c = comparison(3)
    columns = np.random.default_rng(4).standard_normal((14, 3)) * [1e-6, 1.0, 1e6]
    whole = np.column_stack([columns, columns @ [1e6, 1.0, 0.0], np.zeros(14)])
    c = replace(c, baseline=whole)
    assert c.degrees_of_freedom == 11
    Q = np.linalg.qr(columns / np.linalg.norm(columns, axis=0))[0]
    np.testing.assert_allclose(c.left, c.observed - Q @ (Q.T @ c.observed), atol=1e-12)
    assert replace(c, baseline=np.zeros((14, 0))).degrees_of_freedom == 14


def test_what_the_baseline_absorbs_has_no_evidence() -> None:
    c = comparison()
    own = Explanation("baseline again", EFFECT, (Member(c.baseline[:, :1] * c.noise_scale[:, None]),))
    _, something = Comparison(
        c.observed, c.baseline, c.kinds, c.sigma, c.log_sigma, [own, *c.explanations], c.noise_scale, c.least_noise
    ).log_evidence()
    assert something[0, 0] == -np.inf


def test_strong_evidence_for_nothing_is_as_rare_as_it_says() -> None:
    """P(p(y|M)/p(y|0) ≥ k) ≤ 1/k under p(y|0), whatever M is; the data are drawn from all of p(y|0), noise included."""
    c = comparison()
    random = np.random.default_rng(3)
    count = 4000
    weight = np.concatenate([kind.probability * np.exp(c.log_sigma) for kind in c.kinds])
    chosen = random.choice(len(weight), count, p=weight / weight.sum())
    g, s = np.divmod(chosen, len(c.sigma))
    data = np.empty((len(c.left), count))
    for i in range(count):
        data[:, i] = c.sigma[s[i]] * c.noise(c.kinds[g[i]], random, 1)[:, 0]
    nothing, something = c.log_evidence(data)
    for k in (3, 10, 30):
        rate = np.mean(something - nothing >= np.log(k), axis=1)
        assert np.all(rate <= 1 / k + 4 * np.sqrt(1 / k / count))


def test_the_tail_of_a_known_distribution_is_extrapolated() -> None:
    draws = np.random.default_rng(4).exponential(size=20_000)
    for value in (0.1, 3.0, 9.0):
        assert tail_probability(draws, value) == pytest.approx(np.exp(-value), rel=0.2)


def test_a_stated_noise_is_mostly_believed() -> None:
    sigma, log_p = sigma_grid(1e-3, 5e-3)
    p = np.exp(log_p)
    near = np.abs(np.log(sigma / 1e-3)) < 0.25
    assert 0.8 < p[near].sum() / p.sum() < 0.99
    assert p[~near].sum() > 0.01


def test_the_evidence_of_heavy_tails_is_below_that_of_student_s_t_and_meets_it_at_the_tangent() -> None:
    random = np.random.default_rng(9)
    residual = 3e-3 * random.standard_t(4, 40)
    kind = tails(residual)
    scale = np.sqrt(np.diag(covariance(kind)))
    sigma = 1.4826 * np.median(np.abs(residual))
    for data, tangent in ((residual, True), (3e-3 * random.standard_t(4, 40), False)):
        bound = stats.norm.logpdf(data, scale=sigma * scale).sum() + kind.log_factor
        exact = stats.t.logpdf(data, 4, scale=sigma * np.sqrt(0.5)).sum()
        assert bound <= exact + 1e-9
        assert (bound == pytest.approx(exact, abs=1e-9)) == tangent


def test_placings_are_a_kind_of_noise_only_where_they_are_repeated() -> None:
    alone = {kind.name for kind in kinds(np.arange(6), np.arange(6.0), np.zeros((6, 3)))}
    assert alone == {"white", "correlated"}
    repeated = kinds(np.repeat([1, 2], 4), np.arange(8.0), np.eye(3)[[0, 1] * 4])
    (half,) = [kind for kind in repeated if kind.name == "placing" and kind.size == 0.5]
    assert covariance(half) == pytest.approx(np.eye(8) + 0.25 * np.kron(np.eye(2), np.ones((4, 4))), abs=1e-12)
    (near, _) = [kind for kind in repeated if kind.name == "correlated"]
    apart = np.abs(np.subtract.outer(np.arange(8), np.arange(8)))
    alike = np.equal.outer(np.arange(8) % 2, np.arange(8) % 2)
    assert covariance(near) == pytest.approx(np.where(alike, 0.5 ** (apart / 2), 0.0), abs=1e-12)
    for kind in repeated:
        assert kind.log_whitening == pytest.approx(-0.5 * np.linalg.slogdet(covariance(kind))[1], abs=1e-12)
    heavy = tails(np.arange(1.0, 9.0))
    assert sum(kind.probability for kind in [*repeated, heavy]) == pytest.approx(1.0)


def test_correlated_coordinates_seen_along_many_directions_are_correlated_as_these_are() -> None:
    random = np.random.default_rng(2)
    n = random.standard_normal((20, 3))
    n /= np.linalg.norm(n, axis=1, keepdims=True)
    *_, near, far = kinds(np.arange(20), np.arange(20.0), 2.0 * n)
    coordinates = 0.5 ** np.abs(np.subtract.outer(np.arange(20), np.arange(20)))
    wanted = np.einsum("ia,ij,ja->ij", n, coordinates, n)
    assert covariance(near) == pytest.approx(wanted, abs=1e-12)
    drawn = far.noise(random.standard_normal((20, 40_000)))
    assert np.cov(drawn) == pytest.approx(covariance(far), abs=5 * np.sqrt(2 / 40_000))
    assert near.log_whitening == pytest.approx(-0.5 * np.linalg.slogdet(wanted)[1], abs=1e-12)
