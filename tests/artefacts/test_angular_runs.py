"""A rotary table read against a polygon by an autocollimator: figures by ISO 230-2, and closure against its own faces."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import cmm_uq
from cmm_uq.app.commands.reading import read_job
from cmm_uq.artefacts import artefact_of
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.points import Floats
from tests.jobs.test_reading import edit
from tests.maths.geometry.test_positioning import by_loops

FACES = 12
TOML = """[job]
id = "polygon"
date = 2026-01-01
origin = "simulated"
[machine]
name = "m"
chain = "XYZ|C"
travel_mm = {{ x = [0, 500], y = [0, 500], z = [-400, 0] }}
table = {{ axis_mm = [250, 250, -300]{turns} }}
[artefact]
kind = "axis_runs"
name = "Polygon of 12 faces"
{polygon}
[recording]
file = "recording.csv"
[model]
effects = ["rotary_positioning_c_1", "rotary_positioning_c_2", "rotary_play_c"]
"""
TRUE = {"rotary_positioning_c_1": (3.0, -2.0), "rotary_positioning_c_2": (-0.8, 1.1), "rotary_play_c": (1.5,)}


def table(degrees: Floats, approach: Floats) -> Floats:
    """By how much the table is turned further than it reads, ″, by the right hand."""
    c = np.radians(degrees)
    found = 0.5 * TRUE["rotary_play_c"][0] * approach
    for order, name in ((1, "rotary_positioning_c_1"), (2, "rotary_positioning_c_2")):
        a, b = TRUE[name]
        found = found + a * np.cos(order * c) - b * np.sin(order * c)
    return found


def job(
    folder: Path, settings: list[int], polygon: str, *, certified: Floats | None = None, repeats: int = 3,
    noise: float = 0.05, turns: str = "", seed: int = 1,
) -> tuple[Path, Floats, Floats]:  # fmt: skip
    """A recording, the faces' deviations from the first, and deviations of the table as read (2, faces, repeats) at first."""
    folder.mkdir(parents=True, exist_ok=True)
    random = np.random.default_rng(seed)
    faces = random.normal(0, 1.0, FACES)
    faces -= faces[0]
    sense = -1.0 if turns else 1.0
    head = "measurement,point,repeat,x_mm,y_mm,z_mm,turn_x,turn_y,turn_z,reading_arcsec,c_deg,c_approach,face"
    rows, first = [head + (",face_arcsec" if certified is not None else "")], np.zeros((2, FACES, repeats))
    for number, shift in enumerate(settings, 1):
        zero = random.normal(0, 20)
        for repeat in range(repeats):
            for side, approach in enumerate((1.0, -1.0)):
                for i in range(FACES)[:: int(approach)]:
                    degrees, face = 30.0 * i, (i + shift) % FACES
                    # readings that grow clockwise: the same table by the right hand, whatever it is called
                    err = float(table(np.array(sense * degrees), np.array(sense * approach))) + random.normal(0, noise)
                    if number == 1:
                        first[side, i, repeat] = sense * err
                    point = i + 1 + FACES * side
                    row = f"{number},{point},{repeat + 1},250,250,-250,0,0,1,{zero + err + faces[face]:.6f}"
                    row += f",{degrees:g},{approach:g},{face + 1}"
                    rows.append(row + (f",{certified[face]:.4f}" if certified is not None else ""))
    (folder / "recording.csv").write_text("\n".join(rows) + "\n", encoding="utf-8")
    turned = ", turns = 'clockwise'" if turns else ""
    (folder / "job.toml").write_text(TOML.format(polygon=polygon, turns=turned), encoding="utf-8")
    return folder, faces, first


def estimated(report: cmm_uq.Report) -> None:
    for name, true in TRUE.items():
        found = report.estimates[report.estimates.index.str.startswith(f"{name}.")]
        want = [np.hypot(*true), np.arctan2(true[1], true[0])] if len(true) == 2 else [true[0]]
        assert np.all(np.abs(found["value"].to_numpy() - want) < 3.5 * found["u"].to_numpy()), name


@pytest.mark.parametrize("turns", ["", "clockwise"])
def test_figures_and_errors_against_certified_faces(tmp_path: Path, turns: str) -> None:
    """A polygon as its certificate says, or nearly: figures are those of the table's deviations as it reads."""
    certified = np.random.default_rng(1).normal(0, 1.0, FACES)
    folder, faces, first = job(tmp_path / "job", [0], "u_polygon_arcsec = 0.1", certified=certified, turns=turns)
    np.testing.assert_allclose(faces, certified - certified[0])  # as the seed has it
    report = cmm_uq.report(folder, seed=1)
    estimated(report)
    (run,) = report.results["runs"]
    assert (run["quantity"], run["unit"], run["angles_deg"]) == ("ECC", "″", (30.0 * np.arange(FACES)).tolist())
    less = first - first.mean()
    assert run["figures"] == pytest.approx(by_loops(less), rel=1e-3)
    assert 0.1 < run["U"]["E"] < 0.8
    assert run["U"]["B"] == pytest.approx(0.0, abs=1e-9)  # a face is the same from either side


def test_faces_are_found_by_closure_with_the_table(tmp_path: Path) -> None:
    """Four settings of a polygon that nobody calibrated: its faces and the table's errors are both found."""
    folder, faces, first = job(tmp_path / "job", [0, 1, 4, 9], "", repeats=2)
    report = cmm_uq.report(folder, seed=1)
    estimated(report)
    read = read_job(folder)
    artefact = artefact_of(read.facts.artefact, read.points)
    found = {s.name for s in artefact.sizes}
    assert found == {f"face_{k}_arcsec" for k in range(2, FACES + 1)}
    profile = artefact._profile / artefact._factor(turns=True)  # type: ignore[attr-defined]
    face = read.points.columns["face"].astype(int) - 1
    np.testing.assert_allclose(profile, faces[face], atol=0.12)
    run = report.results["runs"][0]
    assert run["figures"]["E"] == pytest.approx(by_loops(first - first.mean())["E"], abs=0.15)
    assert 0.03 < run["U"]["E"] < 0.15


@pytest.mark.parametrize("settings", [[0], [0, 6], [0, 3], [0, 4, 8]])
def test_settings_that_leave_faces_and_table_open_are_refused(tmp_path: Path, settings: list[int]) -> None:
    """Of one setting half of the table's errors passed for the polygon's: E was 4.15 ± 0.04″ where it is 9.23."""
    folder, *_ = job(tmp_path / "job", settings, "")
    read = read_job(folder)
    with pytest.raises(CmmUqError, match="do not part its faces from the table's errors"):
        artefact_of(read.facts.artefact, read.points)


def test_two_settings_one_face_apart_are_enough(tmp_path: Path) -> None:
    folder, _, first = job(tmp_path / "job", [0, 1], "")
    run = cmm_uq.report(folder, seed=1).results["runs"][0]
    assert abs(run["figures"]["E"] - by_loops(first - first.mean())["E"]) < 1.5 * run["U"]["E"]


def test_runs_of_carriages_and_of_a_table_are_two_jobs(tmp_path: Path) -> None:
    folder, *_ = job(tmp_path / "job", [0, 1], "")
    text = (folder / "recording.csv").read_text(encoding="utf-8").split("\n")
    moved = [
        line.replace(",250,250,", f",{250 + i % 9},250,", 1) if line.startswith("2,") else line
        for i, line in enumerate(text)
    ]
    (folder / "recording.csv").write_text("\n".join(moved), encoding="utf-8")
    read = read_job(folder)
    with pytest.raises(CmmUqError, match="runs of carriages beside runs of a rotary table"):
        artefact_of(read.facts.artefact, read.points)


def test_a_fault_that_the_model_leaves_out_is_found(tmp_path: Path) -> None:
    folder, *_ = job(
        tmp_path / "job", [0], "u_polygon_arcsec = 0.1", certified=np.random.default_rng(1).normal(0, 1.0, FACES)
    )
    edit(folder, r"^effects = .*", 'effects = ["rotary_positioning_c_1", "rotary_positioning_c_2"]')
    told = cmm_uq.diagnose(folder, seed=1).diagnosis
    assert "rotary_play_c" in {each["effect"] for each in told["effects"]}
