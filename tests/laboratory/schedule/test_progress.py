"""What is told of the pace of a run is arithmetic on what was counted."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from cmm_uq.laboratory.schedule.state import Log, Pace, duration, pace


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
