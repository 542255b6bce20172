"""Lengths that are not bidirectional, with a short gauge measured beside them: sums worked by hand."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from cmm_uq.analysis.conformity.as_recorded import supplemented
from cmm_uq.analysis.conformity.standards import statement
from cmm_uq.analysis.conformity.statement import Statement
from cmm_uq.artefacts import artefact_facts
from cmm_uq.artefacts.ballbar import Ballbar
from cmm_uq.artefacts.gauge_lines import StepGauge
from cmm_uq.base.points import Floats, Points
from cmm_uq.jobs.recording.beside import ShortGauge, ShortGaugeFacts
from cmm_uq.jobs.tables.conformity import ConformityFacts
from cmm_uq.jobs.tables.length_formula import MaximumPermissibleError
from cmm_uq.machine.model.kind import LENGTHS
from tests.analysis.conformity.recorded import MACHINE, MIDDLE, SEVEN, STATED, Errors, bars, gauge
from tests.recordings import with_columns

MPE = MaximumPermissibleError(a_um=2.5, k=300.0)
ALL = range(1, 8)


def one_sided(errors: Errors | None = None, **how: Any) -> StepGauge:
    """A step gauge in seven positions, all of its faces reached in one sense."""
    made = gauge(errors=errors, **how)
    along = np.sign(np.array([SEVEN[m - 1] for m in made.points.measurement]))
    points = with_columns(made.points, **{f"approach_{a}": along[:, i] for i, a in enumerate("xyz")})
    return StepGauge(artefact_facts(kind="step_gauge", length_mm=800.0, u_um="L/2000"), points)


def short(
    errors_um: Sequence[float] = (0.0, 0.0, 0.0), places: Sequence[int] = ALL, *, length_mm: float = 20.0,
    aside_mm: float = 0.0, directions: Sequence[Floats] = SEVEN, u_um: float = 0.3, turned_deg: float = 0.0,
) -> ShortGauge:  # fmt: skip
    """A gauge in the middle of some of the seven positions, with an error in each repeat; repeats are 1 nm apart."""
    xyz, number, repeated = [], [], []
    for place in places:
        u = np.asarray(directions[place - 1], dtype=float) / np.linalg.norm(directions[place - 1])
        across = np.cross(u, [0.3, 0.5, 0.8])
        across /= np.linalg.norm(across)
        u, across = (np.cos(np.radians(turned_deg)) * u + np.sin(np.radians(turned_deg)) * across,
                     np.cos(np.radians(turned_deg)) * across - np.sin(np.radians(turned_deg)) * u)  # fmt: skip
        for repeat, error in enumerate(errors_um, 1):
            middle, half = MIDDLE + (aside_mm + 1e-6 * repeat) * across, 0.5 * (length_mm + error * 1e-3) * u
            xyz += [middle - half, middle + half]
            number += [place] * 2
            repeated += [repeat] * 2
    count = len(xyz) // 2
    points = Points(np.array(xyz), np.array(number), np.tile([1, 2], count), np.array(repeated), MACHINE)
    facts = ShortGaugeFacts(file="short.csv", length_mm=length_mm, u_um=u_um)
    return ShortGauge(facts, points, np.arange(2 * count).reshape(-1, 2))


def judged(artefact: StepGauge | Ballbar, beside: ShortGauge | None, **wish: Any) -> Statement:
    facts = ConformityFacts(standard="ISO 10360-2:2009", **({"mpe": MPE} | wish))
    return statement(facts, artefact, {}, "[[conformity]] 1", (LENGTHS,), None, replace(STATED, short_gauge=beside))


def test_lengths_met_from_one_side_pass_with_a_short_gauge_in_every_position_and_never_without() -> None:
    assert judged(one_sided(), None).outcome == "incomplete"
    found = judged(one_sided(), short())
    assert (found.outcome, found.missing, len(found.errors)) == ("pass", (), 105)
    assert any("To 105 of 105 errors" in text and "20 mm, U = 0.60 µm (k = 2)" in text for text in found.remarks)


@pytest.mark.parametrize("absent", [1, 4, 7])
def test_a_position_without_it_is_named(absent: int) -> None:
    found = judged(one_sided(), short(places=[place for place in ALL if place != absent]))
    named = {1: "space diagonal +X +Y +Z", 4: "space diagonal +X +Y −Z", 7: "parallel to Z"}
    assert found.outcome == "incomplete"
    assert len(found.missing) == 1
    assert "5 bidirectional lengths (" in found.missing[0]
    assert named[absent] in found.missing[0] or absent in (1, 4)


@pytest.mark.parametrize(("how", "outcome"), [
    ({"aside_mm": 99.0}, "pass"), ({"aside_mm": 101.0}, "incomplete"),
    ({"turned_deg": 9.9}, "pass"), ({"turned_deg": 10.1}, "incomplete"),
    ({"length_mm": 30.0}, "pass"), ({"length_mm": 31.0}, "incomplete"),
    ({"errors_um": (0.0, 0.0)}, "incomplete"),
])  # fmt: skip
def test_it_must_be_short_near_along_the_lengths_and_as_often_repeated(how: dict[str, Any], outcome: str) -> None:
    assert judged(one_sided(), short(**how)).outcome == outcome


def test_a_repeat_that_was_taken_out_is_missing() -> None:
    whole = short([0.0] * 4)
    rest = whole.points.select((whole.points.measurement != 3) | (whole.points.repeat != 2))
    found = judged(one_sided(), ShortGauge(whole.facts, rest, np.arange(len(rest)).reshape(-1, 2)))
    assert found.missing == ("short gauge, repeat 2 of measurement 3: numbered, and not recorded",)


def test_a_copied_repeat_is_none() -> None:
    beside = short()
    xyz = beside.points.xyz.copy()
    rows = (beside.points.measurement == 5) & (beside.points.repeat == 3)
    xyz[rows] = xyz[(beside.points.measurement == 5) & (beside.points.repeat == 1)]
    found = judged(one_sided(), replace(beside, points=beside.points.at(xyz)))
    assert found.outcome == "incomplete"
    assert "3 repetitions of the short gauge in its measurement 5 (2)" in found.missing


def test_errors_add_with_their_signs_repeat_by_repeat() -> None:
    """1.0 at 20 mm; with 0.5, −0.7 and 0.2 µm of the gauge: 1.5, 0.3 and 1.2 µm."""
    errors = {(5, repeat, 20.0): 1.0 for repeat in (1, 2, 3)}
    found = judged(one_sided(errors), short((0.5, -0.7, 0.2)))
    of_five = [item for item in found.errors if item.measurement == 5 and abs((item.length_mm or 0) - 20) < 1]
    assert [(item.repeat, item.error_um) for item in of_five] == [
        (1, pytest.approx(1.5, abs=1e-6)), (2, pytest.approx(0.3, abs=1e-6)), (3, pytest.approx(1.2, abs=1e-6)),
    ]  # fmt: skip


def test_a_repeat_that_the_gauge_does_not_have_takes_the_one_farthest_outwards() -> None:
    """−1.0 with 0.5, −0.7 and 0.2 µm is farthest out at −1.7."""
    errors = {(5, 4, 20.0): -1.0}
    found = judged(one_sided(errors, repeats=4), short((0.5, -0.7, 0.2)))
    fourth = next(
        item for item in found.errors if (item.measurement, item.repeat) == (5, 4) and (item.length_mm or 0) < 21
    )
    assert fourth.error_um == pytest.approx(-1.7, abs=1e-6)


@pytest.mark.parametrize("at", [0, 1, 2, 3])
def test_each_repeat_of_the_gauge_counts_whatever_its_number(at: int) -> None:
    """Of four repeats one is 5 µm off: it is added to one of the three of each length, wherever it stands."""
    errors = np.zeros(4)
    errors[at] = 5.0
    found = judged(one_sided(), short(errors))
    assert found.outcome == "fail"  # more than five lengths have one value outside
    of_five = sorted(item.error_um for item in found.errors if item.measurement == 5 and (item.length_mm or 0) < 21)
    assert of_five == pytest.approx([0.0, 0.0, 5.0], abs=1e-6)


@pytest.mark.parametrize("aside_mm", [-10.0, 10.0])
def test_a_further_gauge_nearer_to_the_line_does_not_take_the_place_of_another(aside_mm: float) -> None:
    off, near = short([5.0] * 3, aside_mm=aside_mm), short()
    points = Points(
        np.vstack([off.points.xyz, near.points.xyz]), np.append(off.points.measurement, near.points.measurement + 7),
        np.tile(off.points.point, 2), np.tile(off.points.repeat, 2), MACHINE,
    )  # fmt: skip
    assert judged(one_sided(), near).outcome == "pass"
    assert (
        judged(one_sided(), replace(off, points=points, rows=np.arange(len(points)).reshape(-1, 2))).outcome == "fail"
    )


def test_two_errors_that_conform_may_not_conform_together() -> None:
    """1.5 and 1.5 µm, each within 2.5667 µm at 20 mm, are 3.0."""
    errors = {(5, repeat, 20.0): 1.5 for repeat in (1, 2, 3)}
    assert judged(one_sided(errors), short()).outcome == "pass"
    assert judged(one_sided(errors), short((1.5, 1.5, 1.5), u_um=0.01)).outcome == "fail"
    assert judged(one_sided(errors), short((-1.5, -1.5, -1.5))).outcome == "pass"


def test_its_uncertainty_is_a_line_of_the_budget_and_shared_by_all() -> None:
    """At 800 mm 0.4 µm of the gauge and 0.3 µm of the short one: 0.5 µm."""
    lines = [[20.0, 800.0]] * 7
    artefact = one_sided({(5, 1, 800.0): 4.0}, lengths=lines)
    found = judged(artefact, short(), mpe=None, limit_um=5.0)
    assert found.named.u_um == pytest.approx(0.5, abs=1e-6)
    assert found.budget is not None
    shown = {str(line.name): line.contribution * 1e3 for line in found.budget.lines}
    assert shown["calibration of the short gauge"] == pytest.approx(0.3)
    assert shown["calibration of the artefact"] == pytest.approx(0.4)
    assert found.budget.u == pytest.approx(0.5e-3)
    plain = judged(artefact, None, mpe=None, limit_um=5.0)
    assert plain.budget is not None
    assert "calibration of the short gauge" not in [line.name for line in plain.budget.lines]


def test_to_lengths_met_from_both_sides_nothing_is_added() -> None:
    made = one_sided()
    faces = made.points.columns["reference_mm"]
    sense = np.where(faces == 0.0, 1.0, -1.0)[:, None] * np.sign(
        np.array([SEVEN[m - 1] for m in made.points.measurement])
    )
    both = StepGauge(
        artefact_facts(kind="step_gauge", length_mm=800.0, u_um="L/2000"),
        with_columns(made.points, **{f"approach_{a}": sense[:, i] for i, a in enumerate("xyz")}),
    )
    found = judged(both, short((9.0, 9.0, 9.0)))
    assert found.outcome == "pass"
    assert not any("is added" in text for text in found.remarks)
    assert judged(both, short((9.0,))).outcome == "pass"


def test_a_ballbar_takes_it_where_it_lies_and_keeps_its_other_bars() -> None:
    """Bar 11 lies along X through the middle, 4 µm of 300 mm off by itself none; the gauge reads 2.0 µm too long there."""
    bar = bars(lengths=[300.0] * 20)
    beside = short((2.0, 2.0, 2.0), places=[5])
    plain, with_it = bar.indications(), supplemented(bar, beside).indications()
    assert plain is not None
    assert with_it is not None
    change = (with_it.errors - plain.errors) * 1e3
    near = [i for i, (first, last) in enumerate(bar.points.xyz[plain.rows])
            if abs((last - first)[0]) > 299.0 and np.linalg.norm(0.5 * (first + last) - MIDDLE) <= 100.0]  # fmt: skip
    assert near
    assert np.flatnonzero(change).tolist() == near
    assert change[near] == pytest.approx(2.0)
    assert supplemented(bar, beside).bidirectional(plain.rows).nonzero()[0].tolist() == near


def test_other_standards_than_those_of_bidirectional_lengths_do_without_it() -> None:
    facts = ConformityFacts(standard="VDI/VDE 2617-2.1", characteristic="U1", mpe=MPE)
    found = statement(facts, one_sided(), {}, "[[conformity]] 1", (LENGTHS,), None,
                      replace(STATED, short_gauge=short((9.0, 9.0, 9.0))))  # fmt: skip
    assert found.outcome == "pass"
