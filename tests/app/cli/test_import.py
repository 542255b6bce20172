"""``cmm-uq import`` and ``new --from``: what is recognised is said before anything is made of it."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

from tests.app.cli.process import run
from tests.conftest import ROOT

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
    assert 'Say decimal = "," or decimal = "."' in refused.stderr
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
