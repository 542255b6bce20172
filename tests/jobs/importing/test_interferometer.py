"""Runs in Renishaw's form: what three public programs read of it comes out; what is damaged is refused with its line."""

from __future__ import annotations

import numpy as np
import pytest

from cmm_uq.app.commands.jobs.exchange import lines_asked
from cmm_uq.base.errors import CmmUqError
from cmm_uq.jobs.importing.format import ImportKeys
from cmm_uq.jobs.importing.lines import axis_place
from cmm_uq.jobs.importing.recording import ImportedTable, imported

TARGETS = [0.0, 100.0, 200.0, 300.0, 400.0, 500.0]
THERE, BACK = [0.0, 1.1, 2.2, 3.1, 3.9, 5.2], [-1.0, 0.1, 1.2, 2.0, 2.9, 4.1]
KEYS = ImportKeys(lines={"X": "along X from 0,200,-300"})


def written(*, owner: str = "Linear", count: int = 6, runs: int = 2, back: bool = True) -> str:
    """As LaserXL writes it: five targets a line; run, target, deviation; the way back in the order it was measured."""
    there = [f" 1 {i} {value:.3f}" for i, value in enumerate(THERE, 1)]
    second = [f" 2 {i} {value:.3f}" for i, value in enumerate(BACK, 1)]
    return "\r\n".join([
        "HEADER::", "File type  : rtl", f"Owner      : {owner}", "Version no : V20.02.02", "", "TARGET DATA::",
        "Filetype  : ISO", f"Target-count: {count}", "Targets :", "0.000 100.000 200.000 300.000 400.000 ", "500.000 ",
        "Flags:", "", "USER-TEXT::", "Machine: Bridge", "Serial No: 12", "Date: 10:12 2026-01-02", "Axis: X", "RUNS::",
        f"Run-count: {runs}", "", "DEVIATIONS::", "Run Target Data:", *there, *(second[::-1] if back else second),
        "EQUIPMENT::", "ENVIRONMENT::", "EOF::", "",
    ])  # fmt: skip


def read(text: str, keys: ImportKeys = KEYS) -> ImportedTable:
    return imported(text.encode(), "x.rtl", keys)


def test_targets_lie_on_the_line_and_deviations_are_the_readings() -> None:
    columns = read(written()).columns
    np.testing.assert_array_equal(columns["x_mm"], [*TARGETS, *TARGETS[::-1]])
    assert set(columns["y_mm"]) == {200.0}
    assert set(columns["z_mm"]) == {-300.0}
    np.testing.assert_array_equal(columns["reading_um"], [*THERE, *BACK[::-1]])
    np.testing.assert_array_equal(columns["approach_x"], [1.0] * 6 + [-1.0] * 6)
    np.testing.assert_array_equal(columns["repeat"], [1.0] * 12)
    np.testing.assert_array_equal(columns["point"], np.arange(1, 13))
    assert set(columns["read_x"]) == {1.0}


def test_a_line_against_the_axis_turns_places_readings_and_directions() -> None:
    columns = read(written(), ImportKeys(lines={"X": "along -X from 900,200,-300"})).columns
    np.testing.assert_array_equal(columns["x_mm"][:6], 900.0 - np.array(TARGETS))
    assert (columns["read_x"][0], columns["approach_x"][0], columns["approach_x"][-1]) == (-1.0, -1.0, 1.0)


def test_runs_all_listed_in_one_order_have_no_direction() -> None:
    """Whether the second of two runs went back cannot be told from such a file."""
    columns = read(written(back=False)).columns
    assert set(columns["approach_x"]) == {0.0}
    np.testing.assert_array_equal(columns["repeat"], [1.0] * 6 + [2.0] * 6)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (written(owner="Angular"), "kind 'Angular', whose unit no public text says"),
        (written(count=7), r"has 6 of 7 \(target-count\)"),
        (written(runs=3), r"has 2 of 3 \(run-count\)"),
        (written().replace(" 1 3 2.200\r\n", ""), "line 24: run 1 has not each target once"),
        (written().replace(" 1 3 2.200", " 1 9 2.200"), "line 26: is no run, target and deviation"),
        (written().replace(" 1 3 2.200", " 1 3 two"), "line 26: ' *1 3 two' holds no figures"),
        (written().split("DEVIATIONS::")[0], r"has 0 of 2 \(run-count\)"),
        (written().replace(" 1 3 2.200", " 1 3 2_200"), "line 26: ' *1 3 2_200' holds no figures"),
        (written().replace(" 1 3 2.200", " 1 3 １２"), "line 26: ' *1 3 １２' holds no figures"),
        (written().replace(" 1 3 2.200", " 1 3 nan"), "line 26: ' *1 3 nan' holds no figures"),
        (written().replace("500.000 \r", "5_00.000 \r"), "line 11: '5_00.000' holds no figures"),
        (written(back=False).partition("4.100\r")[0] + "4.1", "line 35: ends within a figure: the file was cut off"),
    ],
)
def test_a_damaged_file_is_refused_with_its_place(text: str, said: str) -> None:
    with pytest.raises(CmmUqError, match=said):
        read(text)


def test_where_the_axis_lies_is_asked_for() -> None:
    with pytest.raises(CmmUqError, match="nothing says where line 'X' lies") as error:
        read(written(), ImportKeys())
    assert "along X from 0,200,300" in error.value.fix
    asked = {"X": ("along X from 0,?,?", "along X from 0,200,300", "")}
    assert lines_asked(error.value) == (None, "axis X, run 1: 0 mm, +0 µm", asked)
    assert axis_place("Z")[1] == "along Z from 100,200,0"


def test_a_file_of_the_maker_says_its_kind_by_its_type_else_by_its_owner() -> None:
    assert len(read(written(owner="Renishaw")).lines) == len(read(written()).lines)
    for other in (written(owner="Angular"), written(owner="Renishaw").replace(": rtl", ": rta")):
        with pytest.raises(CmmUqError, match="whose unit no public text says"):
            read(other)
