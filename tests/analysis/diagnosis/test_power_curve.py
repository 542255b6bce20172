"""From the sizes at which drawn recordings are detected and named to amplitudes and probabilities, by counting."""

from __future__ import annotations

import numpy as np
import pytest

from cmm_uq.analysis.diagnosis.power import Power


def known(per_unit: float = 2.0, allowed: float = 10.0) -> Power:
    """Ten recordings, detected from sizes 1 to 10 on and named from three more on, of an effect of size 2 a unit."""
    sizes = np.array([3.0, 1.0, 2.0, 5.0, 4.0, 6.0, 10.0, 8.0, 7.0, 9.0])
    return Power("scale_x", "ppm", "ppm", allowed, per_unit, sizes, sizes + 3.0)


@pytest.mark.parametrize(
    ("amplitude", "detected", "named"),
    [(0.49, 0.0, 0.0), (0.5, 0.1, 0.0), (-2.5, 0.5, 0.2), (2.49, 0.4, 0.1), (5.0, 1.0, 0.7), (6.5, 1.0, 1.0)],
)
def test_an_amplitude_is_found_in_the_recordings_whose_size_it_reaches(
    amplitude: float, detected: float, named: float
) -> None:
    assert known().detected(amplitude) == pytest.approx(detected)
    assert known().named(amplitude) == pytest.approx(named)


def test_the_amplitude_found_with_80_percent_is_within_what_physics_allows() -> None:
    """A size of 9: of ranks 0 to 9 the quantile 0.8 is at 7.2, and the higher of its neighbours is the ninth."""
    assert known().detectable == pytest.approx(4.5)
    assert known().identifiable == pytest.approx(6.0)
    assert known(allowed=4.5).detectable == pytest.approx(4.5)
    assert known(allowed=4.49).detectable is None
    assert known(allowed=5.9).identifiable is None
    assert known(per_unit=0.0).detectable is None
