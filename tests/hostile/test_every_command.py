"""Every command of the program has hostile files, and each is given some; the study gives more."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

pytest.importorskip("pyhanko")

from benchmarks.hostile.every_command import ARGUMENTS, commands
from benchmarks.hostile.pool import run_all
from cmm_uq.app.commands.report import write_report
from cmm_uq.base.errors import CmmUqError
from cmm_uq.laboratory.records import open_records
from cmm_uq.laboratory.records.facts import Entry
from cmm_uq.laboratory.records.listing import outcomes_of
from tests.conftest import ROOT

DEAR = ("part", "batch", "prove", "diagnose", "report", "plan")  # commands that compute for seconds: of the study alone


def test_no_command_is_without_cases() -> None:
    assert sorted(ARGUMENTS) == commands()


def test_a_command_reads_hostile_files_or_refuses_them_in_one_line(tmp_path: Path) -> None:
    names = sorted(ARGUMENTS)
    numbers = [number for number in range(len(names)) if names[number] not in DEAR]
    records = list(run_all(numbers, 3, 1, tmp_path, "commands"))
    assert [(r["what"], r["found"], r["said"]) for r in records if r["found"]] == []
    assert {r["target"] for r in records} == set(names) - set(DEAR)


def test_an_entry_that_is_no_json_is_named_by_its_number() -> None:
    with pytest.raises(CmmUqError, match="entry 7 is not as it was recorded"):
        _ = Entry(7, "2026-01-01T00:00:00Z", "report", '{"a": 1', "", "").data


def test_a_refused_report_makes_no_records(tmp_path: Path) -> None:
    job = tmp_path / "job"
    job.mkdir()
    for path in (ROOT / "examples" / "iota-1102-20C").iterdir():
        rows = path.read_text(encoding="utf-8").splitlines(keepends=True)
        (job / path.name).write_text("".join(rows[:3] if path.suffix == ".csv" else rows), encoding="utf-8")
    with pytest.raises(CmmUqError):
        write_report(job, tmp_path / "out", records=tmp_path / "records.db")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["job"]


def test_records_whose_entry_is_no_json_are_refused_in_words(tmp_path: Path) -> None:
    write_report(ROOT / "examples" / "plane-simulated", tmp_path / "out", records=tmp_path / "records.db")
    with open_records(tmp_path / "records.db") as records:
        with records.engine.begin() as connection:
            triggers = "SELECT name FROM sqlite_master WHERE type = 'trigger'"
            for (name,) in connection.exec_driver_sql(triggers).all():
                connection.exec_driver_sql(f'DROP TRIGGER "{name}"')
            connection.exec_driver_sql("UPDATE entries SET content = '{' || content")
        with pytest.raises(CmmUqError, match="not as it was recorded"):
            outcomes_of(records, [1])


def test_a_pipe_is_not_waited_for_as_records(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "records.db")
    with pytest.raises(CmmUqError, match="is no file, and records are one"):
        open_records(tmp_path / "records.db")
