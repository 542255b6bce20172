"""What is told of the pace of a run is arithmetic on what was counted."""

from __future__ import annotations

import pytest

from cmm_uq.laboratory.schedule.progress import Pace, duration, pace


def test_rate_and_remaining_time_follow_from_what_was_computed_alone() -> None:
    now = [100.0]
    found = Pace(400, lambda: now[0])
    assert str(found) == "0 of 400"
    for _ in range(100):
        found.add(computed=False)  # was there already
    assert str(found) == "100 of 400"
    now[0] += 50.0
    for i in range(100):
        found.add(failed=i < 3)
    assert str(found) == "200 of 400, 3 failed, 2.0/s, 1 min 40 s left"
    assert found.part == 0.5
    for _ in range(200):
        found.add()
    assert str(found) == "400 of 400, 3 failed, 6.0/s"


@pytest.mark.parametrize(("rate", "said"), [(2.04, "2.0/s"), (0.5, "30.0/min"), (0.01, "36.0/h")])
def test_a_rate_is_told_in_a_unit_in_which_there_are_some(rate: float, said: str) -> None:
    assert pace(rate) == said


@pytest.mark.parametrize(
    ("seconds", "said"), [(59.4, "59 s"), (59.6, "1 min 0 s"), (3599.0, "59 min 59 s"), (7260.0, "2 h 1 min")]
)
def test_a_duration_is_told_in_its_two_largest_units(seconds: float, said: str) -> None:
    assert duration(seconds) == said
