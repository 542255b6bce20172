"""The closed-form evidence against the density of a multivariate normal distribution, written out."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy import special, stats

from cmm_uq.analysis.diagnosis.comparison import lack_of_fit as draws_of_noise
from cmm_uq.analysis.diagnosis.comparison.conditional import Version
from cmm_uq.analysis.diagnosis.comparison.evidence import CandidateComparison
from cmm_uq.analysis.diagnosis.comparison.explanations import EFFECT, Explanation, Member
from cmm_uq.analysis.diagnosis.comparison.lack_of_fit import (
    draw_nothing,
    left_of_noise,
    probability_of_tails,
    tail_probability,
)
from cmm_uq.analysis.diagnosis.noise import (
    TAILS,
    drawn_shapes,
    heavy_tails,
    probable_tails,
    representative_kinds,
    shape_of,
    sigma_grid,
)
from cmm_uq.base.points import Floats
from cmm_uq.base.units import unit
from cmm_uq.machine.model.recorded import Display
from cmm_uq.maths.inference.linear_model import LinearModel, Unknown, solve
from cmm_uq.maths.inference.noise import Sizes, slow_variances
from tests.analysis.diagnosis.dense_noise import PROBABILITY, covariance, paired, rest, some_kinds


def comparison(seed: int = 1) -> CandidateComparison:
    random = np.random.default_rng(seed)
    m = 14
    rivals = [
        Explanation("one column", EFFECT, (Member(random.standard_normal((m, 1))),)),
        Explanation("two versions", EFFECT, tuple(Member(0.3 * random.standard_normal((m, 3))) for _ in range(2))),
    ]
    noise = some_kinds(np.full(m, 1.4))
    sigma, log_sigma = sigma_grid(None, 0.08)
    observed, baseline = 0.05 * random.standard_normal(m), random.standard_normal((m, 2))
    return CandidateComparison(observed, baseline, noise, sigma, log_sigma, rivals, np.full(m, 1.4), 0.01)


def direct(c: CandidateComparison, members: tuple[Member, ...] | None) -> float:
    """Sum over noise, amplitude and version of the density of what the baseline leaves."""
    total, Q = [], rest(c)
    for kind in c.kinds:
        white = Q.T @ covariance(kind) @ Q
        for signal, weight in _signals(c, members):
            for sigma, log_p in zip(c.sigma, c.log_sigma, strict=True):
                density = stats.multivariate_normal(np.zeros(len(white)), sigma**2 * (white + signal))
                total.append(density.logpdf(Q.T @ c.observed) + log_p + np.log(kind.probability * weight))
    return float(special.logsumexp(total)) + 0.5 * Q.shape[1] * np.log(2 * np.pi)


def _signals(c: CandidateComparison, members: tuple[Member, ...] | None) -> list[tuple[Floats, float]]:
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


@pytest.mark.long
def test_the_evidence_is_that_of_a_multivariate_normal() -> None:
    c = comparison()
    nothing, something = c.log_evidence()
    assert float(nothing[0]) == pytest.approx(direct(c, None), abs=2e-4)
    for i, explanation in enumerate(c.explanations):
        assert something[i, 0] == pytest.approx(direct(c, explanation.members), abs=2e-4)


@pytest.mark.parametrize("stated", [None, 0.07])
def test_the_evidence_of_many_recordings_is_that_of_each_by_itself(stated: float | None) -> None:
    """What is integrated in closed form, or from a table; from no effect to one a thousand times as large as the noise."""
    c = comparison()
    sigma, log_sigma = sigma_grid(stated, 0.08)
    c = replace(c, sigma=sigma, log_sigma=log_sigma)
    effect = c.rest(c.explanations[0].members[0].columns / c.noise_scale[:, None])[:, 0]
    data = np.column_stack([c.left + size * effect for size in (0.0, 0.1, 50.0)])
    given = Version(1, 0, 2.0)
    for beside in ((), (given,)):
        nothing, something = c.log_evidence(data, beside)
        for i, own in enumerate(data.T):
            alone, each = c.log_evidence(own[:, None], beside)
            assert nothing[i] == pytest.approx(float(alone[0]), rel=1e-11)
            np.testing.assert_allclose(something[:, i], each[:, 0], rtol=1e-11)


def singles(c: CandidateComparison, member: Member) -> dict[float, float]:
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


def _amplitudes(c: CandidateComparison, member: Member) -> list[float]:
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


def test_what_was_found_beside_something_is_what_is_found_of_one_explanation_alone() -> None:
    """Whichever was asked for first: one explanation, others, or all; against a comparison that was never asked before."""
    given = [Version(2, 0, 1.5)]
    asked = wide(5)
    every = wide(5).beside(given)
    assert asked.beside(given, (1,)) == wide(5).beside(given, (1,))
    assert set(asked.beside(given, (0, 1))) >= {0, 1}
    for i in (0, 1):
        alone, version = wide(5).beside(given, (i,))[i]
        for found in (every, asked.beside(given), asked.beside(given, (i,))):
            assert found[i][0] == pytest.approx(alone, abs=1e-10)
            assert found[i][1] == version


def wide(columns: int) -> CandidateComparison:
    """Two narrow explanations and a wide one in fifty observations."""
    random, m = np.random.default_rng(8), 50
    several = [
        Explanation(name, EFFECT, (Member(0.3 * random.standard_normal((m, r))),))
        for name, r in (("one column", 1), ("two columns", 2), ("wide", columns))
    ]
    noise, (sigma, log_sigma) = some_kinds(np.full(m, 1.4)), sigma_grid(None, 0.08)
    observed, baseline = 0.08 * random.standard_normal(m), random.standard_normal((m, 2))
    return CandidateComparison(observed, baseline, noise, sigma, log_sigma, several, np.full(m, 1.4), 0.01)


@pytest.mark.parametrize("columns", [5, 36])
def test_what_is_given_is_noise_of_its_covariance(columns: int) -> None:
    """Against the density written out, whatever is given first, and of a wide one at two sizes one after the other."""
    c = wide(columns)
    Q = rest(c)
    y, n = Q.T @ c.observed, Q.shape[1]
    for given in ([(0, 3.0)], [(2, 2.0)], [(2, 0.7)], [(0, 3.0), (2, 2.0)], [(2, 2.0), (1, 1.0), (0, 3.0)]):
        total = []
        for kind in c.kinds:
            white = Q.T @ covariance(kind) @ Q
            for i, amplitude in given:
                F = Q.T @ (c.explanations[i].members[0].columns / c.noise_scale[:, None])
                white = white + amplitude**2 * F @ F.T
            log = -0.5 * (y @ np.linalg.solve(white, y) / c.sigma**2 + np.linalg.slogdet(white)[1])
            total.append(log - n * np.log(c.sigma) + c.log_sigma + np.log(kind.probability))
        versions = [Version(i, 0, amplitude) for i, amplitude in given]
        expected = float(special.logsumexp(total))
        assert float(c.log_evidence_of(versions)[0]) == pytest.approx(expected, abs=2e-4)


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
    _, something = CandidateComparison(
        c.observed, c.baseline, c.kinds, c.sigma, c.log_sigma, [own, *c.explanations], c.noise_scale, c.least_noise
    ).log_evidence()
    assert something[0, 0] == -np.inf


@pytest.mark.long
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
        data[:, i] = left_of_noise(c, c.kinds[g[i]], random, c.sigma[[s[i]]])[:, 0]
    nothing, something = c.log_evidence(data)
    for k in (3, 10, 30):
        rate = np.mean(something - nothing >= np.log(k), axis=1)
        assert np.all(rate <= 1 / k + 4 * np.sqrt(1 / k / count))


def test_the_tail_of_a_known_distribution_is_extrapolated() -> None:
    draws = np.random.default_rng(4).exponential(size=20_000)
    for value in (0.1, 3.0, 9.0):
        assert tail_probability(draws, value) == pytest.approx(np.exp(-value), rel=0.2)


def test_beyond_the_largest_draw_the_tail_is_no_steeper_than_markov_s_inequality_has_it() -> None:
    draws = 0.5 * np.random.default_rng(4).exponential(size=200)
    last = tail_probability(draws, float(draws.max()))
    assert last < 2e-2
    assert tail_probability(draws, float(draws.max()) + 3.0) == pytest.approx(last * np.exp(-3.0), rel=1e-9)
    wide = np.random.default_rng(4).exponential(2.0, size=20_000)
    assert tail_probability(wide, 60.0) == pytest.approx(np.exp(-30.0), rel=1.0)


def test_draws_that_crowd_at_the_floor_of_the_log_odds_show_no_tail() -> None:
    draws = -1.6 + 0.01 * np.random.default_rng(4).exponential(size=200)
    start = float(np.quantile(draws, 0.8))
    assert tail_probability(draws, start + 3.0) == pytest.approx(0.2 * np.exp(-3.0), rel=1e-9)
    assert tail_probability(np.append(draws[1:], 7.0), 7.0) == pytest.approx(1 / 200)


def test_nothing_is_rounded_as_the_recording_was() -> None:
    """Repeats of one coordinate with hardly any noise: all are shown alike, and far from where they are."""
    scale, step = np.ones(8), 5e-3
    fine = replace(paired(scale), display=5.0)
    kind = shape_of(fine, Sizes(np.ones((1, 3)), *np.zeros((3, 1)), np.ones(1)), scale, 1.0)
    xyz = np.repeat([[2e-3, 300.0, 300.0]], 8, axis=0)
    rows, along = np.arange(8)[:, None], np.repeat([[[1.0, 0.0, 0.0]]], 8, axis=0)
    c = CandidateComparison(np.zeros(8), np.zeros((8, 0)), [kind], *sigma_grid(None, 1e-3), [], scale, 1e-4,
                   display=Display(step, xyz, rows, along))  # fmt: skip
    found = left_of_noise(c, kind, np.random.default_rng(1), np.full(5, 1e-5))
    assert found == pytest.approx(np.full((8, 5), -2e-3), abs=1e-9)


def test_a_stated_noise_is_mostly_believed() -> None:
    sigma, log_p = sigma_grid(1e-3, 5e-3)
    p = np.exp(log_p)
    near = np.abs(np.log(sigma / 1e-3)) < 0.6
    assert 0.8 < p[near].sum() / p.sum() < 0.99
    assert p[~near].sum() > 0.01


def test_the_evidence_of_heavy_tails_is_below_that_of_student_s_t_and_meets_it_at_the_tangent() -> None:
    random = np.random.default_rng(9)
    residual = 3e-3 * random.standard_t(4, 40)
    kind = heavy_tails(residual)
    scale = np.sqrt(np.diag(covariance(kind)))
    sigma = 1.4826 * np.median(np.abs(residual))
    for data, tangent in ((residual, True), (3e-3 * random.standard_t(4, 40), False)):
        bound = stats.norm.logpdf(data, scale=sigma * scale).sum() + kind.log_factor
        exact = stats.t.logpdf(data, 4, scale=sigma * np.sqrt(0.5)).sum()
        assert bound <= exact + 1e-9
        assert (bound == pytest.approx(exact, abs=1e-9)) == tangent


def test_a_shape_has_the_covariance_of_its_components() -> None:
    """Written out: pairs that share an offset, axes in turn, cosines of the time."""
    scale = np.repeat(np.linspace(1.0, 2.0, 4), 2)
    white, axes, placing, slow = some_kinds(scale)
    assert covariance(white) == pytest.approx(np.eye(8), abs=1e-12)
    readings = np.repeat([0.25, 1.0, 4.0, 0.25], 2)
    assert np.trace(covariance(axes)) == pytest.approx(readings.sum(), rel=1e-12)
    alike = some_kinds(np.ones(8))[2]
    assert covariance(alike) == pytest.approx(np.eye(8) + 2.25 * np.kron(np.eye(4), np.ones((2, 2))), abs=1e-12)
    assert placing.probability == PROBABILITY["placing"]
    sd, fast = slow_variances(np.array([1.2]), np.array([3.0]), np.arange(4.0))
    waves = np.sqrt([1, 2, 2, 2]) * np.cos(np.pi * np.arange(4.0) * np.linspace(0, 1, 8)[:, None])
    assert covariance(slow) == pytest.approx((1 + fast[0]) * np.eye(8) + (waves * sd) @ waves.T, abs=1e-12)


def test_noise_of_a_shape_has_its_covariance() -> None:
    *_, slow = some_kinds(np.ones(8))
    drawn = slow.noise(np.random.default_rng(2), 40_000)
    wanted = covariance(slow)
    assert np.cov(drawn) == pytest.approx(wanted, abs=5 * np.sqrt(2 / 40_000) * wanted.max())


@pytest.mark.long
@pytest.mark.parametrize("slow", [0.0, 6.0])
def test_the_shapes_that_are_kept_stand_for_all(slow: float) -> None:
    """Evidence for a rival, with set-up offsets or slow noise in the data: of what is kept, and of all that were drawn."""
    random, m = np.random.default_rng(5), 40
    scale, design = np.ones(m), np.column_stack([np.ones(m), np.linspace(-1, 1, m)])
    components = replace(paired(scale), time=np.linspace(0, 1, m))
    sizes = Sizes(np.ones((1, 3)), np.array([0.0 if slow else 1.5]), np.zeros(1), np.array([slow]), np.full(1, 3.0))
    observed = 1e-3 * components.repeated(sizes, 1, random)[0, 0]
    unknowns = tuple(Unknown(("a", str(i)), unit("mm"), 0.0, 1.0, 1.0) for i in range(2))
    linear = LinearModel(observed, design, unknowns, np.zeros((m, 0)), scale, None)
    estimate = solve(linear)
    rival = np.sign(np.sin(np.arange(m) * 0.9))[:, None]
    kept = representative_kinds(linear, components, estimate, 1e-3 * rival, estimate.residuals)
    shapes = drawn_shapes(components)
    every = [
        shape_of(components, components.sizes(shapes[[i]]), scale, (1 - TAILS) / len(shapes))
        for i in range(len(shapes))
    ]
    odds, total = [], []
    for some in (kept, [*every, kept[-1]]):
        grid = sigma_grid(None, estimate.sigma)
        explanation = Explanation("rival", EFFECT, (Member(1e-3 * rival),))
        c = CandidateComparison(observed, design, some, *grid, [explanation], scale, 1e-4)
        nothing, something = c.log_evidence()
        odds.append(float(something[0, 0] - nothing[0]))
        total.append(float(nothing[0]))
    assert odds[0] == pytest.approx(odds[1], abs=0.7)
    assert total[0] == pytest.approx(total[1], abs=1.0)  # of heavy tails a factor of e is no news


@pytest.mark.parametrize("least", [0.04, 0.3])
@pytest.mark.parametrize("stated", [None, 0.1])
def test_a_least_noise_cuts_the_integral_off_below_it(least: float, stated: float | None) -> None:
    """Above it nothing changes; 0.3 is six times what the observations show."""
    whole = sigma_grid(stated, 0.08)
    sigma, log_sigma = sigma_grid(stated, 0.08, least)
    assert np.all(np.isneginf(log_sigma[sigma < least]))
    assert np.exp(log_sigma[sigma >= least]).sum() > 0
    if least < 0.08:
        assert np.array_equal(sigma, whole[0])
        assert np.array_equal(log_sigma[sigma >= least], whole[1][sigma >= least])
    c = replace(comparison(), sigma=sigma[sigma >= least], log_sigma=log_sigma[sigma >= least])
    cut = replace(comparison(), sigma=sigma, log_sigma=log_sigma)
    assert cut.log_evidence()[0][0] == pytest.approx(direct(c, None), abs=0.02)


def test_where_nothing_that_is_thought_of_could_show_nothing_is_missing() -> None:
    """As of a single placing of a triangle, whose freedoms take up all that is observed."""
    assert tail_probability(np.full(50, -np.inf), -np.inf) == 1.0


def test_heavy_tails_are_as_probable_as_studentised_residuals_make_them() -> None:
    """Residuals over the roots of their variances, which the residual-forming matrix of generalised least squares has."""
    c = comparison(11)
    for kind in c.kinds:
        W = kind.white(np.eye(len(c.observed)))
        X = W @ c.baseline
        M = np.eye(len(W)) - X @ np.linalg.pinv(X)
        z = (M @ W @ c.observed)[np.diag(M) > 0.1] / np.sqrt(np.diag(M)[np.diag(M) > 0.1])
        assert probability_of_tails(c, kind) == pytest.approx(0.0 if kind.name == "tails" else probable_tails(z))


def test_as_many_recordings_of_nothing_have_heavy_tails_as_that_is_probable(monkeypatch: pytest.MonkeyPatch) -> None:
    c = comparison(12)
    draws = {}
    for share in (0.0, 0.4):
        monkeypatch.setattr(draws_of_noise, "probability_of_tails", lambda *_, share=share: share)
        draws[share] = draw_nothing(c, np.random.default_rng(1), 2000)
    changed = np.any(draws[0.0] != draws[0.4], axis=0)
    assert stats.binomtest(int(changed.sum()), 2000, 0.4).pvalue > 1e-4
    variance = [np.mean(each[:, ~changed] ** 2) for each in draws.values()]
    assert variance[0] == variance[1]
