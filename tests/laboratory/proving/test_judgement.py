"""What is counted of answers made by hand, whose counts are known."""

from __future__ import annotations

from typing import Any

import pytest

from cmm_uq.jobs.tables.plan import ProveFacts
from cmm_uq.laboratory.proving.cases import ARTEFACT, NOTHING, ONE, OUTSIDE, TWO, Case, HiddenEffect, UnknownCause
from cmm_uq.laboratory.proving.judgement import (
    MET,
    MISSED,
    NAMED,
    NAMED_BESIDE,
    NAMED_GROUPED,
    NAMED_MISSED,
    OPEN,
    STATED,
    JudgedCase,
    ProofJudgement,
    acceptance_figures,
    judge,
)
from cmm_uq.machine.model import Noise

TRUE = {"scale_x.ppm": 3.0}
HOLDS, FAILS = {"scale_x.ppm": [3.1, 2.0, 4.0]}, {"scale_x.ppm": [6.0, 5.0, 7.0]}
BOW = HiddenEffect("straightness_x_y", {"bow_um": 10.0}, 8.0)
WAVE = HiddenEffect("periodic_scale_x", {"amplitude_um": 4.0, "period_mm": 50.0, "phase_rad": 3.1}, 5.0)


def case(kind: str, *hidden: HiddenEffect, noise: str = "own", number: int = 0) -> Case:
    stranger = UnknownCause("step", 5.0, 9.0, 6.0, "rotation_x_z") if kind in (OUTSIDE, ARTEFACT) else None
    return Case(number, kind, noise, Noise(), (), hidden, stranger)


def said(
    verdict: str, *effects: tuple[str, float, dict[str, list[float]]], groups: Any = (), named: Any = HOLDS
) -> dict[str, Any]:
    return {
        "verdict": verdict, "named": named, "groups": groups, "heldout_um": [4.0, 2.0],
        "effects": [{"effect": name, "probability": p, "parameters": parameters} for name, p, parameters in effects],
    }  # fmt: skip


def judged(one: Case, answer: dict[str, Any]) -> JudgedCase:
    return judge(one, answer, TRUE, lambda name: name == "artefact_sag")


FOUND = ("straightness_x_y", 0.97, {"bow_um": [10.2, 9.0, 11.0]})
OFF = ("straightness_x_y", 0.9, {"bow_um": [12.0, 11.5, 12.5]})
TWIN = ("rotation_x_z", 0.6, {"arcsec_per_m": [1.0, 0.5, 1.5]})


@pytest.mark.parametrize(("one", "answer", "found", "alone", "wrong", "right"), [
    (case(NOTHING), said("consistent"), 0, 0, 0, True),
    (case(NOTHING), said("unexplained"), 0, 0, 0, False),
    (case(NOTHING), said("explained", TWIN), 0, 0, 1, False),
    (case(ONE, BOW), said("explained", FOUND), 1, 1, 0, True),
    (case(ONE, BOW), said("explained", FOUND, groups=[["straightness_x_y", "rotation_x_z"]]), 1, 0, 0, True),
    (case(ONE, BOW), said("explained", TWIN, groups=[["rotation_x_z", "straightness_x_y"]]), 1, 0, 0, True),
    (case(ONE, BOW), said("explained", TWIN), 0, 0, 1, False),
    (case(ONE, BOW), said("explained", FOUND, TWIN), 1, 1, 1, False),
    (case(ONE, BOW), said("partial", FOUND), 1, 1, 0, False),
    (case(ONE, BOW), said("consistent"), 0, 0, 0, False),
    (case(ONE, BOW), said("consistent", groups=[["straightness_x_y", "rotation_x_z"]]), 0, 0, 0, False),
    (case(TWO, BOW, WAVE), said("explained", FOUND), 1, 1, 0, False),
    (case(OUTSIDE), said("unexplained"), 0, 0, 0, True),
    (case(OUTSIDE), said("partial"), 0, 0, 0, True),
    (case(OUTSIDE), said("partial", TWIN), 0, 0, 1, False),
    (case(OUTSIDE), said("consistent"), 0, 0, 0, False),
    (case(ARTEFACT), said("unexplained"), 0, 0, 0, True),
    (case(ARTEFACT), said("explained", ("artefact_sag", 0.9, {})), 0, 0, 0, True),
    (case(ONE, BOW), said("explained", ("artefact_sag", 0.9, {})), 0, 0, 1, False),
    (case(ARTEFACT), said("explained", TWIN), 0, 0, 1, False),
    (case(ARTEFACT), said("consistent"), 0, 0, 0, False),
    (case(ONE, BOW), {"refused": "damaged"}, 0, 0, 0, False),
])  # fmt: skip
def test_a_case_is_judged(one: Case, answer: dict[str, Any], found: int, alone: int, wrong: int, right: bool) -> None:
    got = judged(one, answer)
    assert (len(got.found), len(got.alone), len(got.wrong), got.right) == (found, alone, wrong, right)


def test_intervals_are_counted_by_what_they_are_of() -> None:
    both = judged(case(TWO, BOW, WAVE), said("explained", OFF, ("periodic_scale_x", 0.8, {
        "amplitude_um": [4.1, 3.0, 5.0], "period_mm": [50.0, 49.0, 51.0], "phase_rad": [-3.1, -3.3, -2.9]})))  # fmt: skip
    assert both.intervals == ((STATED, 0, 1), (STATED, 3, 3), (NAMED_BESIDE, 1, 1))  # −3.18 is 3.1 on the circle
    assert judged(case(NOTHING), said("consistent", named=FAILS)).intervals == ((NAMED, 0, 1),)
    assert judged(case(ONE, BOW), said("consistent")).intervals == ((NAMED_MISSED, 1, 1),)
    grouped = judged(case(ONE, BOW), said("explained", TWIN, groups=[["rotation_x_z", "straightness_x_y"]]))
    assert grouped.intervals == ((NAMED_GROUPED, 1, 1),)
    assert judged(case(OUTSIDE), said("unexplained")).intervals == ()


def test_an_interval_without_an_end_is_not_counted() -> None:
    answer = said("consistent", named={"scale_x.ppm": [3.0, None, 4.0]})
    assert judged(case(NOTHING), answer).intervals == ((NAMED, 0, 0),)


def whole() -> ProofJudgement:
    """Ten cases with known counts."""
    return ProofJudgement(tuple(judged(one, answer) for one, answer in (
        (case(NOTHING), said("consistent")),
        (case(NOTHING, noise="white"), said("consistent", named=FAILS)),
        (case(NOTHING), said("unexplained")),
        (case(ONE, BOW), said("explained", FOUND)),
        (case(ONE, BOW), said("explained", TWIN, groups=[["rotation_x_z", "straightness_x_y"]])),
        (case(TWO, BOW, WAVE), said("explained", OFF)),
        (case(OUTSIDE), said("unexplained")),
        (case(OUTSIDE), said("explained", TWIN)),
        (case(ARTEFACT), said("explained", TWIN)),
        (case(ONE, BOW), {"refused": "damaged"}),
    )))  # fmt: skip


def test_rates_are_those_counted_by_hand() -> None:
    found = whole()
    counts = {
        name: (getattr(found, name).count, getattr(found, name).of)
        for name in ("false_alarms", "found", "found_alone", "wrong_names", "right", "recognised", "machine_blamed",
                     "predicts_better", "refused", "coverage")
    }  # fmt: skip
    assert counts == {
        "false_alarms": (1, 3), "found": (3, 5), "found_alone": (2, 5), "wrong_names": (2, 9), "right": (5, 10),
        "recognised": (1, 2), "machine_blamed": (1, 1), "predicts_better": (5, 5), "refused": (1, 10),
        "coverage": (5, 7),
    }  # fmt: skip
    assert found.held_out_ratio == 0.5
    assert found.false_alarms.interval == pytest.approx((0.0084, 0.9057), abs=1e-4)  # 1 of 3, Clopper and Pearson
    assert found.verdicts(ONE) == {"explained": 2, "refused": 1}
    assert [(rate.count, rate.of) for rate in found.by_noise("white")] == [(0, 1), (0, 0), (0, 1)]
    assert [(low, rate.count, rate.of) for low, _, rate in found.in_bins if rate.of] == [(4.5, 0, 1), (6.0, 3, 4)]


def test_an_effect_is_counted_where_it_was_hidden_and_where_it_was_not() -> None:
    rate, wrong = whole().of_effect("straightness_x_y")
    assert (rate.count, rate.of, wrong) == (3, 4, 0)
    assert whole().of_effect("rotation_x_z")[1] == 2


def test_probabilities_of_all_assertions_but_of_a_faulty_artefact() -> None:
    tenths = {one.low: (one.right.count, one.right.of) for one in whole().probabilities}
    assert tenths == {0.6: (0, 2), 0.9: (2, 2)}


def alarms(count: int, of: int) -> ProofJudgement:
    told = [said("unexplained")] * count + [said("consistent")] * (of - count)
    return ProofJudgement(tuple(judged(case(NOTHING), answer) for answer in told))


@pytest.mark.parametrize(("count", "of", "standing", "kept"), [
    (0, 182, OPEN, True), (0, 183, MET, True), (1, 60, OPEN, True), (2, 60, OPEN, False), (5, 60, MISSED, False),
])  # fmt: skip
def test_a_limit_is_kept_or_missed_where_the_whole_interval_says_so(
    count: int, of: int, standing: str, kept: bool
) -> None:
    """Two percent: the upper end of 0 of n is 1 − 0.025^(1/n), below it from 183 on; the lower one of 5 of 60 is 2.8 %."""
    one, _ = acceptance_figures(alarms(count, of), ProveFacts())
    assert (one.key, one.standing, one.kept) == ("false_alarms", standing, kept)


def test_cases_without_an_answer_do_not_make_the_rest_look_good() -> None:
    """Of 200 that hide nothing 183 would show it by themselves; 17 got no answer."""
    answers = [said("consistent")] * 183 + [{"refused": "damaged"}] * 17
    one, _ = acceptance_figures(ProofJudgement(tuple(judged(case(NOTHING), each) for each in answers)), ProveFacts())
    assert (one.rate.count, one.rate.of, one.standing) == (17, 200, MISSED)


def test_further_figures_are_asked_for_where_they_are_stated() -> None:
    facts = ProveFacts(wrong_names_pct=20.0, found_pct=90.0)
    keys = {one.key: (one.low, one.high, one.rate.count) for one in acceptance_figures(whole(), facts)}
    assert keys["wrong_names"] == (0.0, 0.2, 2)
    assert keys["found"] == (0.9, 1.0, 3)
    assert keys["coverage"][:2] == (0.93, 0.97)
