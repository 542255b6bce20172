"""From a job to its estimates, with what is stated to be in doubt, and the next plan."""

from __future__ import annotations

import csv
import re
import shutil
from functools import cache
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from benchmarks.coverage.stated_doubt import held, recorded
from cmm_uq.app.commands.diagnose import outcome_of as diagnosis_page
from cmm_uq.app.commands.reading import job_of
from cmm_uq.app.commands.report import analyse, outcome_of
from cmm_uq.artefacts.ballbar import results as bar_results
from cmm_uq.artefacts.gauge_lines_page import figures
from cmm_uq.base.errors import CmmUqError
from cmm_uq.certificate.diagnosis.sections import TO_FILL_IN
from cmm_uq.certificate.result import Outcome, Result
from cmm_uq.machine.model.artefact_doubt import CALIBRATION
from tests.artefacts.simulated import analysed, diagnosis_of
from tests.conftest import ROOT, without_diagnosis

EXAMPLES = ROOT / "examples"


@pytest.fixture(scope="module")
def uncompensated() -> Result:
    return analysed("iota-1102-20C")


@pytest.fixture(scope="module")
def compensated() -> Result:
    return analysed("iota-1102-20C-compensated")


@pytest.mark.parametrize("name", ["iota-1102-20C", "iota-1102-20C-compensated"])
def test_the_examples_hold_the_figures_of_their_source(name: str) -> None:
    state = "compensated" if name.endswith("-compensated") else "uncompensated"
    source = ROOT.parent / "shared" / "data" / "harris2004" / f"ballbar_20C_{state}.csv"
    if not source.is_file():
        pytest.skip("the source tables are not beside the project")
    assert (EXAMPLES / name / "ballbar.csv").read_bytes() == source.read_bytes()


def test_the_figures_of_performance_are_those_of_the_thesis(uncompensated: Result, compensated: Result) -> None:
    """Harris 2004, tables 19 to 21 and figures C 2, C 4; the largest deviation is what it calls B89."""
    wanted = {
        "mean_length_mm": 404.2051,
        "rms_accuracy_error_um": 73.16,
        "b89_range_um": 339.9,
        "b89_max_deviation_um": 185.6,
    }
    for name, value in wanted.items():
        assert uncompensated.accuracy[name].value == pytest.approx(value, abs=10 ** -(4 if name.endswith("mm") else 1))
    wanted = {
        "mean_length_mm": 404.2357,
        "rms_accuracy_error_um": 12.81,
        "b89_range_um": 45.65,
        "b89_max_deviation_um": 24.22,
    }
    for name, value in wanted.items():
        assert compensated.accuracy[name].value == pytest.approx(value, abs=1e-4 if name.endswith("mm") else 1e-2)


def test_the_squareness_agrees_with_the_machines_own_calibration(uncompensated: Result) -> None:
    """Harris 2004, table 7, from other measurements: −173″, −19″, +21″."""
    ls = uncompensated.least_squares
    fitted = {u.key[0]: value for u, value in zip(ls.unknowns, ls.value, strict=True)}
    assert fitted["squareness_xy"] == pytest.approx(-174.7, abs=0.05)
    assert fitted["squareness_yz"] == pytest.approx(-16.9, abs=0.05)
    assert fitted["squareness_zx"] == pytest.approx(18.1, abs=0.05)
    for name, calibrated in (("squareness_xy", -173.0), ("squareness_yz", -19.0), ("squareness_zx", 21.0)):
        low, high = uncompensated.parameters[name]["angle_arcsec"].interval95
        assert low < calibrated < high


def test_the_residual_standard_deviation_is_13_2_micrometres(uncompensated: Result) -> None:
    """Of nineteen lengths and six parameters: position 18 is a copy of 14."""
    assert uncompensated.least_squares.degrees_of_freedom == 19 - 6
    assert uncompensated.least_squares.residual_sd == pytest.approx(13.2e-3, abs=5e-5)
    assert uncompensated.posterior.converged


def test_the_posterior_agrees_with_least_squares_where_the_data_speak(uncompensated: Result) -> None:
    for unknown, value in zip(uncompensated.least_squares.unknowns, uncompensated.least_squares.value, strict=True):
        if unknown.key[0] != "artefact":
            sampled = uncompensated.parameters[unknown.key[0]][unknown.key[1]]
            assert (
                abs(sampled.value - value) < 0.3 * sampled.u
            )  # noise by axis weighs the directions a little otherwise


def test_without_a_certificate_the_common_scale_is_said_to_be_free(compensated: Result) -> None:
    (combination,) = compensated.undetermined
    assert [key[0] for key in combination] == ["scale_x", "scale_y", "scale_z", "artefact"]
    assert compensated.prior_share(("scale_x", "ppm")) == pytest.approx(1 / 3, abs=0.03)
    assert compensated.prior_share(("squareness_xy", "angle_arcsec")) < 0.01


def test_the_copied_position_counts_once(uncompensated: Result) -> None:
    (finding,) = uncompensated.findings
    assert (finding.kind, finding.measurements, finding.set_aside) == ("duplicate", (14, 18), True)
    assert uncompensated.artefact.measurement[~uncompensated.model.used].tolist() == [18]
    assert len(uncompensated.artefact.measurement) == 20


def test_the_machine_fails_a_limit_that_its_compensation_leaves_undecided(
    uncompensated: Result, compensated: Result
) -> None:
    assert uncompensated.statements[0].decision.outcome == "fail"
    assert compensated.statements[0].decision.outcome == "undecided"


def test_the_same_seed_gives_the_same_result(uncompensated: Result) -> None:
    again = analyse(EXAMPLES / "iota-1102-20C")
    assert np.array_equal(again.posterior.draws, uncompensated.posterior.draws)
    assert again.accuracy == uncompensated.accuracy


def rewrite(job: Path, column: str, row: int, add: float) -> None:
    path = job / "ballbar.csv"
    with path.open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    rows[row][column] = f"{float(rows[row][column]) + add:.4f}"
    with path.open("w", encoding="utf-8", newline="") as file:
        writer = csv.DictWriter(file, rows[0].keys())
        writer.writeheader()
        writer.writerows(rows)


def state(job: Path, pattern: str, replacement: str) -> None:
    path = job / "job.toml"
    path.write_text(
        re.sub(pattern, replacement, path.read_text(encoding="utf-8"), count=1, flags=re.M), encoding="utf-8"
    )


@pytest.mark.usefixtures("no_diagnosis")
def test_a_gross_outlier_is_set_aside_from_the_fit_but_counts_in_the_figures(job: Path, uncompensated: Result) -> None:
    rewrite(job, "x_mm", 9, 2.0)
    found = analyse(job)
    (outlier,) = [finding for finding in found.findings if finding.kind == "outlier"]
    assert outlier.measurements == (5,)
    assert outlier.why.startswith("measurement 5, repeat 1 is ")
    assert outlier.set_aside
    assert found.accuracy["b89_range_um"].value > 1000
    for name in ("squareness_xy", "squareness_zx"):
        here, there = found.parameters[name]["angle_arcsec"], uncompensated.parameters[name]["angle_arcsec"]
        assert abs(here.value - there.value) < 2 * there.u


@pytest.mark.long
def test_a_measurement_that_the_lab_sets_aside_is_not_used(job: Path) -> None:
    state(job, r'^file = "ballbar.csv"', 'file = "ballbar.csv"\nset_aside = [18]')
    found = analyse(job)
    assert found.least_squares.residual_sd == pytest.approx(13.2e-3, abs=5e-5)
    assert found.findings[0].set_aside
    assert len(found.artefact.measurement) == 20


@pytest.mark.long
def test_the_copy_of_a_measurement_that_is_set_aside_counts(job: Path, uncompensated: Result) -> None:
    state(job, r'^file = "ballbar.csv"', 'file = "ballbar.csv"\nset_aside = [14]')
    found = analyse(job)
    assert not found.findings[0].set_aside
    assert found.artefact.measurement[~found.model.used].tolist() == [14]
    assert found.least_squares.value == pytest.approx(uncompensated.least_squares.value, rel=1e-12)


def test_a_measurement_that_is_not_there_cannot_be_set_aside(job: Path) -> None:
    state(job, r'^file = "ballbar.csv"', 'file = "ballbar.csv"\nset_aside = [21]')
    with pytest.raises(CmmUqError, match="no measurement 21"):
        analyse(job)


@pytest.mark.long
def test_a_stated_noise_that_the_residuals_contradict_is_not_believed(job: Path) -> None:
    state(job, r'^file = "ballbar.csv"', 'file = "ballbar.csv"\nu_coordinate_um = 1.0')
    found = analyse(job)
    assert found.noise.contradicts_stated
    assert found.noise.coordinate.value > 5.0
    assert found.parameters["squareness_xy"]["angle_arcsec"].u > 5.0


@pytest.mark.usefixtures("no_diagnosis")
def test_a_stated_noise_is_what_is_known_beforehand(job: Path) -> None:
    state(job, r'^file = "ballbar.csv"', 'file = "ballbar.csv"\nu_coordinate_um = 9.0')
    found = analyse(job)
    assert not found.noise.contradicts_stated
    low, high = found.noise.coordinate.interval95
    assert low < 9.0 < high
    assert found.noise.coordinate.u < 0.25 * 9.0  # good to a fifth, and the residuals say nothing else


def test_coordinates_in_metres_are_recognised(job: Path) -> None:
    path = job / "ballbar.csv"
    rows = [line.split(",") for line in path.read_text(encoding="utf-8").splitlines()]
    for row in rows[1:]:
        row[2:5] = [f"{float(cell) / 1000:.7f}" for cell in row[2:5]]
    path.write_text("\n".join(",".join(row) for row in rows), encoding="utf-8")
    with pytest.raises(CmmUqError, match="look like metres, not mm"):
        analyse(job)


def test_a_recording_with_too_few_bars_is_refused(job: Path) -> None:
    path = job / "ballbar.csv"
    path.write_text("\n".join(path.read_text(encoding="utf-8").splitlines()[:9]), encoding="utf-8")
    with pytest.raises(CmmUqError, match="4 observations cannot determine 6 parameters"):
        analyse(job)


@pytest.mark.long
def test_no_effect_at_all_is_a_model_too(job: Path) -> None:
    state(job, r"^effects = .*", "effects = []")
    found = analyse(job)
    assert found.least_squares.residual_sd == pytest.approx(80e-3, abs=10e-3)
    assert found.parameters == {}


@pytest.mark.long
def test_a_display_of_coarse_steps_is_part_of_the_noise_and_of_a_reading(tmp_path: Path) -> None:
    """Coordinates of the simulated plate, 0.7 µm of noise, rounded to 5 µm: no reading is better than 5/√12 = 1.44 µm."""
    job = tmp_path / "job"
    shutil.copytree(ROOT / "examples" / "plate-simulated", job)
    table = pd.read_csv(job / "recording.csv")
    for column in ("x_mm", "y_mm", "z_mm"):
        table[column] = (table[column] / 5e-3).round() * 5e-3
    table.to_csv(job / "recording.csv", index=False)
    found = analyse(job)
    assert isinstance(found, Result)
    noise = outcome_of(found).results["noise"]
    assert noise["display_step_um"] == pytest.approx(5.0)
    assert noise["coordinate_um"]["interval95"][0] > 5 / np.sqrt(12)
    assert not any("display" in name for name in found.draws.names)


TEMPERATURE = "u_temperature_k = 0.15\nu_fixturing_um = 0.3"
SCALES = ("scale_x", "scale_y", "scale_z")


@cache
def stated(job: str, at: Path, text: str = TEMPERATURE) -> Result:
    folder = at / job
    shutil.copytree(ROOT / "examples" / job, folder)
    path = folder / "job.toml"
    declared = path.read_text(encoding="utf-8")
    for line in ("temperature", "fixturing"):  # what a simulation declares negligible is stated here
        declared = re.sub(rf"^{line} = .*\n", "", declared, flags=re.MULTILINE)
    path.write_text(f"{declared}\n[test_uncertainty]\n{text}\n", encoding="utf-8")
    with without_diagnosis():
        found = analyse(folder)
    assert isinstance(found, Result)
    return found


@pytest.fixture(scope="module")
def place(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("jobs")


@pytest.mark.long
def test_scales_and_slopes_of_a_step_gauge_have_the_temperature_in_u(place: Path) -> None:
    """0.15 K of 11.5·10⁻⁶/K are 1.725 ppm; 0.3 µm of the longest length come to it; no value changes."""
    before, after = analysed("step-gauge-simulated"), stated("step-gauge-simulated", place)
    for name in SCALES:
        one, other = before.parameters[name]["ppm"], after.parameters[name]["ppm"]
        assert other.value == pytest.approx(one.value, abs=1e-9)
        more = np.sqrt(other.u**2 - one.u**2)
        assert 1.725 < more < 2.0
    for one, other in zip(figures(before), figures(after), strict=True):
        clamped = 0.3 / (one.line.length * 1e-3)
        assert other.scale_ppm[0] == pytest.approx(np.sqrt(one.scale_ppm[0] ** 2 + 1.725**2 + clamped**2), rel=1e-3)


@pytest.mark.long
def test_figures_of_a_bar_and_the_second_way_have_it_too(place: Path) -> None:
    """30 µm of clamping in each of forty lengths: alike in all they move the mean length, each by itself the range."""
    before, after = analysed("iota-1102-20C"), stated("iota-1102-20C", place, "u_fixturing_um = 30")
    mean, again = before.accuracy["mean_length_mm"], after.accuracy["mean_length_mm"]
    assert np.sqrt(again.u**2 - mean.u**2) == pytest.approx(30e-3, rel=0.1)
    assert after.accuracy["b89_range_um"].u > before.accuracy["b89_range_um"].u
    assert {cause.name for cause in after.causes} == {"fixturing of the artefact"}
    assert after.relative_doubt == pytest.approx(30e-3 / after.artefact.sizes[0].nominal, rel=1e-3)
    assert "distance_equations" in bar_results(after)


def test_a_difference_of_scales_has_what_each_set_up_errs_by(place: Path) -> None:
    after = stated("step-gauge-simulated", place)
    names = [unknown.key[0] for unknown in after.posterior.unknowns]
    combination = np.array([1.0 if name == "scale_x" else -1.0 if name == "scale_y" else 0.0 for name in names])
    assert after.doubt.variance(combination) > combination @ after.doubt.covariance() @ combination - 1e-12
    assert after.doubt.variance(combination) > 0


def test_jobs_that_state_nothing_have_no_cause() -> None:
    assert not [cause for cause in analysed("step-gauge-simulated").causes if cause.name != CALIBRATION]


@pytest.mark.long
def test_intervals_hold_where_the_thermometer_errs_as_stated() -> None:
    """Twelve machines at 22 °C, 36 scales: without what is stated two in five are missed, with it hardly one."""
    without, with_it = held("step_gauge", 12, 1, common=True)[0]
    assert without < 0.8 < 0.86 < with_it


def test_the_job_that_is_simulated_states_what_errs() -> None:
    job, truth = recorded("plate", 1, common=True)
    assert job.circumstances.uncertainty.u_temperature_k == 0.15
    assert set(truth) >= set(SCALES)


EXAMPLE = ROOT / "examples" / "iota-1102-20C"


@cache
def outcome() -> Outcome:
    """Of the real bars."""
    return diagnosis_page(diagnosis_of("iota-1102-20C"))


def test_agreement_without_power_is_said_to_be_so_and_stays_consistent() -> None:
    """Twenty bars with 10 µm of noise: a bow of 40 µm, and much larger ones, would not have shown."""
    diagnosis = outcome().results["diagnosis"]
    assert diagnosis["verdict"] == "consistent"
    beside = "But this recording could not have shown: straightness of X along Y up to 150\u00a0µm"
    assert any(beside in remark for remark in outcome().summary.remarks)
    rows = {row["effect"]: row for row in diagnosis["unseen"]}
    assert not rows["straightness_x_y"]["shown"]
    assert rows["artefact_sag"]["taken_up_by"] == ["scale_x", "scale_y"]
    assert not {"scale_x", "squareness_xy"} & rows.keys(), "what the job names is estimated"


def test_its_plan_shows_more_and_is_numbered_on() -> None:
    plan = outcome().results["diagnosis"]["next_plan"]
    assert [one["measurement"] for one in plan["set_ups"]] == list(range(21, 21 + len(plan["set_ups"])))
    shown = {one["effect"]: one for one in plan["shows"]}
    assert shown["straightness_x_y"]["detected_before"] is None
    assert shown["straightness_x_y"]["detected_after"] < 150.0


def test_the_plan_is_a_recording_to_fill_in() -> None:
    files = {path.name: path.read_bytes() for path in EXAMPLE.iterdir() if path.suffix in (".toml", ".csv")}
    plan = outcome().results["diagnosis"]["next_plan"]
    job = job_of({**files, "ballbar.csv": outcome().files[TO_FILL_IN]})
    assert job.planned
    assert len(job.points) == 2 * plan["repeats"] * len(plan["set_ups"])
    assert set(job.points.measurement.tolist()) == {one["measurement"] for one in plan["set_ups"]}
    assert "fit_rms_um" not in job.points.columns


@pytest.mark.usefixtures("no_regions", "no_diagnosis")
def test_what_is_left_to_the_prior_has_no_value_and_no_decision(tmp_path: Path) -> None:
    """One level plate sees the vertical only by how it happens to tilt: what physics allows is no measurement."""
    level = Path(shutil.copytree(EXAMPLES / "plate-simulated", tmp_path / "level"))
    recording = pd.read_csv(level / "recording.csv")
    recording[recording["measurement"] == 1].to_csv(level / "recording.csv", index=False)
    state(
        level,
        r"^effects = .*",
        'effects = ["scale_x", "scale_z", "squareness_zx"]\ntolerances = { squareness_zx = 1500.0 }',
    )
    outcome = outcome_of(analyse(level))
    found, key = outcome.found, ("squareness_zx", "angle_arcsec")
    assert isinstance(found, Result)
    assert found.prior_share(key) > 0.9
    assert key in found.not_given
    low, high = found.parameters[key[0]][key[1]].interval95
    assert -1500.0 < low < high < 1500.0, "by the prior alone it would pass"
    (verdict,) = (one for one in found.verdicts if one.name == "squareness_zx.angle_arcsec")
    assert verdict.outcome == "undecided"
    assert {"squareness_zx.angle_arcsec": 1.0} in outcome.results["identifiability"]["undetermined"]
    assert any(text.startswith("Squareness Z–X is not determined by this recording") for text in outcome.warnings)
    assert ("scale_x", "ppm") not in found.not_given
