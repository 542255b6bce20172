"""A Parquet file holds its rows as they were given, is there whole or not at all, and says what its columns mean."""

from __future__ import annotations

import datetime as dt
from collections.abc import Iterator
from pathlib import Path

import pytest

from cmm_uq.app.commands.laboratory import batch_jobs as module
from cmm_uq.app.commands.laboratory.batch_jobs import Row, check_parquet, write_parquet
from cmm_uq.base.errors import OutputError

parquet = pytest.importorskip("pyarrow.parquet")

COLUMNS = (
    ("job", "string", "Id."),
    ("word", "word", "Said again."),
    ("day", "date32", "Of it."),
    ("value", "float64", "In µm."),
)
DAY = dt.date(2026, 1, 2)


def rows(count: int) -> Iterator[Row]:
    return ((f"j{i}", "ab"[i % 2], DAY + dt.timedelta(days=i), None if i == 2 else i / 7) for i in range(count))


def test_rows_come_back_as_they_were_given_group_by_group(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "GROUP", 4)
    write_parquet(tmp_path / "a.parquet", COLUMNS, rows(10), force=False)
    with parquet.ParquetFile(tmp_path / "a.parquet") as file:
        assert [file.metadata.row_group(i).num_rows for i in range(file.num_row_groups)] == [4, 4, 2]
        assert file.schema_arrow.field("value").metadata == {b"meaning": "In µm.".encode()}
        assert [tuple(row.values()) for row in file.read().to_pylist()] == list(rows(10))
    write_parquet(tmp_path / "b.parquet", COLUMNS, rows(10), force=False)
    assert (tmp_path / "a.parquet").read_bytes() == (tmp_path / "b.parquet").read_bytes()


def test_no_rows_are_a_table_too(tmp_path: Path) -> None:
    write_parquet(tmp_path / "a.parquet", COLUMNS, (), force=False)
    assert parquet.read_table(tmp_path / "a.parquet").column_names == [name for name, _, _ in COLUMNS]


def test_rows_that_fail_leave_nothing_and_what_is_there_stays(tmp_path: Path) -> None:
    def failing() -> Iterator[Row]:
        yield from rows(2)
        raise OSError(28, "No space left on device")

    path = tmp_path / "a.parquet"
    with pytest.raises(OutputError, match="No space left on device"):
        write_parquet(path, COLUMNS, failing(), force=False)
    assert list(tmp_path.iterdir()) == []
    path.write_text("mine")
    for refused in (
        lambda: check_parquet(path, force=False),
        lambda: write_parquet(path, COLUMNS, rows(1), force=False),
    ):
        with pytest.raises(OutputError, match="is there already"):
            refused()
    with pytest.raises(OutputError, match="no such folder"):
        check_parquet(tmp_path / "none" / "a.parquet", force=False)
    check_parquet(path, force=True)
    write_parquet(path, COLUMNS, rows(1), force=True)
    assert (tmp_path / "a.parquet.previous").read_text() == "mine"
    assert parquet.read_table(path).num_rows == 1
