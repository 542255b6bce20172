"""What a recording of shifted series must be, and which placing mends it where it is not."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from cmm_uq.artefacts.shift.integration import calibration_curve, position_error
from cmm_uq.artefacts.shift.series import NOISE_RATIO, ShiftedSeries, common_period, shifted_series, undetermined
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.points import Floats, Points
from tests.artefacts.shift.shifted import PITCH_20, bent, read

PLACES = 20.0 * np.arange(6)
SHIFTS = np.array([0.0, 20.0])


def recorded(*shifts: float) -> Points:
    return read(bent, PLACES, shifts or (0.0, 20.0))


def moved(points: Points, row: int, by: float) -> Points:
    xyz = points.xyz.copy()
    xyz[row, 0] += by
    return replace(points, xyz=xyz)


def refused(points: Points, *shifts: float) -> CmmUqError:
    with pytest.raises(CmmUqError) as caught:
        shifted_series(points, "x", np.array(shifts), 0.1, "recording.csv")
    return caught.value


def test_one_placing_shows_nothing() -> None:
    error = refused(recorded(0.0), 0.0)
    assert "one placing only" in error.problem
    assert error.fix == "Shift it by about the pitch of its points and read it again"


def test_every_series_needs_its_shift() -> None:
    assert refused(recorded(), 0.0, 20.0, 40.0).problem == "3 shifts for 2 series"


@pytest.mark.parametrize(("shifts", "pair"), [((0.0, 0.0), "1 and 2"), ((0.0, 20.0, 20.0), "2 and 3")])
def test_a_shift_of_zero_and_two_equal_shifts_are_the_same_fault(shifts: tuple[float, ...], pair: str) -> None:
    error = refused(recorded(*shifts), *shifts)
    assert f"series {pair} have the same shift" in error.problem
    assert error.fix is not None
    assert f"Shift series {pair[-1]} by about the pitch" in error.fix


def test_a_shift_beyond_the_artefacts_length_reads_nothing_twice() -> None:
    error = refused(recorded(0.0, 300.0), 0.0, 300.0)
    assert "series 1, shifted by 0 mm, reads no range that another series reads" in error.problem
    assert error.fix is not None
    assert error.fix.startswith("Shift it by less than the 99.9953 mm it covers")


def test_a_far_placing_is_joined_by_one_between() -> None:
    points = recorded(0.0, 60.0, 120.0)
    assert len(shifted_series(points, "x", np.array([0.0, 60.0, 120.0]), 0.1).shifts) == 3


def test_series_of_different_length_name_the_point_that_is_alone() -> None:
    points = recorded()
    error = refused(points.select(np.arange(12) != 11), 0.0, 20.0)
    assert error.problem == "point 6 is read in series 1 only (the series have 6, 5 points)"
    assert error.fix == "Read point 6 in another series as well, or leave it out of series 1"


def test_a_series_of_one_point_is_named() -> None:
    points = recorded(0.0, 20.0, 40.0)
    assert "series 3 has fewer than two points" in refused(points.select(np.arange(18) < 13), 0.0, 20.0, 40.0).problem


def test_a_reading_out_of_order_is_named_with_its_line() -> None:
    points = replace(recorded(), lines=np.arange(2, 14))
    error = refused(moved(points, 8, 35.0), 0.0, 20.0)
    assert "series 2, point 4" in error.problem
    assert "out of order" in error.problem
    assert error.where == "recording.csv line 11"


def test_a_series_read_the_other_way_round_is_out_of_order() -> None:
    points = recorded()
    xyz = points.xyz.copy()
    xyz[6:] = xyz[6:][::-1]
    assert "series 2" in refused(replace(points, xyz=xyz), 0.0, 20.0).problem


def test_a_placing_that_stands_elsewhere_is_told_where() -> None:
    error = refused(recorded(0.0, 33.0), 0.0, 20.0)
    assert "shifted by 33 mm against the first, not by 20 mm" in error.problem
    assert error.fix == "Write 33, or mend the recording"


def test_a_noise_ratio_is_positive() -> None:
    points = replace(recorded(), columns={NOISE_RATIO: np.zeros(12)})
    assert refused(points, 0.0, 20.0).problem == "noise_ratio must be positive"


def test_repeats_are_averaged_by_their_weight() -> None:
    """Two readings, one twice as noisy: 4/5 and 1/5; the mean is 1/√1.25 as noisy as the better one."""
    points = read(bent, PLACES, (0.0, 20.0), repeats=2)
    second = points.repeat == 2
    xyz = points.xyz + np.column_stack([0.005 * second, 0 * second, 0 * second])
    noisy = replace(points, xyz=xyz, columns={NOISE_RATIO: np.where(second, 2.0, 1.0)})
    series = shifted_series(noisy, "x", SHIFTS, 0.1)
    np.testing.assert_allclose(series.reading, points.xyz[points.repeat == 1, 0] + 0.001, atol=1e-12)
    np.testing.assert_allclose(series.noise_scale, 1.25**-0.5)


def test_an_artefact_may_be_read_from_its_far_end() -> None:
    points = recorded()
    turned = replace(points, xyz=-points.xyz)
    series = shifted_series(turned, "x", -SHIFTS, 0.1)
    assert series.pair is not None
    np.testing.assert_allclose(series.pair[1] - series.pair[0], -20.0, atol=0.01)


def test_the_integrations_need_two_complete_series() -> None:
    points = recorded(0.0, 20.0, 40.0)
    assert shifted_series(points, "x", np.array([0.0, 20.0, 40.0]), 0.1).pair is None
    gap = points.select(np.arange(18) != 8)
    assert shifted_series(gap, "x", np.array([0.0, 20.0, 40.0]), 0.1).reading.shape == (17,)


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
