"""What is wrong with a job before it is computed, and exports that are imported."""

from __future__ import annotations

import csv
import datetime as dt
import json
import re
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

import numpy as np
import pytest

from cmm_uq.app.commands.estimation import decision
from cmm_uq.app.commands.jobs.check import Lack, Problem, check_job, in_lines
from cmm_uq.app.commands.jobs.exchange import own_format, read_export, write_job_of_export, write_recording
from cmm_uq.app.commands.jobs.simulate import simulated_job
from cmm_uq.app.commands.model import recorded_model
from cmm_uq.app.commands.reading import read_job
from cmm_uq.app.commands.report import write_report
from cmm_uq.base.errors import CmmUqError, OutputError
from cmm_uq.base.languages.translation import Code, translated
from cmm_uq.base.points import Machine
from cmm_uq.base.values import replace
from cmm_uq.certificate.clauses import formal_warnings, traceability_section
from cmm_uq.certificate.results.contents import head
from cmm_uq.jobs.importing.format import ImportKeys
from cmm_uq.jobs.recording.own import read_recording
from tests.app.cli.process import run
from tests.conftest import MACHINE_JOBS, ROOT
from tests.jobs.importing.exports import EXPORTS, NUMBERS, XYZ


@pytest.fixture
def gauge(tmp_path: Path) -> Path:
    return Path(shutil.copytree(ROOT / "examples" / "step-gauge-simulated", tmp_path / "job"))


def change(path: Path, pattern: str, replacement: str) -> int:
    """Line of the first match, which is replaced."""
    text = path.read_text(encoding="utf-8")
    match = re.search(pattern, text, re.MULTILINE)
    assert match is not None
    path.write_text(text[: match.start()] + replacement + text[match.end() :], encoding="utf-8")
    return text.count("\n", 0, match.start()) + 1


@pytest.mark.parametrize("folder", MACHINE_JOBS, ids=lambda folder: folder.name)
def test_an_example_is_sound_unless_it_is_still_to_be_measured(folder: Path) -> None:
    found = check_job(folder)
    if folder.name.startswith("plan-"):
        (problem,) = found.problems
        assert problem.problem == "no such file"
    else:
        assert found.problems == ()


def test_an_export_is_not_refused_beside_a_wrong_key_for_being_no_recording_of_our_own(tmp_path: Path) -> None:
    export, toml = ROOT / "docs" / "tutorial" / "ballbar-export.xlsx", tmp_path / "job" / "job.toml"
    given = {
        "machine": {"name": "CMM 3"},
        "job": {"date": dt.date(2026, 5, 31)},
        "artefact": {"certificate": {"issuer": "accredited"}},
    }
    write_job_of_export("ballbar", export, toml.parent, given, ImportKeys())
    change(toml, '"accredited"', '"NIST"')
    (problem,) = check_job(toml.parent).problems
    assert problem.key == "[artefact] certificate.issuer"


def test_everything_that_is_wrong_is_told_at_once_with_line_key_and_fix(gauge: Path) -> None:
    toml, csv = gauge / "job.toml", gauge / "recording.csv"
    lines = {
        "chain": change(toml, r"^chain = .*", 'chain = "XY"'),
        "u_mm": change(toml, r"^u_um = ", "u_mm = "),
        "effects": change(toml, r'^effects = \["scale_x", ', 'effects = ["scale", '),
        "mpe": change(toml, r"^mpe = .*", 'mpe = "4 per 100"'),
        "reference": change(csv, r"^1,2,1,([^,]*),([^,]*),([^,]*),140", r"1,2,1,1,2,3,x"),
        "row": change(csv, r"^1,4,1,.*", "1,4,1,2"),
    }
    problems = check_job(gauge).problems
    assert {(Path(one.file).name, one.line, one.key) for one in problems} == {
        ("job.toml", lines["chain"], "[machine] chain"),
        ("job.toml", lines["u_mm"], "[artefact] u_mm"),
        ("job.toml", lines["mpe"], "[[conformity]] 1 mpe"),
        ("job.toml", lines["effects"], "[model] effects"),
        ("recording.csv", lines["reference"], "reference_mm"),
        ("recording.csv", lines["row"], ""),
    }
    told = {one.key: one.fix for one in problems}
    assert told["[model] effects"] == "Did you mean 'scale_x', 'scale_y', 'scale_z'?"
    assert told["[artefact] u_mm"] == "Give u_um = 1000 · u_mm"


@pytest.mark.parametrize(
    ("pattern", "replacement", "told"),
    [
        (r"^standard = .*", 'standard = "ISO 10360-5:2010"', "is not decided on a step_gauge"),
        (r"^effects = .*", 'effects = ["thermal_scale_x"]', "thermal_scale_x needs the column temp_x_c"),
        (r"^file = .*", 'file = "gone.csv"', "no such file"),
        (r'^origin = "simulated"', 'origin = "measured"', ""),
        (r'^kind = "step_gauge"', 'kind = "plate"', "reference_x_mm"),
        (r"^u_um = .*", "u_um = 0.0", "needs the uncertainty"),
    ],
)
def test_what_stops_report_stops_check_and_nothing_else_does(
    pattern: str, replacement: str, told: str, gauge: Path, tmp_path: Path
) -> None:
    change(gauge / "job.toml", pattern, replacement)
    found = check_job(gauge)
    if not told:
        assert found.sound
        return
    with pytest.raises(CmmUqError):
        write_report(gauge, tmp_path / "report")
    assert any(told in one.problem for one in found.problems)


def test_a_decision_that_a_reading_too_few_forbids_stops_check_and_stops_report_before_it_samples(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    job = Path(shutil.copytree(ROOT / "examples" / "axis-runs-simulated", tmp_path / "job"))
    change(job / "recording.csv", r"^1,2,1,.*\n", "")
    (problem, _) = check_job(job).problems
    assert problem.problem.startswith("target 180 mm has 0 readings in direction +1 of repeat 1")
    assert (problem.key, problem.line) == (
        "[[conformity]] 1 standard",
        change(job / "job.toml", r"^standard = ", "standard = "),
    )
    monkeypatch.setattr("cmm_uq.app.commands.report.sample_with_noise", lambda *_: pytest.fail("sampled"))
    with pytest.raises(CmmUqError, match=re.escape(problem.problem)):
        write_report(job, tmp_path / "report")


def test_runs_are_decided_where_the_place_of_another_reading_is_damaged(tmp_path: Path) -> None:
    """Runs of rotations have points of their own, more than readings: these could not be put back for decisions."""
    job = Path(shutil.copytree(ROOT / "examples" / "axis-runs-simulated", tmp_path / "job"))
    expected = decision(read_job(job), *recorded_model(read_job(job)), 1)
    change(job / "recording.csv", r"^(2,3,1,[^,]*,[^,]*),[^,]*", "2,3,1,315.00000,600.00000,-0.001")
    read = read_job(job)
    model, findings = recorded_model(read)
    assert [finding.set_aside for finding in findings] == [True]
    assert decision(read, model, findings, 1).value_um == pytest.approx(expected.value_um, rel=1e-9)
    assert check_job(job).sound


def test_what_the_certificate_warns_of_is_told_with_the_key_that_mends_it(iota: Path) -> None:
    found = check_job(iota)
    (missing,) = [text for text in formal_warnings(read_job(iota)) if text.startswith("Not complete")]
    keys = [one.key for one in found.warnings if "ISO/IEC 17025" in one.problem]
    assert keys == re.findall(r": (\[[a-z.]+\] [a-z]+)", missing)
    assert "[machine] serial" in keys
    assert any("repeats the coordinates of measurement 14" in one.problem for one in found.warnings)


@pytest.mark.parametrize(
    ("where", "expected"),
    [
        ("jobs/a/job.toml line 3: [artefact] u_um", ("jobs/a/job.toml", 3, "[artefact] u_um")),
        ("jobs/a/job.toml: [recording] file", ("jobs/a/job.toml", None, "[recording] file")),
        ("a b/rec.csv line 12, column x_mm", ("a b/rec.csv", 12, "x_mm")),
        ("rec.csv lines 3 and 9", ("rec.csv", 3, "")),
        ("rec.csv", ("rec.csv", None, "")),
    ],
)
def test_the_place_of_a_message_is_taken_apart(where: str, expected: tuple[str, int | None, str]) -> None:
    found = Problem.of(CmmUqError("is wrong", where=where))
    assert (found.file, found.line, found.key) == expected


def test_the_command_tells_several_jobs_as_text_and_as_json(iota: Path, gauge: Path) -> None:
    (gauge / "recording.csv").unlink()
    ended = run("check", iota, gauge)
    assert ended.returncode == 2
    assert f"SOUND  {iota}: nothing would stop report" in ended.stdout
    assert f"STOPS  {gauge}: 1 problem" in ended.stdout
    data = json.loads(run("check", "--json", gauge).stdout)["jobs"]
    assert [one["sound"] for one in data] == [False]
    assert data[0]["problems"][0]["fix"].startswith("Put it beside job.toml")
    assert run("check", "-q", iota).returncode == 0


@pytest.mark.parametrize("command", ["check", "new"])
def test_a_command_that_does_not_compute_loads_nothing_heavy(command: str, iota: Path, tmp_path: Path) -> None:
    program = (
        "import sys; sys.argv = ['cmm-uq', *sys.argv[1:]]\n"
        "import cmm_uq.app.cli.commands as c\nc.run()\n"
        "import cmm_uq.laboratory.records.place, cmm_uq.laboratory.records.facts\n"
        "heavy = ['matplotlib', 'scipy.stats', 'emcee', 'pandas', 'scipy.optimize._optimize', 'jinja2', 'typst']\n"
        "heavy += ['sqlalchemy', 'alembic']\n"
        "print([name for name in heavy if name in sys.modules])"
    )
    asked = [str(iota), "-q"] if command == "check" else ["step_gauge", str(tmp_path / "new"), "-q"]
    ended = subprocess.run(
        [sys.executable, "-c", program, command, *asked], capture_output=True, text=True, check=True, cwd=ROOT
    )
    assert ended.stdout.strip() == "[]"


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


def test_rows_with_the_same_fault_are_told_in_one_line_with_the_rows(tmp_path: Path) -> None:
    shutil.copytree(ROOT / "examples" / "iota-1102-20C", tmp_path / "job")
    path = tmp_path / "job" / "ballbar.csv"
    rows = path.read_text(encoding="utf-8").splitlines()
    for line in (4, 5, 6, 9, 11):
        cells = rows[line - 1].split(",")
        cells[2] = f"n/a {line}"
        rows[line - 1] = ",".join(cells)
    path.write_text("\n".join(rows), encoding="utf-8")
    found = check_job(tmp_path / "job")
    assert [one.line for one in found.problems] == [4, 5, 6, 9, 11]  # each by itself for programs
    (told,) = in_lines(found.problems)
    assert told.startswith(f"{path} lines 4–6, 9, 11: ")
    assert "'n/a 4' is not a number, and 4 more alike. Measure the point again" in told


def test_what_differs_stays_apart() -> None:
    one, other = Problem("'a' is not a number", "r.csv", 4, "x_mm"), Problem("'a' is not a number", "r.csv", 5, "y_mm")
    key = Problem("unknown key", "job.toml", 4, "[job] a"), Problem("unknown key", "job.toml", 5, "[job] a")
    assert in_lines((one, other, *key)) == tuple(map(str, (one, other, *key)))


@pytest.mark.parametrize(
    ("name", "told"), [("export.xlsx", "cmm-uq new KIND my-job --from FILE"), ("c.pdf", "cmm-uq verify FILE")]
)
def test_a_file_in_the_place_of_a_job_is_answered_with_what_to_do(tmp_path: Path, name: str, told: str) -> None:
    (tmp_path / name).write_bytes(b"x")
    with pytest.raises(CmmUqError, match=told):
        read_job(tmp_path / name)
    assert told in str(check_job(tmp_path / name).problems[0])


def test_what_a_certificate_lacks_is_told_in_one_line_with_every_key() -> None:
    found = check_job(ROOT / "examples" / "iota-1102-20C")
    lacking = [one for one in found.warnings if one.problem.startswith("not stated: ")]
    (told,) = [line for line in found.lines[1] if "not stated: " in line]
    assert len(lacking) > 5
    of_tests = {one.key for one in found.warnings if "will be no complete test" in one.problem}
    others = [one for one in found.warnings if one not in lacking and one.key not in of_tests]
    assert len(found.lines[1]) == len(others) + len(of_tests) + 1
    for one in lacking:
        table, _, key = one.key.partition(" ")
        assert re.search(rf"{re.escape(table)} [^;]*\b{key}\b", told)


@pytest.mark.parametrize("code", ["en", "de", "fr", "ja"])
def test_what_a_statement_lacks_is_one_line_in_any_language(gauge: Path, code: Code) -> None:
    """Lines of the uncertainty with their keys together, all else, the calibration's key in [artefact] too, in its words."""
    change(gauge / "job.toml", r"^\[test_uncertainty.negligible\]\n(\w+ = .*\n)+", "")
    change(gauge / "job.toml", r"^u_um = .*$", "u_um = 0.0")
    change(gauge / "job.toml", r"^mpe = .*$", 'mpe = { a_um = 4.0, k = 100.0 }\nrule = "simple"')
    lacks = [one.lack for one in check_job(gauge).warnings if one.lack]
    keys = [one.condition.key for one in lacks if one.condition.key]
    assert keys == ["u_cte_per_k", "u_temperature_k", "u_alignment_um", "u_fixturing_um"]
    assert [
        one
        for one in lacks
        if "calibration of the artefact is neither" in one.what and "(u_um in [artefact]" in one.what
    ]
    said = [
        Lack(
            one.statement, translated(one.what, code), replace(one.condition, line=translated(one.condition.line, code))
        )
        for one in lacks
    ]
    (told,) = in_lines([Problem(str.__str__(one.what), "job.toml", key="[[conformity]] 1", lack=one) for one in said])
    named = ", ".join(str.__str__(one.condition.line) for one in said if one.condition.key)
    assert f"uncertainty of {named} ({', '.join(keys)} in [test_uncertainty], or declared" in told
    for one in said:
        assert bool(one.condition.key) != (str.__str__(one.what) in told)
