"""Evidence and predictions in closed form against dense Gaussian computations of the same."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy import linalg, special, stats

from cmm_uq.analysis.diagnosis.comparison.conditional import AMPLITUDES
from cmm_uq.analysis.diagnosis.empirical.evidence import FunctionFit, FunctionVersion, predictions, residuals
from cmm_uq.analysis.diagnosis.empirical.functions import FunctionFamily, FunctionTerm, forms_of
from cmm_uq.base.messages import Verbatim
from cmm_uq.base.points import Floats

M, P = 24, 3


def family(columns: Floats, name: str, log_prior: float = 0.0) -> FunctionFamily:
    term = FunctionTerm(name, Verbatim(name), "x")
    return FunctionFamily(term, "smooth", columns, log_prior, np.zeros(0), np.zeros((0, *columns.shape[1:])))


@pytest.fixture
def fit() -> FunctionFit:
    random = np.random.default_rng(11)
    free = np.column_stack([np.ones(M), random.standard_normal((M, P - 1))])
    block = np.repeat(np.arange(M // 3), 3)
    covariance = np.eye(M) + 0.8 * (block[:, None] == block)
    families = [
        family(random.standard_normal((M, 4, 1)), "a", float(np.log(0.1))),
        family(random.standard_normal((M, 2, 2)), "b", float(np.log(0.2))),
    ]
    y = (
        free @ [0.3, -0.2, 0.1]
        + 0.02 * families[0].columns[:, 2, 0]
        + 0.004 * np.linalg.cholesky(covariance) @ random.standard_normal(M)
    )
    sigma = np.geomspace(1e-3, 0.1, 300)
    return FunctionFit(y, free, covariance, families, sigma, np.full(300, -np.log(300)), 1e-3)


def dense(y: Floats, free: Floats, covariance: Floats, sigma: Floats, log_sigma: Floats) -> float:
    """Log of ∫ p(y | b, σ) p(σ) db dσ with b flat, but for what no covariance changes (restricted likelihood)."""
    inverse = linalg.inv(covariance)
    normal = free.T @ inverse @ free
    left = y - free @ linalg.solve(normal, free.T @ inverse @ y)
    square, degrees = float(left @ inverse @ left), len(y) - free.shape[1]
    log = -0.5 * (np.linalg.slogdet(covariance)[1] + np.linalg.slogdet(normal)[1])
    return log + float(special.logsumexp(log_sigma - degrees * np.log(sigma) - 0.5 * square / sigma**2))


def test_evidence_is_the_restricted_likelihood(fit: FunctionFit) -> None:
    def of(version: FunctionVersion | None) -> float:
        columns = np.zeros((M, 1))
        if version is not None:
            columns = version.amplitude * fit.families[version.family].columns[:, version.index]
        return dense(fit.y, fit.free, fit.covariance + columns @ columns.T, fit.sigma, fit.log_sigma)

    nothing = of(None)
    for i, one in enumerate(fit.families):
        log, sizes = fit.evidence[i]
        for k in range(one.columns.shape[1]):
            for a in (0, 3, AMPLITUDES - 1):
                told = of(FunctionVersion(i, k, float(sizes[k, a]))) - nothing + one.log_prior - np.log(AMPLITUDES)
                if np.isfinite(log[k, a]):
                    assert log[k, a] - fit.nothing == pytest.approx(told, abs=2e-2)  # of the grid of σ
                else:  # it would show more than three times all that there is to be explained
                    columns = sizes[k, a] * one.columns[:, k]
                    sigma = fit.fitted(FunctionVersion(i, k, float(sizes[k, a])))[2]
                    assert sigma * np.linalg.norm(fit.rest(columns)) > 3 * np.sqrt(fit.square)


def test_the_true_function_is_the_most_probable(fit: FunctionFit) -> None:
    best = fit.versions(1)[0]
    assert (best.family, best.index) == (0, 2)
    mean, covariance, _ = fit.fitted(best)
    assert abs(mean[0] - 0.02) < 3 * np.sqrt(covariance[0, 0])


def alone(fit: FunctionFit, rows: np.ndarray) -> FunctionFit:
    """Some of the observations, as if no others had been measured."""
    families = [replace(one, columns=one.columns[rows]) for one in fit.families]
    covariance = fit.covariance[np.ix_(rows, rows)]
    return replace(fit, y=fit.y[rows], free=fit.free[rows], covariance=covariance, families=families)


def conditional(fit: FunctionFit, out: np.ndarray, added: Floats, sigma: float) -> tuple[Floats, Floats]:
    """Mean and covariance of y[out] given the others, with b normal and very wide, by the dense joint covariance."""
    wide = 1e8 * fit.free @ fit.free.T + fit.covariance + added
    gain = linalg.solve(wide[np.ix_(~out, ~out)], wide[np.ix_(~out, out)], assume_a="pos").T
    mean = gain @ fit.y[~out]
    return mean, (wide[np.ix_(out, out)] - gain @ wide[np.ix_(~out, out)]) * sigma**2


def test_without_functions_predictions_are_those_of_the_joint_normal_distribution(fit: FunctionFit) -> None:
    out = np.zeros(M, dtype=bool)
    out[[4, 5, 13]] = True
    (before, _), lost = predictions(fit, out, 1)
    fold = alone(fit, ~out)
    sigma = np.sqrt(fold.square / fold.degrees)
    mean, covariance = conditional(fit, out, np.zeros((M, M)), float(sigma))
    assert lost == 0
    told = stats.multivariate_normal(mean, covariance).logpdf(fit.y[out])
    order = [*np.flatnonzero(~out), *np.flatnonzero(out)]
    root = np.linalg.cholesky(fit.covariance[np.ix_(order, order)])
    scale = np.log(np.diag(root)[-3:]).sum()  # densities are of white errors
    assert before.log_density == pytest.approx(told + scale, abs=1e-4)


def test_a_function_that_is_certain_predicts_as_a_column_of_the_model(fit: FunctionFit) -> None:
    """With one version alone the average is that version: the joint normal distribution with its columns."""
    out = np.zeros(M, dtype=bool)
    out[[0, 7, 20]] = True
    certain = replace(fit, families=[family(fit.families[0].columns[:, [2]], "a", 40.0)])
    (_, after), _ = predictions(certain, out, 1)
    fold = alone(certain, ~out)
    versions = [v for v in fold.versions() if v.probability > 1e-3]
    total, logs = sum(v.probability for v in versions), []
    for version in versions:
        column = version.amplitude * certain.families[0].columns[:, 0]
        mean, covariance = conditional(certain, out, column @ column.T, fold.fitted(version)[2])
        logs.append(
            stats.multivariate_normal(mean, covariance).logpdf(certain.y[out]) + np.log(version.probability / total)
        )
    order = [*np.flatnonzero(~out), *np.flatnonzero(out)]
    scale = np.log(np.diag(np.linalg.cholesky(certain.covariance[np.ix_(order, order)]))[-3:]).sum()
    assert after.log_density == pytest.approx(float(special.logsumexp(logs)) + scale, abs=1e-3)
    assert np.abs(after.errors).max() < 0.03


def test_what_a_set_up_leaves_open_is_no_error(fit: FunctionFit) -> None:
    """A free column of held-out observations alone takes one dimension, and whatever lies along it."""
    out = np.zeros(M, dtype=bool)
    out[[4, 5, 13]] = True
    own = np.where(out, 1.0, 0.0)[:, None]
    shifted = replace(fit, free=np.hstack([fit.free, own]), y=fit.y + 7.0 * out)
    plain = replace(fit, free=np.hstack([fit.free, own]))
    (before, _), lost = predictions(plain, out, 1)
    (moved, _), _ = predictions(shifted, out, 1)
    assert lost == 1
    assert moved.errors == pytest.approx(before.errors, abs=1e-7)
    assert moved.log_density == pytest.approx(before.log_density, abs=1e-5)


def test_residuals_without_a_function_are_those_of_generalised_least_squares(fit: FunctionFit) -> None:
    inverse = linalg.inv(fit.covariance)
    told = fit.y - fit.free @ linalg.solve(fit.free.T @ inverse @ fit.free, fit.free.T @ inverse @ fit.y)
    none, one = residuals(fit, 1)
    assert none == pytest.approx(told, abs=1e-9)
    assert np.linalg.norm(one) < 0.5 * np.linalg.norm(none)


def left_out(of: str) -> tuple[FunctionFit, np.ndarray]:
    """Set-ups of six observations, each quantity twice, with noise in common, and what is left out of them."""
    random, setup, quantity = np.random.default_rng(7), np.repeat(np.arange(6), 6), np.repeat(np.arange(18), 2)
    m, out = len(setup), np.zeros(len(setup), dtype=bool)
    free = random.standard_normal((18, 3))[quantity]
    if of in ("set-up", "several"):  # whose offset is free
        free = np.hstack([free, np.eye(6)[setup]])
    covariance = np.eye(m) + 0.7 * (quantity[:, None] == quantity) + 0.3 * (setup[:, None] == setup)
    families = [
        family(random.standard_normal((18, 9, r))[quantity], str(r), float(np.log(r / 9))) for r in (1, 2, 5, 1)
    ]
    families[0].columns[:, 0] = (setup == 2)[:, None]  # seen in one set-up alone
    out[{"some": [3, 4, 20], "repeat": [8], "set-up": setup == 2, "several": (setup == 2) | (quantity < 7)}[of]] = True
    y = 0.02 * families[0].columns[:, 4, 0] + 0.01 * families[1].columns[:, 3, 0] + 0.003 * random.standard_normal(m)
    sigma = np.geomspace(1e-4, 1e-1, 300)
    return FunctionFit(y, free, covariance, families, sigma, np.full(300, -np.log(300)), 1e-3), out


@pytest.mark.parametrize("of", ["some", "repeat", "set-up", "several"])
def test_what_is_left_out_changes_the_evidence_as_if_it_had_not_been_measured(of: str) -> None:
    """Against the same of the other observations alone, with one function and with two given, each time computed anew."""
    whole, out = left_out(of)
    fold, anew = whole.without(out), alone(whole, ~out)
    assert whole.degrees - fold.degrees == int(out.sum()) - {"set-up": 1, "several": 3}.get(of, 0)
    for _ in range(3):
        assert fold.degrees == anew.degrees
        assert fold.square == pytest.approx(anew.square, rel=1e-9)
        for found, told in zip(fold.products, anew.products, strict=True):
            for each, own in zip(found, told, strict=True):
                assert each == pytest.approx(own, rel=1e-9, abs=1e-9 * float(np.abs(own).max()))
        for (log, sizes), (own, of_own) in zip(fold.evidence, anew.evidence, strict=True):
            assert log == pytest.approx(own, rel=1e-9)
            assert sizes == pytest.approx(of_own, rel=1e-9)
        first, second = fold.versions(), anew.versions()
        assert [(v.family, v.index) for v in first[:5]] == [(v.family, v.index) for v in second[:5]]
        for one, other in zip(fold.fitted(first[0]), anew.fitted(second[0]), strict=True):
            assert one == pytest.approx(other, rel=1e-8)
        given = first[0].amplitude * anew.families[first[0].family].columns[:, first[0].index]
        fold, anew = fold.with_function(first[0]), replace(anew, covariance=anew.covariance + given @ given.T)


def test_products_of_what_is_left_are_those_with_the_precision() -> None:
    """Of one column, of several, and of functions of several coefficients each."""
    fit, _ = left_out("set-up")
    root = np.linalg.cholesky(fit.covariance)
    basis = linalg.orth(linalg.solve_triangular(root, fit.free, lower=True), rcond=1e-9)
    for columns in (fit.y, fit.free[:, :2], fit.families[1].columns):
        white = linalg.solve_triangular(root, columns.reshape(len(fit.y), -1), lower=True)
        left = (white - basis @ (basis.T @ white)).reshape(columns.shape)
        assert fit.rest(columns) == pytest.approx(left, abs=1e-10)


def test_a_second_function_predicts_beside_the_first_as_the_joint_normal_distribution() -> None:
    """With one version of each alone: the first as noise of its size, the second as noise beside it."""
    whole, out = left_out("some")
    one, other = (family(whole.families[0].columns[:, [k]], str(k), prior) for k, prior in ((4, 80.0), (5, 40.0)))
    (_, _, after), _ = predictions(replace(whole, families=[one, other]), out, 2)
    fold, logs, weights = alone(replace(whole, families=[one, other]), ~out), list[float](), list[float]()
    first = fold.versions()[0]
    given = first.amplitude * (one, other)[first.family].columns[:, 0]
    anew = replace(fold, covariance=fold.covariance + given[~out] @ given[~out].T)
    versions = [v for v in anew.versions() if v.probability > 1e-3]
    for v in versions:
        added = v.amplitude * (one, other)[v.family].columns[:, 0]
        mean, covariance = conditional(whole, out, given @ given.T + added @ added.T, anew.fitted(v)[2])
        logs.append(float(stats.multivariate_normal(mean, covariance).logpdf(whole.y[out])))
        weights.append(v.probability / sum(each.probability for each in versions))
    order = [*np.flatnonzero(~out), *np.flatnonzero(out)]
    scale = np.log(np.diag(np.linalg.cholesky(whole.covariance[np.ix_(order, order)]))[-int(out.sum()) :]).sum()
    assert after.log_density == pytest.approx(float(special.logsumexp(logs, b=weights)) + scale, abs=1e-3)


X, COUNT = np.linspace(0.0, 900.0, 80), np.arange(5.0, 16.0, 0.35)


def of_sines(frequency: Floats) -> FunctionFamily:
    """Of so many periods over the range, (K,)."""
    period = 900.0 / frequency
    form = replace(
        next(f for f in forms_of(X) if f.name == "sine"),
        shapes=period[:, None],
        apart=np.abs(np.gradient(period))[:, None],
    )
    values = 0.05 * form.values(X, form.shapes)
    term, log_prior = FunctionTerm("x_mm", Verbatim("x"), "x"), -float(np.log(len(period)))
    return FunctionFamily(term, "sine", values / 0.05, log_prior, X, values, form, lambda columns: columns / 0.05)


def of_wave(frequency: float, family: FunctionFamily) -> FunctionFit:
    y = 0.01 * np.sin(2 * np.pi * X * frequency / 900.0 + 0.4) + 0.003 * np.random.default_rng(3).standard_normal(80)
    sigma = np.geomspace(1e-4, 0.1, 300)
    return FunctionFit(y, np.ones((80, 1)), np.eye(80), [family], sigma, np.full(300, -np.log(300)), 1e-4)


@pytest.mark.parametrize("frequency", [COUNT[15], COUNT[15] + 0.11, COUNT[15] + 0.175])
def test_a_finer_grid_has_the_evidence_of_a_dense_one_wherever_the_period_lies(frequency: float) -> None:
    """Half way between two nodes a grid 0.35 periods apart loses ten; the dense one has a node each 0.005 periods."""
    fit = of_wave(frequency, of_sines(COUNT))
    dense = of_wave(frequency, of_sines(np.arange(COUNT[0] - 0.1725, COUNT[-1] + 0.175, 0.005)))
    finer = fit.refined()
    assert finer.total == pytest.approx(dense.total, abs=0.3)
    assert frequency != COUNT[15] + 0.175 or fit.total < dense.total - 5.0
    best = finer.versions(1)[0]
    form = finer.families[best.family].shaped
    assert form is not None
    assert 900.0 / float(form.shapes[best.index, 0]) == pytest.approx(frequency, abs=0.06)


def test_finer_nodes_are_together_as_probable_beforehand_as_those_in_whose_place_they_stand() -> None:
    coarse, nodes = of_sines(COUNT), np.array([2, 5])
    finer, rest = coarse.finer(nodes), coarse.without(nodes)
    assert finer is not None
    assert finer.shaped is not None
    prior = [len(one.shaped.shapes) * np.exp(one.log_prior) for one in (finer, rest) if one.shaped]
    assert prior == pytest.approx([2 / len(COUNT), 1 - 2 / len(COUNT)])
    assert finer.cell is not None
    assert np.bincount(finer.cell).tolist() == [9, 9]
    assert finer.shaped.shapes[[4, 13], 0] == pytest.approx(900.0 / COUNT[nodes])
    assert finer.finer(np.array([0])) is None


def test_a_node_made_finer_counts_as_one_function_among_those_that_are_followed() -> None:
    """Its probability is that of all that stand in its place: none is lost because it was divided."""
    fit = of_wave(COUNT[15] + 0.11, of_sines(COUNT)).refined()
    assert sum(version.probability for version in fit.versions()) == pytest.approx(1.0, abs=0.01)
