"""Probabilities beforehand, against sums over all combinations and integrals over how readily effects act."""

from __future__ import annotations

import itertools
from collections.abc import Iterable
from dataclasses import replace

import numpy as np
import pytest
from scipy import integrate, stats

from cmm_uq.analysis.diagnosis.comparison.combinations import (
    EFFECTS,
    OUT_OF_ADJUSTMENT,
    READILY,
    UNKNOWNS,
    CombinationPrior,
    with_two_more,
)
from cmm_uq.analysis.diagnosis.comparison.explanations import EFFECT, SEVERAL, UNKNOWN, Explanation, Member
from cmm_uq.machine.physics.catalogue import every

MEMBER = (Member(np.ones((3, 1))),)
MACHINE = ("scale_x", "scale_y", "scale_z", "squareness_xy", "squareness_yz", "squareness_zx")
OTHERS = ("straightness_x_y", "rotation_x_z", "straightness_y_z")
MANY = (0.4, 0.2, 0.1, 0.08, 0.06, 0.05, 0.04, 0.03, 0.02, 0.01, 0.01)
"""Of none to ten effects, as many as there are in these tests."""


def explanations(*names: str, weight: float = 1.0) -> list[Explanation]:
    known = [Explanation(name, EFFECT, MEMBER, weight=weight, effect=every()[name], together=every()[name].everywhere)
             for name in names]  # fmt: skip
    return [*known, Explanation("function", UNKNOWN, MEMBER)]


def subsets(count: int) -> Iterable[tuple[int, ...]]:
    return itertools.chain.from_iterable(itertools.combinations(range(count), r) for r in range(count + 1))


@pytest.mark.parametrize("weight", [0.3, 1.0, 2.0])
def test_all_combinations_together_have_probability_one(weight: float) -> None:
    """The counts sum to one, but for two unknown functions, where there is one."""
    twins = explanations("artefact_scale_x", "artefact_squareness_xy", weight=weight)[:2]
    listed = [*explanations(*MACHINE, "straightness_x_y", "rotation_x_z"), *twins]
    prior = CombinationPrior(listed, MANY)
    by_themselves = sum(MANY[: len(listed)])  # as many effects as there are
    of_rest = sum(MANY[:3])  # those that are no scale and no squareness
    expected = (1 - OUT_OF_ADJUSTMENT) * by_themselves + OUT_OF_ADJUSTMENT * of_rest
    total = sum(np.exp(prior.log(key)) for key in subsets(len(listed)))
    assert total == pytest.approx(expected * sum(UNKNOWNS[:2]), rel=1e-12)


def test_without_scales_and_squarenesses_it_is_by_counts_and_weights_alone() -> None:
    listed = explanations(*OTHERS)
    listed[1] = replace(listed[1], weight=0.1)
    prior = CombinationPrior(listed)
    total = sum(np.exp(prior.log(key)) for key in subsets(len(listed)))
    assert total == pytest.approx(sum(EFFECTS[:4]) * sum(UNKNOWNS[:2]))
    assert prior.log({1}) == pytest.approx(prior.log({0}) + np.log(0.1))
    assert prior.log(()) == pytest.approx(np.log(EFFECTS[0] * UNKNOWNS[0]))


@pytest.mark.parametrize("acting", range(7))
def test_scales_and_squarenesses_of_a_machine_act_as_readily_as_one_another(acting: int) -> None:
    """Against the integral of p^k (1 − p)^(6 − k) over the beta distribution of p, and the product of the other way."""
    counts = with_two_more(with_two_more(EFFECTS))
    prior = CombinationPrior(explanations(*MACHINE, *OTHERS), counts)
    density = stats.beta(*READILY).pdf
    together, _ = integrate.quad(lambda p: density(p) * p**acting * (1 - p) ** (6 - acting), 0, 1)
    alone = counts[acting] / len(list(itertools.combinations(range(9), acting)))
    expected = (1 - OUT_OF_ADJUSTMENT) * alone + OUT_OF_ADJUSTMENT * together * counts[0]
    assert prior.log(range(acting)) == pytest.approx(np.log(expected * UNKNOWNS[0]), rel=1e-9)


def test_what_a_recording_does_not_show_changes_no_odds_of_those_that_it_shows() -> None:
    """Six of which two are seen: the others are summed over, which leaves the integral over p of those two."""
    listed = explanations(*MACHINE)
    seen, every_one = (
        CombinationPrior(listed, EFFECTS, {0, 3, 6}),
        CombinationPrior(listed, with_two_more(with_two_more(EFFECTS))),
    )
    for key in ((), (0,), (0, 3)):
        summed = sum(
            np.exp(every_one._of_machine[len(key) + len(more)])
            for r in range(5) for more in itertools.combinations((1, 2, 4, 5), r)
        )  # fmt: skip
        assert np.exp(seen._of_machine[len(key)]) == pytest.approx(summed)


def test_errors_of_an_artefact_are_as_probable_together_as_its_weight_says() -> None:
    """With twice the weight of the machine, the odds of any error to none are twice those of the machine."""
    own = [f"artefact_{name}" for name in ("scale_x", "scale_y", "squareness_xy")]
    for weight in (0.3, 2.0):
        listed = [*explanations(*MACHINE)[:6], *explanations(*own, weight=weight)]
        prior = CombinationPrior(listed, MANY, {0, 1, 3, 6, 7, 8, 9})
        machine, artefact = (np.exp(part) for part in (prior._of_machine, prior._of_artefact))
        ways = np.array([1, 3, 3, 1])
        assert ways @ artefact == pytest.approx(1)
        assert ways[1:] @ artefact[1:] / artefact[0] == pytest.approx(weight * (ways[1:] @ machine[1:]) / machine[0])
        assert artefact[2] / artefact[1] == pytest.approx(machine[2] / machine[1])


def test_a_machine_out_of_adjustment_is_more_probable_than_six_coincidences() -> None:
    """Beside thirty effects that act by themselves; a single one is as probable as if all did so, to a fifth."""
    counts = with_two_more(with_two_more(EFFECTS))
    others = [name for name, effect in every().items() if not effect.of_artefact and name not in MACHINE][:24]
    listed = explanations(*MACHINE, *others)
    prior, alone = (
        CombinationPrior(each, counts)
        for each in (listed, [replace(explanation, effect=None) for explanation in listed])
    )
    assert prior.log(range(6)) - alone.log(range(6)) > np.log(1000)
    assert prior.log({0}) == pytest.approx(alone.log({0}), abs=0.2)
    assert prior.log({6}) == pytest.approx(alone.log({6}), abs=0.2)


def test_several_effects_at_once_are_no_combination_and_more_than_are_counted_is_none() -> None:
    several = Explanation("several", SEVERAL, MEMBER)
    prior = CombinationPrior([*explanations("scale_x", *OTHERS, "straightness_y_x"), several])
    assert prior.log({6}) == -np.inf
    assert prior.log(range(5)) == -np.inf
    assert np.isfinite(prior.log(range(4)))


def test_where_the_job_names_some_of_them_the_others_act_by_themselves() -> None:
    """As without any that belong together; that a recording does not show some is another matter."""
    listed = explanations(*MACHINE[1:], *OTHERS)
    prior, alone = (
        CombinationPrior(listed),
        CombinationPrior([replace(explanation, effect=None) for explanation in listed]),
    )
    assert not prior.machine
    assert [prior.log(range(k)) for k in range(5)] == pytest.approx([alone.log(range(k)) for k in range(5)])
    assert CombinationPrior(explanations(*MACHINE, *OTHERS), EFFECTS, {1, 2, 6}).machine == {1, 2}


def test_sizes_of_one_order_of_magnitude_are_more_probable_together() -> None:
    """Each beyond the first is one of three sizes in place of one of seven; of one effect nothing changes."""
    prior = CombinationPrior(explanations(*MACHINE), with_two_more(with_two_more(EFFECTS)))
    assert prior.log({0}, alike=True) == prior.log({0})
    spread, alike = (prior.log(range(6), alike=each) for each in (False, True))
    assert spread < alike < spread + 5 * np.log(7 / 3)
    # what acts by itself beside them is as probable in both
    by_itself = np.log((1 - OUT_OF_ADJUSTMENT) * with_two_more(with_two_more(EFFECTS))[6] * UNKNOWNS[0])
    together = [np.exp(each) - np.exp(by_itself) for each in (spread, alike)]
    assert together[1] / together[0] == pytest.approx((7 / 3) ** 5)
