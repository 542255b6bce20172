"""The tables: entries, what follows from them, and sets of files on their way (SQLAlchemy Core)."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import sqlalchemy as sa

META = sa.MetaData(
    naming_convention={
        "ix": "ix_%(table_name)s_%(column_0_N_name)s",
        "uq": "uq_%(table_name)s_%(column_0_N_name)s",
        "ck": "ck_%(table_name)s_%(constraint_name)s",
        "fk": "fk_%(table_name)s_%(column_0_name)s",
        "pk": "pk_%(table_name)s",
    }
)

DAY = sa.String(10)  # ISO 8601, which sorts as days do

NUMBER = sa.BigInteger().with_variant(sa.Integer, "sqlite")
"""Number of an entry; SQLite makes its rows' own number of an INTEGER only."""

DOUBLE = sa.Float(53)


def _of(column: str) -> sa.ForeignKey:
    """A reference that holds when the transaction ends: rows are written table by table."""
    return sa.ForeignKey(column, deferrable=True, initially="DEFERRED")


def _id() -> sa.Column[int]:
    return sa.Column("id", sa.Integer, primary_key=True, autoincrement=False)


def _entry(name: str = "entry", of: str = "entries.number", *, key: bool = False) -> sa.Column[int]:
    """The number of an entry, which may be the key of the row."""
    return sa.Column(name, NUMBER, _of(of), primary_key=key, autoincrement=False if key else "auto", nullable=False)


def _stated(kind: Any, *names: str, **options: Any) -> Iterator[sa.Column[Any]]:
    return (sa.Column(name, kind, nullable=False, **options) for name in names)


entries = sa.Table(
    "entries", META, sa.Column("number", NUMBER, primary_key=True, autoincrement=False), *_stated(sa.String(27), "at"),
    *_stated(sa.String(20), "kind"), *_stated(sa.Text, "content"), *_stated(sa.String(64), "previous", "hash"),
    sa.CheckConstraint("number >= 1", name="counts"), sa.Index(None, "kind", "number"),
)  # fmt: skip
machines = sa.Table(
    "machines", META, _id(), *_stated(sa.Text, "recognised", "called", unique=True),
    *_stated(sa.Text, "spelled", "named", index=True), *_stated(sa.Text, "name", "manufacturer", "model", "place"),
    sa.Column("calibrate", sa.Text), *_stated(DAY, "day"), _entry(),
)  # fmt: skip
adjustments = sa.Table(
    "adjustments", META, sa.Column("machine", sa.Integer, _of("machines.id"), primary_key=True),
    sa.Column("day", DAY, primary_key=True), _entry(),
)  # fmt: skip
artefacts = sa.Table(
    "artefacts", META, _id(), *_stated(sa.Text, "recognised", unique=True), *_stated(sa.Text, "called", index=True),
    *_stated(sa.Text, "kind", "certificate", "laboratory"), sa.Column("calibrated", DAY), sa.Column("due", DAY),
    *_stated(DAY, "day"), _entry(),
)  # fmt: skip
certificates = sa.Table(
    "certificates", META, _entry(key=True), sa.Column("machine", sa.Integer, _of("machines.id"), nullable=False),
    sa.Column("artefact", sa.Integer, _of("artefacts.id")), *_stated(sa.Text, "command", "job", "number", "kind", "origin"),
    *_stated(DAY, "day"), *_stated(sa.String(27), "at"), sa.Column("adjusted_since", DAY),
    *_stated(sa.Text, "state", "decision", "diagnosis"), *_stated(sa.Boolean(create_constraint=False), "interim"),
    *_stated(sa.Text, "folder", "version"), *_stated(sa.String(64), "results_sha256"), sa.Column("artefact_due", DAY),
    sa.Index(None, "machine", "command", "origin", "day", "entry"), sa.Index(None, "command", "origin", "day", "entry"),
    sa.Index(None, "artefact", "day"), sa.Index(None, "results_sha256"), sa.Index(None, "job"), sa.Index(None, "number"),
    sa.Index(None, "folder", "entry"),
)  # fmt: skip
quantities = sa.Table(
    "quantities",
    META,
    _id(),
    *_stated(sa.Text, "name", "quantity", "unit"),
    sa.UniqueConstraint("name", "quantity", "unit"),
)
figures = sa.Table(
    "figures", META, _entry("certificate", "certificates.entry", key=True),
    sa.Column("place", sa.Integer, primary_key=True, autoincrement=False),
    sa.Column("quantity", sa.Integer, _of("quantities.id"), nullable=False),
    *_stated(DOUBLE, "value", "u", "lower", "upper", "u_artefact"), sa.Column("at_most", DOUBLE), sqlite_with_rowid=False,
)  # fmt: skip
covariances = sa.Table(
    "covariances", META, _entry("certificate", "certificates.entry", key=True), *_stated(sa.Text, "names", "lower")
)
signatures = sa.Table(
    "signatures", META, _entry(key=True),
    sa.Column("certificate", NUMBER, _of("certificates.entry"), nullable=False, index=True),
    *_stated(sa.Text, "what", "by", "reason"), *_stated(sa.String(27), "at"),
    sa.Column("replaced_by", NUMBER, _of("certificates.entry")),
)  # fmt: skip
pending = sa.Table(
    "pending", META, sa.Column("token", sa.String(12), primary_key=True), *_stated(sa.Text, "host", "folder"),
    *_stated(sa.String(64), "manifest"), *_stated(sa.String(27), "at"), *_stated(sa.String(20), "kind"),
    *_stated(sa.Text, "content"),
)  # fmt: skip

versions = sa.Table("alembic_version", sa.MetaData(), sa.Column("version_num", sa.String(32)))  # revision of the tables
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
