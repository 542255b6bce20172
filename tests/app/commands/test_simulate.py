"""Simulated recordings, and faults in them that the diagnosis finds."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from cmm_uq.app.commands.diagnose import screened_model
from cmm_uq.app.commands.jobs.simulate import simulate, simulated_job, write_simulation
from cmm_uq.app.commands.reading import read_job
from cmm_uq.app.commands.report import analyse
from cmm_uq.artefacts import artefact_of
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.points import Floats
from cmm_uq.jobs.derived_job import NoiseFacts, Truth
from cmm_uq.machine.model.placed import Rigid
from tests.conftest import ROOT

TRUTH = """
seed = 7
[effects.scale_x]
ppm = 60.0
[effects.squareness_xy]
angle_arcsec = -40.0
[artefact]
length_mm = 404.2357
[noise]
coordinate_um = 1.0
"""


@pytest.mark.usefixtures("no_diagnosis")
def test_a_simulated_job_reports_the_truth_within_its_intervals(iota: Path, tmp_path: Path) -> None:
    """Five standard uncertainties: among seven figures a wrong alarm comes once in 250 000 such tests."""
    (tmp_path / "truth.toml").write_text(TRUTH)
    write_simulation(iota, tmp_path / "truth.toml", tmp_path / "drawn")
    found = analyse(tmp_path / "drawn")
    wanted = dict.fromkeys(found.parameters, 0.0) | {"scale_x": 60.0, "squareness_xy": -40.0}
    for effect, truth in wanted.items():
        (quantity,) = found.parameters[effect].values()
        assert abs(quantity.value - truth) < 5 * quantity.u
    assert found.noise.coordinate.value == pytest.approx(1.0, rel=0.6)


def test_the_same_seed_draws_the_same_recording(iota: Path) -> None:
    job, truth = read_job(iota), Truth(noise=NoiseFacts(coordinate_um=2.0))
    first, again, other = (simulate(job, truth, seed=seed).xyz for seed in (1, 1, 2))
    assert np.array_equal(first, again)
    assert not np.array_equal(first, other)


def test_temperatures_of_the_truth_enter_the_recording(iota: Path) -> None:
    truth = Truth(effects={"thermal_scale_x": {"cte_per_k": 10e-6}}, columns={"temp_x_c": 25.0})
    drawn = simulate(read_job(iota), truth)
    cold = simulate(read_job(iota), Truth())
    assert drawn.columns["temp_x_c"].tolist() == [25.0] * 40
    bars, warm = (np.diff(points.xyz.reshape(-1, 2, 3), axis=1)[:, 0] for points in (cold, drawn))
    lengths = np.linalg.norm(bars, axis=1)
    expected = lengths - 50e-6 * bars[:, 0] ** 2 / lengths
    np.testing.assert_allclose(np.linalg.norm(warm, axis=1), expected, atol=2e-6)


def test_a_periodic_error_can_be_simulated(iota: Path) -> None:
    truth = Truth(effects={"periodic_scale_x": {"amplitude_um": 5.0, "period_mm": 40.0, "phase_rad": 0.3}})
    assert np.abs(simulate(read_job(iota), truth).xyz - simulate(read_job(iota), Truth()).xyz).max() > 2e-3


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("[effects.scale_w]\nppm = 1.0", "unknown effect 'scale_w'"),
        ("[effects.scale_x]\narcsec = 1.0", "no parameter 'arcsec'"),
        ("[effects.thermal_scale_x]\ncte_per_k = 1e-6", "needs the column temp_x_c"),
        ("[noise]\nslow_um = 1.0", "slow noise needs the column time_s"),
        ("[artefact]\nwidth_mm = 1.0", "a ballbar has no size 'width_mm'"),
        ("[noise]\ncoordinate_um = -1.0", "greater than or equal to 0"),
        ("[nois]\ncoordinate_um = 1.0", "unknown key. Did you mean 'noise'"),
    ],
)
def test_a_wrong_truth_is_refused(iota: Path, tmp_path: Path, text: str, message: str) -> None:
    (tmp_path / "mine.toml").write_text(text)
    with pytest.raises(CmmUqError, match=message) as told:
        write_simulation(iota, tmp_path / "mine.toml", tmp_path / "drawn")
    assert str(told.value).startswith(f"{tmp_path / 'mine.toml'}")
    assert "truth.toml" not in str(told.value)
    assert not (tmp_path / "drawn").exists()


def test_the_job_itself_is_not_written_over(job: Path, tmp_path: Path) -> None:
    (tmp_path / "truth.toml").write_text("")
    with pytest.raises(CmmUqError, match="is an input of this command"):
        write_simulation(job, tmp_path / "truth.toml", job)


def test_a_size_whose_recording_could_not_be_read_back_is_refused(iota: Path) -> None:
    with pytest.raises(CmmUqError, match=r"truth\.toml: the coordinates would go beyond 1e\+07 mm"):
        simulate(read_job(iota), Truth(artefact={"length_mm": 1e15}))


PLATE, BARS = (read_job(ROOT / "examples" / name) for name in ("plate-simulated", "iota-1102-20C"))


def in_own_axes(truth: dict[str, object]) -> Floats:
    """Where a simulated plate without noise is found against its certificate, by set-up (q, N, 3), µm."""
    job = simulated_job(PLATE, truth)
    artefact = artefact_of(job.facts.artefact, job.points)
    assert isinstance(artefact, Rigid)
    points = job.points
    own = 1e3 * np.einsum("nij,ni->nj", artefact.attitudes(points.xyz), artefact.deviations())
    order = np.lexsort((points.point, points.repeat, points.measurement))
    return own[order].reshape(len(np.unique(points.measurement)), -1, 3)


def test_a_simulated_pattern_is_the_same_in_every_set_up_and_as_large_as_asked_for() -> None:
    found = in_own_axes({"effects": {"artefact_pattern": {"rms_um": 8.0, "seed": 3}}})
    np.testing.assert_allclose(found, np.broadcast_to(found[0], found.shape), atol=2e-3)
    assert np.sqrt(np.mean(found**2)) == pytest.approx(8.0, rel=1e-3)
    other = in_own_axes({"effects": {"artefact_pattern": {"rms_um": 8.0, "seed": 4}}})
    assert np.abs(found - other).max() > 5


def test_a_warmer_plate_is_simulated_longer() -> None:
    """By 2 K · 11.5 ppm/K in every direction from its middle."""
    found = in_own_axes({"effects": {"artefact_temperature": {"k": 2.0}}})
    places = np.column_stack([PLATE.points.columns[f"reference_{a}_mm"] for a in "xyz"])
    order = np.lexsort((PLATE.points.point, PLATE.points.repeat, PLATE.points.measurement))
    about = places[order].reshape(found.shape)
    about = about - about.mean(axis=1, keepdims=True)
    np.testing.assert_allclose(found, 23e-3 * about, atol=0.01)


def test_an_artefact_that_cannot_have_the_fault_says_so() -> None:
    with pytest.raises(CmmUqError, match="'ballbar' has no artefact_pattern") as caught:
        simulated_job(BARS, {"effects": {"artefact_pattern": {"rms_um": 8.0}}})
    assert caught.value.where == "truth.toml [effects]"
    assert caught.value.fix == "Leave it out; it has artefact_temperature"


def test_a_model_may_name_a_fault_and_its_size_is_estimated() -> None:
    job = simulated_job(PLATE, {"effects": {"artefact_bending": {"um": 30.0}}, "noise": {"coordinate_um": 0.5}})
    facts = job.facts.model_copy(update={"model": job.facts.model.model_copy(update={"effects": ["artefact_bending"]})})
    model, _ = screened_model(replace(job, facts=facts))
    found = model.estimate().least_squares
    assert abs(found.value[0] - 30.0) < 4 * np.sqrt(found.covariance[0, 0])
