"""Surfaces, twist, wear, joints, loads, lags and lobes move points as nature would: by constructions without the formula."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.special import sph_harm_y

from cmm_uq.base.points import Floats, Points
from cmm_uq.machine.physics.catalogue import EVERY
from tests.machine.physics.test_further_effects import NORMALS, POINTS, C, X, Y, Z, along, error
from tests.recordings import TRAVEL, with_columns

ARCSECOND = np.pi / 648000


def at(*places: tuple[float, float, float]) -> Points:
    """Points at parts of the travel of each axis."""
    one = np.ones(len(places), dtype=np.int64)
    xyz = TRAVEL[:, 0] + np.array(places) * np.ptp(TRAVEL, axis=1)
    return Points(xyz, one, np.arange(len(places)), one, POINTS.machine)


@pytest.mark.parametrize(
    ("name", "a", "b", "across"), [("bowl_xy", 0, 1, 2), ("bowl_yz", 1, 2, 0), ("bowl_zx", 2, 0, 1)]
)
def test_a_bowl_is_deepest_in_the_middle_and_even_along_its_four_edges(name: str, a: int, b: int, across: int) -> None:
    """Half way from the middle to an edge three quarters are left of a parabola, of both nine sixteenths."""
    places = np.full((4, 3), 0.5)
    places[1, a], places[2, [a, b]], places[3, b] = 0.25, 0.25, 1.0
    e = error(name, at(*map(tuple, places)), bow_um=8.0)
    np.testing.assert_allclose(e[:, across], [0.008, 0.006, 0.0045, 0.0], atol=1e-15)
    assert not np.delete(e, across, axis=1).any()


def test_a_twisted_beam_turns_what_hangs_below_it_about_itself() -> None:
    """A rigid turn about the carriage's own axis, none at the ends: x carries (0, y, z), y carries (0, 0, z)."""
    part = (X - TRAVEL[0, 0]) / np.ptp(TRAVEL[0])
    angle = 20 * ARCSECOND * 4 * part * (1 - part)
    turned = np.column_stack(
        [0 * X, np.cos(angle) * Y - np.sin(angle) * Z - Y, np.sin(angle) * Y + np.cos(angle) * Z - Z]
    )
    np.testing.assert_allclose(error("twist_x", twist_arcsec=20.0), turned, atol=1e-5)
    assert not error("twist_y", at((0.5, 0.0, 0.5), (0.5, 1.0, 0.5)), twist_arcsec=20.0).any()


def test_a_ram_sags_as_a_cantilever_with_a_load_at_its_end() -> None:
    """Against the beam's equation E·I·w'' = F·(L − x), clamped, integrated for two lengths: their ratio is that of cubes."""

    def deflection(length: float) -> float:
        solved = solve_ivp(lambda x, w: [w[1], length - x], (0, length), [0.0, 0.0], rtol=1e-10, atol=1e-14)
        return float(solved.y[0, -1])

    points = with_columns(at((0.4, 0, 0), (0.8, 0, 0), (0.8, 0, 0)), load_kg=np.array([2.0, 2.0, 4.0]))
    e = error("ram_sag_x", points, um_per_kg=3.0)[:, 2]
    assert e[0] / e[1] == pytest.approx(deflection(0.4) / deflection(0.8), rel=1e-7)
    assert e[2] == pytest.approx(2 * e[1])
    assert e[1] < 0


def test_a_worn_guideway_is_deepest_where_it_is_worn_and_whole_at_a_quarter_of_the_travel_from_there() -> None:
    e = error("wear_y_z", at(*((0.5, part, 0.5) for part in (0.6, 0.6 + 1 / 12, 0.85))), depth_um=5.0, at_part=0.6)
    np.testing.assert_allclose(e[:, 2], [0.005, 0.005 / np.sqrt(np.e), 0.005 * np.exp(-4.5)], rtol=1e-9)
    assert not e[:, :2].any()


def test_beyond_a_joint_every_reading_is_off_by_the_step() -> None:
    e = error("scale_joint_z", at((0, 0, 0.1), (0, 0, 0.399), (0, 0, 0.401), (0, 0, 1.0)), step_um=4.0, at_part=0.4)
    np.testing.assert_allclose(e[:, 2], [0, 0, 0.004, 0.004], atol=1e-15)


def test_a_machine_bends_in_proportion_to_its_acceleration() -> None:
    np.testing.assert_allclose(
        error("inertia_y", um_s2_per_m=3.0), along(1, 3e-3 * C["acceleration_y_m_s2"]), atol=1e-15
    )


def test_a_spike_at_reversal_has_gone_to_a_third_after_its_way() -> None:
    far = with_columns(POINTS, since_reversal_x_mm=np.full(len(X), 2.0), approach_x=np.ones(len(X)))
    at_once = with_columns(far, since_reversal_x_mm=np.zeros(len(X)))
    first, later = (error("reversal_spike_x", points, spike_um=6.0, decay_mm=2.0)[:, 0] for points in (at_once, far))
    np.testing.assert_allclose(first, 0.006)
    np.testing.assert_allclose(later, first / np.e)


def test_a_scale_behind_its_thermometer_follows_newtons_law_of_cooling() -> None:
    hours, driving, lag = C["time_s"] / 3600, C["temp_y_c"], 1.3
    solved = solve_ivp(lambda t, y: (np.interp(t, hours, driving) - y) / lag, (0, hours[-1]), driving[:1], t_eval=hours,
                       rtol=1e-9, atol=1e-9, max_step=0.02)  # fmt: skip
    e = error("thermal_lag_y", cte_per_k=11.5e-6, lag_h=lag)
    np.testing.assert_allclose(e, along(1, 11.5e-6 * (solved.y[0] - driving) * Y), atol=3e-8)


@pytest.mark.parametrize(
    ("name", "size", "lever"), [("daily_x", "amplitude_um", 1e-3), ("daily_scale_x", "amplitude_ppm", 1e-6 * X)]
)
def test_a_daily_cycle_comes_back_after_a_day_and_is_reversed_after_half_of_one(
    name: str, size: str, lever: Floats | float
) -> None:
    for hours, part in ((0.0, 0.5), (6.0, np.sqrt(0.75)), (12.0, -0.5), (24.0, 0.5)):
        timed = with_columns(POINTS, time_s=np.full(len(X), 3600 * hours))
        e = EVERY[name].displacement(timed, {size: 7.0, "phase_rad": np.pi / 6})
        np.testing.assert_allclose(e[:, 0], 7 * part * lever * np.ones(len(X)), atol=1e-9)


def test_of_less_than_half_a_day_no_cycle_is_thought_of() -> None:
    short, bare = with_columns(POINTS, time_s=np.linspace(0, 43000, len(X))), with_columns(POINTS)
    assert not EVERY["daily_x"].shown_in(short)
    assert EVERY["daily_x"].shown_in(with_columns(bare, time_s=np.linspace(0, 43300, len(X))))


@pytest.mark.parametrize("count", [2, 4, 6])
def test_a_probe_with_lobes_is_alike_after_a_turn_from_one_lobe_to_the_next(count: int) -> None:
    e = error(f"probe_lobing_{count}", amplitude_um=2.0, phase_rad=0.4)
    turn = 2 * np.pi / count
    turned = NORMALS @ np.array([[np.cos(turn), np.sin(turn), 0], [-np.sin(turn), np.cos(turn), 0], [0, 0, 1]])
    after = error(f"probe_lobing_{count}", with_columns(POINTS, **{f"n{a}": turned[:, i] for i, a in enumerate("xyz")}),
                  amplitude_um=2.0, phase_rad=0.4)  # fmt: skip
    along_normal = np.sum(e * NORMALS, axis=1)
    np.testing.assert_allclose(along_normal, np.sum(after * turned, axis=1), atol=1e-12)
    half = 0.5 * turn
    turned = NORMALS @ np.array([[np.cos(half), np.sin(half), 0], [-np.sin(half), np.cos(half), 0], [0, 0, 1]])
    between = error(f"probe_lobing_{count}", with_columns(POINTS, **{f"n{a}": turned[:, i] for i, a in enumerate("xyz")}),
                    amplitude_um=2.0, phase_rad=0.4)  # fmt: skip
    np.testing.assert_allclose(np.sum(between * turned, axis=1), -along_normal, atol=1e-12)


def test_a_map_of_the_probe_spans_what_harmonics_of_two_to_five_do() -> None:
    """scipy's complex harmonics of the same directions span the same, their real and imaginary parts."""
    normals = np.random.default_rng(8).standard_normal((200, 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    one = np.ones(200, dtype=np.int64)
    points = Points(
        np.zeros((200, 3)),
        one,
        np.arange(200),
        one,
        POINTS.machine,
        {f"n{a}": normals[:, i] for i, a in enumerate("xyz")},
    )
    polar, azimuth = np.arccos(normals[:, 2]), np.arctan2(normals[:, 1], normals[:, 0])
    own = 1e3 * np.einsum("nik,ni->nk", EVERY["probe_map"].basis(points), normals)
    theirs = np.column_stack([
        part for l in range(2, 6) for m in range(l + 1)  # noqa: E741
        for part in (sph_harm_y(l, m, polar, azimuth).real, sph_harm_y(l, m, polar, azimuth).imag)
    ])  # fmt: skip
    assert own.shape[1] == 32
    for a, b in ((own, theirs), (theirs, own)):
        np.testing.assert_allclose(b @ np.linalg.lstsq(b, a, rcond=None)[0], a, atol=1e-9)


def test_a_head_that_is_turned_moves_each_tip_as_a_rigid_turn_would() -> None:
    angle = 15 * ARCSECOND
    tip = np.column_stack([C[f"tip_{a}_mm"] for a in "xyz"])
    turn = np.array([[np.cos(angle), -np.sin(angle), 0], [np.sin(angle), np.cos(angle), 0], [0, 0, 1]])
    e = error("head_alignment", about_x_arcsec=0.0, about_y_arcsec=0.0, about_z_arcsec=15.0)
    np.testing.assert_allclose(e, tip @ turn.T - tip, atol=1e-6)
