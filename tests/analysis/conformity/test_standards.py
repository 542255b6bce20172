"""What each standard compares, decides and finds missing, against answers worked by hand."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from cmm_uq.analysis.conformity.standard import BY_MEASUREMENT_ALONE
from cmm_uq.analysis.conformity.standards import statement
from cmm_uq.analysis.conformity.statement import Statement
from cmm_uq.artefacts import artefact_facts, kind_named
from cmm_uq.artefacts.ballbar import Ballbar
from cmm_uq.artefacts.gauge_lines import StepGauge
from cmm_uq.artefacts.spheres.sphere import SphereArtefact
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.points import Machine, Points
from cmm_uq.jobs.tables.conformity import (
    Circumstances,
    ConformityFacts,
    FalseAccept,
    GuardBand,
    Rule,
)
from cmm_uq.jobs.tables.length_formula import MaximumPermissibleError
from cmm_uq.machine.model.artefact import Artefact
from cmm_uq.machine.model.kind import BARS
from cmm_uq.maths.uncertainty.quantity import Quantity
from tests.analysis.conformity.recorded import BAR_U, DIAGONALS, SEVEN, STATED, again, bars, copied_runs, gauge, sphere
from tests.recordings import bar_facts

ISO_2, ISO_5, B89 = "ISO 10360-2:2009", "ISO 10360-5:2010", "ASME B89.4.1-1997"
MPE = MaximumPermissibleError(a_um=2.5, k=300.0)
GUARDED: list[Rule] = ["ISO 14253-1", GuardBand(guard_band=1.0), FalseAccept(max_false_accept=0.02)]
TRAVEL_KEY = "the travel of all three axes ([machine] travel_mm)"


def judged(
    artefact: Artefact,
    standard: str = ISO_2,
    *,
    rule: Rule = "ISO 14253-1",
    range_um: float = 5.0,
    under: Circumstances = STATED,
    **limit: object,
) -> Statement:
    limit = limit or {"mpe": MPE}
    span = Quantity(range_um, 0.5, (range_um - 1, range_um + 1), "µm")
    wish = ConformityFacts(standard=standard, rule=rule, **limit)
    kind = kind_named(artefact.kind)
    assert kind is not None
    return statement(wish, artefact, {"b89_range_um": span}, "[[conformity]] 1", kind.tested, None, under)


def at(bar: Ballbar, machine: Machine) -> Ballbar:
    return Ballbar(bar_facts(300.0, BAR_U), replace(bar.points, machine=machine))


# --- every length by its own uncertainty -----------------------------------------------------------------------------


def test_the_long_length_decides_with_its_own_uncertainty_and_not_the_short_one_with_less_room() -> None:
    """MPE 2.5 + L/300: 2.40 of 2.5667 at 20 mm, u 0.010; 4.99 of 5.1667 at 800 mm, u 0.4: Φ(0.4417) = 0.670."""
    found = judged(gauge([np.eye(3)[0]], [[20.0, 800.0]], errors={(1, 2, 20.0): 2.40, (1, 3, 800.0): -4.99}))
    assert found.outcome == "undecided"
    assert (found.named.measurement, found.named.repeat) == (1, 3)
    assert found.named.length_mm == pytest.approx(800.0)
    assert found.named.error_um == pytest.approx(-4.99, abs=1e-6)
    assert (found.value_um, found.u_um, found.limit_um) == pytest.approx((4.99, 0.4, 5.16667), abs=1e-5)
    assert found.decision.probability_conforming == pytest.approx(0.6706, abs=2e-4)
    short = next(item for item in found.errors if item.error_um == pytest.approx(2.40, abs=1e-6))
    assert (short.u_um, short.limit_um, short.decision.outcome) == pytest.approx((0.010, 2.56667, "pass"), abs=1e-5)
    assert len(found.errors) == 6
    assert any("6 lengths decided" in text and "measurement 1, repeat 3, 800 mm" in text for text in found.remarks)


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize(
    ("rule", "accepted_um", "rejected_um"),
    [
        # limit 2.5 + 600/300 = 4.5 at 600 mm with u = 0.4 · 600/800 = 0.3
        ("simple", 4.5, 4.5),
        ("ISO 14253-1", 4.5 - 0.3 * 1.6449, 4.5 + 0.3 * 1.6449),
        (GuardBand(guard_band=1.0), 4.5 - 0.6, 4.5 + 0.6),
        (FalseAccept(max_false_accept=0.02), 4.5 - 0.3 * 2.0537, 4.5 + 0.3 * 2.0537),
    ],
)
def test_a_complete_test_turns_at_the_limits_of_its_rule(
    rule: Rule, accepted_um: float, rejected_um: float, sign: float
) -> None:
    """A hundredth of u on either side of where each rule turns; two of three repeats, so that nothing is to be remeasured."""

    def outcome(error_um: float) -> str:
        lengths = (
            [[20.0, 230.0, 440.0, 650.0, 850.0]] * 4
            + [[20.0, 165.0, 310.0, 455.0, 600.0]]
            + [[20.0, 115.0, 210.0, 305.0, 400.0]] * 2
        )
        found = judged(gauge(SEVEN, lengths, errors={(5, r, 600.0): sign * error_um for r in (2, 3)}), rule=rule)
        assert found.scope == "complete"
        assert len(found.errors) == 105
        if error_um:
            assert found.named.measurement == 5
            assert found.named.repeat in (2, 3)
        return found.outcome

    hundredth = 0.003
    assert outcome(0.0) == "pass"
    assert outcome(accepted_um - hundredth) == "pass"
    assert outcome(accepted_um + hundredth) == ("fail" if rule == "simple" else "undecided")
    assert outcome(rejected_um - hundredth) == ("pass" if rule == "simple" else "undecided")
    assert outcome(rejected_um + hundredth) == "fail"


def test_one_length_that_fails_fails_the_test_though_others_are_undecided() -> None:
    """At 800 mm 5.10 of 5.1667, u 0.4: undecided. At 20 mm 2.60 of 2.5667, u 0.01: 3.3 u beyond, P = 0.04 %."""
    errors = {(1, 1, 20.0): 2.60, (1, 3, 20.0): 2.60, (1, 1, 800.0): 5.10}
    found = judged(gauge([np.eye(3)[0]], [[20.0, 800.0]], errors=errors))
    assert found.outcome == "fail"
    assert found.named.length_mm == pytest.approx(20.0)
    assert found.decision.probability_conforming == pytest.approx(0.00043, abs=1e-4)
    assert found.missing


# --- what a test lacks -----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("standard", [ISO_2, "VDI/VDE 2617"])
def test_seven_positions_of_five_lengths_three_times_pass(standard: str) -> None:
    found = judged(gauge(), standard)
    assert (found.outcome, found.scope, found.missing, found.characteristic) == ("pass", "complete", (), "E0")
    assert any("like ISO 10360-2" in text for text in found.remarks) == (standard == "VDI/VDE 2617")


def test_seven_parallel_lines_are_one_position() -> None:
    """105 lengths along X."""
    found = judged(gauge([np.eye(3)[0]] * 7))
    assert len(found.errors) == 105 - 6 * 15  # the seven lie in one place, so six are copies
    x = np.eye(3)[0]
    tilted = judged(gauge([x + np.array([0, 0.001 * i, 0]) for i in range(7)]))
    assert len(tilted.errors) == 105
    for each in (found, tilted):
        assert each.outcome == "incomplete"
        assert {"parallel to Y", "parallel to Z", "space diagonal +X −Y +Z"} <= set(each.missing)
        assert "parallel to X" not in each.missing


def test_four_lengths_in_two_positions_are_twenty_four_of_a_hundred_and_five() -> None:
    found = judged(gauge(list(np.eye(3)[:2]), [[20.0, 200.0, 300.0, 600.0], [20.0, 200.0, 300.0, 400.0]]))
    assert found.outcome == "incomplete"
    assert len(found.errors) == 24
    assert "5 different lengths (parallel to X: 4)" in found.missing
    assert "81 of 105 lengths" in found.missing
    assert [text for text in found.missing if text.startswith("space")] == [
        f"space diagonal {a}X {b}Y +Z" for a in "+−" for b in "+−"
    ]


def test_five_faces_on_a_line_of_80_mm_are_no_test() -> None:
    found = judged(gauge([np.eye(3)[1]], [[16.0, 32.0, 48.0, 64.0, 80.0]]))
    assert found.outcome == "incomplete"
    # 80 of 550 mm
    assert "length of at least 66 % of the travel (parallel to Y: 15 %)" in found.missing


def test_a_share_of_exactly_two_thirds_is_enough_and_a_millimetre_less_is_not() -> None:
    """66 % of 550 mm is 363 mm."""
    for longest, enough in ((363.0, True), (362.0, False)):
        found = judged(gauge([np.eye(3)[1]], [[20.0, 100.0, 200.0, 300.0, longest]]))
        assert any("66 %" in text for text in found.missing) != enough


def test_the_shortest_length_is_at_most_thirty_millimetres() -> None:
    for shortest, enough in ((30.0, True), (30.1, False)):
        found = judged(gauge([np.eye(3)[1]], [[shortest, 100.0, 200.0, 300.0, 400.0]]))
        assert any("at most 30 mm" in text for text in found.missing) != enough


def test_lengths_a_millimetre_apart_are_not_different() -> None:
    found = judged(gauge([np.eye(3)[1]], [[20.0, 20.9, 200.0, 300.0, 400.0]]))
    assert "5 different lengths (parallel to Y: 4)" in found.missing


def test_without_travel_the_share_cannot_be_shown() -> None:
    found = judged(gauge(machine=Machine()))
    assert found.outcome == "incomplete"
    assert len(found.missing) == 1
    assert found.missing[0].startswith(TRAVEL_KEY)


@pytest.mark.parametrize("lost", range(7))
def test_each_missing_position_is_named(lost: int) -> None:
    found = judged(gauge([line for i, line in enumerate(SEVEN) if i != lost]))
    names = [*(f"space diagonal {s}" for s in ("+X +Y +Z", "+X −Y +Z", "−X +Y +Z", "−X −Y +Z")), "parallel to X",
             "parallel to Y", "parallel to Z"]  # fmt: skip
    assert found.outcome == "incomplete"
    assert found.missing == (names[lost], "15 of 105 lengths")


def test_where_a_face_is_touched_does_not_move_its_length_to_another_line() -> None:
    """Faces touched up to 4 mm aside: that turns a length of 20 mm by 11°, and a line of hundreds of mm hardly."""
    line = gauge()
    aside = np.where(np.arange(len(line.points)) % 2, 4.0, 0.0)[:, None] * np.array([[0.6, -0.64, 0.48]])
    facts = artefact_facts(kind="step_gauge", length_mm=800.0, u_um="L/2000")
    across = aside - np.einsum("ni,ni->n", aside, line.directions())[:, None] * line.directions()
    found = judged(StepGauge(facts, line.points.at(line.points.xyz + across)), limit_um=200.0)
    assert found.missing == ()


def test_two_repeats_are_not_three() -> None:
    found = judged(gauge(repeats=2))
    assert found.outcome == "incomplete"
    assert "3 repetitions of each length (parallel to Z: 2)" in found.missing
    assert "35 of 105 lengths" in found.missing


def test_the_way_back_along_a_gauge_is_no_repeat() -> None:
    there_and_back = [20.0, 100.0, 200.0, 300.0, 400.0, 300.0, 200.0, 100.0, 20.0]
    found = judged(gauge([np.eye(3)[1]], [[*there_and_back, 400.0]], repeats=2))
    assert "3 repetitions of each length (parallel to Y: 2)" in found.missing


def test_a_copied_repeat_does_not_count_and_is_not_decided() -> None:
    found = judged(copied_runs(gauge(), {(6, 3): (6, 1)}))
    assert found.outcome == "incomplete"
    assert found.missing == ("3 repetitions of each length (parallel to Y: 2)", "5 of 105 lengths")
    assert len(found.errors) == 100
    assert any("measurement 6, repeat 3 of measurement 6, repeat 1" in text for text in found.remarks)


def test_a_bar_has_one_length_and_is_no_test_of_iso_10360_2() -> None:
    found = judged(bars())
    assert found.outcome == "incomplete"
    assert "5 different lengths (parallel to X: 1)" in found.missing


def test_what_is_missing_neither_mends_a_fail_nor_an_undecided_test() -> None:
    """Two positions, 20 mm: 2.5667 µm with u 0.01."""
    for error, outcome in ((2.0, "incomplete"), (2.56, "undecided"), (2.60, "fail")):
        found = judged(gauge(DIAGONALS[:2], errors={(2, 1, 20.0): error, (2, 2, 20.0): error}))
        assert (found.outcome, found.scope) == (outcome, "partial")


# --- ASME B89.4.1 ----------------------------------------------------------------------------------------------------


def test_b89_compares_the_range_of_twenty_positions_on_one_side() -> None:
    """5.0 of 6.0 µm with u = 0.5: Φ(2) = 97.7 %."""
    found = judged(bars(), B89, limit_um=6.0)
    assert (found.value_um, found.u_um, found.outcome, found.missing) == (5.0, 0.5, "pass", ())
    assert found.decision.probability_conforming == pytest.approx(0.97725, abs=1e-5)
    assert found.characteristic == "volumetric performance"
    (item,) = found.errors
    assert (item.measurement, item.repeat, item.length_mm) == (None, None, 300.0)


@pytest.mark.parametrize(
    ("limit_um", "rule", "outcome"),
    [
        (5.0 + 0.5 * 1.65, "ISO 14253-1", "incomplete"), (5.0 + 0.5 * 1.64, "ISO 14253-1", "undecided"),
        (5.0 - 0.5 * 1.64, "ISO 14253-1", "undecided"), (5.0 - 0.5 * 1.65, "ISO 14253-1", "fail"),
        (5.0, "simple", "incomplete"), (4.99, "simple", "fail"), (6.01, GuardBand(guard_band=1.0), "incomplete"),
        (5.99, GuardBand(guard_band=1.0), "undecided"), (6.03, FalseAccept(max_false_accept=0.02), "incomplete"),
        (6.02, FalseAccept(max_false_accept=0.02), "undecided"),
    ],
)  # fmt: skip
def test_three_bars_are_not_b89_whatever_they_measure(limit_um: float, rule: Rule, outcome: str) -> None:
    found = judged(bars([(1, 0, 0), (0, 1, 0), (0, 0, 1)]), B89, rule=rule, limit_um=limit_um)
    assert found.outcome == outcome
    assert found.missing[0] == "17 of 20 positions: 3 distinct"


def test_one_placing_copied_twenty_times_is_one_position() -> None:
    found = judged(again(bars(), dict.fromkeys(range(2, 21), 1)), B89, range_um=0.0, limit_um=60.0)
    assert found.outcome == "incomplete"
    assert found.missing[0] == "19 of 20 positions: 1 distinct, measurements 2 to 20 are copies of 1"


@pytest.mark.parametrize("turned", [False, True])
def test_a_copy_is_found_whichever_way_its_ends_are_numbered(turned: bool) -> None:
    found = judged(again(bars(), {18: 14}, turned=turned), B89, limit_um=60.0)
    assert found.missing == ("1 of 20 positions: 19 distinct, measurement 18 is a copy of 14",)


def test_a_bar_within_ten_millimetres_of_another_is_no_further_position() -> None:
    for moved, counts, turned in ((9.9, False, False), (9.9, False, True), (10.1, True, False), (10.1, True, True)):
        found = judged(again(bars(), {18: 14}, moved, turned=turned), B89, limit_um=60.0)
        assert (found.outcome == "pass") == counts
        if not counts:
            assert found.missing == ("1 of 20 positions: 19 distinct, measurement 18 is within 10 mm of 14",)


def test_a_copied_repeat_leaves_its_position_standing() -> None:
    once = bars().points
    twice = Points(
        np.vstack([once.xyz, once.xyz]), np.tile(once.measurement, 2), np.tile(once.point, 2),
        np.repeat([1, 2], len(once)), once.machine,
    )  # fmt: skip
    assert judged(Ballbar(bar_facts(300.0, BAR_U), twice), B89, limit_um=60.0).missing == ()


def test_twenty_bars_along_x_lack_the_other_directions() -> None:
    found = judged(bars([(1, 0, 0)] * 20), B89, limit_um=60.0)
    assert found.outcome == "incomplete"
    assert len(found.missing) == 12
    assert {"position parallel to Z", "position along face diagonal −X +Z"} <= set(found.missing)


def test_a_long_machine_needs_ten_positions_more_for_each_further_cube() -> None:
    """1001 × 500 × 500 mm is longer than two cubes of its shortest axis by a millimetre."""
    for length, missing in ((1000.0, ()), (1001.0, ("10 of 30 positions: 20 distinct",))):
        travel = np.array([[0.0, length], [0.0, 500.0], [-500.0, 0.0]])
        assert judged(at(bars(), Machine("m", "XYZ", travel)), B89, limit_um=60.0).missing == missing


def test_without_travel_the_number_of_positions_cannot_be_shown() -> None:
    found = judged(at(bars(), Machine()), B89, limit_um=60.0)
    assert found.outcome == "incomplete"
    assert len(found.missing) == 1
    assert found.missing[0].startswith(TRAVEL_KEY)


def test_a_correction_makes_no_copy_a_measurement() -> None:
    """Corrected by an amount that depends on time, a copy is no longer one to the last digit."""
    recorded, wish = again(bars(), {18: 14}), ConformityFacts(standard=B89, limit_um=60.0)
    span = {"b89_range_um": Quantity(5.0, 0.5, (4.0, 6.0), "µm")}
    assert statement(wish, bars(), span, "", [BARS], None, STATED).outcome == "pass"
    assert statement(wish, bars(), span, "", [BARS], recorded, STATED).outcome == "incomplete"


# --- ISO 10360-5 -----------------------------------------------------------------------------------------------------


def test_twenty_five_points_of_a_sphere_are_decided_with_half_the_form_of_the_ball() -> None:
    """A ball of 0.2 µm form: u = 0.1, so that the rule turns 0.164 µm from the limit."""
    found = judged(sphere(), ISO_5, limit_um=5.0)
    assert (found.u_um, found.outcome, found.characteristic) == (pytest.approx(0.1), "pass", "P_FTU")
    assert judged(sphere(), ISO_5, limit_um=found.value_um + 0.16).outcome == "undecided"
    assert judged(sphere(), ISO_5, limit_um=found.value_um + 0.17).outcome == "pass"
    assert judged(sphere(), ISO_5, limit_um=found.value_um - 0.17).outcome == "fail"


@pytest.mark.parametrize(
    ("of", "missing"),
    [
        ({"points": 24}, "25 points on the sphere of measurement 1 (24 recorded, 24 different)"),
        ({"copied": 1}, "25 points on the sphere of measurement 1 (25 recorded, 24 different)"),
        ({"points": 26, "copied": 2}, "25 points on the sphere of measurement 1 (26 recorded, 24 different)"),
        ({"cap_deg": 42.0}, "points over a hemisphere on the sphere of measurement 1"),
    ],
)
def test_too_few_copied_or_huddled_points_are_no_test(of: dict[str, float], missing: str) -> None:
    found = judged(sphere(**of), ISO_5, limit_um=20.0)
    assert found.outcome == "incomplete"
    assert len(found.missing) == 1
    assert found.missing[0].startswith(missing)


def test_a_copied_sphere_is_no_second_one() -> None:
    one = sphere(points=24).points
    two = Points(
        np.vstack([one.xyz, one.xyz]), np.repeat([1, 2], 24), np.tile(one.point, 2), np.ones(48, dtype=np.int64)
    )
    found = judged(
        SphereArtefact(artefact_facts(kind="sphere", length_mm=25.0, form_um=0.2), two), ISO_5, limit_um=20.0
    )
    assert found.missing == ("25 points on the sphere of measurement 1 (24 recorded, 24 different)",)
    assert any("measurement 2, repeat 1 of measurement 1, repeat 1" in text for text in found.remarks)


def test_a_range_and_a_form_have_one_side() -> None:
    """1.65 u below the limit is 95.05 % on one side; near zero the other side would take 5 and 1 points of it."""
    found = judged(bars(), B89, range_um=0.0, limit_um=0.5 * 1.65)
    assert (found.outcome, round(found.decision.probability_conforming or 0.0, 4)) == ("pass", 0.9505)
    value = judged(sphere(), ISO_5, limit_um=5.0).value_um
    found = judged(sphere(form_um=20.0), ISO_5, limit_um=value + 16.5)
    assert (found.outcome, round(found.decision.probability_conforming or 0.0, 4)) == ("pass", 0.9505)


# --- without an uncertainty ------------------------------------------------------------------------------------------


@pytest.mark.parametrize("rule", GUARDED)
def test_a_rule_that_needs_an_uncertainty_refuses_without(rule: Rule) -> None:
    with pytest.raises(CmmUqError, match=r"\[\[conformity\]\] 1 rule: .*states no u_um above 0\. Give u_um.*simple"):
        judged(gauge(u_um=None), rule=rule)
    with pytest.raises(CmmUqError, match=r"states no form_um above 0\. Give form_um"):
        judged(sphere(form_um=None), ISO_5, rule=rule, under=Circumstances(), limit_um=5.0)


def test_simple_acceptance_does_without_an_uncertainty_and_says_so() -> None:
    found = judged(gauge(u_um=None, errors={(5, 1, 20.0): 2.5, (6, 1, 20.0): 2.4}), rule="simple")
    assert (found.finding, found.decision.probability_conforming) == ("pass", None)
    assert found.outcome == "incomplete"
    assert found.missing == ("uncertainty: calibration of the artefact is neither stated nor declared negligible",)
    assert found.named.measurement == 5
    assert any("No uncertainty is stated above zero" in text for text in found.remarks)
    assert any("takes no account of the uncertainty" in text for text in judged(gauge(), rule="simple").remarks)
    assert any(
        "form_um) is not given" in t for t in judged(sphere(form_um=None), ISO_5, rule="simple", limit_um=5.0).remarks
    )


# --- what a statement remarks ----------------------------------------------------------------------------------------

DECLARED = tuple(
    f"{line}: declared negligible by A. Muster: put in by hand."
    for line in ("Expansion coefficient of the artefact", "Temperature of the artefact", "Alignment of the artefact",
                 "Fixturing of the artefact")
)  # fmt: skip
RATED = "Rated conditions: declared to be met by A. Muster: put in by hand."
UNCERTAINTY_IGNORED = (
    "Simple acceptance takes no account of the uncertainty: at the limit itself conforming is as likely as not."
)


def test_a_guarded_statement_on_lengths_remarks_their_uncertainty_and_the_worst() -> None:
    """u of every length is the 0.41236 that is stated; 2.5 of 4.541 there, 0.1 of 2.567 at 20 mm."""
    errors = {(1, 1, 20.0): 0.1, (1, 1, 612.3456): 2.5}
    found = judged(gauge([np.eye(3)[0]], [[20.0, 612.3456]], errors=errors, repeats=1, u_um=0.41236))
    assert found.remarks == (
        "u is the test uncertainty (ISO/TS 23165), 0.41 µm for the length named.",
        "2 lengths decided, each by its own u and limit; least favourable: measurement 1, repeat 1, 612.3456 mm.",
        BY_MEASUREMENT_ALONE,
        *DECLARED,
        RATED,
        found.remarks[-1],
    )
    assert found.remarks[-1].startswith("Clauses not checked against the text of ISO 10360-2:2009: positions, ")


def test_where_the_calibration_alone_is_stated_the_remark_says_that_nothing_else_is() -> None:
    found = judged(gauge([np.eye(3)[0]], [[400.0]], repeats=1, u_um=0.41236), under=Circumstances())
    assert found.remarks[0] == (
        "u is the part of the test uncertainty (ISO/TS 23165) that comes from the calibrated length, 0.41 µm for the length "
        "named; nothing else is stated."
    )


def test_one_length_alone_is_spoken_of_in_the_singular() -> None:
    found = judged(gauge([np.eye(3)[0]], [[400.0]], repeats=1))
    assert found.remarks[1].startswith("1 length decided, ")


def test_simple_acceptance_of_a_length_remarks_what_it_ignores_once_there_is_an_uncertainty() -> None:
    stated, unstated = (
        judged(gauge([np.eye(3)[0]], [[400.0]], repeats=1, u_um=u), rule="simple").remarks for u in (0.4, None)
    )
    assert stated[2:-1] == (UNCERTAINTY_IGNORED, BY_MEASUREMENT_ALONE, *DECLARED, RATED)
    assert unstated[0] == "No uncertainty is stated above zero: none is considered, and no probability can be given."
    assert unstated[2:-1] == (*DECLARED, RATED)


def test_a_statement_on_spheres_remarks_the_ball_and_of_several_the_largest() -> None:
    """Form of the ball 0.2345 µm: half of it is 0.117. Of two spheres the second is a micrometre less true."""
    one = judged(sphere(form_um=0.2345), ISO_5, limit_um=20.0)
    ball = "u is the test uncertainty (ISO/TS 23165): half the form deviation of the sphere, 0.12 µm."
    superseded = "This edition is superseded by ISO 10360-5:2020."
    declared = ("Calibration of the form: declared negligible by A. Muster: put in by hand.", RATED)
    assert one.remarks[:-1] == (ball, BY_MEASUREMENT_ALONE, superseded, *declared)
    assert (one.named.measurement, one.named.repeat, one.named.length_mm) == (1, 1, 25.0)
    two = sphere(form_um=0.2345, spheres=2)
    xyz = two.points.xyz.copy()
    xyz[26] += 1e-3 * (xyz[26] - [30.0, 0.0, 0.0]) / 12.5
    found = judged(SphereArtefact(artefact_facts(kind="sphere", length_mm=25.0, form_um=0.2345), two.points.at(xyz)), ISO_5,
                   limit_um=20.0)  # fmt: skip
    assert found.remarks[:-1] == (
        ball,
        "The largest of 2 spheres: measurement 2.",
        BY_MEASUREMENT_ALONE,
        superseded,
        *declared,
    )
    assert found.named.measurement == 2
    assert found.value_um > one.value_um + 0.5


def test_a_maximum_permissible_error_grows_with_the_size_of_the_sphere() -> None:
    """2.5 + 25/300."""
    assert judged(sphere(), ISO_5).limit_um == pytest.approx(2.5 + 25 / 300)
    assert judged(bars(), B89).limit_um == pytest.approx(2.5 + 300 / 300)


# --- what is not decided ---------------------------------------------------------------------------------------------


def test_iso_10360_2_needs_a_calibrated_length() -> None:
    bar = Ballbar(bar_facts(None), bars().points)
    with pytest.raises(CmmUqError, match=r"\[\[conformity\]\] 1.*calibrated lengths.*length_mm"):
        judged(bar, limit_um=3.0)


def test_a_probing_standard_is_not_decided_on_a_bar() -> None:
    with pytest.raises(CmmUqError, match="ISO 10360-5:2010 is not decided on a ballbar"):
        judged(bars(), ISO_5, limit_um=3.0)
