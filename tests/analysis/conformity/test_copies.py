"""Which measurements are copies of which, and how they are named."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from cmm_uq.analysis.conformity.uncertainty import copies_in_words
from cmm_uq.base.points import Points


def runs(*of: tuple[int, int, float]) -> Points:
    """A single point of each measurement and repeat, at a place along X."""
    measurement, repeat, place = np.array(of).T
    xyz = np.column_stack([place, np.zeros(len(of)), np.ones(len(of))])
    return Points(xyz, measurement.astype(np.int64), np.ones(len(of), dtype=np.int64), repeat.astype(np.int64))


def by_run(points: Points) -> dict[tuple[int, int], tuple[int, int]]:
    return {points.run_of(later): points.run_of(original) for later, original in points.copies.items()}


def test_the_original_is_the_one_of_the_lowest_number_wherever_it_was_recorded() -> None:
    """Measurement 7 stands first in the recording; 2 has two repeats."""
    points = runs((7, 1, 5.0), (2, 2, 5.0), (2, 1, 5.0), (3, 1, 6.0))
    assert by_run(points) == {(7, 1): (2, 1), (2, 2): (2, 1)}


def test_where_nothing_is_repeated_nothing_is_said() -> None:
    assert runs((1, 1, 5.0), (1, 2, 6.0)).copies == {}
    assert copies_in_words(runs((1, 1, 5.0), (1, 2, 6.0))) == ""


def named(numbers: Sequence[int]) -> str:
    return copies_in_words(runs((1, 1, 5.0), *((number, 3, 5.0) for number in numbers)))


def test_five_copies_are_named_in_the_order_of_their_numbers_and_of_more_how_many() -> None:
    said = [f"measurement {n}, repeat 3 of measurement 1, repeat 1" for n in range(2, 7)]
    begin = "Copies to the last digit, which do not count: "
    assert named([2]) == f"{begin}{said[0]}."
    assert named([6, 4, 5, 3, 2]) == f"{begin}{'; '.join(said)}."
    assert named([7, 6, 4, 5, 3, 2]) == f"{begin}{'; '.join(said)} and 1 more."
    assert named([8, 7, 6, 4, 5, 3, 2]) == f"{begin}{'; '.join(said)} and 2 more."


def test_copies_of_several_are_named_in_the_order_of_their_originals() -> None:
    assert copies_in_words(runs((3, 1, 5.0), (1, 1, 6.0), (4, 1, 5.0), (2, 1, 6.0))) == (
        "Copies to the last digit, which do not count: measurement 2, repeat 1 of measurement 1, repeat 1; "
        "measurement 4, repeat 1 of measurement 3, repeat 1."
    )
