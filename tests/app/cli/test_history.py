"""``cmm-uq history``: what is printed, written and refused."""

from __future__ import annotations

import datetime as dt
import json
import subprocess
import sys
from pathlib import Path

import pytest

from tests.app.cli.process import run
from tests.app.cli.test_due import recorded
from tests.laboratory.records.histories import certificate

ON = "2026-11-22"


def scale(value: float) -> tuple[tuple[object, ...], ...]:
    """One value, limit 8, 0.4 of its u = 0.5 from the artefact; and the size of the artefact."""
    return (
        ("scale_x.ppm", "Scale error of x", "ppm", value, 0.5, value - 1, value + 1, 0.4, 8.0),
        ("artefact.length_mm", "Length", "mm", 404.2, 0.001, 404.198, 404.202, 0.001, None),
    )


@pytest.fixture
def drifting(tmp_path: Path) -> Path:
    """Calibrated yearly, adjusted in 2023, then 1 ppm a year but for the last, 2 more."""
    values = [(2021, 5.0, None), (2022, 6.5, None), (2023, 0.0, "2023-02-20"), (2024, 1.0, None), (2025, 2.0, None),
              (2026, 5.0, None)]  # fmt: skip
    return recorded(tmp_path, *(certificate("1102", dt.date(year, 3, 2), scale(value), adjusted_since=since)
                                for year, value, since in values))  # fmt: skip


def test_every_value_has_its_change_its_trend_and_its_limit(drifting: Path) -> None:
    done = run("history", "1102", "--records", drifting, "--on", ON)
    assert (done.returncode, done.stderr) == (0, "")
    head, row, *note = done.stdout.splitlines()
    assert "k = 2" in note[0]
    assert "by the drift model" in " ".join(note)
    assert head == "Machine 1102, serial number 1102: 6 recordings up to 2026-11-22"
    assert "5.0 ± 1.0 ppm" in row
    assert "change 3.00 significant ± 0.85" in row  # 2·√(2·0.25 − 2·0.16)
    assert "a year" in row
    assert "limit 8: about 20" in row


def test_the_data_of_a_history(drifting: Path) -> None:
    data = json.loads(run("history", "1102", "--records", drifting, "--on", ON, "--json").stdout)
    assert data["schema"] == "cmm-uq/history/1"
    assert list(data["values"]) == ["scale_x.ppm"]  # a size is the artefact's, not the machine's
    value = data["values"]["scale_x.ppm"]
    assert [one["value"] for one in value["recorded"]] == [5.0, 6.5, 0.0, 1.0, 2.0, 5.0]
    assert value["change"]["u"] == pytest.approx(0.18**0.5)
    assert (value["change"]["value"], value["change"]["significant"], value["change"]["adjusted_between"]) == (
        3.0,
        True,
        False,
    )
    assert value["trend"]["count"] == 4
    assert value["trend"]["per_year"] == pytest.approx(
        1.6, abs=0.01
    )  # of 0, 1, 2, 5: (−1.5·0 − 0.5·1 + 0.5·2 + 1.5·5)/5
    assert value["crosses_limit"]["last"] == "2026-03-02"
    assert value["crosses_limit"]["day_5"] < value["crosses_limit"]["day_50"]
    assert data["machine"]["adjusted"] == ["2023-02-20"]


def test_a_change_across_an_adjustment_is_none_of_the_machine(drifting: Path) -> None:
    value = json.loads(run("history", "1102", "--records", drifting, "--on", "2023-12-31", "--json").stdout)["values"][
        "scale_x.ppm"
    ]
    assert (value["change"]["value"], value["change"]["adjusted_between"], value["change"]["significant"]) == (
        -6.5,
        True,
        False,
    )
    assert value["trend"] is None
    assert "adjusted" in run("history", "1102", "--records", drifting, "--on", "2023-12-31").stdout


def test_what_is_dated_later_does_not_count_and_is_said(drifting: Path) -> None:
    done = run("history", "Machine 1102", "--records", drifting, "--on", "2022-06-01")
    assert "2 recordings" in done.stdout
    assert "4 certificates are dated after 2022-06-01 and do not count" in done.stdout


def test_the_page_shows_a_picture_of_every_value(drifting: Path, tmp_path: Path) -> None:
    done = run("history", "1102", "--records", drifting, "--on", ON, "--out", tmp_path / "out")
    assert done.returncode == 0
    page = (tmp_path / "out" / "history.html").read_text(encoding="utf-8")
    assert page.count("<svg") == 1
    assert "Changed significantly" in page
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == [
        "history.html",
        "history.json",
        "manifest.json",
    ]
    again = run("history", "1102", "--records", drifting, "--on", ON, "--out", tmp_path / "out")
    assert (again.returncode, (tmp_path / "out" / "history.html").read_text(encoding="utf-8")) == (0, page)


def test_another_machine_is_not_written_over_it(tmp_path: Path) -> None:
    place = recorded(tmp_path, certificate("1101"), certificate("1102"))
    assert run("history", "1101", "--records", place, "--out", tmp_path / "out").returncode == 0
    assert run("history", "1102", "--records", place, "--out", tmp_path / "out").returncode == 2


@pytest.mark.parametrize("name", ["1103", "machine 1101"])
def test_a_machine_that_is_not_known_is_answered_with_those_near(drifting: Path, name: str) -> None:
    done = run("history", name, "--records", drifting)
    assert (done.returncode, done.stdout) == (2, "")
    assert "1102" in done.stderr


def test_a_history_without_a_picture_waits_for_nothing_that_draws_or_fits() -> None:
    heavy = ["matplotlib", "pandas", "scipy", "jinja2", "emcee"]
    for module in ("history", "due"):
        code = f"import sys, cmm_uq.app.commands.laboratory.{module}; print([m for m in {heavy} if m in sys.modules])"
        said = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
        assert said.stdout.strip() == "[]"
