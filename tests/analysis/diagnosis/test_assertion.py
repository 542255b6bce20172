"""What keeps a probable effect from being asserted: each reason by draws and combinations that have it or have it not."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from cmm_uq.analysis.diagnosis import diagnosis, joint
from cmm_uq.analysis.diagnosis.asserted import OmittedEffect
from cmm_uq.analysis.diagnosis.comparison import search
from cmm_uq.analysis.diagnosis.comparison.combinations import Combination, Combinations
from cmm_uq.analysis.diagnosis.comparison.conditional import Version
from cmm_uq.analysis.diagnosis.comparison.explanations import EFFECT, UNKNOWN, Explanation, Member
from cmm_uq.analysis.diagnosis.comparison.search import ModelComparison, SearchResult, effects_to_assert, substitute
from cmm_uq.analysis.diagnosis.held_out import Improvement
from cmm_uq.analysis.diagnosis.joint import HOLDS_ZERO, WithheldEffect, _holds_zero, _phase_known, group_of
from cmm_uq.base.messages import say
from cmm_uq.base.units import unit
from cmm_uq.certificate.diagnosis.overview import sentence
from cmm_uq.machine.physics.effect import Nonparametric
from cmm_uq.maths.uncertainty.quantity import Quantity
from tests.analysis.diagnosis.test_invariance import diagnosed, recording

DRAWS = np.random.default_rng(2).standard_normal((20_000, 2))


@pytest.mark.parametrize(("away", "holds"), [(1.9, True), (2.02, False), (-2.02, False)])
def test_an_interval_of_95_percent_reaches_two_standard_deviations(away: float, *, holds: bool) -> None:
    assert _holds_zero(DRAWS[:, :1] + away) is holds


@pytest.mark.parametrize(("away", "holds"), [(2.40, True), (2.50, False)])
def test_a_region_of_two_coefficients_reaches_the_root_of_chi_squared(away: float, *, holds: bool) -> None:
    """√χ²(0.95; 2) = 2.448, in whatever direction and scale."""
    root = np.array([[3.0, 1.0], [0.0, 0.2]])
    assert _holds_zero((DRAWS + away * np.array([0.6, -0.8])) @ root) is holds


@pytest.mark.parametrize(("away", "known"), [(1.5, False), (1.8, True)])
def test_a_phase_is_known_where_95_percent_lie_within_half_a_turn(away: float, *, known: bool) -> None:
    """Of a normal distribution 95 % lie beyond −1.645 standard deviations."""
    assert _phase_known(DRAWS + np.array([away, 0.0])) is known


def combinations(*members: tuple[tuple[int, ...], float]) -> Combinations:
    member = (Member(np.ones((3, 1))),)
    term = Nonparametric("x_mm", "y")
    explanations = [
        *(Explanation(say(name), EFFECT, member, imitated_by=(term,)) for name in ("one", "two", "three")),
        Explanation(say("function"), UNKNOWN, member, term=term),
    ]
    return Combinations(explanations, {frozenset(key): Combination((), float(np.log(p))) for key, p in members})


def test_a_group_is_what_could_stand_in_the_place_of_an_effect() -> None:
    found = combinations(((0,), 0.45), ((1,), 0.4), ((2,), 0.005), ((3,), 0.145))
    assert group_of(found, frozenset({0}), 0) == {1}
    assert found.of_any(frozenset({0, 1})) == pytest.approx(0.85)


def test_effects_that_no_combination_has_together_keep_the_version_that_each_has() -> None:
    found = combinations(((0, 1), 0.6), ((2,), 0.3), ((0,), 0.1))
    own = {key: tuple(Version(i, 0, 1.0 + i + 10 * len(key)) for i in sorted(key)) for key in found.by_key}
    known = replace(found, by_key={key: replace(one, versions=own[key]) for key, one in found.by_key.items()})
    assert known.versions(frozenset({0})) == own[frozenset({0, 1})]
    assert known.versions(frozenset({0, 1, 2})) == (*own[frozenset({0, 1})], *own[frozenset({2})])


def test_a_function_belongs_to_it_where_effects_alone_are_no_more_than_one_half() -> None:
    found = combinations(((0,), 0.3), ((2,), 0.005), ((3,), 0.695))
    assert group_of(found, frozenset({0}), 0) == {3}


def test_what_was_never_compared_by_itself_has_none_in_its_place() -> None:
    """Two effects found together, of which one is withheld: the other alone is no combination."""
    found = combinations(((0, 1), 0.7), ((1,), 0.2), ((2,), 0.1))
    assert group_of(found, frozenset({0}), 0) == frozenset()
    assert substitute(found_with(((0, 1), 0.7), ((1,), 0.3), chosen=frozenset({0})), 0, frozenset({0})) is None


def test_effects_that_a_function_could_be_are_named_with_it_one_after_the_other() -> None:
    """The most probable effects; the second by what it has where the first is found, 0.25 of 0.3."""
    found = combinations(((3,), 0.65), ((0, 1), 0.25), ((0,), 0.05), ((2,), 0.05))
    assert effects_to_assert(found) == {0, 1}
    assert effects_to_assert(combinations(((3,), 0.65), ((0, 1), 0.04), ((0,), 0.26), ((2,), 0.05))) == {0}
    assert effects_to_assert(combinations(((3,), 0.78), ((0,), 0.12), ((2,), 0.1))) == {0}, (
        "by 0.22 with what cannot be told from it"
    )
    assert effects_to_assert(combinations(((3,), 0.82), ((0,), 0.1), ((2,), 0.08))) == frozenset(), "improbable even so"


def test_effects_that_a_function_could_not_be_are_not_named_with_it() -> None:
    found = combinations(((3,), 0.65), ((0,), 0.3), ((2,), 0.05))
    strange = [replace(e, imitated_by=()) for e in found.explanations]
    assert effects_to_assert(found) == {0}
    assert effects_to_assert(replace(found, explanations=strange)) == frozenset()
    assert effects_to_assert(replace(found, explanations=strange, imitated={0: frozenset({3})})) == {0}, (
        "as this recording shows it"
    )


def found_with(*members: tuple[tuple[int, ...], float], chosen: frozenset[int]) -> SearchResult:
    of = combinations(*members)
    first = SimpleNamespace(explanations=of.explanations, families=[], p_value=0.0, by_rearrangement=0.0)
    none: Any = None
    return SearchResult(cast("ModelComparison", first), none, of, chosen, (), none, 0.0)


@pytest.mark.parametrize(
    ("each", "instead"),
    [((0.36, 0.3, 0.25, 0.09), 1), ((0.36, 0.19, 0.05, 0.4), None), ((0.2, 0.24, 0.05, 0.51), None)],
    ids=["next most probable", "too improbable to be named", "no half with all that cannot be told from it"],
)
def test_in_place_of_an_effect_of_open_size_stands_the_next_that_cannot_be_told_from_it(
    monkeypatch: pytest.MonkeyPatch, each: tuple[float, ...], instead: int | None
) -> None:
    """One fifth to be named, one half with its group, as any; the last of them is a function."""
    of = found_with(*(((i,), p) for i, p in enumerate(each)), chosen=frozenset({0}))
    monkeypatch.setattr(search, "_of", lambda first, own, chosen, stated: replace(of, chosen=chosen))
    other = substitute(of, 0, frozenset({0}))
    assert (None if other is None else other[1]) == instead
    assert other is None or other[0].chosen == {instead}
    assert substitute(of, 0, frozenset({0, 1, 2})) is None, "each is tried once"


def asserted(monkeypatch: pytest.MonkeyPatch, start: SearchResult, **further: Any) -> tuple[SearchResult, list[str]]:
    """What is chosen in the end, and what is withheld, in turn; nothing is sampled."""
    stubs: dict[str, Any] = {
        "withhold_unresolved": lambda found: (found, ()), "_of_all": lambda found, _model: found,
        "joint_posterior": lambda *_: None, "doubted": lambda _found: ({}, False), "least_supported": lambda _found: {},
        "withhold": lambda found, gone: replace(found, chosen=found.chosen - gone),
    }  # fmt: skip
    for name, stub in (stubs | further).items():
        monkeypatch.setattr(diagnosis if hasattr(diagnosis, name) else joint, name, stub)
    found, _, withheld, _ = diagnosis._asserted(start, cast("Any", None), 0, None, None)
    return found, [each.effect for each in withheld]


def test_what_is_doubted_does_not_come_back_in_the_place_of_another(monkeypatch: pytest.MonkeyPatch) -> None:
    """The size of 0 is open; 1, the next in its place, has another form."""
    start = found_with(((0,), 0.45), ((1,), 0.4), ((2,), 0.1), ((3,), 0.05), chosen=frozenset({0, 1}))

    def of(found: SearchResult, number: int) -> dict[int, WithheldEffect]:
        return {i: WithheldEffect(str(i), say("one"), 0.4, HOLDS_ZERO) for i in found.chosen if i == number}

    monkeypatch.setattr(search, "_of", lambda first, own, chosen, stated: replace(start, chosen=chosen))
    found, withheld = asserted(
        monkeypatch, start, doubted=lambda now: (of(now, 1), False), effects_without_size=lambda now, _joint: of(now, 0)
    )
    assert (found.chosen, withheld) == (frozenset(), ["1", "0"])


def test_where_no_size_of_a_group_is_known_the_most_probable_is_withheld(monkeypatch: pytest.MonkeyPatch) -> None:
    """0.45, 0.40 and 0.10 in its place: the third is improbable, the second's size is open as well."""
    start = found_with(((0,), 0.45), ((1,), 0.4), ((2,), 0.1), ((3,), 0.05), chosen=frozenset({0}))
    seen = []

    def open_size(found: SearchResult, _joint: object) -> dict[int, WithheldEffect]:
        seen.append(set(found.chosen))
        return {i: WithheldEffect(str(i), say("one"), 0.4, HOLDS_ZERO) for i in found.chosen}

    monkeypatch.setattr(search, "_of", lambda first, own, chosen, stated: replace(start, chosen=chosen))
    found, withheld = asserted(monkeypatch, start, effects_without_size=open_size)
    assert seen == [{0}, {1}, set()]
    assert (found.chosen, withheld) == (frozenset(), ["0"])


def test_of_effects_whose_sizes_are_open_together_the_least_probable_goes_first(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Three that nearly are one: without the least probable the sizes of the two others are known."""
    start = found_with(((0, 1, 2), 0.9), ((3,), 0.1), chosen=frozenset({0, 1, 2}))
    probability = {0: 0.97, 1: 0.96, 2: 0.78}

    def open_size(found: SearchResult, _joint: object) -> dict[int, WithheldEffect]:
        listed = found.chosen if len(found.chosen) > 2 else ()
        return {i: WithheldEffect(str(i), say("one"), probability[i], HOLDS_ZERO) for i in listed}

    found, withheld = asserted(monkeypatch, start, effects_without_size=open_size, substitute=lambda *_: None)
    assert (found.chosen, withheld) == (frozenset({0, 1}), ["2"])


@pytest.mark.long
def test_what_held_out_placings_do_not_bear_out_is_said_to_be_withheld(monkeypatch: pytest.MonkeyPatch) -> None:
    """By a comparison that finds no gain; what remains is a function of the sense of motion."""
    monkeypatch.setattr(diagnosis, "improvement", lambda *_: Improvement(4.0, 1.0, 4.0, 4.0, 0.5, 1.0))
    found = diagnosed(recording())
    assert (found.verdict, found.effects) == ("empirical", ())
    (withheld,) = found.withheld
    assert withheld.effect == "hysteresis_x"
    assert "does not predict set-ups that the fit had not seen" in withheld.why


@pytest.mark.parametrize(("probability", "named"), [(0.37, True), (0.72, True), (0.93, False)])
def test_an_effect_that_is_named_by_its_group_is_named_with_it(probability: float, named: bool) -> None:
    """From 0.9 on it is named by itself."""
    size = Quantity(12.0, 1.7, (8.6, 15.4), unit("µm"))
    gain = Improvement(4.0, 1.0, 4.0, 1.0, 9.0, 1.0)
    item = OmittedEffect(
        "straightness_x_z",
        say("Straightness"),
        probability,
        {"bow_um": size},
        0.8,
        0.96,
        say("a way"),
        (say("scale_x"),),
    )
    with_it = "96 % that it is this or one that this recording cannot tell from it: Scale error of X;"
    assert (with_it in sentence(item, gain).replace("\u00a0", " ")) == named
