"""Files are written whole or not at all."""

from __future__ import annotations

import errno
import os
from pathlib import Path

import pytest

from cmm_uq.errors import CmmUqError
from cmm_uq.writing import staging, write_whole


def written(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir()) if folder.exists() else []


def test_all_files_arrive_and_nothing_else_stays(tmp_path: Path) -> None:
    out = tmp_path / "a" / "b"
    with staging(out) as place:
        write_whole(place, out, {"x.txt": b"x", "y.bin": b"\0"})
    assert written(out) == ["x.txt", "y.bin"]


def test_an_interruption_leaves_no_trace(tmp_path: Path) -> None:
    out = tmp_path / "a" / "b"
    with pytest.raises(KeyboardInterrupt), staging(out):
        raise KeyboardInterrupt
    assert written(tmp_path) == []


def test_what_stood_there_stays_when_a_new_file_cannot_be_written(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    out = tmp_path / "out"
    with staging(out) as place:
        write_whole(place, out, {"x.txt": b"old"})

    def full(descriptor: int) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(CmmUqError, match="No space left on device"), staging(out) as place:
        write_whole(place, out, {"x.txt": b"new"})
    assert written(out) == ["x.txt"]
    assert (out / "x.txt").read_bytes() == b"old"


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="no /dev/full on this system")
def test_a_full_disk_is_told_as_such(tmp_path: Path) -> None:
    out = tmp_path / "out"
    with staging(out) as place:
        (place / "x.txt").symlink_to("/dev/full")
        with pytest.raises(CmmUqError, match="No space left"):
            write_whole(place, out, {"x.txt": b"x"})
    assert written(tmp_path) == []


def test_a_file_in_the_way_is_named(tmp_path: Path) -> None:
    out = tmp_path / "out"
    out.write_text("mine")
    with pytest.raises(CmmUqError, match=r"out: is a file, not a folder.*--out"), staging(out):
        pass
    assert out.read_text() == "mine"


def test_a_place_below_a_file_is_told_as_unwritable(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(CmmUqError, match="cannot be written"), staging(tmp_path / "file" / "out"):
        pass
