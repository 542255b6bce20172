"""A table is read up to its limits; its columns bear names that can be written into other tables."""

from __future__ import annotations

import re
from decimal import Decimal

import pytest
from hypothesis import example, given, strategies as st

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.files.csv_table import LARGEST, SMALLEST, cells_of, column_problem, conversion, number_problem, numbers
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


@pytest.mark.long
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


GRAMMAR = re.compile(r"[+-]?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][+-]?[0-9]+)?")
"""Written down anew, without a look at the code."""

WRITTEN = st.from_regex(GRAMMAR, fullmatch=True).filter(lambda text: len(text) < 60)


def meant(cell: str) -> Decimal | None:
    """What an independent reading makes of it, within the limits."""
    if not GRAMMAR.fullmatch(cell):
        return None
    exponent = int(re.split("[eE]", cell)[1]) if re.search("[eE]", cell) else 0
    if abs(exponent) > 10_000:
        return Decimal(0) if not re.search("[1-9]", re.split("[eE]", cell)[0]) else None
    value = Decimal(cell)
    return value if value == 0 or Decimal(SMALLEST) <= abs(value) <= Decimal(LARGEST) else None


def place(row: int) -> str:
    return f"row {row}"


@given(st.one_of(WRITTEN, st.text("0123456789+-.eE_ xnaif١²", max_size=12), st.text(max_size=8)))
@example("-2_11.1357")
@example("1e-400")
@example("0e-400")
@example("1e15")
@example("1.0000001e15")
@example("0x10")
@example("1e5")
@example("٣")
@example("infinity")
@example("nan")
@example("")
def test_a_cell_is_read_exactly_as_the_grammar_says(cell: str) -> None:
    expected = meant(cell)
    assert (number_problem(cell) is None) == (expected is not None)
    if expected is None:
        with pytest.raises(CmmUqError, match=r"^row 1: "):
            numbers(["1", cell], place)
    else:
        assert numbers(["1", cell], place)[1] == float(expected)


@pytest.mark.long
@given(st.lists(WRITTEN, max_size=30))
def test_a_column_is_read_as_its_cells_are(cells: list[str]) -> None:
    bad = [i for i, cell in enumerate(cells) if meant(cell) is None]
    if bad:
        with pytest.raises(CmmUqError, match=rf"^row {bad[0]}: "):
            numbers(cells, place)
    else:
        assert numbers(cells, place).tolist() == [float(meant(cell) or 0) for cell in cells]


@pytest.mark.parametrize(
    ("cell", "says"),
    [
        ("", "no value"),
        ("NaN", "'NaN' is not a finite number"),
        ("2,5", "'2,5' is not a number. Write decimals with a point"),
        ("1,234.5", "'1,234.5' is not a number. Write it without groups of digits"),
        ("1_0", "'1_0' is not a number. Write it with digits 0 to 9"),
        ("1e16", "'1e16' is too large"),
        ("-1e400", "'-1e400' is too large"),
        ("1e-31", "'1e-31' is too small"),
    ],
)
def test_the_refusal_says_what_to_write(cell: str, says: str) -> None:
    with pytest.raises(CmmUqError, match=re.escape(says)):
        numbers([cell], place)


KEYS = (
    "length_mm",
    "u_um",
    "cte_per_k",
    "temperature_c",
    "u_temperature_k",
    "squareness_arcsec",
    "time_s",
    "pressure_hpa",
)


@pytest.mark.parametrize(
    ("given", "told"),
    [
        ("U_um", "Give u_um = U/k, the standard uncertainty: U is k times as large"),
        ("u_ppm", "Give u_um = u_ppm · L / 1000, with the length L in mm"),
        ("u_um_per_m", "Give u_um = u_um_per_m · L / 1000, with the length L in mm"),
        ("u_mm", "Give u_um = 1000 · u_mm"),
        ("u_inch", "Give u_um = 25400 · u_inch"),
        ("length_in", "Give length_mm = 25.4 · length_in"),
        ("length_m", "Give length_mm = 1000 · length_m"),
        ("cte_ppm_per_k", "Give cte_per_k = 1e-6 · cte_ppm_per_k"),
        ("cte_per_f", "Give cte_per_k = 1.8 · cte_per_f"),
        ("temperature_f", "Give temperature_c = (temperature_f − 32) / 1.8"),
        ("temperature_k", "Give temperature_c = temperature_k − 273.15"),
        ("u_temperature_f", "Give u_temperature_k = u_temperature_f / 1.8"),
        ("squareness_deg", "Give squareness_arcsec = 3600 · squareness_deg"),
        ("dof", "Give u_um = u · √(ν/(ν − 2)), the standard deviation of a t distribution with ν degrees of freedom"),
        ("u", None), ("length", None), ("colour", None),
    ],
)  # fmt: skip
def test_the_fix_is_the_conversion(given: str, told: str | None) -> None:
    assert conversion(given, KEYS) == told


@pytest.mark.parametrize(
    ("given", "value", "known", "converted"),
    [
        ("u_ppm", 2.0, "u_um", 2.0 * 500 / 1000),
        ("temperature_f", 68.0, "temperature_c", 20.0),
        ("length_in", 1.0, "length_mm", 25.4),
    ],
)
def test_the_formulas_are_right_for_known_figures(given: str, value: float, known: str, converted: float) -> None:
    """2 ppm of half a metre are a micrometre; 68 °F are 20 °C; an inch is 25.4 mm."""
    told = conversion(given, [known])
    assert told is not None
    formula = told.partition(" = ")[2].partition(",")[0].replace("−", "-").replace("·", "*").replace(given, repr(value))
    assert eval(formula, {"L": 500}) == pytest.approx(converted)
