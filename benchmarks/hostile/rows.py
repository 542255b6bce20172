"""Records altered by SQL, as who has the file can: rows, tables, columns, triggers, views, and what SQLite says of itself."""

from __future__ import annotations

import random
import sqlite3

_JOURNAL = slice(18, 20)
"""Bytes of the header that say whether there is a journal beside; in memory there is none."""
VALUES = (None, -1, 0, 2**63 - 1, -(2**63), 1e308, float("inf"), "", "x", "9" * 5000, "a\0b", "\u202etxt", "2026-13-40", "{",
          "[]", "null", '{"a": 1}', "[" * 3000, b"", b"\xff\xfe", b"x" * 100_000, "../../etc/passwd", "/dev/zero")  # fmt: skip


def altered(content: bytes, random_: random.Random) -> tuple[bytes, str]:
    """The file with one to three alterations, and what they were; mostly past the triggers, which come back or do not."""
    connection = sqlite3.connect(":memory:", isolation_level=None)
    connection.deserialize(_journal(content, b"\1\1"))
    connection.execute("PRAGMA writable_schema = 1")
    triggers = connection.execute("SELECT name, sql FROM sqlite_master WHERE type = 'trigger'").fetchall()
    if past := random_.random() < 0.8:
        for name, _ in triggers:
            connection.execute(f'DROP TRIGGER "{name}"')
    told = [_alter(connection, random_) for _ in range(random_.choice((1, 1, 1, 2, 3)))]
    if past and random_.random() < 0.7:
        for _, sql in triggers:
            _run(connection, sql)
    made = connection.serialize()
    connection.close()
    return _journal(made, content[_JOURNAL]), "; ".join(told)


def _journal(content: bytes, kind: bytes) -> bytes:
    return content[: _JOURNAL.start] + kind + content[_JOURNAL.stop :]


def _alter(connection: sqlite3.Connection, random_: random.Random) -> str:
    tables = [
        name for (name,) in connection.execute("SELECT name FROM sqlite_master WHERE type = 'table' ORDER BY name")
    ]
    if not tables:
        return "nothing is left"
    table = random_.choice(tables)
    columns = [row[1] for row in connection.execute(f'PRAGMA table_info("{table}")')] or ["x"]
    column, value = random_.choice(columns), random_.choice(VALUES)
    some = f'rowid IN (SELECT rowid FROM "{table}" ORDER BY random() LIMIT {random_.choice((1, 1, 100))})'
    number = random_.choice((0, 1, 3, 0x7FFFFFFF))
    statements = {
        f'UPDATE "{table}" SET "{column}" = ?': 6, f'UPDATE "{table}" SET "{column}" = "{column}" || ?': 1,
        f'UPDATE "{table}" SET "{column}" = ? WHERE {some}': 6, f'DELETE FROM "{table}"': 1,
        f'DELETE FROM "{table}" WHERE {some}': 2, f'INSERT INTO "{table}" ("{column}") VALUES (?)': 1,
        f'INSERT INTO "{table}" SELECT * FROM "{table}" LIMIT 1': 1, f'DROP TABLE "{table}"': 1,
        f'ALTER TABLE "{table}" RENAME TO "other"': 1, f'ALTER TABLE "{table}" ADD COLUMN more TEXT': 1,
        f'ALTER TABLE "{table}" DROP COLUMN "{column}"': 1, f'ALTER TABLE "{table}" RENAME COLUMN "{column}" TO "more"': 1,
        f'CREATE TABLE "copy" AS SELECT * FROM "{table}"': 1,
        f"CREATE TRIGGER t AFTER INSERT ON \"{table}\" BEGIN SELECT RAISE(ABORT, 'no'); END": 1,
        f'CREATE TRIGGER t AFTER INSERT ON "{table}" BEGIN DELETE FROM "{table}"; END': 1,
        f'CREATE VIEW "seen" AS SELECT * FROM "{table}"': 1, f"PRAGMA user_version = {number}": 1,
        f"PRAGMA application_id = {number}": 1, "UPDATE sqlite_master SET sql = ? WHERE type <> 'trigger'": 1,
        f"UPDATE sqlite_master SET rootpage = {number} WHERE name = '{table}'": 1, "PRAGMA encoding = 'UTF-16'": 1,
    }  # fmt: skip
    statement = random_.choices(list(statements), list(statements.values()))[0]
    why = _run(connection, statement, *([value] if "?" in statement else []))
    return f"{statement.replace('?', repr(value)[:40])}{why}"


def _run(connection: sqlite3.Connection, statement: str, *values: object) -> str:
    """Run it; where the database itself refuses, it stays as it is."""
    try:
        connection.execute(statement, values)
    except (sqlite3.Error, OverflowError) as error:
        return f" ({error})"
    return ""
