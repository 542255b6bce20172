"""Which measurements are copies of which, and how they are named."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from itertools import product

import numpy as np
import pytest

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


def lengths_alone(step_mm: float, copied: Collection[int] = (), *, across_mm: float = 0.0) -> Points:
    """Five lengths on each of seven lines, three times, 0.3 µm of scatter, rounded to ``step_mm``.

    The third repeat of the measurements ``copied`` is their first. ``across_mm``: how far ends lie beside their lines.
    """
    noise, rows = np.random.default_rng(12), list[tuple[float, ...]]()
    for line, nominal in product(range(7), (60, 180, 300, 420, 540)):
        number = len(rows) // 6 + 1
        read = np.round((nominal + noise.normal(0.0, 3e-4, 3)) / step_mm) * step_mm
        read[2] = read[0] if number in copied else read[2]
        for repeat, length in enumerate(read, 1):
            start, beside = np.array([10.0 * line, 5.0, 6.0]), across_mm * noise.standard_normal()
            rows += [(number, 1, repeat, *start), (number, 2, repeat, *(start + np.array([length, 0.0, beside])))]
    number, point, repeat, *xyz = np.array(rows).T
    return Points(np.column_stack(xyz), number.astype(int), point.astype(int), repeat.astype(int))


@pytest.mark.parametrize("step_mm", [1e-4, 1e-5, 25.4e-5])
def test_lengths_alone_that_are_equal_by_rounding_are_no_copies(step_mm: float) -> None:
    points = lengths_alone(step_mm)
    length = np.linalg.norm(points.xyz[1::2] - points.xyz[::2], axis=1).reshape(-1, 3)
    assert np.any(np.abs(np.diff(length[:, [0, 1, 2, 0]])) < 1e-9), "some are equal"
    assert points.copies == {}


@pytest.mark.parametrize("step_mm", [1e-4, 1e-5, 1e-7])
def test_a_line_whose_lengths_are_all_those_of_another_repeat_is_copied(step_mm: float) -> None:
    copied = range(11, 16)
    assert by_run(lengths_alone(step_mm, copied)) == {(n, 3): (n, 1) for n in copied}


def test_a_repeat_that_is_another_on_every_line_is_copied() -> None:
    assert {(n, 3) for n in range(1, 36)} <= set(by_run(lengths_alone(1e-4, range(1, 36))))


def test_points_that_were_probed_are_copies_each_by_itself() -> None:
    """Ends scatter across the line as well, so that two repeats are not the same by rounding."""
    assert by_run(_with_copied_ends(lengths_alone(1e-4, across_mm=1e-3), 7)) == {(7, 3): (7, 1)}


def _with_copied_ends(points: Points, measurement: int) -> Points:
    xyz, own = points.xyz.copy(), points.measurement == measurement
    xyz[own & (points.repeat == 3)] = xyz[own & (points.repeat == 1)]
    return points.at(xyz)


def test_lengths_that_repeat_exactly_every_time_are_copies() -> None:
    assert len(lengths_alone(0.1).copies) == 70
