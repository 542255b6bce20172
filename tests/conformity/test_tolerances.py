"""A parameter against its tolerance: by its whole 95 % interval, on both sides of zero."""

from __future__ import annotations

import pytest

from cmm_uq.conformity.tolerances import Judged
from cmm_uq.uncertainty.quantity import Quantity


@pytest.mark.parametrize(
    ("low", "high", "verdict"),
    [
        (-4.0, 5.0, "in"),  # an end at the tolerance is within it
        (-5.0, 4.0, "in"),
        (-4.0, 5.1, "open"),
        (-5.1, 4.0, "open"),
        (-6.0, 6.0, "open"),
        (5.0, 6.0, "open"),  # the tolerance itself conforms
        (5.1, 6.0, "out"),
        (-6.0, -5.0, "open"),
        (-6.0, -5.1, "out"),
    ],
)
def test_a_tolerance_of_five(low: float, high: float, verdict: str) -> None:
    quantity = Quantity((low + high) / 2, (high - low) / 4, (low, high), "ppm")
    assert Judged("scale_x", "Scale of X", "ppm", quantity, 5.0).verdict == verdict
