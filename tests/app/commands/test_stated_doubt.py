"""What a job states of temperature, expansion and clamping is in U of every figure of its certificate."""

from __future__ import annotations

import re
import shutil
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from benchmarks.coverage.stated_doubt import held, recorded
from cmm_uq.app.commands.report import analyse
from cmm_uq.artefacts.ballbar import results as bar_results
from cmm_uq.artefacts.gauge_lines_page import figures
from cmm_uq.certificate.result import Result
from cmm_uq.machine.model.artefact_doubt import CALIBRATION
from tests.artefacts.simulated import analysed
from tests.conftest import ROOT

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
    found = analyse(folder)
    assert isinstance(found, Result)
    return found


@pytest.fixture(scope="module")
def place(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("jobs")


def test_scales_and_slopes_of_a_step_gauge_have_the_temperature_in_u(place: Path) -> None:
    """0.15 K of 11.5·10⁻⁶/K are 1.725 ppm; 0.3 µm of the longest length come to it; no value changes."""
    before, after = analysed("step-gauge-simulated"), stated("step-gauge-simulated", place)
    for name in SCALES:
        one, other = before.parameters[name]["ppm"], after.parameters[name]["ppm"]
        assert other.value == pytest.approx(one.value, abs=1e-9)
        more = np.sqrt(other.u**2 - one.u**2)
        assert 1.725 < more < 2.0
    for one, other in zip(figures(before).lines, figures(after).lines, strict=True):
        clamped = 0.3 / (one.line.length * 1e-3)
        assert other.scale_u_ppm == pytest.approx(np.sqrt(one.scale_u_ppm**2 + 1.725**2 + clamped**2), rel=1e-3)


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


def test_intervals_hold_where_the_thermometer_errs_as_stated() -> None:
    """Twelve machines at 22 °C, 36 scales: without what is stated two in five are missed, with it hardly one."""
    without, with_it = held("step_gauge", 12, 1, common=True)[0]
    assert without < 0.8 < 0.86 < with_it


def test_the_job_that_is_simulated_states_what_errs() -> None:
    job, truth = recorded("plate", 1, common=True)
    assert job.circumstances.uncertainty.u_temperature_k == 0.15
    assert set(truth) >= set(SCALES)
