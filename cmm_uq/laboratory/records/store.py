"""The records as an object: what they hold, entries added to them, and sets of files recorded as they are put in place.

Files and their entry are one: before a set is put in place, a row of ``pending`` says which (the hash of its manifest) and
what is to be recorded of it. When all of its files are in place, one transaction adds the entry and removes the row. Whoever
opens the records after a crash looks at every row whose process is no more: it has the folder completed or rolled back as its
journal says (:mod:`cmm_uq.base.output.staging`), and records the set where its manifest is the one that was intended.
"""

from __future__ import annotations

import contextlib
import datetime as dt
import json
import socket
from collections.abc import Callable, Iterable, Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

from sqlalchemy import Connection, Engine, delete, func, insert, select, text

from cmm_uq.base.errors import CmmUqError, OutputError
from cmm_uq.base.output import MANIFEST, InDoubtError, finish_interrupted, is_pending, sha256_of
from cmm_uq.laboratory.records import facts
from cmm_uq.laboratory.records.facts import ChainFinding, ChainHead, Entry, Heads, Witness, now
from cmm_uq.laboratory.records.indexing import Indexer, chain, entry_block, in_blocks, verified
from cmm_uq.laboratory.records.place import APPLICATION, shown, told
from cmm_uq.laboratory.records.queries import RecordQueries, entry_of_results
from cmm_uq.laboratory.records.tables import certificates, entries, pending

if TYPE_CHECKING:
    from cmm_uq.base.output import Ledger

New = tuple[str, Mapping[str, Any], dt.datetime | None]
"""Kind, content, and moment of an entry to be added; ``None`` for now."""


class Records(RecordQueries):
    """The history, opened; see :func:`~cmm_uq.laboratory.records.opening.open_records`."""

    def __init__(
        self, engine: Engine, place: str | Path, *, read_only: bool = False, clock: Callable[[], dt.datetime] = now
    ) -> None:
        self.engine, self.place, self.read_only, self.clock = engine, place, read_only, clock

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def __repr__(self) -> str:
        return f"<Records {self.shown}>"

    def close(self) -> None:
        """Close all connections."""
        self.engine.dispose()

    @property
    def shown(self) -> str:
        """Where they are, without a password."""
        return shown(self.place)

    def signed(self, certificate: int) -> dict[str, str]:
        """SHA-256 by name of the files of a certificate (its entry) that were signed since, as they are now."""
        return {name: digest for _, files in self._signed(certificate) for name, digest in files.items()}

    def _signed(self, certificate: int) -> Iterator[tuple[Entry, dict[str, str]]]:
        for entry in self.entries(certificate, kind="signed"):
            if entry.data.get("certificate") == certificate:
                yield entry, entry.data.get("files") or {}

    def head(self) -> tuple[int, str]:
        """Number and hash of the last entry, to be filed elsewhere; 0 where there is none."""
        with self.reading() as connection:
            return last(connection)

    def heads(self, command: str, job: str) -> Heads:
        """Where a document of a job that a command now makes may say that the records stand."""
        e, c, most = entries.c, certificates.c, 20
        newest = select(e.number, e.hash, e.at).order_by(e.number.desc()).limit(1)
        recorded = select(e.content).join(certificates, c.entry == e.number).order_by(e.number.desc()).limit(most)
        with self.reading() as connection:
            head = ChainHead(*connection.execute(newest).first() or (0, facts.BEGINNING, None))
            found = connection.execute(recorded.where(c.job == job, c.command == command))
            each = [json.loads(content) for content in found.scalars()]
        return Heads(head, {one["results_sha256"]: at for one in each if (at := ChainHead.of_results(one))})

    @property
    def last_moment(self) -> dt.datetime | None:
        """Latest moment of any entry, whatever clock the last one was written by; ``None`` where there is none."""
        with self.reading() as connection:
            at = connection.execute(select(func.max(entries.c.at))).scalar()
        if at is not None and (moment := facts.instant(at)) is None:
            fix = "cmm-uq records verify says which"
            raise CmmUqError(f"an entry is of no time: {at!r}", where=self.shown, fix=fix)
        return None if at is None else moment

    def entries(self, first: int = 1, kind: str | None = None) -> Iterator[Entry]:
        """Entries in their order, of one kind or all, read block by block."""

        def block(number: int) -> list[Entry]:
            with self.reading() as connection:
                return entry_block(connection, number, kind)

        return in_blocks(block, first)

    def entry(self, number: int) -> Entry:
        """The entry of a number; an error where entries were deleted from the database."""
        if (own := next(self.entries(number), None)) is None or own.number != number:
            fix = "Restore them from a copy; cmm-uq records verify says what is missing"
            raise CmmUqError(f"has no entry {number} any more", where=self.shown, fix=fix)
        return own

    def append(self, kind: str, content: Mapping[str, Any], *, at: dt.datetime | None = None) -> Entry:
        """Add an entry; refused where no entry before it allows what it says."""
        return self.append_all([(kind, content, at)])[-1]

    def append_all(self, new: Iterable[New]) -> list[Entry]:
        """Add entries, all or none; see :meth:`append`."""
        with self.writing() as writing:
            return writing.add(new)

    @contextlib.contextmanager
    def writing(self) -> Iterator[Writing]:
        """A transaction that writes: what is added in it is there when it ends, or nothing of it."""
        if self.read_only:
            raise OutputError("the records were opened to be read only", where=self.shown)
        with told(self.place), self.engine.connect().execution_options(writing=True) as connection:
            connection.begin()
            if connection.dialect.name == "postgresql":
                connection.execute(text("SELECT pg_advisory_xact_lock(:key)"), {"key": APPLICATION})
            end = connection.rollback
            try:
                yield Writing(connection, self.clock)
                end = connection.commit
            finally:
                try:
                    end()
                except BaseException:
                    connection.invalidate()  # a transaction whose end failed must not come back from the pool
                    raise

    def settle(self) -> None:
        """Record or forget every set of files whose process is no more."""
        with self.reading() as connection:
            rows = connection.execute(select(pending).where(pending.c.host == socket.gethostname())).all()
        for row in rows:
            folder = Path(row.folder)
            if is_pending(folder, row.token):
                # of a process that is no more; a folder that cannot be written to keeps nobody from the records
                with contextlib.suppress(CmmUqError):
                    finish_interrupted(folder)
            if is_pending(folder, row.token) or not folder.parent.is_dir():
                continue  # somebody is at it; a disk that is away for now may hold it
            with self.writing() as writing:
                if _pending_row(writing.connection, row.token) is None:
                    continue  # somebody was faster
                if sha256_of(folder / MANIFEST) == row.manifest:
                    writing.record(row.kind, json.loads(row.content))
                writing.forget(row.token)

    def ledger(self, kind: str, content: Mapping[str, Any]) -> Ledger:
        """For a set of files that is to be recorded as it is put in place; the same results are recorded once."""
        return Intended(self, kind, content)

    def disagreements(self, witnesses: Iterable[Witness]) -> list[ChainFinding]:
        """What these records have otherwise than certificates state: they were rewritten, are shorter, or are others."""
        with self.reading() as connection:
            return [found for one in witnesses if (found := _disagreement(connection, one)) is not None]

    def broken(self) -> ChainFinding | None:
        """The first thing that is wrong with the chain itself, without which no head shows anything."""
        with self.reading() as connection:
            return next((one for one in chain(connection) if one.kind == "chain"), None)

    def files_of(self, results_sha256: str) -> dict[str, Entry]:
        """Entries of a certificate and its signatures by the SHA-256 of each file that they name, the first of each."""
        if (number := self.has_results(results_sha256)) is None:
            return {}
        own = self.entry(number)
        each = reversed([(own, own.data.get("files") or {}), *self._signed(number)])
        return {digest: entry for entry, files in each for digest in files.values()} | {results_sha256: own}

    def verify(self, head: str | None = None, *, files: bool = True) -> list[ChainFinding]:
        """What is wrong of everything against the chain, and the hash of an entry that was filed elsewhere."""
        return verified(self, head, files=files)


class Writing:
    def __init__(self, connection: Connection, clock: Callable[[], dt.datetime]) -> None:
        self.connection, self._clock = connection, clock

    def add(self, new: Iterable[New]) -> list[Entry]:
        """Add entries after the last one, with the rows that follow from them."""
        return Indexer(self.connection).all(self._following(new), chain=True)

    def copy(self, whole: Iterable[Entry]) -> None:
        """Add entries of other records as they are, into records that hold none."""
        Indexer(self.connection).all(whole, chain=True)

    def record(self, kind: str, content: dict[str, Any]) -> None:
        """Add an entry of a set of files; the same results are recorded once, and anew after they were withdrawn."""
        if entry_of_results(self.connection, content.get("results_sha256") or "", standing=True) is None:
            self.add([(kind, content, None)])

    def forget(self, token: str) -> None:
        """Intend a set of files no longer."""
        self.connection.execute(delete(pending).where(pending.c.token == token))

    def _following(self, new: Iterable[New]) -> Iterator[Entry]:
        number, previous = last(self.connection)
        for kind, content, at in new:
            number += 1
            entry = facts.following(previous, number, at or self._clock(), kind, content)
            previous = entry.hash
            yield entry


def last(connection: Connection) -> tuple[int, str]:
    """Number and hash of the last entry."""
    query = select(entries.c.number, entries.c.hash).order_by(entries.c.number.desc()).limit(1)
    row = connection.execute(query).first()
    return (0, facts.BEGINNING) if row is None else (row.number, row.hash)


def _disagreement(connection: Connection, witness: Witness) -> ChainFinding | None:
    """Whoever rewrites an entry, or any before it, gives it another hash; what came after it has the certificate itself."""
    head, number, (end, newest) = witness.head, witness.head.entries, last(connection)
    own = entry_of_results(connection, witness.results_sha256)
    row = connection.execute(select(entries.c.hash, entries.c.at).where(entries.c.number == number)).first()
    if number > end:
        problem = f"they end at entry {end} with the hash {newest}: their last entries are missing, or they are others"
    elif number and (row is None or row.hash != head.head):
        there = "is missing" if row is None else f"has the hash {row.hash}"
        of_own = connection.execute(select(entries.c.kind).where(entries.c.number == own)).scalar()
        known = "" if own is None else f", though they have the {witness.what} as entry {own}"
        if of_own == "imported":
            known = f", or the {witness.what}, their entry {own}, was imported from others"
        problem = f"that entry {there}: they were rewritten{known or ', or they are others'}"
    elif row is not None and row.at != head.at:
        problem = f"that entry is of {row.at}, and the {witness.what} says {head.at}"
    elif own is None:
        lost = "what came later was rewritten or lost, as by restoring an older backup, or they are others"
        problem = f"they do not have the {witness.what} itself: {lost}"
    else:
        return None
    stated = f"entry {number} with the hash {head.head}" if number else "entry 0, empty records"
    return ChainFinding("witness", f"{witness.name} was made after {stated}, and of these records {problem}", number)


class Intended:
    """One entry that is to be added with a set of files; a :class:`~cmm_uq.base.output.staging.Ledger`."""

    def __init__(self, records: Records, kind: str, content: Mapping[str, Any]) -> None:
        self.records, self.kind, self.content = records, kind, facts.canonical(content)

    def intend(self, token: str, folder: Path, manifest: str) -> None:
        row = {
            "token": token, "host": socket.gethostname(), "folder": str(folder), "manifest": manifest,
            "at": facts.moment_of(self.records.clock()), "kind": self.kind, "content": self.content,
        }  # fmt: skip
        with self.records.writing() as writing:
            writing.connection.execute(insert(pending), row)

    def commit(self, token: str) -> None:
        try:
            with self.records.writing() as writing:
                writing.record(self.kind, json.loads(self.content))
                writing.forget(token)
        except (CmmUqError, OSError):
            if self._is_pending(token):
                raise

    def forget(self, token: str) -> None:
        with contextlib.suppress(CmmUqError, OSError), self.records.writing() as writing:
            writing.forget(token)

    def _is_pending(self, token: str) -> bool:
        """Whether a commit that failed was none; its answer may have been lost on the way."""
        try:
            with self.records.reading() as connection:
                return _pending_row(connection, token) is not None
        except (CmmUqError, OSError) as lost:
            problem = "the records were lost while a report was recorded"
            fix = "Its files are in place; the next command records them"
            raise InDoubtError(problem, where=shown(self.records.place), fix=fix) from lost


def _pending_row(connection: Connection, token: str) -> Any:
    return connection.execute(select(pending).where(pending.c.token == token)).first()
