"""What earlier runs have done, locks, and how far a run is."""

from __future__ import annotations

import hashlib
import json
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from cmm_uq.base.errors import CmmUqError, OutputError
from cmm_uq.base.output import Owner, sha256_of, staged
from cmm_uq.laboratory.records import open_records
from cmm_uq.laboratory.records.store import Records
from cmm_uq.laboratory.schedule.jobs import JobFolder, JobReporting
from cmm_uq.laboratory.schedule.notices import of_results
from cmm_uq.laboratory.schedule.processes import Pace, duration, pace
from cmm_uq.laboratory.schedule.state import (
    Dispatch,
    FolderState,
    Log,
    RecordsState,
    inputs_of,
    turn,
    turn_at,
    was_left,
)
from tests.laboratory.records.histories import certificate
from tests.laboratory.schedule.runs import Jobs, made

INPUTS = {"job.toml": "1" * 64, "points.csv": "2" * 64}


@pytest.fixture
def records(tmp_path: Path) -> Iterator[Records]:
    with open_records(tmp_path / "reports" / "records.db", create=True) as opened:
        yield opened


def report(out: Path, job: str = "a", inputs: dict[str, str] = INPUTS, command: str = "report") -> str:
    results = json.dumps({"job": {"id": job, "inputs_sha256": inputs}}).encode()
    with staged(out / job, Owner(command, job)) as place:
        place.write({"results.json": results, "certificate.pdf": b"%PDF"})
    return hashlib.sha256(results).hexdigest()


def record(records: Records, digest: str, job: str = "a", inputs: dict[str, str] = INPUTS) -> int:
    return records.append("report", certificate(job=job, results_sha256=digest, inputs=inputs, folder=job)).number


def test_a_folder_knows_its_own_whole_reports_alone(tmp_path: Path) -> None:
    state = FolderState(tmp_path)
    assert inputs_of(state.results("a")) is None
    report(tmp_path)
    assert inputs_of(state.results("a")) == INPUTS
    report(tmp_path, "diagnosed", command="diagnose")
    assert inputs_of(state.results("diagnosed")) is None
    (tmp_path / "a" / "results.json").write_text('{"job": {"inputs_sha256": {}}}')
    assert inputs_of(state.results("a")) is None


def test_what_the_folder_has_and_the_records_have_not_is_to_be_recorded_yet(tmp_path: Path, records: Records) -> None:
    state = RecordsState(records, tmp_path / "reports")
    digest = report(tmp_path / "reports")
    assert inputs_of(state.results("a")) is None
    record(records, digest)
    assert inputs_of(state.results("a")) == INPUTS


def test_a_report_that_was_taken_away_is_not_made_again_and_of_several_the_newest_counts(
    tmp_path: Path, records: Records
) -> None:
    """The laboratory's archive is no reason for a second certificate."""
    state = RecordsState(records, tmp_path / "reports")
    record(records, "a" * 64, inputs={"job.toml": "0" * 64})
    record(records, report(tmp_path / "reports"))
    shutil.rmtree(tmp_path / "reports" / "a")
    assert inputs_of(state.results("a")) == INPUTS


def test_a_released_certificate_is_not_replaced(tmp_path: Path, records: Records) -> None:
    folder = made(tmp_path, "a")
    state = RecordsState(records, tmp_path / "reports")
    entry = record(records, report(tmp_path / "reports"))
    work = JobReporting(tmp_path / "reports", state, lambda job: b"", lambda notices: None)
    job = JobFolder(folder, tmp_path, "a", "points.csv")
    assert work.reason(job) == "changed: job.toml, points.csv"
    assert not state.released("a")
    records.append("release", {"certificate": entry, "by": "A. Person", "reason": "reviewed"})
    assert state.released("a")
    with pytest.raises(CmmUqError, match="changed after the certificate was released"):
        work.reason(job)


def test_a_message_that_any_run_has_sent_is_known(tmp_path: Path, records: Records) -> None:
    mine, others = (RecordsState(records, tmp_path / "reports") for _ in range(2))
    assert not mine.sent("k")
    others.add_sent("k", {"about": "a"})
    assert mine.sent("k")
    assert not mine.sent("l")
    (entry,) = records.entries(kind="sent")
    assert entry.data == {"about": "a", "key": "k"}


def test_runs_with_records_send_once_and_their_chain_holds(tmp_path: Path, records: Records) -> None:
    made(tmp_path, "a", "fail")
    jobs = Jobs(tmp_path, state=RecordsState(records, tmp_path / "reports"))
    jobs.run()
    results = jobs.out / "a" / "results.json"
    digest = hashlib.sha256(results.read_bytes()).hexdigest()
    record(records, digest, inputs=json.loads(results.read_text())["job"]["inputs_sha256"])
    assert jobs.run() == 0
    assert jobs.reported == []
    assert len(jobs.channel.messages) == 1
    assert [(entry.kind, entry.data.get("channel")) for entry in records.entries()] == [
        ("sent", "exit code"), ("sent", "kept"), ("report", None),
    ]  # fmt: skip
    assert records.verify(files=False) == []


def test_a_certificate_that_fails_stands_until_a_person_released_it_wherever_its_files_are(
    tmp_path: Path, records: Records
) -> None:
    made(tmp_path, "a", "fail")
    jobs = Jobs(tmp_path, state=RecordsState(records, tmp_path / "reports"))
    jobs.run()
    results = jobs.out / "a" / "results.json"
    inputs, digest = json.loads(results.read_text())["job"]["inputs_sha256"], sha256_of(results)
    stated = {"statements": [{"name": "E0", "by": "S", "title": None, "outcome": "fail", "value": 9.0, "U": 1.0, "limit": 8.0,
                              "unit": "µm", "missing": []}]}  # fmt: skip
    content = certificate(job="a", results_sha256=digest, inputs=inputs, folder="a", decision="fail", verdicts=stated)
    entry = records.append("report", content).number

    def standing() -> list[str]:
        assert jobs.run() == 0
        assert jobs.reported == []
        return [line["why"] for line in jobs.lines if "standing" in line and "run" not in line]

    assert standing() == ["CMM 3 (job a): S E0: fail."]
    shutil.rmtree(jobs.out / "a")
    assert standing() == ["Machine 1102 (job a): S E0: fail."]
    records.append("release", {"certificate": entry, "by": "A. Person", "reason": "reviewed"})
    assert standing() == []


def test_of_a_certificate_without_its_statements_the_records_know_the_gravest_outcome(
    tmp_path: Path, records: Records
) -> None:
    state = RecordsState(records, tmp_path / "reports")
    for job, facts in {"a": {"decision": "fail"}, "b": {"diagnosis": "partial"}, "c": {"decision": "none"}}.items():
        records.append("report", certificate(job=job, inputs=INPUTS, folder=job, results_sha256=job * 64, **facts))
    events = {job: [one.event for one in of_results(state.results(job) or {}, "", "")] for job in "abc"}
    assert events == {"a": ["fail"], "b": ["mismatch"], "c": []}


def test_what_is_claimed_is_said_by_one_and_known_to_all(tmp_path: Path, records: Records) -> None:
    def again(before: Dispatch | None) -> bool:
        return before is None or before.last.day != int(day)

    for state, other in (
        (RecordsState(records, tmp_path), RecordsState(records, tmp_path)), (FolderState(tmp_path), FolderState(tmp_path)),
    ):  # fmt: skip
        for day in ("23", "24"):
            claims = [one.claim("k", {"at": f"2026-11-{day}T06:15:00Z"}, again) for one in (state, other, state)]
            assert claims == [True, False, False]
        known = other.sent("k")
        assert known is not None
        assert (known.first.day, known.last.day) == (23, 24)


HOLD = """
import sys, time
from pathlib import Path
from cmm_uq.laboratory.schedule.state import turn_at
assert turn_at(Path(sys.argv[1])) is not None
print("held", flush=True)
time.sleep(60)
"""


@pytest.fixture
def lock(tmp_path: Path) -> Path:
    return tmp_path / "locks" / "job.lock"


def test_while_another_process_holds_a_lock_there_is_no_turn_and_once_it_is_killed_there_is(lock: Path) -> None:
    holder = subprocess.Popen([sys.executable, "-c", HOLD, str(lock)], stdout=subprocess.PIPE)
    try:
        assert holder.stdout is not None
        assert holder.stdout.readline() == b"held\n"
        assert turn_at(lock) is None
    finally:
        holder.kill()
        holder.communicate()
    assert was_left(lock)
    with turn(lock) as mine:
        assert mine is not None
        assert mine.resumed
    assert not was_left(lock)


def test_a_turn_that_ended_leaves_nothing(lock: Path) -> None:
    for _ in range(2):
        with turn(lock) as mine:
            assert mine is not None
            assert not mine.resumed
            assert was_left(lock)
    assert not lock.exists()


def test_one_that_was_not_through_is_resumed_by_the_next(lock: Path) -> None:
    with turn(lock) as mine:
        assert mine is not None
        mine.through = False
    with turn(lock) as mine:
        assert mine is not None
        assert mine.resumed


def test_a_second_turn_in_the_same_process_waits_no_longer_than_it_is_to(lock: Path) -> None:
    with turn(lock), turn(lock, patience_s=0.1) as second:
        assert second is None


def test_a_file_where_the_folder_of_locks_belongs_is_told(tmp_path: Path) -> None:
    (tmp_path / "locks").write_text("")
    with pytest.raises(OutputError, match="cannot be locked"):
        turn_at(tmp_path / "locks" / "job.lock")


def test_rate_and_remaining_time_follow_from_what_was_computed_alone() -> None:
    now = [100.0]
    found = Pace(400, lambda: now[0])
    assert str(found) == "0 of 400"
    for _ in range(100):
        found.add(computed=False)  # was there already
    assert str(found) == "100 of 400"
    now[0] += 50.0
    for i in range(100):
        found.add(failed=i < 3)
    assert str(found) == "200 of 400, 3 failed, 2.0/s, 1 min 40 s left"
    assert found.part == 0.5
    for _ in range(200):
        found.add()
    assert str(found) == "400 of 400, 3 failed, 6.0/s"


@pytest.mark.parametrize(("rate", "said"), [(2.04, "2.0/s"), (0.5, "30.0/min"), (0.01, "36.0/h")])
def test_a_rate_is_told_in_a_unit_in_which_there_are_some(rate: float, said: str) -> None:
    assert pace(rate) == said


@pytest.mark.parametrize(
    ("seconds", "said"), [(59.4, "59 s"), (59.6, "1 min 0 s"), (3599.0, "59 min 59 s"), (7260.0, "2 h 1 min")]
)
def test_a_duration_is_told_in_its_two_largest_units(seconds: float, said: str) -> None:
    assert duration(seconds) == said


WRITE = """
import sys
from pathlib import Path
from cmm_uq.laboratory.schedule.state import Log
log = Log(Path(sys.argv[1]), 500, 100)
for i in range(150):
    log.write(f"{sys.argv[2]} {i}")
"""


def test_two_processes_lose_no_line_while_files_are_begun_anew(tmp_path: Path) -> None:
    path = tmp_path / "schedule.log"
    writers = [subprocess.Popen([sys.executable, "-c", WRITE, str(path), name]) for name in "ab"]
    assert [writer.wait() for writer in writers] == [0, 0]
    files = sorted(tmp_path.glob("schedule.log*"))
    assert len(files) > 1
    assert all(file.stat().st_size <= 500 for file in files)
    lines = [line for file in files for line in file.read_text().splitlines()]
    assert sorted(lines) == sorted(f"{name} {i}" for name in "ab" for i in range(150))


def test_no_more_are_kept_than_said(tmp_path: Path) -> None:
    log = Log(tmp_path / "schedule.log", 1000, 2)
    for i in range(200):
        log.write(f"line {i:04} {'x' * 40}")
    assert sorted(path.name for path in tmp_path.glob("schedule.log*")) == [
        "schedule.log", "schedule.log.1", "schedule.log.2",
    ]  # fmt: skip
    assert "line 0199" in (tmp_path / "schedule.log").read_text()


def test_a_line_is_one_line_whatever_it_holds(tmp_path: Path) -> None:
    Log(tmp_path / "schedule.log", 1000, 1).write("a\nb\x1b[31m\udcff µ")
    assert (tmp_path / "schedule.log").read_text(encoding="utf-8").splitlines() == ["a\\nb\\x1b[31m\\udcff µ"]


def test_a_log_that_cannot_be_written_stops_nothing(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    Log(tmp_path / "file" / "schedule.log", 1000, 1).write("a")
    Log(tmp_path, 1000, 1).write("a")
    Log(None, 1000, 1).write("a")
