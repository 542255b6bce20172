"""What cannot be opened, read or written is refused in one line and stays as it was; an older version is migrated whole."""

from __future__ import annotations

import os
import shutil
import sqlite3
import sys
import threading
from pathlib import Path

import pytest

from cmm_uq.base.errors import CmmUqError, OutputError
from cmm_uq.laboratory.records import open_records, opening as openings
from cmm_uq.laboratory.records.backup import migrate
from cmm_uq.laboratory.records.opening import KNOWN, REVISION, engine_of
from cmm_uq.laboratory.records.place import of_folder, place_of, shown
from tests.laboratory.records.histories import history, take_back

AS_ROOT = hasattr(os, "geteuid") and os.geteuid() == 0


@pytest.fixture
def place(tmp_path: Path) -> Path:
    path = tmp_path / "records.db"
    with open_records(path, create=True) as records:
        records.append_all(history(2, 2))
    return path


def refused(where: Path | str, match: str, **how: bool) -> CmmUqError:
    with pytest.raises(CmmUqError, match=match) as told:
        open_records(where, **how)
    assert "\n" not in str(told.value)
    assert told.value.fix
    return told.value


def test_records_that_are_not_there_are_not_made_by_reading(tmp_path: Path) -> None:
    refused(tmp_path / "records.db", "there are no records")
    assert list(tmp_path.iterdir()) == []


def test_a_file_that_is_no_database_is_left_alone(tmp_path: Path) -> None:
    path = tmp_path / "records.db"
    path.write_bytes(b"number;value\n1;2\n" * 100)
    refused(path, "is no database", create=True)
    assert path.read_bytes() == b"number;value\n1;2\n" * 100


def test_a_folder_is_no_file_of_records(tmp_path: Path) -> None:
    refused(tmp_path, "is a folder", create=True)


def test_the_database_of_another_program_is_left_alone(tmp_path: Path) -> None:
    path = tmp_path / "orders.db"
    with sqlite3.connect(path) as raw:
        raw.execute("CREATE TABLE orders (number)")
    raw.close()
    before = path.read_bytes()
    refused(path, "another program", create=True)
    assert path.read_bytes() == before


def test_half_a_file_is_damaged_and_says_so(place: Path) -> None:
    with sqlite3.connect(place) as raw:
        raw.execute("PRAGMA wal_checkpoint(TRUNCATE)")
    raw.close()
    whole = place.read_bytes()
    place.write_bytes(whole[: len(whole) // 2])
    with pytest.raises(CmmUqError, match=r"damaged\. Restore a backup"):
        whatever_is_read(place)


def whatever_is_read(place: Path) -> None:
    with open_records(place, read_only=True) as records:
        records.verify(files=False)


def test_an_empty_file_holds_no_records_and_can_become_some(tmp_path: Path) -> None:
    path = tmp_path / "records.db"
    path.touch()
    refused(path, "holds no records")
    with open_records(path, create=True) as records:
        assert records.verify() == []


def test_records_that_another_program_keeps_locked_are_waited_for_then_said_to_be(
    place: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(openings, "PATIENCE_S", 0.2)
    other = sqlite3.connect(place, isolation_level=None)
    other.execute("BEGIN IMMEDIATE")
    with open_records(place) as records:
        assert len(records.certificates()) == 4  # reading goes on
        with pytest.raises(OutputError, match="another program keeps the records locked"):
            records.append("sent", {})
        other.execute("ROLLBACK")
        assert records.append("sent", {}).number == 5
    other.close()


def test_what_is_opened_to_be_read_is_not_written_to(place: Path) -> None:
    with open_records(place, read_only=True) as records:
        with pytest.raises(OutputError, match="read only"):
            records.append("sent", {})
        assert records.head()[0] == 4


def test_entries_that_stand_in_the_log_are_not_passed_over_where_nothing_can_be_written(
    place: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A database that is copied while somebody writes, to a medium that is read only or a folder that is closed."""
    copy = tmp_path / "copy" / place.name
    copy.parent.mkdir()
    access = os.access
    monkeypatch.setattr(os, "access", lambda path, mode, **how: mode != os.W_OK and access(path, mode, **how))
    with open_records(place) as records, records.reading():
        assert records.append("sent", {}).number == 5
        for end in ("", "-wal"):
            shutil.copy(f"{place}{end}", f"{copy}{end}")
        with open_records(place, read_only=True) as reader:  # beside who writes
            assert reader.head()[0] == 5
    refused(copy, "newest entries are in records.db-wal still. Copy both", read_only=True)
    Path(f"{copy}-wal").unlink()
    with open_records(copy, read_only=True) as records:
        assert records.head()[0] == 4


@pytest.mark.skipif(AS_ROOT, reason="root may write everywhere")
def test_a_file_without_permission_to_write_is_said_to_be_so(place: Path) -> None:
    place.chmod(0o444)
    with open_records(place) as records, pytest.raises(OutputError, match="cannot be written"):
        records.append("sent", {})


def test_a_full_disk_records_nothing(place: Path) -> None:
    with open_records(place) as records:
        with records.engine.connect() as connection:
            pages = connection.exec_driver_sql("PRAGMA page_count").scalar_one()
            connection.exec_driver_sql(f"PRAGMA max_page_count = {pages}")
            connection.rollback()
        with pytest.raises(OutputError, match="disk of the records is full"):
            records.append("sent", {"text": "x" * 100_000})
        assert records.head()[0] == 4
        assert records.verify(files=False) == []


@pytest.mark.parametrize(
    ("url", "match"),
    [
        ("mysql://lab@host/records", "mysql is no database for records"),
        ("nonsense://host/records", "nonsense is no database for records"),
        ("postgresql+psycopg9://lab@host/records", "is no URL of a database"),
        ("postgresql://lab@host:port/records", "is no URL of a database"),
    ],
)
def test_urls_without_a_database_behind_them_are_refused(url: str, match: str) -> None:
    refused(url, match)


def test_a_url_without_its_driver_names_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "psycopg", None)
    assert "postgres" in str(refused("postgresql://lab@host/records", "psycopg").fix)


def test_a_password_is_never_shown() -> None:
    assert shown("postgresql://lab:secret@host/records?sslkey=x") == "postgresql://lab@host/records"


def test_the_option_goes_before_the_environment_and_the_environment_before_the_default(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.delenv("CMM_UQ_RECORDS")
    assert place_of(None) == Path("reports/records.db")
    monkeypatch.setenv("CMM_UQ_RECORDS", "postgresql://host/lab")
    assert place_of(None) == "postgresql://host/lab"
    assert place_of(tmp_path / "x.db") == tmp_path / "x.db"
    assert place_of("none") is None
    monkeypatch.setenv("CMM_UQ_RECORDS", "none")
    assert place_of(None) is None
    with pytest.raises(CmmUqError, match="no records are asked for"):
        open_records()


def test_the_records_are_in_one_place_whatever_out_is_and_former_ones_go_on(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.chdir(tmp_path)
    assert of_folder(None) == of_folder(Path("a/x")) == of_folder(tmp_path / "b" / "x") == Path("reports/records.db")
    former = tmp_path / "b" / "records.db"
    former.parent.mkdir()
    open_records(former, create=True).close()
    assert of_folder(tmp_path / "b" / "x") == former  # made beside the folder by a version up to 0.15
    assert of_folder(tmp_path / "c" / "x") == Path("reports/records.db")
    monkeypatch.setattr("os.access", lambda path, mode: False)
    assert of_folder(tmp_path / "c" / "x") == tmp_path / "c" / "records.db"  # nothing can be written here


def test_writers_at_the_same_time_make_one_chain(tmp_path: Path) -> None:
    place = tmp_path / "records.db"

    def write(who: int) -> None:
        with open_records(place, create=True) as records:
            for turn in range(5):
                records.append("sent", {"who": who, "turn": turn})

    threads = [threading.Thread(target=write, args=(who,)) for who in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    with open_records(place) as records:
        assert sorted((entry.data["who"], entry.data["turn"]) for entry in records.entries()) == [
            (who, turn) for who in range(4) for turn in range(5)
        ]
        assert records.verify() == []


def test_a_file_that_another_process_is_making_is_waited_for(tmp_path: Path) -> None:
    """A reader and a writer of the same empty file: SQLite refuses to change its journal at once, whatever its time limit."""
    place = tmp_path / "records.db"
    other = sqlite3.connect(place, isolation_level=None, check_same_thread=False)
    other.execute("BEGIN EXCLUSIVE")
    threading.Timer(0.4, other.execute, ("ROLLBACK",)).start()
    with open_records(place, create=True) as records:
        assert records.append("sent", {"turn": 1}).number == 1


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
