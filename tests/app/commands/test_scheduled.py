"""``cmm-uq report --scheduled`` and ``cmm-uq schedule``, as they are typed, with real reports and real processes."""

from __future__ import annotations

import contextlib
import datetime as dt
import json
import os
import shutil
import signal
import sqlite3
import subprocess
import time
from collections import Counter
from hashlib import sha256
from pathlib import Path
from typing import Any
from unittest import mock

import pytest

from cmm_uq.app.commands.laboratory.schedule import _newest_jobs, drift_notices, due_notices
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.output import read_manifest, sha256_of
from cmm_uq.laboratory.records import open_records
from tests.app.cli.process import COMMAND, run
from tests.laboratory.records.histories import certificate
from tests.laboratory.schedule.servers import Taken, web_server

QUICK = "[run]\nquiet_s = 0\nback_off_s = 0\n"


@pytest.fixture
def jobs(iota: Path, tmp_path: Path) -> Path:
    """A folder with a job in it, and one that is wrong."""
    shutil.copytree(iota, tmp_path / "jobs" / "iota")
    (tmp_path / "jobs" / "schedule.toml").write_text(QUICK)
    return tmp_path / "jobs"


def lines(text: str) -> list[dict[str, Any]]:
    return [json.loads(line) for line in text.splitlines()]


def of_job(text: str) -> dict[str, Any]:
    (line,) = [line for line in lines(text) if line.get("job") == "iota-1102-20C"]
    return line


def started(jobs: Path) -> subprocess.Popen[str]:
    return subprocess.Popen([*COMMAND, "report", "--scheduled", str(jobs)], stdout=subprocess.PIPE, stderr=subprocess.PIPE,
                            text=True)  # fmt: skip


@pytest.mark.long
def test_two_schedulers_on_one_folder_make_one_certificate_and_one_message(jobs: Path) -> None:
    taken = Taken()
    with web_server(taken) as port:
        (jobs / "schedule.toml").write_text(f'{QUICK}[[webhook]]\nurl = "http://localhost:{port}/"\n')
        runs = [started(jobs) for _ in range(2)]
        told = [one.communicate() for one in runs]
        assert run("report", "--scheduled", jobs).returncode == 0
    assert [error for _, error in told] == ["", ""]
    states = sorted(of_job(text)["state"] for text, _ in told)
    assert states in (["busy", "reported"], ["reported", "unchanged"])
    assert sorted(one.returncode for one in runs) == [0, 1]
    (body,) = [json.loads(body) for _, body in taken.requests]
    assert (body["event"], body["about"]) == ("fail", "iota-1102-20C")
    folder = jobs / "reports" / "iota-1102-20C"
    assert body["where"] == str(folder)
    manifest = read_manifest(folder)
    assert manifest is not None
    assert all(sha256_of(folder / name) == digest for name, digest in manifest.files.items())


@pytest.mark.long
@pytest.mark.skipif(os.name == "nt", reason="Windows has no SIGTERM that a process can see")
@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGKILL])
def test_a_run_that_is_ended_in_the_middle_leaves_nothing_half_and_the_next_one_goes_on(
    jobs: Path, number: signal.Signals
) -> None:
    lock = jobs / "reports" / ".scheduled" / "locks" / "iota-1102-20c.lock"
    one = started(jobs)
    deadline = time.monotonic() + 60
    while not (lock.exists() and lock.stat().st_size) and time.monotonic() < deadline:
        time.sleep(0.01)
    one.send_signal(number)
    _, error = one.communicate()
    if number == signal.SIGTERM:
        assert one.returncode == 143
        assert error == "cmm-uq: interrupted; 0 reports were written\n"
    assert not (jobs / "reports" / "iota-1102-20C" / "results.json").exists()
    if number == signal.SIGKILL:
        done = run("report", "--scheduled", jobs)
        assert done.returncode == 1
        assert of_job(done.stdout)["state"] == "reported"
        assert not lock.exists()
        assert not list((jobs / "reports" / "iota-1102-20C").glob(".unfinished-*"))


def test_a_dry_run_writes_nothing_and_lines_are_added_to_a_file(jobs: Path, tmp_path: Path) -> None:
    (jobs / "wrong").mkdir()
    (jobs / "wrong" / "job.toml").write_text("x =")
    for _ in range(2):
        done = run("report", "--scheduled", jobs, "--dry-run", "--lines", tmp_path / "lines.jsonl")
        assert (done.returncode, done.stdout, done.stderr) == (0, "", "")
    told = lines((tmp_path / "lines.jsonl").read_text())
    assert [line.get("state") for line in told] == ["would report", "would report", None] * 2
    assert not (jobs / "reports").exists()


def test_bad_jobs_are_lines_and_exit_code_2(jobs: Path, tmp_path: Path) -> None:
    shutil.rmtree(jobs / "iota")
    (jobs / "wrong").mkdir()
    (jobs / "wrong" / "job.toml").write_text("x =")
    done = run("report", "--scheduled", jobs, "--out", tmp_path / "out")
    assert (done.returncode, done.stderr) == (2, "")
    first, last = lines(done.stdout)
    assert first["error"]["problem"].startswith("is not valid TOML")
    assert last["exit_code"] == 2
    assert "refused" in (tmp_path / "out" / "schedule.log").read_text()


def test_a_quiet_run_says_nothing_but_what_is_wrong(jobs: Path, tmp_path: Path) -> None:
    shutil.rmtree(jobs / "iota")
    (jobs / "bad").mkdir()
    (jobs / "bad" / "job.toml").write_text("x =")
    done = run("report", "--scheduled", jobs, "--out", tmp_path / "out", "--quiet")
    assert (done.returncode, done.stdout) == (2, "")
    (line,) = done.stderr.splitlines()
    assert line.startswith("cmm-uq: ")
    assert "job.toml" in line


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (
            ["a", "b"],
            "b: 2 jobs are named, and a report is of one. Report them one after the other, or with --scheduled",
        ),
        (["a", "--dry-run"], "--dry-run: goes with --scheduled. Add --scheduled"),
        (["a", "--lines", "x"], "--lines: goes with --scheduled. Add --scheduled"),
        (["a", "--scheduled", "--force"], "--force: goes without --scheduled. Leave it out"),
        (
            ["a", "--scheduled", "--schedule", "x.toml"],
            "x.toml: no such file. cmm-uq schedule new FILE writes one with every",
        ),
    ],
)
def test_options_of_the_other_way_are_refused(tmp_path: Path, arguments: list[str], told: str) -> None:
    done = run("report", *arguments, cwd=tmp_path)
    assert done.returncode == 2
    assert done.stderr.startswith(f"cmm-uq: {told}")
    assert done.stderr.count("\n") == 1
    assert list(tmp_path.iterdir()) == []


def test_a_place_for_lines_that_is_none_is_told_before_anything_is_done(jobs: Path, tmp_path: Path) -> None:
    done = run("report", "--scheduled", jobs, "--lines", tmp_path)
    assert done.returncode == 3
    assert "Name another file" in done.stderr
    assert not (jobs / "reports").exists()


def test_a_new_schedule_is_read_and_is_written_over_nothing(tmp_path: Path) -> None:
    path = tmp_path / "schedule.toml"
    assert run("schedule", "new", path).returncode == 0
    text = path.read_text()
    assert "# [[email]]" in text
    assert 'out = "reports"' in text
    done = run("schedule", "test", "--schedule", path)
    assert done.returncode == 2
    assert "names nobody who is told of anything" in done.stderr
    assert run("schedule", "new", path).returncode == 3
    assert path.read_text() == text


def test_a_trial_message_says_who_got_it_and_who_did_not(tmp_path: Path) -> None:
    taken = Taken()
    with web_server(taken) as port:
        hooks = [f'[[webhook]]\nurl = "http://localhost:{at}/"\n' for at in (port, 1)]
        (tmp_path / "schedule.toml").write_text("".join(hooks))
        done = run("schedule", "test", tmp_path, "--json")
    assert done.returncode == 1
    assert [one["sent"] for one in json.loads(done.stdout)["channels"]] == [True, False]
    assert len(taken.requests) == 1


def test_ready_files_are_printed_or_written(jobs: Path, tmp_path: Path) -> None:
    printed = run("schedule", "print", "systemd", jobs, "--at", "05:00").stdout
    assert printed.startswith("# cmm-uq-schedule.service\n[Unit]")
    assert "OnCalendar=*-*-* 05:00:00" in printed
    done = run("schedule", "print", "windows", jobs, "--out", tmp_path)
    assert done.stdout == f"{tmp_path / 'cmm-uq-schedule.xml'}\n"
    assert "--scheduled" in (tmp_path / "cmm-uq-schedule.xml").read_text(encoding="utf-16")


@pytest.mark.long
@pytest.mark.skipif(shutil.which("faketime") is None, reason="faketime gives a process another clock")
def test_by_another_clock_and_in_another_zone_what_stands_is_told_weekly_and_never_hidden(jobs: Path) -> None:
    """400 days ahead for one run, and back: the wrong clock is named, and no fault is taken for told by it."""
    schedule = jobs / "schedule.toml"
    schedule.write_text(f'{QUICK}at = "06:15"\n')

    def at(moment: str, zone: str = "Europe/Berlin", *further: str) -> tuple[int, list[str], int]:
        line = ["faketime", "-f", f"@{moment}", *COMMAND, "report", "--scheduled", str(jobs), *further]
        done = subprocess.run(line, capture_output=True, text=True, check=False, env={**os.environ, "TZ": zone})
        assert done.stderr == ""
        told = lines(done.stdout)
        ages = [line["days"] for line in told if line.get("event") == "fail"]
        return done.returncode, [line["why"] for line in told if line.get("event") == "missed"], *ages

    assert at("2026-10-19 06:15:00") == (1, [])  # its certificate is made: a fail
    assert at("2026-10-20 06:15:00") == (0, [], 1)
    assert at("2026-10-20 07:15:00", "Europe/Berlin", "--strict") == (1, [], 1)
    missed = (
        "3 runs were missed, after the run of 2026-10-20 07:15: 2026-10-21 06:15, 2026-10-22 06:15, 2026-10-23 06:15"
    )
    assert at("2026-10-24 06:15:00") == (1, [f"{missed}. What was due then is done and said now."], 5)
    assert at("2026-10-25 06:15:00") == (0, [], 6)  # the night with 25 hours
    assert at("2026-10-26 06:15:00", "America/New_York") == (1, [], 7)  # another week
    code, (why,), _ = at("2027-11-28 06:15:00")
    assert (code, why[:39]) == (1, "397 runs were missed, after the run of ")
    wrong = "the last run began on 2027-11-28 06:15, and the clock says 2026-10-27 06:15: one is wrong"
    assert at("2026-10-27 06:15:00") == (1, [wrong], 8)
    assert at("2026-10-28 06:15:00") == (0, [], 9)


@pytest.mark.usefixtures("no_regions", "no_diagnosis")
def test_what_was_reported_and_sent_is_in_the_records_and_a_dry_run_only_reads_them(jobs: Path) -> None:
    taken, where = Taken(), jobs / "lab.db"
    with web_server(taken) as port:
        (jobs / "schedule.toml").write_text(
            f'{QUICK}records = "lab.db"\n[[webhook]]\nurl = "http://localhost:{port}/"\n'
        )
        with mock.patch.dict(os.environ):
            del os.environ["CMM_UQ_RECORDS"]
            run("report", "--scheduled", jobs, "--dry-run")
            assert not where.exists()
            assert run("report", "--scheduled", jobs).returncode == 1
            before = where.read_bytes()
            shutil.rmtree(jobs / "reports")
            done = run("report", "--scheduled", jobs, "--dry-run")
            assert of_job(done.stdout)["state"] == "unchanged"
            assert where.read_bytes() == before
    with open_records(where, read_only=True) as records:
        entries = list(records.entries())
    ways = Counter((entry.kind, str(entry.data.get("channel"))[:7]) for entry in entries)
    assert ways == {("report", "None"): 1, ("sent", "exit co"): 2, ("sent", "webhook"): 2}
    # a machine that does not conform is due at once
    told = {(entry.data["event"], entry.data["about"]) for entry in entries[1:]}
    assert told == {("fail", "iota-1102-20C"), ("due", "machine DEA Iota 1102")}
    assert len(taken.requests) == 2


def test_records_that_cannot_be_written_end_the_run_before_any_job_and_somebody_is_told_once(
    jobs: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Held by another program for longer than anybody waits."""
    where, taken = jobs / "lab.db", Taken()
    open_records(where, create=True).close()
    monkeypatch.setattr("cmm_uq.laboratory.records.opening.PATIENCE_S", 0.1)
    holder = sqlite3.connect(where, isolation_level=None)
    with web_server(taken) as port, contextlib.closing(holder):
        (jobs / "schedule.toml").write_text(f'{QUICK}[[webhook]]\nurl = "http://localhost:{port}/"\n')
        holder.execute("BEGIN IMMEDIATE")
        for _ in range(2):
            done = run("report", "--scheduled", jobs, "--records", where)
            assert done.returncode == 3
            assert done.stderr.count("\n") == 1
    assert str(where) in done.stderr
    assert not (jobs / "reports" / "iota-1102-20C").exists()
    assert list((jobs / "reports" / ".scheduled" / "problems").iterdir())
    shutil.rmtree(jobs / "iota")
    run("report", "--scheduled", jobs, "--records", where)
    assert not list((jobs / "reports" / ".scheduled" / "problems").glob(f"{sha256(b'the run').hexdigest()[:16]}-*"))
    (body,) = [json.loads(body) for _, body in taken.requests]
    assert (body["event"], body["about"]) == ("error", "the run")


def test_another_programs_database_is_bad_input(jobs: Path) -> None:
    (jobs / "lab.db").write_text("no database, but long enough")
    done = run("report", "--scheduled", jobs, "--records", jobs / "lab.db")
    assert done.returncode == 2
    assert "is no database" in done.stderr


def test_what_is_due_is_told_and_with_a_clock_behind_the_records_nothing_is_due(tmp_path: Path) -> None:
    """The made-up certificate's artefact is due on 2027-06-01, its machine a year after the certificate of 2026-03-02."""
    with open_records(tmp_path / "lab.db", create=True) as records:
        records.append("report", certificate(), at=dt.datetime(2027, 5, 1, tzinfo=dt.UTC))
        told = {on: list(due_notices(records, dt.date.fromisoformat(on), dt.timedelta(days=29))) for on in (
            "2027-05-02", "2027-05-03", "2027-06-01", "2027-06-02",
        )}  # fmt: skip
        titles = {on: [str(notice.title) for notice in notices] for on, notices in told.items()}
        machine = "overdue since 2027-03-02: machine 1102"
        assert titles == {
            "2027-05-02": [machine],
            "2027-05-03": [machine, "due on 2027-06-01: artefact BB-7"],
            "2027-06-01": [machine, "due on 2027-06-01: artefact BB-7"],
            "2027-06-02": [machine, "overdue since 2027-06-01: artefact BB-7"],
        }
        assert len({notice.key for notices in told.values() for notice in notices}) == 3
        with pytest.raises(CmmUqError, match="the clock says 2027-04-20"):
            list(due_notices(records, dt.date(2027, 4, 20), dt.timedelta(days=60)))
        records.append("sent", {}, at=dt.datetime(2026, 4, 20, tzinfo=dt.UTC))  # by the clock that is behind
        with pytest.raises(CmmUqError, match="the newest entry is of 2027-05-01, and the clock says 2026-04-20"):
            list(due_notices(records, dt.date(2026, 4, 20), dt.timedelta(days=60)))
    assert list(due_notices(None, dt.date(2027, 6, 1), dt.timedelta(days=30))) == []


@pytest.mark.parametrize(("on", "titles"), [
    ("2027-04-20", ["overdue since 2027-03-02: machine 1102", "due on 2027-06-01: artefact BB-7"]),
    ("2026-04-20", []),
])  # fmt: skip
def test_with_a_clock_behind_the_records_what_is_due_by_it_is_said_before_the_error(
    tmp_path: Path, on: str, titles: list[str]
) -> None:
    """By all certificates that there are: a machine is not taken for one that was never calibrated."""
    said: list[str] = []
    with open_records(tmp_path / "lab.db", create=True) as records:
        records.append("report", certificate(), at=dt.datetime(2027, 5, 1, tzinfo=dt.UTC))
        with pytest.raises(CmmUqError, match=f"and the clock says {on}: more may be due than is said"):
            said.extend(
                str(one.title) for one in due_notices(records, dt.date.fromisoformat(on), dt.timedelta(days=60))
            )
    assert said == titles


def test_records_that_hold_messages_alone_have_nothing_due(tmp_path: Path) -> None:
    with open_records(tmp_path / "lab.db", create=True) as records:
        records.append("sent", {"key": "k"}, at=dt.datetime(2027, 5, 1, tzinfo=dt.UTC))
        assert list(due_notices(records, dt.date(2027, 5, 1), dt.timedelta(days=60))) == []


def test_ready_files_go_by_the_times_of_the_schedule_and_by_no_others(jobs: Path) -> None:
    (jobs / "schedule.toml").write_text(f'{QUICK}at = "05:30"\ndays = ["THU", "MON"]\n')
    assert "OnCalendar=Mon,Thu *-*-* 05:30:00" in run("schedule", "print", "systemd", jobs).stdout
    assert run("schedule", "print", "cron", jobs, "--at", "5:30", "--days", "mon,thu").returncode == 0
    for further in (("--at", "06:15"), ("--days", "MON")):
        done = run("schedule", "print", "cron", jobs, *further)
        assert done.returncode == 2
        assert "names another time, by which it tells which runs were missed" in done.stderr


@pytest.mark.parametrize(("key", "told"), [('at = "6:15"', "at"), ('days = ["Mon"]', "days"), ('at = "24:00"', "at")])
def test_times_that_are_none_are_refused_with_their_line(jobs: Path, key: str, told: str) -> None:
    (jobs / "schedule.toml").write_text(f"{QUICK}{key}\n")
    done = run("report", "--scheduled", jobs)
    assert done.returncode == 2
    assert f"schedule.toml line 4: [run] {told}" in done.stderr


@pytest.mark.parametrize(("value", "told"), [(2.5, False), (9.0, True)])
def test_a_machine_that_changed_by_more_than_chance_drifts(tmp_path: Path, value: float, told: bool) -> None:
    """Against the change worked by hand: 2.0 ± 0.5 before; 0.5 more is 0.7 u, 7 more is 10 u."""
    with open_records(tmp_path / "lab.db", create=True) as records:
        for day, measured in ((dt.date(2025, 3, 1), 2.0), (dt.date(2026, 3, 1), value)):
            row = ("scale_x.ppm", "Scale error of x", "ppm", measured, 0.5, measured - 1, measured + 1, 0.0, 8.0)
            records.append("report", certificate(day=day, values=(row,)))
        notices = list(drift_notices(records, "1102-2026-03-01", dt.date(2026, 4, 1)))
        assert list(drift_notices(records, "1102-2025-03-01", dt.date(2026, 4, 1))) == []
        # as long as nothing newer is known of the machine
        assert _newest_jobs(records, dt.date(2026, 4, 1)) == {"1102-2026-03-01"}
    assert [notice.text for notice in notices] == [
        "machine 1102 changed by more than chance since the recording before: Scale error of x."
    ] * told
