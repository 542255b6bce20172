"""One new file, whole or not at all, and what to do where it cannot be."""

from __future__ import annotations

import errno
import os
from pathlib import Path

import pytest

from cmm_uq.base.errors import OutputError
from cmm_uq.base.output.manifest import new_file, write_new


@pytest.mark.parametrize(
    ("number", "fix"),
    [
        (errno.ENOSPC, "Free the disk"),
        (errno.EROFS, "mend the permissions"),
        (errno.EACCES, "mend the permissions"),
        (errno.ENOENT, "Name a folder that exists"),
    ],
)
def test_what_to_do_fits_what_stands_in_the_way(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, number: int, fix: str
) -> None:
    def refused(*_: object) -> None:
        raise OSError(number, os.strerror(number))

    monkeypatch.setattr(os, "link", refused)
    with pytest.raises(OutputError) as found:
        write_new(tmp_path / "new.csv", b"x")
    assert fix in str(found.value.fix)
    assert list(tmp_path.iterdir()) == []


def test_what_is_there_is_kept(tmp_path: Path) -> None:
    write_new(tmp_path / "new.csv", b"first")
    with pytest.raises(OutputError, match="is there already"):
        write_new(tmp_path / "new.csv", b"second")
    assert (tmp_path / "new.csv").read_bytes() == b"first"
    with new_file(tmp_path / "new.csv", force=True) as path:
        path.write_bytes(b"second")
    assert {path.name: path.read_bytes() for path in tmp_path.iterdir()} == {
        "new.csv": b"second", "new.csv.previous": b"first",
    }  # fmt: skip
