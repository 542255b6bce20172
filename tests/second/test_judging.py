"""What the second study counts as found, blamed, held and right."""

from __future__ import annotations

import math

import pytest

from benchmarks.second.judging import (
    artefact_named,
    covered,
    hit,
    innocent,
    machine_blamed,
    period_told,
    recognised,
    same,
    tenths,
    there,
    told,
)


def said(*names: str, groups: tuple[tuple[str, ...], ...] = (), verdict: str = "explained") -> dict:
    effect = {"probability": 0.9, "together": 0.9, "parameters": {}}
    return {"verdict": verdict, "effects": dict.fromkeys(names, effect), "groups": list(groups)}


TRUTH = {"kind": "one", "hidden": {"scale_x": 3.0}, "rivals": {"scale_x": ["rotation_x_y"]}}


def test_an_effect_is_found_by_name_in_a_group_or_by_what_nobody_could_tell_from_it() -> None:
    assert hit(TRUTH, said("scale_x"))
    assert hit(TRUTH, said("drift_x", groups=(("drift_x", "scale_x"),)))
    assert hit(TRUTH, said("rotation_x_y"))
    told = said("drift_x")
    told["effects"]["drift_x"] = {**told["effects"]["drift_x"], "group": ["scale_x", "scale_z"]}
    assert hit(TRUTH, told)
    assert not hit(TRUTH, said("drift_x"))
    assert not hit(TRUTH, said())
    assert not hit({**TRUTH, "hidden": {"scale_x": 3.0, "scale_y": 1.0}}, said("scale_x"))


def test_innocent_is_what_is_neither_there_nor_named_with_what_is() -> None:
    assert innocent(TRUTH, said("scale_x", "drift_y")) == ["drift_y"]
    assert innocent(TRUTH, said("drift_y", groups=(("drift_y", "scale_x"),))) == []
    assert innocent(TRUTH, said("rotation_x_y")) == []


def test_the_machine_is_blamed_where_no_word_is_said_of_the_artefact() -> None:
    assert machine_blamed(said("rotation_x_y", "artefact_pattern")) == ["rotation_x_y"]
    alike = said("rotation_x_y", groups=(("rotation_x_y", "artefact_pattern"),))
    assert machine_blamed(alike) == []
    assert artefact_named(alike)
    assert not artefact_named(said("rotation_x_y"))
    assert machine_blamed(said("thermal_artefact")) == []


def test_something_unknown_is_recognised_by_the_verdict() -> None:
    assert [recognised(said(verdict=v)) for v in ("unexplained", "partial", "explained", "consistent")] == [
        True, True, False, False]  # fmt: skip


def test_an_effect_is_there_by_itself_or_with_its_group() -> None:
    assert there("drift_x", TRUTH, {"drift_x", "scale_x"}) == (False, True)
    outside = {"kind": "outside", "hidden": {}}
    assert there("drift_x", outside, ("scale_x", "error along X as a function of the place")) == (False, True)
    assert there("drift_x", outside, ("scale_x",)) == (False, False)


def test_of_an_artefacts_fault_right_is_what_it_is_or_what_nobody_could_tell_from_it() -> None:
    fault = {
        "kind": "artefact, geometry",
        "hidden": {},
        "is": ["artefact_scale_x"],
        "alike": ["artefact_pattern", "scale_x"],
    }
    assert there("artefact_scale_x", fault, ()) == (True, True)
    assert there("scale_x", fault, {"scale_x", "scale_y"}) == (True, True)
    assert there("artefact_bending", fault, {"artefact_bending", "artefact_pattern"}) == (False, True)
    assert there("artefact_bending", fault, {"artefact_bending", "drift_x"}) == (False, False)


def test_effects_of_an_artefact_that_are_the_same_are_one_statement() -> None:
    """Said 0.3 and 0.6 of two that are one, 0.05 of both at once: of the statement 0.95, whichever is named."""
    fault = {"kind": "artefact, geometry", "hidden": {}, "is": ["artefact_a", "artefact_b"], "alike": ["artefact_pattern"],
             "same": [["artefact_a", "artefact_b"], ["artefact_c", "artefact_d"]]}  # fmt: skip
    found = said("artefact_a", "artefact_c", "artefact_pattern")
    for name, p in (("artefact_a", 0.35), ("artefact_c", 0.2), ("artefact_pattern", 0.1)):
        found["effects"][name] = {**found["effects"][name], "probability": p}
    found["remaining"] = [
        [0.3, ["artefact_a"]],
        [0.6, ["artefact_b"]],
        [0.05, ["artefact_a", "artefact_b"]],
        [0.02, ["artefact_d"]],
    ]
    assert told("artefact_a", fault, found) == (pytest.approx(0.95), True)
    assert told("artefact_c", fault, found) == (0.2, False)
    assert told("artefact_pattern", fault, found) == (0.1, True)
    assert told("artefact_a", {**TRUTH, "same": fault["same"]}, found) == (0.35, False)
    del found["remaining"]
    assert told("artefact_a", fault, found) == (0.35, True)


def test_a_phase_is_held_on_the_circle_and_turned_half_where_the_amplitude_is_negative() -> None:
    truth = {"hidden": {"periodic_scale_x": -2.0}, "period": 50.0, "phase": 0.1}
    found = said("periodic_scale_x")
    found["effects"]["periodic_scale_x"]["parameters"] = {
        "amplitude_um": [2.1, 0.2, 1.7, 2.5],
        "period_mm": [52.0, 0.5, 51.0, 53.0],
        "phase_rad": [-3.0, 0.1, -3.2, -2.8],
    }
    assert covered(truth, found) == [("amplitude_um", True), ("period_mm", False), ("phase_rad", True)]
    positive = {**truth, "hidden": {"periodic_scale_x": 2.0}}
    assert covered(positive, found)[2] == ("phase_rad", False)


def test_a_period_is_told_by_its_interval_or_among_the_others_that_fit() -> None:
    truth = {"hidden": {"periodic_scale_x": 2.0}, "period": 50.0, "phase": 0.1}
    found = said("periodic_scale_x")
    parameters = {"period_mm": [30.0, 0.5, 29.0, 31.0]}
    found["effects"]["periodic_scale_x"] = {**found["effects"]["periodic_scale_x"], "parameters": parameters}
    assert not period_told(truth, found)
    found["effects"]["periodic_scale_x"]["periods"] = [75.0, 50.4]
    assert period_told(truth, found)


def test_rows_in_another_order_are_the_same_to_a_thousandth_of_u() -> None:
    def one(value: float) -> dict:
        return {
            "verdict": "explained",
            "groups": [],
            "effects": {"scale_x": {"parameters": {"ppm": [value, 1.0, 0, 9]}}},
        }

    assert same(one(5.0) | {"in_order": one(5.0005)})
    assert not same(one(5.0) | {"in_order": one(5.01)})
    assert not same(one(5.0) | {"in_order": one(5.0) | {"verdict": "partial"}})


def test_each_tenth_has_its_own_count_mean_and_expected_spread() -> None:
    rows = tenths([0.95, 0.95, 0.55, 1.0], [True, False, True, True])
    assert [(row[0], pytest.approx(row[1]), row[2]) for row in rows] == [(1, 0.55, 1), (3, 2.9 / 3, 2)]
    low, high = rows[1][4]
    assert low == pytest.approx(2.9 / 3 - 1.96 * math.sqrt(2 * 0.95 * 0.05) / 3)
    assert high == 1.0
