"""What an oracle sees that is told the form of what is hidden outside the catalogue."""

from __future__ import annotations

from dataclasses import replace

import pytest

from benchmarks.second.cases import Case, case, outside
from benchmarks.second.oracle import DRAWS, EXCEED, known_forms
from benchmarks.second.page import LEAST_P, _told_the_form


def without(made: Case) -> Case:
    """The case with what is hidden taken off its observations."""
    ((name, size),) = made.truth["hidden"].items()
    seen = -made.placed.D @ (size * outside(made.placed)[name](made.placed.true, made.context)).ravel()
    return replace(made, y=made.y - seen)


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


def test_the_least_p_value_is_that_of_one_draw_beyond() -> None:
    assert pytest.approx(0.01) == LEAST_P
    assert EXCEED == 1


def test_the_page_counts_what_the_oracle_sees_and_what_is_recognised_of_it() -> None:
    out = [
        ({"name": f"{i}"}, {"verdict": verdict})
        for i, verdict in enumerate(("partial", "consistent", "explained", "partial"))
    ]
    oracles = {"0": {"knows_form": {"p": 0.005, "named": True}}, "1": {"knows_form": {"p": 0.01, "named": False}},
               "2": {"knows_form": {"p": 0.2, "named": False}}}  # fmt: skip
    said = _told_the_form(out, oracles)
    assert "sees 2 of 3, and names it among the whole catalogue in 1; of those that it sees 1 are recognised." in said
    assert _told_the_form(out, {}) == ""
