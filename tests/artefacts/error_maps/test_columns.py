"""Columns of error maps that repeat another map's figures."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from cmm_uq.artefacts.error_maps.columns import columns_of, copies, spikes
from cmm_uq.artefacts.error_maps.diagnosis import diagnose_maps
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.units import ARCSECOND, METRE, MICROMETRE
from cmm_uq.jobs.tables.machine import ErrorMapFile
from cmm_uq.machine.physics.error_map import AxisErrors, ErrorMap, read_error_map
from tests.conftest import ROOT


def rounded_maps(count: int = 3, seed: int = 1) -> np.ndarray:
    random = np.random.default_rng(seed)
    return np.round(COURSE + SIGMA * random.standard_normal((count, len(PLACE))), 4)


def test_maps_that_were_measured_are_no_copies() -> None:
    assert all(copies(rounded_maps(4, seed), MICROMETRE) == [] for seed in range(50))


def test_a_copy_is_found_with_what_it_is_a_copy_of() -> None:
    values = rounded_maps(5)
    values[3], values[4] = values[1], values[0] + 0.3
    assert copies(values, MICROMETRE) == [(0, 4), (1, 3)]


def test_a_copy_with_a_few_readings_changed_is_one() -> None:
    values = rounded_maps()
    values[1] = values[0]
    values[1, [3, 9, 17]] += 0.02
    assert copies(values, MICROMETRE) == [(0, 1)]


def test_a_copy_in_fewer_digits_is_one() -> None:
    """Figures of 0.1 µm, rounded to whole micrometres."""
    values = rounded_maps()
    values[2] = np.round(values[1], 3)
    assert copies(values, MICROMETRE) == [(1, 2)]


def test_another_run_in_fewer_digits_is_none() -> None:
    """Two runs with a noise of 0.5 µm each agree within half a micrometre in half of 25 readings, not in all."""
    assert not any(
        copies(np.vstack([one[0], np.round(one[1], 3)]), MICROMETRE)
        for one in (rounded_maps(2, seed) for seed in range(40))
    )


def test_maps_of_few_whole_figures_are_alike_without_being_copies() -> None:
    """Straightnesses of −1, 0 and 1 µm."""
    random = np.random.default_rng(4)
    values = 1e-3 * random.integers(-1, 2, (3, 25)).astype(float)
    values[1] = values[0]
    values[1, ::4] += 1e-3
    assert copies(values, MICROMETRE) == []


def test_a_column_of_nothing_is_no_copy_of_another() -> None:
    assert copies(np.zeros((3, 25)), MICROMETRE) == []


def machine_map(temperature: float, **columns: np.ndarray) -> ErrorMap:
    """A map of X alone."""
    table = np.zeros((len(PLACE), 6))
    for name, values in columns.items():
        table[:, ("dx", "dy", "dz", "rx", "ry", "rz").index(name)] = values
    rest = AxisErrors(PLACE, np.zeros((len(PLACE), 6)))
    return ErrorMap((AxisErrors(PLACE, table), rest, rest), temperature=temperature)


def three_with_a_copy(expansion: float) -> list[ErrorMap]:
    """20, 25 and 30 °C; the scale's figures at 25 °C are those of 20 °C."""
    values = rounded_maps() + expansion * np.outer([0, 5, 10], PLACE)
    values[1] = values[0]
    return [
        machine_map(t, dx=v, dy=rounded_maps(seed=2)[i])
        for i, (t, v) in enumerate(zip((20, 25, 30), values, strict=True))
    ]


def test_a_scale_whose_figures_stand_above_two_temperatures_accuses_no_third_map_and_gives_no_expansion() -> None:
    """Whether 54 µm came with 5 K or with 10 K nobody knows."""
    columns, findings = columns_of(three_with_a_copy(9e-6))
    assert [c.title for c in columns] == ["straightness of X along Y"]
    copied = next(f for f in findings if f.kind == "copied")
    assert copied.why.startswith("scale error of X: the maps at 20, 25 °C give the same figures")
    found = diagnose_maps(columns, (), alpha=0.01, seed=0)
    assert found.verdict == "consistent"
    assert not found.effects


def test_two_pairs_of_copies_are_told_apart() -> None:
    values = rounded_maps(4)
    values[1], values[3] = values[0], values[2]
    given = [machine_map(t, dy=v) for t, v in zip((18, 20, 22, 24), values, strict=True)]
    told = [f.why for f in columns_of(given)[1] if f.kind == "copied"]
    assert [why.split("maps at ")[1].split(" °C")[0] for why in told] == ["18, 20", "22, 24"]


def test_a_map_at_a_temperature_in_kelvin_is_refused() -> None:
    assert ErrorMapFile(file="a.csv", temperature_c=25.0).temperature_c == 25.0
    with pytest.raises(ValueError, match=r"298\.15 K are 25 °C"):
        ErrorMapFile(file="a.csv", temperature_c=298.15)
    with pytest.raises(ValueError, match="no machine is mapped at 150 °C"):
        ErrorMapFile(file="a.csv", temperature_c=150.0)


def test_the_error_names_the_key(tmp_path: object) -> None:
    import cmm_uq

    with pytest.raises(CmmUqError, match=r"error_map\.0\.temperature_c"):
        cmm_uq.job(
            machine={"name": "M", "error_map": [{"file": "a.csv", "temperature_c": 293.15}]}, artefact="error_map", effects=[],
        )  # fmt: skip


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
