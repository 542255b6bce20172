"""Readings of error maps that jump, in maps made for it and in the real ones."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from cmm_uq.artefacts.error_maps.columns import columns_of, spikes
from cmm_uq.base.units import ARCSECOND, METRE, MICROMETRE
from cmm_uq.machine.physics.error_map import AxisErrors, ErrorMap, read_error_map
from tests.conftest import ROOT

PLACE = np.arange(0, 601, 25.0)
COURSE = 0.02 * np.sin(PLACE / 130) + 2e-5 * PLACE
SIGMA = 0.5 * MICROMETRE


def maps(count: int = 3, seed: int = 1) -> np.ndarray:
    """One error in several maps: the same course, and white noise of 0.5 µm."""
    return COURSE + SIGMA * np.random.default_rng(seed).standard_normal((count, len(PLACE)))


def with_spikes(values: np.ndarray, *places: tuple[int, int, float]) -> np.ndarray:
    """(map, position, µm)."""
    found = values.copy()
    for k, i, um in places:
        found[k, i] += um * MICROMETRE
    return found


def found(values: np.ndarray) -> set[tuple[int, int]]:
    return {(int(k), int(i)) for k, i in zip(*np.nonzero(spikes(PLACE, values, MICROMETRE)), strict=True)}


def test_a_jump_of_twenty_times_the_noise_is_a_spike_of_its_map() -> None:
    assert found(with_spikes(maps(), (1, 10, 10.0))) == {(1, 10)}
    assert found(with_spikes(maps(4), (3, 10, -10.0))) == {(3, 10)}


def test_of_two_maps_the_one_whose_own_course_jumps_has_it() -> None:
    assert found(with_spikes(maps(2), (1, 10, 15.0))) == {(1, 10)}
    assert found(with_spikes(maps(2), (0, 12, -15.0))) == {(0, 12)}


def test_two_in_a_row_and_a_third_near_by_hide_no_sound_reading_between_them() -> None:
    """As in the real map of Z at 30 °C: −125, −100 and −50 mm are off, −75 mm is sound."""
    assert found(with_spikes(maps(), (2, 15, 11.0), (2, 16, 9.0), (2, 18, 14.0))) == {(2, 15), (2, 16), (2, 18)}


def test_what_every_map_has_is_no_spike() -> None:
    feature = np.zeros(len(PLACE))
    feature[10] = 10 * MICROMETRE
    assert found(maps() + feature) == set()


def test_where_a_map_goes_on_at_another_level_is_none() -> None:
    """A step, whose edges lie off one side alone, and a block of five readings."""
    step = np.where(PLACE > 300, 12 * MICROMETRE, 0.0)
    block = np.where((PLACE >= 200) & (PLACE <= 300), 12 * MICROMETRE, 0.0)
    for what in (step, block):
        assert found(maps() + np.outer([0, 1, 0], what)) == set()


def test_a_scale_that_expands_has_none() -> None:
    assert found(maps() + np.outer([0.0, 5, 10], 12e-6 * PLACE)) == set()


def test_a_jump_within_the_maps_own_noise_is_none() -> None:
    """5 µm are ten times the noise of the other maps, and two of that of this one."""
    noisy = maps()
    noisy[2] += 2.5 * MICROMETRE * np.random.default_rng(8).standard_normal(len(PLACE))
    clean = found(noisy)
    assert found(with_spikes(noisy, (2, 10, 5.0))) == clean
    assert (2, 10) in found(with_spikes(noisy, (2, 10, 60.0)))


def test_sound_maps_have_hardly_any() -> None:
    """Of 2 × 3 × 200 courses, white or following themselves, at most one in a hundred has any."""
    random, count = np.random.default_rng(2026), 0
    for i in range(200):
        noise = random.standard_normal((3, len(PLACE)))
        if i % 2:
            for j in range(1, len(PLACE)):
                noise[:, j] = 0.8 * noise[:, j - 1] + 0.6 * noise[:, j]
        count += bool(found(COURSE + SIGMA * noise))
    assert count <= 2


@settings(max_examples=30, deadline=None)
@given(
    st.integers(1, 23),
    st.integers(0, 2),
    st.sampled_from([-40.0, 25.0, 60.0]),
    st.floats(-1e-4, 1e-4),
    st.integers(0, 99),
)
def test_what_maps_share_and_where_they_begin_changes_no_spike(
    i: int, k: int, um: float, slope: float, seed: int
) -> None:  # fmt: skip
    values = with_spikes(maps(seed=seed), (k, i, um))
    assert (k, i) in found(values)
    assert found(values + slope * PLACE + np.array([[0.3], [-0.1], [2.0]])) == found(values)


def test_the_mirrored_map_has_the_mirrored_spikes() -> None:
    values = with_spikes(maps(), (0, 4, 20.0), (2, 17, -20.0))
    turned = spikes(-PLACE[::-1], values[:, ::-1], MICROMETRE)[:, ::-1]
    assert np.array_equal(turned, spikes(PLACE, values, MICROMETRE))


# ---- the maps of Harris 2004, tables 8 to 16


@pytest.fixture(scope="module")
def real() -> list[ErrorMap]:
    folder = ROOT / "examples" / "iota-1102-maps"
    return [read_error_map(folder / f"error_map_{t}C.csv", temperature=t) for t in (20, 25, 30)]


def test_the_spikes_of_the_real_maps_are_those_that_a_reader_sees(real: list[ErrorMap]) -> None:
    """By hand: Z at 30 °C falls by 2.4 µm a step (−14.3, then −7.7 at −75 and −2.4 at −25), but for −0.9, −0.6 and 9.2; Y at
    30 °C rises by 4.9 ± 0.6 µm a step, but by 1.9 and 7.7 to and from 25 mm."""
    told = [f.why for f in columns_of(real)[1] if f.kind == "outlier"]
    places = [
        ("scale error of Y at 25 mm", "30 °C, 1.9"), ("scale error of Z at −125 mm", "30 °C, −0.9"),
        ("scale error of Z at −100 mm", "30 °C, −0.6"), ("scale error of Z at −50 mm", "30 °C, 9.2"),
    ]  # fmt: skip
    assert len(told) == len(places)
    for why, (where, what) in zip(told, places, strict=True):
        assert where in why
        assert what in why


def test_every_other_position_of_the_real_maps_is_compared(real: list[ErrorMap]) -> None:
    """Among them the two sound ones in the rotations: X about Y at 450 mm, Z about X at −225 mm."""
    left = {column.title: len(column.positions) for column in columns_of(real)[0]}
    assert left["rotation of X about Y"] == 37
    assert left["rotation of Z about X"] == 21
    assert (left["scale error of Y"], left["scale error of Z"]) == (22, 18)


def test_a_column_that_jumps_throughout_is_left_out_as_a_whole(real: list[ErrorMap]) -> None:
    """The rotation of X about Y at 30 °C, every third reading off by 40″."""
    x, y, z = real[2].axes
    errors = x.errors.copy()
    errors[1::3, 4] += 40 * ARCSECOND * np.where(np.arange(len(errors[1::3])) % 2, 1, -1)
    jumping = ErrorMap((AxisErrors(x.positions, errors), y, z), temperature=30)
    columns, findings = columns_of([*real[:2], jumping])
    kept = next(c for c in columns if c.title == "rotation of X about Y")
    assert kept.temperatures.tolist() == [20, 25]
    assert np.allclose(kept.values[0], METRE * real[0].axes[0].errors[:, 4])
    assert any("jumps in more than a quarter of its readings in the map at 30 °C" in f.why for f in findings)
