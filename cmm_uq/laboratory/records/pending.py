"""Files and their entry as one: a set of files is recorded when it is in place, and a crash leaves both or neither.

Before a set is put in place, a row of ``pending`` says which (the hash of its manifest) and what is to be recorded of it.
When all of its files are in place, one transaction adds the entry and removes the row. Whoever opens the records after a
crash looks at every row whose process is no more: it has the folder completed or rolled back as its journal says
(:mod:`cmm_uq.base.output.staging`), and records the set where its manifest is the one that was intended.
"""

from __future__ import annotations

import contextlib
import json
import socket
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from sqlalchemy import Connection, delete, insert, select

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.output import MANIFEST, InDoubtError, finish_interrupted, is_pending, sha256_of
from cmm_uq.laboratory.records.entries import canonical, moment_of
from cmm_uq.laboratory.records.place import shown, told
from cmm_uq.laboratory.records.queries import entry_of_results
from cmm_uq.laboratory.records.store import Records, Writing
from cmm_uq.laboratory.records.tables import pending


class Intended:
    """One entry that is to be added with a set of files; a :class:`~cmm_uq.base.output.staging.Ledger`."""

    def __init__(self, records: Records, kind: str, content: Mapping[str, Any]) -> None:
        self.records, self.kind, self.content = records, kind, canonical(content)

    def intend(self, token: str, folder: Path, manifest: str) -> None:
        row = {
            "token": token, "host": socket.gethostname(), "folder": str(folder), "manifest": manifest,
            "at": moment_of(self.records.clock()), "kind": self.kind, "content": self.content,
        }  # fmt: skip
        with self.records.writing() as writing:
            writing.connection.execute(insert(pending), row)

    def commit(self, token: str) -> None:
        try:
            with self.records.writing() as writing:
                _record(writing, self.kind, json.loads(self.content))
                writing.connection.execute(delete(pending).where(pending.c.token == token))
        except (CmmUqError, OSError):
            if self._is_pending(token):
                raise

    def forget(self, token: str) -> None:
        with contextlib.suppress(CmmUqError, OSError), self.records.writing() as writing:
            writing.connection.execute(delete(pending).where(pending.c.token == token))

    def _is_pending(self, token: str) -> bool:
        """Whether a commit that failed was none; its answer may have been lost on the way."""
        try:
            with told(self.records.place), self.records.engine.connect() as connection:
                return _row(connection, token) is not None
        except (CmmUqError, OSError) as lost:
            raise InDoubtError("the records were lost while a report was recorded", where=shown(self.records.place),
                               fix="Its files are in place; the next command records them") from lost  # fmt: skip


def settle(records: Records) -> None:
    """Record or forget every set whose process is no more."""
    with told(records.place), records.engine.connect() as connection:
        rows = connection.execute(select(pending).where(pending.c.host == socket.gethostname())).all()
    for row in rows:
        folder = Path(row.folder)
        if is_pending(folder, row.token):
            with contextlib.suppress(
                CmmUqError
            ):  # a folder that cannot be written to now keeps nobody from the records
                finish_interrupted(folder)  # of a process that is no more; otherwise nothing happens
        if is_pending(folder, row.token) or not folder.parent.is_dir():
            continue  # somebody is at it; a disk that is away for now may hold it
        with records.writing() as writing:
            if _row(writing.connection, row.token) is None:
                continue  # somebody was faster
            if sha256_of(folder / MANIFEST) == row.manifest:
                _record(writing, row.kind, json.loads(row.content))
            writing.connection.execute(delete(pending).where(pending.c.token == row.token))


def _record(writing: Writing, kind: str, content: dict[str, Any]) -> None:
    """Add an entry; the same results are recorded once, and anew after they were withdrawn."""
    if entry_of_results(writing.connection, content.get("results_sha256") or "", standing=True) is None:
        writing.add([(kind, content, None)])


def _row(connection: Connection, token: str) -> Any:
    return connection.execute(select(pending).where(pending.c.token == token)).first()
