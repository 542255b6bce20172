"""Rarer effects move points as nature would: each against a construction that knows nothing of the formula."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.points import Floats, Machine, Points
from cmm_uq.machine.physics.catalogue import CATALOGUE, EVERY, FURTHER, effects
from cmm_uq.machine.physics.compensation import Compensation
from cmm_uq.machine.physics.digitizer import Digitizer, euler_313
from cmm_uq.machine.physics.error_map import AxisErrors, ErrorMap
from cmm_uq.machine.physics.map_interpolation import ErrorMaps
from tests.recordings import TRAVEL, bars, on_table, with_columns

ARCSECOND = np.pi / 648000


def recording() -> Points:
    """Bars with every column that an effect asks for."""
    random = np.random.default_rng(2)
    points = bars(random, 15, 300.0, Machine("m", "XYZ", TRAVEL))
    n = len(points)
    normals = random.standard_normal((n, 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    places = ("x", "y", "z", "artefact", "air", "bridge_top", "bridge_bottom", "ram_front", "ram_back")
    return with_columns(
        points,
        **{f"approach_{a}": random.choice([-1.0, 0.0, 1.0], n) for a in "xyz"},
        **{f"n{a}": normals[:, i] for i, a in enumerate("xyz")},
        **{f"temp_{p}_c": 20 + np.cumsum(0.1 * random.standard_normal(n)) for p in places},
        **{f"tip_{a}_mm": random.uniform(-120, 120, n) for a in "xyz"},
        time_s=np.arange(n) * 400.0, pressure_hpa=random.uniform(980, 1030, n), humidity_pct=random.uniform(30, 70, n),
        speed_mm_s=random.uniform(2, 80, n), gamma_deg=random.choice([0.0, -60.0, 90.0], n),
        depth_mm=random.uniform(-30, 30, n), load_kg=random.uniform(0, 5, n),
        **{f"acceleration_{a}_m_s2": random.uniform(-2, 2, n) for a in "xyz"},
        **{f"since_reversal_{a}_mm": random.uniform(0, 30, n) for a in "xyz"},
    )  # fmt: skip


POINTS = recording()
X, Y, Z = POINTS.carriages.T
C = POINTS.columns
NORMALS = np.column_stack([C["nx"], C["ny"], C["nz"]])
TRAVELS = np.column_stack([C["approach_x"], C["approach_y"], C["approach_z"]])


TIMED = [name for name, effect in EVERY.items() if "time_s" in effect.columns]


@pytest.mark.parametrize("name", TIMED)
def test_by_a_clock_that_began_long_before_time_counts_from_the_first_reading(name: str) -> None:
    """As by a stopwatch, in the whole recording and in each part of it; a stopwatch's own start is kept."""
    epoch = with_columns(POINTS, time_s=C["time_s"] + 1.7e9)
    shape = [0.5 * (one.low + one.high) for one in EVERY[name].shape]
    later = np.arange(len(POINTS)) >= 12
    assert np.ptp(EVERY[name].basis(POINTS, shape)) > 0
    np.testing.assert_array_equal(EVERY[name].basis(epoch, shape), EVERY[name].basis(POINTS, shape))
    if "_lag" not in name:  # begins with what it follows
        expected = EVERY[name].basis(POINTS, shape)[later]
        np.testing.assert_array_equal(EVERY[name].basis(epoch.select(later), shape), expected)
        np.testing.assert_array_equal(EVERY[name].basis(POINTS.select(later), shape), expected)


def error(name: str, points: Points = POINTS, **parameters: float) -> Floats:
    return EVERY[name].displacement(points, parameters)


def along(axis: int, component: Floats) -> Floats:
    e = np.zeros((len(component), 3))
    e[:, axis] = component
    return e


def test_a_carriage_with_play_stands_half_of_it_to_either_side() -> None:
    e = error("play_y_x", gap_um=8.0)
    assert np.unique(e[:, 0]) == pytest.approx([-0.004, 0.0, 0.004])
    np.testing.assert_array_equal(np.sign(e[:, 0]), C["approach_y"])
    assert not e[:, 1:].any()


def test_a_yaw_at_reversal_is_the_turning_of_what_the_carriage_carries() -> None:
    """A rigid turn of (0, y, z) about z by half the angle either way; the first order of the sine is good to 10⁻¹¹ mm."""
    half = 0.5 * 3.0 * ARCSECOND * C["approach_x"]
    turned = np.column_stack([-np.sin(half) * Y, np.cos(half) * Y - Y, 0 * Y])
    np.testing.assert_allclose(error("yaw_play_x", angle_arcsec=3.0), turned, atol=2e-8)


def test_the_yaw_of_a_table_carriage_y_acts_on_x_and_z() -> None:
    table = Points(POINTS.xyz, POINTS.measurement, POINTS.point, POINTS.repeat, Machine("m", "YXZ", TRAVEL), C)
    e = error("yaw_play_y", table, angle_arcsec=2.0)
    np.testing.assert_allclose(e, along(1, ARCSECOND * C["approach_y"] * X), atol=1e-15)


def test_an_unequal_backlash_has_its_gap_at_either_end_of_travel() -> None:
    """Wind-up of 40 µm/m over 900 mm: gaps of −18 and +18 µm at the ends, none in the middle."""
    xyz = np.zeros((3, 3))
    xyz[:, 0] = [0.0, 450.0, 900.0]
    one = np.ones(3, dtype=np.int64)
    points = Points(xyz, one, np.arange(3), one, POINTS.machine)
    there = error("windup_x", with_columns(points, approach_x=np.ones(3)), um_per_m=40.0)
    back = error("windup_x", with_columns(points, approach_x=-np.ones(3)), um_per_m=40.0)
    assert (there - back)[:, 0] == pytest.approx([-0.018, 0.0, 0.018])


@pytest.mark.parametrize("sense", [1.0, -1.0])
def test_a_scale_read_too_early_is_short_of_the_contact_by_speed_times_lag(sense: float) -> None:
    """At 40 mm/s, 1.5 ms before contact, the probe was 60 µm short of where it touched."""
    contact = 123.0
    read_at = contact - sense * 40.0 * 1.5e-3
    one = np.ones(1, dtype=np.int64)
    point = Points(np.array([[read_at, 0.0, 0.0]]), one, one, one, POINTS.machine)
    point = with_columns(point, speed_mm_s=np.array([40.0]), approach_x=np.array([sense]), approach_y=np.zeros(1),
                         approach_z=np.zeros(1))  # fmt: skip
    assert (point.xyz + error("speed_lag_x", point, lag_ms=1.5))[0, 0] == pytest.approx(contact, abs=1e-12)


def test_a_curved_scale_is_right_at_both_ends_and_off_by_its_bow_in_the_middle() -> None:
    xyz = np.array([[0.0, 0, 0], [0, 275.0, 0], [0, 550.0, 0]])
    one = np.ones(3, dtype=np.int64)
    e = error("scale_curvature_y", Points(xyz, one, np.arange(3), one, POINTS.machine), bow_um=6.0)
    assert e[:, 1] == pytest.approx([0.0, 0.006, 0.0])


def fringes(length: Floats, index: Floats) -> Floats:
    """Half wavelengths of a helium-neon laser on a path in air."""
    return length * index / (0.5 * 632.9912e-6)


def index_of(points: Points) -> Floats:
    """The formula of Harris 2004 section 3.3, written out: P in mm Hg, T in °C, H in %."""
    P, T, H = points.columns["pressure_hpa"] / 1.33322387, points.columns["temp_air_c"], points.columns["humidity_pct"]
    density = P * (1 + 1e-6 * P * (0.817 - 0.0133 * T)) / (1 + 0.0036610 * T)
    return np.asarray(1 + 1e-6 * (0.3836391 * density - 3.033e-3 * H * np.exp(0.057627 * T)))


def test_a_laser_scale_without_correction_counts_fringes_of_todays_air_as_those_of_standard_air() -> None:
    standard = 1.0 + 271.307e-6  # 20 °C, 760 mm Hg, 50 %
    indicated = fringes(X, index_of(POINTS)) / fringes(np.ones_like(X), np.full_like(X, standard))
    true = POINTS.at(POINTS.xyz + along(0, indicated - X))
    np.testing.assert_allclose(true.readings["x"] + error("air_scale_x", true, part=1.0)[:, 0], X, atol=1e-6)


def test_the_dead_path_changes_its_optical_length_while_nothing_moves() -> None:
    """Zeroed at the first point, a path of 250 mm outside of the scale shows as change of every later reading."""
    dead = 250.0
    n = index_of(POINTS)
    shown = dead * (n - n[0])
    np.testing.assert_allclose(error("dead_path_z", path_mm=dead)[:, 2], -shown, atol=1e-9)
    assert error("dead_path_z", path_mm=dead)[0, 2] == 0.0


@pytest.mark.parametrize(("name", "axis", "size"), [("settling_x", 0, 1e-3), ("scale_settling_y", 1, 1e-6 * Y)])
def test_what_settles_is_two_thirds_there_after_one_time_constant_and_ends_at_its_amplitude(
    name: str, axis: int, size: Floats | float
) -> None:
    parameter = next(iter(EVERY[name].coefficients)).name
    at = {
        hours: error(name, with_columns(POINTS, time_s=np.full(len(POINTS), 3600.0 * hours)),
                     **{parameter: 10.0, "settling_h": 2.0})[:, axis]
        for hours in (0.0, 2.0, 200.0)
    }  # fmt: skip
    assert not at[0.0].any()
    np.testing.assert_allclose(at[2.0], (1 - 1 / np.e) * 10 * size * np.ones_like(Y), rtol=1e-12)
    np.testing.assert_allclose(at[200.0], 10 * size * np.ones_like(Y), rtol=1e-12)


def test_early_settling_is_a_drift() -> None:
    """A·(1 − exp(−t/τ)) ≈ A·t/τ: 20 µm in 20 h begins as 1 µm/h."""
    minutes = with_columns(POINTS, time_s=np.linspace(0, 60, len(POINTS)))
    drift = CATALOGUE["drift_x"].displacement(minutes, {"um_per_h": 1.0})
    np.testing.assert_allclose(error("settling_x", minutes, um=20.0, settling_h=20.0), drift, rtol=1e-3)


def test_a_growing_scale_is_a_scale_error_at_each_moment() -> None:
    e = error("scale_drift_z", ppm_per_h=2.0)
    for i in range(0, len(POINTS), 7):
        at_once = CATALOGUE["scale_z"].displacement(POINTS, {"ppm": 2.0 * C["time_s"][i] / 3600})
        assert e[i] == pytest.approx(at_once[i], abs=1e-15)


@pytest.mark.parametrize("plane", ["xy", "yz", "zx"])
def test_a_frame_at_21_degrees_has_the_squareness_of_one_kelvin(plane: str) -> None:
    warm = with_columns(POINTS, **{f"temp_{a}_c": np.full(len(POINTS), 20.0 + i) for i, a in enumerate("xyz")})
    square = CATALOGUE[f"squareness_{plane}"].displacement(POINTS, {"angle_arcsec": 4.0})
    np.testing.assert_allclose(error(f"thermal_squareness_{plane}", warm, arcsec_per_k=4.0), square, atol=1e-15)


@pytest.mark.parametrize(
    ("name", "columns", "rotation"),
    [
        ("thermal_gradient_bridge", ("temp_bridge_top_c", "temp_bridge_bottom_c"), "rotation_y_x"),
        ("thermal_gradient_ram", ("temp_ram_front_c", "temp_ram_back_c"), "rotation_z_y"),
    ],
)
def test_a_bent_carriage_turns_along_its_travel(name: str, columns: tuple[str, str], rotation: str) -> None:
    """Two kelvin across it, 3″/(m·K): a rotation of 6″/m."""
    n = len(POINTS)
    bent = with_columns(POINTS, **{columns[0]: np.full(n, 23.0), columns[1]: np.full(n, 21.0)})
    turned = CATALOGUE[rotation].displacement(POINTS, {"arcsec_per_m": 6.0})
    np.testing.assert_allclose(error(name, bent, arcsec_per_m_k=3.0), turned, atol=1e-15)


def test_a_lagging_bar_follows_newtons_law_of_cooling() -> None:
    """Against a numerical solution of τ·dT′/dt = T − T′ for the recorded temperature."""
    hours, driving, lag = C["time_s"] / 3600, C["temp_artefact_c"], 0.7
    solved = solve_ivp(lambda t, y: (np.interp(t, hours, driving) - y) / lag, (0, hours[-1]), driving[:1], t_eval=hours,
                       rtol=1e-9, atol=1e-9, max_step=0.02)  # fmt: skip
    e = error("artefact_lag", cte_per_k=11.5e-6, lag_h=lag).reshape(-1, 2, 3)
    lengthened = np.sum((e[:, 1] - e[:, 0]) * np.diff(POINTS.xyz.reshape(-1, 2, 3), axis=1)[:, 0], axis=1) / 300.0
    behind = (solved.y[0] - driving).reshape(-1, 2)
    middle = 0.5 * 300.0 * behind.sum(axis=1)  # each end by its own half
    np.testing.assert_allclose(lengthened, -11.5e-6 * middle, atol=1e-8)


def test_a_bar_that_has_soaked_does_not_lag() -> None:
    steady = with_columns(POINTS, temp_artefact_c=np.full(len(POINTS), 24.0))
    assert not error("artefact_lag", steady, cte_per_k=11.5e-6, lag_h=1.0).any()


def test_pre_travel_is_a_stylus_radius_where_the_travel_is_against_the_normal() -> None:
    against = with_columns(POINTS, **{f"n{a}": -TRAVELS[:, i] / np.maximum(np.linalg.norm(TRAVELS, axis=1), 1)
                                      for i, a in enumerate("xyz")})  # fmt: skip
    radius = CATALOGUE["probe_radius"].displacement(against, {"um": 2.5})
    np.testing.assert_allclose(error("pre_travel", um=2.5), radius, atol=1e-15)


def test_deflection_along_and_across_the_stylus_together_are_a_radius() -> None:
    n = len(POINTS)
    tip = with_columns(POINTS, tip_x_mm=np.zeros(n), tip_y_mm=np.full(n, -60.0), tip_z_mm=np.full(n, -80.0))
    both = error("probe_axial", tip, um=3.0) + error("stylus_bending", tip, um=3.0)
    np.testing.assert_allclose(both, CATALOGUE["probe_radius"].displacement(tip, {"um": 3.0}), atol=1e-15)


def test_a_stylus_twice_as_long_bends_eight_times_as_much() -> None:
    n = len(POINTS)
    one = with_columns(POINTS, tip_x_mm=np.zeros(n), tip_y_mm=np.zeros(n), tip_z_mm=np.full(n, -50.0))
    two = with_columns(one, tip_z_mm=np.full(n, -100.0))
    short, long = (error("stylus_bending", p, um=4.0) for p in (one, two))
    np.testing.assert_allclose(long, 8 * short, atol=1e-15)
    np.testing.assert_allclose(long, 4e-3 * NORMALS * [1, 1, 0], atol=1e-15)


def test_without_a_tip_the_stylus_hangs_from_the_ram() -> None:
    bare = Points(POINTS.xyz, POINTS.measurement, POINTS.point, POINTS.repeat, POINTS.machine,
                  {f"n{a}": C[f"n{a}"] for a in "xyz"})  # fmt: skip
    np.testing.assert_allclose(error("probe_axial", bare, um=1.0), along(2, 1e-3 * C["nz"]), atol=1e-18)


def test_a_late_trigger_lets_the_probe_travel_into_the_surface() -> None:
    """Probed along −n at v, read 2 ms late: the indicated point lies v·2 ms inside of the true one."""
    inside = POINTS.at(POINTS.xyz - NORMALS * (C["speed_mm_s"] * 2e-3)[:, None])
    np.testing.assert_allclose(inside.xyz + error("trigger_delay", inside, delay_ms=2.0), POINTS.xyz, atol=1e-12)


POSES = [(90.0, 90.0), (0.0, -90.0)]
"""Harris 2004 section 6.2: w along X, and along Y."""


def chain(pose: tuple[float, float], gamma: float, offset: Floats, scan: Floats) -> Floats:
    """Coordinates (3,) by the whole chain of Harris 2004 eq. 35 on a machine without errors, at reading 0."""
    still = AxisErrors(np.array([-1e4, 1e4]), np.zeros((2, 6)))
    compensation = Compensation(ErrorMaps((ErrorMap((still, still, still)),)))
    digitizer = Digitizer(euler_313(*np.radians([*pose, gamma])), offset, compensation)
    return digitizer.coordinates(scan[None], np.zeros((1, 3)))[0][0]


def posed(pose: tuple[float, float]) -> Points:
    return with_columns(POINTS, alpha_deg=np.full(len(X), pose[0]), beta_deg=np.full(len(X), pose[1]))


@pytest.mark.parametrize("pose", POSES)
def test_a_misaligned_digitizer_is_the_whole_chain_with_another_offset(pose: tuple[float, float]) -> None:
    """[U1 V1] that are 12 and −7 µm less than the chain takes them for."""
    middle = np.zeros(2)
    moved = [
        chain(pose, gamma, np.array([-0.012, 0.007, 0.0]), middle) - chain(pose, gamma, np.zeros(3), middle)
        for gamma in C["gamma_deg"]
    ]
    np.testing.assert_allclose(error("digitizer_offset", posed(pose), u_um=12.0, v_um=-7.0), moved, atol=1e-15)


@pytest.mark.parametrize("pose", POSES)
def test_a_depth_scale_that_is_short_is_the_whole_chain_with_longer_v(pose: tuple[float, float]) -> None:
    """Depths of which each millimetre is 1.003 mm in truth."""
    moved = [
        chain(pose, gamma, np.zeros(3), np.array([5.0, 1.003 * v]))
        - chain(pose, gamma, np.zeros(3), np.array([5.0, v]))
        for gamma, v in zip(C["gamma_deg"], C["depth_mm"], strict=True)
    ]
    np.testing.assert_allclose(error("digitizer_depth", posed(pose), um_per_mm=3.0), moved, atol=1e-13)


def test_without_a_recorded_attitude_w_lies_along_x() -> None:
    np.testing.assert_allclose(
        error("digitizer_offset", u_um=1.0, v_um=2.0), error("digitizer_offset", posed(POSES[0]), u_um=1.0, v_um=2.0)
    )


@pytest.mark.parametrize(("incident", "projected"), [(10.0, 0.0), (0.0, -25.0), (-30.0, 0.0)])
def test_light_that_meets_a_surface_askew_errs_along_the_beam(incident: float, projected: float) -> None:
    """A surface turned by an angle in the scan plane or across it, seen in three poses about w."""
    for gamma in (0.0, -60.0, 90.0):
        u, v, w = euler_313(np.pi / 2, np.pi / 2, np.radians(gamma)).T
        tilt, towards = (incident, u) if incident else (projected, w)
        normal = np.cos(np.radians(tilt)) * v + np.sin(np.radians(tilt)) * towards
        one = np.ones(1, dtype=np.int64)
        point = Points(np.zeros((1, 3)), one, one, one, POINTS.machine)
        point = with_columns(
            point, gamma_deg=np.array([gamma]), **{f"n{a}": normal[i : i + 1] for i, a in enumerate("xyz")}
        )
        e = error("digitizer_incidence", point, incident_um_per_deg=0.4, projected_um_per_deg=0.7)
        np.testing.assert_allclose(e[0], 1e-3 * (0.4 * incident + 0.7 * projected) * v, atol=1e-14)


@pytest.mark.parametrize("name", FURTHER)
def test_a_further_effect_is_as_complete_as_the_others(name: str) -> None:
    effect = FURTHER[name]
    points = on_table(POINTS, effect)
    assert effect.tier == "further"
    assert all(coefficient.prior_sd > 0 for coefficient in effect.coefficients)
    bases = [effect.basis(points, shape) for shape in effect.trials()]
    for basis in bases:
        assert basis.shape == (len(POINTS), 3, len(effect.coefficients))
        assert np.isfinite(basis).all()
    # in the chain XYZ carriage y carries nothing beside the ram; no point lies beyond the last joints
    assert any(np.any(basis[:, :, 0]) for basis in bases) or name == "yaw_play_y"
    for column in effect.columns:
        bare = {key: values for key, values in points.columns.items() if key != column}
        less = Points(POINTS.xyz, POINTS.measurement, POINTS.point, POINTS.repeat, points.machine, bare)
        with pytest.raises(CmmUqError, match=column):
            effect.basis(less, next(iter(effect.trials())))


def test_tiers_do_not_overlap() -> None:
    assert not set(CATALOGUE) & set(FURTHER)
    assert all(effect.tier == "contract" for effect in CATALOGUE.values())
    assert [e.name for e in effects(["play_x_y", "scale_x"])] == ["play_x_y", "scale_x"]


def test_trials_of_a_time_constant_reach_from_its_lowest_to_its_highest() -> None:
    trials = [tau for (tau,) in EVERY["settling_x"].trials()]
    assert trials[0] == pytest.approx(0.2)
    assert trials[-1] == pytest.approx(20.0)
    assert np.ptp(np.diff(np.log(trials))) < 1e-12
