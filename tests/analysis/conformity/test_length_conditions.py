"""What a small plan of two lines, two lengths and two repeats says of lengths laid out by hand."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

from cmm_uq.analysis.conformity.plan_conditions import lengths_measured, nominals, with_offset
from cmm_uq.analysis.conformity.plans import FACE_DIAGONALS, PARALLELS, LengthPlan
from cmm_uq.artefacts import artefact_facts
from cmm_uq.artefacts.ballbar import Ballbar
from cmm_uq.artefacts.gauge_lines import StepGauge
from cmm_uq.base.points import Machine
from tests.analysis.conformity.recorded import MACHINE, bars, gauge
from tests.recordings import TRAVEL, bar_facts

X, Y, _ = np.eye(3)
PLAN = LengthPlan(PARALLELS[:2], 2, 2, 0.664, 30.0)


def said(artefact: StepGauge | Ballbar, plan: LengthPlan = PLAN) -> tuple[list[str], list[str]]:
    """What the plan asks for and how much of it there is, and all that is missing."""
    found = lengths_measured(plan, artefact, {})
    return [condition.what for condition in found], [text for condition in found for text in condition.missing]


def along(*lines: tuple[np.ndarray, Sequence[float]], machine: Machine = MACHINE) -> StepGauge:
    """One run of each line, its travel 900 mm along X and 550 mm along Y."""
    return gauge([line for line, _ in lines], [lengths for _, lengths in lines], repeats=1, machine=machine)


def test_a_plan_that_is_kept_says_how_amply() -> None:
    """720 of 900 mm are 80 %, 365.2 of 550 mm 66.4 %; the shortest lengths are 25 and 28.126 mm."""
    lines = [(X, [25.0, 720.0])] * 2 + [(Y, [28.126, 365.2])] * 2
    assert said(along(*lines)) == (
        [
            "parallel to X, parallel to Y",
            "longest length at least 66 % of the travel along each line: 66 % to 80 %",
            "2 lengths on each line: 2 to 2",
            "2 lengths spread over the range on each line",
            "shortest length at most 30 mm: 28.126 mm",
            "2 repetitions of each, 8 lengths in all: 8",
        ],
        [],
    )


def test_a_plan_that_is_not_kept_says_what_is_missing() -> None:
    """85 of 550 mm are 15.45 %."""
    assert said(along((Y, [30.126, 85.0]))) == (
        [
            "parallel to X, parallel to Y; missing: parallel to X",
            "longest length at least 66 % of the travel along each line: 15 % to 15 %",
            "2 lengths on each line: 2 to 2",
            "2 lengths spread over the range on each line",
            "shortest length at most 30 mm: 30.126 mm",
            "2 repetitions of each, 8 lengths in all: 2",
        ],
        [
            "parallel to X",
            "length of at least 66 % of the travel (parallel to Y: 15 %)",
            "length of at most 30 mm (parallel to Y: 30.126 mm)",
            "2 repetitions of each length (parallel to Y: 1)",
            "6 of 8 lengths",
        ],
    )


def test_of_an_artefact_without_calibrated_lengths_nothing_is_there() -> None:
    what, missing = said(Ballbar(bar_facts(None), bars().points))
    assert what[1:5] == [
        "longest length at least 66 % of the travel along each line: none",
        "2 lengths on each line: none",
        "2 lengths spread over the range on each line",
        "shortest length at most 30 mm: none",
    ]
    assert missing == ["parallel to X", "parallel to Y", "8 of 8 lengths"]


def test_of_lengths_of_one_nominal_length_the_longest_is_compared_with_the_travel() -> None:
    """365.2 of 550 mm are enough, 364.6 are not."""
    for lengths in ((365.2, 364.6), (364.6, 365.2)):
        _, missing = said(along((X, [25.0, 720.0]), *((Y, [25.0, length]) for length in lengths)))
        assert not any("of the travel" in text for text in missing)
    _, missing = said(along((X, [25.0, 720.0]), (Y, [25.0, 364.6])))
    assert "length of at least 66 % of the travel (parallel to Y: 66 %)" in missing


def test_a_line_outside_the_travel_has_no_share_of_it() -> None:
    beside = Machine("m", "XYZ", TRAVEL + np.array([[0.0], [2000.0], [0.0]]))
    _, missing = said(along((X, [25.0, 720.0]), machine=beside))
    assert "length of at least 66 % of the travel (parallel to X: 0 %)" in missing


@pytest.mark.parametrize("unknown", [0, 2])
def test_the_travel_of_two_axes_does_not_tell_the_share_of_a_line(unknown: int) -> None:
    travel = TRAVEL.copy()
    travel[unknown] = np.nan
    what, missing = said(along((X, [25.0, 720.0]), machine=Machine("m", "XYZ", travel)))
    assert what[1] == "longest length at least 66 % of the travel along each line: not known"
    assert (
        "the travel of all three axes ([machine] travel_mm), without which no length's share of it is known" in missing
    )


def test_as_many_lengths_as_the_plan_asks_for_are_to_be_repeated_and_no_more() -> None:
    x = [(X, [25.0, 720.0])] * 2
    _, missing = said(along(*x, (Y, [25.0, 400.0]), (Y, [25.0, 400.0]), (Y, [100.0])))
    assert missing == []
    _, missing = said(along(*x, (Y, [25.0, 400.0]), (Y, [25.0])))
    assert missing == ["2 repetitions of each length (parallel to Y: 1)", "1 of 8 lengths"]


@pytest.mark.parametrize(
    ("once", "missing"),
    [
        (25.0, "length of at most 30 mm (parallel to Y: 100 mm)"),
        (400.0, "length of at least 66 % of the travel (parallel to Y: 55 %)"),
    ],
)
def test_the_ends_of_the_range_are_among_the_lengths_that_are_repeated(once: float, missing: str) -> None:
    """Two lengths are repeated, and one end of the range is measured once beside them."""
    x, often = [(X, [25.0, 720.0])] * 2, [length for length in (25.0, 100.0, 300.0, 400.0) if length != once]
    _, lacks = said(along(*x, *[(Y, often)] * 2, (Y, [once])))
    assert lacks == [missing]


@pytest.mark.parametrize(("forth", "missing"), [((), []), ((1, 2), []), ((1, 2, 3), ["parallel to X: 1"])])
def test_only_bidirectional_lengths_count_as_repeats_of_bidirectional_ones(
    forth: tuple[int, ...], missing: list[str]
) -> None:
    """Measurements ``forth`` meet all faces of one line from one side."""
    both, plan = along(*[(X, [25.0, 720.0])] * 4), replace(PLAN, bidirectional=True)
    one_sided = np.isin(both.points.measurement, forth)
    along_x = np.where(one_sided, 1.0, both.points.columns["approach_x"])
    points = replace(both.points, columns={**both.points.columns, "approach_x": along_x})
    _, lacks = said(StepGauge(artefact_facts(kind="step_gauge", u_um="L/2000"), points), plan)
    assert [text for text in lacks if "repetitions" in text] == [f"2 repetitions of each length ({m})" for m in missing]


@pytest.mark.parametrize(("axes", "across"), [("x", True), ("xy", True), ("z", False), ("xyz", True), ("", False)])
def test_a_tip_of_which_not_every_coordinate_is_recorded_is_where_the_others_say(axes: str, across: bool) -> None:
    """150 mm along X and along Z, the ram: those without a column are none, as in the physics of the machine."""
    points, tip = along((X, [25.0, 720.0])).points, {"x": 150.0, "y": 0.0, "z": 150.0}
    columns = {f"tip_{a}_mm": np.full(len(points), tip[a]) for a in axes}
    beside = replace(points, columns={**points.columns, **columns})
    rows = np.array([[0, 1], [0, 2]])
    assert with_offset(beside, rows, 150.0).tolist() == [across] * 2
    assert with_offset(beside, rows, 0.0).tolist() == [not across] * 2


def test_lengths_up_to_a_millimetre_apart_are_one_nominal_length() -> None:
    lengths = np.array([22.004, 20.0, 21.0, 100.0, 20.0])
    assert nominals(lengths).tolist() == [1, 0, 0, 2, 0]


def test_a_line_that_crosses_too_little_for_a_diagonal_is_named_with_what_it_crosses() -> None:
    """Travel 900 × 550 mm in X and Y: 45° in XY crosses all 550 mm of Y and as much of X, 61 % of it."""
    plan = replace(PLAN, positions=FACE_DIAGONALS[:1])
    oblique = (X + Y) / np.sqrt(2.0)
    _, missing = said(along((oblique, [25.0, 400.0])), plan)
    assert missing[0].startswith("face diagonal +X +Y (measurement 1 lies along it, but its line crosses ")
    assert "% of the travel of X, less than 75 %)" in missing[0]
    _, missing = said(along((X, [25.0, 400.0])), plan)
    assert missing[0] == "face diagonal +X +Y"
