"""The command that begins a job: what it asks on a terminal, what its options say, and that it writes over nothing."""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Any

import pytest

from cmm_uq.app.cli import asking
from cmm_uq.app.cli.asking import value_of
from tests.app.cli.process import run


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
        ("artefact.lenght_mm=3", "[artefact] lenght_mm: unknown key. Did you mean 'length_mm'?"),
        ("artefacts.length_mm=3", "unknown key. Did you mean 'artefact'?"),
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
