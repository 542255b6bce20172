"""A table is read up to its limits; its columns bear names that can be written into other tables."""

from __future__ import annotations

import pytest

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.files.csv_table import cells_of, column_problem
from cmm_uq.base.files.limits import CELL, CELLS, COLUMN_NAME, COLUMNS, LINE, LINES, ROWS, Limit


def cells(text: str, rows: Limit = ROWS):
    return cells_of(text.encode(), "t.csv", "Save it", most_rows=rows)


def test_blanks_comments_and_empty_rows_are_passed_over_and_lines_counted() -> None:
    found = cells("\n# who\n a , b\n\n1, 2\r\n# why\n3,4")
    assert (found.header, found.header_line) == (["a", "b"], 3)
    assert (found.rows, found.lines) == ([["1", "2"], ["3", "4"]], [5, 7])


def test_lone_carriage_returns_end_lines_too() -> None:
    assert cells("a\r1\r2").lines == [2, 3]


def test_a_file_without_rows_has_none() -> None:
    assert cells("").header == []
    assert cells("# nothing\n").rows == []


@pytest.mark.parametrize(
    ("within", "beyond", "says"),
    [
        ("a\n" + "1" * CELL.most, "a\n" + "1" * (CELL.most + 1), "line 2: a cell has 501 characters"),
        ("," * (COLUMNS.most - 1) + "a", "," * COLUMNS.most + "a", "line 1: has 201 cells"),
        ("#" * LINE.most, "a\n" + "#" * (LINE.most + 1), "line 2: the line has 100001 characters"),
        ("\n" * LINES.most, "\n" * (LINES.most + 1), f"has more than {LINES.most} lines"),
        ('a\n"1\n2"', 'a\n"' + "1\n" * 70_000, "is no CSV: field larger"),
    ],
)
def test_what_goes_beyond_a_limit_is_refused_with_its_line(within: str, beyond: str, says: str) -> None:
    cells(within)
    with pytest.raises(CmmUqError, match=says):
        cells(beyond)


def test_rows_and_cells_are_counted_while_they_are_read() -> None:
    three = Limit(3, "rows", "test", "it is one")
    assert len(cells("a\n1\n2\n3\n", three).rows) == 3
    with pytest.raises(CmmUqError, match="line 5: the table goes on after 3 rows"):
        cells("a\n1\n2\n3\n4\n", three)
    row = "1," * 99 + "1\n"
    assert len(cells(row * (CELLS.most // 100)).rows) == CELLS.most // 100 - 1
    with pytest.raises(CmmUqError, match="5000000 cells"):
        cells(row * (CELLS.most // 100 + 1))


@pytest.mark.parametrize(
    "name", ['=HYPERLINK("x")', "+1", "-x", "@x", "＝x", "a\x1bb", "a\u202eb", "a\u200bb", "a" * 61]
)
def test_a_column_cannot_bear_a_name_that_computes_steers_or_never_ends(name: str) -> None:
    assert column_problem(name)


@pytest.mark.parametrize("name", ["temp_x_c", "Größe", "a-b", "x=1", "1", "a" * COLUMN_NAME.most, "温度"])
def test_other_names_are_free(name: str) -> None:
    assert column_problem(name) is None
