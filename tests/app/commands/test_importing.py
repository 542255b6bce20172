"""A job of an export is the job of the same recording in the project's own format; what was recognised stays with it."""

from __future__ import annotations

import csv
import datetime as dt
import shutil
import tomllib
from pathlib import Path

import numpy as np
import pytest

from cmm_uq.app.commands.jobs.exchange import own_format, read_export, write_job_of_export, write_recording
from cmm_uq.app.commands.jobs.simulate import simulated_job
from cmm_uq.app.commands.reading import read_job
from cmm_uq.base.errors import CmmUqError, OutputError
from cmm_uq.base.points import Machine
from cmm_uq.certificate.results.contents import head
from cmm_uq.certificate.sections.traceability import traceability_section
from cmm_uq.jobs.importing.keys import ImportKeys
from cmm_uq.jobs.importing.recording import read_recording
from tests.conftest import ROOT
from tests.jobs.importing.exports import EXPORTS, NUMBERS, XYZ

DATED = {"date": dt.date(2026, 5, 31)}
SAMPLE = ROOT / "docs" / "import" / "samples" / "ballbar-de.csv"
HEADINGS = {"measurement": "Messung", "point": "Kugel", "x_mm": "X [mm]", "y_mm": "Y [mm]", "z_mm": "Z [mm]"}


@pytest.fixture
def german(job: Path) -> Path:
    """The example of a real recording, exported by a spreadsheet in German."""
    with (job / "ballbar.csv").open(encoding="utf-8") as file:
        rows = [row for row in csv.reader(file) if not row[0].startswith("#")]
    lines = [";".join(HEADINGS.get(name, name) for name in rows[0])]
    lines += [";".join(cell.replace(".", ",") for cell in row) for row in rows[1:]]
    (job / "export.csv").write_bytes(("Prüfer: Müller\n" + "\n".join(lines) + "\n").encode("cp1252"))
    (job / "ballbar.csv").unlink()
    text = (job / "job.toml").read_text(encoding="utf-8").replace('"ballbar.csv"', '"export.csv"')
    (job / "job.toml").write_text(text, encoding="utf-8")
    return job


def test_points_of_an_export_are_those_of_the_recording_to_the_last_bit(german: Path, iota: Path) -> None:
    found, own = read_job(german).points, read_job(iota).points
    assert np.array_equal(found.xyz, own.xyz)
    assert np.array_equal(found.measurement, own.measurement)
    assert np.array_equal(found.point, own.point)
    assert {name: values.tolist() for name, values in found.columns.items()} == {
        name: values.tolist() for name, values in own.columns.items()
    }


def test_what_was_recognised_is_in_the_results_and_on_the_certificate(german: Path, iota: Path) -> None:
    job = read_job(german)
    told = head(job)["import"]
    assert told[0]["encoding"] == "Windows-1252"
    assert told[0]["columns"]["x_mm"] == "X [mm]"
    ((label, text),) = traceability_section(job, ()).blocks[0].rows
    assert label == "Imported file"
    assert text.startswith(
        "read from export.csv (text table (CSV)): measurement from Messung, point from Kugel, x_mm from X [mm]"
    )
    assert "decimal sign: comma" in text
    assert "export.csv" in head(job)["job"]["inputs_sha256"]
    own = read_job(iota)
    assert "import" not in head(own)
    assert traceability_section(own, ()).blocks[0].rows == ()


def test_a_job_derived_from_an_export_has_its_recording_in_the_own_format(german: Path) -> None:
    text = (german / "job.toml").read_text(encoding="utf-8").replace('"export.csv"', '"export.csv"\nunit = "mm"')
    (german / "job.toml").write_text(text, encoding="utf-8")
    derived = simulated_job(read_job(german), {"seed": 1, "noise": {"coordinate_um": 1.0}})
    table = tomllib.loads(derived.inputs["job.toml"].decode())["recording"]
    assert table["file"] == "recording.csv"
    assert "unit" not in table
    assert "export.csv" not in derived.inputs
    assert derived.imported == ()
    assert derived.origin == "simulated"


@pytest.mark.parametrize("name", EXPORTS)
def test_an_export_becomes_a_recording_that_reads_back_the_same(name: str, tmp_path: Path) -> None:
    (tmp_path / name).write_bytes(EXPORTS[name]("en", "mm"))
    keys = ImportKeys(points_per_measurement=2) if name == "trace.txt" else ImportKeys()
    write_recording(tmp_path / name, read_export(tmp_path / name, keys), tmp_path / "recording.csv")
    points = read_recording((tmp_path / "recording.csv").read_bytes(), "recording.csv", Machine())
    assert points.xyz.tolist() == XYZ.tolist()
    assert list(zip(points.measurement, points.point, strict=True)) == list(NUMBERS)


def test_nothing_is_overwritten_and_nothing_half_written_is_left(tmp_path: Path) -> None:
    out = tmp_path / "recording.csv"
    out.write_text("mine")
    with pytest.raises(OutputError, match=r"recording\.csv: is there already"):
        write_recording(SAMPLE, read_export(SAMPLE), out)
    assert out.read_text() == "mine"
    assert [path.name for path in tmp_path.iterdir()] == ["recording.csv"]


def test_the_mark_of_a_simulated_recording_stays_on_it(tmp_path: Path) -> None:
    source = tmp_path / "simulated.csv"
    source.write_text("# simulated by cmm-uq 1, seed 1\nmeasurement,point,x_mm,y_mm,z_mm\n1,1,1.5,2,3\n")
    write_recording(source, read_export(source), tmp_path / "recording.csv")
    assert (tmp_path / "recording.csv").read_text().startswith("# simulated by cmm-uq 1, seed 1\nmeasurement,point,")


def test_an_export_with_a_point_that_is_there_twice_is_refused_without_a_job_too(tmp_path: Path) -> None:
    (tmp_path / "twice.csv").write_text("Measurement,Point,X [mm],Y [mm],Z [mm]\n1,1,1,2,3\n1,1,4,5,6\n")
    with pytest.raises(CmmUqError, match=r"lines 2 and 3: measurement 1, point 1, repeat 1 is there twice"):
        read_export(tmp_path / "twice.csv")


def test_digits_of_a_double_survive() -> None:
    found = read_export(SAMPLE)
    found.columns["x_mm"][:2] = (0.1 + 0.2, 1 / 3)
    points = read_recording(own_format(found), "recording.csv", Machine())
    assert points.xyz[:2, 0].tolist() == [0.1 + 0.2, 1 / 3]


def test_a_new_job_of_an_export_makes_nothing_up(tmp_path: Path) -> None:
    given = {"job": DATED, "machine": {"name": "My CMM"}, "artefact": {"U_um": 1.0, "k": 2.0, "length_mm": 400.002}}
    files = write_job_of_export("ballbar", SAMPLE, tmp_path / "job", given, ImportKeys())
    assert {"job.toml", "ballbar-de.csv"} <= set(files)
    job = read_job(tmp_path / "job")
    assert job.origin == "measured"
    assert job.facts.machine.name == "My CMM"
    assert job.facts.job.date == DATED["date"]
    assert job.facts.machine.travel_mm.x is None
    assert job.facts.artefact.u_um == 0.5
    assert job.facts.conformity == []
    assert job.facts.recording.file == "ballbar-de.csv"
    assert len(job.points) == 6


def test_a_new_job_of_an_export_needs_the_name_of_the_machine_and_whatever_its_kind_does(tmp_path: Path) -> None:
    with pytest.raises(CmmUqError, match="the machine that was measured has no name"):
        write_job_of_export("ballbar", SAMPLE, tmp_path / "job", {}, ImportKeys())
    with pytest.raises(CmmUqError, match=r"\[artefact\] blocks_mm: is missing"):
        write_job_of_export(
            "triangle", SAMPLE, tmp_path / "job", {"job": DATED, "machine": {"name": "A"}}, ImportKeys()
        )
    with pytest.raises(CmmUqError, match=r"does not say when it was measured.*--set job\.date="):
        write_job_of_export("ballbar", SAMPLE, tmp_path / "job", {"machine": {"name": "A"}}, ImportKeys())
    assert not (tmp_path / "job").exists()


def test_a_copy_of_an_export_keeps_the_keys_that_settled_it(tmp_path: Path) -> None:
    export = shutil.copy(SAMPLE, tmp_path / "e.csv")
    keys = ImportKeys(decimal=",", columns={"x_mm": "X-Istwert [mm]"})
    write_job_of_export("ballbar", Path(export), tmp_path / "job", {"job": DATED, "machine": {"name": "A"}}, keys)
    recording = read_job(tmp_path / "job").facts.recording
    assert recording.decimal == ","
    assert recording.columns == {"x_mm": "X-Istwert [mm]"}
