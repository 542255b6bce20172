"""Error maps in the contractors' text form, read wherever a map is read, and written by ``compensate``."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pytest

from cmm_uq.app.commands.jobs.compensate import write_compensated
from cmm_uq.app.commands.reading import read_job
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.units import ARCSECOND
from cmm_uq.machine.model.predicted_errors import maps_of
from cmm_uq.machine.physics.error_map import parse_map_file, read_error_map, read_error_map_text
from tests.app.cli.process import run
from tests.app.commands.test_compensate import straight
from tests.app.commands.test_map_squareness import HARRIS, TABLE_7, at, stated, with_maps

PRINTED = (169.397, 33.979, -25.984)
"""Squareness in appendix B, 90° less the angle, ″."""


def naming(job: Path, *entries: str) -> Path:
    """The job with these maps, on the travel that appendix B covers."""
    path = job / "job.toml"
    maps = f"error_map = [ {', '.join(entries)} ]\n"
    text = path.read_text(encoding="utf-8").replace("[artefact]", f"{maps}[artefact]", 1)
    path.write_text(text, encoding="utf-8")
    return job


def appendix_b(job: Path, more: str = "", name: str = "contractor.csv") -> str:
    """Its map in the job's folder, under a name that does not tell its form; the entry that names it."""
    shutil.copy(HARRIS / "appendix_b.txt", job / name)
    return f'{{ file = "{name}", temperature_c = 22.0{more} }}'


def test_appendix_b_compensates_as_its_transcription_with_the_sign_turned(job: Path, tmp_path: Path) -> None:
    """The same map as CSV, with the printed squareness times −1 beside it."""
    twin = Path(shutil.copytree(job, tmp_path / "twin"))
    naming(job, appendix_b(job))
    shutil.copy(HARRIS / "error_map_22C.csv", twin / "map.csv")
    naming(twin, f'{{ file = "map.csv", temperature_c = 22.0{stated(tuple(-s for s in PRINTED))} }}')
    for folder, out in ((job, "a"), (twin, "b")):
        write_compensated(folder, tmp_path / out, beyond="extrapolate")
    one, other = (read_job(tmp_path / out) for out in ("a", "b"))
    np.testing.assert_array_equal(one.points.xyz, other.points.xyz)
    assert np.abs(one.points.xyz - read_job(job).points.xyz).max() > 0.1


def test_the_form_is_told_by_what_is_in_the_file_whatever_its_name(tmp_path: Path) -> None:
    text, has_squareness = parse_map_file((HARRIS / "appendix_b.txt").read_bytes(), "map.csv", temperature=22.0)
    assert has_squareness
    table, has_none = parse_map_file((HARRIS / "error_map_22C.csv").read_bytes(), "map.txt", temperature=22.0)
    assert not has_none
    for one, other in zip(text.axes, table.axes, strict=True):
        np.testing.assert_array_equal(one.errors, other.errors)
    remark = b"# Map Data: X Axis\n" + straight().encode()
    assert not parse_map_file(remark, "map.csv")[1]


@pytest.mark.parametrize(
    ("content", "says"),
    [
        (straight() + "Map Data: X Axis\n", "begins as a CSV and has tables under “Map Data”"),
        ("Position Linear Straight\n0 1 2\n", "is no error map in either form"),
        ("axis;position_mm\n", "is no error map in either form"),
        ("", "has no rows"),
        ("Map Data: X Axis\n0 1 2 3 4 5\n", "line 2: '0 1 2 3 4 5' is not 7 numbers"),
        ("axis,position_mm\nx,0\n", "column dx_um is missing"),
    ],
)
def test_what_is_neither_or_both_is_refused(content: str, says: str) -> None:
    with pytest.raises(CmmUqError, match=says):
        parse_map_file(content.encode(), "map")


@pytest.mark.parametrize("where", ["map", "machine"])
def test_a_squareness_beside_a_map_that_states_its_own_is_refused(job: Path, where: str) -> None:
    naming(job, appendix_b(job, stated(PRINTED) if where == "map" else ""))
    if where == "machine":
        path = job / "job.toml"
        path.write_text(path.read_text().replace("error_map =", "squareness_arcsec = { xy = 1.0 }\nerror_map =", 1))
    with pytest.raises(CmmUqError, match=r"contractor\.csv: states its squareness, and the job gives it"):
        maps_of(read_job(job))


def test_a_map_without_squareness_beside_a_text_with_it_is_refused(job: Path) -> None:
    (job / "map.csv").write_text(straight())
    naming(job, appendix_b(job), '{ file = "map.csv", temperature_c = 25.0 }')
    with pytest.raises(CmmUqError, match=r"map\.csv: has no squareness, and another map has"):
        maps_of(read_job(job))


def test_the_map_between_two_is_written_as_their_mean_and_the_sign_of_its_squareness_is_turned(
    job: Path, tmp_path: Path
) -> None:
    """Figures of tables 8 to 10 and 7 of the thesis at 20 and 25 °C, halved by hand."""
    with_maps(at(job, (22.5, 22.5, 22.5)), {t: stated(TABLE_7[t]) for t in (20, 25)})
    write_compensated(job, tmp_path / "out", map_text_c=22.5)
    written = tmp_path / "out" / "error-map-22.5C.txt"
    assert "\nXY: 175.5\nYZ: 11.5\nZX: -31.5\n" in written.read_text(encoding="utf-8")
    cold, warm = (read_error_map(HARRIS / f"error_map_{t}C.csv") for t in (20, 25))
    found = read_error_map_text(written)
    for axis, one, other in zip(found.axes, cold.axes, warm.axes, strict=True):
        np.testing.assert_array_equal(axis.positions, one.positions)
        np.testing.assert_allclose(axis.errors, (one.errors + other.errors) / 2, rtol=1e-11, atol=1e-18)
    np.testing.assert_allclose(found.squareness / ARCSECOND, [-175.5, -11.5, 31.5], rtol=1e-12)
    assert "error-map-22.5C.txt" in read_job(tmp_path / "out").inputs


def test_what_was_written_compensates_as_the_maps_that_it_was_made_from(
    iota: Path, job: Path, tmp_path: Path
) -> None:  # fmt: skip
    with_maps(at(job, (23.0, 23.0, 23.0)), {t: stated(s) for t, s in TABLE_7.items()})
    write_compensated(job, tmp_path / "a", map_text_c=23.0)
    again = at(Path(shutil.copytree(iota, tmp_path / "again")), (23.0, 23.0, 23.0))
    shutil.copy(tmp_path / "a" / "error-map-23C.txt", again / "map.txt")
    naming(again, '{ file = "map.txt", temperature_c = 23.0 }')
    write_compensated(again, tmp_path / "b")
    np.testing.assert_allclose(
        read_job(tmp_path / "a").points.xyz, read_job(tmp_path / "b").points.xyz, rtol=0, atol=1.1e-7
    )


@pytest.mark.parametrize(("asked", "says"), [("35", "no error map at 35 °C"), ("nan", "no error map at nan °C")])
def test_a_temperature_beyond_the_maps_is_refused_and_nothing_is_written(
    job: Path, tmp_path: Path, asked: str, says: str
) -> None:
    with_maps(at(job, (25.0, 25.0, 25.0)), {t: stated(s) for t, s in TABLE_7.items()})
    process = run("compensate", job, "--out", tmp_path / "out", "--map-text", asked)
    assert process.returncode == 2
    assert says in process.stderr
    assert not (tmp_path / "out").exists()


def test_the_command_writes_it_and_says_so(job: Path, tmp_path: Path) -> None:
    with_maps(at(job, (25.0, 25.0, 25.0)), {t: stated(s) for t, s in TABLE_7.items()})
    process = run("compensate", job, "--out", tmp_path / "out", "--map-text", "30.5")
    assert process.returncode == 0, process.stderr
    assert "error-map-30.5C.txt" in process.stdout
    nearest = read_error_map(HARRIS / "error_map_30C.csv")  # within 1 K the nearest map holds
    found = read_error_map_text(tmp_path / "out" / "error-map-30.5C.txt")
    np.testing.assert_allclose(found.axes[2].errors, nearest.axes[2].errors, rtol=1e-11)
