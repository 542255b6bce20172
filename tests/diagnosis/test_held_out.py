"""Exact refits without each placing against Pareto-smoothed importance sampling (ArviZ), which refits nothing."""

from __future__ import annotations

import arviz
import numpy as np
import pytest
from scipy import stats

from cmm_uq.commands.reading import read_job
from cmm_uq.diagnosis.held_out import FOLDS, improvement
from cmm_uq.inference.posterior import Density
from cmm_uq.kinds.ballbar.observe import Ballbar
from cmm_uq.kinds.gauge_lines.observe import StepGauge
from cmm_uq.model import MeasurementModel, Noise
from cmm_uq.physics.catalogue import effects
from cmm_uq.points import Floats, Machine, Points
from tests.conftest import ROOT
from tests.recordings import TRAVEL, bar_facts, bars

SCALES = ("scale_x", "scale_y", "scale_z")


def recording() -> Points:
    """Forty bars on a machine with a squareness error of 12″."""
    points = bars(np.random.default_rng(3), 40, 400.0, Machine("m", "XYZ", TRAVEL))
    truth = MeasurementModel(Ballbar(bar_facts(), points), effects(("squareness_xy",)))
    return points.at(truth.simulate(np.array([12.0]), np.array([400.0]), Noise(5e-3), np.random.default_rng(4)))


def leave_one_out(model: MeasurementModel) -> tuple[float, Floats]:
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
        MeasurementModel(Ballbar(bar_facts(), points), effects(names)) for names in (SCALES, (*SCALES, "squareness_xy"))
    )
    (first, k_first), (second, k_second) = leave_one_out(before), leave_one_out(after)
    assert max(k_first.max(), k_second.max()) < 0.7
    gain = improvement(before, after)
    assert gain.elpd_gain > 0
    assert gain.elpd_gain == pytest.approx(second - first, abs=0.3)


def predicted(model: MeasurementModel, count: int) -> tuple[Floats, float]:
    """Log predictive density of each fold and rms of its errors, µm: y is normal with covariance A·P·Aᵀ + σ²N, from which the
    training observations are taken as given (Gelman et al., *Bayesian Data Analysis*, A.1), in units of the noise scale.
    """
    estimate = model.estimate()
    linear, sigma = estimate.linear, estimate.least_squares.sigma_of_residuals
    A = linear.design / linear.noise_scale[:, None]
    y = linear.observed / linear.noise_scale - A @ linear.prior_mean
    whole = A @ np.diag(linear.prior_sd**2) @ A.T + sigma**2 * np.eye(len(y))
    numbers = np.unique(model.artefact.measurement)
    densities, errors = [], []
    for k in range(count):
        out = np.isin(model.artefact.measurement, numbers[k::count])
        gain = whole[np.ix_(out, ~out)] @ np.linalg.inv(whole[np.ix_(~out, ~out)])
        error = y[out] - gain @ y[~out]
        spread = whole[np.ix_(out, out)] - gain @ whole[np.ix_(~out, out)]
        densities.append(stats.multivariate_normal.logpdf(error, cov=spread))
        errors.append(error * linear.noise_scale[out])
    return np.array(densities), float(1e3 * np.sqrt(np.mean(np.concatenate(errors) ** 2)))


@pytest.mark.parametrize(("bars_made", "folds"), [(12, 12), (40, 40), (44, FOLDS)])
def test_predictions_are_those_of_the_joint_normal_distribution(bars_made: int, folds: int) -> None:
    """Up to forty bars one by one, of more a tenth at a time; the gain's standard error is over what was left out."""
    points = bars(np.random.default_rng(6), bars_made, 400.0, Machine("m", "XYZ", TRAVEL))
    truth = MeasurementModel(Ballbar(bar_facts(), points), effects(("squareness_xy",)))
    xyz = truth.simulate(np.array([12.0]), np.array([400.0]), Noise(5e-3), np.random.default_rng(7))
    before, after = (
        MeasurementModel(Ballbar(bar_facts(), points.at(xyz)), effects(names))
        for names in (SCALES, (*SCALES, "squareness_xy"))
    )
    (first, rms_first), (second, rms_second) = predicted(before, folds), predicted(after, folds)
    found = improvement(before, after)
    assert found.unseen == "placings"
    assert found.heldout_rms_before_um == pytest.approx(rms_first, rel=1e-6)
    assert found.heldout_rms_after_um == pytest.approx(rms_second, rel=1e-6)
    assert found.elpd_gain == pytest.approx((second - first).sum(), rel=1e-5)
    assert found.elpd_gain_se == pytest.approx(np.sqrt(folds) * (second - first).std(ddof=1), rel=1e-5)
    for model, rms in ((before, found.rms_before_um), (after, found.rms_after_um)):
        residuals = model.estimate().least_squares.residuals
        assert rms == pytest.approx(1e3 * np.sqrt(np.mean(residuals**2)))
    same = improvement(after, after)
    assert (same.elpd_gain, same.elpd_gain_se) == (0.0, 0.0)
    assert same.heldout_rms_before_um == same.heldout_rms_after_um == found.heldout_rms_after_um


def test_points_of_a_few_lines_are_predicted_as_the_press_residuals_of_all_columns_say() -> None:
    """Without rows O, e = (1 − H_OO)⁻¹ r (Cook & Weisberg 1982, 2.2.3), the gauge's place on each line being a column too."""
    job = read_job(ROOT / "examples" / "step-gauge-simulated")
    facts = job.facts.artefact.model_copy(update={"u_um": 1e-6})
    model = MeasurementModel(StepGauge(facts, job.points), effects(("scale_x", "scale_y", "scale_z", "squareness_xy")))
    linear = model.estimate().linear
    y = linear.observed - linear.design[:, 4:] @ linear.prior_mean[4:]
    columns = np.hstack([linear.design[:, :4], linear.placing])
    Q = np.linalg.qr(columns / np.linalg.norm(columns, axis=0))[0]
    residual, hat = y - Q @ (Q.T @ y), Q @ Q.T
    artefact = model.artefact
    key = np.column_stack([artefact.measurement, artefact.points.point[artefact.rows[:, 0]]])
    groups = np.unique(key, axis=0, return_inverse=True)[1].ravel()
    errors = []
    for k in range(FOLDS):
        out = np.isin(groups, np.unique(groups)[k::FOLDS])
        errors.append(np.linalg.solve(np.eye(out.sum()) - hat[np.ix_(out, out)], residual[out]))
    found = improvement(model, model)
    assert found.unseen == "points"
    assert found.heldout_rms_before_um == pytest.approx(1e3 * np.sqrt(np.mean(np.concatenate(errors) ** 2)), rel=2e-3)
