"""Concealed effects are found, innocent ones are not blamed, noise is called noise.

Squarenesses of hundreds of seconds that a job leaves out are found by themselves: their squares are no further effects.

Figures without noise, and a recording compared with itself, are consistent: their last digits say nothing.

A machine that is out of adjustment, and a job that names nothing of it.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy import stats

from benchmarks.told_nothing import case, errors, gauge
from cmm_uq.analysis.diagnosis.comparison.search import model_comparison
from cmm_uq.analysis.diagnosis.diagnosis import Diagnosis, diagnose
from cmm_uq.analysis.diagnosis.held_out import improvement
from cmm_uq.app.commands.estimation import without_outliers
from cmm_uq.app.commands.reading import read_job
from cmm_uq.artefacts import artefact_facts
from cmm_uq.artefacts.ballbar import Ballbar
from cmm_uq.artefacts.plate import Plate
from cmm_uq.base.points import Floats, Machine, Points
from cmm_uq.jobs.recording.compared import against_earlier
from cmm_uq.machine.model import Noise, RecordingModel
from cmm_uq.machine.physics.catalogue import effects
from tests.artefacts.constructions import indicated, plate
from tests.artefacts.simulated import diagnosis_of
from tests.conftest import ROOT
from tests.machine.model.test_bending import LENGTH, recorded
from tests.recordings import TRAVEL, bar_facts, bars, suggested, with_columns

SIX = ("scale_x", "scale_y", "scale_z", "squareness_xy", "squareness_yz", "squareness_zx")
SIGMA_UM = 1.0


def repeated(points: Points, times: int) -> Points:
    """Every placing measured several times, each repeat approached and timed in its own way."""
    n = len(points) * times
    random = np.random.default_rng(5)
    made = Points(
        np.tile(points.xyz, (times, 1)), np.tile(points.measurement, times), np.tile(points.point, times),
        np.repeat(np.arange(1, times + 1), len(points)), points.machine,
    )  # fmt: skip
    return with_columns(
        made, time_s=np.arange(n) * 60.0, **{f"approach_{a}": random.choice([-1.0, 1.0], n) for a in "xyz"}
    )


def recording(hidden: dict[str, float], noise: Noise, seed: int = 1, error: Floats | None = None) -> Points:
    """Forty bars, three times each, with hidden effects (one parameter each) and, if given, an error e of each point."""
    points = repeated(bars(np.random.default_rng(3), 40, 400.0, Machine("m", "XYZ", TRAVEL)), 3)
    model = RecordingModel(Ballbar(bar_facts(), points), effects(tuple(hidden)))
    drawn = points.at(
        model.simulate(np.array(list(hidden.values())), np.array([400.0]), noise, np.random.default_rng(seed))
    )
    return drawn if error is None else drawn.at(drawn.xyz - error)


def diagnosed(points: Points, stated_um: float | None = SIGMA_UM, named: tuple[str, ...] = SIX) -> Diagnosis:
    model = RecordingModel(Ballbar(bar_facts(), points), effects(named))
    return diagnose(model, stated_um=stated_um, alpha=0.01, seed=0)


@pytest.mark.long
def test_told_only_of_scale_the_real_recording_shows_its_squareness() -> None:
    """Against the machine's own calibration, which it never saw: −173″ (Harris 2004, table 7)."""
    job = read_job(ROOT / "examples" / "iota-1102-20C")
    model = RecordingModel(Ballbar(job.facts.artefact, job.points), effects(["scale_x", "scale_y", "scale_z"]))
    found = diagnose(model, stated_um=None, alpha=0.01, seed=0)
    assert found.verdict == "explained"
    (item,) = found.effects
    assert item.effect == "squareness_xy"
    assert item.probability > 0.5
    low, high = item.parameters["angle_arcsec"].interval95
    assert low < -173.0 < high
    assert found.improvement.heldout_rms_after_um < 0.3 * found.improvement.heldout_rms_before_um
    assert found.improvement.elpd_gain > 3 * found.improvement.elpd_gain_se
    (place,) = found.where
    assert (place.covariate, place.along) == ("y_mm", "x")
    assert place.also == ("error along Y as a function of X",)


def test_with_all_six_factors_the_real_recording_is_consistent() -> None:
    found = diagnosis_of("iota-1102-20C").diagnosis
    assert found.verdict == "consistent"
    assert not found.effects
    assert not found.where


@pytest.mark.long
def test_two_hidden_effects_are_both_named_with_their_size() -> None:
    truth = {"hysteresis_x": 5.0, "straightness_x_z": -9.0}
    found = diagnosed(recording(truth, Noise(1e-3)))
    assert found.verdict == "explained"
    assert {item.effect for item in found.effects} == set(truth)
    for item in found.effects:
        (quantity,) = item.parameters.values()
        assert abs(quantity.value - truth[item.effect]) < 4 * quantity.u
        assert item.probability > 0.9


@pytest.mark.long
def test_a_hidden_periodic_error_is_found_with_its_period() -> None:
    points = recording({}, Noise(1e-3))
    error = np.zeros_like(points.xyz)
    error[:, 0] = 4e-3 * np.sin(2 * np.pi * points.xyz[:, 0] / 80.0 + 0.4)
    found = diagnosed(recording({}, Noise(1e-3), error=error))
    assert [item.effect for item in found.effects] == ["periodic_scale_x"]
    assert found.effects[0].parameters["period_mm"].value == pytest.approx(80.0, rel=0.03)
    assert found.effects[0].parameters["amplitude_um"].value == pytest.approx(4.0, abs=1.0)


@pytest.mark.long
def test_an_effect_that_nobody_knows_is_located_and_modelled_without_a_name() -> None:
    points = recording({}, Noise(1e-3))
    error = np.zeros_like(points.xyz)
    square = ((points.xyz[:, 0] - 600.0) / 90.0) ** 2  # a dent with a bank at either side
    error[:, 1] = 12e-3 * (1 - 2 * square) * np.exp(-square)
    found = diagnosed(recording({}, Noise(1e-3), error=error))
    assert found.verdict == "empirical"
    assert not found.effects
    assert found.empirical is not None
    assert (found.empirical.functions[0].term.of, found.empirical.functions[0].term.along) == ("x_mm", "y")
    assert found.where[0].covariate == "x_mm"
    assert found.where[0].p_value < 1e-3
    low, high = found.where[0].region
    assert low < 600.0 < high


@pytest.mark.long
def test_false_alarms_are_as_frequent_as_the_p_value_says() -> None:
    """Sixteen sound recordings: p-values are uniform (Kolmogorov–Smirnov at 0.1 %), at most two lie below 1 % (1 in 1900)."""
    values = []
    for seed in range(16):
        points = repeated(bars(np.random.default_rng(seed), 20, 400.0, Machine("m", "XYZ", TRAVEL)), 2)
        empty = RecordingModel(Ballbar(bar_facts(), points), effects(()))
        drawn = points.at(
            empty.simulate(np.zeros(0), np.array([400.0]), Noise(1e-3), np.random.default_rng(1000 + seed))
        )
        stated = 1e-3 if seed % 2 else None
        values.append(model_comparison(RecordingModel(Ballbar(bar_facts(), drawn), effects(SIX)), stated, 0).p_value)
    assert stats.kstest(values, "uniform").pvalue > 1e-3
    assert sum(value < 0.01 for value in values) <= 2


@pytest.mark.long
def test_noise_that_is_twice_what_was_stated_is_noise_and_contradicts_it() -> None:
    found = diagnosed(recording({}, Noise(2e-3)))
    assert found.verdict == "consistent"
    assert found.noise.contradicts_stated
    low, high = found.noise.coordinate.interval95
    assert low < 2.0 < high


@pytest.mark.long
def test_set_up_offsets_are_noise_of_the_placing() -> None:
    found = diagnosed(recording({}, Noise(1e-3, placing=1.5e-3)))
    assert found.verdict == "undetermined"  # nothing is found, and repeats share more than they scatter by
    assert found.noise.placing.value == pytest.approx(1.5, rel=0.5)


@pytest.mark.long
def test_effects_with_one_signature_are_named_together_with_a_measurement_that_parts_them() -> None:
    """Bars in one plane of constant y: squareness XY and the roll of X along it cannot be told apart from others."""
    machine = Machine("m", "XYZ", TRAVEL)
    random = np.random.default_rng(8)
    angle = random.uniform(0, np.pi, 30)
    half = 200 * np.column_stack([np.cos(angle), np.zeros(30), np.sin(angle)])
    middle = np.array([450.0, 300.0, -250.0]) + random.uniform(-40, 40, (30, 3)) * [1, 0, 1]
    xyz = np.stack([middle - half, middle + half], axis=1).reshape(-1, 3)
    number = np.repeat(np.arange(30), 2)
    points = Points(xyz, number, np.tile([1, 2], 30), np.ones_like(number), machine)
    model = RecordingModel(Ballbar(bar_facts(), points), effects(["rotation_x_z"]))
    drawn = points.at(model.simulate(np.array([60.0]), np.array([400.0]), Noise(1e-3), random))
    found = diagnosed(drawn, named=("scale_y", "scale_z", "squareness_zx"))
    assert found.verdict == "explained"
    (group,) = found.indistinguishable
    assert {"rotation_x_z", "scale_x"} <= set(group)
    assert any({"rotation_x_z", "scale_x"} == set(s.separates) for s in suggested(found, bar_facts()))


def test_the_held_out_error_of_least_squares_is_the_press_residual() -> None:
    """Without a prior that matters, leaving one bar out gives r/(1 − h) (Cook & Weisberg 1982, 2.2.3)."""
    points = bars(np.random.default_rng(3), 30, 400.0, Machine("m", "XYZ", TRAVEL))
    empty = RecordingModel(Ballbar(bar_facts(), points), effects(SIX))
    drawn = points.at(empty.simulate(np.zeros(6), np.array([400.0]), Noise(1e-3), np.random.default_rng(2)))
    model = RecordingModel(Ballbar(bar_facts(400.0, 1e-6), drawn), effects(SIX))
    linear = model.estimate().linear
    A, y = linear.design[:, :6], linear.observed - linear.design[:, 6] * 400.0
    Q = np.linalg.qr(A)[0]
    press = (y - Q @ (Q.T @ y)) / (1 - np.einsum("ij,ij->i", Q, Q))
    wanted = float(np.sqrt(np.mean(press**2))) * 1e3
    assert improvement(model, model).heldout_rms_before_um == pytest.approx(wanted, rel=2e-3)


@pytest.mark.long
def test_the_false_alarm_rate_is_asked_for() -> None:
    points = recording({"straightness_y_x": 1.0}, Noise(1e-3))
    model = RecordingModel(Ballbar(bar_facts(), points), effects(SIX))
    weak = diagnose(model, stated_um=1.0, alpha=1e-6, seed=0)
    assert weak.verdict == "consistent"
    near = diagnose(replace(model), stated_um=1.0, alpha=0.5, seed=0).p_value  # of more draws, and with heavy tails
    assert weak.p_value == pytest.approx(near, abs=4 * np.sqrt(near * (1 - near) / 200))


@pytest.mark.long
def test_a_jump_is_located_between_the_readings_about_it() -> None:
    points = recording({}, Noise(1e-3))
    error = np.zeros_like(points.xyz)
    error[:, 2] = np.where(points.xyz[:, 0] > 500.0, 8e-3, 0.0)
    found = diagnosed(recording({}, Noise(1e-3), error=error))
    assert not found.effects
    low, high = next(place.region for place in found.where if place.what == "error along Z as a function of X")
    assert low < 500.0 < high
    assert high - low < 60.0


@pytest.mark.long
def test_a_known_mechanism_of_another_form_is_modelled_and_told_as_probable() -> None:
    """Straightness as an asymmetric bow, which the effect's symmetric one describes but in part."""
    points = recording({}, Noise(1e-3))
    place = points.xyz[:, 0] / 900.0
    error = np.zeros_like(points.xyz)
    error[:, 1] = 12e-3 * (1 - (2 * place - 1) ** 2) * (1 + 0.6 * (2 * place - 1))
    found = diagnosed(recording({}, Noise(1e-3), error=error))
    assert found.verdict == "empirical"
    assert found.empirical is not None
    assert (found.empirical.functions[0].term.of, found.empirical.functions[0].term.along) == ("x_mm", "y")
    assert ("straightness_x_y", True) in [(one.effect, one.probability > 0.5) for one in found.withheld]


SCALES = ("scale_x", "scale_y", "scale_z")


@pytest.mark.long
@pytest.mark.parametrize(
    ("truth", "named"),
    [([0, 0, 0, 600, 600, 600], ()), ([0, 0, 0, 1500, -1500, 900], SCALES)],
    ids=["600 arcsec each", "1500 arcsec and scales named"],
)
def test_nothing_but_the_squarenesses_is_found(truth: list[float], named: tuple[str, ...]) -> None:
    """To first order Z would be 8.5 ppm short at 600″, and bars and guideways would be blamed for products of angles."""
    points = recorded(np.array(truth, dtype=np.float64), sigma=1e-3, seed=1, count=40)
    model = RecordingModel(Ballbar(bar_facts(LENGTH, 0.5), points), effects(named), None)
    found = diagnose(model, stated_um=1.0, alpha=0.01, seed=0)
    assert found.verdict == "explained"
    assert {e.effect for e in found.effects} == {"squareness_xy", "squareness_yz", "squareness_zx"}
    for effect, angle in zip(("squareness_xy", "squareness_yz", "squareness_zx"), truth[3:], strict=True):
        quantity = next(e for e in found.effects if e.effect == effect).parameters["angle_arcsec"]
        assert abs(quantity.value - angle) < 4 * quantity.u
        assert quantity.u < 1


FACTS = artefact_facts(kind="plate")
PLACES = ((0, 0, 0),)


def exact() -> Points:
    """Nine balls as a perfect machine indicates them."""
    points = plate(PLACES, side=3)
    whole = np.round(points.xyz, 5)
    return points.at(whole)


def noisy() -> Points:
    points = plate(PLACES, side=3)
    xyz = np.round(indicated(FACTS, points, ["scale_x"], [12.0], sigma=2e-3).xyz, 5)
    return Points(xyz, points.measurement, points.point, points.repeat, points.machine, {}, points.lines)


@pytest.mark.parametrize("points", [exact(), against_earlier(noisy(), noisy(), 0.0, "now.csv")], ids=["exact", "copy"])
def test_they_are_consistent_without_an_outlier(points: Points) -> None:
    model, outliers = without_outliers(RecordingModel(Plate(FACTS, points), effects(("scale_x", "scale_y"))))
    assert not outliers
    found = diagnose(model, stated_um=None, alpha=0.01, seed=0)
    assert found.verdict == "consistent"
    assert found.p_value > 0.5
    assert not found.remaining.rivals


def test_on_seven_lines_of_a_gauge_scales_and_squarenesses_are_another_scale_of_each_line() -> None:
    """By equations written apart from the package: whatever six errors do, seven temperatures do."""
    true, line, _ = gauge(np.random.default_rng(0))
    six = {name: e for name, e in errors(true).items() if name.startswith(("scale", "squareness"))}
    assert len(six) == 6
    for error in six.values():
        for k in np.unique(line):
            at, e = true[line == k], error[line == k]
            along = (at - at[0]) / np.linalg.norm(at[-1] - at[0])
            length, read = np.linalg.norm(at - at[0], axis=1), np.sum((e - e[0]) * along[-1], axis=1)
            np.testing.assert_allclose(read, length * read[-1] / length[-1], atol=1e-12)


@pytest.mark.long
def test_of_a_gauge_on_seven_lines_a_machine_out_of_adjustment_is_not_told_from_temperatures_and_not_named() -> None:
    hidden, named, verdict = case(13, of_gauge=True)
    assert len(hidden) == 6
    assert {name for name, _ in named} <= set(hidden)
    assert verdict not in ("consistent", "explained")
