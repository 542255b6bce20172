"""Job folders are found wherever they lie, and one that changed is known by what its files hold, not by their times."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.output import sha256_of
from cmm_uq.laboratory.schedule.jobs import JobFolder, differing, job_folders, quiet_since, snapshot

JOB = '[job]\nid = "{id}"\n[recording]\nfile = "points.csv"\n'


def made(folder: Path, id: str = "a", recording: str | None = "1,2\n") -> Path:  # noqa: A002
    folder.mkdir(parents=True)
    (folder / "job.toml").write_text(JOB.format(id=id))
    if recording is not None:
        (folder / "points.csv").write_text(recording)
    return folder


def found(root: Path, out: Path | None = None) -> list[str]:
    return [job.folder.relative_to(root).as_posix() for job in job_folders(root, out)]


def inputs_of(job: JobFolder) -> dict[str, str]:
    return {name: str(sha256_of(job.folder / name)) for name in ("job.toml", "points.csv")}


def test_jobs_are_found_at_any_depth_by_name_but_not_hidden_nor_inside_a_job_nor_among_the_reports(
    tmp_path: Path,
) -> None:
    for name in ("b", "a/2026/x", "a/2026/x/before", ".unfinished-1", "reports/b"):
        made(tmp_path / name)
    assert found(tmp_path, tmp_path / "reports") == ["a/2026/x", "b"]


def test_a_job_folder_itself_is_found(tmp_path: Path) -> None:
    assert [job.folder for job in job_folders(made(tmp_path / "x"))] == [tmp_path / "x"]


@pytest.mark.parametrize(("name", "told"), [("nowhere", "no such folder"), ("file", "is a file")])
def test_a_folder_that_is_not_there_is_told(tmp_path: Path, name: str, told: str) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(CmmUqError, match=told):
        list(job_folders(tmp_path / name))


@pytest.mark.parametrize("id", ["../../etc", "a/b", "..", "", "x" * 101, "con", "ä"])
def test_an_id_that_no_job_may_have_is_none(tmp_path: Path, id: str) -> None:  # noqa: A002
    """It becomes the name of a folder and of a lock before the job is read whole."""
    made(tmp_path / "x", id)
    (job,) = job_folders(tmp_path)
    assert job.id == ""


@pytest.mark.parametrize("text", ["", "x =", "[job]\nid = 3\n", 'recording = 3\n[job]\nid = "a"\n', "\udcff"])
def test_a_job_file_that_says_nothing_is_found_all_the_same(tmp_path: Path, text: str) -> None:
    made(tmp_path / "x")
    (tmp_path / "x" / "job.toml").write_bytes(text.encode("utf-8", "surrogateescape"))
    (job,) = job_folders(tmp_path)
    assert job == JobFolder(tmp_path / "x", tmp_path)


def test_a_plan_without_a_recording_is_still_to_be_measured_and_a_job_without_one_is_not(tmp_path: Path) -> None:
    folder = made(tmp_path / "x", recording=None)
    (job,) = job_folders(tmp_path)
    assert not job.planned
    (folder / "job.toml").write_text(JOB.format(id="a") + "[plan]\n")
    (job,) = job_folders(tmp_path)
    assert job.planned


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no named pipes here")
def test_a_pipe_in_the_place_of_a_recording_is_not_waited_for(tmp_path: Path) -> None:
    (tmp_path / "a").mkdir()
    (tmp_path / "a" / "job.toml").write_text('[job]\nid = "a"\n[recording]\nfile = "x.csv"\n[plan]\n')
    os.mkfifo(tmp_path / "a" / "x.csv")
    assert [one.planned for one in job_folders(tmp_path)] == [False]
    (tmp_path / "a" / "x.csv").unlink()
    assert [one.planned for one in job_folders(tmp_path)] == [True]


def test_a_change_of_content_is_seen_where_size_and_times_stay(tmp_path: Path) -> None:
    folder = made(tmp_path / "x")
    (job,) = job_folders(tmp_path)
    inputs, before = inputs_of(job), (folder / "points.csv").stat()
    assert differing(job, inputs) == []
    (folder / "points.csv").write_text("1,3\n")
    os.utime(folder / "points.csv", ns=(before.st_atime_ns, before.st_mtime_ns))
    assert differing(job, inputs) == ["points.csv"]


def test_a_change_of_times_alone_is_none_nor_is_a_file_that_the_job_does_not_name(tmp_path: Path) -> None:
    folder = made(tmp_path / "x")
    (job,) = job_folders(tmp_path)
    inputs = inputs_of(job)
    os.utime(folder / "points.csv", (1, 1))
    (folder / "photo.jpg").write_text("")
    assert differing(job, inputs) == []


def test_a_file_that_is_gone_and_one_that_is_read_where_it_is_there_are_changes(tmp_path: Path) -> None:
    folder = made(tmp_path / "x")
    (job,) = job_folders(tmp_path)
    inputs = inputs_of(job)
    (folder / "points.acquired.json").write_text("{}")
    assert differing(job, inputs) == ["points.acquired.json"]
    (folder / "points.csv").unlink()
    assert differing(job, inputs) == ["points.csv", "points.acquired.json"]


def test_a_folder_is_quiet_for_as_long_as_its_newest_file_by_any_of_its_times(tmp_path: Path) -> None:
    """A copy that keeps the times of its files is new by the time at which it was made."""
    folder = made(tmp_path / "x")
    now = (folder / "points.csv").stat().st_ctime
    for name in ("job.toml", "points.csv"):
        os.utime(folder / name, (1, 1))
    now = max((folder / name).stat().st_ctime for name in ("job.toml", "points.csv"))
    assert quiet_since(snapshot(folder), now + 7.0) == pytest.approx(7.0, abs=1e-3)
    os.utime(folder / "points.csv", (now + 3600, now + 3600))
    assert quiet_since(snapshot(folder), now) < 0


def test_two_looks_at_a_folder_differ_when_it_grew_between(tmp_path: Path) -> None:
    folder = made(tmp_path / "x")
    first = snapshot(folder)
    assert snapshot(folder) == first
    with (folder / "points.csv").open("a") as file:
        file.write("3,4\n")
    assert snapshot(folder) != first
    assert snapshot(tmp_path / "gone") == frozenset()
