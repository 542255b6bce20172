"""The field's posterior beside the same computed with dense matrices, and with no errors but the named ones."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
import scipy.linalg

from cmm_uq.analysis.machine import recordings
from cmm_uq.analysis.machine.conditional import RecordedField, shown, white
from cmm_uq.analysis.machine.state import Unmodelled
from cmm_uq.artefacts import artefact_facts
from cmm_uq.base.points import Floats
from cmm_uq.machine.model import RecordingModel
from cmm_uq.machine.model.field import covariance, curves, family_of, linear
from cmm_uq.machine.physics.catalogue import effects
from cmm_uq.machine.physics.effect import Effect
from cmm_uq.machine.physics.effects.drives import PeriodicScale
from cmm_uq.maths.inference import families as room
from cmm_uq.maths.inference.families import FieldModel
from cmm_uq.maths.inference.posterior import Density
from tests.analysis.machine.test_conditional import calibration, gauge
from tests.artefacts.constructions import indicated, model as named, rings
from tests.recordings import with_columns

OTHERS = (*curves(), *effects(["hysteresis_x", "hysteresis_y", "hysteresis_z"]))
PERIODIC = effects(["periodic_scale_x", "periodic_scale_y", "periodic_scale_z"])
SIGMA = 2e-3  # mm


def field(model: RecordingModel, *more: Effect) -> FieldModel:
    others = [Unmodelled(one, np.array([c.prior_sd for c in one.coefficients])) for one in (*OTHERS, *more)]
    return RecordedField.of(model, others).field


def dense(
    model: RecordingModel, families: tuple[str, ...], scales: Floats, periodic: tuple[Effect, ...] = ()
) -> tuple[Floats, Floats]:
    """Mean and covariance of the named errors and of the artefact: what the placings reach is projected out of all
    observations, and the rest is one normal distribution (docs/machine/field.md)."""
    about = model.estimate().linear
    spread = SIGMA**2 * np.diag(about.noise_scale**2)
    for one in OTHERS:
        if (family := family_of(one)) in families:
            columns = recordings.shown_by(model, linear(one)) * recordings.sd_of(linear(one))
            spread += scales[families.index(family)] ** 2 * columns @ columns.T
    points = model.artefact.points.at(model.where(model.estimate().about))
    for one in periodic:
        assert isinstance(one, PeriodicScale)
        impulse, at = shown(model, one), points.readings[one.axis]
        spread += scales[families.index("periodic")] ** 2 * impulse @ covariance(one, at, at) @ impulse.T
    inside = scipy.linalg.null_space(about.freedoms.dense().T)
    weight, X = np.linalg.inv(inside.T @ spread @ inside), inside.T @ about.design
    found = np.linalg.inv(np.diag(about.prior_sd**-2.0) + X.T @ weight @ X)
    left = inside.T @ (about.observed - about.design @ about.prior_mean)
    return about.prior_mean + found @ X.T @ weight @ left, found


def ring() -> RecordingModel:
    """Rings of 50 mm at two heights, flat, standing and askew, approached along their normals."""
    points, facts = rings((-6.0, 6.0)), artefact_facts(kind="ring", length_mm=50.0, u_um=0.2)
    points = with_columns(points, **{f"approach_{a}": -np.sign(np.round(points.columns[f"n{a}"], 9)) for a in "xyz"})
    names = ["probe_radius", "squareness_xy", "scale_x"]
    return named(facts, indicated(facts, points, names, [3.0, 20.0, 8.0], sigma=SIGMA, seed=3), names)


def off(found: tuple[Floats, Floats], expected: tuple[Floats, Floats]) -> tuple[float, float]:
    """By how much means, and covariances, differ at most, in standard uncertainties."""
    k, u = len(expected[0]), np.sqrt(np.diag(expected[1]))
    mean, spread = found[0][:k] - expected[0], found[1][:k, :k] - expected[1]
    return float(np.abs(mean / u).max()), float(np.abs(spread / np.outer(u, u)).max())


@pytest.mark.parametrize("recorded", [calibration, gauge, ring])
def test_the_posterior_is_that_of_dense_matrices_to_eight_digits(
    recorded: Callable[[], RecordingModel], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Twenty bars, a step gauge of seven lines thrice, and three rings, with all observations."""
    monkeypatch.setattr(room, "_UNSEEN", (0.0, 0.0))
    model = recorded()
    whole = field(model)
    for scales in np.random.default_rng(5).uniform(0.01, 1.0, (3, len(whole.families))):
        assert max(off(whole.normal(white(SIGMA), scales), dense(model, whole.families, scales))) < 1e-8


def test_of_periods_that_nobody_knows_the_mean_is_exact_and_draws_are_of_trial_periods() -> None:
    model = calibration()
    whole = field(model, *PERIODIC)
    scales = np.full(len(whole.families), 0.3)
    mean, spread = off(whole.normal(white(SIGMA), scales), dense(model, whole.families, scales, PERIODIC))
    assert mean < 1e-8
    assert spread < 5e-3


def test_contrasts_of_repeats_say_next_to_nothing_of_the_machine() -> None:
    """They are left out of the matrices: of 282 readings of a gauge, three at each face, 87 are left."""
    model = gauge()
    whole = field(model)
    assert whole.into.shape == (282, 87)
    scales = np.full(len(whole.families), 0.3)
    assert max(off(whole.normal(white(SIGMA), scales), dense(model, whole.families, scales))) < 2e-3


@pytest.mark.parametrize("recorded", [calibration, gauge, ring])
def test_with_no_other_errors_it_is_what_a_certificate_states(
    recorded: Callable[[], RecordingModel], monkeypatch: pytest.MonkeyPatch
) -> None:
    """The factors of the named model alone, given the same noise."""
    monkeypatch.setattr(room, "_UNSEEN", (0.0, 0.0))
    model = recorded()
    whole = field(model)
    about = replace(model.estimate().linear, sigma=SIGMA)
    mean, spread, _ = Density(about).conditional(float(np.log(SIGMA)))
    found = whole.normal(white(SIGMA), np.zeros(len(whole.families)))
    assert max(off(found, (np.asarray(mean), np.asarray(spread)))) < 1e-8
