"""What an oracle sees that is told the form of what is hidden outside the catalogue."""

from __future__ import annotations

from dataclasses import replace

import pytest

from benchmarks.second.cases import Case, case, outside
from benchmarks.second.oracle import DRAWS, known_forms
from benchmarks.second.page import LEAST_P


def without(made: Case) -> Case:
    """The case with what is hidden taken off its observations."""
    ((name, size),) = made.truth["hidden"].items()
    seen = -made.placed.D @ (size * outside(made.placed)[name](made.placed.true, made.context)).ravel()
    return replace(made, y=made.y - seen)


@pytest.mark.long
@pytest.mark.parametrize("number", [0, 1, 2])
def test_what_is_nine_times_its_uncertainty_is_seen_and_named_and_without_it_there_is_no_more_than_noise(
    number: int,
) -> None:
    """By the noncentral χ² of one degree, √λ of 9 and more exceeds the threshold of 1 % in all but 10⁻¹⁰ of recordings."""
    made = case(21, "outside", number)
    p_value, named = known_forms(made, seed=number)
    assert p_value == 1 / (1 + DRAWS)
    assert named
    p_without, named_without = known_forms(without(made), seed=number)
    assert p_without > LEAST_P
    assert not named_without
