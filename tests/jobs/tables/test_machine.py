"""Keys of ``[[machine.axes]]``: what goes together, and what is said where it does not."""

from __future__ import annotations

from typing import Any

import pytest
from pydantic import ValidationError

from cmm_uq.jobs.tables.machine import MachineFacts, stated_axes

ONE = {"names": ["x", "y"], "reading": "exposed optical grating", "source": "data sheet, 2024-05", "period_mm": 0.02}


def test_axes_are_known_by_their_names_and_unknown_ones_are_not() -> None:
    facts = MachineFacts.model_validate({"name": "A", "axes": [ONE, {"names": ["z"], "reading": "unknown"}]})
    assert list(stated_axes(facts.axes)) == ["x", "y"]


@pytest.mark.parametrize(("change", "problem"), [
    ({"source": ""}, "nobody states this: name the data sheet"),
    ({"reading": "grating"}, "exposed optical grating"),
    ({"names": ["x", "w"]}, "'x', 'y' or 'z'"),
    ({"names": []}, "at least 1"),
    ({"reading": "unknown"}, 'reading = "unknown" knows no period_mm'),
    ({"grade": 3}, "grade is of reading = \"ball screw and rotary encoder\""),
    ({"reading": "ball screw and rotary encoder", "grade": 3, "period_mm": None}, "grade is of a period, of a screw its lead"),
    ({"reading": "ball screw and rotary encoder", "grade": 2, "period_mm": 5.0}, "1, 3, 5 or 7"),
    ({"reading": "ball screw and rotary encoder"}, "period_mm = 0.02: of a screw the lead"),
    ({"interpolation_um": 11.0}, "interpolation_um = 11 is more than half of period_mm = 0.02"),
    ({"interpolation_um": 0.2, "period_mm": None}, "interpolation_um is of a period"),
    ({"deviation": [[1000.0]]}, "at least 2 items"),
    ({"play_um": -1.0}, "greater than 0"),
    ({"pitch": 5}, "Extra inputs are not permitted"),
])  # fmt: skip
def test_what_does_not_go_together_is_refused_in_words(change: dict[str, Any], problem: str) -> None:
    with pytest.raises(ValidationError) as refused:
        MachineFacts.model_validate({"name": "A", "axes": [ONE | change]})
    assert problem in str(refused.value)


def test_an_axis_is_stated_once() -> None:
    with pytest.raises(ValidationError, match="how y is read is stated twice"):
        MachineFacts.model_validate({"name": "A", "axes": [ONE, ONE | {"names": ["y", "z"]}]})
