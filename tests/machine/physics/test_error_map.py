"""Error maps as CSV and as a contractor's text (Harris 2004 appendix B)."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.points import Machine
from cmm_uq.base.units import ARCSECOND
from cmm_uq.machine.physics.error_map import (
    COLUMNS,
    ErrorMap,
    error_map_text,
    parse_error_map,
    parse_error_map_text,
    read_error_map,
    read_error_map_text,
    write_error_map,
)

HARRIS = Path(__file__).parent / "harris2004"
HEADER = "axis,position_mm," + ",".join(COLUMNS)


def content(*rows: str, header: str = HEADER) -> bytes:
    return "\n".join([header, *rows]).encode()


def axis(name: str, *rows: str) -> list[str]:
    return [f"{name},{row}" for row in rows or ("0,0,0,0,0,0,0", "100,1,2,3,4,5,6")]


def good() -> list[str]:
    return axis("x") + axis("y") + axis("z")


def test_files_are_in_micrometres_and_arc_seconds_and_arrays_in_mm_and_rad():
    error_map = parse_error_map(content(*good()), "map.csv", temperature=22.0)
    np.testing.assert_allclose(error_map.axes[0].errors[1, :3], [1e-3, 2e-3, 3e-3], rtol=1e-14)
    np.testing.assert_allclose(error_map.axes[0].errors[1, 3:], np.array([4, 5, 6]) * ARCSECOND, rtol=1e-14)
    assert error_map.axes[2].span == (0.0, 100.0)
    assert error_map.temperature == 22.0


@pytest.mark.parametrize("temperature", [20, 22, 25, 30])
def test_the_published_maps_are_read_and_written_without_change(temperature, tmp_path):
    error_map = read_error_map(HARRIS / f"error_map_{temperature}C.csv", temperature=temperature)
    assert [len(c.positions) for c in error_map.axes] == [37, 23, 21]
    write_error_map(error_map, tmp_path / "again.csv")
    again = read_error_map(tmp_path / "again.csv", temperature=temperature)
    for before, after in zip(error_map.axes, again.axes, strict=True):
        np.testing.assert_array_equal(before.positions, after.positions)
        np.testing.assert_allclose(before.errors, after.errors, rtol=1e-12)


def test_half_a_metre_along_x_the_published_machine_has_the_errors_of_table_8():
    x = read_error_map(HARRIS / "error_map_20C.csv").axes[0]
    assert x.errors[x.positions == 500.0, 0] == pytest.approx(48.3e-3)
    assert x.errors[x.positions == 500.0, 4] == pytest.approx(6.93 * ARCSECOND)


def test_squareness_comes_beside_the_map():
    error_map = parse_error_map(content(*good()), "map.csv").with_squareness_arcsec(-173, -19, 21)
    np.testing.assert_allclose(error_map.squareness / ARCSECOND, [-173, -19, 21], rtol=1e-14)


@pytest.mark.parametrize(
    ("rows", "message"),
    [
        (
            axis("x", "0,0,0,0,0,0,0", "50,1,0,0,0,0,0", "25,1,0,0,0,0,0"),
            r"line 4: axis x: position 25 mm comes after 50 mm",
        ),
        (
            axis("x", "0,0,0,0,0,0,0", "25,1,0,0,0,0,0", "25,2,0,0,0,0,0"),
            r"line 4: axis x: position 25 mm is there twice",
        ),
        (axis("x", "0,0,0,0,0,0,0"), "axis x has 1 positions"),
        (axis("x", "0,0,0,0,0,0,0", "25,1,,0,0,0,0"), r"line 3: dy_um = '' is no number"),
        (axis("x", "0,0,0,0,0,0,0", "25,1,nan,0,0,0,0"), r"line 3: dy_um = 'nan' is no number"),
        (axis("x", "0,0,0,0,0,0,0", "25,1,0"), r"line 3: has 4 cells where the header has 8"),
        (axis("w"), r"line 2: axis 'w'"),
    ],
)
def test_what_is_wrong_is_named_with_its_line(rows, message):
    with pytest.raises(CmmUqError, match=rf"map\.csv:? ?{message}" if message.startswith("axis") else message):
        parse_error_map(content(*rows, *axis("y"), *axis("z")), "map.csv")


def test_a_missing_axis_or_column_is_named():
    with pytest.raises(CmmUqError, match="axis z has 0 positions"):
        parse_error_map(content(*axis("x"), *axis("y")), "map.csv")
    with pytest.raises(CmmUqError, match="column rz_arcsec is missing"):
        parse_error_map(content("x,0,0,0,0,0,0", header=HEADER.removesuffix(",rz_arcsec")), "map.csv")
    with pytest.raises(CmmUqError, match="unknown column 'dx_nm'"):
        parse_error_map(content(*(f"{row},0" for row in good()), header=HEADER + ",dx_nm"), "map.csv")
    with pytest.raises(CmmUqError, match="column dx_um is there twice"):
        parse_error_map(content(*(f"{row},0" for row in good()), header=HEADER + ",dx_um"), "map.csv")
    with pytest.raises(CmmUqError, match="has no rows"):
        parse_error_map(content(), "map.csv")


def converted(error_map: ErrorMap, displacement: float, rotation: float, position: float = 1.0) -> bytes:
    """The map as someone would write it who used other units."""
    rows = []
    for name, carriage in zip("xyz", error_map.axes, strict=True):
        for p, e in zip(carriage.positions, carriage.errors, strict=True):
            values = [*(e[:3] * 1e3 * displacement), *(e[3:] / ARCSECOND * rotation)]
            rows.append(f"{name},{p * position:.9g}," + ",".join(f"{v:.9g}" for v in values))
    return content(*rows)


@pytest.mark.parametrize(
    ("displacement", "rotation", "message"),
    [
        (1e-3, 1.0, "seems to be in mm, 1000 times off"),
        (1e3, 1.0, "the map is not in µm"),
        (1.0, ARCSECOND, "seems to be in rad"),
        (1.0, 1e3, "the map is not in arc seconds"),
    ],
)
def test_a_map_in_other_units_is_recognised(displacement, rotation, message):
    wrong = converted(read_error_map(HARRIS / "error_map_20C.csv"), displacement, rotation)
    with pytest.raises(CmmUqError, match=message):
        parse_error_map(wrong, "map.csv")
    assert parse_error_map(wrong, "map.csv", units_checked=False).axes[0].errors.any()


def test_a_map_without_any_error_has_no_wrong_units():
    rows = [f"{name},{position},0,0,0,0,0,0" for name in "xyz" for position in (0, 100)]
    assert not parse_error_map(content(*rows), "map.csv").axes[0].errors.any()


TRAVEL = np.array([[0.0, 900], [0, 550], [-500, 0]])


def test_a_map_must_cover_the_travel():
    error_map = read_error_map(HARRIS / "error_map_20C.csv")
    error_map.covers(Machine(travel_mm=TRAVEL))
    with pytest.raises(CmmUqError, match="axis y is mapped from 0 to 550 mm, the travel is 0 to 600 mm"):
        error_map.covers(Machine(travel_mm=TRAVEL + np.array([[0, 0], [0, 50], [0, 0]])))
    error_map.covers(Machine())  # travel not known


def test_positions_in_metres_are_recognised_by_the_travel():
    metres = parse_error_map(converted(read_error_map(HARRIS / "error_map_20C.csv"), 1.0, 1.0, 1e-3), "map.csv")
    with pytest.raises(CmmUqError, match="positions seem to be in m"):
        metres.covers(Machine(travel_mm=TRAVEL))


def test_a_file_that_is_not_there_is_said_to_be_so(tmp_path):
    with pytest.raises(CmmUqError, match="no such file"):
        read_error_map(tmp_path / "none.csv")


def test_the_scan_of_appendix_b_reads_as_its_transcription():
    scanned = read_error_map_text(HARRIS / "appendix_b.txt", temperature=22.0)
    transcribed = read_error_map(HARRIS / "error_map_22C.csv", temperature=22.0)
    for one, other in zip(scanned.axes, transcribed.axes, strict=True):
        np.testing.assert_array_equal(one.positions, other.positions)
        np.testing.assert_array_equal(one.errors, other.errors)


def test_its_squareness_is_turned_to_the_sign_of_table_7():
    # printed 169.397, 33.979, −25.984; table 7 gives −173, −19, 21 for the same machine at 20 °C
    squareness = read_error_map_text(HARRIS / "appendix_b.txt").squareness / ARCSECOND
    np.testing.assert_allclose(squareness, [-169.397, -33.979, 25.984], rtol=1e-12)


def test_what_is_written_is_read_again():
    error_map = read_error_map_text(HARRIS / "appendix_b.txt")
    again = parse_error_map_text(error_map_text(error_map).encode(), "again")
    np.testing.assert_allclose(again.squareness, error_map.squareness, rtol=1e-11)
    for one, other in zip(again.axes, error_map.axes, strict=True):
        np.testing.assert_allclose(one.errors, other.errors, rtol=1e-11)


def spoiled(old: str, new: str) -> bytes:
    text = (HARRIS / "appendix_b.txt").read_text(encoding="utf-8")
    assert old in text
    return text.replace(old, new, 1).encode()


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("YZ: 33.979", "", "the squareness YZ is missing"),
        ("YZ: 33.979", "YZ: unknown", "'unknown' is not a number"),
        ("875\t12.00", "850\t12.00", "position 850 mm is there twice"),
        ("875\t12.00", "75\t12.00", "position 75 mm is there twice"),
        ("875\t12.00", "812\t12.00", "position 812 mm comes after 850 mm"),
        ("875\t12.00", "875\t12.OO", "line .*is not 7 numbers"),
        ("Map Data: Z Axis", "Map Data", "are no heading of axis y"),
        ("X\tX\tY\tZ\tY\tZ\tx", "X\tY\tY\tZ\tY\tZ\tx", "no heading of axis x"),
    ],
)
def test_what_is_wrong_is_named(old, new, message):
    with pytest.raises(CmmUqError, match=message):
        parse_error_map_text(spoiled(old, new), "errors_1102.txt")


def test_a_file_of_something_else_has_no_tables():
    with pytest.raises(CmmUqError, match="no table of axis x"):
        parse_error_map_text(b"measurement,point,x_mm\n1,1,2.0\n", "ballbar.csv")
