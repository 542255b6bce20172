from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.units import ARCSECOND
from cmm_uq.machine.physics.error_map import error_map_text, parse_error_map_text, read_error_map, read_error_map_text

HARRIS = Path(__file__).parent / "harris2004"


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
