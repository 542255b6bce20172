"""The tables: entries, what follows from them, and sets of files on their way (SQLAlchemy Core); and what is unlike them."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator
from typing import Any

import sqlalchemy as sa
from sqlalchemy.schema import CreateTable

from cmm_uq.laboratory.records.facts import ChainFinding

_BY = {"ix": "column_0_N_name", "uq": "column_0_N_name", "ck": "constraint_name", "fk": "column_0_name"}
_NAMES = {kind: f"{kind}_%(table_name)s_%({of})s" for kind, of in _BY.items()} | {"pk": "pk_%(table_name)s"}
META = sa.MetaData(naming_convention=_NAMES)

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
_QUANTITY = ("name", "quantity", "unit")
quantities = sa.Table("quantities", META, _id(), *_stated(sa.Text, *_QUANTITY), sa.UniqueConstraint(*_QUANTITY))
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

versions = sa.Table(
    "alembic_version", sa.MetaData(naming_convention={"pk": "%(table_name)s_pkc"}),
    sa.Column("version_num", sa.String(32), primary_key=True),
)  # fmt: skip
"""Revision of the tables."""

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


def schema_findings(connection: sa.Connection) -> Iterator[ChainFinding]:
    """Tables, columns, their definitions, indexes and triggers that are not as records are made."""
    inspector, sqlite = sa.inspect(connection), connection.dialect.name == "sqlite"
    made, there = {**META.tables, versions.name: versions}, inspector.get_table_names()
    yield from _apart("table", there, made)
    for name, table in made.items():
        if name not in there:
            continue
        columns = {str(column["name"]) for column in inspector.get_columns(name)}
        yield from _apart(f"column of {name}", columns, table.columns.keys())
        if columns == set(table.columns.keys()):
            wanted = _definitions(str(CreateTable(table).compile(dialect=connection.dialect)))
            stored = connection.exec_driver_sql((_SQLITE if sqlite else _POSTGRESQL).format(name)).scalars().all()
            yield from _apart(f"definition in {name}", _definitions(stored[0]) if sqlite else stored, wanted, _plain)
        own = [one for one in inspector.get_indexes(name) if not one.get("duplicates_constraint")]
        indexes = {
            f"{one['name']} ({', '.join(map(str, one['column_names']))}){' UNIQUE' * bool(one['unique'])}"
            for one in own
        }
        yield from _apart(
            f"index of {name}", indexes, [f"{one.name} ({', '.join(one.columns.keys())})" for one in table.indexes]
        )
    if sqlite:
        query = "SELECT sql FROM sqlite_master WHERE type IN ('trigger', 'view')"
        yield from _apart("trigger or view", connection.exec_driver_sql(query).scalars(), TRIGGERS["sqlite"])
        return
    query = (
        "SELECT concat_ws(' ', t.tgname, t.tgtype, t.tgenabled, t.tgqual, p.proname) || p.prosrc FROM pg_trigger t "
        "JOIN pg_proc p ON p.oid = t.tgfoid WHERE t.tgrelid = 'entries'::regclass AND NOT t.tgisinternal"
    )
    refuses = "O entries_stay BEGIN RAISE EXCEPTION 'entries are never changed'; END "
    # before each row that is deleted or updated (1 + 2 + 8 + 16), before a truncation (2 + 32), without a condition
    triggers = {f"{name} {refuses}" for name in ("entries_no_change 27", "entries_no_truncate 34")}
    yield from _apart("trigger", connection.exec_driver_sql(query).scalars(), triggers)


_SQLITE = "SELECT sql FROM sqlite_master WHERE type = 'table' AND name = '{}'"
_POSTGRESQL = (
    "SELECT concat(a.attname, ' ', format_type(a.atttypid, a.atttypmod), CASE WHEN a.attnotnull THEN ' NOT NULL' END, "
    "' DEFAULT ' || pg_get_expr(d.adbin, d.adrelid), a.attidentity, a.attgenerated) FROM pg_attribute a "
    "LEFT JOIN pg_attrdef d ON d.adrelid = a.attrelid AND d.adnum = a.attnum "
    "WHERE a.attrelid = '{0}'::regclass AND a.attnum > 0 AND NOT a.attisdropped UNION ALL "
    "SELECT concat('CONSTRAINT ', conname, ' ', pg_get_constraintdef(oid)) FROM pg_constraint "
    "WHERE conrelid = '{0}'::regclass AND contype IN ('c', 'f', 'p', 'u', 'x')"
)


def _definitions(sql: str) -> list[str]:
    """Columns and constraints of a CREATE TABLE, in any order, and what stands behind them."""
    inside, _, behind = sql.partition("(")[2].rpartition(")")
    return [" ".join(one.split()) for one in (*re.split(r",(?![^()]*\))", inside), behind) if one.strip()]


def _plain(definition: str) -> str:
    """A definition as both a database and SQLAlchemy write it."""
    text = re.sub(r'[\s()"]', "", definition.lower())
    return text.replace("charactervarying", "varchar").replace("doubleprecision", "float53")


def _apart(
    sort: str, there: Iterable[str], made: Iterable[str], plain: Callable[[str], str] = str
) -> Iterator[ChainFinding]:
    one, other = ({plain(name): name for name in names} for names in (there, made))
    for name in sorted(other.keys() - one.keys()):
        yield ChainFinding("schema", f"the {sort} {other[name]} is missing")
    for name in sorted(one.keys() - other.keys()):
        yield ChainFinding("schema", f"the {sort} {one[name]} is not of the records")
