"""A run makes one certificate a job however often it runs, and whatever goes wrong with one stops none of the others."""

from __future__ import annotations

import datetime as dt
import os
import shutil
from pathlib import Path

import pytest

from cmm_uq.base.errors import CmmUqError, OutputError
from cmm_uq.laboratory.schedule.jobs import JobFolder, Snapshot, snapshot
from cmm_uq.laboratory.schedule.state import FolderState, turn, turn_at
from tests.laboratory.schedule.runs import Jobs, made
from tests.laboratory.schedule.told import notice


@pytest.fixture
def jobs(tmp_path: Path) -> Jobs:
    for name in "abc":
        made(tmp_path, name)
    return Jobs(tmp_path)


def failing(name: str, error: Exception, times: int = 10**6) -> object:
    left = [times]

    def before(job: JobFolder) -> None:
        if job.id == name and left[0]:
            left[0] -= 1
            raise error

    return before


def test_each_job_is_reported_once_and_again_when_it_changed(jobs: Jobs) -> None:
    assert jobs.run() == 0
    assert jobs.reported == ["a", "b", "c"]
    assert jobs.run() == 0
    assert jobs.reported == []
    assert set(jobs.states().values()) == {"unchanged"}
    made(jobs.root, "b", "3,4\n")
    assert jobs.run() == 0
    assert jobs.reported == ["b"]
    assert [line["why"] for line in jobs.lines if line.get("job") == "b"] == ["changed: points.csv"]


def test_a_dry_run_says_what_would_happen_and_leaves_nothing_behind(jobs: Jobs) -> None:
    made(jobs.root, "a2", id="a")
    assert jobs.run(dry=True) == 2
    assert jobs.states() == {"a": "refused", "b": "would report", "c": "would report"}
    assert not jobs.out.exists()
    assert jobs.logged == []
    shutil.rmtree(jobs.root / "a2")
    jobs.run()
    assert jobs.run(dry=True) == 0
    assert set(jobs.states().values()) == {"unchanged"}


@pytest.mark.parametrize(
    ("word", "events", "code"),
    [("1,2", [], 0), ("fail", ["fail"], 1), ("incomplete", ["incomplete"], 1), ("mismatch", ["mismatch"], 1)],
)
def test_what_needs_a_person_is_told_once_and_is_in_the_exit_code(
    jobs: Jobs, word: str, events: list[str], code: int
) -> None:
    made(jobs.root, "b", word)
    assert jobs.run() == code
    assert jobs.run() == 0
    assert [message.event for message in jobs.channel.messages] == events


@pytest.mark.parametrize("error", [CmmUqError("no such file"), MemoryError(), ZeroDivisionError("division by zero")])
def test_a_job_that_fails_stops_none_of_the_others(jobs: Jobs, error: Exception) -> None:
    jobs.before = failing("a", error)
    assert jobs.run() == 2
    assert jobs.reported == ["b", "c"]
    assert jobs.states()["a"] == "refused"
    (line,) = [line for line in jobs.lines if line.get("job") == "a"]
    assert set(line["error"]) == {"problem", "where", "fix"}
    assert line["events"] == ["error"]


def test_an_error_is_told_once_while_it_stands_and_again_when_it_comes_back(jobs: Jobs) -> None:
    broken = failing("a", CmmUqError("no such file"))
    for before in (broken, broken, lambda job: None, broken, broken):
        jobs.before = before
        made(jobs.root, "a", f"{len(jobs.logged)}\n")
        jobs.now += dt.timedelta(days=1)
        jobs.run()
    assert jobs.channel.titles == ["error: a", "error: a"]


def test_a_folder_that_is_not_there_is_bad_input_and_the_others_go_on(jobs: Jobs) -> None:
    jobs.folders = [jobs.root / "unmounted", jobs.root]
    assert jobs.run() == 2
    assert jobs.reported == ["a", "b", "c"]
    assert jobs.run() == 2
    assert [message.about for message in jobs.channel.messages] == [str(jobs.root / "unmounted")]


def test_a_folder_without_a_job_is_bad_input_unless_it_may_be_empty(tmp_path: Path) -> None:
    """A drive that is not mounted is an empty folder."""
    assert Jobs(tmp_path).run() == 2
    assert Jobs(tmp_path, settings={"may_be_empty": True}).run() == 0


def test_two_jobs_of_one_id_are_both_refused_and_named(jobs: Jobs) -> None:
    """Otherwise each would replace the other's certificate in every run; names differ by case alone are one on Windows."""
    made(jobs.root, "other", id="A")
    assert jobs.run() == 2
    assert jobs.reported == ["b", "c"]
    told = [line["error"]["problem"] for line in jobs.lines if line.get("state") == "refused"]
    assert sorted(told) == [
        f"its id 'A' is that of {jobs.root / 'a'} too",
        f"its id 'a' is that of {jobs.root / 'other'} too",
    ]


def test_a_job_named_twice_is_reported_once(jobs: Jobs) -> None:
    jobs.folders = [jobs.root, jobs.root / "a", jobs.root / "b" / ".."]
    assert jobs.run() == 0
    assert jobs.reported == ["a", "b", "c"]


def test_a_folder_that_vanishes_meanwhile_is_no_error(jobs: Jobs) -> None:
    def archived(job: JobFolder) -> None:
        shutil.rmtree(jobs.root / "b", ignore_errors=True)
        if job.id == "b":
            raise CmmUqError("no such file")

    jobs.before = archived
    assert jobs.run() == 0
    assert jobs.states() == {"a": "reported", "b": "gone", "c": "reported"}
    assert jobs.channel.messages == []


def test_a_schedules_folder_that_vanishes_meanwhile_is_one(jobs: Jobs) -> None:
    def unmounted(job: JobFolder) -> None:
        (jobs.root / "jobs").rename(jobs.root / "away")
        raise CmmUqError("no such file")

    made(jobs.root / "jobs", "d")
    jobs.folders, jobs.before = [jobs.root / "jobs"], unmounted
    assert jobs.run() == 2
    assert jobs.channel.titles == ["error: d"]


def test_a_folder_that_is_still_being_copied_is_left_for_the_next_run(jobs: Jobs) -> None:
    jobs.now = dt.datetime.now(dt.UTC)
    jobs.asleep = lambda: made(jobs.root, "b", f"{len(jobs.slept)}\n" * 2) and None
    assert jobs.run() == 0
    assert jobs.states() == {"a": "reported", "b": "waiting", "c": "reported"}
    assert jobs.slept[0] == 60.0  # one wait for all of them
    assert sum(jobs.slept) == 60.0
    jobs.now += dt.timedelta(minutes=5)
    assert jobs.run() == 0
    assert jobs.states()["b"] == "reported"


@pytest.mark.parametrize(("named", "state"), [("b", "reported"), ("C", "waiting")])
def test_a_job_that_was_read_before_it_was_whole_is_read_again(
    jobs: Jobs, named: str, state: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Its last byte comes between the first look into job.toml and the one at the folder; then it may have another's id."""
    path = jobs.root / "b" / "job.toml"
    path.write_text("[jo")
    jobs.now = dt.datetime.now(dt.UTC)

    def completed(folder: Path) -> Snapshot:
        made(jobs.root, "b", id=named) if path.read_text() == "[jo" else None
        return snapshot(folder)

    monkeypatch.setattr("cmm_uq.laboratory.schedule.jobs.snapshot", completed)
    assert jobs.run() == 0
    assert [line["state"] for line in jobs.lines if line.get("folder") == str(jobs.root / "b")] == [state]
    assert jobs.channel.messages == []


def test_a_clock_that_jumped_back_keeps_no_job_waiting(jobs: Jobs) -> None:
    """All files are of the future then; that nothing changed between two looks is what counts."""
    jobs.now = dt.datetime(2020, 1, 1, tzinfo=dt.UTC)
    assert jobs.run() == 0
    assert jobs.reported == ["a", "b", "c"]
    assert jobs.run() == 0
    assert jobs.reported == []


def test_a_plan_that_is_still_to_be_measured_waits(jobs: Jobs) -> None:
    path = jobs.root / "b" / "job.toml"
    path.write_text(path.read_text() + "[plan]\n")
    (jobs.root / "b" / "points.csv").unlink()
    assert jobs.run() == 0
    assert jobs.states()["b"] == "waiting"


def test_what_may_pass_is_tried_again_after_the_others_with_longer_and_longer_waits(jobs: Jobs) -> None:
    jobs.before = failing("a", OutputError("the records are locked"), times=2)
    assert jobs.run() == 0
    assert jobs.reported == ["b", "c", "a"]
    assert jobs.slept == [1.0, 2.0]
    assert jobs.channel.messages == []


def test_what_does_not_pass_is_told_and_left_for_the_next_run(jobs: Jobs) -> None:
    jobs.before = failing("a", OutputError("No space left on device"))
    assert jobs.run() == 3
    assert jobs.states()["a"] == "failed"
    assert jobs.channel.titles == ["error: a"]
    jobs.before = lambda job: None
    assert jobs.run() == 0
    assert jobs.reported == ["a"]


def test_where_output_is_impossible_for_several_in_a_row_no_more_are_computed_before_it_is_waited(
    tmp_path: Path,
) -> None:
    for i in range(10):
        made(tmp_path, f"job-{i}")
    asked: list[str] = []

    def full(job: JobFolder) -> None:
        asked.append(job.id)
        if not jobs.slept:
            raise OutputError("No space left on device")

    jobs = Jobs(tmp_path, before=full)
    assert jobs.run() == 0
    assert len(asked) == 3 + 10
    assert len(jobs.reported) == 10


def test_folders_that_cannot_be_written_keep_no_other_job_from_its_turn(tmp_path: Path) -> None:
    for name in ("a", "b", "c", "d", "e"):
        made(tmp_path, name)

    def refused(job: JobFolder) -> None:
        if job.id in "abc":
            raise OutputError("Permission denied")

    jobs = Jobs(tmp_path, before=refused)
    assert jobs.run() == 3
    assert jobs.reported == ["d", "e"]
    assert jobs.slept[0] == 1.0


def test_where_even_a_message_cannot_be_kept_it_is_sent_at_once(jobs: Jobs, monkeypatch: pytest.MonkeyPatch) -> None:
    """A full disk is what a person has to hear of most."""

    def full(descriptor: int) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", full)
    assert jobs.run() == 3
    assert sorted(jobs.channel.titles) == ["error: a", "error: b", "error: c"]


def test_records_that_are_lost_in_the_middle_stop_neither_the_jobs_nor_the_messages(jobs: Jobs) -> None:
    class Lost(FolderState):
        def sent(self, key: str) -> bool:
            raise CmmUqError("the server closed the connection")

    for name in "ab":
        made(jobs.root, name, "fail")
    jobs.state = Lost(jobs.out)
    assert jobs.run() == 3
    assert jobs.states() == {"a": "refused", "b": "refused", "c": "reported"}
    assert sorted(jobs.channel.titles) == ["error: a", "error: b"]
    jobs.state = None
    jobs.run()
    assert jobs.reported == []
    assert sorted(jobs.channel.titles)[2:] == ["fail: CMM 3 (job a)", "fail: CMM 3 (job b)"]


def test_a_job_that_another_run_is_at_is_left_to_it(jobs: Jobs) -> None:
    with turn(jobs.out / ".scheduled" / "locks" / "b.lock"):
        assert jobs.run() == 0
    assert jobs.states()["b"] == "busy"
    assert jobs.run() == 0
    assert jobs.states()["b"] == "reported"


def test_a_job_that_ended_the_last_run_comes_last(jobs: Jobs) -> None:
    left = turn_at(jobs.out / ".scheduled" / "locks" / "a.lock")
    assert left is not None
    os.close(left.descriptor)  # as when the process is killed
    assert jobs.run() == 0
    assert jobs.reported == ["b", "c", "a"]


def test_a_run_that_ended_between_a_certificate_and_its_message_is_made_up_for(jobs: Jobs) -> None:
    made(jobs.root, "b", "fail")
    jobs.channel.events = frozenset()
    jobs.run()
    assert jobs.channel.messages == []
    jobs.channel.events = frozenset({"fail"})
    left = turn_at(jobs.out / ".scheduled" / "locks" / "b.lock")
    assert left is not None
    os.close(left.descriptor)
    jobs.run()
    assert jobs.reported == []
    assert jobs.channel.titles == ["fail: CMM 3 (job b)"]
    jobs.run()
    assert len(jobs.channel.messages) == 1


def test_a_message_that_does_not_go_out_needs_a_person_and_goes_out_with_the_next_run(jobs: Jobs) -> None:
    made(jobs.root, "b", "fail")
    jobs.channel.failures = 3
    jobs.run()
    assert jobs.channel.asked == 3
    assert jobs.slept == [1.0, 2.0]
    assert jobs.lines[-1]["messages_waiting"] == 1
    (told,) = [line for line in jobs.lines if "message" in line]
    assert not told["sent"]
    assert jobs.run() == 0
    assert jobs.channel.titles == ["fail: CMM 3 (job b)"]


def test_what_is_due_goes_out_once_and_with_a_clock_that_is_wrong_the_jobs_go_on(jobs: Jobs) -> None:
    asked: list[dt.date] = []

    def due(on: dt.date) -> list[object]:
        asked.append(on)
        return [notice("CMM 3", "due", "2027-01-31")]

    jobs.due = due  # type: ignore[assignment]
    assert jobs.run() == 1
    assert jobs.run() == 0
    assert jobs.channel.titles == ["due: CMM 3"]
    assert asked == [jobs.now.date()] * 2

    def wrong(on: dt.date) -> list[object]:
        raise CmmUqError("the newest entry is of tomorrow")

    jobs.due = wrong  # type: ignore[assignment]
    made(jobs.root, "d")
    assert jobs.run() == 2
    assert jobs.reported == ["d"]


def test_a_certificate_that_a_person_wrote_into_stands(jobs: Jobs) -> None:
    jobs.run()
    (jobs.out / "b" / "certificate.html").write_text("with a remark")
    assert jobs.run() == 0
    assert jobs.reported == []


def test_a_certificate_that_is_gone_or_whose_results_were_changed_is_made_again(jobs: Jobs) -> None:
    jobs.run()
    (jobs.out / "a" / "certificate.html").unlink()
    shutil.rmtree(jobs.out / "b")
    jobs.run()
    assert jobs.reported == ["a", "b"]


def test_every_line_says_how_it_counts_and_the_last_is_of_the_run(jobs: Jobs) -> None:
    made(jobs.root, "b", "fail")
    code = jobs.run()
    assert {line["schema"] for line in jobs.lines} == {"cmm-uq/scheduled/1"}
    assert code == jobs.lines[-1]["exit_code"] == max(line["exit_code"] for line in jobs.lines[:-1])
    assert jobs.lines[-1]["run"] == {"reported": 3}
    assert jobs.logged[-1].endswith("run ended with 1: 3 reported")
