"""A job has one run at it; what a run that was killed held is free, and said to be left."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from cmm_uq.base.errors import OutputError
from cmm_uq.laboratory.schedule.state import turn, turn_at, was_left

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
