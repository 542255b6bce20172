"""Rated conditions against what was recorded."""

from __future__ import annotations

import numpy as np
import pytest

from cmm_uq.analysis.conformity.uncertainty import rated_conditions
from cmm_uq.base.points import Points
from cmm_uq.jobs.tables.conformity import Circumstances, Declared, RatedConditions
from cmm_uq.jobs.tables.machine import ProbeFacts


def lacking(rated: RatedConditions, probe: ProbeFacts | None = None, **columns: list[float]) -> list[str]:
    count = max((len(values) for values in columns.values()), default=1)
    number = np.ones(count, dtype=np.int64)
    points = Points(np.zeros((count, 3)), number, number, number, columns={k: np.array(v) for k, v in columns.items()})
    found = rated_conditions(Circumstances(rated=rated, probe=probe or ProbeFacts()), points)
    return [text for condition in found for text in condition.missing if text != UNSTATED]


UNSTATED = "rated conditions: the temperatures for which the limits hold are not stated"
TEMPERATURE = RatedConditions(temperature_c=[18.0, 22.0])


def test_limits_hold_for_temperatures_that_are_stated_or_that_somebody_answers_for() -> None:
    number = np.ones(1, dtype=np.int64)
    points = Points(np.zeros((1, 3)), number, number, number, columns={"temp_x_c": np.array([20.0])})
    declared = RatedConditions(declared=Declared(by="A. Muster", reason="by the data sheet any"))
    for rated, missing in ((RatedConditions(), [UNSTATED]), (declared, []), (TEMPERATURE, [])):
        found = rated_conditions(Circumstances(rated=rated), points)
        assert [text for condition in found for text in condition.missing] == missing


@pytest.mark.parametrize(("recorded", "met"), [([18.0, 22.0], True), ([17.99, 20.0], False), ([20.0, 22.01], False)])
def test_every_temperature_lies_within_the_rated_ones(recorded: list[float], met: bool) -> None:
    assert (lacking(TEMPERATURE, temp_x_c=[20.0, 20.0], temp_artefact_c=recorded) == []) == met


def test_what_was_not_recorded_is_not_shown() -> None:
    assert lacking(TEMPERATURE) == ["rated temperature 18 to 22 °C: no temperature is recorded (temp_…_c)"]
    assert lacking(RatedConditions(change_k_per_h=1.0), temp_x_c=[20.0]) == [
        "rated change of temperature 1 K/h: no temperature is recorded over time (temp_…_c, time_s)"
    ]
    assert lacking(RatedConditions(difference_k=1.0), temp_x_c=[20.0]) == [
        "rated difference of temperatures 1 K: one temperature at most is recorded"
    ]


def test_a_change_is_the_largest_within_an_hour() -> None:
    """Half a kelvin in each half hour: 1 K in an hour, 1.5 K in all; the rows in any order."""
    time, values = [5400.0, 0.0, 1800.0, 3600.0], [21.5, 20.0, 20.5, 21.0]
    assert lacking(RatedConditions(change_k_per_h=1.0), time_s=time, temp_air_c=values) == []
    assert lacking(RatedConditions(change_k_per_h=0.99), time_s=time, temp_air_c=values) == [
        "rated change of temperature 0.99 K/h (1 K in an hour)"
    ]


def test_a_difference_is_between_places_at_one_time() -> None:
    columns = {"temp_table_top_c": [20.0, 22.0], "temp_table_bottom_c": [19.2, 21.5]}
    assert lacking(RatedConditions(difference_k=0.8), **columns) == []
    assert lacking(RatedConditions(difference_k=0.7), **columns) == ["rated difference of temperatures 0.7 K (0.8 K)"]


def test_probe_and_stylus_are_those_for_which_the_limits_hold() -> None:
    rated = RatedConditions(probe="TP200", stylus="20 mm, 4 mm ball")
    assert lacking(rated, ProbeFacts(name="TP200", stylus="20 mm, 4 mm ball")) == []
    assert lacking(rated, ProbeFacts(name="TP20")) == [
        "rated probe TP200 (TP20)", "rated stylus 20 mm, 4 mm ball (not stated)",
    ]  # fmt: skip
