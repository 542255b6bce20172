"""How far a machine has moved since its calibration, by its records: drawn where they say so, said where they do not."""

from __future__ import annotations

import datetime as dt
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from cmm_uq.analysis.machine.state import MachineState
from cmm_uq.app.commands.parts.drift import known_of, with_drift
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.points import Machine
from cmm_uq.laboratory.records import open_records
from cmm_uq.machine.physics.catalogue import effects
from tests.app.cli.test_due import recorded, scale
from tests.laboratory.records.histories import certificate

CALIBRATED, ON = dt.date(2026, 3, 2), dt.date(2027, 3, 2)
STATE = MachineState(Machine("1102"), effects(["scale_x", "scale_y"]), np.zeros((1, 2)), calibrated=CALIBRATED)


@pytest.fixture
def records(tmp_path: Path) -> Path:
    """One ppm a year, each known to 0.5 ppm."""
    return recorded(tmp_path, *(certificate("1102", dt.date(2021 + i, 3, 2), scale(float(i))) for i in range(6)))


def test_without_records_the_age_is_told_and_nothing_is_drawn() -> None:
    found = with_drift(STATE, "1102", ON, None, "job.toml")
    assert "365 days since the calibration is not known" in found.told
    assert not found.state.drift.any()
    assert found.state.drift_unknown == ("scale_x", "scale_y")


def test_the_word_none_is_no_records_as_in_the_other_commands(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    assert (
        with_drift(STATE, "1102", ON, "none", "job.toml").told == with_drift(STATE, "1102", ON, None, "job.toml").told
    )


def test_on_the_day_of_the_calibration_nothing_has_changed() -> None:
    assert "on the day of the measurement" in with_drift(STATE, "1102", CALIBRATED, None, "job.toml").told


def test_a_steady_drift_goes_on_by_its_rate_and_more(records: Path) -> None:
    """A year at 1 ppm a year: the rate, its uncertainty and some wandering; of scale_y there is nothing."""
    found = with_drift(STATE, "1102", ON, records, "job.toml")
    assert 1.0 < found.state.drift[0] < 3.0
    assert found.state.drift[1] == 0
    assert "They say nothing of Scale error of Y" in found.told
    later = with_drift(STATE, "1102", dt.date(2029, 3, 2), records, "job.toml")
    assert found.state.drift[0] < 0.6 * later.state.drift[0]


@pytest.mark.parametrize(
    "found", [{"interim": True, "values": scale(20.0)}, {"decision": "fail"}], ids=["check", "fail"]
)
def test_a_machine_that_its_records_find_out_of_control_measures_no_part(records: Path, found: dict[str, Any]) -> None:
    """By an interim check of the very day, or a calibration that it fails; on the day before nothing is known of it."""
    with open_records(records) as known:
        known.append("check" if "interim" in found else "report", certificate("1102", ON, **found))
    with_drift(STATE, "1102", ON - dt.timedelta(days=1), records, "job.toml")
    with pytest.raises(CmmUqError, match="the records say that the machine is overdue"):
        with_drift(STATE, "1102", ON, records, "job.toml")


def test_calibrations_of_one_month_say_nothing_of_the_season_in_another(tmp_path: Path) -> None:
    """All of March: in June more may have changed than in a year; with those of June, September and December too, less."""
    days = [dt.date(2021 + i, month, 2) for i in range(6) for month in (3, 6, 9, 12)][:21]
    rows = [certificate("1102", day, scale((day - days[0]).days / 365.25)) for day in days]
    march, june = rows[::4], CALIBRATED + dt.timedelta(days=92)
    for name, some, more in (("one", march, True), ("four", rows, False)):
        (tmp_path / name).mkdir()
        place = recorded(tmp_path / name, *some)
        there, again = (with_drift(STATE, "1102", on, place, "job.toml").state.drift[0] for on in (june, ON))
        assert bool(there > again) is more


def test_a_history_that_was_kept_gives_the_same_drift_once_more(records: Path) -> None:
    """To the bit, without the records: of the drift model's changes as :func:`change_since` has them."""
    found = with_drift(STATE, "1102", ON, records, "job.toml")
    assert found.changes is not None
    assert found.changes["scale_y.ppm"] is None
    again = with_drift(STATE, "1102", ON, None, "job.toml", kept=found.history)
    np.testing.assert_array_equal(again.state.drift, found.state.drift)
    assert (again.told, again.state.drift_unknown) == (found.told, found.state.drift_unknown)
    assert (again.changes, again.history) == (found.changes, found.history)


def test_a_history_inside_says_nothing_of_what_came_after_the_calibration(records: Path) -> None:
    sooner = replace(STATE, calibrated=dt.date(2024, 3, 2))
    kept = with_drift(sooner, "1102", ON, records, "job.toml").history
    assert kept is not None
    ((series, _),) = known_of(kept).values.values()
    assert series.value.tolist() == [0.0, 1.0, 2.0, 3.0]


@pytest.mark.parametrize(
    "content", [b"", b"{}", b"[" * 100_000, b'{"schema": "cmm-uq/machine-history/1", "adjusted": [1]}']
)
def test_what_is_no_history_is_refused(content: bytes) -> None:
    with pytest.raises(CmmUqError, match="is no history of a machine"):
        with_drift(STATE, "1102", ON, None, "job.toml", kept=content)


def test_a_machine_that_was_adjusted_since_is_refused(tmp_path: Path) -> None:
    since = certificate("1102", dt.date(2026, 9, 1), scale(0.0), adjusted_since="2026-06-01")
    kept = recorded(tmp_path, certificate("1102", CALIBRATED, scale(5.0)), since)
    with pytest.raises(CmmUqError, match="adjusted on 2026-06-01, after its calibration of 2026-03-02"):
        with_drift(STATE, "1102", ON, kept, "job.toml")
    later = replace(STATE, calibrated=dt.date(2026, 9, 1))
    assert with_drift(later, "1102", ON, kept, "job.toml").state.calibrated == dt.date(2026, 9, 1)


def test_a_machine_that_is_not_in_the_records_is_refused(records: Path) -> None:
    with pytest.raises(CmmUqError, match="1103"):
        with_drift(STATE, "1103", ON, records, "job.toml")
