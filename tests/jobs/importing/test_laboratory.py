"""Exports as laboratories have them are read whole, to their last digit; what they leave open is asked, and never guessed."""

from __future__ import annotations

import numpy as np
import pytest

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.points import Machine
from cmm_uq.jobs.columns import COORDINATES
from cmm_uq.jobs.importing.format import ImportKeys
from cmm_uq.jobs.importing.recording import ImportedTable, UnplacedError, example, imported
from cmm_uq.jobs.recording.own import points_of
from tests.jobs.importing import laboratory, unseen
from tests.jobs.importing.laboratory import Export, text

EVERY = {**laboratory.EXPORTS, **unseen.EXPORTS}


def read(content: bytes | str, name: str = "a.csv", **keys: object) -> ImportedTable:
    raw = content.encode() if isinstance(content, str) else content
    return imported(raw, name, ImportKeys.model_validate(keys))


def answered(export: Export, name: str) -> ImportedTable:
    """Read at the first try, but for where its lines lie: line i along the diagonal of x and y, from z = 100 i."""
    if not export.lengths:
        return read(export.content, name)
    with pytest.raises(UnplacedError, match=r"nothing says where lines? "):
        read(export.content, name)
    names = dict.fromkeys(line for line, *_ in export.lengths)
    return read(
        export.content, name, lines={one: f"from 0,0,{100 * i} to 3,4,{100 * i}" for i, one in enumerate(names)}
    )


@pytest.mark.parametrize("name", EVERY)
def test_an_export_is_read_as_it_was_written(name: str) -> None:
    file, made = EVERY[name]
    export = made()
    table = answered(export, file)
    points = points_of(table.columns, table.lines.tolist(), file, Machine())
    if export.points:
        numbers = zip(points.measurement.tolist(), points.point.tolist(), map(tuple, points.xyz.tolist()), strict=True)
        assert list(numbers) == list(export.points)
        return
    names = list(dict.fromkeys(line for line, *_ in export.lengths))
    first, second = points.xyz[points.point == 1], points.xyz[points.point == 2]
    rows = points.point == 2
    reference = points.columns.get("reference_mm", np.zeros(len(points)))[rows]
    of = (names[round(z / 100)] for z in first[:, 2])
    found = sorted(zip(of, np.round(reference, 5).tolist(), points.repeat[rows].tolist(),
                       np.linalg.norm(second - first, axis=1).tolist(), strict=True))  # fmt: skip
    expected = sorted((line, round(nominal, 5), run, length) for line, nominal, run, length in export.lengths)
    assert [one[:3] for one in found] == [one[:3] for one in expected]
    assert [one[3] for one in found] == pytest.approx([one[3] for one in expected], abs=1e-7)
    assert (second - first) / np.linalg.norm(second - first, axis=1)[:, None] == pytest.approx(
        np.tile([0.6, 0.8, 0.0], (len(first), 1))
    )
    assert len({*zip(points.measurement.tolist(), points.repeat.tolist(), strict=True)}) == len(first)


LINE = {"lines": {"1": "along -Y from 10,20,30"}}


def test_a_line_is_said_by_its_start_and_an_axis_or_by_two_places() -> None:
    table = read("Nominal (mm);Measured (mm)\n100;100.002\n", **LINE)
    assert table.columns["y_mm"].tolist() == [20.0, 20 - 100.002]
    assert table.columns["reference_mm"].tolist() == [0.0, 100.0]
    with pytest.raises(CmmUqError, match="begins where it ends"):
        read("Nominal (mm);Measured (mm)\n100;100.002\n", lines={"1": "from 1,2,3 to 1,2,3"})
    with pytest.raises(ValueError, match="says no place of line 1"):
        read("", lines={"1": "somewhere"})
    with pytest.raises(CmmUqError, match="has no line 'upper'"):
        read("Nominal (mm);Measured (mm)\n100;100.002\n", lines={**LINE["lines"], "upper": "along X from 0,0,0"})


@pytest.mark.parametrize(("start", "end"), [("von", "nach"), ("van", "naar"), ("fra", "til"), ("from", "to")])
def test_a_title_that_says_start_and_end_places_its_line(start: str, end: str) -> None:
    titles = ((1, "X", "(50; 500; 300)", "(950; 500; 300)"), (2, "Y", "(450; 80; 300)", "(450; 1100; 300)"))
    rows = [row for i, axis, a, b in titles for row in (
        f"Lage {i}: parallel {axis} {start} {a} {end} {b} mm,,", "Nr.,Nominal [mm],Measured [mm]",
        *(f"{n},{100 * n + 300},{100 * n + 300}.00{n}" for n in range(1, 6)), "",
    )]  # fmt: skip
    table = read("\n".join(rows))
    assert [table.columns[name][:2].tolist() for name in COORDINATES] == [[50.0, 450.001], [500.0] * 2, [300.0] * 2]
    assert table.columns["y_mm"][10] == 80.0
    assert example(table) == "run 1: 400.0000 mm measured as 400.0010 mm, +1 µm"


def test_planned_places_of_both_balls_are_where_a_line_lies() -> None:
    heads = "Posição,Valor do padrão (mm),Medição,Esfera 1,,,Esfera 2,,,Comprimento medido (mm),Erro (µm)\n"
    heads += ",,,X nom. (mm),Y nom. (mm),Z nom. (mm),X nom. (mm),Y nom. (mm),Z nom. (mm),,\n"
    rows = "".join(
        f"{i},{of}.0127,{run},{place},{of}.01{10 + 3 * i + run},{(3 * i + run) / 10 - 1.7:.1f}\n"
        for i, (of, place) in enumerate((
            (400, "150,400,-400,550,400,-400"), (400, "400,150,-400,400,550,-400"), (400, "400,400,-620,400,400,-220"),
            (800, "100,420,-380,900,420,-380"), (800, "430,90,-380,430,890,-380"), (800, "160,140,-610,689,637,-273"),
        ), 1)
        for run in (1, 2, 3)
    )  # fmt: skip
    table = read(heads + rows)
    assert table.columns["x_mm"][::6].tolist() == [150.0, 400.0, 400.0, 100.0, 430.0, 160.0]
    assert table.columns["z_mm"][13] == pytest.approx(-219.99, abs=0.02)


def test_a_length_that_a_laser_measures_in_every_run_is_one_length() -> None:
    """Two blocks as near to each other, each with all runs, are two."""
    head, lengths = "Line,Run,Reference length (mm),Measured length (mm)\n", (200.0, 550.0, 900.0, 1250.0)
    rows = "".join(
        f"1,{run},{of + off:.4f},{of + off + 0.001 * run:.4f}\n"
        for of in lengths
        for run, off in ((1, -0.0127), (2, 0.0065), (3, -0.0066))
    )
    table = read(head + rows, lines={"1": "along X from 0,0,0"})
    assert table.columns["measurement"].tolist() == np.repeat([1, 2, 3, 4], 6).tolist()
    assert table.columns["repeat"].tolist() == np.tile([1, 1, 2, 2, 3, 3], 4).tolist()
    assert table.columns["reference_mm"][1:6:2].tolist() == [199.9873, 200.0065, 199.9934]
    blocks = "".join(
        f"1,{run},{of:.4f},{of + 0.001 * run:.4f}\n" for of in (200.0, 200.05, 550.0, 900.0) for run in (1, 2, 3)
    )
    table = read(head + blocks, lines={"1": "along X from 0,0,0"})
    assert len(np.unique(table.columns["measurement"])) == 4


@pytest.mark.parametrize(("table", "question"), [
    ("Line;Nominal;Measured\n1;100;100.002\n1;250;250.003\n", "may be in mm or in inch"),
    ("Line;Nominal (mm);Deviation\n1;100;2\n1;250;3\n", "nothing says the unit of 'Deviation': µm or mm"),
    ("Line;Nominal (mm);Run 1;Run 2\n1;100;2;1\n1;250;3;1\n", "'Run 1', 'Run 2' may be lengths, or deviations in µm or mm"),
    ("Line;Nominal (mm);Measured (mm)\n1;100;250.002\n", r"250\.002 mm is no measured length of 100 mm"),
    ("Line;Nominal (mm);Measured (mm);Deviation (µm)\n1;100;100.002;7\n", "is not measured minus reference: one of the"),
    ("Line;Nominal (mm);Measured (mm)\n1;100;100.001\n1;;250.002\n1;400;400.001\n", "no value"),
    ("Line;Nominal (mm);Measured (mm);Repeat;Mean\n;100;100.002;1;3\n", "no line is named"),
    ("Nominal (mm);Measured 1 (mm);Measured 2 (mm);Run\n100;100.002;100.001;1\n", "counts runs, and so do 2 columns"),
])  # fmt: skip
def test_what_could_be_read_two_ways_is_refused(table: str, question: str) -> None:
    with pytest.raises(CmmUqError, match=question):
        read(table, **LINE)


def test_deviations_beside_lengths_may_have_either_sign_and_are_a_check_alone() -> None:
    for sign in ("", "-"):
        table = read(f"Line;Nominal (mm);Measured (mm);Deviation (µm)\n1;100;100.002;{sign}2.0\n", **LINE)
        assert table.columns["y_mm"].tolist() == [20.0, 20 - 100.002]


def test_a_correction_of_the_columns_is_followed() -> None:
    """What the messages above say to write, by name, by number, with two columns of one name."""
    table = "Line;Nominal (mm);Run 1;Run 2\n1;100;2;1\n1;250;3;1\n"
    um = read(table, columns={"deviation_um": ["Run 1", "Run 2"]}, lines={"1": "along X from 0,0,0"})
    mm = read(
        table,
        columns={"nominal_mm": 2, "line": 1, "deviation_mm": [3, 4]},
        unit="mm",
        lines={"1": "along X from 0,0,0"},
    )
    assert um.columns["x_mm"][1::2].tolist() == pytest.approx([100.002, 100.001, 250.003, 250.001])
    assert mm.columns["x_mm"][1::2].tolist() == pytest.approx([102.0, 101.0, 253.0, 251.0])


def test_every_row_and_column_that_is_left_out_is_named_with_why() -> None:
    rows = [["Line", "Nominal (mm)", "Run 1 (mm)", "Run 2 (mm)", "MPE"], [1, 100, "100.001", "", 3],
            ["Mean", "", "100.0", "", ""],
            ["soaked anew"], [1, 250, "250.001", "250.002", 3]]  # fmt: skip
    table = read(text(rows, ";"), **LINE)
    facts = table.recognised.data
    assert (
        facts["left_out"]
        == "line 3: 'Mean 100.0', a summary; line 4: 'soaked anew', a remark; line 2, column Run 2 (mm): nothing in the cell"
    )
    assert facts["not_used"] == "Line, MPE"  # there is one line alone
    assert len(table.lines) == 6


def test_a_reading_is_shown_by_an_example_in_words() -> None:
    file, made = laboratory.EXPORTS["deviations_with_units_row"]
    with pytest.raises(UnplacedError) as raised:
        read(made().content, file)
    assert example(raised.value.lengths) == "line Position 1, run 1: 100.0000 mm measured as 99.9980 mm, -2 µm"
    points = read("Measurement;Point;X [mm];Y [mm];Z [mm]\n1;1;120.00123;0;1\n")
    assert example(points) == "measurement 1, point 1, x 120.0012 mm, y 0.0000 mm, z 1.0000 mm"


RUNS_OF_THREE = """Verification record;;;
Line {n};;;
Nominal mm;Run 1 mm;Run 2 mm;Run 3 mm
1{sign}0{zeros};1{sign}0{zeros};1{sign}2{zeros};1{sign}1{zeros}
2{sign}0{zeros};2{sign}1{zeros};2{sign}3{zeros};2{sign}2{zeros}
3{sign}0{zeros};3{sign}2{zeros};3{sign}0{zeros};3{sign}1{zeros}
"""


def test_the_third_run_is_no_mean_of_the_first_two_though_its_last_digit_would_let_it_be() -> None:
    content = "".join(RUNS_OF_THREE.format(n=n, sign=".", zeros="") for n in (1, 2)).replace(".", ".00")
    with pytest.raises(UnplacedError) as asked:
        read(content)
    assert [sorted({*one.repeat}) for one in asked.value.lengths] == [[1, 2, 3]]
    assert sum(len(one.measured) for one in asked.value.lengths) == 18


def test_thousands_or_thousandths_are_asked_where_no_figure_tells() -> None:
    content = "".join(RUNS_OF_THREE.format(n=n, sign=",", zeros="00") for n in (1, 2))
    with pytest.raises(CmmUqError, match=r"can be 1000 or 1\.000") as refused:
        read(content)
    assert 'decimal = ","' in (refused.value.fix or "")
    with pytest.raises(UnplacedError):
        read(content.replace("3,200", "3,2000"))
