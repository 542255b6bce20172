"""Names of lines in the volume, and the travel along them."""

from __future__ import annotations

import numpy as np
import pytest

from cmm_uq.analysis.conformity.plans import (
    FACE_DIAGONALS,
    PARALLELS,
    SPACE_DIAGONALS,
    crossed_travel,
    position_of,
    position_on,
    share_of_travel,
    too_short,
)
from cmm_uq.base.languages.translation import Code, translated
from cmm_uq.base.points import Machine
from tests.recordings import TRAVEL

MACHINE = Machine("m", "XYZ", TRAVEL)
LONG = Machine("long", "XYZ", np.array([[0.0, 6000.0], [0.0, 1000.0], [-600.0, 0.0]]))


@pytest.mark.parametrize(
    ("direction", "position"),
    [
        ((1, 0, 0), "parallel to X"), ((0, -1, 0.1), "parallel to Y"), ((0, 1, 1), "face diagonal +Y +Z"),
        ((9, -5.5, 0), "face diagonal −X +Y"), ((-1, -1, -1), "space diagonal +X +Y +Z"),
        ((9, -5.5, 5), "space diagonal +X −Y +Z"),
    ],
)  # fmt: skip
def test_a_line_has_its_position_whichever_way_it_is_measured(direction: tuple[float, ...], position: str) -> None:
    assert position_of(np.array(direction)) == position
    assert position_of(-np.array(direction)) == position
    for machine in (Machine(), MACHINE):
        assert (
            position_on(machine, TRAVEL.mean(axis=1), np.array(direction)).replace("oblique", "space diagonal")
            == position
        )


def test_the_six_face_diagonals_are_the_names_of_their_directions() -> None:
    directions = [(a, b, 0) for a, b in ((1, 1), (-1, 1))] + [(0, a, 1) for a in (1, -1)] + [(a, 0, 1) for a in (1, -1)]
    assert {position_of(np.array(d, dtype=float)) for d in directions} == set(FACE_DIAGONALS)
    assert len(FACE_DIAGONALS) == 6


def test_a_space_diagonal_goes_from_corner_to_corner_where_the_travel_is_known() -> None:
    diagonal = np.array([900.0, 550, 500])
    middle = TRAVEL.mean(axis=1)
    assert position_on(MACHINE, middle, diagonal) == "space diagonal +X +Y +Z"
    # moved by 20 % of the travel the line still crosses 80 % of every axis; by 30 % no longer
    assert position_on(MACHINE, middle + np.array([180, 0, 0]), diagonal) == "space diagonal +X +Y +Z"
    assert position_on(MACHINE, middle + np.array([270, 0, 0]), diagonal) == "oblique +X +Y +Z"
    # by 25 % of it three quarters to the last digit of measured ends, which lie a few micrometres beside
    for off in (-1e-4, 0.0, 1e-4):
        assert position_on(MACHINE, middle + np.array([225 + off, 0, 0]), diagonal) == "space diagonal +X +Y +Z"
    # across a corner, and hardly off the floor
    assert position_on(MACHINE, np.array([50.0, 50.0, -50.0]), np.array([1.0, -1, 1])) == "oblique +X −Y +Z"
    assert position_on(MACHINE, middle, np.array([1.0, 0.2, 0.2])) == "oblique +X +Y +Z"


def test_the_diagonal_of_a_long_machine_is_one_though_it_is_nearly_along_an_axis() -> None:
    """6000 × 1000 × 600 mm: its diagonal is 11° off X, but less than 10° in each plane."""
    middle = LONG.travel_mm.mean(axis=1)
    assert position_of(np.array([6000.0, 1000, 600])) == "parallel to X"
    assert position_on(LONG, middle, np.array([6000.0, 1000, 600])) == "space diagonal +X +Y +Z"
    assert position_on(LONG, middle, np.array([6000.0, 100, 60])) == "parallel to X"


def test_a_length_is_compared_with_the_travel_along_its_line() -> None:
    """900 × 550 × 500 mm: 450 mm along X is half; the space diagonal is √(900² + 550² + 500²) mm long."""
    middle = TRAVEL.mean(axis=1)
    assert share_of_travel(MACHINE, middle, np.array([1.0, 0, 0]), 450.0) == pytest.approx(0.5)
    diagonal = np.array([900.0, 550, 500])
    length = float(np.linalg.norm(diagonal))
    assert crossed_travel(MACHINE, middle, diagonal) == pytest.approx(length)
    assert share_of_travel(MACHINE, middle, diagonal / length, length) == pytest.approx(1.0)
    assert share_of_travel(Machine(), middle, diagonal / length, length) is None
    assert crossed_travel(MACHINE, np.array([5000.0, 0, 0]), diagonal) == 0.0


@pytest.mark.parametrize(("degrees", "position"), [(9.99, "parallel to X"), (10.02, "face diagonal +X +Y")])
def test_a_line_is_parallel_to_an_axis_up_to_ten_degrees_from_it(degrees: float, position: str) -> None:
    t = np.radians(degrees)
    assert position_of(np.array([np.cos(t), np.sin(t), 0.0])) == position


@pytest.mark.parametrize(("moved", "position"), [(0.248, "space diagonal"), (0.251, "oblique")])
def test_a_space_diagonal_crosses_three_quarters_of_every_axis(moved: float, position: str) -> None:
    """Moved along X by a part of its travel, the diagonal crosses the rest."""
    middle = TRAVEL.mean(axis=1) + np.array([900 * moved, 0, 0])
    assert position_on(MACHINE, middle, np.array([900.0, 550, 500])) == f"{position} +X +Y +Z"


@pytest.mark.parametrize(
    ("middle", "direction", "position"),
    [
        ((450.0, 275, -250), (9.0, 5.5, 0), "face diagonal +X +Y"),
        ((450.0, 275, -250), (1.0, 0.2, 0), "oblique +X +Y"),  # 11°: all of X, a third of Y
        ((850.0, 30, -250), (9.0, 5.5, 0), "oblique +X +Y"),  # across a corner
        ((450.0, 275, -250), (1.0, 0.17, 0), "parallel to X"),
        ((750.0, 25, -250), (1.0, 0.17, 0), "oblique +X"),  # 9.6°, out of the travel of Y after 294 of 900 mm of X
    ],
)
def test_other_positions_cross_three_quarters_of_the_axes_that_they_are_named_by(
    middle: tuple[float, ...], direction: tuple[float, ...], position: str
) -> None:
    travel = np.array([[0.0, 900.0], [0.0, 550.0], [-500.0, 0.0]])
    assert position_on(Machine("m", "XYZ", travel), np.array(middle), np.array(direction)) == position
    assert position_on(Machine(), np.array(middle), np.array(direction)) == position_of(np.array(direction))


@pytest.mark.parametrize("unknown", [0, 1, 2])
def test_the_travel_of_two_axes_alone_is_no_travel(unknown: int) -> None:
    travel = TRAVEL.copy()
    travel[unknown] = np.nan
    assert crossed_travel(Machine("m", "XYZ", travel), TRAVEL.mean(axis=1), np.array([1.0, 0, 0])) is None


@pytest.mark.parametrize("tilt", [0.0, 1e-6])
def test_a_line_beside_the_travel_crosses_none_of_it(tilt: float) -> None:
    """Along X, whether exactly or not; at the end of the travel of Y it lies within it."""
    along = np.array([1.0, tilt, 0.0])
    for y, crossed in ((-1.0, 0.0), (551.0, 0.0), (275.0, 900.0)):
        assert crossed_travel(MACHINE, np.array([450.0, y, -250.0]), along) == pytest.approx(crossed)
        assert crossed_travel(MACHINE, np.array([100.0, y, -250.0]), -along) == pytest.approx(crossed)
    for y in (0.0, 550.0):
        assert crossed_travel(MACHINE, np.array([450.0, y, -500.0]), np.array([1.0, 0.0, 0.0])) == pytest.approx(900.0)


def test_the_travel_is_that_of_the_scales() -> None:
    """Recorded 1000 mm off the scales: the origin brings the line back."""
    moved = Machine("m", "XYZ", TRAVEL, np.array([1000.0, 0, 0]))
    assert crossed_travel(moved, TRAVEL.mean(axis=1) - [1000, 0, 0], np.array([1.0, 0, 0])) == pytest.approx(900.0)


@pytest.mark.parametrize(
    ("code", "said"),
    [("en", "its line crosses 70 % of the travel of X"), ("de", "ihre Linie durchquert 70 % des Verfahrwegs von X"),
     ("fr", "70 %"), ("ja", "70 %")],
)  # fmt: skip
def test_a_diagonal_that_is_missing_names_the_nearest_line_in_any_language(code: Code, said: str) -> None:
    """Moved along X by 30 % of its travel, of which it then crosses 70 %, and by 40 %."""
    middle, diagonal = TRAVEL.mean(axis=1), np.array([900.0, 550, 500])
    lines = [(7, middle + np.array([360.0, 0, 0]), diagonal), (8, middle + np.array([270.0, 0, 0]), -diagonal)]
    told = [str.__str__(translated(too_short(one, MACHINE, lines), code)) for one in (*SPACE_DIAGONALS, *PARALLELS)]
    (named,) = [text for text in told if "8" in text]
    assert said in named.replace("\xa0", " ")
    assert "+X +Y +Z" in named
    assert not [text for text in told if "7" in text.replace("70", "").replace("75", "")]
