"""Runs of lasers beside other errors of an axis, and along diagonals; heads and levels that are not passed over."""

from __future__ import annotations

import io

import numpy as np
import pytest
from openpyxl import Workbook

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.messages import Verbatim
from cmm_uq.jobs.importing.format import Fact, ImportKeys, NotReadError, Recognition
from cmm_uq.jobs.importing.recording import ImportedTable, imported

TARGETS = [100.0 * k for k in range(6)]


def read(lines: list[str]) -> ImportedTable:
    return imported("\n".join(lines).encode(), "a.csv", ImportKeys())


def fact(table: ImportedTable, key: str) -> str:
    return next(str.__str__(one.value) for one in table.recognised.facts if one.key == key)


def linear(target: float, run: int, way: int) -> float:
    return round(0.01 * target + 0.3 * run + 0.7 * (way < 0), 2)


def test_of_six_components_the_linear_one_is_read_and_the_others_are_named() -> None:
    head = "Run;Direction;Target (mm);Linear (µm);Straightness V (µm);Straightness H (µm);Pitch (arcsec);Yaw (arcsec)"
    rows = [
        f"{run};{'+' if way > 0 else '-'};{t};{linear(t, run, way)};0.31;-0.2{k};1.{k};-0.4{k}"
        for run in (1, 2)
        for way in (1, -1)
        for k, t in enumerate(TARGETS[::way])
    ]
    table = read(["Start position;X0 Y-200 Z-300", "Test;X axis", "", head, *rows])
    expected = [linear(t, run, way) for run in (1, 2) for way in (1, -1) for t in TARGETS[::way]]
    np.testing.assert_allclose(table.columns["reading_um"], expected)
    assert {*table.columns["y_mm"], *table.columns["z_mm"]} == {-200.0, -300.0}
    unused = ("Straightness V (µm)", "Straightness H (µm)", "Pitch (arcsec)", "Yaw (arcsec)")
    assert table.recognised.unused == unused


def test_a_table_of_angles_below_one_of_positions_is_left_out_by_name() -> None:
    head = "Target (mm);Run 1 +;Run 1 -;Run 2 +;Run 2 -"
    ways = [(run, way) for run in (1, 2) for way in (1, -1)]
    rows = [";".join(f"{v}" for v in (t, *(linear(t, run, way) for run, way in ways))) for t in TARGETS]
    angles = [f"{t};1.52;-0.31;0.44;2.01" for t in TARGETS]
    table = read(["X axis, Y = -200, Z = -150", "Linear (µm)", head, *rows, "", "Pitch (arcsec)", head, *angles])
    assert len(table.lines) == 4 * len(TARGETS)
    assert {*table.columns["repeat"]} == {1.0, 2.0}
    assert fact(table, "left_out").count("angles") == len(TARGETS)


def test_diagonals_are_lines_of_their_own_from_their_start() -> None:
    ends = {"PPP": ("(0, 0, -400)", "(800, 600, 0)"), "NPP": ("(800, 0, -400)", "(0, 600, 0)")}
    rows = ["Deviations in µm"]
    for name, (start, end) in ends.items():
        rows += [f"Body diagonal {name}: from {start} to {end}", "Target (mm);1 fwd;1 rev;2 fwd;2 rev"]
        rows += [f"{2 * t};{linear(t, 1, 1)};{linear(t, 1, -1)};{linear(t, 2, 1)};{linear(t, 2, -1)}" for t in TARGETS]
    columns = read(rows).columns
    assert {*columns["measurement"]} == {1.0, 2.0}
    second = columns["measurement"] == 2
    way = np.array([-800, 600, 400]) / np.sqrt(800**2 + 600**2 + 400**2)
    place = np.column_stack([columns[f"{axis}_mm"][second] for axis in "xyz"])
    read_along = np.column_stack([columns[f"read_{axis}"][second] for axis in "xyz"])
    np.testing.assert_allclose(read_along, np.tile(way, (len(place), 1)), atol=1e-9)
    targets = [2 * t for t in TARGETS]
    np.testing.assert_allclose(np.unique(np.round((place - [800, 0, -400]) @ way, 5)), targets)


def test_a_column_of_one_coordinate_says_where_lines_lie() -> None:
    rows = [f"{z if k == 0 else ''};{n};{n + 0.0012:.4f}" for z in (-300, -500) for k, n in enumerate((100, 200, 300))]
    table = read(["Stufenendmaß parallel zu X, Y=400, Start X=100", "Z [mm];Nennmaß;Messwert", *rows])
    assert {*table.columns["z_mm"]} == {-300.0, -500.0}
    assert {*table.columns["y_mm"]} == {400.0}


def test_a_head_that_comes_again_is_told() -> None:
    page = ["E0 test", "Line\tX\tY\tZ", "\tmm\tmm\tmm"]
    rows = [[f"{line}\t{100 * line}.0012\t{y}.0023\t-5.0{line}13" for y in (50, 450)] for line in (1, 2)]
    table = read([*page, *rows[0], *page, *rows[1]])
    assert "'Line X Y Z', a head again" in fact(table, "left_out")


def test_a_heading_with_commas_is_one() -> None:
    unused = Fact("not_used", Verbatim(""), Verbatim("U, k = 2, T"), ("U, k = 2", "T"))
    assert Recognition("a", "text", Verbatim(""), (unused,), {}, 0).unused == ("U, k = 2", "T")


def test_a_direction_of_approach_is_no_line() -> None:
    rows = [f"1;{way};{t};{linear(t, 1, 1 if way == '+' else -1)}" for way in "+-" for t in TARGETS]
    table = read(["Run;Direction;Target mm;Deviation um", *rows, "axis X, Y = 100, Z = -50"])
    assert {*table.columns["measurement"]} == {1.0}
    assert {*table.columns["approach_x"]} == {1.0, -1.0}


@pytest.mark.parametrize(
    ("title", "across"),
    [("Straightness vertical", "z"), ("Straightness horizontal", "x"), ("Geradheit Y, Abweichung in Z", "z"),
     ("Rectitude EXY", "x"), ("真直度 (X)", "x"), ("Straightness", "")],
)  # fmt: skip
def test_straightness_lies_across_its_axis(title: str, across: str) -> None:
    rows = [
        f"{t:.3f};" + ";".join(f"{(7 * k + 3 * run * run) % 11 / 10:.2f}" for run in range(4))
        for k, t in enumerate(TARGETS)
    ]
    lines = [f"Test title;{title}", "Axis;Y", "Error units;micrometres",
             "Target;Run 1 (+);Run 1 (-);Run 2 (+);Run 2 (-)", *rows]  # fmt: skip
    if not across:
        with pytest.raises(CmmUqError, match="along which axis they lie"):
            read(lines)
        return
    found = imported("\n".join(lines).encode(), "a.csv", ImportKeys(lines={"Y": "along Y from 100,0,300"})).columns
    assert {name for name in "xyz" if found[f"read_{name}"].any()} == {across}
    assert {*found[f"read_{across}"].tolist()} == {1.0}
    assert found["reading_um"][:2].tolist() == [0.0, 0.7]
    assert {*found["approach_y"].tolist()} == {1.0, -1.0}


def test_deviations_are_known_by_their_mean_whatever_they_are_called() -> None:
    series = [[round(0.1 * k + 0.37 * s * (-1) ** s, 2) for s in range(4)] for k in range(5)]
    rows = [
        f"{k + 1};{100 * k + 40}.00{k}21;{';'.join(map(str, own))};{sum(own) / 4:.2f}" for k, own in enumerate(series)
    ]
    head = "ST;KALIBRIERWERT;H1;R1;H2;R2;MITTEL"
    table = read(["Abweichungen in UM, Laengen in MM, from (0, 0, 0) to (500, 0, 0)", head, *rows])
    x = table.columns["x_mm"].reshape(-1, 2)[:, 1] - table.columns["reference_mm"].reshape(-1, 2)[:, 1]
    np.testing.assert_allclose(np.sort(1000 * x), np.sort(np.ravel(series)), atol=1e-6)


def test_hidden_rows_of_a_workbook_are_left_out_by_name() -> None:
    book = Workbook()
    book.active.append(["Line", "Nominal (mm)", "Measured (mm)"])
    for line, nominal, off in ((1, 100, 0.0012), (1, 200, 0.0181), (1, 200, 0.0013), (1, 300, -0.0004)):
        book.active.append([line, nominal, nominal + off])
    book.active.row_dimensions[3].hidden = True
    out = io.BytesIO()
    book.save(out)
    keys = ImportKeys.model_validate({"lines": {"Sheet": "along X from 0,0,0"}})
    table = imported(out.getvalue(), "a.xlsx", keys)
    assert sorted({*table.columns["reference_mm"]}) == [0.0, 100.0, 200.0, 300.0]
    assert len(table.lines) == 6
    assert "hidden" in fact(table, "left_out")


def test_errors_in_parts_of_a_length_are_no_lengths() -> None:
    rows = [f"{axis};{n};{n / 7:.2f};{n / 9 - 1:.2f}" for axis in "XYZ" for n in (1, 2, 3, 4)]
    with pytest.raises(NotReadError):
        read(["axis;nominal length/m;relative error/ppm run 1;relative error/ppm run 2", *rows])
