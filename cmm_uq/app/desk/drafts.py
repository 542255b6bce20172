"""What is begun on the desk and is no job yet: a dropped export with the answers to it, in a folder of the desk's own.

All of it lies in ``.cmm-uq/desk`` of the root, as files, so that a server that was ended loses nothing.
"""

from __future__ import annotations

import contextlib
import json
import re
import secrets
import shutil
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from cmm_uq.app.desk.place import OWN, safe_name, sha256, write_over
from cmm_uq.app.serve.exchange import WebRequest, read_dropped
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.files.content import content_of
from cmm_uq.base.files.limits import JOB_BYTES, TABLE_BYTES

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
