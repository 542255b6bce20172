"""A set of files in its place: its ``manifest.json``, what it replaces, and its placing by renames.

The manifest says which command wrote a folder's files, for which job, and the hash of each. It is the last file of a set to be
put in place, so that a folder whose files agree with it is one set, whole. Renames can be done again, or undone, after any.

One new file, whole or not at all, and over nothing; what the system refuses to write, in words.
"""

from __future__ import annotations

import contextlib
import errno
import hashlib
import json
import os
import tempfile
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

from cmm_uq import __version__
from cmm_uq.base.errors import CmmUqError, OutputError
from cmm_uq.base.output import interruption
from cmm_uq.base.values import asdict, dataclass

MANIFEST = "manifest.json"
SCHEMA = "cmm-uq/manifest/1"
LARGEST = 4 * 2**20  # bytes of a manifest beyond which it is somebody else's file: a set has a dozen files


@dataclass(frozen=True)
class Owner:
    """Who writes a set, for the job of an id and the origin of its recording; only the same owner may replace it."""

    command: str
    job: str
    origin: str = "measured"

    def __str__(self) -> str:
        measured = "" if self.origin == "measured" else f" ({self.origin})"
        return f"cmm-uq {self.command} for {self.job}{measured}"


@dataclass(frozen=True)
class Manifest:
    """Owner of a set, and SHA-256 of each of its files by name."""

    owner: Owner
    files: Mapping[str, str]

    def as_json(self, sizes: Mapping[str, int]) -> bytes:
        """The file's bytes; ``sizes`` in bytes by name."""
        data = {
            "schema": SCHEMA, "program": f"cmm-uq {__version__}", "command": self.owner.command,
            "job": {"id": self.owner.job, "origin": self.owner.origin},
            "files": {name: {"sha256": self.files[name], "bytes": sizes[name]} for name in sorted(self.files)},
        }  # fmt: skip
        return (json.dumps(data, indent=2, ensure_ascii=False) + "\n").encode()


def read_manifest(folder: Path) -> Manifest | None:
    """The manifest of a folder; ``None`` where there is none that this program wrote."""
    path = folder / MANIFEST
    try:
        if path.is_symlink() or not path.is_file() or path.stat().st_size > LARGEST:
            return None
        return parsed(json.loads(path.read_bytes()))
    except (OSError, ValueError, RecursionError):
        return None


def parsed(data: Any) -> Manifest | None:
    """The manifest in JSON data; ``None`` where it is not one."""
    try:
        if data["schema"] != SCHEMA:
            return None
        owner = Owner(str(data["command"]), str(data["job"]["id"]), str(data["job"]["origin"]))
        files = {str(name): str(entry["sha256"]) for name, entry in data["files"].items()}
    except (TypeError, KeyError, AttributeError):
        return None
    return Manifest(owner, files) if all(plain_name(name) for name in files) else None


def plain_name(name: str) -> bool:
    """Whether a name stays inside its folder, on any system."""
    parts = name.split("/")
    return not any(part in ("", ".", "..") for part in parts) and not any(c in name for c in "\\:\0")


def sha256_of(path: Path) -> str | None:
    """SHA-256 of a regular file, read in blocks; ``None`` where it is none, or cannot be read."""
    try:
        if path.is_symlink() or not path.is_file():
            return None
        with path.open("rb") as file:
            return hashlib.file_digest(file, "sha256").hexdigest()
    except OSError:
        return None


JOURNAL, NEW, OLD = "journal.json", "new", "old"
PREVIOUS = ".previous"


@dataclass(frozen=True)
class Journal:
    """What is to be done: SHA-256 of each new file, of those of the former set that it replaces, and of those that it has not.

    ``kept``: new name of each file that stands in the way.
    """

    token: str
    new: Mapping[str, str]
    replaced: Mapping[str, str]
    kept: Mapping[str, str]
    stale: Mapping[str, str]

    def as_json(self) -> bytes:
        return json.dumps(asdict(self)).encode()

    @classmethod
    def read(cls, placing: Path) -> Journal | None:
        """The journal of a staged set; ``None`` where it was not committed."""
        try:
            data = json.loads((placing / JOURNAL).read_bytes())
            journal = cls(**data)
            names = [*journal.new, *journal.replaced, *journal.kept, *journal.kept.values(), *journal.stale]
        except (OSError, ValueError, TypeError, AttributeError):
            return None
        return journal if all(plain_name(name) for name in names) else None


def place(folder: Path, placing: Path, journal: Journal) -> None:
    """Put the set in place, the manifest last. May be called again after it was interrupted anywhere."""
    for name, kept in journal.kept.items():
        if os.path.lexists(folder / name) and not os.path.lexists(folder / kept):
            (folder / name).rename(folder / kept)
    for name in (*journal.new, MANIFEST):
        if not (placing / NEW / name).exists():
            continue  # it is in place already
        if name in journal.new and sha256_of(folder / name) not in (None, journal.replaced.get(name)):
            (folder / name).rename(folder / free_name(folder, name))  # changed since this was interrupted
        _set_aside(folder, placing, name)
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (placing / NEW / name).replace(folder / name)
    for name, digest in journal.stale.items():
        if sha256_of(folder / name) == digest:
            _set_aside(folder, placing, name)


def rolled_back(folder: Path, placing: Path, journal: Journal) -> bool:
    """Undo a placing that failed; whether that succeeded."""
    try:
        for name in (*journal.new, MANIFEST):
            if not (placing / NEW / name).exists() and os.path.lexists(folder / name):
                (folder / name).rename(placing / NEW / name)
        for name in (*journal.new, *journal.stale, MANIFEST):
            if (placing / OLD / name).exists() and not os.path.lexists(folder / name):
                (placing / OLD / name).rename(folder / name)
        for name, kept in journal.kept.items():
            if os.path.lexists(folder / kept) and not os.path.lexists(folder / name):
                (folder / kept).rename(folder / name)
    except OSError:
        return False
    for name in journal.new:
        with contextlib.suppress(OSError):
            (folder / name).parent.rmdir()  # a folder that was made for a nested name
    return True


def free_name(folder: Path, name: str) -> str:
    """``NAME.previous``, or ``NAME.previous-2`` and so on, whichever is free."""
    candidate, number = f"{name}{PREVIOUS}", 1
    while os.path.lexists(folder / candidate):
        number += 1
        candidate = f"{name}{PREVIOUS}-{number}"
    return candidate


def _set_aside(folder: Path, placing: Path, name: str) -> None:
    """Move the former file into the stage, so that it can come back."""
    if os.path.lexists(folder / name):
        (placing / OLD / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).replace(placing / OLD / name)


WAY_OUT = "Choose another folder with --out, or give --force to keep what is there as NAME.previous"


def journal_for(
    folder: Path, owner: Owner, files: Mapping[str, str], *, inputs: Iterable[Path], force: bool, token: str = ""
) -> Journal:
    """What has to happen to the files of a folder for a new set; ``force`` renames what is not the owner's."""
    old = read_manifest(folder)
    before = {} if old is None else old.files
    stranger = old is not None and old.owner != owner
    if stranger and old is not None and not force:
        raise CmmUqError(f"holds what {old.owner} wrote", where=str(folder), fix=WAY_OUT)
    names = (*files, MANIFEST)
    mine = {} if stranger else {name: digest for name, digest in before.items() if sha256_of(folder / name) == digest}
    in_the_way = [name for name in names if os.path.lexists(folder / name) and name not in mine]
    if stranger:
        in_the_way += [name for name in before if name not in in_the_way and os.path.lexists(folder / name)]
    elif old is not None and MANIFEST in in_the_way:
        in_the_way.remove(MANIFEST)
    given = [path for path in inputs if os.path.exists(path)]  # noqa: PTH110 - raises nothing; who reads it says why not
    for target in [folder / name for name in (*names, *in_the_way)]:
        if target.exists() and any(target.samefile(path) for path in given):
            raise CmmUqError("is an input of this command, and would be replaced", where=str(target),
                             fix="Choose another folder with --out")  # fmt: skip
    if in_the_way and not force:
        why = "was changed after it was written" if in_the_way[0] in before else f"was not written by {owner}"
        if (first := folder / in_the_way[0]).is_file() and not os.access(first, os.R_OK):
            why = "cannot be read: Permission denied"  # so that nobody can tell who wrote it
        raise CmmUqError(why, where=str(first), fix=WAY_OUT)
    kept = {name: free_name(folder, name) for name in in_the_way}
    stale = {name: digest for name, digest in mine.items() if name not in files}
    return Journal(token, dict(files), {name: mine[name] for name in files if name in mine}, kept, stale)


@contextlib.contextmanager
def writing_to(path: Path, fix: str) -> Iterator[None]:
    try:
        yield
    except (OSError, ValueError) as error:
        what = error.strerror or error if isinstance(error, OSError) else error
        raise OutputError(f"cannot be written: {what}", where=str(path), fix=fix) from error


_TAKEN, _FOLDER = "Name another file; nothing is overwritten", "Name a folder that exists"
_MENDED = "Free the disk, mend the permissions, or name another file"


def write_new(out: Path, content: bytes) -> None:
    """Write a file that is not there yet."""
    with new_file(out) as path:
        path.write_bytes(content)


def refuse_taken(out: Path) -> None:
    """Make sure, before there is anything to write, that a new file could be there."""
    if os.path.lexists(out):
        raise OutputError("is there already", where=str(out), fix=_TAKEN)
    if not out.parent.is_dir():
        raise OutputError("cannot be written: no such folder", where=str(out), fix=_FOLDER)


@contextlib.contextmanager
def new_file(out: Path, *, force: bool = False) -> Iterator[Path]:
    """Where a file is to be written that then takes its place; where that fails, nothing is left, after a signal neither."""
    unfinished = _Unfinished()
    with interruption.staged(unfinished):
        try:
            with tempfile.NamedTemporaryFile(dir=out.parent, prefix=".unfinished-", delete=False) as file:
                unfinished.name = file.name
            yield Path(unfinished.name)
            if force and os.path.lexists(out):
                out.rename(out.parent / free_name(out.parent, out.name))
            os.link(unfinished.name, out)
        except FileExistsError:
            raise OutputError("is there already", where=str(out), fix=_TAKEN) from None
        except OSError as error:
            fix = _FOLDER if error.errno in (errno.ENOENT, errno.ENOTDIR) else _MENDED
            raise OutputError(f"cannot be written: {error.strerror}", where=str(out), fix=fix) from error
        finally:
            unfinished.discard()


class _Unfinished:
    """The file before it takes its place."""

    name = ""

    def discard(self) -> None:
        with contextlib.suppress(OSError):
            os.unlink(self.name)  # noqa: PTH108 - may be empty
