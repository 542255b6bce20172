"""Only regular files are read, without waiting, and never more of them than their limit."""

from __future__ import annotations

import os
import socket
from pathlib import Path

import pytest

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.files.limits import Limit, content_of, text_of

TEN = Limit(10, "bytes", "test", "it is one")
POSIX = pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no such files here")


def refused(path: Path) -> str:
    with pytest.raises(CmmUqError) as caught:
        content_of(path, TEN, "Mend its name")
    return str(caught.value)


def test_a_file_up_to_its_limit_is_read_whole(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    path.write_bytes(b"0123456789")
    assert content_of(path, TEN, "") == b"0123456789"
    path.write_bytes(b"0123456789\n")
    assert refused(path).endswith("a.csv: is larger than the 10 bytes that are read of such a file. "
                                  "Check that it is the right file")  # fmt: skip


def test_what_is_missing_or_a_folder_is_said_to_be_so(tmp_path: Path) -> None:
    assert "none.csv: no such file. Mend its name" in refused(tmp_path / "none.csv")
    assert "is a folder, not a file" in refused(tmp_path)


@POSIX
def test_a_pipe_is_refused_without_waiting_for_a_writer(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")
    assert "pipe: is a pipe, not a file" in refused(tmp_path / "pipe")


@POSIX
def test_devices_and_sockets_are_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    assert "is a device, not a file" in refused(Path("/dev/zero"))
    monkeypatch.chdir(tmp_path)
    with socket.socket(socket.AF_UNIX) as server:
        server.bind("s")
        assert "cannot be read" in refused(Path("s"))


@POSIX
def test_links_that_lead_to_themselves_are_refused(tmp_path: Path) -> None:
    (tmp_path / "loop").symlink_to("loop")
    assert "loop: cannot be read: " in refused(tmp_path / "loop")


@pytest.mark.parametrize("name", ["a\0b", "a" * 5000])
def test_a_name_that_no_system_takes_is_refused(tmp_path: Path, name: str) -> None:
    assert "cannot be read: " in refused(tmp_path / name)


@pytest.mark.parametrize(
    ("content", "says"),
    [
        (b"a\nb\xff", "line 2: is not UTF-8 text"),
        ("a".encode("utf-16"), "line 1: is not UTF-8 text"),
        ("a".encode("utf-16-le"), "contains zero bytes"),
    ],
)
def test_what_is_no_text_is_refused(content: bytes, says: str) -> None:
    with pytest.raises(CmmUqError, match=says):
        text_of(content, "a.csv")


def test_a_byte_order_mark_is_no_part_of_the_text() -> None:
    assert text_of("\ufeffµ".encode(), "a.csv") == "µ"
