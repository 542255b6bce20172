"""``cmm_uq.due`` and ``cmm_uq.history``: tables of what the commands print."""

from __future__ import annotations

import datetime as dt
from pathlib import Path

import pytest

import cmm_uq
from tests.app.cli.test_due import recorded
from tests.laboratory.records.histories import certificate


@pytest.fixture
def place(tmp_path: Path) -> Path:
    """Two certificates of one machine, 2 ppm apart."""
    values = (
        (("scale_x.ppm", "Scale error of x", "ppm", value, 0.5, value - 1, value + 1, 0.4, 8.0),)
        for value in (1.0, 3.0)
    )
    days = (dt.date(2025, 3, 2), dt.date(2026, 3, 2))
    return recorded(tmp_path, *(certificate("1102", day, value) for day, value in zip(days, values, strict=True)))


def test_what_is_due_is_a_table(place: Path, tmp_path: Path) -> None:
    found = cmm_uq.due(records=place, on="2026-11-22")
    assert repr(found) == "<Due on 2026-11-22: 0 overdue, 0 due, 2 later, 0 unknown>"
    assert found.frame.loc[0, ["serial", "state", "due"]].tolist() == ["1102", "later", "2027-03-02"]
    assert "1102" in found._repr_html_()
    assert set(found.write(tmp_path / "out")) == {"due.html", "due.json", "manifest.json"}


def test_one_machine_may_be_named_alone(place: Path) -> None:
    found = cmm_uq.due("1102", records=place, on=dt.date(2027, 3, 3), within=dt.timedelta(days=1))
    assert found.frame["serial"].tolist() == ["1102"]
    assert found.frame["state"].tolist() == ["overdue"]


def test_a_history_has_its_values_and_all_that_was_recorded(place: Path, tmp_path: Path) -> None:
    found = cmm_uq.history("1102", records=place, on="2026-11-22")
    assert repr(found) == "<History of 1102: 2 recordings, 1 values>"
    row = found.values.loc["scale_x.ppm"]
    assert (row["value"], row["change"], row["u_change"]) == (3.0, 2.0, pytest.approx(0.18**0.5))
    assert row["per_year"] == pytest.approx(2 * 365.2425 / 365)
    assert dt.date(2026, 3, 2) < row["early"] < row["middle"]
    assert found.recorded["value"].tolist() == [1.0, 3.0]
    assert "Scale error of x" in found._repr_html_()
    assert set(found.write(tmp_path / "out")) == {"history.html", "history.json", "manifest.json"}
