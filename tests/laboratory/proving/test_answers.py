"""Answers of processes are kept as they come: a kill loses none, and no number of processes changes them."""

from __future__ import annotations

import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import pytest

from cmm_uq.base.errors import CmmUqError
from cmm_uq.laboratory.proving.answers import RECORDS, AnswersFolder, Record, answer_tasks
from cmm_uq.laboratory.proving.cases import canonical_json
from tests.conftest import ROOT
from tests.laboratory.proving.interrupted import PROGRAM, TASKS, TRUTH, main


def answers(tasks: dict[int, Any], workers: int) -> dict[int, Record]:
    found: dict[int, Record] = {}
    answer_tasks(PROGRAM, 0.0, tasks, workers, keep=lambda record: found.update({record["number"]: record}))
    return found


@pytest.mark.long
def test_a_run_that_was_killed_goes_on_with_every_answer_that_it_had(tmp_path: Path) -> None:
    folder = tmp_path / "kept"
    command = [sys.executable, "-m", "tests.laboratory.proving.interrupted", str(folder), "0.15"]
    process = subprocess.Popen(command, cwd=ROOT)
    records = folder / RECORDS
    while not records.exists() or records.read_bytes().count(b"\n") < 3:
        assert process.poll() is None
        time.sleep(0.02)
    process.kill()
    process.wait()
    before = records.read_bytes()
    assert 3 <= before.count(b"\n") < len(TASKS)
    main(folder, 0.0)
    after = records.read_bytes()
    assert after.startswith(before[: before.rindex(b"\n") + 1])
    assert sorted(after.splitlines()) == sorted(canonical_json(record).strip() for record in answers(TASKS, 1).values())


def test_a_torn_line_is_dropped_and_asked_again(tmp_path: Path) -> None:
    whole = canonical_json({"number": 0, "square": 0})
    AnswersFolder(tmp_path, TRUTH).close()
    (tmp_path / RECORDS).write_bytes(whole + b'{"number":1,"squ')
    kept = AnswersFolder(tmp_path, TRUTH)
    assert list(kept.records) == [0]
    kept.keep({"number": 2, "square": 4})
    kept.close()
    assert (tmp_path / RECORDS).read_bytes() == whole + canonical_json({"number": 2, "square": 4})


def test_another_truth_is_refused_and_what_was_kept_stays(tmp_path: Path) -> None:
    kept = AnswersFolder(tmp_path, TRUTH)
    kept.keep({"number": 0})
    kept.close()
    with pytest.raises(CmmUqError, match="another truth"):
        AnswersFolder(tmp_path, b'{"run":2}\n')
    assert (tmp_path / RECORDS).read_bytes() == canonical_json({"number": 0})


def test_two_at_once_are_refused(tmp_path: Path) -> None:
    kept = AnswersFolder(tmp_path, TRUTH)
    with pytest.raises(CmmUqError, match="at work"):
        AnswersFolder(tmp_path, TRUTH)
    kept.close()
    AnswersFolder(tmp_path, TRUTH).remove()
    assert not tmp_path.exists()


def test_a_process_that_dies_and_an_answer_that_is_refused_end_the_run_in_words() -> None:
    with pytest.raises(CmmUqError, match="processes ended before its work was done"):
        answers({0: "die"}, 1)
    with pytest.raises(CmmUqError, match="this is refused"):
        answers({0: None, 1: "refuse"}, 1)
