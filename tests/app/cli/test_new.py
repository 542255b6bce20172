"""``cmm-uq new`` and ``import``: jobs begun from figures, questions and exports."""

from __future__ import annotations

import json
import subprocess
import sys
import tomllib
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

import pytest

from cmm_uq.analysis.parts.setup import plan_of, refuse_unfit
from cmm_uq.app.cli import asking
from cmm_uq.app.cli.asking import value_of
from cmm_uq.app.commands.jobs.new import put_new, write_new
from cmm_uq.app.commands.parts.new import PART
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.output import Owner
from cmm_uq.jobs.part.job import PartJob, read_part
from tests.app.cli.process import run
from tests.conftest import ROOT


def test_a_key_that_means_another_and_a_text_without_quotes_are_explained(tmp_path: Path) -> None:
    said = run("new", "sphere", "--machine", "M", "--set", "artefact.diameter_mm=25", cwd=tmp_path).stderr
    assert "Did you mean 'length_mm'? Certified length at 20 °C, of a sphere its diameter" in said
    said = run("new", "sphere", "--machine", "M", "--set", "artefact.serial=2217", cwd=tmp_path).stderr
    assert """Write --set 'artefact.serial="…"': a shell takes other quotes away""" in said
    assert not (tmp_path / "sphere").exists()


def test_it_lists_the_kinds_and_begins_one_in_a_folder_of_its_name(tmp_path: Path) -> None:
    listed = run("new", cwd=tmp_path)
    assert listed.returncode == 0
    assert {"ballbar", "shift_plate", "plan", "budget"} <= {line.split()[0] for line in listed.stdout.splitlines()}
    ended = run(
        "new", "sphere", "--machine", "Bridge 7", "--serial", "12", "--set", "artefact.length_mm=30", cwd=tmp_path
    )
    assert ended.returncode == 0
    assert ended.stderr == ""
    told = tomllib.loads((tmp_path / "sphere" / "job.toml").read_text(encoding="utf-8"))
    assert (told["machine"]["name"], told["machine"]["serial"], told["artefact"]["length_mm"]) == ("Bridge 7", "12", 30)
    again = run("new", "sphere", cwd=tmp_path)
    assert again.returncode == 2
    assert "nothing is overwritten" in again.stderr


@pytest.mark.parametrize(
    ("setting", "told"),
    [
        ("artefact", "names no key of a table"),
        ("artefact..length_mm=3", "names no key of a table"),
        ("artefact.lenght_mm=3", "cmm-uq: --set artefact.lenght_mm: unknown key. Did you mean 'length_mm'?"),
        ("artefacts.length_mm=3", "cmm-uq: --set artefacts: unknown key. Did you mean 'artefact'?"),
        ("artefact.certificate.fil=x.csv", "cmm-uq: --set artefact.certificate.fil: unknown key. Did you mean 'file'?"),
        ("machine.travel_mm.w=[0,1]", "cmm-uq: --set machine.travel_mm.w: unknown key. Known: x, y, z"),
    ],
)
def test_a_wrong_setting_is_refused_and_nothing_is_written(setting: str, told: str, tmp_path: Path) -> None:
    ended = run("new", "sphere", "--set", setting, cwd=tmp_path)
    assert ended.returncode == 2
    assert told in ended.stderr
    assert list(tmp_path.iterdir()) == []


def test_a_setting_is_a_value_of_toml_or_a_text() -> None:
    assert value_of("3") == 3
    assert value_of("{ x = [0, 900] }") == {"x": [0, 900]}
    assert value_of('"3"') == "3"
    assert value_of("A Ltd") == "A Ltd"


def test_the_answers_are_what_differs_from_the_defaults(monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[str] = []
    said = {
        "Machine": "Bridge 7", "Number of its certificate": "K 12", "Certified length or diameter in mm": "30.001",
        "Its travel, lowest and highest reading in mm": "{ x = [0, 500], y = [0, 500], z = [-400, 0] }",
        "Limit in µm (ISO 10360-5:2010)": "2.5",
    }  # fmt: skip

    def prompt(question: str, default: str, **_: Any) -> str:
        asked.append(question)
        return said.get(question, default)

    monkeypatch.setattr(asking.typer, "prompt", prompt)
    assert asking.job_answers("sphere") == {
        "machine": {"name": "Bridge 7", "travel_mm": {"x": [0, 500], "y": [0, 500], "z": [-400, 0]}},
        "artefact": {"length_mm": 30.001, "certificate": {"number": "K 12"}},
        "conformity": {"limit_um": 2.5},
    }
    assert set(said) <= set(asked)
    assert "Customer" in asked


SAMPLE = ROOT / "docs" / "import" / "samples" / "ballbar-de.csv"


def test_import_shows_what_is_recognised_and_writes_the_own_format(tmp_path: Path) -> None:
    shown = run("import", SAMPLE, "--out", tmp_path / "recording.csv")
    assert shown.returncode == 0
    rows = [line.split(maxsplit=2) for line in shown.stdout.splitlines()]
    assert ["Decimal", "sign", "comma"] in rows
    assert ["Column", "x_mm", "X-Istwert [mm]"] in rows
    assert (tmp_path / "recording.csv").read_text().splitlines()[:2] == [
        "measurement,point,x_mm,y_mm,z_mm",
        "1,1,100.0213,250.0044,-120.0018",
    ]
    told = json.loads(run("import", SAMPLE, "--json").stdout)
    assert told["columns"]["point"] == "Kugel"


def test_an_ambiguity_ends_with_the_key_that_settles_it_and_exit_code_2(tmp_path: Path) -> None:
    export = tmp_path / "e.csv"
    export.write_text("Messung;Kugel;X [mm];Y [mm];Z [mm]\n1;1;1,234;2,345;3,456\n")
    refused = run("import", export)
    assert refused.returncode == 2
    assert refused.stdout == ""
    assert 'Say --key decimal="," or --key decimal="."' in refused.stderr
    assert run("import", export, "--key", "decimal=,").returncode == 0
    unknown = run("import", export, "--key", "dezimal=,")
    assert unknown.returncode == 2
    assert "--key dezimal" in unknown.stderr


def test_a_text_table_is_read_without_the_libraries_of_workbooks() -> None:
    code = (
        "import sys; from pathlib import Path; from cmm_uq.app.commands.jobs.exchange import read_export; "
        f"read_export(Path({str(SAMPLE)!r})); print(sorted({{'pandas', 'openpyxl', 'defusedxml'}} & set(sys.modules)))"
    )
    assert subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout == "[]\n"


def test_new_from_an_export_shows_it_first(tmp_path: Path) -> None:
    made = run(
        "new", "ballbar", tmp_path / "job", "--from", SAMPLE, "--machine", "My CMM", "--set", "job.date=2026-05-31"
    )
    assert made.returncode == 0
    assert made.stdout.index("Column x_mm") < made.stdout.index("job.toml")
    assert "ballbar-de.csv" in made.stdout


LINES = {
    "1 - osa X": "along X from 50,600,-350",
    "LÄGE 1 (längs X)": "along Y from 450,200,-350",
    "Linha 1": "along Z from 1,2,3",
    'the "long" one': "from 0,0,0 to 300,400,0",
}


def lengths_of(lines: Iterable[str]) -> str:
    rows = [f"{name};{at};{at}.001;{at}.002" for name in lines for at in (50, 150, 400, 600, 800)]
    return "\n".join(["Position;Nominal [mm];Actual 1 [mm];Actual 2 [mm]", *rows, ""])


def test_lines_of_any_name_stand_in_a_job_that_can_be_read(tmp_path: Path) -> None:
    export = tmp_path / "lengths.csv"
    export.write_text(lengths_of(name.replace('"', "'") for name in LINES), encoding="utf-8")
    said = {name.replace('"', "'"): place for name, place in LINES.items()}
    options = [option for name, place in said.items() for option in ("--line", f"{name}={place}")]
    made = run(
        "new",
        "gauge_blocks",
        "job",
        "--from",
        export,
        "--machine",
        "M",
        "--set",
        "job.date=2026-05-31",
        *options,
        cwd=tmp_path,
    )
    assert made.returncode == 0, made.stderr
    told = tomllib.loads((tmp_path / "job" / "job.toml").read_text(encoding="utf-8"))
    assert told["recording"]["lines"] == said
    assert run("check", "job", cwd=tmp_path).returncode == 0


def test_keys_within_tables_are_set_and_the_certificate_is_laid_beside_the_export(tmp_path: Path) -> None:
    certificate = tmp_path / "mine" / "gauge.csv"
    certificate.parent.mkdir()
    certificate.write_bytes((ROOT / "docs" / "import" / "samples" / "step-gauge-certificate.csv").read_bytes())
    rows = [f"{m},{p},{20 * (p - 1)},{100 * m},-50" for m in (1, 2) for p in (1, 2, 3, 4)]
    export = tmp_path / "export.csv"
    export.write_text("\n".join(["measurement,point,x_mm,y_mm,z_mm", *rows, ""]))
    keys = (
        "job.date=2026-05-31",
        "artefact.certificate.number=K 7",
        "artefact.certificate.file=mine/gauge.csv",
        "machine.travel_mm.x=[0, 900]",
        "machine.travel_mm.y=[0, 900]",
        "machine.travel_mm.z=[-400, 0]",
    )
    settings = [option for key in keys for option in ("--set", key)]
    made = run("new", "step_gauge", "job", "--from", export, "--machine", "M", *settings, cwd=tmp_path)
    assert made.returncode == 0, made.stderr
    told = tomllib.loads((tmp_path / "job" / "job.toml").read_text(encoding="utf-8"))
    assert told["artefact"]["certificate"] == {"number": "K 7", "file": "gauge.csv"}
    assert told["machine"]["travel_mm"] == {"x": [0, 900], "y": [0, 900], "z": [-400, 0]}
    assert (tmp_path / "job" / "gauge.csv").read_bytes() == certificate.read_bytes()


def test_all_that_is_missing_is_told_at_once(tmp_path: Path) -> None:
    export = str(ROOT / "docs" / "tutorial" / "ballbar-export.xlsx")
    named = ["--machine", "CMM 3", "--set", "job.date=2026-05-31"]
    for options, missing in (([], ("--machine", "job.date")), (named, ("artefact.blocks_mm", "artefact.cylinders_mm"))):
        ended = run("new", "triangle", "my-job", "--from", export, *options, cwd=tmp_path)
        assert ended.returncode == 2
        assert all(one in ended.stderr for one in missing), ended.stderr
    assert not (tmp_path / "my-job").exists()


def test_a_value_and_a_key_within_it_are_refused(tmp_path: Path) -> None:
    both = ("--set", "artefact.certificate.number=7", "--set", "artefact.certificate={ date = 2026-01-02 }")
    ended = run("new", "sphere", *both, cwd=tmp_path)
    assert ended.returncode == 2
    assert "artefact.certificate has a value, and artefact.certificate.number lies within it" in ended.stderr


def test_one_axis_of_a_travel_leaves_the_others_an_example(tmp_path: Path) -> None:
    assert run("new", "sphere", "--set", "machine.travel_mm.x=[0, 300]", cwd=tmp_path).returncode == 0
    text = (tmp_path / "sphere" / "job.toml").read_text(encoding="utf-8")
    (line,) = (line for line in text.splitlines() if line.startswith("travel_mm"))
    assert line.startswith("travel_mm = { x = [0, 300], y = [0.0, 1000.0], z = [-600.0, 0.0] }  # EXAMPLE")


def test_what_would_be_no_toml_is_not_written(tmp_path: Path) -> None:
    with pytest.raises(CmmUqError, match=r"job\.toml: would be no valid TOML, and is not written: Expected '='"):
        put_new(tmp_path / "job", Owner("new", "job"), {"job.toml": b"lines = { 1 - osa X = 3 }", "a.csv": b""})
    assert list(tmp_path.iterdir()) == []


CERTIFICATE = ROOT / "examples" / "part-plate-simulated" / "machine" / "certificate-simulated.pdf"
BEGIN = ["Shaft", "D 7", "11.5e-6", str(CERTIFICATE), "3", "0 0 -120", "0.2"]


def seat(name: str, x: float) -> list[str]:
    """A cylinder about the x axis."""
    return [name, "cylinder", f"{x} 0 0", "1 0 0", "30", "n", "20", "24"]


def plane(name: str, at: str, normal: str) -> list[str]:
    return [name, "plane", at, normal, "8", "8", "9"]


def said(monkeypatch: pytest.MonkeyPatch, answers: list[str]) -> list[str]:
    """Answer every question; what was asked."""
    asked: list[str] = []
    given: Iterator[str] = iter(answers)

    def prompt(question: str, default: str, **_: object) -> str:
        asked.append(question)
        return next(given, default)

    monkeypatch.setattr("typer.prompt", prompt)
    return asked


def job_of(folder: Path) -> PartJob:
    write_new(PART, folder, {}, answers=asking.part_answers())
    job = read_part(folder)
    refuse_unfit(job)
    return job


def test_a_shaft_described_at_the_terminal_is_a_sound_job(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    features = [*seat("A", 0), *seat("B", 200), *seat("gear", 100), *plane("end", "-10 0 0", "-1 0 0"),
                *plane("key", "150 0 15", "0 0 1"), ""]  # fmt: skip
    runout, size = ["1", "total_runout", "gear", "A-B", "0.02"], ["2", "size", "gear", "29.9", "30.1"]
    tolerances = [*runout, *size, "3", "x", "gear", "", "99", "", ""]
    said(monkeypatch, [*BEGIN, *features, "A-B, end, key", *tolerances])
    job = job_of(tmp_path / "shaft")
    plan = plan_of(job)
    assert [one.name for one in plan.features] == ["A", "B", "gear", "end", "key"]
    assert [(one.what, one.datums, one.lower, one.upper) for one in plan.characteristics] == [
        ("total_runout", ("A-B",), None, 0.02), ("size", (), 29.9, 30.1), ("x", (), 99.0, None)]  # fmt: skip
    assert plan.alignment.datums == ("A-B", "end", "key")
    assert job.machine_files["machine/certificate-simulated.pdf"] == CERTIFICATE.read_bytes()
    assert job.facts.stylus[0].diameter_mm == 3.0


def test_an_answer_that_no_reader_would_take_is_asked_for_again(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A certificate that is not there, a word for a number, too few points, loose datums, a size of a plane."""
    begin = [*BEGIN[:3], "nowhere.pdf", *BEGIN[3:4], "three", *BEGIN[4:]]
    few = ["A", "circel", "circle", "0 0", "0 0 0", "0 0 1", "30", "perhaps", "y", "2"]
    again = ["circle", "0 0 0", "0 0 1", "30", "y", "8", "A", "top", *plane("top", "0 0 0", "0 0 1")[1:], ""]
    aligned = ["top, A", "best fit"]
    size = ["1", "size", "top", "1", "2", "size", "A", "29.9", "30.1", ""]
    said(monkeypatch, [*begin, *few, *again, *aligned, *size])
    job = job_of(tmp_path / "part")
    told = " ".join(capsys.readouterr().out.split())
    assert [(one.facts.name, len(one.points)) for one in job.features] == [("A", 8), ("top", 9)]
    for words in ("'three' is not understood", "'circel' is none of them. Did you mean 'circle'", "'perhaps' is not",
                  "2 points are too few for a circle", "'A' is there already", "leave free rotation about z",
                  "a size is of a circle or sphere or cylinder, and 'top' is a plane"):  # fmt: skip
        assert words in told


def test_where_no_feature_is_named_the_job_is_that_of_the_example(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    asked = said(monkeypatch, [*BEGIN, ""])
    job = job_of(tmp_path / "plate")
    assert [one.facts.name for one in job.features] == ["A", "B", "C", "bore"]
    assert asked[-1] == "Name of a feature, empty for no more"
