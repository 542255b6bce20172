"""Puts a staged set in place by renames that can be done again, or undone, after any of them."""

from __future__ import annotations

import contextlib
import json
import os
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path

from cmm_uq.base.output.manifest import MANIFEST, plain_name, sha256_of

JOURNAL, NEW, OLD = "journal.json", "new", "old"
PREVIOUS = ".previous"


@dataclass(frozen=True)
class Journal:
    """What is to be done.

    Parameters
    ----------
    token : of the stage.
    new : SHA-256 of each new file, by name.
    replaced : SHA-256 of the files of the former set that new ones replace, by name.
    kept : new name of each file that stands in the way and is kept.
    stale : SHA-256 of files of the former set that the new set does not have, by name.
    """

    token: str
    new: Mapping[str, str]
    replaced: Mapping[str, str]
    kept: Mapping[str, str]
    stale: Mapping[str, str]

    def as_json(self) -> bytes:
        """The file's bytes."""
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
    """Put the set in place, the manifest last. May be called again after it was interrupted anywhere.

    Raises
    ------
    OSError : the system refuses; :func:`rolled_back` undoes what was done.
    """
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
