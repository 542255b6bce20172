"""A file that is still being written is left alone; one that stands still is read once."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from cmm_uq.base.errors import CmmUqError
from cmm_uq.laboratory.live.running import WatchedFolder
from tests.laboratory.live.session import FakeClock


def test_a_growing_file_is_read_when_it_stands_still_and_once(tmp_path: Path) -> None:
    clock = FakeClock()
    watched, path, read = WatchedFolder(tmp_path, clock), tmp_path / "result.txt", []
    for text in ("a", "ab", "abc"):
        path.write_text(text, encoding="utf-8")
        read += watched.look()
        clock.go(0.5)
    assert read == []
    clock.go(1.0)
    assert [one.content for one in watched.look()] == [b"abc"]
    clock.go(5.0)
    assert watched.look() == []
    path.write_text("abcd", encoding="utf-8")
    watched.look()
    clock.go(1.5)
    assert [one.content for one in watched.look()] == [b"abcd"]


def test_files_come_in_the_order_in_which_they_were_written_and_unfinished_ones_do_not(tmp_path: Path) -> None:
    clock, watched = FakeClock(), WatchedFolder(tmp_path, FakeClock())
    watched = WatchedFolder(tmp_path, clock)
    for name, age in (("b.txt", 20), ("a.txt", 10), ("c.txt.part", 30), (".d.txt", 30)):
        (tmp_path / name).write_text(name, encoding="utf-8")
        os.utime(tmp_path / name, (1_000_000 - age, 1_000_000 - age))
    watched.look()
    clock.go(1.0)
    assert [one.path.name for one in watched.look()] == ["b.txt", "a.txt"]


def test_a_folder_that_is_not_there_is_refused(tmp_path: Path) -> None:
    with pytest.raises(CmmUqError, match="is no folder"):
        WatchedFolder(tmp_path / "none", FakeClock())
