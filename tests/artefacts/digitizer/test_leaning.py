"""A digitizer on a machine whose axes lean by degrees: its scans make one sphere only on these axes."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from cmm_uq.app.commands.diagnose import screened_model
from cmm_uq.app.commands.model import model_of
from cmm_uq.app.commands.reading import read_job
from cmm_uq.app.commands.report import analyse
from cmm_uq.artefacts import artefact_facts
from cmm_uq.artefacts.digitizer import DigitizerArtefact
from cmm_uq.artefacts.digitizer_page import DigitizerFigures
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.points import Points
from cmm_uq.jobs.tables.artefact import ArtefactFacts
from tests.artefacts.constructions import leaning, model
from tests.artefacts.digitizer.aligned import OFFSET, SIX, centres, scans
from tests.conftest import ROOT

LEANS = ("squareness_xy", "squareness_yz", "squareness_zx")
DEGREES = np.array([1.0, -0.9, 1.1])


def certified() -> ArtefactFacts:
    return artefact_facts(kind="digitizer", length_mm=25.4, u_um=0.3)


def read(points: Points, degrees: float, noise_um: float = 3.0, seed: int = 0) -> Points:
    """What scales on axes that lean so read where the mount truly stands at the points, with noise."""
    noise = np.random.default_rng(seed).normal(0.0, 1e-3 * noise_um, points.xyz.shape)
    return points.at(points.xyz @ np.linalg.inv(leaning(3600 * degrees * DEGREES)) + noise)


@pytest.mark.parametrize("degrees", [0.0, 0.1, 0.5, 3.0, 6.0, -3.0])
def test_squarenesses_and_offset_are_found_within_their_uncertainty_at_any_angle(degrees: float) -> None:
    found = model(certified(), read(scans(SIX), degrees), LEANS, None).estimate().least_squares
    u = np.sqrt(np.diag(found.covariance))[:6]
    truth = np.array([*(3600 * degrees * DEGREES), *OFFSET])
    assert np.all(u[:3] < 20)
    assert np.all(u[3:] < 0.01)
    assert np.all(np.abs(found.value[:6] - truth) < 4 * u)
    assert found.sigma == pytest.approx(3e-3, rel=0.15)


@pytest.mark.long
def test_intervals_hold_at_three_degrees_as_often_as_they_say() -> None:
    """2σ of 40 recordings, three angles and three components of the offset each: 95.4 % of 240 within three of its sd."""
    truth, held = np.array([*(10800 * DEGREES), *OFFSET]), 0
    for seed in range(40):
        found = model(certified(), read(scans(SIX), 3.0, seed=seed), LEANS, 3e-3).estimate().least_squares
        u = np.sqrt(np.diag(found.covariance))[:6]
        held += int(np.sum(np.abs(found.value[:6] - truth) < 2 * u))
    assert held / 240 == pytest.approx(0.954, abs=3 * np.sqrt(0.954 * 0.046 / 240) * np.sqrt(2))


def test_centres_do_it_too() -> None:
    points = centres((*SIX, (60.0, 40.0, 20.0), (10.0, 80.0, 70.0), (-40.0, 60.0, -30.0)), times=4)
    found = model(artefact_facts(kind="digitizer"), read(points, 3.0, 1.0), LEANS, None).estimate().least_squares
    u = np.sqrt(np.diag(found.covariance))[:6]
    assert np.all(np.abs(found.value[:6] - [*(10800 * DEGREES), *OFFSET]) < 4 * u)


def test_small_angles_and_other_spheres_are_not_taken_for_leans() -> None:
    assert not DigitizerArtefact(certified(), read(scans(SIX), 0.02)).leans.any()
    with pytest.raises(CmmUqError, match="by the certificate 30 mm"):
        DigitizerArtefact(certified().model_copy(update={"length_mm": 30.0}), read(scans(SIX), 3.0))
    points = scans(SIX)
    with pytest.raises(CmmUqError):  # no machine leans by 15°
        DigitizerArtefact(certified(), read(points, 15.0))


@pytest.mark.parametrize(
    ("named", "missing"),
    [((), "squareness_xy, squareness_yz, squareness_zx"), (LEANS[:1], "squareness_yz, squareness_zx")],
)
def test_angles_that_nobody_names_are_refused_with_the_remedy(named: tuple[str, ...], missing: str) -> None:
    job = read_job(ROOT / "examples" / "digitizer-simulated")
    facts = job.facts.model_copy(update={"model": job.facts.model.model_copy(update={"effects": list(named)})})
    leaning_scans = DigitizerArtefact(certified(), read(scans(SIX), 3.0))
    with pytest.raises(CmmUqError, match=r"out of square by .*3\.3° \(Z and X\)") as refused:
        model_of(replace(job, facts=facts), leaning_scans)
    assert f"Name {missing} in job.toml [model] effects" in str(refused.value.fix)


def test_half_a_degree_that_nobody_names_is_left_to_the_diagnosis(tmp_path: Path) -> None:
    points = read(scans(), 0.5)
    example = ROOT / "examples" / "digitizer-simulated"
    names = ("measurement", "point", "repeat", "x_mm", "y_mm", "z_mm", *points.columns)
    columns = [points.measurement, points.point, points.repeat, *points.xyz.T, *points.columns.values()]
    rows = [",".join(f"{value:.9g}" for value in row) for row in zip(*columns, strict=True)]
    (tmp_path / "recording.csv").write_text("\n".join([",".join(names), *rows]) + "\n")
    (tmp_path / "job.toml").write_text((example / "job.toml").read_text())
    found, _ = screened_model(read_job(tmp_path))
    assert np.degrees(found.artefact.leans) == pytest.approx(0.5 * DEGREES, abs=0.05)


def job_on_leaning_axes(folder: Path, degrees: float) -> Path:
    """The example's own scans as such a machine reads them, its angles named."""
    example = ROOT / "examples" / "digitizer-simulated"
    points = read(scans(SIX), degrees)
    names = ("measurement", "point", "repeat", "x_mm", "y_mm", "z_mm", *points.columns)
    columns = [points.measurement, points.point, points.repeat, *points.xyz.T, *points.columns.values()]
    rows = [",".join(f"{value:.9g}" for value in row) for row in zip(*columns, strict=True)]
    (folder / "recording.csv").write_text("\n".join([",".join(names), *rows]) + "\n")
    toml = (example / "job.toml").read_text()
    assert "effects = []" in toml
    (folder / "job.toml").write_text(toml.replace("effects = []", f"effects = {[*LEANS]}".replace("'", '"')))
    return folder


@pytest.mark.long
def test_every_attitude_is_held_against_the_axes_that_are_estimated(tmp_path: Path) -> None:
    """Centres by themselves lie within their noise of the common one, where on square axes they are off by millimetres."""
    found = DigitizerFigures(analyse(job_on_leaning_axes(tmp_path, 3.0)))
    off = np.array([pose.off_um for pose in found.poses])
    assert np.abs(off).max() < 30.0
    square = found.digitizer
    assert np.linalg.norm(square.start.residuals, axis=1).max() > 0.5
    assert found.start.offset == pytest.approx(OFFSET, abs=0.03)
    assert np.abs(square.start.offset - OFFSET).max() > 0.3
    # with the digitizer's origin at the centre the scales read what these axes make of the centre
    axes = leaning(3 * 3600 * DEGREES)
    centres_by_hand = np.array([found.sphere + one.attitude @ OFFSET for one in found.alignments]) @ np.linalg.inv(axes)
    np.testing.assert_allclose([pose.reading_mm for pose in found.poses], centres_by_hand, atol=0.08)
