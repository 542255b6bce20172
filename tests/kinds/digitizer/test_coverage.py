"""95 % intervals for the offset hold the truth in 95 % of simulated recordings."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats

from benchmarks.artefacts.digitizer_coverage import cases

RECORDINGS = 300
CHANCE = 1e-4 / (2 * 4 * 3)
"""Of one bound, of two for each of four coverages in three cases: together they fail once in ten thousand by chance."""


@pytest.mark.parametrize("which", [1, 3, 5])
def test_intervals_hold_the_truth_as_often_as_they_say(which: int) -> None:
    """Scans with all that may be in doubt, centres with stated noise, centres with noise to be found."""
    hits, u = cases()[which].coverage(RECORDINGS)
    low, high = stats.binom.ppf([CHANCE, 1 - CHANCE], RECORDINGS, 0.95)
    assert np.all(hits >= low)
    assert np.all(hits <= high)
    assert np.all(u > 1)
