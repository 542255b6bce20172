"""How far an error has moved since the last certificate, by hand and against drawn machines."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from cmm_uq.laboratory.due.drift import YEAR
from cmm_uq.laboratory.due.drift_filter import change_since
from tests.laboratory.due.drifting import machine, one_node

STILL = {"rate_sd": 1e-9, "walk": 1e-9, "steps_per_year": 1e-9}


@pytest.mark.parametrize(("moves", "years", "change"), [
    ({"walk": 0.7}, 4.0, 0.7 * 2),  # a Wiener process
    ({"rate": -0.6}, 2.0, 0.6 * 2),  # a rate that is known; its sign is no matter
    ({"steps_per_year": 0.5, "step_sd": 2.0}, 2.0, 2.0),  # one step on average
    ({"walk": 0.6, "rate": 0.4}, 4.0, np.hypot(1.2, 1.6)),
])  # fmt: skip
def test_by_hand(moves: dict[str, float], years: float, change: float) -> None:
    prior = one_node(**(STILL | moves))
    for days in (years * YEAR, -years * YEAR):
        assert change_since(machine([0, 1], [0.2, 0.2]), days, prior=prior) == pytest.approx(change, rel=1e-6)


def test_a_rate_that_certificates_show_is_carried_on() -> None:
    """Four certificates on a line of 2 a year, each known to 0.01: after half a year it has moved by one."""
    prior = one_node(**(STILL | {"rate_sd": 5.0}))
    found = change_since(machine([0, 1, 2, 3], [0.0, 2, 4, 6], 0.01), 0.5 * YEAR, prior=prior)
    assert found == pytest.approx(1.0, rel=0.01)


def test_what_nobody_can_know() -> None:
    two = machine([0, 1], [0.2, 0.3])
    assert change_since(machine([0], [0.2]), 100.0) is None
    assert change_since(replace(two, adjusted_after=two.day[-1] + 1), 100.0) is None
    found = change_since(two, 100.0)
    assert found is not None
    assert found > 0
