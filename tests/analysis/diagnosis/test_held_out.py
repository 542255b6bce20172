"""Exact refits without each placing against Pareto-smoothed importance sampling (ArviZ), which refits nothing."""

from __future__ import annotations

import arviz
import numpy as np
import pytest
from scipy import linalg, stats

from cmm_uq.analysis.diagnosis.held_out import FOLDS, improvement, numbered_by_place
from cmm_uq.app.commands.reading import read_job
from cmm_uq.artefacts import artefact_facts
from cmm_uq.artefacts.ballbar import Ballbar
from cmm_uq.artefacts.gauge_lines import StepGauge
from cmm_uq.base.points import Floats, Ints, Machine, Points
from cmm_uq.machine.model import Noise, RecordingModel
from cmm_uq.machine.physics.catalogue import effects
from cmm_uq.maths.inference.posterior import Density
from tests.analysis.conformity.recorded import gauge
from tests.conftest import ROOT
from tests.recordings import TRAVEL, bar_facts, bars

SCALES = ("scale_x", "scale_y", "scale_z")


def recording() -> Points:
    """Forty bars on a machine with a squareness error of 12″."""
    points = bars(np.random.default_rng(3), 40, 400.0, Machine("m", "XYZ", TRAVEL))
    truth = RecordingModel(Ballbar(bar_facts(), points), effects(("squareness_xy",)))
    return points.at(truth.simulate(np.array([12.0]), np.array([400.0]), Noise(5e-3), np.random.default_rng(4)))


def leave_one_out(model: RecordingModel) -> tuple[float, Floats]:
    """Expected log predictive density and Pareto k of each bar, from draws of the posterior given all of them."""
    linear = model.estimate().linear
    sigma = model.estimate().least_squares.sigma_of_residuals
    mean, covariance, _ = Density(linear).conditional(float(np.log(sigma)))
    draws = np.random.default_rng(5).multivariate_normal(mean, covariance, 8000, method="eigh")
    log = stats.norm.logpdf(linear.observed, draws @ linear.design.T, sigma * linear.noise_scale)
    log += np.log(linear.noise_scale)  # densities of observations in units of their noise scale
    found = arviz.loo(
        arviz.from_dict(posterior={"theta": draws[None]}, log_likelihood={"length": log[None]}), pointwise=True
    )
    return float(found.elpd_loo), np.asarray(found.pareto_k)


def test_the_gain_of_exact_refits_is_that_of_importance_sampling() -> None:
    points = recording()
    before, after = (
        RecordingModel(Ballbar(bar_facts(), points), effects(names)) for names in (SCALES, (*SCALES, "squareness_xy"))
    )
    (first, k_first), (second, k_second) = leave_one_out(before), leave_one_out(after)
    assert max(k_first.max(), k_second.max()) < 0.7
    gain = improvement(before, after)
    assert gain.elpd_gain > 0
    assert gain.elpd_gain == pytest.approx(second - first, abs=0.3)


def predicted(model: RecordingModel, groups: Ints, *, whole: bool) -> tuple[Floats, float]:
    """Log predictive density of each fold and rms of its errors, µm.

    All observations, in units of their noise, are normal with covariance A·P·Aᵀ + σ², a placing being known to 100 mm before;
    those that the fit has seen are taken as given (Gelman et al., *Bayesian Data Analysis*, A.1). Where set-ups are left out
    as a whole, only combinations that their own place does not change are predicted.
    """
    estimate = model.estimate()
    linear, sigma = estimate.linear, estimate.least_squares.sigma_of_residuals
    A = np.hstack([linear.design, linear.freedoms.dense()]) / linear.noise_scale[:, None]
    variance = [*linear.prior_sd**2, *[1e4] * linear.freedoms.dense().shape[1]]
    y = (linear.observed - linear.design @ linear.prior_mean) / linear.noise_scale
    joint = A @ np.diag(variance) @ A.T + sigma**2 * np.eye(len(y))
    numbers, densities, errors = np.unique(groups), [], []
    count = FOLDS if len(numbers) > 40 else len(numbers)
    for k in range(count):
        out = np.isin(groups, numbers[k::count])
        gain = np.linalg.solve(joint[np.ix_(~out, ~out)], joint[np.ix_(~out, out)]).T
        Q = (
            linalg.null_space(linear.freedoms.dense()[out].T)
            if whole and linear.freedoms.dense().size
            else np.eye(out.sum())
        )
        error = Q.T @ (y[out] - gain @ y[~out])
        spread = Q.T @ (joint[np.ix_(out, out)] - gain @ joint[np.ix_(~out, out)]) @ Q
        densities.append(stats.multivariate_normal.logpdf(error, cov=spread))
        errors.append(error * linear.noise_scale[out][0])
    return np.array(densities), float(1e3 * np.sqrt(np.mean(np.concatenate(errors) ** 2)))


def compared(before: RecordingModel, after: RecordingModel, groups: Ints, unseen: str) -> None:
    """All figures of an improvement against the joint distribution; its standard error is over what was left out."""
    whole = unseen == "set-ups"
    xyz, rows = before.artefact.points.xyz, before.artefact.rows
    away = [np.mean(np.sum((xyz - xyz.mean(axis=0)) ** 2, axis=1)[rows[groups == g]]) for g in np.unique(groups)]
    _, index = np.unique(groups, return_inverse=True)
    groups = np.argsort(np.argsort(away))[index]  # in folds by how far they are from the middle, whatever their numbers
    (first, rms_first), (second, rms_second) = (predicted(model, groups, whole=whole) for model in (before, after))
    found = improvement(before, after)
    assert found.unseen == unseen
    assert found.heldout_rms_before_um == pytest.approx(rms_first, rel=1e-5)
    assert found.heldout_rms_after_um == pytest.approx(rms_second, rel=1e-5)
    assert found.elpd_gain == pytest.approx((second - first).sum(), rel=1e-4)
    assert found.elpd_gain_se == pytest.approx(np.sqrt(len(first)) * (second - first).std(ddof=1), rel=1e-4)
    for model, rms in ((before, found.rms_before_um), (after, found.rms_after_um)):
        assert rms == pytest.approx(1e3 * np.sqrt(np.mean(model.estimate().least_squares.residuals ** 2)))
    same = improvement(after, after)
    assert (same.elpd_gain, same.elpd_gain_se) == (0.0, 0.0)
    assert same.heldout_rms_before_um == same.heldout_rms_after_um == found.heldout_rms_after_um


@pytest.mark.parametrize("made", [12, 40, 41, 44])
def test_predictions_of_bars_are_those_of_the_joint_normal_distribution(made: int) -> None:
    """Up to forty bars one by one, of more a tenth at a time."""
    points = bars(np.random.default_rng(6), made, 400.0, Machine("m", "XYZ", TRAVEL))
    truth = RecordingModel(Ballbar(bar_facts(), points), effects(("squareness_xy",)))
    points = points.at(truth.simulate(np.array([12.0]), np.array([400.0]), Noise(5e-3), np.random.default_rng(7)))
    before, after = (
        RecordingModel(Ballbar(bar_facts(), points), effects(names)) for names in (SCALES, (*SCALES, "squareness_xy"))
    )
    compared(before, after, after.artefact.measurement, "set-ups")


@pytest.mark.parametrize(("lines", "unseen"), [(12, "set-ups"), (10, "set-ups"), (9, "points")])
def test_predictions_along_lines_are_those_of_the_joint_normal_distribution(lines: int, unseen: str) -> None:
    """Whole lines of a gauge, whose place is then open, or faces on few lines, whose place the other faces give."""
    directions = np.random.default_rng(8).standard_normal((lines, 3))
    ideal = gauge(list(directions), [[20.0, 100.0, 200.0, 300.0]] * lines, repeats=2)
    truth = RecordingModel(ideal, effects(("squareness_xy",)))
    xyz = truth.simulate(np.array([12.0]), np.array([800.0]), Noise(2e-3), np.random.default_rng(9))
    facts = artefact_facts(kind="step_gauge", length_mm=800.0, u_um=0.4)
    artefact = StepGauge(facts, ideal.points.at(xyz))
    before, after = (RecordingModel(artefact, effects(names)) for names in (SCALES, (*SCALES, "squareness_xy")))
    key = np.column_stack([artefact.measurement, artefact.points.point])
    groups = artefact.measurement if unseen == "set-ups" else np.unique(key, axis=0, return_inverse=True)[1].ravel()
    compared(before, after, groups, unseen)


def test_points_of_a_few_lines_are_predicted_as_the_press_residuals_of_all_columns_say() -> None:
    """Without rows O, e = (1 − H_OO)⁻¹ r (Cook & Weisberg 1982, 2.2.3), the gauge's place on each line being a column too."""
    job = read_job(ROOT / "examples" / "step-gauge-simulated")
    facts = job.facts.artefact.model_copy(update={"u_um": 1e-6})
    model = RecordingModel(StepGauge(facts, job.points), effects(("scale_x", "scale_y", "scale_z", "squareness_xy")))
    linear = model.estimate().linear
    y = linear.observed - linear.design[:, 4:] @ linear.prior_mean[4:]
    columns = np.hstack([linear.design[:, :4], linear.freedoms.dense()])
    Q = np.linalg.qr(columns / np.linalg.norm(columns, axis=0))[0]
    residual, hat = y - Q @ (Q.T @ y), Q @ Q.T
    artefact = model.artefact
    groups = numbered_by_place(
        model, np.column_stack([artefact.measurement, artefact.points.point[artefact.rows[:, 0]]])
    )
    errors = []
    for k in range(FOLDS):
        out = np.isin(groups, np.unique(groups)[k::FOLDS])
        errors.append(np.linalg.solve(np.eye(out.sum()) - hat[np.ix_(out, out)], residual[out]))
    found = improvement(model, model)
    assert found.unseen == "points"
    assert found.heldout_rms_before_um == pytest.approx(1e3 * np.sqrt(np.mean(np.concatenate(errors) ** 2)), rel=2e-3)
