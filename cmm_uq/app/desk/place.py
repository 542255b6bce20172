"""Names and paths of the desk: one root folder, nothing outside of it, and files that are never written over unseen.

Rules of names hold on every system at once, so that a folder can be carried from one to another.
"""

from __future__ import annotations

import contextlib
import hashlib
import re
import threading
import unicodedata
from pathlib import Path

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.files.content import content_of
from cmm_uq.base.files.limits import JOB_BYTES
from cmm_uq.base.output.staging import replace_file
from cmm_uq.jobs.source import check_name, device_name

LONGEST = 100  # characters of a name that is made of a dropped one
DEEPEST = 6  # folders below the root that a path may lead through
FOREIGN = "export"  # what a name that cannot be kept begins with
OWN = ".cmm-uq"  # folder of the desk's own files in the root
_writing = threading.Lock()


def safe_name(name: str, *, written: bool = False) -> str:
    r"""A file name that every system takes, as near as can be to one from elsewhere; none that a command has ``written``.

    Examples
    --------
    >>> safe_name("C:\\data\\run 1.csv"), safe_name("../../aux.txt"), safe_name("a:b?.csv. .")
    ('run 1.csv', 'export-aux.txt', 'a_b_.csv')
    """
    last = re.split(r"[/\\]", unicodedata.normalize("NFC", name))[-1]
    plain = "".join("_" if c in '<>:"|?*' else c for c in last if unicodedata.category(c)[0] != "C").strip(". ")
    stem, dot, ending = plain.rpartition(".")
    if len(plain) > LONGEST:
        ending = ending[:10] if dot else ""
        plain = f"{(stem or plain)[: LONGEST - 11].rstrip('. ')}{dot}{ending}".rstrip(". ")
    while len(plain.encode()) > 2 * LONGEST:  # file systems count bytes
        stem, dot, ending = plain.rpartition(".")
        plain = f"{stem[:-1].rstrip('. ')}{dot}{ending}" if stem else ending[:-1]
    try:
        check_name(plain, "")
    except CmmUqError:
        if not (plain and written) or device_name(plain):
            plain = f"{FOREIGN}-{plain}" if plain else FOREIGN
    return plain


def parts_of(path: str) -> tuple[str, ...]:
    """Names of a path below the root, separated by /; one that could lead out of it, or is hidden, is refused."""
    parts = tuple(path.split("/"))
    unfit = any(
        not part
        or part[0] == "."
        or part != part.strip()
        or part[-1] == "."
        or len(part) > 2 * LONGEST
        or any(c in '<>:"|?*\\' or unicodedata.category(c)[0] == "C" for c in part)
        for part in parts
    )
    if unfit or len(parts) > DEEPEST:
        raise CmmUqError("is no path of a file in the folder of the desk", where=repr(path[:80]))
    return parts


def below(root: Path, path: str) -> Path:
    """A file or folder in the root that is there, reached without any link."""
    found = root
    for part in parts_of(path):
        found = found / part
        if found.is_symlink() or getattr(found, "is_junction", bool)():
            raise CmmUqError("is a link, which the desk does not follow", where=path, fix="Copy the file itself there")
    if not found.exists():
        raise CmmUqError("is not there", where=path, fix="It may have been moved or deleted since: go back to the list")
    return found


def sha256(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()


class ChangedError(CmmUqError):
    """A file is another than the one that was read; ``now``: its bytes, empty where it is gone."""

    def __init__(self, path: Path, now: bytes) -> None:
        super().__init__("was changed meanwhile, by another tab, an editor or a command", where=path.name)
        self.now = now


def write_over(path: Path, content: bytes, seen: str) -> None:
    """Write a file whole or not at all, if it still has the SHA-256 that was ``seen``; empty of one that is not there."""
    with _writing:
        now = content_of(path, JOB_BYTES, "") if path.exists() else b""
        if path.is_symlink() or (sha256(now) if path.exists() else "") != seen:
            raise ChangedError(path, now)
        replace_file(path, content, "Free the disk, or mend its permissions")


def plans_in(root: Path) -> list[str]:
    """Files ``plan.csv`` in the root and two levels below, by their paths there."""
    found = (path.relative_to(root) for pattern in ("", "*/", "*/*/") for path in root.glob(f"{pattern}plan.csv"))
    return sorted(path.as_posix() for path in found if not any(part[0] == "." for part in path.parts))


def jobs_in(root: Path) -> list[Path]:
    """Folders of jobs in the root and one level below, the newest first."""
    found: dict[Path, float] = {}
    for file in (path for pattern in ("*/job.toml", "*/*/job.toml") for path in root.glob(pattern)):
        parts = file.relative_to(root).parts
        linked = any(one.is_symlink() for one in (file, *file.parents[: len(parts) - 1]))
        if not (linked or parts[0] == "reports" or any(part[0] == "." for part in parts)):
            with contextlib.suppress(OSError):
                found[file.parent] = file.stat().st_mtime
    return sorted(found, key=lambda folder: (-found[folder], folder))
