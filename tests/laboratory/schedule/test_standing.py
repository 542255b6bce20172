"""What stands is said by every run with its age, and is in the exit code once a week of the calendar; no clock hides it."""

from __future__ import annotations

import datetime as dt
import json
import os
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from cmm_uq.base.errors import CmmUqError, OutputError
from cmm_uq.laboratory.schedule.jobs import JobFolder
from cmm_uq.laboratory.schedule.notices import Notice
from cmm_uq.laboratory.schedule.schedulers import starts
from cmm_uq.laboratory.schedule.state import FolderState, Problems, last_run, remember_run, turn_at
from tests.laboratory.schedule.runs import Jobs, made
from tests.laboratory.schedule.told import notice

DAY = dt.timedelta(days=1)
MONDAY = dt.datetime(2026, 11, 23, 6, 15, tzinfo=dt.UTC)
Zone = Callable[[str], None]


@pytest.fixture
def zone(monkeypatch: pytest.MonkeyPatch) -> Iterator[Zone]:
    """Sets the time zone of this computer, as its users do."""
    if not hasattr(time, "tzset"):
        pytest.skip("Windows has one time zone for all programs")

    def hang(name: str) -> None:
        monkeypatch.setenv("TZ", name)
        time.tzset()

    yield hang
    monkeypatch.undo()
    time.tzset()


@pytest.fixture
def jobs(tmp_path: Path, zone: Zone) -> Jobs:
    """One job that fails, one that passes; nobody is told but by exit codes."""
    zone("UTC")
    made(tmp_path, "a", "fail")
    made(tmp_path, "b")
    return Jobs(tmp_path, told=False, now=MONDAY, settings={"quiet_s": 0})


def standing(jobs: Jobs) -> list[tuple[str, int, int]]:
    """What a run said that stands, for how many days, and how it counts."""
    lines = [line for line in jobs.lines if {"due", "standing"} & line.keys() and "run" not in line]
    return [(line.get("due") or line["standing"], line["days"], line["exit_code"]) for line in lines]


def test_without_anybody_to_tell_a_fault_is_in_the_exit_code_when_it_is_new_and_then_once_a_week(jobs: Jobs) -> None:
    codes = []
    for day in range(22):
        jobs.now = MONDAY + day * DAY
        codes.append(jobs.run())
        if day:
            assert standing(jobs) == [("a", day, codes[-1])]
        assert jobs.lines[-1]["standing"] == 1
    assert [day for day, code in enumerate(codes) if code] == [0, 7, 14, 21]


def test_one_that_is_first_told_in_the_middle_of_a_week_comes_again_with_the_first_run_of_the_next(jobs: Jobs) -> None:
    made(jobs.root, "a", "1,2")
    codes = []
    for day in range(15):
        jobs.now = MONDAY + day * DAY
        if day == 3:
            made(jobs.root, "b", "fail")
        codes.append(jobs.run())
    assert [day for day, code in enumerate(codes) if code] == [3, 7, 14]


def test_runs_once_a_week_say_what_stands_each_time_also_over_a_change_of_clocks_and_after_a_late_one(
    jobs: Jobs, zone: Zone
) -> None:
    """Seven days are 167 hours in spring, and from a late start to the next one in time less than seven days."""
    zone("Europe/Berlin")
    for begun in (
        "2026-03-23T06:15+01:00",
        "2026-03-30T06:15+02:00",
        "2026-04-07T09:00+02:00",
        "2026-04-13T06:15+02:00",
    ):
        jobs.now = dt.datetime.fromisoformat(begun).astimezone(dt.UTC)
        assert jobs.run() == 1


def test_with_strict_it_is_in_every_exit_code_while_it_stands(jobs: Jobs) -> None:
    assert [jobs.run(strict=True) for _ in range(3)] == [1, 1, 1]
    assert jobs.run() == 0
    made(jobs.root, "a", "1,2")
    assert jobs.run(strict=True) == 0


def test_a_fault_that_is_mended_stands_no_longer_and_one_that_comes_back_is_new(jobs: Jobs) -> None:
    codes = []
    for word in ("fail", "1,2", "fail\n\n"):
        made(jobs.root, "a", word)
        codes.append(jobs.run())
        assert standing(jobs) == []  # what was reported now is told by its own line
    assert codes == [1, 0, 1]


def test_errors_are_2_in_every_run_and_say_for_how_long(jobs: Jobs) -> None:
    def refuse(job: JobFolder) -> None:
        if job.id == "b":
            raise CmmUqError("no such file", where="points.csv")

    jobs.before = refuse
    for day in range(9):
        jobs.now = MONDAY + day * DAY
        assert jobs.run() == 2
        (line,) = [line for line in jobs.lines if line.get("state") == "refused"]
        assert (line["since"], line["days"]) == ("2026-11-23T06:15:00Z", day)


def told_state(jobs: Jobs) -> list[Path]:
    return sorted((jobs.out / ".scheduled" / "sent").glob("*.json"))


@pytest.mark.parametrize("content", [
    None, b"", b"{", b"[]", b'{"at": "yesterday"}', b"\xff\x00", b'{"at": "2026-11-23T06:15:00"}', b"[" * 100_000,
    b'{"at": "2027-12-28T06:15:00Z"}', b'{"at": "1990-01-01T00:00:00Z", "first": "9999-12-31T23:59:59Z"}',
])  # fmt: skip
def test_whatever_becomes_of_what_was_remembered_no_fault_is_forgotten(jobs: Jobs, content: bytes | None) -> None:
    """Lost, cut off, somebody else's, of a clock that is ahead: it is told once more, and remembered anew."""
    assert jobs.run() == 1
    (path,) = told_state(jobs)
    jobs.now += DAY
    path.unlink() if content is None else path.write_bytes(content)
    assert jobs.run() == 1
    assert jobs.run() == 0
    assert [path.name for path in told_state(jobs)] == [path.name]


def test_where_nothing_can_be_remembered_every_run_tells_and_says_why(jobs: Jobs) -> None:
    (jobs.out / ".scheduled").mkdir(parents=True)
    (jobs.out / ".scheduled" / "sent").write_text("a file where the folder belongs")
    assert [jobs.run(), jobs.run()] == [3, 3]


def test_a_run_that_ended_in_the_middle_had_no_exit_code_so_the_next_one_tells_again(jobs: Jobs) -> None:
    jobs.run()
    left = turn_at(jobs.out / ".scheduled" / "runs" / "4711-1.lock")
    assert left is not None
    os.close(left.descriptor)  # as when its process is killed
    assert [jobs.run(), jobs.run()] == [1, 0]
    assert list((jobs.out / ".scheduled" / "runs").iterdir()) == []


@pytest.mark.parametrize(("failures", "codes"), [(1, [1, 0, 0]), (2, [3, 1, 0]), (3, [3, 3, 1])])
def test_what_cannot_be_remembered_at_first_is_in_the_exit_code_all_the_same(
    jobs: Jobs, failures: int, codes: list[int]
) -> None:
    """Locked records keep a job's notices from being queued; its second attempt finds its certificate made."""

    class Locked(FolderState):
        def claim(self, *given: Any) -> bool:
            nonlocal failures
            failures -= 1
            if failures >= 0:
                raise OutputError("the records are locked")
            return super().claim(*given)

    jobs.told, jobs.state = True, Locked(jobs.out)
    assert [jobs.run() for _ in codes] == codes
    assert jobs.channel.titles == ["fail: CMM 3 (job a)"]


@pytest.mark.long
def test_a_clock_400_days_ahead_for_one_run_and_right_again_hides_nothing(jobs: Jobs) -> None:
    """What became due by the wrong clock was told then; it is told again, and sent again, when it truly is."""
    due = dt.date(2027, 1, 15)
    jobs.told = True
    jobs.due = lambda on: [notice("CMM 3", "due", str(due))] if on >= due else []
    made(jobs.root, "a", "1,2")
    assert jobs.run() == 0
    jobs.now = MONDAY + 400 * DAY
    assert jobs.run() == 1
    codes = {}
    for day in range(1, 60):
        jobs.now = MONDAY + day * DAY
        codes[jobs.now.date()] = jobs.run()
    # that the clock was set back is told; then what is due when it is, and a week later
    assert [str(on) for on, code in codes.items() if code] == ["2026-11-24", "2027-01-15", "2027-01-18"]
    assert jobs.channel.titles == ["due: CMM 3", "a wrong clock", "due: CMM 3"]


def test_a_clock_that_is_set_back_is_named_once_with_both_dates(jobs: Jobs) -> None:
    jobs.run()
    jobs.now -= 3 * DAY
    assert jobs.run() == 1
    (line,) = [line for line in jobs.lines if line.get("event") == "missed"]
    assert line["why"] == "the last run began on 2026-11-23 06:15, and the clock says 2026-11-20 06:15: one is wrong"
    jobs.now += dt.timedelta(hours=1)
    assert jobs.run() == 0


def missed(jobs: Jobs) -> list[str]:
    return [line["why"] for line in jobs.lines if line.get("event") == "missed"]


def test_runs_that_were_missed_are_named_once_by_the_next_with_their_dates(jobs: Jobs) -> None:
    """Nobody's scheduler makes up for them; what was due meanwhile is said by the run that comes."""
    jobs.told, jobs.settings["at"] = True, "06:15"
    made(jobs.root, "a", "1,2")
    wednesday = dt.date(2026, 11, 25)
    jobs.due = lambda on: [notice("CMM 3", "due", f"{wednesday}")] if on >= wednesday else []
    assert jobs.run() == 0
    jobs.now = MONDAY + 4 * DAY + dt.timedelta(hours=2)
    assert jobs.run() == 1
    days = ("2026-11-24 06:15", "2026-11-25 06:15", "2026-11-26 06:15")
    assert missed(jobs) == [
        f"3 runs were missed, after the run of 2026-11-23 06:15: {', '.join(days)}. What was due then is done and said now."
    ]
    assert sorted(jobs.channel.titles) == ["3 runs were missed", "due: CMM 3"]
    jobs.now += dt.timedelta(hours=1)
    assert jobs.run() == 0
    assert missed(jobs) == []
    jobs.now = MONDAY + 5 * DAY
    assert jobs.run() == 0
    assert jobs.lines[-1]["last_run"] == "2026-11-27T09:15:00+00:00"


@pytest.mark.parametrize("moved", ["", "x", "2026-11-23", "0001-01-01T00:00:00+00:00", "9999-12-31T00:00:00+14:00"])
def test_a_damaged_moment_of_the_last_run_is_none(jobs: Jobs, moved: str) -> None:
    jobs.settings["at"] = "06:15"
    jobs.run()
    (jobs.out / ".scheduled" / "last-run").write_text(moved)
    jobs.now += DAY
    assert jobs.run() == 0
    assert last_run(jobs.out) == jobs.now


def test_of_two_runs_the_one_that_began_later_is_the_last_whichever_ends_first(tmp_path: Path) -> None:
    tuesday, now = MONDAY + DAY, MONDAY + 2 * DAY
    for begun in (tuesday, MONDAY):
        remember_run(tmp_path, begun, now)
        assert last_run(tmp_path) == tuesday
    remember_run(tmp_path, MONDAY + 400 * DAY, MONDAY + 400 * DAY)
    remember_run(tmp_path, tuesday, now)  # by a clock that is right again
    assert last_run(tmp_path) == tuesday


def test_a_run_that_did_not_come_to_its_end_was_missed(jobs: Jobs) -> None:
    jobs.settings["at"] = "06:15"
    jobs.run()
    jobs.now += DAY
    jobs.before = lambda job: (_ for _ in ()).throw(KeyboardInterrupt())
    made(jobs.root, "b", "3,4")
    with pytest.raises(KeyboardInterrupt):
        jobs.run()
    jobs.now, jobs.before = jobs.now + DAY, lambda job: None
    jobs.run()
    assert [text[:18] for text in missed(jobs)] == ["1 run was missed, "]


AT = dt.datetime.fromisoformat


@pytest.mark.parametrize(("name", "after", "until", "days", "times"), [
    ("Europe/Berlin", "2026-03-28T02:30", "2026-03-30T02:30", [], ["2026-03-30T02:30"]),  # 29 March has no 02:30
    ("Europe/Berlin", "2026-10-24T02:30", "2026-10-26T02:30", [], ["2026-10-25T02:30", "2026-10-26T02:30"]),  # 25 October two
    ("UTC", "2026-03-28T02:30", "2026-03-30T02:30", [], ["2026-03-29T02:30", "2026-03-30T02:30"]),
    ("Europe/Berlin", "2026-11-23T06:25", "2026-11-30T06:14", ["MON", "THU"], ["2026-11-26T06:15"]),
    ("Pacific/Apia", "2011-12-28T06:25", "2011-12-31T07:00", [], ["2011-12-29T06:15", "2011-12-31T06:15"]),  # no 30th
])  # fmt: skip
def test_starts_are_those_that_a_clock_on_the_wall_shows(
    zone: Zone, name: str, after: str, until: str, days: list[str], times: list[str]
) -> None:
    zone(name)
    at = times[0][-5:]
    assert starts(AT(after), AT(until), at, days) == [AT(one) for one in times]


@pytest.mark.parametrize(("at", "begun"), [
    # the hour that is skipped: some schedulers start at the next minute that there is, others not at all
    ("02:30", ["2026-03-28T02:30+01:00", "2026-03-29T03:00+02:00", "2026-03-30T02:30+02:00"]),
    ("02:30", ["2026-03-28T02:30+01:00", "2026-03-30T02:30+02:00"]),
    # the hour that comes twice: a run in each, or in one
    ("02:30", ["2026-10-24T02:30+02:00", "2026-10-25T02:30+02:00", "2026-10-25T02:30+01:00", "2026-10-26T02:30+01:00"]),
    ("02:30", ["2026-10-24T02:30+02:00", "2026-10-25T02:30+01:00", "2026-10-26T02:30+01:00"]),
])  # fmt: skip
def test_no_run_is_missed_where_clocks_are_changed(jobs: Jobs, zone: Zone, at: str, begun: list[str]) -> None:
    zone("Europe/Berlin")
    jobs.settings["at"] = at
    for one in begun:
        jobs.now = AT(one).astimezone(dt.UTC)
        jobs.run()
        assert missed(jobs) == []


def test_another_time_zone_between_two_runs_makes_none_missed(jobs: Jobs, zone: Zone) -> None:
    jobs.settings["at"] = "06:15"
    for name, begun in (
        ("Europe/Berlin", "2026-11-23T06:15+01:00"), ("America/New_York", "2026-11-24T06:15-05:00"),
        ("Asia/Tokyo", "2026-11-25T06:15+09:00"), ("Europe/Berlin", "2026-11-26T06:15+01:00"),
    ):  # fmt: skip
        zone(name)
        jobs.now = AT(begun).astimezone(dt.UTC)
        assert jobs.run() == (1 if "23" in begun[:10] else 0)
        assert missed(jobs) == []


def test_what_is_due_goes_by_the_day_where_the_computer_stands(jobs: Jobs, zone: Zone) -> None:
    asked: list[dt.date] = []

    def due(on: dt.date) -> list[Notice]:
        asked.append(on)
        return []

    jobs.due = due
    for name in ("Pacific/Auckland", "UTC", "Pacific/Honolulu"):
        zone(name)
        jobs.now = dt.datetime(2026, 11, 23, 17, 15, tzinfo=dt.UTC)
        jobs.run()
    assert [on.day for on in asked] == [24, 23, 23]


@pytest.mark.parametrize("content", ["2030-01-01T00:00:00Z", "", "monday"])
def test_a_damaged_moment_of_an_error_or_one_of_the_future_is_begun_anew(tmp_path: Path, content: str) -> None:
    problems = Problems(tmp_path)
    assert problems.since("a", "no such file", "2026-11-20T06:15:00Z") == "2026-11-20T06:15:00Z"
    (path,) = problems.folder.iterdir()
    assert Problems(tmp_path).since("a", "no such file", "2026-11-23T06:15:00Z") == "2026-11-20T06:15:00Z"
    path.write_text(content)
    for now in ("2026-11-24T06:15:00Z", "2026-11-25T06:15:00Z"):
        assert Problems(tmp_path).since("a", "no such file", now) == "2026-11-24T06:15:00Z"


def test_lines_of_what_stands_name_event_words_and_since_when(jobs: Jobs) -> None:
    jobs.run()
    jobs.now += 2 * DAY
    jobs.run()
    (line,) = [line for line in jobs.lines if "standing" in line and "run" not in line]
    assert json.loads(json.dumps(line)) == {
        "schema": "cmm-uq/scheduled/1", "at": "2026-11-25T06:15:00Z", "standing": "a", "event": "fail",
        "why": "CMM 3 (job a): S E0: fail.", "since": "2026-11-23T06:15:00Z", "days": 2, "exit_code": 0,
    }  # fmt: skip
    assert any("days 2" in line and "CMM 3 (job a): S E0: fail." in line for line in jobs.logged)
