"""Damaged jobs of parts are evaluated or refused in words; the whole study is ``python -m benchmarks.hostile.parts``."""

from __future__ import annotations

import tracemalloc

import numpy as np
import pytest

from benchmarks.hostile.parts import case, outcome
from cmm_uq.maths.geometry.repeated import Repeated


@pytest.mark.long
def test_a_damaged_job_of_a_part_is_evaluated_or_refused() -> None:
    ended = [(number, outcome(case(1, number)[1])) for number in range(150)]
    assert [one for one in ended if one[1] not in ("evaluated", "refused")] == []
    assert {found for _, found in ended} == {"evaluated", "refused"}


def test_a_feature_of_many_points_takes_memory_by_its_points_not_by_their_square() -> None:
    """4000 points of a plane have 12 000 coordinates, whose square alone is 1.2 GB; half of that is not reached."""
    random = np.random.default_rng(1)
    points = np.column_stack([random.uniform(0, 100, (4000, 2)), np.zeros(4000)])
    tracemalloc.start()
    Repeated("plane", points)
    most = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert most < 0.6e9
