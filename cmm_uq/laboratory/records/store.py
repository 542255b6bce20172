"""The records as an object: what they hold, and entries added to them."""

from __future__ import annotations

import datetime as dt
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Any, Self, TypeVar

from sqlalchemy import Connection, Engine, insert, select, text

from cmm_uq.base.errors import OutputError
from cmm_uq.laboratory.records import queries
from cmm_uq.laboratory.records.entries import BEGINNING, Entry, following, now
from cmm_uq.laboratory.records.facts import (
    ArtefactRow,
    ChainFinding,
    RecordedCertificate,
    RecordedMachine,
    ReleaseSignature,
    Series,
)
from cmm_uq.laboratory.records.indexing import Indexer
from cmm_uq.laboratory.records.place import APPLICATION, shown, told
from cmm_uq.laboratory.records.tables import entries

if TYPE_CHECKING:
    import pandas as pd

    from cmm_uq.base.output import Ledger

T = TypeVar("T")

New = tuple[str, Mapping[str, Any], dt.datetime | None]
"""Kind, content, and moment of an entry to be added; ``None`` for now."""

_BLOCK = 5000
"""Entries that are written together."""


class Records:
    """The history, opened; see :func:`~cmm_uq.laboratory.records.opening.open_records`.

    Parameters
    ----------
    engine : connections to the database.
    place : file or URL.
    read_only : whether nothing may be written.
    clock : says what time it is.
    """

    def __init__(
        self, engine: Engine, place: str | Path, *, read_only: bool = False, clock: Callable[[], dt.datetime] = now
    ) -> None:
        self.engine, self.place, self.read_only, self.clock = engine, place, read_only, clock

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
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

    @property
    def home(self) -> Path | None:
        """Folder of the file: folders of reports inside it are recorded relative to it; ``None`` for a server."""
        return self.place.absolute().parent if isinstance(self.place, Path) else None

    def machines(self) -> list[RecordedMachine]:
        """All machines, by serial."""
        return self._read(queries.machines_of)

    def machine(self, serial: str) -> RecordedMachine:
        """One machine, by serial however it is spelled, or by name.

        Raises
        ------
        CmmUqError : it is not known, or several are called so.
        """
        return self._read(lambda connection: queries.machine_of(connection, serial))

    def artefacts(self) -> list[ArtefactRow]:
        """All artefacts, by serial."""
        return self._read(queries.artefacts_of)

    def certificates(
        self,
        machine: str | None = None,
        *,
        origin: str | None = "measured",
        states: Collection[str] | None = None,
        artefact: str | None = None,
        since: dt.date | None = None,
        limit: int | None = None,
        values: bool = True,
        command: str | None = "report",
        job: str | None = None,
        offset: int = 0,
        newest_first: bool = False,
    ) -> list[RecordedCertificate]:
        """Certificates and interim checks, by day, then entry.

        Parameters
        ----------
        machine, artefact : serials, however they are spelled.
        origin : of the recording; ``None`` for all.
        states : that they may be in; ``None`` for all.
        since : first day.
        limit : at most so many, the newest.
        values : whether what they state is read too.
        command : report or diagnose; ``None`` for both.
        job : id of the job.
        offset : newest that are left out, for pages.
        newest_first : in reverse order.

        Raises
        ------
        CmmUqError : the machine is not known.
        """
        wanted = queries.CertificateQuery(machine, origin, states, artefact, since, command, job)
        found = self._read(lambda c: queries.certificates_of(c, wanted, limit, offset, values=values, home=self.home))
        return found[::-1] if newest_first else found

    def certificate(self, entry: int) -> RecordedCertificate:
        """One certificate, by the number of its entry.

        Raises
        ------
        CmmUqError : there is none of that number.
        """
        return self._read(lambda connection: queries.certificate_of(connection, entry, self.home))

    def named(self, certificate: str) -> list[RecordedCertificate]:
        """Certificates by their number, id of the job, folder, hash of results.json, or number of the entry; by day.

        Values are not read.
        """
        return self._read(lambda connection: queries.named(connection, certificate, self.home))

    def latest(self, until: dt.date | None = None, *, values: bool = True) -> list[RecordedCertificate]:
        """Newest measured certificate, not withdrawn nor replaced, of each machine, by serial; interim checks are none.

        Parameters
        ----------
        until : a day; what is dated later does not count.
        values : whether their values are read too.
        """
        return self._read(lambda connection: queries.latest_of(connection, self.home, until, values=values))

    def limited(self, entries: Sequence[int]) -> set[int]:
        """Those of the certificates, by the numbers of their entries, that set a limit to any value."""
        return self._read(lambda connection: queries.limited_of(connection, entries))

    def dated_after(self, day: dt.date) -> dict[str, dt.date]:
        """Machines with measured certificates or interim checks dated after a day, and the last such date of each."""
        return self._read(lambda connection: queries.dated_after_of(connection, day))

    def checks(self) -> list[RecordedCertificate]:
        """Measured interim checks of all machines, neither withdrawn nor replaced, by day, then entry."""
        return self._read(lambda connection: queries.checks_of(connection, self.home))

    def series(self, machine: str, names: Collection[str] | None = None, origin: str = "measured") -> dict[str, Series]:
        """Each value of a machine over its standing certificates and interim checks.

        Parameters
        ----------
        machine : serial.
        names : of values; ``None`` for all.
        origin : of the recordings.

        Raises
        ------
        CmmUqError : the machine is not known.
        """
        return self._read(lambda connection: queries.series_of(connection, machine, names, origin))

    def all_series(self, names: Collection[str] | None = None, origin: str = "measured") -> pd.DataFrame:
        """Values of all machines, a row each.

        Returns
        -------
        columns machine, model, place, day (ordinal), name, value, u, u_artefact, artefact, limit, entry,
        adjusted_since (ordinal, 0 where unknown), interim; by machine, name, day, entry.
        """
        return self._read(lambda connection: queries.all_series_of(connection, names, origin))

    def signatures(self, certificate: int) -> list[ReleaseSignature]:
        """Who released, withdrew or replaced a certificate, in order."""
        return self._read(lambda connection: queries.signatures_of(connection, certificate))

    def signed(self, certificate: int) -> dict[str, str]:
        """SHA-256 by name of the files of a certificate that were signed since, as they are now.

        Parameters
        ----------
        certificate : number of its entry.
        """
        found: dict[str, str] = {}
        for entry in self.entries(certificate, kind="signed"):
            if entry.data.get("certificate") == certificate:
                found.update(entry.data.get("files") or {})
        return found

    def has_results(self, results_sha256: str) -> int | None:
        """Number of the entry that recorded these very results; ``None`` where none did."""
        return self._read(lambda connection: queries.entry_of_results(connection, results_sha256))

    def head(self) -> tuple[int, str]:
        """Number and hash of the last entry, to be filed elsewhere; 0 where there is none."""
        return self._read(last)

    def entries(self, first: int = 1, kind: str | None = None) -> Iterator[Entry]:
        """Entries in their order, read block by block.

        Parameters
        ----------
        first : number.
        kind : of entries that are wanted; ``None`` for all.
        """
        number = first
        while True:
            wanted = select(entries).where(entries.c.number >= number).order_by(entries.c.number).limit(_BLOCK)
            if kind is not None:
                wanted = wanted.where(entries.c.kind == kind)
            rows = self._read(lambda connection, query=wanted: connection.execute(query).all())  # type: ignore[misc]
            for row in rows:
                yield Entry(*row)
            if len(rows) < _BLOCK:
                return
            number = rows[-1].number + 1

    def append(self, kind: str, content: Mapping[str, Any], *, at: dt.datetime | None = None) -> Entry:
        """Add an entry.

        Parameters
        ----------
        kind : of the entry.
        content : JSON.
        at : moment; now by default.

        Raises
        ------
        CmmUqError : it says something that no entry before it allows.
        OutputError : the records cannot be written to.
        """
        return self.append_all([(kind, content, at)])[-1]

    def append_all(self, new: Iterable[New]) -> list[Entry]:
        """Add entries, all or none; see :meth:`append`."""
        with self.writing() as writing:
            return writing.add(new)

    def writing(self) -> Writing:
        """A transaction that writes: what is added in it is there when it ends, or nothing of it."""
        if self.read_only:
            raise OutputError("the records were opened to be read only", where=self.shown)
        return Writing(self)

    def settle(self) -> None:
        """Complete or take back what a crash left between files and records; see :mod:`cmm_uq.laboratory.records.pending`."""
        from cmm_uq.laboratory.records.pending import settle

        settle(self)

    def ledger(self, kind: str, content: Mapping[str, Any]) -> Ledger:
        """For a set of files that is to be recorded as it is put in place; see :mod:`cmm_uq.laboratory.records.pending`.

        Parameters
        ----------
        kind : of the entry.
        content : of the entry; its ``results_sha256`` is recorded once, however often the same results are written.
        """
        from cmm_uq.laboratory.records.pending import Intended

        return Intended(self, kind, content)

    def verify(self, head: str | None = None, *, files: bool = True) -> list[ChainFinding]:
        """Compare everything with the chain; see :mod:`cmm_uq.laboratory.records.verifying`.

        Parameters
        ----------
        head : hash of an entry that was filed elsewhere.
        files : whether the files of the reports are compared too.

        Returns
        -------
        what is wrong; empty where nothing is.
        """
        from cmm_uq.laboratory.records.verifying import verified

        return verified(self, head, files=files)

    def _read(self, query: Callable[[Connection], T]) -> T:
        with told(self.place), self.engine.connect() as connection:
            return query(connection)


class Writing:
    """One transaction of one writer."""

    def __init__(self, records: Records) -> None:
        self.records = records

    def __enter__(self) -> Self:
        self._told = told(self.records.place)
        self._told.__enter__()
        try:
            self.connection = self.records.engine.connect().execution_options(writing=True)
            try:
                self.connection.begin()
                if self.connection.dialect.name == "postgresql":
                    self.connection.execute(text("SELECT pg_advisory_xact_lock(:key)"), {"key": APPLICATION})
            except BaseException:
                self.connection.close()
                raise
        except BaseException as error:
            if not self._told.__exit__(type(error), error, error.__traceback__):
                raise
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        try:
            try:
                if error is None:
                    self.connection.commit()
                else:
                    self.connection.rollback()
            except BaseException:
                self.connection.invalidate()  # a transaction whose end failed must not come back from the pool
                raise
            finally:
                self.connection.close()
        except BaseException as failed:
            self._told.__exit__(type(failed), failed, failed.__traceback__)
            raise
        self._told.__exit__(kind, error, trace)

    def add(self, new: Iterable[New]) -> list[Entry]:
        """Add entries after the last one, with the rows that follow from them."""
        return self._all(self._following(new))

    def copy(self, whole: Iterable[Entry]) -> None:
        """Add entries of other records as they are, into records that hold none."""
        self._all(whole)

    def _following(self, new: Iterable[New]) -> Iterator[Entry]:
        number, previous = last(self.connection)
        for kind, content, at in new:
            number += 1
            entry = following(previous, number, at or self.records.clock(), kind, content)
            previous = entry.hash
            yield entry

    def _all(self, whole: Iterable[Entry]) -> list[Entry]:
        indexer, added = Indexer(self.connection), []
        block: list[Entry] = []
        for entry in whole:
            indexer.add(entry)
            block.append(entry)
            if len(block) == _BLOCK:
                self._write(block, indexer)
                added += block
                block = []
        self._write(block, indexer)
        return added + block

    def _write(self, block: list[Entry], indexer: Indexer) -> None:
        if block:
            rows = [{name: getattr(entry, name) for name in Entry.__slots__} for entry in block]
            self.connection.execute(insert(entries), rows)
        indexer.flush()


def last(connection: Connection) -> tuple[int, str]:
    """Number and hash of the last entry."""
    query = select(entries.c.number, entries.c.hash).order_by(entries.c.number.desc()).limit(1)
    row = connection.execute(query).first()
    return (0, BEGINNING) if row is None else (row.number, row.hash)
