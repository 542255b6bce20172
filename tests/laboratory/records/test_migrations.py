"""Records of an older version are brought to the newest, with all that they hold."""

from __future__ import annotations

import sqlite3
from pathlib import Path

import pytest

from cmm_uq.base.errors import CmmUqError
from cmm_uq.laboratory.records import open_records
from cmm_uq.laboratory.records.backup import migrate
from cmm_uq.laboratory.records.opening import KNOWN, REVISION, engine_of
from tests.laboratory.records.histories import history, take_back


def first(path: Path) -> Path:
    open_records(path, create=True).close()
    take_back(engine_of(path))
    return path


def schema(path: Path) -> dict[str, set[str]]:
    with sqlite3.connect(path) as raw:
        names = raw.execute("SELECT type, name, tbl_name FROM sqlite_master WHERE name NOT LIKE 'sqlite_%'").fetchall()
        columns = {name: {repr(row[1:]) for row in raw.execute(f"PRAGMA table_info({name})")}
                   for kind, name, _ in names if kind == "table"}  # fmt: skip
        return columns | {"": {f"{kind} {name} {table}" for kind, name, table in names if kind != "table"}}


def test_an_older_version_is_refused_until_it_is_migrated_with_all_that_it_holds(tmp_path: Path) -> None:
    path, fresh = first(tmp_path / "old.db"), tmp_path / "new.db"
    with open_records(fresh, create=True) as records:
        records.append_all(history(3, 2))
        entries = list(records.entries())
    with sqlite3.connect(path) as raw:  # what the older version had written; the index tables are made again from it
        raw.executemany("INSERT INTO entries VALUES (?, ?, ?, ?, ?, ?)",
                        [(e.number, e.at, e.kind, e.content, e.previous, e.hash) for e in entries])  # fmt: skip
    with pytest.raises(CmmUqError, match=r"older version.*records migrate"):
        open_records(path)
    assert migrate(path) == (KNOWN[0], REVISION)
    assert migrate(path) == (REVISION, REVISION)
    with open_records(path) as records, open_records(fresh) as made:
        assert list(records.entries()) == entries
        assert records.verify(files=False) == []
        assert records.certificates("100001") == made.certificates("100001")


def test_migrated_tables_are_those_that_are_made_anew(tmp_path: Path) -> None:
    path, fresh = first(tmp_path / "old.db"), tmp_path / "new.db"
    migrate(path)
    open_records(fresh, create=True).close()
    assert schema(path) == schema(fresh)


def test_a_revision_that_fails_changes_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = first(tmp_path / "old.db")
    before = schema(path)

    def fail(connection: object) -> None:
        raise OSError("no more")

    monkeypatch.setattr("cmm_uq.laboratory.records.indexing.rebuild", fail)
    with pytest.raises(OSError, match="no more"):
        migrate(path)
    assert schema(path) == before


def test_records_of_a_newer_version_are_refused_and_stay_as_they_are(tmp_path: Path) -> None:
    path = tmp_path / "records.db"
    open_records(path, create=True).close()
    with sqlite3.connect(path) as raw:
        raw.execute("UPDATE alembic_version SET version_num = '9999'")
    for way in (lambda: open_records(path), lambda: open_records(path, create=True), lambda: migrate(path)):
        with pytest.raises(CmmUqError, match=r"newer version.*Update cmm-uq"):
            way()
