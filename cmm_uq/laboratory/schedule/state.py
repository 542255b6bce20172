"""What earlier runs have done: which inputs a job was last reported from, which messages were sent, which problems stand.

The records of the laboratory keep it, or the folder of the reports where there are none: the manifest of a report says that
it is whole, its results.json what it was made from.
"""

from __future__ import annotations

import contextlib
import hashlib
import json
import os
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

from cmm_uq.base.errors import CmmUqError, OutputError
from cmm_uq.base.files.content import content_of
from cmm_uq.base.files.limits import TABLE_BYTES
from cmm_uq.base.output import read_manifest, sha256_of
from cmm_uq.base.output.new_file import write_new
from cmm_uq.jobs.source import RESULTS

if TYPE_CHECKING:
    from cmm_uq.laboratory.records.facts import RecordedCertificate
    from cmm_uq.laboratory.records.store import Records

PRIVATE = ".scheduled"  # folder beside the reports with locks and messages
COMMAND = "report"


class State(Protocol):
    """What is remembered from run to run."""

    def reported(self, job: str) -> Mapping[str, str] | None:
        """SHA-256 by name of every file that a job's newest certificate was made from; ``None`` where it has none."""
        ...

    def released(self, job: str) -> bool:
        """Whether a person has released the newest certificate of a job, so that it must not be replaced."""
        ...

    def sent(self, key: str) -> bool: ...

    def add_sent(self, key: str, content: Mapping[str, Any]) -> None: ...


@dataclass(frozen=True)
class FolderState:
    """State kept with the reports alone."""

    out: Path

    def reported(self, job: str) -> Mapping[str, str] | None:
        folder = self.out / job
        manifest = read_manifest(folder)
        if manifest is None or (manifest.owner.command, manifest.owner.job) != (COMMAND, job):
            return None
        there = all(os.path.lexists(folder / name) for name in manifest.files)
        return inputs_in(folder) if there and sha256_of(folder / RESULTS) == manifest.files.get(RESULTS) else None

    def released(self, job: str) -> bool:
        return False

    def sent(self, key: str) -> bool:
        return self._marker(key).exists()

    def add_sent(self, key: str, content: Mapping[str, Any]) -> None:
        marker = self._marker(key)
        try:
            marker.parent.mkdir(parents=True, exist_ok=True)
            marker.write_text(json.dumps(content, ensure_ascii=False), encoding="utf-8")
        except OSError as error:
            fix = "Free the disk, or mend the permissions"
            raise OutputError(f"cannot be written: {error.strerror}", where=str(marker), fix=fix) from error

    def _marker(self, key: str) -> Path:
        return self.out / PRIVATE / "sent" / f"{key}.json"


class RecordsState:
    """State kept in the records; the folder of the reports says what they need not be asked for."""

    def __init__(self, records: Records, out: Path) -> None:
        self.records, self.folder = records, FolderState(out)
        self._sent: set[str] = set()
        self._read = 0

    def reported(self, job: str) -> Mapping[str, str] | None:
        if (here := self.folder.reported(job)) is not None:
            digest = sha256_of(self.folder.out / job / RESULTS)
            if digest is not None and self.records.has_results(digest) is not None:
                return here
        newest = self._newest(job)
        inputs = None if newest is None else next(self.records.entries(newest.entry)).data.get("inputs")
        return {str(name): str(digest) for name, digest in inputs.items()} if inputs else None

    def released(self, job: str) -> bool:
        newest = self._newest(job)
        return newest is not None and newest.state == "released"

    def sent(self, key: str) -> bool:
        for entry in self.records.entries(self._read + 1, kind="sent"):
            self._sent.add(str(entry.data.get("key")))
            self._read = entry.number
        return key in self._sent

    def add_sent(self, key: str, content: Mapping[str, Any]) -> None:
        self.records.append("sent", {**content, "key": key})

    def _newest(self, job: str) -> RecordedCertificate | None:
        found = self.records.certificates(job=job, origin=None, values=False)
        return max(found, key=lambda one: one.entry, default=None)


def inputs_in(folder: Path) -> dict[str, str] | None:
    """SHA-256 of every file that a report was made from, by name, as its results.json says; ``None`` where it does not."""
    try:
        data = json.loads(content_of(folder / RESULTS, TABLE_BYTES, ""))
        return {str(name): str(digest) for name, digest in data["job"]["inputs_sha256"].items()}
    except (CmmUqError, ValueError, TypeError, KeyError, AttributeError, RecursionError):
        return None


class Problems:
    def __init__(self, out: Path) -> None:
        self.folder = out / PRIVATE / "problems"
        try:
            self._known = {path.name for path in self.folder.iterdir()}
        except OSError:
            self._known = set()

    def since(self, about: str, problem: str, now: str) -> str:
        """The moment at which a problem was first met; now, where it is new."""
        path = self.folder / f"{_short(about)}-{_short(problem)}"
        with contextlib.suppress(OSError, OutputError):  # a full disk: it will be new again
            self.folder.mkdir(parents=True, exist_ok=True)
            write_new(path, now.encode())
            self._known.add(path.name)
        try:
            return path.read_text(encoding="utf-8")
        except (OSError, UnicodeDecodeError):
            return now

    def mended(self, about: str) -> None:
        """Forget what was wrong with a job or a folder."""
        short = _short(about)
        for name in [name for name in self._known if name.startswith(f"{short}-")] if self._known else ():
            self._known.discard(name)
            with contextlib.suppress(OSError):
                (self.folder / name).unlink()


def _short(text: str) -> str:
    return hashlib.sha256(text.encode("utf-8", "surrogateescape")).hexdigest()[:16]
