"""Whatever the dialect of a text table, its values are read back as they were written; two ways to read them are refused."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest
from hypothesis import assume, given, settings, strategies as st

from cmm_uq.base.errors import CmmUqError
from cmm_uq.jobs.importing.cells.encodings import decoded
from cmm_uq.jobs.importing.format import ImportKeys
from cmm_uq.jobs.importing.recording import ImportedTable, imported
from tests.jobs.importing.exports import HEADINGS

MICROMETRES = st.integers(-2_000_000_000, 2_000_000_000)
ENCODINGS = ("utf-8", "utf-8-sig", "utf-16", "cp1252")


def read(content: str | bytes, **keys: object) -> ImportedTable:
    data = content.encode() if isinstance(content, str) else content
    return imported(data, "export.csv", ImportKeys.model_validate(keys))


def xyz(found: ImportedTable) -> list[list[float]]:
    return np.column_stack([found.columns[f"{axis}_mm"] for axis in "xyz"]).tolist()


def grouped(figure: str, group: str) -> str:
    """A figure with a sign between groups of three digits of its whole part."""
    whole, point, rest = figure.partition(".")
    sign, digits = ("-", whole[1:]) if whole.startswith("-") else ("", whole)
    parts = [digits[max(0, i - 3) : i] for i in range(len(digits), 0, -3)][::-1]
    return sign + group.join(parts) + point + rest


@st.composite
def dialects(draw: st.DrawFn) -> tuple[bytes, list[list[str]], str]:
    """Bytes of a table, its figures with a decimal point, and its decimal sign."""
    points = draw(st.lists(st.tuples(MICROMETRES, MICROMETRES, MICROMETRES), min_size=1, max_size=6))
    digits = draw(st.integers(1, 6))
    figures = [[f"{value / 1e6:.{digits}f}" for value in point] for point in points]
    decimal = draw(st.sampled_from(".,"))
    separator = draw(st.sampled_from(";\t|," if decimal == "." else ";\t|"))
    group = draw(st.sampled_from(["", " ", "'", "," if decimal == "." and separator != "," else ".", "\u00a0"]))
    assume(not (decimal == "." and group == "."))
    heads = HEADINGS[draw(st.sampled_from(sorted(HEADINGS)))]
    mark = "\x00"
    rows = [separator.join([*heads[:2], *(f"{head} [mm]" for head in heads[2:5])])]
    for i, point in enumerate(figures):
        cells = [grouped(figure, mark).replace(".", decimal).replace(mark, group) for figure in point]
        rows.append(separator.join([str(i + 1), "1", *cells]))
    before = draw(st.lists(st.sampled_from(["Protokoll", "", "Kunde: Müller", "x"]), max_size=3))
    end = draw(st.sampled_from(["\n", "\r\n", "\r"]))
    text = end.join([*before, *rows]) + draw(st.sampled_from(["", end, end + end]))
    return text.encode(draw(st.sampled_from(ENCODINGS))), figures, decimal


@settings(deadline=None)
@given(dialects())
def test_values_are_read_back_exactly_in_every_dialect(dialect: tuple[bytes, list[list[str]], str]) -> None:
    """Against Python's own reading of the figures; what cannot tell its decimal sign says so, and the key settles it."""
    content, figures, decimal = dialect
    refused = ""
    try:
        found = read(content)
    except CmmUqError as error:
        refused = str(error)
        found = read(content, decimal=decimal)
    assert not refused or "Say decimal" in refused
    assert xyz(found) == [[float(figure) for figure in point] for point in figures]


@settings(deadline=None)
@given(
    st.integers(-(10**9), 10**9),
    st.sampled_from([("in", Fraction(254, 10)), ("µm", Fraction(1, 1000)), ("m", Fraction(1000))]),
)
def test_a_unit_is_converted_to_the_last_digit_of_a_double(millionths: int, unit: tuple[str, Fraction]) -> None:
    """Against exact fractions: reading, multiplying and dividing round once each, by 2⁻⁵³ of the value at most."""
    figure = f"{millionths / 10**6:.6f}"
    assume(abs(Fraction(figure) * unit[1]) <= 10**7)
    found = read(f"Measurement,Point,X [{unit[0]}],Y [{unit[0]}],Z [{unit[0]}]\n1,1,{figure},0,0\n").columns["x_mm"][0]
    exact = Fraction(figure) * unit[1]
    assert abs(Fraction(float(found)) - exact) <= 3 * abs(exact) * Fraction(1, 2**53)


def test_an_inch_is_25_4_millimetres() -> None:
    assert xyz(read("Measurement,Point,X [in],Y [in],Z [in]\n1,1,1,0.5,-10\n")) == [[25.4, 12.7, -254.0]]


AMBIGUOUS = "Measurement;Point;X [mm];Y [mm];Z [mm]\n1;1;1,234;12,345;-3,210\n"


def test_a_comma_before_three_digits_everywhere_may_be_thousands_or_thousandths() -> None:
    with pytest.raises(CmmUqError, match=r"line 2, column X \[mm\]: '1,234' can be 1234 or 1\.234.*decimal = \",\""):
        read(AMBIGUOUS)
    assert xyz(read(AMBIGUOUS, decimal=",")) == [[1.234, 12.345, -3.21]]
    assert xyz(read(AMBIGUOUS, decimal=".")) == [[1234.0, 12345.0, -3210.0]]


@pytest.mark.parametrize(
    ("cell", "value"),
    [
        ("0,123", 0.123),
        ("1234,567", 1234.567),
        ("1,5", 1.5),
        ("1.234,567", 1234.567),
        ("1,234e2", 123.4),
        (",250", 0.25),
    ],
)
def test_one_cell_that_tells_settles_the_whole_table(cell: str, value: float) -> None:
    assert xyz(read(AMBIGUOUS + f"2;1;{cell};1,234;1,234\n"))[1] == [value, 1.234, 1.234]


@pytest.mark.parametrize(("cell", "value"), [("1,234.5", 1234.5), ("1,234,567", 1234567.0), ("12.5", 12.5)])
def test_commas_between_groups_are_no_decimal_commas(cell: str, value: float) -> None:
    assert xyz(read(AMBIGUOUS + f"2;1;{cell};1,234;1,234\n"))[1] == [value, 1234.0, 1234.0]


def test_nothing_that_says_the_unit_is_asked_for_where_inches_would_fit_too() -> None:
    text = "Measurement,Point,X,Y,Z\n1,1,0,0,0\n1,2,{},0,0\n"
    with pytest.raises(CmmUqError, match=r'may be in mm or in inch\. Say unit = "mm" or unit = "inch"'):
        read(text.format(400))
    assert xyz(read(text.format(400), unit="inch"))[1] == [10160.0, 0.0, 0.0]
    assert xyz(read(text.format(1600)))[1] == [1600.0, 0.0, 0.0]  # 40 640 mm is longer than any machine


def test_the_travel_of_the_machine_settles_the_unit() -> None:
    text = b"Measurement,Point,X,Y,Z\n1,1,0,0,0\n1,2,400,0,0\n"
    assert xyz(imported(text, "e.csv", ImportKeys(), reach_mm=1500.0))[1] == [400.0, 0.0, 0.0]
    with pytest.raises(CmmUqError, match="may be in mm or in inch"):
        imported(text, "e.csv", ImportKeys(), reach_mm=12_000.0)


@pytest.mark.parametrize("line", ["Units: inch", "Einheit;inch", "Unité = inch", "Unità: inch", "Unidad: inch"])
def test_a_line_before_the_table_may_say_the_unit(line: str) -> None:
    assert xyz(read(f"{line}\nMeasurement;Point;X;Y;Z\n1;1;1;0;0\n")) == [[25.4, 0.0, 0.0]]


def test_a_row_of_units_below_the_header_says_the_unit() -> None:
    assert xyz(read("Measurement;Point;X;Y;Z\n;;in;in;in\n1;1;1;0;0\n")) == [[25.4, 0.0, 0.0]]


def test_units_may_stand_in_the_cells_and_must_be_one() -> None:
    text = "Measurement;Point;X;Y;Z\n1;1;1 in;0 in;0 in\n1;2;{};0 in;0 in\n"
    assert xyz(read(text.format("2 in")))[1] == [50.8, 0.0, 0.0]
    with pytest.raises(CmmUqError, match=r"line 3, column X: '2 mm' among numbers in inch: the column mixes units"):
        read(text.format("2 mm"))


def test_columns_that_a_job_names_by_heading_or_number_win() -> None:
    text = "Nr;a;b;c\n1;1,5;2,5;3,5\n2;4,5;5,5;6,5\n"
    for columns in ({"x_mm": "c", "y_mm": "b", "z_mm": "a"}, {"x_mm": 4, "y_mm": 3, "z_mm": 2}):
        found = read(
            text,
            columns=columns,
            unit="mm",
            points_per_measurement=2,
            **({} if "c" in columns.values() else {"delimiter": ";"}),
        )
        assert xyz(found) == [[3.5, 2.5, 1.5], [6.5, 5.5, 4.5]]


def test_columns_of_several_points_are_named_in_their_order_and_further_ones_by_any_name() -> None:
    text = "Nr;XA;YA;ZA;XB;YB;ZB;Wind\n1;1,5;2;3;4;5;6;0,7\n"
    columns = {"measurement": "Nr", "x_mm": ["XB", "XA"], "y_mm": ["YB", "YA"], "z_mm": [7, 4], "wind": "Wind"}
    found = read(text, columns=columns, unit="mm")
    assert xyz(found) == [[4.0, 5.0, 6.0], [1.5, 2.0, 3.0]]
    assert found.columns["wind"].tolist() == [0.7, 0.7]
    with pytest.raises(CmmUqError, match=r"no column is wind among"):
        read(text, columns={**columns, "wind": "Wnd"}, unit="mm")


def test_a_table_without_a_header_is_read_by_numbers_of_columns() -> None:
    found = read("1\t0.5\t1.5\n2\t0.25\t1.25\n", columns={"x_mm": 1, "y_mm": 2, "z_mm": 3}, unit="mm", delimiter="tab",
                 points_per_measurement="all")  # fmt: skip
    assert xyz(found) == [[1.0, 0.5, 1.5], [2.0, 0.25, 1.25]]
    assert found.columns["measurement"].tolist() == [1, 1]
    assert found.columns["point"].tolist() == [1, 2]


def test_a_row_may_hold_several_points_with_what_they_share() -> None:
    found = read(
        "Position;x1 [mm];y1 [mm];z1 [mm];x2 [mm];y2 [mm];z2 [mm];Lufttemperatur [°C]\n"
        "7;1;2;3;4;5;6;20,5\n9;7;8;9;10;11;12;21,5\n"
    )
    assert xyz(found) == [[1, 2, 3], [4, 5, 6], [7, 8, 9], [10, 11, 12]]
    assert found.columns["measurement"].tolist() == [7, 7, 9, 9]
    assert found.columns["point"].tolist() == [1, 2, 1, 2]
    assert found.columns["temp_air_c"].tolist() == [20.5, 20.5, 21.5, 21.5]
    assert found.lines.tolist() == [2, 2, 3, 3]


def test_nominal_values_are_never_taken_for_measured_ones() -> None:
    found = read("Messung;Punkt;X Soll [mm];X Ist [mm];Y Ist [mm];Z Ist [mm];X Abw [mm]\n1;1;5;5,1;2,5;3,5;0,1\n")
    assert xyz(found) == [[5.1, 2.5, 3.5]]
    assert found.recognised.data["not_used"] == "X Soll [mm], X Abw [mm]"
    with pytest.raises(CmmUqError, match=r"nominal values are not taken for measured ones"):
        read("Messung;Punkt;X Soll [mm];Y Soll [mm];Z Soll [mm]\n1;1;5;5;5\n")


@pytest.mark.parametrize(
    ("heading", "value", "column", "read_as"),
    [
        ("Zeit [min]", "2", "time_s", 120.0), ("Temp X [K]", "293.15", "temp_x_c", 20.0),
        ("Luftdruck [kPa]", "101.3", "pressure_hpa", 1013.0),
        ("Part temperature [°C]", "20.1", "temp_artefact_c", 20.1),
        ("Certified length [µm]", "20000.1", "reference_mm", 20.0001),
        ("Approach X", "-1", "approach_x", -1.0), ("J", "1", "ny", 1.0), ("Wiederholung", "3", "repeat", 3.0),
    ],
)  # fmt: skip
def test_further_columns_are_brought_to_the_units_of_their_names(
    heading: str, value: str, column: str, read_as: float
) -> None:
    found = read(f"Measurement,Point,X [mm],Y [mm],Z [mm],{heading}\n1,1,1,2,3,{value}\n")
    assert found.columns[column].tolist() == pytest.approx([read_as], rel=1e-15)


def test_fahrenheit_is_refused_with_its_conversion() -> None:
    with pytest.raises(CmmUqError, match=r"'Temp X \[°F\]' is in °F. Export it in °C: temp_x_c = \(°F − 32\) / 1.8"):
        read("Measurement,Point,X [mm],Y [mm],Z [mm],Temp X [°F]\n1,1,1,2,3,68\n")


def test_what_was_recognised_is_told_in_full() -> None:
    told = read("Bericht\nMessung;Kugel;X [mm];Y [mm];Z [mm];Farbe\n1;A;1,5;2;3;rot\n1;B;2;3;4;rot\n").recognised.data
    assert told == {
        "file": "export.csv", "format": "text", "encoding": "UTF-8", "delimiter": "semicolon",
        "unit": "mm, in the heading X [mm]",
        "decimal": "comma", "table": "one point in a row", "header": "line 2", "not_used": "Farbe",
        "point_names": "A is 1, B is 2",
        "columns": {"x_mm": "X [mm]", "y_mm": "Y [mm]", "z_mm": "Z [mm]", "measurement": "Messung", "point": "Kugel"},
        "points": 2,
    }  # fmt: skip


def test_numbers_of_measurement_and_point_come_from_names_that_have_two() -> None:
    found = read("Name,X [mm],Y [mm],Z [mm]\nBar 3 ball 1,1,2,3\nBar 3 ball 2,1,2,4\nBar 10 ball 1,1,2,5\n")
    assert found.columns["measurement"].tolist() == [3, 3, 10]
    assert found.columns["point"].tolist() == [1, 2, 1]


@pytest.mark.parametrize(
    "name",
    [
        "Bar {m} ball {p}", "Ball{p}_Pos{m}", "KUGEL {p} / MESSUNG {m}", "{m}.{p}", "Sphere{p} (position {m})", "B{p}-{m}",
        "M{m}_P{p}_R{r}", "Run {r}, bar {m}, ball {p}",
    ],
)  # fmt: skip
def test_the_parts_of_a_name_say_measurement_point_and_repeat(name: str) -> None:
    """A bar of 400 mm in three directions, read twice where names have a third number."""
    ends = {3: [(1, 2, 3), (401, 2, 3)], 4: [(1, 2, 33), (1, 402, 33)], 5: [(1, 2, 63), (241, 2, 383)]}
    every = [(m, p, r) for m in ends for r in ((1, 2) if "{r}" in name else (1,)) for p in (1, 2)]
    rows = (";".join(map(str, (f'"{name.format(m=m, p=p, r=r)}"', *ends[m][p - 1]))) for m, p, r in every)
    found = read("Name;X [mm];Y [mm];Z [mm]\n" + "\n".join(rows) + "\n")
    columns = [found.columns.get(column, np.ones(len(every))) for column in ("measurement", "point", "repeat")]
    assert [*zip(*columns, strict=True)] == every


def test_names_of_which_nothing_says_what_they_number_are_asked_about() -> None:
    """Rows of a plate, or bars side by side."""
    rows = "".join(f"{m}.{p};{100 * p};{170 * m};5\n" for m in (1, 2, 3) for p in (1, 2, 3, 4))
    with pytest.raises(CmmUqError, match="nothing says which points belong to one measurement"):
        read(f"Name;X [mm];Y [mm];Z [mm]\n{rows}")


def test_names_whose_numbers_are_both_of_a_point_say_no_measurement() -> None:
    with pytest.raises(CmmUqError, match="nothing says which points belong to one measurement"):
        read("Name;X [mm];Y [mm];Z [mm]\nball 1 to ball 2;1;2;3\n")


def test_words_about_a_unit_are_no_unit() -> None:
    """ "unit in charge" is no inch, "Unit M" no metre."""
    with pytest.raises(CmmUqError, match="may be in mm or in inch"):
        read("The unit in charge\nBusiness unit M\nMeasurement;Point;X;Y;Z\n1;1;1;0;0\n")


def test_a_number_of_points_that_is_no_whole_number_of_measurements_is_refused() -> None:
    with pytest.raises(CmmUqError, match="3 points are no whole number of measurements of 2"):
        read("X [mm],Y [mm],Z [mm]\n1,2,3\n1,2,4\n1,2,5\n", points_per_measurement=2)


def said_of(content: bytes) -> str:
    """The refusal of a file, or nothing."""
    try:
        read(content)
    except CmmUqError as error:
        return str(error)
    return ""


@settings(deadline=None)
@given(st.text(max_size=200), st.sampled_from(["", "Measurement;Point;X [mm];Y [mm];Z [mm]\n1;1;"]))
def test_any_text_is_read_or_refused_in_one_line(text: str, before: str) -> None:
    told = said_of((before + text).encode("utf-8", errors="surrogatepass"))
    assert "\n" not in told
    assert len(told) <= 300


@settings(deadline=None)
@given(
    st.binary(max_size=300),
    st.sampled_from([b"", b"PK\x03\x04[Content_Types].xml", b"<QIFDocument>", b"00001 &\n00001 %\n", b"FILNAM/'A'\n"]),
)
def test_any_bytes_are_read_or_refused_in_one_line(content: bytes, before: bytes) -> None:
    assert "\n" not in said_of(before + content)


JAPANESE = "測定線;校正長さ [mm];測定値 1 [mm];測定値 2 [mm]\n1;100;100.0012;100.0008\n1;250;250.0021;250.0019\n"


def test_a_japanese_table_is_read_in_shift_jis_as_in_utf_8() -> None:
    place = {"lines": {"1": "along X from 0,0,0"}}
    utf_8, shift_jis = (read(JAPANESE.encode(code), **place) for code in ("utf-8", "cp932"))
    assert ("encoding", "Shift JIS") in [(fact.key, str(fact.value)) for fact in shift_jis.recognised.facts]
    assert shift_jis.columns.keys() == utf_8.columns.keys()
    assert all(np.array_equal(values, utf_8.columns[name]) for name, values in shift_jis.columns.items())
    assert shift_jis.recognised.columns == utf_8.recognised.columns


def test_japanese_names_of_a_character_and_a_number_are_shift_jis() -> None:
    rows = "".join(f"  {i}  点  面{i:02d}  {40 * i}.0012  5.0003  7.0001\n" for i in range(40))
    text = f"測定結果一覧\n番号  要素  名称  X座標  Y座標  Z座標\n{rows}"
    assert decoded(text.encode("cp932"), "export.txt") == (text, "Shift JIS")


SIGNS = ["µm", "±0,5", "100–200", "…", "Ø12", "20", "°C", "mm²"]
WORDS = {
    ("cp1252", "Windows-1252"): [
        ["Größe", "Länge", "Nennmaß", "Prüfkörper", "Größen–Liste", "„Zitat“", "ÜBER"],
        ["mesuré", "répétition", "Répétabilité", "à", "naïve", "«écart»", "ÉTALON"], ["Línea", "medición", "Nº", "señal"],
        ["Åsa", "mätning", "LÄGE"],
    ],
    ("cp1250", "Windows-1250"): [["měření", "délka", "příčka"], ["długość", "błąd", "położenie"]],
    ("cp1254", "Windows-1254"): [["ölçüm", "değeri", "sıcaklığı", "İleri"]],
    ("cp1251", "Windows-1251"): [["Положение", "длина", "ПОГРЕШНОСТЬ"]],
    ("cp1253", "Windows-1253"): [["Μέτρηση", "μήκος", "θέση"]],
    ("cp850", "code page 850"): [["Länge", "Prüfkörper", "LÄNGE"]],
    ("cp932", "Shift JIS"): [["測定線", "校正長さ", "繰返し"]],
    ("gb18030", "GB 18030"): [["测量值", "标称", "误差"]],
    ("big5", "Big5"): [["量測線", "標準值", "誤差"]],
    ("cp949", "Windows-949"): [["측정값", "길이", "위치"]],
}  # fmt: skip


@pytest.mark.parametrize("encoding", WORDS)
@given(st.data())
def test_an_encoding_is_known_by_words_of_one_language(encoding: tuple[str, str], data: st.DataObject) -> None:
    own = data.draw(st.sampled_from(WORDS[encoding]))
    signs = [one for one in SIGNS if one.encode(encoding[0], errors="replace").decode(encoding[0]) == one]
    words = data.draw(
        st.lists(st.sampled_from(signs if encoding[0] not in ("cp949", "gb18030", "cp932", "big5") else ["20"]))
    )
    text = data.draw(st.sampled_from([" ", ";", "\n"])).join([*own, *words])
    assert decoded(text.encode(encoding[0]), "export.csv") == (text, encoding[1])


IN_ROWS = {
    "axes in a column": [
        "Element;Merkmal;Istwert [mm];Sollwert [mm]", "Kugel 1;X;1,5;1", "Kugel 1;Y;2,5;2", "Kugel 1;Z;-3,5;-3",
        "Kugel 2;X;4,5;4", "Kugel 2;Y;5,5;5", "Kugel 2;Z;6,5;6",
    ],
    "labels in the first row": [
        "Feature;Axis;Nominal;Measured [mm];Dev", "S 1;X;1;1.5;0.5", ";Y;2;2.5;0.5", ";Z;-3;-3.5;-0.5",
        "S 2;X;4;4.5;0.5", ";Y;5;5.5;0.5", ";Z;6;6.5;0.5",
    ],
    "numbered points": [
        "Messung;Punkt;Achse;Soll;Ist (mm)", "1;1;X;1;1,5", "1;1;Y;2;2,5", "1;1;Z;-3;-3,5", "1;2;X;4;4,5", "1;2;Y;5;5,5",
        "1;2;Z;6;6,5",
    ],
    "names that end in an axis": [
        "Name;Actual [mm]", "M1_P1_X;1.5", "M1_P1_Y;2.5", "M1_P1_Z;-3.5", "M1_P2_X;4.5", "M1_P2_Y;5.5", "M1_P2_Z;6.5",
    ],
}  # fmt: skip


@pytest.mark.parametrize("name", IN_ROWS)
def test_a_row_for_each_coordinate_is_a_point_in_three_rows(name: str) -> None:
    keys = {} if name in ("numbered points", "names that end in an axis") else {"points_per_measurement": 2}
    found = read("\n".join(IN_ROWS[name]), **keys)
    assert xyz(found) == [[1.5, 2.5, -3.5], [4.5, 5.5, 6.5]]
    assert found.columns["point"].tolist() == [1, 2]
    assert found.lines.tolist() == [2, 5]


def test_runs_beside_each_other_are_repeats_of_a_point_in_three_rows() -> None:
    text = "Point;Axis;Run 1 (mm);Run 2 (mm)\n1;X;1.5;1.25\n;Y;2.5;2.25\n;Z;3.5;3.25\n2;X;4.5;4.25\n;Y;5.5;5.25\n;Z;6.5;6.25\n"
    found = read(text, points_per_measurement=4)
    assert xyz(found) == [[1.5, 2.5, 3.5], [1.25, 2.25, 3.25], [4.5, 5.5, 6.5], [4.25, 5.25, 6.25]]
    assert found.columns["repeat"].tolist() == [1, 2, 1, 2]


@pytest.mark.parametrize("head", ["Run;Axis", "Nr.;Axis"])
def test_lengths_along_x_y_and_z_in_turn_are_no_points(head: str) -> None:
    rows = "".join(
        f"{run};{axis};{size};{size}.00{run}\n"
        for run in (1, 2)
        for axis, size in zip("XYZ", (800, 600, 400), strict=True)
    )
    with pytest.raises(CmmUqError, match="nothing says where lines 'X', 'Y', 'Z' lie"):
        read(f"{head};Nominal (mm);Measured (mm)\n{rows}")


BLOCK = "Punkt;X [mm];Y [mm];Z [mm]\n1;1.5;2.5;3.5\n2;4.5;5.5;6.5\n"


def test_tables_below_each_other_are_measurements_where_each_has_a_title() -> None:
    found = read(f"Lage 1\n{BLOCK}\nLage 2\n{BLOCK}")
    assert found.columns["measurement"].tolist() == [1, 1, 2, 2]
    assert found.columns["point"].tolist() == [1, 2, 1, 2]
    assert found.lines.tolist() == [3, 4, 8, 9]


def test_the_head_of_another_page_begins_no_measurement() -> None:
    text = "Name;X [mm];Y [mm];Z [mm]\nM1_P1;1.5;2.5;3.5\nName;X [mm];Y [mm];Z [mm]\nM1_P2;4.5;5.5;6.5\n"
    found = read(text)
    assert (found.columns["measurement"].tolist(), found.columns["point"].tolist()) == ([1, 1], [1, 2])


def test_nominal_values_alone_are_no_points() -> None:
    with pytest.raises(CmmUqError):
        read("Element;Achse;Soll [mm]\nKugel 1;X;1.5\nKugel 1;Y;2.5\nKugel 1;Z;3.5\n", points_per_measurement=1)


def test_a_column_that_is_called_otherwise_says_no_unit() -> None:
    text = "Element;Axis;Actual;Status\nBall 1;X;1500.5;M\nBall 1;Y;2.5;M\nBall 1;Z;3.5;M\n"
    assert xyz(read(text, points_per_measurement=1, unit="mm")) == [[1500.5, 2.5, 3.5]]
    with pytest.raises(CmmUqError, match="nothing says the unit"):
        read(f"{text}Kugel 2;X;900.5;M\nKugel 2;Y;2.5;M\nKugel 2;Z;3.5;M\n", points_per_measurement=2)


def test_what_is_said_to_be_lengths_is_read_as_lengths() -> None:
    text = "Element;Axis;Nominal (mm);Measured (mm)\nA;X;100;100.001\nA;Y;200;200.002\nA;Z;300;300.003\n"
    places = {axis: f"along {axis} from 0,0,0" for axis in "XYZ"}
    found = read(text, columns={"line": "Axis"}, lines=places)
    np.testing.assert_allclose(found.columns["reference_mm"][1::2], [100, 200, 300])


def test_a_page_with_a_remark_begins_no_measurement() -> None:
    head = "Name;X [mm];Y [mm];Z [mm]\n"
    found = read(f"{head}M1_P1;1.5;2.5;3.5\nSeite 2\n{head}M1_P2;4.5;5.5;6.5\n")
    assert (found.columns["measurement"].tolist(), found.columns["point"].tolist()) == ([1, 1], [1, 2])


FEATURE = "SPHERE : S{0}\n     Nominal    Actual\nX    1.0000    1.0010\nY    2.0000    2.0010\nZ    3.0000    3.0010\n"


@pytest.mark.parametrize(("text", "told"), [
    (FEATURE.format(1) + "X    4.0000    4.0010\n", "no column is y_mm"),
    ("Units: mm\n" + FEATURE.format(1) + "Units: inch\n" + FEATURE.format(2), "no column is y_mm"),
    (FEATURE.format(1).replace("Z    3.0000    3.0010\n", ""), "nothing says"),
])  # fmt: skip
def test_a_report_of_features_drops_nothing(text: str, told: str) -> None:
    with pytest.raises(CmmUqError, match=told):
        read(text, points_per_measurement=1)


def test_a_list_of_points_without_a_head_is_asked_about_once() -> None:
    rows = [
        ("P1", 10.125, 20.25, -5.5),
        ("P2", 410.5, 22.125, -6.25),
        ("P3", 11.25, 330.5, -8.125),
        ("P4", 9.5, 19.25, 300.5),
    ]
    content = "\n".join(";".join(map(str, row)) for row in rows).encode()
    with pytest.raises(CmmUqError, match=r"2, 3, 4 may be x, y and z; nothing says the unit.*If they are: Say unit = "):
        imported(content, "list.txt", ImportKeys())
    found = imported(content, "list.txt", ImportKeys(unit="mm"))
    np.testing.assert_array_equal(
        np.column_stack([found.columns[f"{axis}_mm"] for axis in "xyz"]), [row[1:] for row in rows]
    )


def test_cells_of_two_figures_are_no_reading() -> None:
    head = "Line;Nominal (mm);Run 1 (mm);Run 2 (mm)\n"
    content = head + "1;100;100.0012;100.0008\n1;200;200.0021 200.0018;200.0013\n1;300;300.0002;299.9998\n"
    with pytest.raises(CmmUqError, match=r"column|cell|line"):
        imported(content.encode(), "e0.csv", ImportKeys(lines={"1": "along X from 0,0,0"}))


BALLS = b"""Ball bar check;;;;;;;;
;;Ball A;;;Ball B;;;
Asento;Toisto;X;Y;Z;X;Y;Z;Distance [mm]
1;1;100.0012;300.0003;-200.0011;600.0033;300.0001;-200.0010;500.0021
;2;100.0011;300.0004;-200.0010;600.0031;300.0002;-200.0011;500.0020
2;1;100.0012;400.0003;-200.0011;100.0033;900.0021;-200.0010;500.0018
;2;100.0013;400.0003;-200.0012;100.0034;900.0023;-200.0011;500.0020
"""


@pytest.mark.parametrize(
    "columns", [{}, {"measurement": "Asento"}, {"repeat": "Toisto"}, {"measurement": "Asento", "repeat": 2}]
)
def test_a_column_of_numbers_may_be_named_beside_balls_in_a_row(columns: dict[str, str | int]) -> None:
    found = read(BALLS, columns=columns, unit="mm").columns
    assert found["measurement"].tolist() == [1, 1, 1, 1, 2, 2, 2, 2]
    assert found["repeat"].tolist() == [1, 1, 2, 2, 1, 1, 2, 2]
    assert found["x_mm"].tolist()[:2] == [100.0012, 600.0033]


@pytest.mark.parametrize("columns", [{"repeat": "Nonsense"}, {"measurement": 12}])
def test_a_column_that_is_not_there_is_an_error(columns: dict[str, str | int]) -> None:
    with pytest.raises(CmmUqError, match="no column is"):
        read(BALLS, columns=columns, unit="mm")


def test_a_column_of_lengths_that_is_not_there_is_an_error() -> None:
    table = b"Line;Nominal [mm];Run 1 [mm];Run 2 [mm]\nA;100;100.001;100.002\nA;200;200.001;200.002\n"
    with pytest.raises(CmmUqError, match=r"no column is 'Nominel'\. Did you mean 'Nominal"):
        read(table, columns={"nominal_mm": "Nominel", "length_mm": "Run 1 [mm]"})


def test_a_figure_that_is_missing_makes_no_other_column_the_measured_one() -> None:
    rows = [
        (f"Ball{n}_{axis}", f"{100 * n + k}.0012", f"{100 * n + k}.0000", "0.0050")
        for n in range(1, 5)
        for k, axis in enumerate("XYZ")
    ]
    head = "Name;Measured [mm];Nominal [mm];Tolerance [mm]"
    whole = "\n".join([head, *map(";".join, rows)])
    assert len(read(whole).lines) == 4
    with pytest.raises(CmmUqError, match="no value"):
        read(whole.replace("302.0012", ""))


def test_a_coordinate_that_is_missing_makes_no_lengths_of_balls_in_a_row() -> None:
    with pytest.raises(CmmUqError, match="no value"):
        read(BALLS.replace(b"-200.0010;500.0018", b";500.0018") + BALLS.partition(b"mm]\n")[2], unit="mm")
