"""Every command of the program has hostile files, and each is given some; the study gives more."""

from __future__ import annotations

import os
import random
import tempfile
from pathlib import Path

import pytest

pytest.importorskip("pyhanko")

from benchmarks.hostile.every_command import DEAR, LINES, commands, lay_out, unaltered
from benchmarks.hostile.pool import run_all
from benchmarks.hostile.rows import altered
from cmm_uq.app.commands.report import write_report
from cmm_uq.base.errors import CmmUqError
from cmm_uq.laboratory.records import open_records
from cmm_uq.laboratory.records.facts import Entry
from cmm_uq.laboratory.records.listing import outcomes_of
from tests.app.cli.process import run
from tests.conftest import ROOT


@pytest.fixture(autouse=True)
def passphrase(monkeypatch: pytest.MonkeyPatch) -> None:
    """Laying files out sets it for commands that are started; no other test finds it."""
    monkeypatch.setenv("CMM_UQ_SIGN_PASSPHRASE", "open")


def test_no_command_is_without_cases() -> None:
    assert sorted({line.command for line in LINES}) == commands()


@pytest.mark.parametrize("number", range(len(LINES)), ids=lambda number: LINES[number].words[:50])
def test_each_command_line_ends_well_on_files_that_nobody_altered(number: int, tmp_path: Path) -> None:
    """So that what the study refuses is refused for what was altered; the dear ones have tests of their own."""
    line = LINES[number]
    if line.command == "selftest" or (line.command in (*DEAR, "serve", "desk") and "out" in line.words):
        pytest.skip("takes seconds: of the study alone")
    lay_out(unaltered(number), tmp_path)
    if line.command in ("serve", "desk"):
        done = run_all([number], 3, 1, tmp_path / "work", "unaltered")
        assert [(record["code"], record["found"]) for record in done] == [(0, [])]
        return
    done = run(*line.arguments, cwd=tmp_path)
    assert done.returncode == line.ends, done.stderr


@pytest.mark.long
def test_a_command_reads_hostile_files_or_refuses_them_in_one_line(tmp_path: Path) -> None:
    numbers = [number for number, line in enumerate(LINES) if line.command not in DEAR]
    records = list(run_all(numbers, 3, 1, tmp_path, "commands"))
    assert [(r["what"], r["found"], r["said"]) for r in records if r["found"]] == []
    assert {r["target"] for r in records} == set(commands()) - set(DEAR)


def test_records_altered_by_sql_differ_and_are_still_a_database_or_are_said_to_be_none() -> None:
    """The alterations are real: most files differ, and SQLite opens them."""
    with tempfile.TemporaryDirectory() as folder:
        place = Path(folder) / "records.db"
        open_records(place, create=True).close()
        before = place.read_bytes()
    made = [altered(before, random.Random(number)) for number in range(60)]
    assert sum(content != before for content, _ in made) > 40
    assert len({what for _, what in made}) > 40


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


@pytest.mark.long
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
