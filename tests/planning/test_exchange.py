"""Chosen designs against optimal designs that are known, and against all designs tried one by one."""

from __future__ import annotations

from collections import Counter
from itertools import combinations

import numpy as np
import pytest

from cmm_uq.errors import CmmUqError
from cmm_uq.inference.linear_model import Unknown
from cmm_uq.planning.candidates import candidates
from cmm_uq.planning.exchange import choose, score_of
from cmm_uq.planning.information import Told, told
from cmm_uq.points import Floats
from tests.planning.plans import BALLBAR, setting

PLACES = np.linspace(-1, 1, 21)


def quadratic() -> Told:
    """One reading a place of a + b·x + c·x², the noise so small that priors do not count."""
    rows = 1e4 * np.column_stack([np.ones(21), PLACES, PLACES**2])
    unknowns = tuple(Unknown((name, name), "", 0.0, 1.0, 1.0) for name in ("a", "b", "c"))
    return Told(unknowns, rows[:, :, None] * rows[:, None, :], np.zeros((3, 3)))


def taken(known: Told, criterion: str, count: int) -> Counter[float]:
    score = score_of(criterion, known, [0, 1, 2])
    return Counter(np.round(PLACES[list(choose(known, known.prior, score, count, again=True).indices)], 6).tolist())


def test_a_parabola_is_read_at_both_ends_and_in_the_middle_equally_often() -> None:
    """The D-optimal design of a quadratic (Atkinson, Donev & Tobias 2007, 11.2)."""
    assert taken(quadratic(), "D", 12) == Counter({-1.0: 4, 0.0: 4, 1.0: 4})


def test_for_the_smallest_mean_variance_the_middle_is_read_twice_as_often() -> None:
    """The A-optimal design of a quadratic on [−1, 1] has weights ¼, ½, ¼ (Pukelsheim 1993, 9.12)."""
    assert taken(quadratic(), "A", 12) == Counter({-1.0: 3, 0.0: 6, 1.0: 3})


@pytest.mark.parametrize("criterion", ["D", "A", "worst", "separation"])
def test_no_other_three_of_twelve_placings_are_much_better(criterion: str) -> None:
    """Against every one of the 220 choices: exchange ends in a local optimum; here it is the best of all or next to it."""
    chosen = setting(BALLBAR, named=("scale_x", "squareness_xy", "squareness_yz"), candidates=12)
    known = told(chosen, candidates(chosen))
    score = score_of(criterion, known, [0, 1, 2])
    start = known.prior
    every = np.array([
        float(score((start + known.each[list(some)].sum(axis=0))[None])[0])
        for some in combinations(range(12), 3)
    ])  # fmt: skip
    found = choose(known, start, score, 3)
    assert found.after == pytest.approx(float(score((start + known.each[list(found.indices)].sum(axis=0))[None])[0]))
    assert np.mean(every < found.after - 1e-9) < 0.02


def test_a_placing_more_never_makes_the_uncertainty_larger() -> None:
    chosen = setting(BALLBAR, candidates=40)
    known = told(chosen, candidates(chosen))
    for criterion in ("D", "A", "worst"):
        score = score_of(criterion, known, known.where(chosen.named))
        start = known.prior + known.each[:10].sum(axis=0)
        assert np.all(score(start + known.each) <= score(start[None]) + 1e-12)


def scores_of(criterion: str, targets: list[int]) -> Floats:
    known = quadratic()
    return score_of(criterion, known, targets)(known.each)


def test_an_unknown_criterion_is_refused() -> None:
    with pytest.raises(CmmUqError, match="no criterion 'E'"):
        scores_of("E", [0])


def test_one_effect_alone_has_nothing_to_be_told_apart_from() -> None:
    with pytest.raises(CmmUqError, match="at least 2 effects"):
        scores_of("separation", [0])


def test_no_placing_is_planned_twice_while_others_are_left() -> None:
    chosen = setting(BALLBAR, candidates=30)
    known = told(chosen, candidates(chosen))
    score = score_of("A", known, known.where(chosen.named))
    indices = choose(known, known.prior, score, 20).indices
    assert len(set(indices)) == 20
    assert list(indices) == sorted(indices)
