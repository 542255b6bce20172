"""Recordings damaged on purpose: every damage is named as what it is, and only what is damaged is left out."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from cmm_uq.analysis.screening.screening import ScreenedRecording
from cmm_uq.artefacts import artefact_facts
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.points import Floats, Points
from cmm_uq.jobs.tables.artefact import ArtefactFacts
from tests.artefacts.simulated import job_read
from tests.recordings import bar_facts, screened, with_columns

REAL = "iota-1102-20C"
BARS_BODIES_AND_LINES = (
    REAL, "gauge-blocks-simulated", "plate-simulated", "sphere-simulated", "step-gauge-simulated", "triangle-simulated",
)  # fmt: skip
SIZED = (*BARS_BODIES_AND_LINES, "bryan-simulated")
KINDS = (*SIZED, "iota-1102-20C-compensated", "plane-simulated", "plate-two-dates-simulated")
INCH, METRE = 25.4, 1000.0
ROW = 7
Spoil = Callable[[Floats], None]


def recording(example: str) -> tuple[Points, ArtefactFacts]:
    job = job_read(example)
    return job.points, job.facts.artefact


def screen_of(example: str, spoil: Spoil | None = None, **columns: Floats) -> ScreenedRecording:
    points, facts = recording(example)
    xyz = points.xyz.copy()
    if spoil is not None:
        spoil(xyz)
    spoilt = with_columns(points.at(xyz), **columns)
    return screened(spoilt, facts, needed=set(), set_aside=[], where="recording.csv")


def damage(found: ScreenedRecording) -> list[str]:
    """Kinds found, but for the copy that the real recording holds (position 18 of the thesis)."""
    return [f.kind for f in found.findings if f.measurements != (14, 18)]


@pytest.mark.parametrize("example", KINDS)
def test_an_honest_recording_is_used_whole(example: str) -> None:
    points, facts = recording(example)
    found = screened(points, facts, needed=set(), set_aside=[], where="recording.csv")
    assert damage(found) == []
    assert np.array_equal(found.points.xyz, points.xyz)
    assert found.points.columns.keys() == points.columns.keys()


def times(rows: int | slice | tuple[slice, int], factor: float) -> Spoil:
    def spoil(xyz: Floats) -> None:
        xyz[rows] *= factor

    return spoil


@pytest.mark.parametrize("example", SIZED)
@pytest.mark.parametrize(("factor", "unit"), [(1 / INCH, "inches"), (1 / METRE, "metres")])
def test_a_row_in_another_unit_is_left_out_and_named(example: str, factor: float, unit: str) -> None:
    points, _ = recording(example)
    found = screen_of(example, times(ROW, factor))
    first = found.findings[0]
    assert (first.kind, first.set_aside) == ("unit", True)
    assert first.lines == (points.lines[ROW],)
    assert f"x_mm, y_mm, z_mm look like {unit}, not mm" in first.why
    assert points.lines[ROW] not in found.points.lines


@pytest.mark.parametrize("example", BARS_BODIES_AND_LINES)
def test_a_whole_recording_in_another_unit_is_refused(example: str) -> None:
    with pytest.raises(CmmUqError, match="x_mm, y_mm, z_mm look like inches, not mm") as error:
        screen_of(example, times(slice(None), 1 / INCH))
    assert error.value.fix == "Convert to mm (times 25.4)"


@pytest.mark.parametrize("example", ["bryan-simulated", "iota-1102-20C-compensated"])
def test_a_bar_without_a_certificate_is_still_no_millimetre_long(example: str) -> None:
    with pytest.raises(CmmUqError, match="look like metres"):
        screen_of(example, times(slice(None), 1 / METRE))


@pytest.mark.parametrize("example", SIZED)
def test_one_axis_in_inches_is_refused_with_its_column(example: str) -> None:
    with pytest.raises(CmmUqError, match="x_mm looks like inches") as error:
        screen_of(example, times((slice(None), 0), 1 / INCH))
    assert error.value.where == "recording.csv, column x_mm"


@pytest.mark.parametrize("example", ["gauge-blocks-simulated", "plate-simulated", "step-gauge-simulated"])
def test_references_in_inches_are_refused_with_their_column(example: str) -> None:
    points, _ = recording(example)
    names = [name for name in points.columns if name.startswith("reference")]
    with pytest.raises(CmmUqError, match="like inches") as error:
        screen_of(example, **{name: points.columns[name] / INCH for name in names})
    assert error.value.where == f"recording.csv, column {names[0]}"


def exchanged(i: int, j: int) -> Spoil:
    def spoil(xyz: Floats) -> None:
        xyz[[i, j]] = xyz[[j, i]]

    return spoil


@pytest.mark.parametrize("example", BARS_BODIES_AND_LINES)
@pytest.mark.parametrize("rows", [(3, 12), (20, 33)])
def test_two_points_exchanged_are_found_together(example: str, rows: tuple[int, int]) -> None:
    points, _ = recording(example)
    first = screen_of(example, exchanged(*rows)).findings[0]
    assert first.kind == "swapped"
    assert first.measurements == tuple(dict.fromkeys(points.measurement[list(rows)]))
    if example != REAL:  # of two bars the other ends may be those exchanged: their lengths are the same
        assert first.lines == tuple(points.lines[list(rows)])
    assert "are exchanged: exchange their coordinates" in first.why


def coordinates_exchanged(xyz: Floats) -> None:
    xyz[11, [0, 1]] = xyz[11, [1, 0]]


@pytest.mark.parametrize("example", SIZED)
def test_x_and_y_of_one_row_exchanged_are_named(example: str) -> None:
    assert damage(screen_of(example, coordinates_exchanged)) == ["exchanged coordinates"]


def sign_turned(xyz: Floats) -> None:
    xyz[9, 2] *= -1


@pytest.mark.parametrize("example", SIZED)
def test_a_sign_that_was_lost_is_named_where_the_travel_says_so(example: str) -> None:
    """The length of a bar does not change when either end is mirrored alike; the travel of the machine tells them apart."""
    points, _ = recording(example)
    found = screen_of(example, sign_turned)
    assert damage(found) == ["sign"]
    if example != REAL:
        assert found.findings[0].lines == (points.lines[9],)


@pytest.mark.parametrize("example", SIZED)
def test_a_column_that_slipped_by_a_row_is_refused(example: str) -> None:
    def slipped(xyz: Floats) -> None:
        xyz[:, 0] = np.roll(xyz[:, 0], 1)

    with pytest.raises(CmmUqError, match="x_mm seems shifted down by one row") as error:
        screen_of(example, slipped)
    assert error.value.where == "recording.csv, column x_mm"


@pytest.mark.parametrize("example", ["gauge-blocks-simulated", "plate-simulated", "step-gauge-simulated"])
def test_references_that_slipped_by_a_row_are_not_taken_for_many_outliers(example: str) -> None:
    points, _ = recording(example)
    names = [name for name in points.columns if name.startswith("reference")]
    with pytest.raises(CmmUqError):
        screen_of(example, **{name: np.roll(points.columns[name], 1) for name in names})


@pytest.mark.parametrize("example", [REAL, "gauge-blocks-simulated", "step-gauge-simulated", "triangle-simulated"])
def test_an_axis_that_sticks_is_refused(example: str) -> None:
    def stuck(xyz: Floats) -> None:
        xyz[:, 1] = xyz[0, 1]

    with pytest.raises(CmmUqError, match="y_mm is stuck"):
        screen_of(example, stuck)


@pytest.mark.parametrize("example", ["plate-simulated", "sphere-simulated", "triangle-simulated"])
def test_a_coordinate_that_repeats_the_row_before_is_stuck(example: str) -> None:
    def stuck(xyz: Floats) -> None:
        xyz[14, 0] = xyz[13, 0]

    assert damage(screen_of(example, stuck)) == ["stuck"]


@pytest.mark.parametrize("example", BARS_BODIES_AND_LINES)
def test_a_row_copied_over_another_is_a_copy(example: str) -> None:
    points, _ = recording(example)

    def copied(xyz: Floats) -> None:
        xyz[15] = xyz[4]

    first = screen_of(example, copied).findings[0]
    assert (first.kind, first.set_aside) == ("duplicate", True)
    assert f"line {points.lines[4]} to the last digit" in first.why


@pytest.mark.parametrize("example", SIZED)
def test_a_gross_row_that_nothing_explains_is_an_outlier(example: str) -> None:
    """37 mm in x: no unit, sign or exchange makes that."""

    def gross(xyz: Floats) -> None:
        xyz[16, 0] += 37.0

    assert damage(screen_of(example, gross)) == ["outlier"]


def test_a_block_of_bars_pasted_twice_is_one_finding_and_left_out(ballbar_points: Points) -> None:
    xyz = ballbar_points.xyz.copy()
    xyz[40:60] = xyz[:20]
    found = screened(ballbar_points.at(xyz), bar_facts(), needed=set(), set_aside=[], where="bar.csv")
    (block,) = found.findings
    assert (block.kind, block.set_aside) == ("repeated block", True)
    assert "measurements 21 to 30 repeat the coordinates of measurements 1 to 10" in block.why
    assert sorted(set(found.points.measurement)) == [*range(1, 21), *range(31, 41)]


def test_a_plate_counted_by_columns_instead_of_rows_is_told(ballbar_points: Points) -> None:
    """4 × 3 balls: the distances are those of the plate, in another order."""
    grid = np.array([[90.0 * x, 90.0 * y, 0.0] for y in range(3) for x in range(4)])
    other = grid[np.lexsort((grid[:, 1], grid[:, 0]))]
    places = [grid + np.array([100.0 + 50 * k, 100.0, -200.0 - 20 * k]) for k in range(6)]
    places[2] = other + np.array([200.0, 100.0, -240.0])
    n = 12 * len(places)
    points = replace(
        ballbar_points,
        xyz=np.vstack(places), measurement=np.repeat(np.arange(1, 7), 12), point=np.tile(np.arange(1, 13), 6),
        repeat=np.ones(n, dtype=np.int64), lines=np.arange(2, n + 2),
        columns={f"reference_{a}_mm": np.tile(grid[:, i], 6) for i, a in enumerate("xyz")},
    )  # fmt: skip
    (found,) = screened(points, artefact_facts(kind="plate"), needed=set(), set_aside=[], where="p.csv").findings
    assert found.kind == "swapped"
    assert found.measurements == (3,)
    assert "numbered in another order" in found.why


def repeated_bars(points: Points) -> Points:
    """Every bar three times in its place."""
    n = len(points)
    return Points(
        np.tile(points.xyz, (3, 1)), np.tile(points.measurement, 3), np.tile(points.point, 3), np.repeat([1, 2, 3], n),
        points.machine, {}, np.arange(2, 3 * n + 2),
    )  # fmt: skip


def test_a_bar_turned_round_against_its_repeats_is_reported_and_used(ballbar_points: Points) -> None:
    points = repeated_bars(ballbar_points)
    xyz = points.xyz.copy()
    xyz[[90, 91]] = xyz[[91, 90]]
    found = screened(points.at(xyz), bar_facts(), needed=set(), set_aside=[], where="bar.csv")
    (swap,) = found.findings
    assert (swap.kind, swap.measurements, swap.lines, swap.set_aside) == ("swapped", (6,), (92, 93), False)
    assert len(found.points) == len(points)


def test_a_bar_turned_round_is_left_out_where_the_approach_of_its_balls_matters(ballbar_points: Points) -> None:
    points = repeated_bars(ballbar_points)
    xyz = points.xyz.copy()
    xyz[[90, 91]] = xyz[[91, 90]]
    approach = np.where(points.point == 1, 1.0, -1.0)
    spoilt = with_columns(points.at(xyz), approach_x=approach)
    found = screened(spoilt, bar_facts(), needed={"approach_x"}, set_aside=[], where="bar.csv")
    (swap,) = found.findings
    assert swap.set_aside
    assert len(found.points) == len(points) - 2


def lines_twice(points: Points) -> Points:
    """Eight lines of a gauge of six faces, each measured twice."""
    faces = np.array([0.0, 40, 100, 180, 260, 300])
    starts = points.xyz[:8] * [0.3, 0.3, 0.3] + [30.0, 30.0, -30.0]
    directions = np.abs(points.xyz[1::2][:8] - points.xyz[::2][:8]) / 400.0 * [1, 1, -1]
    xyz = np.concatenate([s + np.outer(faces, d) for s, d in zip(starts, directions, strict=True) for _ in (1, 2)])
    n = len(xyz)
    number, repeat = np.repeat(np.arange(1, 9), 12), np.tile(np.repeat([1, 2], 6), 8)
    return Points(xyz, number, np.tile(np.arange(1, 7), 16), repeat, points.machine,
                  {"reference_mm": np.tile(faces, 16)}, np.arange(2, n + 2))  # fmt: skip


@pytest.mark.parametrize("which", [1, 2])
def test_of_two_repeats_the_one_in_inches_is_left_out_and_the_other_used(ballbar_points: Points, which: int) -> None:
    """Neither half has a majority in its line; that one of them is in a known unit decides."""
    points = lines_twice(ballbar_points)
    spoilt = (points.measurement == 5) & (points.repeat == which)
    xyz = points.xyz.copy()
    xyz[spoilt] /= INCH
    found = screened(points.at(xyz), artefact_facts(kind="step_gauge"), needed=set(), set_aside=[], where="g.csv")
    (unit,) = found.findings
    assert unit.kind == "unit"
    assert set(unit.rows) == set(np.flatnonzero(spoilt))


def test_a_gauge_counted_from_its_other_end_is_told(ballbar_points: Points) -> None:
    points = lines_twice(ballbar_points)
    xyz = points.xyz.copy()
    for repeat in (1, 2):
        rows = np.flatnonzero((points.measurement == 3) & (points.repeat == repeat))
        xyz[rows] = xyz[rows[::-1]]
    found = screened(points.at(xyz), artefact_facts(kind="step_gauge"), needed=set(), set_aside=[], where="g.csv")
    (swap,) = found.findings
    assert (swap.kind, swap.measurements) == ("swapped", (3,))
    assert "counted from the other end" in swap.why


def test_a_row_in_inches_is_named_though_the_origin_is_missing(ballbar_points: Points) -> None:
    """Every reading lies outside the travel then, so that the travel says nothing about this row."""
    xyz = ballbar_points.xyz + np.array([-700.0, 300.0, 200.0])
    xyz[3] /= INCH
    found = screened(ballbar_points.at(xyz), bar_facts(), needed=set(), set_aside=[], where="bar.csv")
    assert found.findings[0].kind == "unit"
    assert found.findings[0].lines == (5,)


def test_several_damages_at_once_are_each_named(ballbar_points: Points) -> None:
    xyz = ballbar_points.xyz.copy()
    xyz[3] /= INCH
    xyz[[20, 41]] = xyz[[41, 20]]
    xyz[60, 0] += 53.0
    found = screened(ballbar_points.at(xyz), bar_facts(), needed=set(), set_aside=[], where="bar.csv")
    assert {f.kind: f.measurements for f in found.findings} == {"unit": (2,), "swapped": (11, 21), "outlier": (31,)}


def test_the_other_end_of_a_damaged_bar_goes_with_it() -> None:
    found = screen_of(REAL, times(ROW, 1 / INCH))
    assert 4 not in found.points.measurement
    assert len(found.points) == 38


def test_damage_of_a_third_of_a_recording_is_refused(ballbar_points: Points) -> None:
    xyz = ballbar_points.xyz.copy()
    xyz[np.arange(0, 80, 6)] += [11.0, 23.0, 31.0]
    with pytest.raises(CmmUqError, match="do not fit the artefact"):
        screened(ballbar_points.at(xyz), bar_facts(), needed=set(), set_aside=[], where="bar.csv")


def test_what_the_job_sets_aside_already_does_not_count_as_damage(ballbar_points: Points) -> None:
    xyz = ballbar_points.xyz.copy()
    rows = np.arange(0, 80, 6)
    xyz[rows] += [11.0, 23.0, 31.0]
    aside = np.unique(ballbar_points.measurement[rows]).tolist()
    found = screened(ballbar_points.at(xyz), bar_facts(), needed=set(), set_aside=aside, where="bar.csv")
    # what a bar shows of a displaced ball is its length: less than 2.5 mm of 400 mm could be a machine's error
    longer = np.abs(np.linalg.norm(xyz[1::2] - xyz[::2], axis=1) - 400.0)
    damaged = ballbar_points.measurement[::2][longer > 2.5]
    assert set(damaged) <= set(aside)
    assert len(damaged) >= 13
    assert set(found.points.measurement) == set(ballbar_points.measurement) - set(damaged)


def test_the_recording_of_another_bar_is_refused_in_the_words_of_the_bar(ballbar_points: Points) -> None:
    with pytest.raises(CmmUqError, match=r"by the certificate 410 mm"):
        screened(ballbar_points, bar_facts(410.0), needed=set(), set_aside=[], where="bar.csv")


def on_axes(degrees: float, then: Spoil | None = None) -> Spoil:
    """Readings of a machine whose axes lean by so much: each place is the sum of what was read, along unit vectors."""
    xy, yz, zx = np.cos(np.pi / 2 + np.radians(degrees * np.array([1.0, -0.7, 0.5])))
    axes = np.linalg.cholesky(np.array([[1, xy, zx], [xy, 1, yz], [zx, yz, 1]]))

    def spoil(xyz: Floats) -> None:
        xyz[:] = xyz @ np.linalg.inv(axes)
        if then is not None:
            then(xyz)

    return spoil


@pytest.mark.parametrize("example", SIZED)
@pytest.mark.parametrize("degrees", [0.5, 0.7, 1.0, 3.0])
def test_axes_out_of_square_damage_nothing(example: str, degrees: float) -> None:
    assert damage(screen_of(example, on_axes(degrees))) == []


@pytest.mark.parametrize("degrees", [0.5, 1.0, 3.0])
def test_a_wrong_figure_is_found_on_axes_out_of_square(degrees: float) -> None:
    points, _ = recording(REAL)
    found = screen_of(REAL, on_axes(degrees, shift_y))
    assert [points.lines[ROW] in f.lines for f in found.findings if f.measurements != (14, 18)] == [True]


def shift_y(xyz: Floats) -> None:
    xyz[ROW, 1] += 12.0


def test_one_wrong_bar_is_not_taken_for_axes_out_of_square() -> None:
    """The angles are those of the other bars, which do not foretell what is wrong with this one."""
    points, _ = recording(REAL)
    found = screen_of(REAL, shift_y)
    assert [points.lines[ROW] in f.lines for f in found.findings if f.measurements != (14, 18)] == [True]


def test_a_wrong_length_is_not_taken_for_axes_out_of_square() -> None:
    with pytest.raises(CmmUqError):
        screen_of("step-gauge-simulated", times(slice(None), 1.02))
