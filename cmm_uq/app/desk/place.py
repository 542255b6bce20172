"""Where the desk works: names, paths and files below its root, and what is begun there and is no job yet.

Rules of names hold on every system at once, so that a folder can be carried from one to another. Files are never written over
unseen. A dropped export with the answers to it lies in ``.cmm-uq/desk`` of the root, so that a server that was ended loses
nothing.
"""

from __future__ import annotations

import contextlib
import hashlib
import json
import re
import secrets
import shutil
import threading
import unicodedata
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from cmm_uq.app.serve.exchange import WebRequest, read_dropped
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.files.limits import JOB_BYTES, TABLE_BYTES, content_of
from cmm_uq.base.output.staging import replace_file
from cmm_uq.base.values import dataclass, field
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


ANSWERS, LAST = "answers.json", "last.json"
MOST_DRAFTS = 50
OF_ONE = ("folder", "job.date", "job.issued")  # answers that are of one job
_ID = re.compile(r"[0-9a-f]{16}")


@dataclass
class Draft:
    """An export with its answers; ``seen``: SHA-256 of their file as it was read."""

    id: str
    export: str  # path of it below the root
    keys: dict[str, Any] = field(default_factory=dict)
    values: dict[str, str] = field(default_factory=dict)
    seen: str = ""

    @property
    def name(self) -> str:
        return Path(self.export).name

    @property
    def part(self) -> bool:
        """Whether it is the plan of a part."""
        return "part" in self.values


@dataclass(frozen=True)
class DraftFolder:
    """Drafts of a root folder, and what its laboratory filled in last."""

    root: Path

    @property
    def folder(self) -> Path:
        return self.root / OWN / "desk"

    def every(self) -> list[Draft]:
        """The newest first; one whose answers were damaged is told of where it is opened, and stands in nobody's way."""
        found: list[Draft] = []
        for path in sorted(self.folder.glob(f"*/{ANSWERS}"), key=_age, reverse=True):
            with contextlib.suppress(CmmUqError):
                found.append(self.read(path.parent.name))
        return found[:MOST_DRAFTS]

    def take(self, request: WebRequest) -> Draft:
        """A file that was dropped, in a draft of its own; nothing is left of one that did not come whole."""
        if len(self.every()) >= MOST_DRAFTS:
            raise CmmUqError(f"{MOST_DRAFTS} exports lie here unfinished", fix="Finish or delete some of them")
        one = Draft(secrets.token_hex(8), "")
        folder = self.folder / one.id
        folder.mkdir(parents=True)
        try:
            name = received(request, folder)
        except BaseException:
            shutil.rmtree(folder, ignore_errors=True)
            raise
        one.export = f"{OWN}/desk/{one.id}/{name}"
        self.write(one)
        return one

    def read(self, name: str) -> Draft:
        folder = self.folder / name
        if not _ID.fullmatch(name) or not (folder / ANSWERS).is_file():
            raise CmmUqError("is not here any more", where="draft", fix="Drop the export again")
        content = content_of(folder / ANSWERS, JOB_BYTES, "Drop the export again")
        try:
            data = json.loads(content)
            export = str(data["export"])
            return Draft(
                name,
                f"{OWN}/desk/{name}/{safe_name(export)}",
                dict(data["keys"]),
                dict(data["values"]),
                sha256(content),
            )
        except (ValueError, KeyError, TypeError):
            raise CmmUqError("cannot be read", where=f"{name}/{ANSWERS}", fix="Drop the export again") from None

    def write(self, one: Draft) -> None:
        content = as_json({"export": one.name, "keys": one.keys, "values": one.values})
        write_over(self.folder / one.id / ANSWERS, content, one.seen)
        one.seen = sha256(content)

    def delete(self, one: Draft) -> None:
        shutil.rmtree(self.folder / one.id, ignore_errors=True)

    def last(self) -> dict[str, str]:
        """What was filled in last, by key, of any kind."""
        with contextlib.suppress(CmmUqError, ValueError, OSError):
            data = json.loads(content_of(self.folder / LAST, JOB_BYTES, ""))
            return {str(key): str(value) for key, value in data.items()}
        return {}

    def remember(self, values: Mapping[str, str]) -> None:
        """For the next job: all but what is of one measurement."""
        path = self.folder / LAST
        kept = {**self.last(), **{key: value for key, value in values.items() if key not in OF_ONE}}
        with contextlib.suppress(CmmUqError, OSError):
            write_over(path, as_json(kept), sha256(path.read_bytes()) if path.exists() else "")


def received(request: WebRequest, folder: Path, *, written: bool = False) -> str:
    """Name of a file that was dropped, once it lies in a folder, whole, and over nothing."""
    unfinished = folder / f".unfinished-{secrets.token_hex(8)}"
    try:
        with unfinished.open("wb") as file:
            dropped = read_dropped(request, file, TABLE_BYTES.most)
        name = safe_name(dropped.name, written=written)
        if (folder / name).exists():
            raise CmmUqError("is there already", where=name, fix="Give the file another name")
        unfinished.rename(folder / name)
    finally:
        unfinished.unlink(missing_ok=True)
    return name


def as_json(data: Mapping[str, Any]) -> bytes:
    return (json.dumps(data, indent=1, ensure_ascii=False) + "\n").encode()


def _age(path: Path) -> float:
    try:
        return path.stat().st_mtime
    except OSError:
        return 0.0
