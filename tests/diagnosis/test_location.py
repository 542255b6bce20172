"""Where a curve is large."""

from __future__ import annotations

import numpy as np
import pytest

from cmm_uq.diagnosis.location import region_of

PLACES = 10.0 * np.arange(7)


@pytest.mark.parametrize(
    ("curve", "region"),
    [
        ([0, 1, 2, 4, 2, 1, 0], (20.0, 40.0)),  # half of the largest belongs to it
        ([0, 1, 1.99, 4, 2.01, 1, 0], (30.0, 40.0)),
        ([0, -1, -3, -4, -3, -1, 0], (20.0, 40.0)),
        ([-4, 3, 1, 0, 3, 3, 3], (0.0, 10.0)),  # what lies apart does not
        ([3, 0, 1, 0, 2, 3, 5], (50.0, 60.0)),
        ([3, 3, 3, 4, 3, 3, 3], (0.0, 60.0)),
        ([0, 0, 0, 0, 0, 0, -1], (60.0, 60.0)),
        ([2, 0, 0, 0, 0, 0, 0], (0.0, 0.0)),
        ([3, 4, -3, 1, 0, 0, 0], (0.0, 20.0)),
    ],
)
def test_the_region_is_where_the_curve_exceeds_half_of_its_largest_value(
    curve: list[float], region: tuple[float, float]
) -> None:
    assert region_of(PLACES, np.array(curve, dtype=np.float64)) == region
