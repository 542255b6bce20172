"""Chosen designs against optimal designs that are known, and against all designs tried one by one."""

from __future__ import annotations

from collections import Counter
from functools import partial
from itertools import combinations

import numpy as np
import pytest

from cmm_uq.analysis.planning.candidates import Information, candidates, set_up_information
from cmm_uq.analysis.planning.exchange import choose, score_of
from cmm_uq.analysis.planning.set_up import join
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.points import Floats
from cmm_uq.jobs.tables.artefact import ArtefactFacts
from cmm_uq.machine.model.measurement import ARTEFACT
from cmm_uq.maths.inference.linear_model import Unknown
from tests.analysis.planning.plans import BALLBAR, GAUGE, setting

PLACES = np.linspace(-1, 1, 21)


def quadratic() -> Information:
    """One reading a place of a + b·x + c·x², the noise so small that priors do not count."""
    rows = 1e4 * np.column_stack([np.ones(21), PLACES, PLACES**2])
    unknowns = tuple(Unknown((name, name), "", 0.0, 1.0, 1.0) for name in ("a", "b", "c"))
    return Information(unknowns, rows[:, :, None] * rows[:, None, :], np.zeros((3, 3)))


def taken(known: Information, criterion: str, count: int) -> Counter[float]:
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
    known = set_up_information(chosen, candidates(chosen))
    score = score_of(criterion, known, [0, 1, 2])
    start = known.prior
    every = np.array(
        [float(score((start + known.each[list(some)].sum(axis=0))[None])[0]) for some in combinations(range(12), 3)]
    )
    found = choose(known, start, score, 3)
    assert found.after == pytest.approx(float(score((start + known.each[list(found.indices)].sum(axis=0))[None])[0]))
    assert np.mean(every < found.after - 1e-9) < 0.02


def three(*, length: bool = False) -> Information:
    """Three effects, and the length of an artefact beside them."""
    unknowns = [Unknown((name, name), "", 0.0, 1.0, 1.0) for name in ("a", "b", "c")]
    more = [Unknown((ARTEFACT, "length_mm"), "mm", 400.0, 0.1, 0.1)] * length
    k = 3 + length
    return Information((*unknowns, *more), np.zeros((0, k, k)), np.zeros((k, k)))


@pytest.mark.parametrize(
    ("criterion", "targets", "score"),
    [
        ("A", [0, 1, 2], np.log((1 / 2 + 1 / 4 + 1) / 3)),
        ("A", [0, 1], np.log((1 / 2 + 1 / 4) / 2)),
        ("worst", [0, 1, 2], np.log(1.0)),
        ("worst", [1, 0], np.log(1 / 2)),
        ("D", [0, 1, 2], np.log(1 / 8) / 3),
        ("D", [1], np.log(1 / 4)),
    ],
)
def test_criteria_of_variances_worked_by_hand(criterion: str, targets: list[int], score: float) -> None:
    """Information 1, 3 and 0 with a prior variance of one: variances ½, ¼ and 1."""
    found = score_of(criterion, three(), targets)(np.diag([1.0, 3.0, 0.0])[None])
    assert found == pytest.approx([score], abs=1e-12)


def test_what_is_no_effect_has_no_prior_and_is_fitted() -> None:
    """With a length that looks like the first effect as well as it can, the prior variance alone is left of that."""
    information = np.diag([1.0, 3.0, 0.0, 1.0])
    information[0, 3] = information[3, 0] = 1.0
    found = score_of("worst", three(length=True), [0])(information[None])
    assert found == pytest.approx([0.0], abs=1e-9)
    assert score_of("worst", three(length=True), [1])(information[None]) == pytest.approx([np.log(1 / 4)])


def test_the_separation_of_a_pair_by_hand() -> None:
    """Cosine 0.8, and a thousandth so that a pair that is one keeps finite: −ln(1 − 0.64 + 0.001)."""
    pair = np.array([[100.0, -80.0, 0.0], [-80.0, 100.0, 0.0], [0.0, 0.0, 50.0]])
    assert score_of("separation", three(), [0, 1])(pair[None]) == pytest.approx([-np.log(0.361)])
    assert score_of("separation", three(), [0, 1, 2])(pair[None]) == pytest.approx(
        [-(np.log(0.361) + 2 * np.log(1.001)) / 3]
    )
    hidden = np.array([[100.0, 0.0, 50.0], [0.0, 100.0, 50.0], [50.0, 50.0, 50.0]])
    # less what the third takes, ½ of 100 each and −50 between: cosine one
    assert score_of("separation", three(), [0, 1])(hidden[None]) == pytest.approx([-np.log(0.001)], rel=1e-6)


def test_a_placing_more_never_makes_the_uncertainty_larger() -> None:
    chosen = setting(BALLBAR, candidates=40)
    known = set_up_information(chosen, candidates(chosen))
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
    known = set_up_information(chosen, candidates(chosen))
    score = score_of("A", known, known.where(chosen.named))
    indices = choose(known, known.prior, score, 20).indices
    assert len(set(indices)) == 20
    assert list(indices) == sorted(indices)


def drawn(seed: int) -> Information:
    """Thirty candidates, each of two readings of four effects, larger and smaller."""
    random = np.random.default_rng(seed)
    rows = random.standard_normal((30, 2, 4)) * random.uniform(0.1, 3.0, (30, 1, 1))
    unknowns = tuple(Unknown((name, name), "", 0.0, 1.0, 1.0) for name in "abcd")
    return Information(unknowns, rows.swapaxes(1, 2) @ rows, np.zeros((4, 4)))


@pytest.mark.parametrize("criterion", ["D", "A", "worst", "separation"])
@pytest.mark.parametrize("again", [False, True])
def test_no_single_exchange_makes_a_choice_better(criterion: str, again: bool) -> None:
    for seed in range(8):
        known = drawn(seed)
        score = score_of(criterion, known, [0, 1, 2, 3])
        found = choose(known, known.prior, score, 6, again=again)
        assert len(found.indices) == 6
        assert found.before == pytest.approx(float(score(known.prior[None])[0]))
        whole = known.each[list(found.indices)].sum(axis=0)
        assert found.after == pytest.approx(float(score(whole[None])[0]))
        for one in found.indices:
            others = [i for i in range(30) if again or i not in found.indices]
            assert np.all(score(whole - known.each[one] + known.each[others]) >= found.after - 1e-6)


def test_where_no_placing_alone_helps_the_one_that_tells_most_is_taken_first() -> None:
    """Two effects, each of which shows in one placing only: neither placing alone parts them."""
    rows = np.array([[1e-3, 0.0], [0.0, 1e-3], [30.0, 0.0], [0.0, 20.0]])
    unknowns = tuple(Unknown((name, name), "", 0.0, 1.0, 1.0) for name in "ab")
    known = Information(unknowns, rows[:, :, None] * rows[:, None, :], np.zeros((2, 2)))
    found = choose(known, known.prior, score_of("separation", known, [0, 1]), 2)
    assert found.indices == (2, 3)
    assert found.before == pytest.approx(-np.log(0.001))


def test_more_placings_than_candidates_take_some_again() -> None:
    known = drawn(3)
    score = score_of("A", known, [0, 1, 2, 3])
    assert len(choose(known, known.prior, score, 31).indices) == 31


@pytest.mark.parametrize("criterion", ["D", "A", "worst"])
@pytest.mark.parametrize(("facts", "count"), [(BALLBAR, 4), (BALLBAR, 20), (GAUGE, 6)])
def test_hopeless_candidates_are_not_missed(criterion: str, facts: ArtefactFacts, count: int) -> None:
    """Against a search that looks at all of them every time: the same set-ups."""
    chosen = setting(facts, candidates=90, **({} if facts is BALLBAR else {"length_mm": 820.0}))
    possible = candidates(chosen)
    known = set_up_information(chosen, possible, chosen.rivals(join(possible[:2])))
    score = score_of(criterion, known, known.where(chosen.named))
    found, every = (choose(known, known.prior, one, count) for one in (score, partial(score)))
    assert found.indices == every.indices
    assert found.after == every.after


@pytest.mark.parametrize("criterion", ["D", "A", "worst"])
@pytest.mark.parametrize("again", [False, True])
def test_of_few_combinations_each_the_search_is_the_same(criterion: str, again: bool) -> None:
    """Of candidates with one reading of twelve effects each, two of which are the same."""
    for seed in range(6):
        rows = np.random.default_rng(seed).standard_normal((60, 1, 12))
        rows[7] = rows[31]
        unknowns = tuple(Unknown((name, name), "", 0.0, 1.0, 1.0) for name in "abcdefghijkl")
        known = Information(unknowns, rows.swapaxes(1, 2) @ rows, np.zeros((12, 12)))
        score = score_of(criterion, known, [0, 1, 2, 5])
        found, every = (choose(known, known.prior, one, 9, again=again) for one in (score, partial(score)))
        assert found.indices == every.indices
        assert found.after == every.after
