"""The tables: entries, what follows from them, and sets of files on their way (SQLAlchemy Core)."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from sqlalchemy import (
    BigInteger,
    Boolean,
    CheckConstraint,
    Column,
    Float,
    ForeignKey,
    Index,
    Integer,
    MetaData,
    String,
    Table,
    Text,
    UniqueConstraint,
)

META = MetaData(
    naming_convention={
        "ix": "ix_%(table_name)s_%(column_0_N_name)s",
        "uq": "uq_%(table_name)s_%(column_0_N_name)s",
        "ck": "ck_%(table_name)s_%(constraint_name)s",
        "fk": "fk_%(table_name)s_%(column_0_name)s",
        "pk": "pk_%(table_name)s",
    }
)

DAY = String(10)  # ISO 8601, which sorts as days do

NUMBER = BigInteger().with_variant(Integer, "sqlite")
"""Number of an entry; SQLite makes its rows' own number of an INTEGER only."""

DOUBLE = Float(53)


def _of(column: str) -> ForeignKey:
    """A reference that holds when the transaction ends: rows are written table by table."""
    return ForeignKey(column, deferrable=True, initially="DEFERRED")


def _id() -> Column[int]:
    return Column("id", Integer, primary_key=True, autoincrement=False)


def _entry(name: str = "entry", of: str = "entries.number", *, key: bool = False) -> Column[int]:
    """The number of an entry, which may be the key of the row."""
    return Column(name, NUMBER, _of(of), primary_key=key, autoincrement=False if key else "auto", nullable=False)


def _stated(kind: Any, *names: str, **options: Any) -> Iterator[Column[Any]]:
    return (Column(name, kind, nullable=False, **options) for name in names)


entries = Table(
    "entries", META, Column("number", NUMBER, primary_key=True, autoincrement=False), *_stated(String(27), "at"),
    *_stated(String(20), "kind"), *_stated(Text, "content"), *_stated(String(64), "previous", "hash"),
    CheckConstraint("number >= 1", name="counts"), Index(None, "kind", "number"),
)  # fmt: skip
machines = Table(
    "machines", META, _id(), *_stated(Text, "recognised", "called", unique=True),
    *_stated(Text, "spelled", "named", index=True), *_stated(Text, "name", "manufacturer", "model", "place"),
    Column("calibrate", Text), *_stated(DAY, "day"), _entry(),
)  # fmt: skip
adjustments = Table(
    "adjustments", META, Column("machine", Integer, _of("machines.id"), primary_key=True),
    Column("day", DAY, primary_key=True), _entry(),
)  # fmt: skip
artefacts = Table(
    "artefacts", META, _id(), *_stated(Text, "recognised", unique=True), *_stated(Text, "called", index=True),
    *_stated(Text, "kind", "certificate", "laboratory"), Column("calibrated", DAY), Column("due", DAY),
    *_stated(DAY, "day"), _entry(),
)  # fmt: skip
certificates = Table(
    "certificates", META, _entry(key=True), Column("machine", Integer, _of("machines.id"), nullable=False),
    Column("artefact", Integer, _of("artefacts.id")), *_stated(Text, "command", "job", "number", "kind", "origin"),
    *_stated(DAY, "day"), *_stated(String(27), "at"), Column("adjusted_since", DAY),
    *_stated(Text, "state", "decision", "diagnosis"), *_stated(Boolean(create_constraint=False), "interim"),
    *_stated(Text, "folder", "version"), *_stated(String(64), "results_sha256"), Column("artefact_due", DAY),
    Index(None, "machine", "command", "origin", "day", "entry"), Index(None, "command", "origin", "day", "entry"),
    Index(None, "artefact", "day"), Index(None, "results_sha256"), Index(None, "job"), Index(None, "number"),
    Index(None, "folder", "entry"),
)  # fmt: skip
quantities = Table(
    "quantities", META, _id(), *_stated(Text, "name", "quantity", "unit"), UniqueConstraint("name", "quantity", "unit")
)
figures = Table(
    "figures", META, _entry("certificate", "certificates.entry", key=True),
    Column("place", Integer, primary_key=True, autoincrement=False),
    Column("quantity", Integer, _of("quantities.id"), nullable=False),
    *_stated(DOUBLE, "value", "u", "lower", "upper", "u_artefact"), Column("at_most", DOUBLE), sqlite_with_rowid=False,
)  # fmt: skip
covariances = Table(
    "covariances", META, _entry("certificate", "certificates.entry", key=True), *_stated(Text, "names", "lower")
)
signatures = Table(
    "signatures", META, _entry(key=True),
    Column("certificate", NUMBER, _of("certificates.entry"), nullable=False, index=True),
    *_stated(Text, "what", "by", "reason"), *_stated(String(27), "at"),
    Column("replaced_by", NUMBER, _of("certificates.entry")),
)  # fmt: skip
pending = Table(
    "pending", META, Column("token", String(12), primary_key=True), *_stated(Text, "host", "folder"),
    *_stated(String(64), "manifest"), *_stated(String(27), "at"), *_stated(String(20), "kind"),
    *_stated(Text, "content"),
)  # fmt: skip

INDEX = (machines, adjustments, artefacts, certificates, quantities, figures, covariances, signatures)
"""Tables that follow from the entries, each after those that it refers to."""

TRIGGERS = {
    "sqlite": (
        "CREATE TRIGGER entries_no_update BEFORE UPDATE ON entries "
        "BEGIN SELECT RAISE(ABORT, 'entries are never changed'); END",
        "CREATE TRIGGER entries_no_delete BEFORE DELETE ON entries "
        "BEGIN SELECT RAISE(ABORT, 'entries are never changed'); END",
        "CREATE TRIGGER entries_no_replace BEFORE INSERT ON entries "  # INSERT OR REPLACE deletes without a trigger
        "WHEN EXISTS (SELECT 1 FROM entries WHERE number = NEW.number) "
        "BEGIN SELECT RAISE(ABORT, 'entries are never changed'); END",
    ),
    "postgresql": (
        "CREATE FUNCTION entries_stay() RETURNS trigger LANGUAGE plpgsql AS "
        "$$ BEGIN RAISE EXCEPTION 'entries are never changed'; END $$",
        "CREATE TRIGGER entries_no_change BEFORE UPDATE OR DELETE ON entries "
        "FOR EACH ROW EXECUTE FUNCTION entries_stay()",
        "CREATE TRIGGER entries_no_truncate BEFORE TRUNCATE ON entries "
        "FOR EACH STATEMENT EXECUTE FUNCTION entries_stay()",
    ),
}
"""What refuses to change entries, by the database."""
