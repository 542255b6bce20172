"""Every standard and characteristic by every rule: inside, a hundredth of u on either side of each turn, outside, incomplete,
copied, without u, one repeat out. What must come out is worked here, from the normal distribution of SciPy alone.

Values lie twenty u or more from the limit on the other side, so each rule turns at so many u from the limit.
"""

from __future__ import annotations

import itertools
import pickle
from functools import cache

import pytest
from scipy import stats

from cmm_uq.analysis.conformity import own_rule, positioning
from cmm_uq.analysis.conformity.positioning import uncertainty_of_figures
from cmm_uq.analysis.conformity.standards import BUILT_IN, statement
from cmm_uq.analysis.conformity.statement import Statement
from cmm_uq.base.errors import CmmUqError
from cmm_uq.jobs.tables.conformity import Circumstances, ConformityFacts, FalseAccept, GuardBand, Prior, Rule
from cmm_uq.machine.model.kind import BARS, FORMS, LENGTHS, POSITIONING
from cmm_uq.maths.geometry.positioning import PositioningRuns
from tests.analysis.conformity.tests_by_hand import TESTS, Hand, by_hand

P95, P98 = float(stats.norm.ppf(0.95)), float(stats.norm.ppf(0.98))
FLAT = Prior(sd_um=1e5)
"""So wide that it says nothing: the posterior is that of the measurement, and hardly any item is near its limit."""

TURNS: dict[str, tuple[Rule, list[tuple[float, str]]]] = {
    "simple": ("simple", [(0.0, "pass"), (-99.0, "fail")]),
    "ASME B89.7.3.1": ("ASME B89.7.3.1", [(0.0, "pass"), (-99.0, "fail")]),
    "ISO 14253-1": ("ISO 14253-1", [(P95, "pass"), (-P95, "undecided"), (-99.0, "fail")]),
    "guard band": (GuardBand(guard_band=1.0), [(2.0, "pass"), (-2.0, "undecided"), (-99.0, "fail")]),
    "false accept": (FalseAccept(max_false_accept=0.02), [(P98, "pass"), (-P98, "undecided"), (-99.0, "fail")]),
    "ILAC binary": ("ILAC-G8:09/2019 binary", [(2.0, "pass"), (-99.0, "fail")]),
    "ILAC non-binary": ("ILAC-G8:09/2019 non-binary", [
        (2.0, "pass"), (0.0, "conditional pass"), (-2.0, "conditional fail"), (-99.0, "fail"),
    ]),
    "JCGM 106": ("JCGM 106:2012", [(P95, "pass"), (-P95, "undecided"), (-99.0, "fail")]),
    "Z540.3": ("ANSI/NCSL Z540.3-2006", [(0.0, "pass"), (-99.0, "fail")]),
}  # fmt: skip
"""By rule: from how many u of room on, what follows."""

CASES = [(*test, rule) for test, rule in itertools.product(TESTS, TURNS)]
AGAIN = {"E0", "E150"}
OF_ARMS = ("L_Dia", "SPAT", "SPAT maximum", "AP", "RP", "AP_a", "AP_b", "AP_c", "RP_a", "RP_b", "RP_c")


def expected(rule: str, room: float) -> str:
    return next(outcome for least, outcome in TURNS[rule][1] if room >= least)


def rooms(rule: str) -> list[float]:
    """Well inside, a hundredth of u on either side of each turn, well outside; in u."""
    turns = [least for least, _ in TURNS[rule][1][:-1]]
    return [10.0, *(turn + side for turn in turns for side in (0.01, -0.01)), -8.0]


def judged(hand: Hand, standard: str, characteristic: str, rule: str, room: float) -> Statement:
    limit = abs(hand.value) + room * hand.u
    wish = ConformityFacts(
        standard=standard, characteristic=characteristic, limit_um=limit, rule=TURNS[rule][0], prior=FLAT
    ).model_copy(update={"complete": hand.complete})
    return statement(
        wish,
        hand.artefact,
        hand.accuracy,
        "[[conformity]] 1",
        (BARS, FORMS, LENGTHS, POSITIONING, "FR", "FT", "FA", *OF_ARMS, *own_rule.FIGURES),
        None,
        hand.circumstances,
    )


@pytest.fixture(autouse=True)
def drawn_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """The uncertainty of one recording's figures, against whatever limit."""
    monkeypatch.setattr(positioning, "uncertainty_of_figures", spread_once)


@cache
def spread_of(inputs: bytes) -> dict[str, float]:
    return uncertainty_of_figures(*pickle.loads(inputs))


def spread_once(runs: PositioningRuns, under: Circumstances) -> dict[str, float]:
    return spread_of(pickle.dumps((runs, under)))


def test_every_characteristic_of_every_standard_is_in_the_grid() -> None:
    assert set(TESTS) == {(name, one.name) for name, standard in BUILT_IN.items() for one in standard.characteristics}


@pytest.mark.long(but="ISO 14253-1")
@pytest.mark.parametrize(("standard", "characteristic", "rule"), CASES)
def test_a_complete_test_turns_where_its_rule_does(standard: str, characteristic: str, rule: str) -> None:
    hand = by_hand(standard, characteristic, "complete")
    for room in rooms(rule):
        found = judged(hand, standard, characteristic, rule, room)
        assert found.missing == ()
        assert found.outcome == expected(rule, room), room
        assert (found.value_um, found.u_um) == (pytest.approx(abs(hand.value), abs=2e-5), pytest.approx(hand.u))


@pytest.mark.long(but="ISO 14253-1")
@pytest.mark.parametrize("how", ["incomplete", "copied"])
@pytest.mark.parametrize(("standard", "characteristic", "rule"), CASES)
def test_what_is_missing_or_copied_makes_no_pass(standard: str, characteristic: str, rule: str, how: str) -> None:
    hand = by_hand(standard, characteristic, how)
    for room in (*rooms(rule)[:3], -8.0):
        found = judged(hand, standard, characteristic, rule, room)
        assert found.scope == "partial"
        alone = expected(rule, room)
        assert found.outcome == ("incomplete" if alone in ("pass", "conditional pass") else alone), room


@pytest.mark.parametrize(("standard", "characteristic", "rule"), CASES)
def test_without_an_uncertainty_only_simple_acceptance_decides(standard: str, characteristic: str, rule: str) -> None:
    if characteristic == "volumetric performance":
        pytest.skip("it falls back on the scatter of the recording; see test_standards.py")
    if own_rule.FIGURES.get(characteristic, ("", "", None))[2] == own_rule.EVALUATED:
        pytest.skip("its u is that of the evaluation, which always has one")
    hand = by_hand(standard, characteristic, "no u")
    if rule != "simple":
        keys = "u_um|u_blocks_um( and u_cylinders_um)?|u_repeat_um|form_um|u_scale_um_per_m|u_bar_um|u_[a-z]*_arcsec"
        states_none = rf"needs the uncertainty.*states no ({keys}) above 0"
        with pytest.raises(CmmUqError, match=states_none):
            judged(hand, standard, characteristic, rule, 10.0)
        return
    for room in (10.0, 0.01, -0.01, -8.0):
        found = judged(hand, standard, characteristic, rule, room)
        assert found.finding == ("pass" if room > 0 else "fail")
        assert found.outcome == ("incomplete" if room > 0 else "fail")
        assert any(text.startswith("uncertainty: ") for text in found.missing)
        assert (found.decision.probability_conforming, found.joint) == (None, None)


@pytest.mark.long(but="ISO 14253-1")
@pytest.mark.parametrize(("standard", "characteristic", "rule"), [
    case for case in CASES if case[1] in {*AGAIN, "U1", "U2", "U3", "linear displacement accuracy", "bidirectional length"}
])  # fmt: skip
def test_one_repeat_out_is_measured_again_where_the_standard_says_so(
    standard: str, characteristic: str, rule: str
) -> None:
    hand = by_hand(standard, characteristic, "one repeat out")
    for room in rooms(rule):
        alone = expected(rule, room)
        outside = alone in ("fail", "conditional fail")
        wanted = "remeasure" if outside and characteristic in AGAIN else alone
        assert judged(hand, standard, characteristic, rule, room).outcome == wanted, room
