"""A recording's cells are checked where they stand."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, strategies as st

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.points import Machine, Points
from cmm_uq.jobs.columns import largest
from cmm_uq.jobs.recording.own import read_recording

HEADER = "measurement,point,x_mm,y_mm,z_mm"


def read(text: str) -> Points:
    return read_recording(text.encode(), "bar.csv", Machine())


def test_points_carry_their_lines_groups_and_covariates() -> None:
    points = read(f"{HEADER},repeat,mood\n# a comment\n3,1,1,2,3,1,7\n\n3,2,4,5,6,1,8\n3,1,1,2,3,2,9\n")
    assert points.lines.tolist() == [3, 5, 6]
    assert points.group.tolist() == [0, 0, 1]
    assert points.column("mood").tolist() == [7, 8, 9]


def test_a_byte_order_mark_and_windows_lines_do_no_harm() -> None:
    assert read("\ufeff" + f"{HEADER}\r\n1,1,1,2,3\r\n").xyz.tolist() == [[1, 2, 3]]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "has no rows"),
        (HEADER, "has no rows"),
        ("measurement,point,x_mm,y_mm\n1,1,2,3", r"bar.csv line 1: no column 'z_mm'"),
        ("measurement,point,x_mm,y_mm,z_um\n1,1,2,3,4", r"the column 'z_um' is not in the unit of 'z_mm'"),
        ("measurement,point,x_mm,y_mm,z_mm,temp_x_k\n1,1,2,3,4,293", r"'temp_x_k' is not in the unit of 'temp_x_c'"),
        ("measurement,point,x,y,z\n1,1,2,3,4", r"'x' is not in the unit of 'x_mm'"),
        *(
            (
                f"measurement,point,x_mm,y_mm,z_mm,{name}\n1,1,2,3,4,20",
                rf"'{name}' is nearly '{meant}' and would not be used",
            )
            for name, meant in (
                ("temp_artifact_c", "temp_artefact_c"),
                ("temp_arefact_c", "temp_artefact_c"),
                ("temp_X_c", "temp_x_c"),
                ("temperature_x_c", "temp_x_c"),
                ("Repeat", "repeat"),
            )
        ),
        (f"{HEADER},x_mm\n1,1,1,2,3,4", r"the column 'x_mm' is there twice"),
        (f"{HEADER},\n1,1,1,2,3,4", r"column 6 has no name"),
        (f"{HEADER}\n1,1,1,2,3\n1,2,1,2", r"line 3: has 4 cells where the header has 5"),
        (f"{HEADER}\n1,1,1,two,3", r"line 2, column y_mm: 'two' is not a number"),
        (f'{HEADER}\n1,1,1,"2,5",3', r"column y_mm: '2,5' is not a number. Write decimals with a point"),
        (f"{HEADER}\n1,1,1,,3", r"column y_mm: no value. Measure the point again, or leave out its measurement"),
        (f"{HEADER}\n1,,1,2,3", r"column point: no value. Give a number$"),
        (f"{HEADER},temp_x_c\n1,1,1,2,3,", r"column temp_x_c: no value. Give a number, or remove the column$"),
        (f"{HEADER}\n1,1,1,NaN,3", r"column y_mm: 'NaN' is not a finite number"),
        (f"{HEADER}\n1,1,1,-inf,3", r"column y_mm: '-inf' is not a finite number"),
        (f"{HEADER}\n1.5,1,1,2,3", r"column measurement: 1.5 is not a whole number"),
        (f"{HEADER}\n1,1,1,2,3\n1,1,4,5,6", r"lines 2 and 3: measurement 1, point 1, repeat 1 is there twice"),
        (f"{HEADER},approach_x\n1,1,1,2,3,0.5", r"0.5 is no direction"),
        (HEADER.replace(",", ";") + "\n1;1;1;2;3", r"cells are separated by semicolons"),
        (f"{HEADER}\n1,1,1,2,\0", r"no text file"),
        (f"{HEADER}\n1,1,-2_11.1357,2,3", r"line 2, column x_mm: '-2_11.1357' is not a number"),
        (f"{HEADER}\n1,1,١٢,2,3", r"column x_mm: '١٢' is not a number"),
        (f"{HEADER}\n1,1,1e300,2,3", r"column x_mm: '1e300' is too large"),
        (f"{HEADER}\n1,1,1.1e7,2,3", r"line 2, column x_mm: 1.1e\+07 is more than anything that is measured"),
        (f"{HEADER},temp_x_c\n1,1,1,2,3,1.1e5", r"column temp_x_c: 110000 is more than"),
        (f"{HEADER},mood\n1,1,1,2,3,1e-300", r"column mood: '1e-300' is too small"),
        (
            f"{HEADER},nx,ny,nz\n1,1,1,2,3,0,0,1\n1,2,1,2,3,-1e14,0,0",
            r"line 3: the normal nx, ny, nz has the length 1e\+14",
        ),
        (f"{HEADER},nx,ny,nz\n1,1,1,2,3,1e-9,0,0", r"the normal nx, ny, nz has the length 1e-09"),
        (f'{HEADER},"=HYPERLINK(""x"")"\n1,1,1,2,3,4', r"line 1: the column '=HYPERLINK\(\"x\"\)' begins as a formula"),
        (f"{HEADER},a\x1bb\n1,1,1,2,3,4", r"has a control character in its name"),
        (f"{HEADER}\n1,1,1,2,{'3' * 140_000}", r"line 2: the line has 140008 characters"),
    ],
)
def test_a_spoiled_recording_is_refused_with_its_place(text: str, message: str) -> None:
    with pytest.raises(CmmUqError, match=message):
        read(text)


def test_bytes_that_are_no_text_are_refused_with_their_line() -> None:
    with pytest.raises(CmmUqError, match="line 2: is not UTF-8"):
        read_recording(f"{HEADER}\n".encode() + b"1,1,\xff,2,3\n", "bar.csv", Machine())


@given(st.text(max_size=300))
def test_no_text_leads_to_anything_but_points_or_a_clear_error(text: str) -> None:
    try:
        points = read(f"{HEADER}\n{text}")
    except CmmUqError:
        return
    except UnicodeEncodeError:
        return
    assert np.all(np.isfinite(points.xyz))


def test_normals_of_another_length_and_directions_without_one_are_kept() -> None:
    points = read(f"{HEADER},nx,ny,nz\n1,1,1,2,3,0,0,577\n1,2,1,2,3,0,0,0\n")
    assert points.column("nz").tolist() == [577, 0]


@pytest.mark.parametrize(("column", "most"), [("x_mm", 1e7), ("temp_x_c", 1e5), ("mood", 1e15), ("measurement", 1e9)])
def test_the_largest_number_of_a_column_goes_by_its_unit(column: str, most: float) -> None:
    assert largest(column) == most
