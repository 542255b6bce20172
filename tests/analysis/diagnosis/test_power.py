"""Predicted power of the diagnosis, against recordings that are simulated and searched one by one.

From the sizes at which drawn recordings are detected and named to amplitudes and probabilities, by counting.
"""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from scipy import stats

from cmm_uq.analysis.diagnosis.comparison.lack_of_fit import statistic_of
from cmm_uq.analysis.diagnosis.comparison.search import model_comparison
from cmm_uq.analysis.diagnosis.power import POWER, SIZES, DrawnNoise, Naming, Power, _Rule, powers, without_fault
from cmm_uq.analysis.planning.candidates import ready_plan
from cmm_uq.analysis.planning.set_up import join
from cmm_uq.analysis.planning.setting import PlannedNoise
from cmm_uq.artefacts import artefact_of
from cmm_uq.base.points import Floats
from cmm_uq.machine.model import Noise, RecordingModel
from cmm_uq.machine.physics.catalogue import effects
from tests.analysis.planning.plans import BALLBAR, GAUGE, setting

ALPHA = 0.01
SETTING = setting(GAUGE, length_mm=820.0, repeats=1)
POINTS = join(ready_plan(SETTING)[1])


@cache
def predicted(quantile: float = POWER) -> dict[str, Power]:
    model = without_fault(SETTING.observed, SETTING.model(POINTS), Noise(SETTING.sigma), 0)
    rivals = effects(("rotation_y_y", "rotation_x_y", "rotation_y_x", "rotation_z_z"))
    found = powers(model, rivals, stated=SETTING.sigma, sigma=SETTING.sigma, alpha=ALPHA, seed=0, quantile=quantile)
    return {power.effect: power for power in found}


@pytest.mark.long
def test_power_grows_with_the_effect_and_naming_needs_more_than_detection() -> None:
    power = predicted()["rotation_y_y"]
    assert power.detectable is not None
    assert power.identifiable is not None
    assert power.detectable <= power.identifiable
    curve = [power.detected(part * power.detectable) for part in (0.3, 0.7, 1.0, 1.3, 2.0)]
    assert curve == sorted(curve)
    assert curve[2] >= POWER
    assert np.all(power.named_at >= power.detected_at)


@pytest.mark.long
def test_sizes_that_no_quantile_asks_for_change_no_amplitude() -> None:
    """With every size asked for, no recording is alarmed, or named, from a larger one on, and what counts from the same."""
    for name, whole in predicted(0.0).items():
        one = predicted()[name]
        for few, every in ((one.detected_at, whole.detected_at), (one.named_at, whole.named_at)):
            counts = every >= np.quantile(every, POWER, method="higher")
            np.testing.assert_allclose(few[counts], every[counts], rtol=1e-9)
            assert np.all(few >= every * (1 - 1e-9))
    assert np.any(predicted()["rotation_y_y"].detected_at > predicted(0.0)["rotation_y_y"].detected_at * 1.01)


@pytest.mark.long
def test_sizes_are_those_of_all_odds_at_every_size() -> None:
    """Against the rule applied whole to every recording in every size, each by itself."""
    model = without_fault(SETTING.observed, SETTING.model(POINTS), Noise(SETTING.sigma), 0)
    compared = model_comparison(model, SETTING.sigma, 0)
    rule, naming = _Rule(compared.comparison, SETTING.sigma, ALPHA, None, compared.null), Naming(compared.explanations)
    points = model.artefact.points.at(model.placed(compared.values))
    for name in ("rotation_y_y", "rotation_x_y"):
        effect, index = effects((name,))[0], rule.index(name)
        assert index is not None
        shown = rule.comparison.rest(
            model.seen(effect.basis(points)[:, :, :1], compared.values) / rule.comparison.noise_scale[:, None]
        )
        shown /= np.linalg.norm(shown)
        noise = rule.noise(shown, 0, 20)
        margins = np.empty((2, len(SIZES), 20))
        for i, size in enumerate(SIZES):
            for j in range(20):
                data = SETTING.sigma * (noise[:, [j]] + size * shown)
                statistic, odds = statistic_of(rule.comparison, data)
                margins[0, i, j] = (statistic - rule.threshold(data)).item()
                margins[1, i, j] = min(margins[0, i, j], naming(odds, np.array([index])).item())
        alarmed, named = (crossings(each) for each in margins)
        found = predicted(0.0)[name]
        np.testing.assert_allclose(found.detected_at, alarmed, rtol=1e-9)
        np.testing.assert_allclose(found.named_at, named, rtol=1e-9)


def crossings(margin: Floats) -> Floats:
    """Size from which on each column stays positive, linear in the square of the size."""
    found = np.full(margin.shape[1], SIZES[0])
    for low in range(len(SIZES)):
        for column in np.flatnonzero(margin[low] <= 0):
            found[column] = np.inf
            if low + 1 < len(SIZES):
                part = np.interp(0.0, margin[low : low + 2, column], SIZES[low : low + 2] ** 2)
                found[column] = np.sqrt(part)
    return found


@pytest.mark.long
def test_an_effect_that_moves_no_face_is_never_found() -> None:
    """The ram turning about its own axis leaves the tip at its end where it is."""
    power = predicted()["rotation_z_z"]
    assert power.detectable is None
    assert power.detected(1e3) == 0.0


def test_twins_are_detected_and_never_named() -> None:
    """On lines through one middle the pitch of X and the roll of Y bend the space diagonals alike."""
    for name in ("rotation_x_y", "rotation_y_x"):
        assert predicted()[name].detectable is not None
        assert predicted()[name].identifiable is None
        assert not np.isfinite(predicted()[name].named_at).any()


@pytest.mark.long
def test_the_gate_opens_as_often_as_predicted() -> None:
    """Six simulated recordings: the count lies within the central 99.9 % of the predicted binomial."""
    power = predicted()["rotation_y_y"]
    assert power.detectable is not None
    acting = RecordingModel(artefact_of(GAUGE, POINTS), effects(("rotation_y_y",)))
    random = np.random.default_rng(12)
    alarms = 0
    for _ in range(6):
        sizes = np.array([size.nominal + size.sd * random.standard_normal() for size in acting.artefact.sizes])
        xyz = acting.simulate(np.array([power.detectable]), sizes, Noise(SETTING.sigma), random)
        alarms += model_comparison(SETTING.model(POINTS.at(xyz)), SETTING.sigma, 0).p_value < ALPHA
    low, high = stats.binom.interval(0.999, 6, power.detected(power.detectable))
    assert low <= alarms <= high


def test_drawn_noise_has_its_covariance() -> None:
    """The product with the covariance, against the dense one of readings and offsets shared by repeats."""
    chosen = setting(BALLBAR, repeats=2)
    model = chosen.model(join(ready_plan(chosen)[1]))
    noise = PlannedNoise((1e-3, 1e-3, 1e-3), placing=2e-3)
    values = np.array([unknown.prior_mean for unknown in model.unknowns])
    drawn = DrawnNoise(noise.components(model, values), noise.typical, model.artefact.noise_scale)
    measurement = model.artefact.measurement
    dense = np.eye(len(measurement)) + 4.0 * (measurement[:, None] == measurement)
    column = np.random.default_rng(3).standard_normal((len(measurement), 1))
    np.testing.assert_allclose(drawn.covariance(column), dense @ column, rtol=1e-9, atol=1e-9)
    # of 4000 draws, the product of two that share an offset: 4 ± √(5² + 4²)/√4000, five of which are allowed
    many = drawn.draws(np.random.default_rng(4), 4000)
    first, second = np.flatnonzero(measurement == measurement[0])
    assert abs(float(np.mean(many[first] * many[second])) - 4.0) < 5 * np.sqrt(41 / 4000)


def known(per_unit: float = 2.0, allowed: float = 10.0) -> Power:
    """Ten recordings, detected from sizes 1 to 10 on and named from three more on, of an effect of size 2 a unit."""
    sizes = np.array([3.0, 1.0, 2.0, 5.0, 4.0, 6.0, 10.0, 8.0, 7.0, 9.0])
    return Power("scale_x", "ppm", "ppm", allowed, per_unit, sizes, sizes + 3.0)


@pytest.mark.parametrize(
    ("amplitude", "detected", "named"),
    [(0.49, 0.0, 0.0), (0.5, 0.1, 0.0), (-2.5, 0.5, 0.2), (2.49, 0.4, 0.1), (5.0, 1.0, 0.7), (6.5, 1.0, 1.0)],
)
def test_an_amplitude_is_found_in_the_recordings_whose_size_it_reaches(
    amplitude: float, detected: float, named: float
) -> None:
    assert known().detected(amplitude) == pytest.approx(detected)
    assert known().named(amplitude) == pytest.approx(named)


def test_the_amplitude_found_with_80_percent_is_within_what_physics_allows() -> None:
    """A size of 9: of ranks 0 to 9 the quantile 0.8 is at 7.2, and the higher of its neighbours is the ninth."""
    assert known().detectable == pytest.approx(4.5)
    assert known().identifiable == pytest.approx(6.0)
    assert known(allowed=4.5).detectable == pytest.approx(4.5)
    assert known(allowed=4.49).detectable is None
    assert known(allowed=5.9).identifiable is None
    assert known(per_unit=0.0).detectable is None
