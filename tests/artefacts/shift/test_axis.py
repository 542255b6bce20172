"""The joint estimate of an axis: what it finds of a known error, and what it must agree with."""

from __future__ import annotations

import re
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from cmm_uq.app.commands.report import analyse, outcome_of
from cmm_uq.artefacts.shift.axis import CurveEstimate, ShiftResult, estimate_curve
from cmm_uq.artefacts.shift.integration import KnownSpan, integrated
from cmm_uq.artefacts.shift.series import shifted_series
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.points import Points
from tests.artefacts.shift.shifted import PITCH_20, bent, integrated_by_monte_carlo, read
from tests.artefacts.simulated import analysed
from tests.conftest import ROOT

NOISE = 1.1e-3
KNOWN = KnownSpan(0, 22, 440.0, 0.0)


def off(estimate: CurveEstimate, error=bent):
    """True minus estimated error, and the standard uncertainty, at the positions read."""
    curve, start = estimate.curve, estimate.series.reading[0]
    return error(curve.position) - error(np.array([start])) - curve.error, curve.u


@pytest.fixture(scope="module")
def paper() -> CurveEstimate:
    """The paper's data: 23 points, 20 mm, ten readings of 1.1 µm, one shift by the pitch."""
    points = read(bent, PITCH_20, (0.0, 20.0), NOISE, 10)
    return estimate_curve(shifted_series(points, "x", np.array([0.0, 20.0]), 0.5), KNOWN)


@pytest.mark.long
def test_the_chains_converge(paper: CurveEstimate) -> None:
    assert paper.chains.converged


def test_the_true_curve_lies_in_the_simultaneous_band_widened_to_a_chance_of_one_in_ten_thousand(
    paper: CurveEstimate,
) -> None:
    away, u = off(paper)
    assert np.all(np.abs(away[u > 1e-7]) < 5.0 * u[u > 1e-7])


def test_repeats_give_the_repeatability(paper: CurveEstimate) -> None:
    """460 readings: to 1/√(2·414) = 3.5 %, three times that."""
    assert paper.sigma.mean() == pytest.approx(NOISE, rel=0.105)


def test_the_posterior_agrees_with_the_law_of_propagation_where_smoothness_adds_little(paper: CurveEstimate) -> None:
    """A shift by the pitch joins all points: the integration is unbiased, and the joint fit at most as uncertain."""
    a, b = paper.series.pair
    law = integrated(a, b, np.full((2, 23), paper.sigma.mean() / np.sqrt(10)), known=KNOWN)
    joint = paper.at(a)
    assert np.all(joint.u[1:] <= 1.1 * law.u[1:])  # 2000 draws know u to 1.6 %; growth and σ add to the posterior's
    assert np.all(joint.u[5:18] > 0.8 * law.u[5:18])
    assert np.all(np.abs(joint.error - law.error) < 3 * law.u + 1e-12)


def test_the_known_length_is_met_exactly(paper: CurveEstimate) -> None:
    np.testing.assert_allclose(paper.artefact[:, 22], 440.0, atol=1e-9)


def test_without_noise_three_placings_give_the_curve_and_the_artefact() -> None:
    places = PITCH_20 + np.random.default_rng(3).normal(0, 0.01, 23)
    points = read(bent, places, (0.0, 20.0, 47.0))
    known = KnownSpan(0, 22, places[22] - places[0], 0.0)
    estimate = estimate_curve(shifted_series(points, "x", np.array([0.0, 20.0, 47.0]), 0.5), known, sigma=1e-5)
    away, _ = off(estimate)
    assert np.abs(away).max() < 0.2e-3
    np.testing.assert_allclose(estimate.artefact.mean(axis=0), places - places[0], atol=0.2e-3)


@pytest.mark.long
def test_points_missing_in_a_placing_cost_little() -> None:
    points = read(bent, PITCH_20, (0.0, 20.0, 47.0), 0.2e-3, 3)
    gone = ((points.measurement == 2) & (points.point == 7)) | ((points.measurement == 3) & (points.point > 18))
    series = shifted_series(points.select(~gone), "x", np.array([0.0, 20.0, 47.0]), 0.5)
    estimate = estimate_curve(series, KNOWN)
    away, u = off(estimate)
    assert np.all(np.abs(away[u > 1e-7]) < 5 * u[u > 1e-7])


@pytest.mark.long
def test_an_artefact_turned_a_little_sideways_reads_shorter_by_its_cosine() -> None:
    """2 mrad: 440 mm shorten by 0.88 µm in that placing alone; the other coordinates tell."""
    points = read(lambda x: 0 * x, PITCH_20, (0.0, 20.0))
    turned = points.measurement == 2
    x = points.xyz[:, 0].copy()
    xyz = np.column_stack([
        np.where(turned, 20 + (x - 20) * np.cos(2e-3), x), np.where(turned, (x - 20) * np.sin(2e-3), 0), 0 * x
    ])  # fmt: skip
    series = shifted_series(replace(points, xyz=xyz), "x", np.array([0.0, 20.0]), 0.5)
    assert series.cosine == pytest.approx([1.0, np.cos(2e-3)], abs=1e-12)
    estimate = estimate_curve(series, KNOWN, sigma=1e-5)
    assert np.abs(estimate.curve.error).max() < 0.05e-3


def forth_and_back(rate: float, noise: float) -> tuple[Points, Points]:
    """Two series, the second read forth and halfway back, while the machine drifts, mm/h; half an hour forth and back.

    With and without the time of each reading.
    """
    points = read(bent, PITCH_20, (0.0, 20.0), noise, 2)
    points = points.select((points.repeat == 1) | ((points.measurement == 2) & (points.point > 8)))
    way = np.where(points.repeat == 1, points.point - 1, 46 - points.point) / 45
    time = 1800.0 * (way + points.measurement - 1)
    drifting = replace(points, xyz=points.xyz + np.column_stack([rate * time / 3600, 0 * time, 0 * time]))
    return replace(drifting, columns={"time_s": time}), drifting


@pytest.mark.long
def test_drift_is_told_from_the_curve_where_series_are_read_forth_and_back() -> None:
    """6 µm/h; read one way only, a drift makes b − a change linearly along the axis, as a parabola of errors would."""
    timed, blind = forth_and_back(6e-3, 0.0)
    shifts = np.array([0.0, 20.0])
    series = shifted_series(timed, "x", shifts, 0.5)
    assert series.drift is not None
    assert series.drift.rate == pytest.approx(6e-3, rel=1e-4)
    away, _ = off(estimate_curve(series, KNOWN, sigma=1e-5))
    worse, _ = off(estimate_curve(shifted_series(blind, "x", shifts, 0.5), KNOWN, sigma=1e-5))
    assert np.ptp(away) < 0.2e-3 < 1e-3 < np.ptp(worse)


def test_repeats_tell_the_repeatability_apart_from_the_drift() -> None:
    """15 differences of two readings, one spent on the drift: known to 1/√28 = 19 %; three times that."""
    timed, blind = forth_and_back(20e-3, NOISE)
    scatters = [shifted_series(p, "x", np.array([0.0, 20.0]), 0.5).scatter for p in (timed, blind)]
    assert scatters[0] is not None
    assert scatters[1] is not None
    assert scatters[0].sigma == pytest.approx(NOISE, rel=0.57)
    assert scatters[1].sigma > 2 * NOISE


@pytest.mark.long
def test_without_a_known_length_and_shift_the_curve_is_zero_at_both_ends() -> None:
    points = read(bent, PITCH_20, (0.0, 20.0), NOISE, 3)
    estimate = estimate_curve(shifted_series(points, "x", np.array([0.0, 20.0]), 0.5))
    ends = estimate.at(estimate.series.reading[[0, 22]])
    assert not estimate.scale_known
    np.testing.assert_allclose(ends.draws, 0.0, atol=1e-12)


@pytest.mark.long
def test_a_shift_known_exactly_gives_the_scale() -> None:
    """50 ppm: a shift of 20 mm, read without noise, shows 1 nm a µm of scale."""
    points = read(lambda x: 50e-6 * x, PITCH_20, (0.0, 20.0))
    estimate = estimate_curve(shifted_series(points, "x", np.array([0.0, 20.0]), 0.0), sigma=1e-5)
    assert estimate.scale.mean() == pytest.approx(50e-6, abs=0.5e-6)


@pytest.mark.long
def test_the_same_seed_gives_the_same_draws() -> None:
    points = read(bent, PITCH_20, (0.0, 20.0), NOISE, 2)
    series = shifted_series(points, "x", np.array([0.0, 20.0]), 0.5)
    one, other = (estimate_curve(series, KNOWN, seed=5).curve.draws for _ in range(2))
    np.testing.assert_array_equal(one, other)


def test_with_next_to_no_smoothness_the_posterior_is_the_integration_with_its_propagated_uncertainty(
    paper: CurveEstimate,
) -> None:
    """A shift by the pitch determines every place once, so nothing else can come out: GUM, Monte Carlo and posterior agree.

    Hyper-parameters held at 150 µm, a correlation length of 14 mm and σ = 1.1 µm; 10 000 draws give u to 0.7 %.
    """
    a, b = paper.series.pair
    theta = np.tile([np.log(30.0), np.log(0.03), 0.0, np.log(NOISE)], (10_000, 1))
    free = replace(paper, coefficients=paper.coefficients.model.draw(theta, np.random.default_rng(2))).at(a)
    noise = np.full((2, 23), NOISE / np.sqrt(10))
    law = integrated(a, b, noise, known=KNOWN)
    trials = integrated_by_monte_carlo(a, b, noise, known=KNOWN)
    np.testing.assert_allclose(free.u[1:], law.u[1:], rtol=0.035, atol=1e-9)
    np.testing.assert_allclose(trials.u[1:], law.u[1:], rtol=0.012, atol=1e-9)
    np.testing.assert_allclose(free.error, law.error, atol=5 * law.u.max() / 100)
    correlation = np.corrcoef(free.draws[:, 1:-1], rowvar=False)
    spread = np.outer(law.u, law.u)[1:-1, 1:-1]
    np.testing.assert_allclose(correlation, law.covariance[1:-1, 1:-1] / spread, atol=0.05)


EXAMPLE = ROOT / "examples" / "shift-simulated"
NOISE_UM = 1.1


def truth(x: np.ndarray) -> np.ndarray:
    """Error of the example, mm, as its remarks state it."""
    return 0.012 * np.sin(x / 90) + 0.010 * np.exp((x - 590) / 60) + 8e-6 * x


@pytest.fixture(scope="module")
def example() -> ShiftResult:
    result = analysed("shift-simulated")
    assert isinstance(result, ShiftResult)
    return result


def edited(folder: Path, *changes: tuple[str, str]) -> Path:
    """The example with parts of its job.toml replaced."""
    job = folder / "job"
    shutil.copytree(EXAMPLE, job)
    text = (job / "job.toml").read_text(encoding="utf-8")
    for pattern, replacement in changes:
        text, count = re.subn(pattern, replacement, text)
        assert count == 1, pattern
    (job / "job.toml").write_text(text, encoding="utf-8")
    return job


def of_series(job: Path, kept: set[str]) -> None:
    """Keep only some series of the recording."""
    path = job / "recording.csv"
    header, *rows = path.read_text(encoding="utf-8").splitlines()
    path.write_text("\n".join([header, *(r for r in rows if r.split(",")[0] in kept)]) + "\n", encoding="utf-8")


@pytest.mark.long
def test_the_true_error_lies_within_four_standard_uncertainties_everywhere(example: ShiftResult) -> None:
    curve = example.estimate.curve
    away = curve.error - (truth(curve.position) - truth(curve.position[:1]))
    assert np.all(np.abs(away[1:]) < 4 * curve.u[1:])


def test_the_scale_is_the_mean_slope_between_the_ends_of_the_known_length(example: ShiftResult) -> None:
    ends = np.array([100.0, 540.0])
    assert example.scale is not None
    true_ppm = 1e6 * np.diff(truth(ends))[0] / 440
    assert abs(example.scale.value - true_ppm) < 4 * example.scale.u
    assert example.scale.u > 0.5 / 440 * 1e3  # the known length's own 0.5 µm at least


def test_the_linearity_error_is_that_of_the_true_curve_about_the_line_through_its_ends(example: ShiftResult) -> None:
    x = example.estimate.curve.position
    line = truth(np.array([100.0, 540.0]))
    left = truth(x) - line[0] - (line[1] - line[0]) * (x - 100) / 440
    assert abs(example.linearity.value - 1e3 * np.ptp(left)) < 4 * example.linearity.u


def test_repeats_of_the_example_give_its_repeatability(example: ShiftResult) -> None:
    """3 repeats of 69 readings: 138 degrees of freedom, 6 %."""
    assert abs(example.repeatability.value - NOISE_UM) < 4 * NOISE_UM / np.sqrt(2 * 138)


def test_three_placings_have_no_integration_of_two(example: ShiftResult) -> None:
    assert not example.integrated


@pytest.mark.long
def test_two_placings_show_the_sources_integrations_beside_the_curve(tmp_path: Path) -> None:
    job = edited(tmp_path, (r"shifts_mm = .*", "shifts_mm = [0.0, 20.0]"))
    of_series(job, {"1", "2"})
    result = analyse(job)
    assert isinstance(result, ShiftResult)
    assert set(result.integrated) == {"pitch", "improved"}
    one = result.integrated["pitch"]
    joint = result.estimate.at(one.position)
    assert np.all(np.abs(joint.error - one.error)[1:] < 4 * one.u[1:])
    assert result.undetermined.patterns.shape[1] == 0


@pytest.mark.long
def test_without_a_known_length_there_is_no_scale(tmp_path: Path) -> None:
    result = analyse(edited(tmp_path, (r"known = .*\n", "")))
    assert isinstance(result, ShiftResult)
    assert result.scale is None
    assert result.estimate.curve.error[0] == 0.0


@pytest.mark.long
@pytest.mark.parametrize(("u_shift", "scaled"), [("u_shift_um = 0.0\n", True), ("", False)])
def test_shifts_of_which_nobody_says_how_well_they_are_known_give_no_scale(
    tmp_path: Path, u_shift: str, scaled: bool
) -> None:
    """Two series, 10 µm of the shift of 20 mm off: as exact it is a scale of 500 ppm, which the machine has not."""
    edits = (r"known = .*\n", ""), (r"u_shift_um = .*\n", u_shift), (r"shifts_mm = .*", "shifts_mm = [0.0, 20.0]")
    job = edited(tmp_path, *edits)
    of_series(job, {"1", "2"})
    head, *rows = (job / "recording.csv").read_text("utf-8").splitlines()
    at = head.split(",").index("x_mm")
    cells = [row.split(",") for row in rows]
    for row in cells:
        row[at] = f"{float(row[at]) + 0.01 * (row[0] == '2'):.6f}"
    (job / "recording.csv").write_text("\n".join([head, *map(",".join, cells)]) + "\n", "utf-8")
    result = analyse(job)
    assert isinstance(result, ShiftResult)
    assert (result.scale is not None) == scaled
    assert result.scale is None or abs(result.scale.value) > 300
    assert ("not stated" in str(outcome_of(result).document)) != scaled


WISH = (
    'effects = []\n[[conformity]]\nstandard = "laboratory\'s own rule"\ncharacteristic = "linearity"\nlimit_um = {limit}\n'
    "complete = {{ measurements = 3, repeats = 3, points = {points} }}\n[rated_conditions]\n"
    'declared = {{ by = "A. Muster", reason = "20 °C" }}\n'
)


@pytest.mark.long
def test_the_linearity_error_is_decided_by_the_laboratorys_own_rule(tmp_path: Path) -> None:
    for limit, points, outcome in (
        (40.0, 23, "pass"),
        (28.0, 23, "undecided"),
        (20.0, 23, "fail"),
        (40.0, 24, "incomplete"),
    ):
        job = edited(tmp_path / str(points + limit), (r"effects = .*", WISH.format(limit=limit, points=points)))
        result = analyse(job)
        assert isinstance(result, ShiftResult)
        ((found,), low, high) = result.statements, *result.linearity.interval95
        assert found.outcome == outcome
        assert found.value_um == pytest.approx(result.linearity.value)
        assert found.u_um == pytest.approx(max(high - found.value_um, found.value_um - low) / 2)
        assert outcome_of(result).results["verdicts"]["overall"] == outcome


@pytest.mark.parametrize(
    ("pattern", "replacement", "where", "said"),
    [
        (r"axis = .*\n", "", "[artefact]", "neither axis nor plane"),
        (r"shifts_mm = .*\n", "", "shifts_mm", "is missing"),
        (r"shifts_mm = .*", "shifts_mm = [0.0, 20.0]", "shifts_mm", "2 shifts for 3 series"),
        (r"shifts_mm = .*", "shifts_mm = [0.0, 20.0, 20.0]", "shifts_mm", "same shift"),
        (r"effects = .*", 'effects = ["scale_x"]', "effects", "not by effects"),
        (r"effects = .*", 'effects = []\n[[conformity]]\nstandard = "VDI/VDE 2617"\nlimit_um = 5.0', "conformity",
         "is not decided on a shift"),
        (r'file = "recording.csv"', 'file = "recording.csv"\nset_aside = [2]', "set_aside", "cannot be set aside"),
        (r'file = "recording.csv"', 'file = "recording.csv"\nset_aside = [9]', "set_aside", "no measurement 9"),
        (r"to = 23", "to = 24", "known", "no point 24"),
        (r"to = 23", "to = 1", "known", "both point 1"),
        (r"length_mm = 440.0", "length_mm = 400.0", "known", "not 400 mm"),
    ],
)  # fmt: skip
def test_what_a_shift_job_cannot_be_is_said_with_its_key(
    tmp_path: Path, pattern: str, replacement: str, where: str, said: str
) -> None:
    with pytest.raises(CmmUqError, match=said) as caught:
        analyse(edited(tmp_path, (pattern, replacement)))
    assert caught.value.where is not None
    assert where in caught.value.where
    assert caught.value.fix
