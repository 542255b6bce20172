"""A year of runs, day by day, with records: what is due is told once, what stands comes weekly, nothing is forgotten."""

from __future__ import annotations

import datetime as dt
from collections import Counter, defaultdict
from collections.abc import Iterable
from functools import partial
from pathlib import Path

import pytest

from cmm_uq.app.commands.laboratory.schedule import due_notices
from cmm_uq.laboratory.records import open_records
from cmm_uq.laboratory.schedule.notices import Notice
from cmm_uq.laboratory.schedule.state import RecordsState
from tests.laboratory.records.histories import certificate
from tests.laboratory.schedule.runs import FolderResults, Jobs, made

DAY, AHEAD = dt.timedelta(days=1), dt.timedelta(days=30)
FIRST = dt.datetime(2026, 1, 5, 6, 15, tzinfo=dt.UTC)  # a Monday
CALIBRATED = {"101": dt.date(2025, 3, 2), "102": dt.date(2025, 5, 20), "103": dt.date(2025, 11, 30)}
OFF = {*range(54, 75), 100, 101, *range(300, 303)}
"""Days without a run: three weeks with a due date in them, a week-end, the days around a due date."""

RECALIBRATED = {"101": 90}
"""Days on which a machine has its new certificate."""

FAILS = (40, 260)  # days on which the certificate of a job is made that fails, and one that passes in its place


def due_dates(day: int) -> dict[str, dt.date]:
    """When what is to be calibrated, as known on a day: a year after its certificate; the artefact by its own."""
    on = CALIBRATED | {serial: (FIRST + since * DAY).date() for serial, since in RECALIBRATED.items() if day >= since}
    return {"artefact BB-7": dt.date(2026, 8, 1), **{f"machine {s}": d.replace(year=d.year + 1) for s, d in on.items()}}


def recorded(day: dt.date, serial: str) -> dict[str, object]:
    artefact = certificate()["artefact"] | {"due": "2026-08-01"}
    return certificate(serial, day, artefact=artefact)


@pytest.fixture(autouse=True)
def _without_waiting_for_the_disk(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("os.fsync", lambda descriptor: None)


@pytest.mark.long
def test_a_year_of_daily_runs(tmp_path: Path) -> None:
    made(tmp_path, "a")
    jobs = Jobs(tmp_path, now=FIRST, settings={"quiet_s": 0, "at": "06:15"})
    lines: dict[int, dict[str, tuple[int, int]]] = {}
    codes: dict[int, int] = {}
    missed: dict[int, str] = {}
    with open_records(tmp_path / "lab.db", create=True) as records:
        records.clock = lambda: jobs.now
        records.append_all(("report", recorded(day, serial), FIRST - DAY) for serial, day in CALIBRATED.items())
        jobs.due = partial(due_notices, records, within=AHEAD)
        for day in (day for day in range(366) if day not in OFF):
            jobs.now = FIRST + day * DAY
            for serial in (serial for serial, since in RECALIBRATED.items() if since == day):
                records.append("report", recorded(jobs.now.date(), serial))
            if day in FAILS:
                made(tmp_path, "a", "fail" if day == FAILS[0] else "1,2\n")
            # the state is read anew by each run, as by each process
            jobs.state = FolderResults(RecordsState(records, jobs.out))
            codes[day] = jobs.run()
            found = [line for line in jobs.lines if {"due", "standing"} & line.keys() and "run" not in line]
            missed.update((day, line["why"]) for line in found if line["event"] == "missed")
            lines[day] = {
                line.get("due") or line["standing"]: (line["days"], line["exit_code"])
                for line in found if line["event"] != "missed"
            }  # fmt: skip
            reported = [line for line in jobs.lines if line.get("state") == "reported" and line["events"]]
            lines[day] |= {line["job"]: (0, line["exit_code"]) for line in reported}
        assert records.verify(files=False) == []
        sent = Counter(entry.data["channel"] for entry in records.entries(kind="sent"))

    # nothing is forgotten: on every day with a run each thing that stands is said, and nothing else
    for day, said in lines.items():
        on = (FIRST + day * DAY).date()
        stands = {about for about, due in due_dates(day).items() if due <= on + AHEAD}
        assert set(said) == stands | ({"a"} if FAILS[0] <= day < FAILS[1] else set()), day

    # each is in the exit code when it is new, when it becomes overdue, and by the first run of every week after
    weeks: dict[tuple[str, tuple[int, int], str], int] = defaultdict(int)
    for day, said in lines.items():
        on = (FIRST + day * DAY).date()
        for about, (age, code) in said.items():
            due = due_dates(day).get(about)
            state = f"{due} {'overdue' if due is not None and due < on else 'due'}"
            weeks[about, on.isocalendar()[:2], state] += code
            assert age <= day
    assert set(weeks.values()) == {1}
    assert {day for day, code in codes.items() if code} == {
        day for day, said in lines.items() if day in missed or any(code for _, code in said.values())
    }
    assert set(codes.values()) == {0, 1}

    # runs that were missed are named by the next, once, with the first and the last of their dates
    assert list(missed) == [75, 102, 303]
    assert missed[75].startswith("21 runs were missed, after the run of 2026-02-27 06:15: 2026-02-28 06:15, ")
    assert missed[75].endswith(", 2026-03-20 06:15. What was due then is done and said now.")
    assert "2026-04-15 06:15, 2026-04-16 06:15." in missed[102]

    # of messages there is one of each, however often a run looks
    assert sent["kept"] == len(jobs.channel.messages) == len({message.key for message in jobs.channel.messages})
    due = [message.title for message in jobs.channel.messages if message.event == "due"]
    assert sorted(due) == [
        "due on 2026-03-02: machine 101", "due on 2026-05-20: machine 102", "due on 2026-08-01: artefact BB-7",
        "due on 2026-11-30: machine 103", "overdue since 2026-03-02: machine 101",
        "overdue since 2026-05-20: machine 102", "overdue since 2026-08-01: artefact BB-7",
        "overdue since 2026-11-30: machine 103",
    ]  # fmt: skip
    others = Counter(message.event for message in jobs.channel.messages if message.event != "due")
    assert others == {"fail": 1, "missed": 3}


def test_a_clock_that_was_400_days_ahead_leaves_its_dates_in_the_records_and_nothing_that_is_due_is_hidden(
    tmp_path: Path,
) -> None:
    """Entries cannot be taken back, so that every run says that one of them and the clock cannot both be right."""
    jobs = Jobs(tmp_path, now=FIRST, settings={"quiet_s": 0, "may_be_empty": True})
    with open_records(tmp_path / "lab.db", create=True) as records:
        records.clock = lambda: jobs.now
        records.append_all(("report", recorded(day, serial), FIRST - DAY) for serial, day in CALIBRATED.items())

        def due(on: dt.date) -> Iterable[Notice]:
            return due_notices(records, on, AHEAD)

        jobs.due, titles = due, {}
        for day in (0, 400, 1, 2, 25, 26, 27, 56, 57, 58, 104, 105, 106):
            jobs.now, jobs.state = FIRST + day * DAY, FolderResults(RecordsState(records, jobs.out))
            before = len(jobs.channel.messages)
            code = jobs.run()
            assert code == {0: 0, 400: 1}.get(day, 2)
            titles[day] = {message.title for message in jobs.channel.messages[before:] if message.event == "due"}
            if 0 < day < 400:
                why = f"the newest entry is of 2027-02-09, and the clock says {jobs.now.date()}: more may be due than is said"
                assert any(str(line.get("why")).startswith(f"records: {why}") for line in jobs.lines)
    late = {"overdue since 2026-03-02: machine 101", "overdue since 2026-05-20: machine 102",
            "overdue since 2026-08-01: artefact BB-7", "overdue since 2026-11-30: machine 103"}  # fmt: skip
    assert titles[400] == late  # by the clock of then
    days = {title: day for day, found in titles.items() if day != 400 for title in found}
    in_days = {title: (FIRST + day * DAY).date() for title, day in days.items()}
    assert {title: str(day) for title, day in in_days.items()} == {
        "due on 2026-03-02: machine 101": "2026-01-31", "due on 2026-05-20: machine 102": "2026-04-20",
        "overdue since 2026-03-02: machine 101": "2026-03-03",
    }  # fmt: skip
