"""The tables: entries, what follows from them, and sets of files on their way (SQLAlchemy Core)."""

from __future__ import annotations

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


entries = Table(
    "entries", META,
    Column("number", NUMBER, primary_key=True, autoincrement=False),
    Column("at", String(27), nullable=False),
    Column("kind", String(20), nullable=False),
    Column("content", Text, nullable=False),
    Column("previous", String(64), nullable=False),
    Column("hash", String(64), nullable=False),
    CheckConstraint("number >= 1", name="counts"),
    Index(None, "kind", "number"),
)  # fmt: skip

machines = Table(
    "machines", META,
    Column("id", Integer, primary_key=True, autoincrement=False),
    Column("recognised", Text, nullable=False, unique=True),
    Column("called", Text, nullable=False, unique=True),
    Column("spelled", Text, nullable=False, index=True),
    Column("named", Text, nullable=False, index=True),
    Column("name", Text, nullable=False),
    Column("manufacturer", Text, nullable=False),
    Column("model", Text, nullable=False),
    Column("place", Text, nullable=False),
    Column("calibrate", Text),
    Column("day", DAY, nullable=False),
    Column("entry", NUMBER, _of("entries.number"), nullable=False),
)  # fmt: skip

adjustments = Table(
    "adjustments", META,
    Column("machine", Integer, _of("machines.id"), primary_key=True),
    Column("day", DAY, primary_key=True),
    Column("entry", NUMBER, _of("entries.number"), nullable=False),
)  # fmt: skip

artefacts = Table(
    "artefacts", META,
    Column("id", Integer, primary_key=True, autoincrement=False),
    Column("recognised", Text, nullable=False, unique=True),
    Column("called", Text, nullable=False, index=True),
    Column("kind", Text, nullable=False),
    Column("certificate", Text, nullable=False),
    Column("laboratory", Text, nullable=False),
    Column("calibrated", DAY),
    Column("due", DAY),
    Column("day", DAY, nullable=False),
    Column("entry", NUMBER, _of("entries.number"), nullable=False),
)  # fmt: skip

certificates = Table(
    "certificates", META,
    Column("entry", NUMBER, _of("entries.number"), primary_key=True, autoincrement=False),
    Column("machine", Integer, _of("machines.id"), nullable=False),
    Column("artefact", Integer, _of("artefacts.id")),
    Column("command", Text, nullable=False),
    Column("job", Text, nullable=False),
    Column("number", Text, nullable=False),
    Column("kind", Text, nullable=False),
    Column("origin", Text, nullable=False),
    Column("day", DAY, nullable=False),
    Column("at", String(27), nullable=False),
    Column("adjusted_since", DAY),
    Column("state", Text, nullable=False),
    Column("decision", Text, nullable=False),
    Column("diagnosis", Text, nullable=False),
    Column("interim", Boolean(create_constraint=False), nullable=False),
    Column("folder", Text, nullable=False),
    Column("version", Text, nullable=False),
    Column("results_sha256", String(64), nullable=False),
    Column("artefact_due", DAY),
    Index(None, "machine", "command", "origin", "day", "entry"),
    Index(None, "command", "origin", "day", "entry"),
    Index(None, "artefact", "day"),
    Index(None, "results_sha256"),
    Index(None, "job"),
    Index(None, "number"),
    Index(None, "folder", "entry"),
)  # fmt: skip

quantities = Table(
    "quantities", META,
    Column("id", Integer, primary_key=True, autoincrement=False),
    Column("name", Text, nullable=False),
    Column("quantity", Text, nullable=False),
    Column("unit", Text, nullable=False),
    UniqueConstraint("name", "quantity", "unit"),
)  # fmt: skip

figures = Table(
    "figures", META,
    Column("certificate", NUMBER, _of("certificates.entry"), primary_key=True, autoincrement=False),
    Column("place", Integer, primary_key=True, autoincrement=False),
    Column("quantity", Integer, _of("quantities.id"), nullable=False),
    Column("value", DOUBLE, nullable=False),
    Column("u", DOUBLE, nullable=False),
    Column("lower", DOUBLE, nullable=False),
    Column("upper", DOUBLE, nullable=False),
    Column("u_artefact", DOUBLE, nullable=False),
    Column("at_most", DOUBLE),
    sqlite_with_rowid=False,
)  # fmt: skip

covariances = Table(
    "covariances", META,
    Column("certificate", NUMBER, _of("certificates.entry"), primary_key=True, autoincrement=False),
    Column("names", Text, nullable=False),
    Column("lower", Text, nullable=False),
)  # fmt: skip

signatures = Table(
    "signatures", META,
    Column("entry", NUMBER, _of("entries.number"), primary_key=True, autoincrement=False),
    Column("certificate", NUMBER, _of("certificates.entry"), nullable=False, index=True),
    Column("what", Text, nullable=False),
    Column("by", Text, nullable=False),
    Column("reason", Text, nullable=False),
    Column("at", String(27), nullable=False),
    Column("replaced_by", NUMBER, _of("certificates.entry")),
)  # fmt: skip

pending = Table(
    "pending", META,
    Column("token", String(12), primary_key=True),
    Column("host", Text, nullable=False),
    Column("folder", Text, nullable=False),
    Column("manifest", String(64), nullable=False),
    Column("at", String(27), nullable=False),
    Column("kind", String(20), nullable=False),
    Column("content", Text, nullable=False),
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
