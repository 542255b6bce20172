"""Positions of ISO 10360-2:2009, 6.3."""

from __future__ import annotations

import numpy as np
import pytest

from cmm_uq.conformity.measurement_lines import SEVEN_LINES, missing_lines, position_of, share_of_travel
from cmm_uq.points import Machine
from tests.recordings import TRAVEL


@pytest.mark.parametrize(
    ("direction", "position"),
    [
        ((1, 0, 0), "parallel to X"), ((0, -1, 0.1), "parallel to Y"), ((0, 1, 1), "face diagonal +Y +Z"),
        ((1, -1, 0), "face diagonal −X +Y"), ((-1, -1, -1), "space diagonal +X +Y +Z"),
        ((9, -5.5, 5), "space diagonal +X −Y +Z"),
    ],
)  # fmt: skip
def test_a_line_has_its_position_whichever_way_it_is_measured(direction: tuple[float, ...], position: str) -> None:
    assert position_of(np.array(direction)) == position
    assert position_of(-np.array(direction)) == position


def test_seven_positions_are_complete_and_each_missing_one_is_named() -> None:
    lines = [np.array(d, dtype=float) for d in ((1, 1, 1), (1, -1, 1), (-1, 1, 1), (-1, -1, 1), (1, 0, 0), (0, 1, 0))]
    assert missing_lines(lines) == ("parallel to Z",)
    assert missing_lines([*lines, np.array([0, 0, -1.0])]) == ()
    assert missing_lines([]) == SEVEN_LINES


def test_a_length_is_compared_with_the_travel_along_its_line() -> None:
    """900 × 550 × 500 mm: 450 mm along X is half; the space diagonal is √(900² + 550² + 500²) mm long."""
    machine = Machine("m", "XYZ", TRAVEL)
    middle = TRAVEL.mean(axis=1)
    assert share_of_travel(machine, middle, np.array([1.0, 0, 0]), 450.0) == pytest.approx(0.5)
    diagonal = np.array([900.0, 550, 500])
    length = float(np.linalg.norm(diagonal))
    assert share_of_travel(machine, middle, diagonal / length, length) == pytest.approx(1.0)
    assert share_of_travel(Machine(), middle, diagonal / length, length) is None
