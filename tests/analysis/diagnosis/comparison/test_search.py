"""Which effects are asserted, given the probabilities of combinations; the combinations are made by hand."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pytest

from cmm_uq.analysis.diagnosis.comparison.combinations import Combination, Combinations
from cmm_uq.analysis.diagnosis.comparison.explanations import EFFECT, UNKNOWN, Explanation
from cmm_uq.analysis.diagnosis.comparison.search import effects_to_assert, probability_with_rivals
from cmm_uq.machine.physics.effect import Nonparametric

BOW, TURN, SQUARE, FUNCTION = range(4)
X_OF_Y = Nonparametric("y_mm", "x")
RIVALS = (
    Explanation("straightness_y_x", EFFECT, (), imitated_by=(X_OF_Y,)),
    Explanation("rotation_x_z", EFFECT, ()),
    Explanation("squareness_xy", EFFECT, (), imitated_by=(X_OF_Y,)),
    Explanation("error along X as a function of Y", UNKNOWN, (), term=X_OF_Y),
)


def combinations(probability: Mapping[tuple[int, ...], float]) -> Combinations:
    return Combinations(RIVALS, {frozenset(key): Combination((), float(np.log(p))) for key, p in probability.items()})


def found(probability: Mapping[tuple[int, ...], float]) -> set[int]:
    return set(effects_to_assert(combinations(probability)))


def test_the_most_probable_set_is_asserted() -> None:
    assert found({(BOW, SQUARE): 0.9, (BOW,): 0.1}) == {BOW, SQUARE}


def test_what_something_else_could_well_be_instead_is_not() -> None:
    assert found({(SQUARE, TURN): 0.4, (SQUARE,): 0.3, (BOW,): 0.3}) == {SQUARE}


def test_one_of_two_that_cannot_be_told_apart_is_asserted_for_both() -> None:
    assert found({(BOW,): 0.45, (TURN,): 0.4, (): 0.15}) == {BOW}


def test_effects_whose_sum_is_a_nonparametric_term_are_asserted() -> None:
    """A line and a bow are a smooth function; that it is more probable than the two of them is no reason to know nothing."""
    assert found({(FUNCTION,): 0.6, (SQUARE, BOW): 0.4}) == {SQUARE, BOW}
    assert found({(FUNCTION,): 0.9, (SQUARE, BOW): 0.1}) == set()


def test_not_beside_one_that_stands_in_their_place() -> None:
    """Together two that cannot be told apart would determine nothing."""
    assert found({(TURN,): 0.5, (BOW,): 0.3, (FUNCTION,): 0.2}) == {TURN}


def test_an_effect_or_its_rival_counts_once_where_both_hold() -> None:
    some = combinations({(BOW,): 0.5, (TURN,): 0.2, (BOW, TURN): 0.2, (SQUARE,): 0.005, (): 0.095})
    assert probability_with_rivals(some, frozenset({BOW}), BOW) == pytest.approx(0.9)
