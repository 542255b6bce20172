"""What shifts leave free: counted by hand, and shown to change no reading."""

from __future__ import annotations

import numpy as np
import pytest

from cmm_uq.artefacts.shift.integration import calibration_curve, position_error
from cmm_uq.artefacts.shift.series import ShiftedSeries, common_period, shifted_series, undetermined
from cmm_uq.base.points import Floats
from tests.artefacts.shifting.shifted import PITCH_20, bent, read

PITCH_40 = 40.0 * np.arange(12)


def series(places: Floats, *shifts: float, u_shift: float = 0.1) -> ShiftedSeries:
    return shifted_series(read(bent, places, shifts), "x", np.array(shifts), u_shift)


def test_a_shift_by_the_pitch_determines_all_but_a_constant_and_a_slope() -> None:
    assert undetermined(series(PITCH_20, 0.0, 20.0), scale_known=True).patterns.shape[1] == 0


def test_a_shift_by_half_the_pitch_leaves_every_pair_of_places_by_itself() -> None:
    """24 places, 12 differences: 12 pairs may lie at any height; a constant and the slope of a free shift are not counted."""
    assert undetermined(series(PITCH_40, 0.0, 20.0), scale_known=False).patterns.shape[1] == 11


@pytest.mark.parametrize(("u_shift", "free"), [(0.1, 1), (0.0, 0)])
def test_a_third_placing_by_a_pitch_joins_the_pairs_up_to_the_height_of_a_free_shift(u_shift: float, free: int) -> None:
    """0, 20 and 40 mm: the second placing reads the places between, all of them higher or lower by its own shift's error."""
    found = undetermined(series(PITCH_40, 0.0, 20.0, 40.0, u_shift=u_shift), scale_known=True)
    assert found.patterns.shape[1] == free


def test_two_interleaved_grids_may_lie_at_two_heights() -> None:
    """Shifts of 20 and 50 mm of a pitch of 20: the grids of even and odd tens are joined by a free shift alone."""
    found = undetermined(series(PITCH_20, 0.0, 20.0, 50.0), scale_known=True)
    assert found.patterns.shape[1] == 1
    steps = np.diff(np.sign(found.patterns[3:-3, 0]))  # near the ends one grid only was read
    assert np.all(steps != 0)


@pytest.mark.parametrize("shifts", [(0.0, 20.0), (0.0, 20.0, 100.0)])
def test_what_is_called_free_changes_no_reading(shifts: tuple[float, ...]) -> None:
    """Points and shifts that follow it absorb every such pattern, by least squares on dummy columns."""
    found = series(PITCH_40, *shifts)
    patterns = undetermined(found, scale_known=False).patterns
    assert patterns.size
    place = np.abs(found.reading[:, None] - found.positions).argmin(axis=1)
    dummies = np.hstack([np.eye(len(found.numbers))[found.point], np.eye(len(shifts))[found.series]])
    for pattern in patterns.T:
        left = pattern[place] - dummies @ np.linalg.lstsq(dummies, pattern[place], rcond=None)[0]
        np.testing.assert_allclose(left, 0.0, atol=1e-9)


def test_an_error_of_the_shifts_own_period_is_invisible() -> None:
    """5 µm of period 20 mm, shifted by 20 mm: no integration sees any of it."""
    places = PITCH_20 + np.random.default_rng(1).uniform(-8, 8, 23)
    points = read(lambda x: 5e-3 * np.sin(2 * np.pi * x / 20), places, (0.0, 20.0))
    a, b = points.xyz[:23, 0], points.xyz[23:, 0]
    assert np.abs(position_error(a, calibration_curve(a, b, 20.0))).max() < 1e-9


@pytest.mark.parametrize(
    ("shifts", "period"),
    [((0.0, 20.0), 20.0), ((0.0, 20.0, 50.0), 10.0), ((0.0, 40.0, 100.0), 20.0), ((0.0, 20.003, 39.998), 20.0),
     ((5.0, -15.0, 25.0), 20.0)],
)  # fmt: skip
def test_the_common_period_is_the_largest_length_that_all_shifts_are_multiples_of(
    shifts: tuple[float, ...], period: float
) -> None:
    assert common_period(np.array(shifts)) == pytest.approx(period, abs=0.02)
