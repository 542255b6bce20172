"""Each error map with the squareness that was measured at its temperature."""

from __future__ import annotations

import json
import re
import shutil
import tomllib
from pathlib import Path

import numpy as np
import pytest

from cmm_uq.app.commands.diagnose import diagnose_read
from cmm_uq.app.commands.jobs.compensate import write_compensated
from cmm_uq.app.commands.reading import read_job
from cmm_uq.artefacts.error_maps.diagnosis import squareness_findings, squareness_sections
from cmm_uq.artefacts.error_maps.page import maps_results
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.points import Floats
from cmm_uq.machine.model.predicted_errors import maps_of
from tests.app.commands.test_compensate import straight
from tests.conftest import ROOT

HARRIS = Path(__file__).parents[2] / "machine" / "physics" / "harris2004"
TABLE_7 = {20: (-173.0, -19.0, 21.0), 25: (-178.0, -4.0, 42.0), 30: (-172.0, -20.0, 1.0)}
"""Squareness XY, YZ, ZX in ″ (Harris 2004)."""
ARCSECOND = np.pi / 648000


def stated(given: tuple[float, ...]) -> str:
    return f", squareness_arcsec = {{ xy = {given[0]}, yz = {given[1]}, zx = {given[2]} }}"


def with_maps(job: Path, own: dict[int, str], more: str = "") -> Path:
    """The job with the thesis' three maps; ``own``: what stands beside each."""
    for t in own:
        shutil.copy(HARRIS / f"error_map_{t}C.csv", job)
    entries = "".join(f'  {{ file = "error_map_{t}C.csv", temperature_c = {t}.0{text} }},\n' for t, text in own.items())
    path = job / "job.toml"
    text = re.sub(r"(?m)^(chain = .*\n)", rf"\1error_map = [\n{entries}]\n{more}", path.read_text(encoding="utf-8"))
    path.write_text(text, encoding="utf-8")
    return job


def at(job: Path, temperature: tuple[float, float, float]) -> Path:
    """The job with its scales at these temperatures."""
    path = job / "ballbar.csv"
    header, *rows = path.read_text(encoding="utf-8").splitlines()
    while header.startswith("#"):
        header, *rows = rows
    cells = ",".join(f"{t}" for t in temperature)
    path.write_text("\n".join([f"{header},temp_x_c,temp_y_c,temp_z_c", *(f"{row},{cells}" for row in rows)]) + "\n")
    return job


def unit_vectors(arcsec: tuple[float, float, float]) -> Floats:
    """Rows x, y, z that enclose 90° + S: the Cholesky factor of the cosines between them."""
    xy, yz, zx = np.cos(np.pi / 2 + ARCSECOND * np.array(arcsec))
    return np.linalg.cholesky(np.array([[1, xy, zx], [xy, 1, yz], [zx, yz, 1]]))


def compensated(job: Path, out: Path) -> Floats:
    write_compensated(job, out)
    return read_job(out).points.xyz


@pytest.mark.parametrize(
    ("temperature", "expected"),
    [
        ((20.0, 20.0, 20.0), TABLE_7[20]),
        ((25.0, 25.0, 25.0), TABLE_7[25]),
        ((22.5, 22.5, 22.5), (-175.5, -11.5, 31.5)),
        ((24.0, 27.0, 30.0), (-175.6, -10.4, 25.6)),  # their mean, 27 °C: two fifths of the way from 25 to 30 °C
    ],
)
def test_squareness_is_interpolated_with_the_maps_at_the_mean_temperature_of_the_scales(
    iota: Path, tmp_path: Path, temperature: tuple[float, float, float], expected: tuple[float, float, float]
) -> None:
    """Axes that enclose 90° + S are all that it adds to the maps, but for products with their errors: 10⁻³ of 0.15 mm."""
    for name in ("with", "without"):
        at(Path(shutil.copytree(iota, tmp_path / name)), temperature)
    readings = read_job(tmp_path / "with").points.carriages
    own = compensated(with_maps(tmp_path / "with", {t: stated(s) for t, s in TABLE_7.items()}), tmp_path / "a")
    none = compensated(with_maps(tmp_path / "without", dict.fromkeys(TABLE_7, "")), tmp_path / "b")
    np.testing.assert_allclose(own - none, readings @ (unit_vectors(expected) - np.eye(3)), atol=1.5e-4)


def test_one_squareness_for_all_maps_is_wrong_by_tens_of_micrometres_at_25_degrees(iota: Path, tmp_path: Path) -> None:
    """Of table 7, 20 instead of 25 °C: 5″ of XY over y, 21″ of ZX over z, 15″ of YZ over z."""
    for name in ("own", "one"):
        at(Path(shutil.copytree(iota, tmp_path / name)), (25.0, 25.0, 25.0))
    readings = read_job(tmp_path / "own").points.carriages
    own = compensated(with_maps(tmp_path / "own", {t: stated(s) for t, s in TABLE_7.items()}), tmp_path / "a")
    shared = stated(TABLE_7[20]).removeprefix(", ") + "\n"
    one = compensated(with_maps(tmp_path / "one", dict.fromkeys(TABLE_7, ""), shared), tmp_path / "b")
    wrong = readings @ (unit_vectors(TABLE_7[25]) - unit_vectors(TABLE_7[20]))
    np.testing.assert_allclose(own - one, wrong, atol=2e-5)
    assert np.abs(wrong).max() > 0.025


def test_how_it_came_about_names_the_squareness_of_each_map(job: Path, tmp_path: Path) -> None:
    with_maps(at(job, (21.0, 21.0, 21.0)), {t: stated(s) for t, s in TABLE_7.items()})
    write_compensated(job, tmp_path / "out")
    told = json.loads((tmp_path / "out" / "compensation.json").read_text(encoding="utf-8"))
    assert {m["temperature_c"]: tuple(m["squareness_arcsec"].values()) for m in told["error_maps"]} == TABLE_7
    assert "squareness_arcsec" not in (tmp_path / "out" / "job.toml").read_text(encoding="utf-8")


def test_tables_of_maps_go_with_their_squareness(job: Path, tmp_path: Path) -> None:
    (job / "map.csv").write_text(straight())
    table = '[[machine.error_map]]\nfile = "map.csv"\ntemperature_c = 20.0\n[machine.error_map.squareness_arcsec]\nxy = 4.0\n'
    path = job / "job.toml"
    path.write_text(path.read_text().replace("[artefact]", f"{table}[artefact]", 1))
    assert maps_of(read_job(job))[0].squareness.tolist() == [4 * ARCSECOND, 0, 0]
    write_compensated(job, tmp_path / "out")
    assert (
        not {"error_map", "squareness_arcsec"}
        & tomllib.loads((tmp_path / "out" / "job.toml").read_text())["machine"].keys()
    )


@pytest.mark.parametrize(
    ("own", "more", "says"),
    [
        (stated(TABLE_7[20]), "squareness_arcsec = { xy = -173.0 }\n",
         r"job\.toml line \d+: \[machine\]: squareness_arcsec is given for the machine and for the map 'error_map_20C\.csv'"),
        (", squareness_arcsec = { xy = 40000.0 }", "", r"squareness_arcsec\.xy: input should be less than or equal to 36000"),
        (", squareness_arcsec = { yx = 4.0 }", "", r"squareness_arcsec\.yx: unknown key"),
        (", squareness_arcsec = 4.0", "", r"\[machine\] error_map\.0\.squareness_arcsec"),
    ],
)  # fmt: skip
def test_what_contradicts_or_cannot_be_is_refused_with_its_place(job: Path, own: str, more: str, says: str) -> None:
    with_maps(job, {20: own}, more)
    with pytest.raises(CmmUqError, match=says):
        read_job(job)


def test_a_map_without_squareness_between_maps_that_have_it_is_refused(job: Path) -> None:
    with_maps(job, {20: stated(TABLE_7[20]), 25: ""})
    with pytest.raises(
        CmmUqError, match=r"\[machine\] error_map: the map 'error_map_25C\.csv' has no squareness_arcsec"
    ):
        read_job(job)


def maps_job(folder: Path, squareness: dict[int, tuple[float, ...]]) -> Path:
    job = Path(shutil.copytree(ROOT / "examples" / "iota-1102-maps", folder / "maps"))
    path = job / "job.toml"
    text = path.read_text(encoding="utf-8")
    for t, given in squareness.items():
        text = text.replace(f"temperature_c = {t}.0 ", f"temperature_c = {t}.0{stated(given)} ")
    path.write_text(text, encoding="utf-8")
    return job


@pytest.mark.long
def test_the_diagnosis_of_maps_lists_their_squareness_side_by_side(tmp_path: Path) -> None:
    found = diagnose_read(read_job(maps_job(tmp_path, TABLE_7)))
    told = maps_results(found, 0)["diagnosis"]["squareness_arcsec"]
    assert {row.pop("temperature_c"): tuple(row.values()) for row in told} == TABLE_7
    (section,) = squareness_sections(found.maps)
    assert section.blocks[0].rows[-1] == ("Largest less smallest", "6", "16", "41")  # type: ignore[union-attr]
    assert not squareness_findings(found.maps)


def test_maps_with_one_squareness_were_measured_once(tmp_path: Path) -> None:
    maps = maps_of(read_job(maps_job(tmp_path, TABLE_7 | {30: TABLE_7[20]})))
    (finding,) = squareness_findings(maps)
    assert finding.why.startswith("squareness: the maps at 20, 30 °C give the same figures")


def test_maps_without_squareness_say_nothing_of_it() -> None:
    maps = maps_of(read_job(ROOT / "examples" / "iota-1102-maps"))
    assert squareness_sections(maps) == ()
    assert squareness_findings(maps) == []
