"""A batch reports every job as ``report`` does, whatever fails among them, and goes on where it was stopped."""

from __future__ import annotations

import errno
import json
import re
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import pytest

from cmm_uq.app.commands.files import NOT_RECORDED
from cmm_uq.app.commands.laboratory import batch as batch_run, batch_jobs
from cmm_uq.app.commands.laboratory.batch import Batch, BatchOptions, write_batch
from cmm_uq.app.commands.laboratory.batch_jobs import begin, conforming
from cmm_uq.app.commands.reading import read_job
from cmm_uq.app.commands.report import write_report
from cmm_uq.base.errors import CmmUqError, OutputError
from cmm_uq.base.output import staging
from cmm_uq.laboratory.records import open_records
from tests.app.cli.process import run
from tests.laboratory.schedule.small_jobs import small_job

CANNED = "tests.laboratory.schedule.canned"


@pytest.fixture
def canned(monkeypatch: pytest.MonkeyPatch) -> None:
    """What a report says is made up: these tests are about what is around it."""
    monkeypatch.setattr(batch_jobs, "PROGRAM", CANNED)


def contents(folder: Path) -> dict[str, bytes]:
    return {str(path.relative_to(folder)): path.read_bytes() for path in sorted(folder.rglob("*")) if path.is_file()}


def done(jobs: Path, out: Path, **asked: Any) -> Batch:
    return write_batch([jobs], out, BatchOptions(**{"workers": 1, **asked}))


@pytest.mark.long
def test_a_batch_writes_what_report_writes_whatever_the_number_of_workers(tmp_path: Path) -> None:
    jobs = tmp_path / "jobs"
    folders = [small_job(jobs, f"plane-{i}", shift_um=0.2 * i) for i in range(3)]
    one = done(jobs, tmp_path / "one")
    three = write_batch(folders[::-1], tmp_path / "three", BatchOptions(workers=3, results_only=True))
    assert (one.written, one.failed, three.written) == (3, [], 3)
    write_report(folders[1], tmp_path / "alone")
    whole = contents(tmp_path / "one")
    assert contents(tmp_path / "alone") == contents(tmp_path / "one" / "plane-1")
    assert {name: content for name, content in whole.items() if name.endswith("results.json")} == {
        name: content for name, content in contents(tmp_path / "three").items() if "manifest" not in name
    }
    assert all(conforming(json.loads(whole[f"plane-{i}/results.json"])) for i in range(3)) == (not one.not_conforming)


@pytest.mark.long
def test_figures_alone_are_the_same_and_nothing_is_drawn(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    job = small_job(tmp_path, "plane")
    monkeypatch.setattr(
        "cmm_uq.certificate.plots.style.new_figure", lambda height_mm: pytest.fail("a picture is drawn")
    )
    found = begin((0, True))(0, (str(job), dict(read_job(job).inputs), NOT_RECORDED))
    assert list(found) == ["results.json"]


@pytest.mark.long
@pytest.mark.usefixtures("canned")
def test_a_job_that_fails_hangs_or_kills_its_process_stops_no_other(tmp_path: Path) -> None:
    jobs = tmp_path / "jobs"
    for name, remarks in (
        ("a", ""),
        ("b", "refuse"),
        ("c", "hang"),
        ("d", f"kill {tmp_path}/killed"),
        ("e", "mismatch"),
    ):
        small_job(jobs, name, remarks)
    (jobs / "f").mkdir()
    (jobs / "f" / "job.toml").write_text("[job", encoding="utf-8")
    found = done(jobs, tmp_path / "out", workers=2, seconds=1.5)
    assert (found.count, found.written, found.ended, found.not_conforming) == (6, 3, 1, 1)
    assert [(one.id, one.error.problem) for one in found.failed[:2]] == [
        ("b", "is refused"), ("c", "took longer than 1.5 s and was stopped"),
    ]  # fmt: skip
    assert str(jobs / "f") in str(found.failed[2])
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == ["a", "d", "e"]


@pytest.mark.usefixtures("canned")
def test_resumed_it_does_what_is_missing_or_changed_and_nothing_else(tmp_path: Path) -> None:
    jobs, out = tmp_path / "jobs", tmp_path / "out"
    folders = [small_job(jobs, name) for name in "abcd"]
    assert done(jobs, out).written == 4
    before = contents(out)
    found = done(jobs, out, resume=True)
    assert (found.written, found.already) == (0, 4)
    (folders[0] / "recording.csv").write_text((folders[0] / "recording.csv").read_text() + "# checked\n")
    (out / "b" / "manifest.json").unlink()
    (out / "b" / "results.json").unlink()
    (out / "b" / "certificate-simulated.html").unlink()
    (out / "b" / "certificate-simulated.pdf").unlink()
    (out / "b" / "certificate-simulated.xml").unlink()
    found = done(jobs, out, resume=True)
    assert (found.written, found.already) == (2, 2)
    after = contents(out)
    assert {name for name in after if after[name] != before[name]} == {"a/results.json", "a/manifest.json"}
    assert done(jobs, out, resume=True, seed=1).already == 0


@pytest.mark.usefixtures("canned")
def test_a_report_that_was_asked_for_in_another_language_is_made_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    jobs, out = tmp_path / "jobs", tmp_path / "out"
    small_job(jobs, "a")
    done(jobs, out)
    found = batch_jobs.results_of(out / "a")
    assert found is not None
    assert done(jobs, out, resume=True).already == 1
    german = {**found, "job": {**found["job"], "language": "de"}}
    monkeypatch.setattr(batch_jobs, "results_of", lambda folder: german)
    assert done(jobs, out, resume=True).already == 0


@pytest.mark.usefixtures("canned")
def test_every_report_is_recorded_with_its_files_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("CMM_UQ_RECORDS", raising=False)
    monkeypatch.chdir(tmp_path)
    jobs, out = tmp_path / "jobs", tmp_path / "out"
    for name in "abc":
        small_job(jobs, name, "refuse" if name == "b" else "")
    asked = BatchOptions(workers=2, resume=True)
    found = write_batch([jobs], out, asked, records=None)
    assert found.records == str(Path("reports") / "records.db")
    assert write_batch([jobs], out, asked, records=None).already == 2
    with open_records(tmp_path / "reports" / "records.db") as records:
        kept = records.certificates(origin="simulated")
        assert sorted((one.job, Path(one.folder).name, one.values[0].value) for one in kept) == [
            ("a", "a", 1.5),
            ("c", "c", 1.5),
        ]
        assert records.verify() == []


@pytest.mark.usefixtures("canned")
def test_a_certificate_is_never_lost_to_figures_alone(tmp_path: Path) -> None:
    jobs, out = tmp_path / "jobs", tmp_path / "out"
    small_job(jobs, "a")
    done(jobs, out)
    before = contents(out)
    found = done(jobs, out, results_only=True)
    assert "would be lost" in str(found.failed[0])
    assert contents(out) == before
    assert done(jobs, out, results_only=True, resume=True).already == 1
    assert done(jobs, tmp_path / "figures", results_only=True).written == 1
    assert done(jobs, tmp_path / "figures").written == 1


@pytest.mark.usefixtures("canned")
def test_what_others_wrote_fails_that_job_before_it_is_computed(tmp_path: Path) -> None:
    jobs, out = tmp_path / "jobs", tmp_path / "out"
    small_job(jobs, "a", f"kill {tmp_path}/computed")
    (out / "a").mkdir(parents=True)
    (out / "a" / "results.json").write_text("mine")
    found = done(jobs, out)
    assert "was not written by cmm-uq report for a" in str(found.failed[0])
    assert not (tmp_path / "computed").exists()
    assert (out / "a" / "results.json").read_text() == "mine"


def test_two_jobs_with_one_id_are_both_named(tmp_path: Path) -> None:
    small_job(tmp_path / "x", "same")
    small_job(tmp_path / "y", "Same").joinpath("job.toml")
    with pytest.raises(CmmUqError, match=r"y/Same: has the id 'Same', as .*x/same has 'same'"):
        done(tmp_path, tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_no_job_and_no_sense_are_refused(tmp_path: Path) -> None:
    with pytest.raises(CmmUqError, match="no job was found"):
        done(tmp_path, tmp_path / "out")
    with pytest.raises(CmmUqError, match="--workers or --scheduler"):
        BatchOptions(workers=2, scheduler="tcp://127.0.0.1:1")
    with pytest.raises(CmmUqError, match="time limit of 0 s"):
        BatchOptions(seconds=0)
    with pytest.raises(CmmUqError, match="0 tries"):
        BatchOptions(tries=0)
    with pytest.raises(CmmUqError, match="a seed of -1"):
        BatchOptions(seed=-1)


@pytest.mark.usefixtures("canned")
def test_one_folder_given_twice_is_one_job(tmp_path: Path) -> None:
    job = small_job(tmp_path / "jobs", "a")
    found = write_batch([job, job.parent, job / "job.toml"], tmp_path / "out", BatchOptions(workers=1))
    assert (found.count, found.written) == (1, 1)


@pytest.mark.usefixtures("canned")
def test_a_full_disk_ends_the_batch_in_one_line_and_keeps_what_was_written(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:  # fmt: skip
    jobs, out = tmp_path / "jobs", tmp_path / "out"
    for name in "abc":
        small_job(jobs, name)
    write = staging._write

    def full(path: Path, content: bytes) -> None:
        if (out / "a" / "manifest.json").exists():
            raise OSError(errno.ENOSPC, "No space left on device")
        write(path, content)

    monkeypatch.setattr(batch_run, "WRITERS", 1)
    monkeypatch.setattr(staging, "_write", full)
    with pytest.raises(OutputError, match=r"No space left on device.*1 of 3 jobs are written in .*--resume goes on"):
        done(jobs, out)
    assert sorted(path.name for path in out.rglob("*") if path.is_file() and path.parent.name != "a") == []
    monkeypatch.setattr(staging, "_write", write)
    assert done(jobs, out, resume=True).written == 2


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
def test_a_signal_leaves_whole_reports_and_says_how_to_go_on(tmp_path: Path, number: int) -> None:
    jobs, out = tmp_path / "jobs", tmp_path / "out"
    for name in "abcdefgh":
        small_job(jobs, name, "slow")
    script = f"""if 1:
        import sys
        from cmm_uq.app import cli
        from cmm_uq.app.commands.laboratory import batch_jobs
        batch_jobs.PROGRAM = {CANNED!r}
        sys.argv = ["cmm-uq", "batch", {str(jobs)!r}, "--out", {str(out)!r}, "--workers", "2"]
        cli.main()"""
    process = subprocess.Popen([sys.executable, "-c", script], stderr=subprocess.PIPE, text=True)
    while not list(out.glob("*/manifest.json")):
        assert process.poll() is None
        time.sleep(0.02)
    process.send_signal(number)
    _, said = process.communicate(timeout=60)
    assert process.returncode == 128 + number
    written = [path.parent.name for path in out.glob("*/manifest.json")]
    assert 1 <= len(written) < 8
    told = re.fullmatch(
        rf"cmm-uq: interrupted; (\d) of 8 jobs are written in {out}: the same command with --resume goes on\n", said
    )
    assert told is not None
    assert len(written) - int(told[1]) in range(batch_run.WRITERS + 1)  # in place and not counted yet
    assert not list(out.rglob(".*"))
    assert all((out / name / "results.json").exists() for name in written)


@pytest.mark.usefixtures("canned")
def test_the_command_says_what_came_of_it_and_its_exit_code_tells(tmp_path: Path) -> None:
    jobs, out = tmp_path / "jobs", tmp_path / "out"
    small_job(jobs, "a", "mismatch")
    found = run("batch", jobs, "--out", out, "--workers", 1, "--strict", "--json", "--parquet", tmp_path / "v.parquet")
    assert found.returncode == 4
    told = json.loads(found.stdout)
    assert {key: told[key] for key in ("schema", "jobs", "written", "not_conforming", "failed")} == {
        "schema": "cmm-uq/batch/1", "jobs": 1, "written": 1, "not_conforming": 1, "failed": [],
    }  # fmt: skip
    small_job(jobs, "b", "refuse")
    found = run("batch", jobs, "--out", out, "--workers", 1, "--resume")
    assert found.returncode == 2
    assert "2 jobs: 0 written; 1 there already; 1 not conforming or inconsistent; 1 failed" in found.stdout
    assert f"{jobs}/b: job.toml: is refused. Mend it" in found.stdout
    found = run("batch", jobs, "--out", out, "--parquet", tmp_path / "v.parquet")
    assert (found.returncode, found.stderr.count("\n")) == (3, 1)
    assert "is there already" in found.stderr


@pytest.mark.parametrize(
    ("stated", "worst"),
    [(["pass", "fail", "undecided"], "fail"), (["pass", "conditional pass"], "conditional pass"), ([], "none"),
     (["incomplete", "pass"], "incomplete"), (["conditional fail", "undecided"], "conditional fail")],
)  # fmt: skip
def test_one_statement_that_is_no_pass_is_enough(stated: list[str], worst: str) -> None:
    results = {"conformity": [{"decision": word} for word in stated]}
    assert conforming(results) == (worst in ("pass", "none"))
