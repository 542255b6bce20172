"""``--json``: one object on standard output and nothing else; an error is one too, on standard error."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from tests.app.cli.process import run
from tests.conftest import ROOT


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("json")
    (folder / "truth.toml").write_text("seed = 1\n[noise]\ncoordinate_um = 1.0\n", encoding="utf-8")
    return folder


def test_a_simulation_says_what_it_wrote_where(folder: Path) -> None:
    job = ROOT / "examples" / "iota-1102-20C"
    done = run("simulate", job, "--truth", "truth.toml", "--out", "out", "--json", cwd=folder)
    assert (done.returncode, done.stderr) == (0, "")
    data = json.loads(done.stdout)
    assert (data["command"], data["folder"]) == ("simulate", "out")
    assert set(data["files"]) == {"job.toml", "ballbar.csv", "truth.toml"}
    manifest = json.loads((folder / "out" / "manifest.json").read_bytes())
    assert {**manifest, "folder": "out"} == data


@pytest.mark.parametrize(
    ("arguments", "problem", "where"),
    [
        (("report", "nowhere"), "no such file", str(Path("nowhere") / "job.toml")),
        (("report", "x", "--bogus"), "No such option: --bogus", None),
    ],
)
def test_an_error_is_an_object_with_problem_place_and_fix(
    folder: Path, arguments: tuple[str, ...], problem: str, where: str | None
) -> None:
    done = run(*arguments, "--json", cwd=folder)
    assert (done.returncode, done.stdout) == (2, "")
    told = json.loads(done.stderr)["error"]
    assert (told["problem"], told["where"], told["exit_code"]) == (problem, where, 2)
    assert told["fix"]
