"""A decision is made of the whole recording: what the screening leaves out of the estimates is a value outside."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
import pytest

from cmm_uq.analysis.conformity.accuracy import figures
from cmm_uq.analysis.conformity.as_recorded import OutsideReadings, numbered
from cmm_uq.analysis.conformity.standards import statement
from cmm_uq.analysis.conformity.statement import Statement
from cmm_uq.artefacts import artefact_facts, kind_named
from cmm_uq.base.points import Floats, Points
from cmm_uq.jobs.job import RecordingFacts
from cmm_uq.jobs.tables.artefact import ArtefactFacts
from cmm_uq.jobs.tables.conformity import Circumstances, ConformityFacts
from cmm_uq.machine.model.kind import BARS, FORMS, LENGTHS
from cmm_uq.maths.uncertainty.quantity import Quantity
from tests.analysis.conformity import recorded
from tests.recordings import bar_facts, screened, with_columns

STEP_GAUGE = artefact_facts(kind="step_gauge", length_mm=800.0, u_um="L/2000")
SPHERE = artefact_facts(kind="sphere", length_mm=25.0, u_um=0.1, form_um=0.2)
ISO = {"standard": "ISO 10360-2:2009", "mpe": "2.5 + L/300"}
UNDER = replace(recorded.STATED, uncertainty=recorded.STATED.uncertainty.model_copy(update={"u_repeat_um": 0.05}))


def decided(
    points: Points, facts: ArtefactFacts, under: Circumstances = UNDER, aside: Sequence[int] = (), **wish: Any
) -> Statement:
    """A recording screened as every command does, and decided."""
    kind = kind_named(facts.kind)
    assert kind is not None
    points = numbered_lines(points)
    recording = screened(points, facts, needed=set(), set_aside=aside, where="recording.csv")
    observe = partial(kind.observing("decided"), facts)
    artefact = observe(recording.points)
    lengths = artefact.lengths()
    accuracy = {} if lengths is None else {
        name: Quantity.of_draws(np.full(100, value), "µm", float(value)) for name, value in figures(lengths).items()
    }  # fmt: skip
    left_out = OutsideReadings.of(points, recording.findings, observe)
    facts_of = ConformityFacts.model_validate(wish)
    return statement(facts_of, artefact, accuracy, "[[conformity]] 1", [LENGTHS, BARS, FORMS], None, under, left_out)


def numbered_lines(points: Points) -> Points:
    return Points(points.xyz, points.measurement, points.point, points.repeat, points.machine, points.columns,
                  np.arange(2, len(points) + 2))  # fmt: skip


def along_line(points: Points, chosen: Any, by_mm: float) -> Points:
    """Some faces of a step gauge moved along their line."""
    xyz = points.xyz.copy()
    for row in np.flatnonzero(chosen):
        line = points.measurement == points.measurement[row]
        reference = points.columns["reference_mm"]
        way = points.xyz[line][np.argmax(reference[line])] - points.xyz[line][np.argmin(reference[line])]
        xyz[row] += by_mm * way / np.linalg.norm(way)
    return points.at(xyz)


@pytest.mark.parametrize("by_mm", [0.002, 0.4, 2.0, 5.0, -5.0, 10.0, -10.0, 20.0])
@pytest.mark.parametrize("characteristic", ["E0", "R0"])
def test_a_length_that_is_wrong_in_one_repeat_never_passes(by_mm: float, characteristic: str) -> None:
    """0.002 mm is no more than its limit of 2.5 + 200/300 = 3.2 µm allows; from 0.4 mm on all of them are outside."""
    points = recorded.gauge().points
    chosen = (points.measurement == 2) & (points.point == 3) & (points.repeat == 2)
    found = decided(along_line(points, chosen, by_mm), STEP_GAUGE, characteristic=characteristic, **ISO)
    far = abs(by_mm) > 0.3
    assert found.outcome == ({"E0": "remeasure", "R0": "fail"}[characteristic] if far else "pass")
    assert (found.named.measurement, found.value_um) == (2, pytest.approx(1e3 * abs(by_mm), abs=1e-3))
    if far and characteristic == "E0":
        assert (found.named.repeat, np.sign(found.named.error_um)) == (2, np.sign(by_mm))


@pytest.mark.parametrize("by_mm", [2.0, 5.0, 10.0, 20.0])
def test_a_length_that_is_wrong_in_all_three_repeats_fails(by_mm: float) -> None:
    """Six lengths on each line, so that five are left where one is taken away."""
    lengths = [[*recorded.five(line), recorded.five(line)[1] + 30] for line in recorded.SEVEN]
    points = recorded.gauge(lengths=lengths).points
    chosen = (points.measurement == 5) & (points.point == 4)
    found = decided(along_line(points, chosen, by_mm), STEP_GAUGE, **ISO)
    assert (found.outcome, found.scope) == ("fail", "complete")
    assert found.value_um == pytest.approx(1e3 * by_mm, abs=1e-3)
    assert len(found.errors) == 7 * 3 * 6
    assert [item.repeat for item in found.errors if item.outcome == "fail"] == [1, 2, 3]


def test_what_was_left_out_is_named_with_lines_and_reason() -> None:
    points = recorded.gauge().points
    chosen = (points.measurement == 2) & (points.point == 3) & (points.repeat == 2)
    found = decided(along_line(points, chosen, 10.0), STEP_GAUGE, **ISO)
    line = int(np.flatnonzero(chosen)[0]) + 2
    assert any(
        f"left out of the estimates alone: line {line}: the artefact is missed by 10 mm" in t for t in found.remarks
    )
    assert [item.set_aside for item in found.errors].count(True) == 1
    assert found.joint is None


def test_other_values_stand_as_they_are_without_it() -> None:
    """The far end of a line, 20 mm aside, turns the line of the raw recording; not the lengths of other repeats."""
    points = recorded.gauge(errors={(2, 1, 20.0): 1.25}).points
    xyz = points.xyz.copy()
    at = (points.measurement == 2) & (points.point == 6) & (points.repeat == 3)
    xyz[at] = xyz[at][:, [1, 0, 2]] + [0.0, 0.0, 3.0]
    found = decided(points.at(xyz), STEP_GAUGE, **ISO)
    rest = [item for item in found.errors if not item.set_aside]
    assert (len(rest), len(found.errors)) == (104, 105)
    assert max(abs(item.error_um) for item in rest) == pytest.approx(1.25, abs=1e-3)
    (aside,) = [item for item in found.errors if item.set_aside]
    first = points.xyz[(points.measurement == 2) & (points.point == 1) & (points.repeat == 3)]
    length = points.columns["reference_mm"][at]
    assert aside.error_um == pytest.approx(1e3 * (np.linalg.norm(xyz[at] - first) - length[0]), abs=1.0)
    assert found.outcome == "remeasure"


def test_the_first_face_takes_all_lengths_of_its_repeat_with_it() -> None:
    points = recorded.gauge().points
    chosen = (points.measurement == 2) & (points.point == 1) & (points.repeat == 2)
    found = decided(along_line(points, chosen, 10.0), STEP_GAUGE, **ISO)
    aside = [item for item in found.errors if item.set_aside]
    assert [(item.measurement, item.repeat) for item in aside] == [(2, 2)] * 5
    assert [item.error_um for item in aside] == pytest.approx([-1e4] * 5, abs=1e-3)
    assert found.outcome == "remeasure"  # five lengths, each outside once


@pytest.mark.parametrize(("by_mm", "repeats"), [(6.0, 1), (6.0, 2)])
def test_one_of_four_repeats(by_mm: float, repeats: int) -> None:
    """The fourth is one of the further readings that nobody had to make: one of these outside fails, too."""
    points = recorded.gauge(repeats=4).points
    chosen = (points.measurement == 7) & (points.point == 2) & (points.repeat <= repeats)
    found = decided(along_line(points, chosen, by_mm), STEP_GAUGE, **ISO)
    assert found.outcome == ("remeasure" if repeats == 1 else "fail")
    found = decided(along_line(points, (points.measurement == 7) & (points.point == 2) & (points.repeat == 4), 6.0),
                    STEP_GAUGE, **ISO)  # fmt: skip
    assert found.outcome == "fail"


def test_a_standard_without_such_a_clause_fails_at_once() -> None:
    points = recorded.gauge(recorded.DIAGONALS).points
    chosen = (points.measurement == 2) & (points.point == 3) & (points.repeat == 2)
    found = decided(along_line(points, chosen, 10.0), STEP_GAUGE, standard="VDI/VDE 2617-2.1", mpe="2.5 + L/300")
    assert found.outcome == "fail"


@pytest.mark.parametrize("by_mm", [10.0, -10.0, 3.0])
def test_one_of_twenty_one_bars_that_is_too_long_or_too_short_fails(by_mm: float) -> None:
    lengths = [300.0 + 1e-4 * (i % 7) for i in range(21)]
    lengths[17] += by_mm
    points = recorded.bars([*recorded.TWENTY, (1, 1, 1)], lengths=lengths, step_mm=11.0).points
    found = decided(points, bar_facts(300.0, 0.35), standard="ASME B89.4.1-1997", limit_um=5.0)
    assert (found.outcome, found.scope) == ("fail", "complete")
    assert found.value_um == pytest.approx(1e3 * abs(by_mm) + 0.3, abs=1e-3)  # bars of 300 mm and 0 to 0.6 µm


@pytest.mark.parametrize("characteristic", ["P_Form", "P_Size"])
def test_a_point_of_a_sphere_that_is_far_off_fails(characteristic: str) -> None:
    points = with_columns(recorded.sphere(height_um=0.2).points, temp_artefact_c=np.full(25, 20.0))
    xyz = points.xyz.copy()
    xyz[11] *= 1.08  # 1 mm
    wish = {"standard": "ISO 10360-5:2020", "characteristic": characteristic, "limit_um": 2.0}
    assert decided(points, SPHERE, **wish).outcome == "pass"
    found = decided(points.at(xyz), SPHERE, **wish)
    assert (found.outcome, found.scope, len(found.errors)) == ("fail", "complete", 1)
    assert found.named.set_aside
    if characteristic == "P_Form":
        assert found.value_um > 900


def test_a_line_that_stood_still_is_outside_without_a_value() -> None:
    """All faces of one line in one place: no artefact can be made of it."""
    lengths = [recorded.five(line) for line in recorded.SEVEN]
    points = recorded.gauge(lengths=lengths).points
    xyz = points.xyz.copy()
    at = points.measurement == 3
    xyz[at] = xyz[np.flatnonzero(at)[0]] + 1e-6 * np.arange(at.sum())[:, None] * [0.0, 0.0, 1.0]
    xyz[at, :2] = xyz[np.flatnonzero(at)[0], :2]
    found = decided(points.at(xyz), STEP_GAUGE, **ISO)
    assert found.outcome == "fail"
    assert found.named.set_aside or found.outside


def test_copies_stay_no_measurements() -> None:
    points = recorded.gauge().points
    xyz = points.xyz.copy()
    xyz[points.measurement == 7] = xyz[points.measurement == 6]
    found = decided(points.at(xyz), STEP_GAUGE, **ISO)
    assert found.outcome == "incomplete"
    assert any("parallel to Z" in text for text in found.missing)


def rows(points: Points, **at: int) -> Floats:
    return np.logical_and.reduce([getattr(points, name) == number for name, number in at.items()])


@pytest.mark.parametrize(("gone", "words"), [
    ({"measurement": 3}, "measurement 3: numbered"),
    ({"measurement": 1}, "measurement 1: numbered"),
    ({"measurement": 2, "repeat": 2}, "repeat 2 of measurement 2: numbered"),
    ({"measurement": 2, "repeat": 2, "point": 4}, "point 4 of measurement 2, repeat 2: recorded in its other repeats"),
    ({"measurement": 2, "point": 4}, "point 4 of measurement 2: numbered"),
])  # fmt: skip
def test_a_row_that_was_taken_out_is_missing(gone: dict[str, int], words: str) -> None:
    points = recorded.gauge(repeats=4).points
    assert not numbered(points)
    (condition,) = numbered(points.select(~rows(points, **gone)))
    assert [words in text for text in condition.missing] == [True]


def test_a_row_taken_out_of_one_of_two_measurements_is_missing() -> None:
    points = recorded.gauge(recorded.SEVEN[:2], repeats=1).points
    assert not numbered(points)
    (condition,) = numbered(points.select(~rows(points, measurement=2, point=4)))
    assert condition.missing == ("point 4 of measurement 2: numbered, and not recorded",)


def test_numbers_of_faces_are_no_gaps() -> None:
    """A laboratory that numbers the faces of its gauge has gaps in every line, and none is one."""
    points = recorded.gauge().points
    faces = np.array([1, 2, 5, 9, 14, 20])[points.point - 1]
    assert not numbered(Points(points.xyz, points.measurement, faces, points.repeat, points.machine, points.columns))


def test_further_repeats_of_one_length_are_no_gaps() -> None:
    points = recorded.gauge(repeats=13).points
    some = points.select((points.repeat <= 3) | ((points.measurement == 1) & (points.point <= 2)))
    assert not numbered(some, 3)
    assert numbered(some)


def test_what_the_laboratory_sets_aside_is_decided_and_said_with_its_reason() -> None:
    """Of 5 mm in a measurement that the laboratory sets aside, too: its reason is printed, and nothing passes by it."""
    points = recorded.gauge().points
    chosen = (points.measurement == 2) & (points.point == 3)
    under = replace(UNDER, set_aside={2: "The door stood open.", 4: ""})
    found = decided(along_line(points, chosen, 5.0), STEP_GAUGE, under=under, aside=[2, 4], **ISO)
    assert found.outcome == "fail"
    told = [text for text in found.remarks if "by the laboratory" in text]
    assert told == [
        "Measurement 2, left out of the estimates by the laboratory, is decided with the others: The door stood open.",
        "Measurement 4, left out of the estimates by the laboratory, is decided with the others; no reason is stated.",
    ]


@pytest.mark.parametrize(("written", "numbers", "reasons"), [
    ([3, 5], (3, 5), {3: "", 5: ""}),
    ([{"measurement": 3, "reason": "Door open"}, 5], (3, 5), {3: "Door open", 5: ""}),
])  # fmt: skip
def test_measurements_are_set_aside_by_number_or_with_a_reason(written: Any, numbers: Any, reasons: Any) -> None:
    facts = RecordingFacts.model_validate({"file": "recording.csv", "set_aside": written})
    assert facts.measurements_aside == numbers
    assert {entry.measurement: entry.reason for entry in facts.set_aside} == reasons


def test_a_gauge_block_of_one_repeat_far_off_is_measured_again_and_of_two_fails() -> None:
    """Three blocks in each of the seven positions, two faces each; one face 10 mm off."""
    made = recorded.gauge(lengths=[[20.0, 100.0, 200.0, 300.0, 0.7 * 500 + 50]] * 7).points
    facts = artefact_facts(kind="gauge_blocks", length_mm=400.0, u_um=0.2)
    for repeats, outcome in ((1, "remeasure"), (2, "fail")):
        chosen = (made.measurement == 3) & (made.point == 4) & (made.repeat <= repeats)
        assert decided(along_line(made, chosen, 10.0), facts, **ISO).finding == outcome


@pytest.mark.long
@pytest.mark.parametrize("across", [False, True])
def test_a_ball_of_a_plate_that_is_far_off_fails(across: bool) -> None:
    """10 mm along the plate, or off it: square to a distance that hardly changes its length, and is outside all the same."""
    x, y = np.meshgrid(np.arange(5) * 100.0, np.arange(5) * 100.0)
    body = np.column_stack([x.ravel(), y.ravel(), np.zeros(25)])
    count = 7
    xyz = np.vstack([body + np.array([200.0, 50.0, -400.0 + 50 * k]) for k in range(count)])
    points = Points(
        xyz, np.repeat(np.arange(1, count + 1), 25), np.tile(np.arange(1, 26), count), np.ones(25 * count, dtype=np.int64),
        recorded.MACHINE, {f"reference_{a}_mm": np.tile(body[:, i], count) for i, a in enumerate("xyz")},
    )  # fmt: skip
    facts = artefact_facts(kind="plate", length_mm=400.0, u_um=0.2)
    wish = {"standard": "VDI/VDE 2617", "limit_um": 40.0}
    assert decided(points, facts, **wish).finding == "pass"
    xyz = xyz.copy()
    xyz[30] += [0.0, 0.0, 5.0] if across else [10.0, 0.0, 0.0]
    found = decided(points.at(xyz), facts, **wish)
    assert found.finding == "fail"
    aside = [item for item in found.errors if item.set_aside]
    assert len(aside) == 24
    assert {item.outcome for item in aside} == {"fail"}
    if across:  # 5 mm off the plate lengthen 500 mm by 25 µm
        assert min(abs(item.error_um) for item in aside) == pytest.approx(25.0, abs=0.1)


@pytest.mark.parametrize("by_mm", [2.0, 10.0])
def test_a_bar_against_its_calibrated_length_fails(by_mm: float) -> None:
    lengths = [300.0] * 20
    lengths[4] += by_mm
    points, wish = recorded.bars(lengths=lengths).points, {"standard": "VDI/VDE 2617-2.1", "limit_um": 3.0}
    found = decided(points, bar_facts(300.0, 0.35), characteristic="U1", **wish)
    assert found.finding == "pass"  # the axes alone: the bar lies along a face diagonal
    found = decided(points, bar_facts(300.0, 0.35), characteristic="U2", **wish)
    assert found.finding == "fail"
    assert found.value_um == pytest.approx(1e3 * by_mm, abs=1e-3)


def test_a_temperature_that_cannot_be_trusted_is_not_taken_for_20_degrees() -> None:
    points = recorded.gauge().points
    temperatures = np.where(np.arange(len(points)) == 7, 293.15, 20.0)
    found = decided(with_columns(points, temp_artefact_c=temperatures), STEP_GAUGE, **ISO)
    assert found.outcome == "incomplete"
    assert any("temperature" in text for text in found.missing)


def test_a_face_found_exactly_where_another_lies_is_outside_and_no_copy() -> None:
    """The face at 20 mm found at 0, to the last digit, in all three repeats; six lengths, so that five remain."""
    lengths = [[*recorded.five(line), recorded.five(line)[1] + 30] for line in recorded.SEVEN]
    points = recorded.gauge(lengths=lengths).points
    xyz = points.xyz.copy()
    for repeat in (1, 2, 3):
        first, second = (rows(points, measurement=7, repeat=repeat, point=point) for point in (1, 2))
        xyz[second] = xyz[first]
    found = decided(points.at(xyz), STEP_GAUGE, **ISO)
    assert found.finding == "fail"
    assert [item.error_um for item in found.errors if item.set_aside] == pytest.approx([-2e4] * 3)
