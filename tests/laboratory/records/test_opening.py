"""What cannot be opened, read or written is refused in one line that says what to do, and stays as it was."""

from __future__ import annotations

import os
import sqlite3
import subprocess
import sys
import threading
from pathlib import Path

import pytest

from cmm_uq.base.errors import CmmUqError, OutputError
from cmm_uq.laboratory.records import open_records, opening as openings
from cmm_uq.laboratory.records.place import place_of, shown
from tests.laboratory.records.histories import history

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


def test_checking_a_job_does_not_import_the_database(iota: Path) -> None:
    code = (
        "import sys; from cmm_uq.app.api.calls import check; from pathlib import Path; "
        f"check(Path({str(iota)!r})); import cmm_uq.laboratory.records.place, cmm_uq.laboratory.records.facts; "
        "sys.exit(any(name.split('.')[0] in ('sqlalchemy', 'alembic') for name in sys.modules))"
    )
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
