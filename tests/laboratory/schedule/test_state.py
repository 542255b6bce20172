"""What was done is known from run to run: from the records, or from the folder of the reports where there are none."""

from __future__ import annotations

import hashlib
import json
import shutil
from collections.abc import Iterator
from pathlib import Path

import pytest

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.output import Owner, staged
from cmm_uq.laboratory.records import open_records
from cmm_uq.laboratory.records.store import Records
from cmm_uq.laboratory.schedule.jobs import JobFolder, JobReporting
from cmm_uq.laboratory.schedule.state import FolderState, RecordsState
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
    assert state.reported("a") is None
    report(tmp_path)
    assert state.reported("a") == INPUTS
    report(tmp_path, "diagnosed", command="diagnose")
    assert state.reported("diagnosed") is None
    (tmp_path / "a" / "results.json").write_text('{"job": {"inputs_sha256": {}}}')
    assert state.reported("a") is None


def test_what_the_folder_has_and_the_records_have_not_is_to_be_recorded_yet(tmp_path: Path, records: Records) -> None:
    state = RecordsState(records, tmp_path / "reports")
    digest = report(tmp_path / "reports")
    assert state.reported("a") is None
    record(records, digest)
    assert state.reported("a") == INPUTS


def test_a_report_that_was_taken_away_is_not_made_again_and_of_several_the_newest_counts(
    tmp_path: Path, records: Records
) -> None:
    """The laboratory's archive is no reason for a second certificate."""
    state = RecordsState(records, tmp_path / "reports")
    record(records, "a" * 64, inputs={"job.toml": "0" * 64})
    record(records, report(tmp_path / "reports"))
    shutil.rmtree(tmp_path / "reports" / "a")
    assert state.reported("a") == INPUTS


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
    assert [entry.kind for entry in records.entries()] == ["sent", "report"]
    assert records.verify(files=False) == []
