"""Error maps against each other: what changes with temperature, and which map contradicts the others."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from cmm_uq.artefacts.error_maps.columns import MapColumn, columns_of, roughness, turned
from cmm_uq.artefacts.error_maps.comparison import column_comparison, expansion as expansion_of
from cmm_uq.artefacts.error_maps.diagnosis import MapsDiagnosis, diagnose_maps
from cmm_uq.base.units import ARCSECOND, MICROMETRE
from cmm_uq.machine.physics.error_map import AxisErrors, ErrorMap, read_error_map
from tests.conftest import ROOT

PLACE = np.arange(0, 601, 25.0)
THREE = np.array([20.0, 25.0, 30.0])
COURSE = 0.02 * np.sin(PLACE / 130) + 2e-5 * PLACE
SIGMA = 0.5 * MICROMETRE


def column(*, component: int = 0, temperatures: np.ndarray = THREE, seed: int = 1, sigma: float = SIGMA) -> MapColumn:
    """One error of X in every map: the same course, and white noise."""
    random = np.random.default_rng(seed)
    values = COURSE + sigma * random.standard_normal((len(temperatures), len(PLACE)))
    return MapColumn("x", component, PLACE, values, temperatures)


def plus(given: MapColumn, what: np.ndarray) -> MapColumn:
    return replace(given, values=given.values + what)


def diagnosed(*columns: MapColumn, named: tuple[str, ...] = ()) -> MapsDiagnosis:
    return diagnose_maps(columns, named, alpha=0.01, seed=0)


def expansion(ppm_per_k: float, temperatures: np.ndarray = THREE) -> np.ndarray:
    return 1e-6 * ppm_per_k * np.outer(temperatures - 20, PLACE)


def in_map(k: int, function: np.ndarray) -> np.ndarray:
    return np.eye(3)[k][:, None] * function


def test_maps_that_differ_by_noise_alone_are_consistent() -> None:
    found = diagnosed(column(), column(component=4, seed=2), column(component=5, seed=3))
    assert found.verdict == "consistent"
    assert not found.effects
    assert not found.differences
    assert found.improvement.elpd_gain == 0


def test_an_expansion_of_a_scale_is_found_with_its_size() -> None:
    found = diagnosed(plus(column(), expansion(8.0)), column(component=4, seed=2))
    assert found.verdict == "explained"
    (effect,) = found.effects
    assert effect.effect == "thermal_scale_x"
    low, high = effect.parameters["cte_per_k"].interval95
    assert low < 8e-6 < high
    assert high - low < 2e-6  # own scale errors of 2 ppm in maps 10 K apart alone: 4 · 0.28 ppm/K
    assert found.improvement.heldout_rms_after_um < 0.2 * found.improvement.heldout_rms_before_um


def test_without_noise_the_expansion_is_that_of_the_differences() -> None:
    """Exact construction: maps that differ by 8 ppm/K and nothing else."""
    compared = column_comparison(plus(column(sigma=1e-5), expansion(8.0)), (), 0)
    assert compared.effect is not None
    assert np.median(expansion_of(compared, compared.effect)) == pytest.approx(8e-6, rel=1e-3)


@pytest.mark.long
def test_scale_errors_of_the_maps_themselves_count_in_the_interval_of_an_expansion() -> None:
    """Slopes of 3 ppm over the contrast that no expansion makes, no noise: by numerical integration over their size s,
    p(c₁ − α·√50 K) ∝ ∫ N(c₁ − α·√50 K; s) N(3 ppm; s) / (1 + (s/2 ppm)²) ds; a t with few degrees of freedom."""
    slopes = 3e-6 * np.array([1.0, -2.0, 1.0]) / np.sqrt(6)
    given = plus(column(sigma=1e-5 * MICROMETRE), expansion(8.0) + np.outer(slopes, PLACE))
    compared = column_comparison(given, (), 0)
    alone = replace(compared, rivals=tuple(rival for rival in compared.rivals if rival.effect))
    s, off = np.geomspace(1e-3, 1e3, 4001)[:, None], np.linspace(0, 400, 40001)
    density = np.sum(np.exp(-0.5 * (off**2 + 9) / s**2) / s / (1 + (s / 2) ** 2), axis=0)  # ds = s d ln s
    cumulated = np.cumsum(density) / density.sum()
    half = float(off[np.searchsorted(cumulated, 0.95)]) / np.sqrt(50)
    low, high = 1e6 * np.quantile(expansion_of(alone, 0), (0.025, 0.975))
    assert (high - low) / 2 == pytest.approx(half, rel=0.05)
    assert (high + low) / 2 == pytest.approx(8.0, abs=0.1 * half)


def test_an_expansion_that_the_job_names_is_not_found_again() -> None:
    found = diagnosed(plus(column(), expansion(8.0)), named=("thermal_scale_x",))
    assert found.verdict == "consistent"


@pytest.mark.parametrize("k", [0, 1, 2])
def test_the_map_that_contradicts_the_others_is_named_with_where_and_by_how_much(k: int) -> None:
    bump = 8 * MICROMETRE * np.exp(-(((PLACE - 400) / 80) ** 2))
    found = diagnosed(column(component=2, seed=2), plus(column(component=1), in_map(k, bump)))
    assert found.verdict == "unexplained"
    (difference,) = found.differences
    assert difference.rival.map == k
    assert difference.rival.name == f"straightness of X along Y in the map at {THREE[k]:g} °C"
    assert difference.probability > 0.9
    low, high = difference.region
    assert low < 400 < high
    assert high - low < 250
    assert found.improvement.heldout_rms_after_um < found.improvement.heldout_rms_before_um


def test_an_expansion_and_a_map_that_is_off_are_told_apart() -> None:
    slope = in_map(1, 20 * ARCSECOND * 1e3 * PLACE / 600)
    found = diagnosed(plus(column(), expansion(-6.0)), plus(column(component=4, seed=2), slope))
    assert found.verdict == "partial"
    assert [e.effect for e in found.effects] == ["thermal_scale_x"]
    (difference,) = found.differences
    assert difference.rival.map == 1
    assert difference.amplitude == pytest.approx(20, abs=1)
    assert difference.column.unit[0] == "″"


def test_of_two_maps_nothing_says_which_is_off() -> None:
    two = np.array([20.0, 21.0])
    given = column(component=4, temperatures=two)
    found = diagnosed(plus(given, np.outer([0, 1], 0.02 * (PLACE / 600) ** 2)))
    (difference,) = found.differences
    assert difference.rival.map is None
    assert not difference.instead
    assert difference.amplitude_um == pytest.approx(20, rel=0.15)


def test_what_all_maps_share_where_they_begin_and_where_a_straightness_points_changes_nothing() -> None:
    given = plus(column(component=1), in_map(2, 0.004 * np.sin(PLACE / 90)))
    shared = (
        0.1 * np.cos(PLACE / 33) + np.outer([0.3, -0.2, 0.7], np.ones(len(PLACE))) + np.outer([1, 2, -4], PLACE) * 1e-5
    )
    one, other = diagnosed(given), diagnosed(plus(given, shared))
    assert other.p_value == pytest.approx(one.p_value, rel=1e-4)
    assert other.differences[0].amplitude == pytest.approx(one.differences[0].amplitude, rel=1e-4)


def test_a_map_with_the_wrong_sign_is_said_to_have_it() -> None:
    given = column()
    given = replace(given, values=given.values * np.array([[1.0], [1.0], [-1.0]]))
    assert [turned(given, k) for k in range(3)] == [False, False, True]


def test_the_roughness_is_the_noise_whatever_the_course() -> None:
    assert roughness(column(seed=5)) == pytest.approx(SIGMA, rel=0.25)


def machine_map(temperature: float, x: np.ndarray, positions: np.ndarray = PLACE) -> ErrorMap:
    """A map of X alone."""
    rest = AxisErrors(PLACE, np.zeros((len(PLACE), 6)))
    return ErrorMap((AxisErrors(positions, x), rest, rest), temperature=temperature)


def readings(seed: int) -> np.ndarray:
    random = np.random.default_rng(seed)
    table = np.zeros((len(PLACE), 6))
    table[:, 0] = COURSE + SIGMA * random.standard_normal(len(PLACE))
    table[:, 1] = 0.001 * np.round(3 * np.sin(PLACE / 200))
    return table


def test_figures_that_stand_in_several_maps_were_measured_once() -> None:
    columns, findings = columns_of([machine_map(20, readings(1)), machine_map(25, readings(2))])
    assert [c.title for c in columns] == ["scale error of X"]
    copied, unmeasured = findings
    assert copied.kind == "copied"
    assert copied.why.startswith("straightness of X along Y: the maps at 20, 25 °C give the same figures")
    assert unmeasured.kind == "not measured"


def three_scales(*ppm: float, temperatures: tuple[float, ...] = (20, 25, 30)) -> list[str]:
    """What is said of maps of the scale of X, of so many ppm each."""
    random = np.random.default_rng(4)
    maps = []
    for size, temperature in zip(ppm, temperatures, strict=True):
        table = np.zeros((len(PLACE), 6))
        table[:, 0] = COURSE + 1e-6 * size * PLACE + SIGMA * random.standard_normal(len(PLACE))
        maps.append(machine_map(temperature, table))
    return [finding.why for finding in columns_of(maps)[1] if finding.kind == "copied"]


def test_two_maps_of_a_scale_that_agree_where_a_third_shows_that_it_expands_may_be_copies() -> None:
    """100 ppm over 600 mm are 60 µm; five kelvin are to make half of what ten make."""
    (said,) = three_scales(0, 1, 100)
    assert "the maps at 20 and 25 °C agree to" in said
    assert "where that at 30 °C is" in said
    assert not three_scales(0, 50, 100)  # an expansion
    assert not three_scales(0, 1, 2)  # none
    assert not three_scales(0, 1, 100, temperatures=(20, 20.1, 30))  # the temperatures say why two agree
    assert not three_scales(0, 0, 100, temperatures=(20, 20, 30))


def test_a_stray_reading_is_reported_and_its_position_left_out() -> None:
    third = readings(3)
    third[10, 0] += 0.03
    columns, findings = columns_of([machine_map(20, readings(1)), machine_map(25, readings(2)), machine_map(30, third)])
    assert PLACE[10] not in columns[0].positions
    assert len(columns[0].positions) == len(PLACE) - 1
    (stray,) = [f for f in findings if f.kind == "outlier"]
    assert "at 250 mm in the map at 30 °C" in stray.why


def test_maps_at_different_positions_are_compared_where_they_share_them() -> None:
    maps = [machine_map(20, readings(1)), machine_map(25, readings(2)[::2], PLACE[::2])]
    columns, _ = columns_of(maps)
    assert columns[0].positions.tolist() == PLACE[::2].tolist()
    apart = [machine_map(20, readings(1)), machine_map(25, readings(2), PLACE + 3)]
    columns, findings = columns_of(apart)
    assert not columns
    assert [f.kind for f in findings if f.kind == "positions"] == ["positions"]


@pytest.fixture(scope="module")
def harris() -> MapsDiagnosis:
    folder = ROOT / "examples" / "iota-1102-maps"
    maps = [read_error_map(folder / f"error_map_{t}C.csv", temperature=t) for t in (20, 25, 30)]
    return diagnosed(*columns_of(maps)[0])


@pytest.mark.long
def test_the_real_maps_show_the_expansion_of_two_scales(harris: MapsDiagnosis) -> None:
    """Harris 2004, 3.4: steel, 12 ppm/K; Y in good agreement (106 − 52 µm over 550 mm and 10 K), Z less (36 over 500)."""
    printed = {"thermal_scale_y": 54 / 550 / 10 * 1e-3, "thermal_scale_z": 36 / 500 / 10 * 1e-3}
    assert {e.effect for e in harris.effects} == set(printed)
    for effect in harris.effects:
        low, high = effect.parameters["cte_per_k"].interval95
        assert low < printed[effect.effect] < high


def test_the_real_map_at_25_degrees_contradicts_the_others_in_the_rotation_of_x_about_y(harris: MapsDiagnosis) -> None:
    """Harris 2004, 3.4: εy(x) is mostly independent of temperature, yet rises to 34.7″ at 25 °C and to 12.6″, 15.8″ else."""
    first = next(d for d in harris.differences if d.column.title == "rotation of X about Y")
    assert first.rival.map == 1
    assert first.probability > 0.95
    assert first.amplitude == pytest.approx(34.7 - (12.6 + 15.8) / 2, abs=1.5)
    assert harris.verdict == "partial"
