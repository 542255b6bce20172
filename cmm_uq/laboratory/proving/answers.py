"""What processes answer, kept in a file as soon as it is there."""

from __future__ import annotations

import contextlib
import json
import os
import shutil
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.output.manifest import writing_to
from cmm_uq.base.output.staging import locked, replace_file
from cmm_uq.laboratory.proving.cases import canonical_json
from cmm_uq.laboratory.schedule.processes import WorkerTask, answers

Record = dict[str, Any]  # what was said of a task: plain data with its ``number``
TRUTH, RECORDS, LOCK = "truth.json", "cases.jsonl", "lock"
_MENDED = "Free the disk, mend the permissions, or choose another --out"


class AnswersFolder:
    """A folder with the sealed truth and the answers so far; this process alone writes to it while it is open."""

    def __init__(self, folder: Path, truth: bytes) -> None:
        self.folder = folder
        self._descriptor = -1
        with writing_to(folder, _MENDED):
            folder.mkdir(parents=True, exist_ok=True)
            (folder / LOCK).touch()
            descriptor = locked(folder / LOCK, create=False)
            if descriptor is None:
                raise CmmUqError("another cmm-uq prove is at work here", where=str(folder), fix="Wait until it is done")
            self._descriptor = descriptor
            try:
                self.records = self._begun(truth)
                self._file = (folder / RECORDS).open("ab")
            except BaseException:
                os.close(descriptor)
                raise

    def _begun(self, truth: bytes) -> dict[int, Record]:
        sealed = self.folder / TRUTH
        if sealed.exists() and sealed.read_bytes() != truth:
            raise CmmUqError("holds an unfinished run with another truth: other options, inputs, seed or version",
                             where=str(self.folder),
                             fix="Repeat the command that began it to go on, or remove the folder")  # fmt: skip
        if not sealed.exists():
            (self.folder / RECORDS).unlink(missing_ok=True)
            replace_file(sealed, truth, _MENDED)
        path = self.folder / RECORDS
        content = path.read_bytes() if path.exists() else b""
        records: dict[int, Record] = {}
        whole = 0
        for line in content.splitlines(keepends=True):
            try:
                record: Record = json.loads(line) if line.endswith(b"\n") else {}
                records[int(record["number"])] = record
            except (ValueError, TypeError, KeyError):
                break
            whole += len(line)
        if whole < len(content):
            with path.open("rb+") as file:
                file.truncate(whole)
        return records

    def keep(self, record: Record) -> None:
        with writing_to(self.folder, _MENDED):
            self._file.write(canonical_json(record))
            self._file.flush()
            os.fsync(self._file.fileno())
        self.records[record["number"]] = record

    def close(self) -> None:
        """Leave it to others; what it holds stays."""
        if self._descriptor >= 0:
            self._file.close()
            os.close(self._descriptor)
            self._descriptor = -1

    def remove(self) -> None:
        """What was kept is in place elsewhere."""
        self.close()
        shutil.rmtree(self.folder, ignore_errors=True)


def answer_tasks(
    program: str, setting: Any, tasks: Mapping[int, Any], workers: int, *, keep: Callable[[Record], None]
) -> None:
    with contextlib.closing(answers(WorkerTask(program, setting), tasks.items(), workers)) as found:
        for answer in found:
            if answer.failure is not None:
                raise answer.failure
            keep(answer.value)
