"""Every effect moves points as its formula says; the formulas are written out here a second time."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, strategies as st

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.messages import NOTHING
from cmm_uq.base.points import Floats, Machine, Points
from cmm_uq.base.units import UNITS, Unit, printed_unit
from cmm_uq.machine.physics.catalogue import CATALOGUE, EVERY, effects
from tests.machine.physics.effect_table import END, PAGE, START, table
from tests.recordings import TRAVEL, bars, on_table, with_columns

ARCSECOND = np.pi / 648000


def recording(chain: str = "XYZ") -> Points:
    """Bars with every optional column, away from the origin."""
    random = np.random.default_rng(1)
    machine = Machine("m", chain, TRAVEL, np.array([10.0, -20.0, -30.0]))
    points = bars(random, 12, 300.0, machine)
    n = len(points)
    normals = random.standard_normal((n, 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    return with_columns(
        points,
        **{f"approach_{a}": random.choice([-1.0, 0.0, 1.0], n) for a in "xyz"},
        **{f"temp_{p}_c": 20 + random.standard_normal(n) for p in ("x", "y", "z", "table_top", "table_bottom")},
        temp_artefact_c=np.repeat(20 + random.standard_normal(n // 2), 2),
        time_s=np.arange(n) * 600.0,
        **{f"n{a}": normals[:, i] for i, a in enumerate("xyz")},
    )


def moved(component: Floats, axis: str) -> Floats:
    e = np.zeros((len(component), 3))
    e[:, "xyz".index(axis)] = component
    return e


POINTS = recording()
X, Y, Z = POINTS.carriages.T
COLUMN = POINTS.columns

FORMULAS: dict[str, tuple[dict[str, float], Callable[[], Floats]]] = {
    "scale_x": ({"ppm": 80.0}, lambda: moved(80e-6 * X, "x")),
    "scale_z": ({"ppm": -30.0}, lambda: moved(-30e-6 * Z, "z")),
    "squareness_xy": ({"angle_arcsec": -173.0}, lambda: moved(173 * ARCSECOND * Y, "x")),
    "squareness_yz": ({"angle_arcsec": -19.0}, lambda: moved(19 * ARCSECOND * Z, "y")),
    "squareness_zx": ({"angle_arcsec": 21.0}, lambda: moved(-21 * ARCSECOND * Z, "x")),
    "straightness_x_y": ({"bow_um": 5.0}, lambda: moved(5e-3 * (1 - (2 * X / 900 - 1) ** 2), "y")),
    "straightness_z_x": ({"bow_um": -2.0}, lambda: moved(-2e-3 * (1 - (2 * (Z + 500) / 500 - 1) ** 2), "x")),
    # Equations (11) and (13) of Harris 2004: e_x = … − y·εz(x) + z·εy(x), e_z = … + y·εx(x), e_y = … − z·εx(x)
    "rotation_x_z": ({"arcsec_per_m": 9.0}, lambda: moved(-Y * 9 * ARCSECOND * X / 1000, "x")),
    "rotation_x_y": ({"arcsec_per_m": 9.0}, lambda: moved(Z * 9 * ARCSECOND * X / 1000, "x")),
    "rotation_x_x": (
        {"arcsec_per_m": 9.0},
        lambda: moved(Y * 9 * ARCSECOND * X / 1000, "z") + moved(-Z * 9 * ARCSECOND * X / 1000, "y"),
    ),
    "rotation_y_x": ({"arcsec_per_m": 9.0}, lambda: moved(-Z * 9 * ARCSECOND * Y / 1000, "y")),
    "rotation_y_z": ({"arcsec_per_m": 9.0}, lambda: moved(0 * X, "x")),
    "rotation_z_x": ({"arcsec_per_m": 9.0}, lambda: moved(0 * X, "x")),
    "periodic_scale_y": (
        {"amplitude_um": 3.0, "period_mm": 40.0, "phase_rad": 1.0},
        lambda: moved(3e-3 * np.sin(2 * np.pi * Y / 40 + 1), "y"),
    ),
    "hysteresis_x": ({"gap_um": 5.0}, lambda: moved(2.5e-3 * COLUMN["approach_x"], "x")),
    "thermal_scale_z": ({"cte_per_k": 8e-6}, lambda: moved(8e-6 * (COLUMN["temp_z_c"] - 20) * Z, "z")),
    "drift_y": ({"um_per_h": 2.0}, lambda: moved(2e-3 * COLUMN["time_s"] / 3600, "y")),
    "thermal_gradient": (
        {"arcsec_per_m_k": 4.0},
        lambda: moved(Z * 4 * ARCSECOND * (COLUMN["temp_table_top_c"] - COLUMN["temp_table_bottom_c"]) * X / 1000, "x"),
    ),
    "probe_radius": ({"um": 2.0}, lambda: 2e-3 * np.column_stack([COLUMN["nx"], COLUMN["ny"], COLUMN["nz"]])),
    "probe_lobing": (
        {"amplitude_um": 2.0, "phase_rad": -0.5},
        lambda: (
            (2e-3 * np.cos(3 * np.arctan2(COLUMN["ny"], COLUMN["nx"]) - 0.5))[:, None]
            * np.column_stack([COLUMN["nx"], COLUMN["ny"], COLUMN["nz"]])
        ),
    ),
}


@pytest.mark.parametrize("name", FORMULAS)
def test_an_effect_moves_points_by_its_formula(name: str) -> None:
    parameters, formula = FORMULAS[name]
    np.testing.assert_allclose(CATALOGUE[name].displacement(POINTS, parameters), formula(), rtol=1e-12, atol=1e-15)


def test_the_rotation_of_the_table_carriage_in_the_chain_yxz_carries_x_and_z() -> None:
    points = recording("YXZ")
    x, y, _ = points.carriages.T
    e = CATALOGUE["rotation_y_z"].displacement(points, {"arcsec_per_m": 10.0})
    np.testing.assert_allclose(e, moved(x * 10 * ARCSECOND * y / 1000, "y"), atol=1e-15)


def test_the_stylus_tip_is_the_lever_of_the_ram_alone() -> None:
    n = len(POINTS)
    tipped = with_columns(POINTS, tip_x_mm=np.full(n, 30.0), tip_y_mm=np.full(n, -20.0), tip_z_mm=np.full(n, -150.0))
    same = CATALOGUE["rotation_x_y"].displacement(tipped, {"arcsec_per_m": 9.0})
    np.testing.assert_array_equal(same, CATALOGUE["rotation_x_y"].displacement(POINTS, {"arcsec_per_m": 9.0}))
    angle = 9 * ARCSECOND * (Z + 500) / 1000
    expected = moved(20 * angle, "x") + moved(30 * angle, "y")
    np.testing.assert_allclose(
        CATALOGUE["rotation_z_z"].displacement(tipped, {"arcsec_per_m": 9.0}), expected, atol=1e-15
    )


def bar_lengths(points: Points, e: Floats) -> Floats:
    xyz = (points.xyz + e).reshape(-1, 2, 3)
    return np.asarray(np.linalg.norm(xyz[:, 1] - xyz[:, 0], axis=1))


def test_an_expanded_bar_is_drawn_back_to_its_length_at_20_degrees() -> None:
    e = CATALOGUE["thermal_artefact"].displacement(POINTS, {"cte_per_k": 11.5e-6})
    excess = COLUMN["temp_artefact_c"].reshape(-1, 2)[:, 0] - 20
    expected = bar_lengths(POINTS, np.zeros_like(e)) * (1 - 11.5e-6 * excess)
    np.testing.assert_allclose(bar_lengths(POINTS, e), expected, rtol=1e-14)


def test_a_sagging_bar_is_drawn_out_by_the_square_of_the_cosine_of_its_elevation() -> None:
    e = CATALOGUE["artefact_sag"].displacement(POINTS, {"um": 6.0})
    bars_ = np.diff(POINTS.xyz.reshape(-1, 2, 3), axis=1)[:, 0]
    elevation = np.arcsin(bars_[:, 2] / np.linalg.norm(bars_, axis=1))
    expected = bar_lengths(POINTS, np.zeros_like(e)) + 6e-3 * np.cos(elevation) ** 2
    np.testing.assert_allclose(bar_lengths(POINTS, e), expected, rtol=1e-13)


def test_what_does_not_lie_on_a_line_does_not_sag_as_a_bar() -> None:
    corners = np.array([[0.0, 0.0, 0.0], [300.0, 0.0, 0.0], [0.0, 300.0, 0.0], [300.0, 300.0, 0.0]])
    flat = Points(corners, np.ones(4, int), np.arange(1, 5), np.ones(4, int), POINTS.machine, {}, np.arange(2, 6))
    with pytest.raises(CmmUqError, match=r"measurement 1 do not lie on one line.*artefact_bending"):
        raise CATALOGUE["artefact_sag"].unfit(flat) or AssertionError
    assert CATALOGUE["artefact_sag"].unfit(POINTS) is None
    assert not np.any(CATALOGUE["artefact_sag"].displacement(flat, {"um": 6.0}))


def test_a_bar_that_is_seen_from_a_mount_is_where_the_mount_sees() -> None:
    """The mount moves on an arc and looks at a bar; or along a line, and looks at what is none."""
    turn = np.linspace(0.0, 3.0, 5)[:, None]
    mount = 300.0 * np.hstack([np.cos(turn), np.sin(turn), 0 * turn])
    bar = np.linspace(-100.0, 100.0, 5)[:, None] * np.array([1.0, 0.0, 0.0])
    columns = {f"tip_{axis}_mm": (bar - mount)[:, i] for i, axis in enumerate("xyz")}
    one = np.ones(5, int)
    machine = replace(POINTS.machine, tip_on_every_carriage=True)
    seen = Points(mount, one, np.arange(1, 6), one, machine, columns, np.arange(2, 7))
    e = CATALOGUE["artefact_sag"].displacement(seen, {"um": 6.0})
    np.testing.assert_allclose(e[-1] - e[0], [6e-3, 0.0, 0.0], atol=1e-15)
    aside = replace(seen, xyz=bar, columns={f"tip_{axis}_mm": (mount - bar)[:, i] for i, axis in enumerate("xyz")})
    assert CATALOGUE["artefact_sag"].unfit(aside) is not None


def test_a_gauge_that_is_measured_forth_and_back_sags_from_its_first_face_to_the_farthest() -> None:
    """Nine faces, and back: the last point is the first face again. Every other face stands 9 mm beside the line."""
    forth = np.linspace(0, 600, 9)[:, None] * np.array([0.8, 0.6, 0.0])
    forth[1::2, 2] += 9.0
    both = np.vstack([forth, forth[::-1]])
    n = len(both)
    faces = Points(both, np.ones(n, int), np.arange(1, n + 1), np.ones(n, int), POINTS.machine, {}, np.arange(2, n + 2))
    e = CATALOGUE["artefact_sag"].displacement(faces, {"um": 6.0})
    along = e @ np.array([0.8, 0.6, 0.0])
    assert along[8] - along[0] == pytest.approx(6e-3, rel=1e-9)
    assert along[4] == pytest.approx(0.0, abs=1e-9), "in the middle nothing moves"
    np.testing.assert_allclose(e[:9], e[:8:-1], atol=1e-12)


@given(amplitude=st.floats(0.01, 50), phase=st.floats(-3.1, 3.1), period=st.floats(1, 500))
def test_amplitude_and_phase_survive_the_way_through_linear_coefficients(
    amplitude: float, phase: float, period: float
) -> None:
    effect = CATALOGUE["periodic_scale_x"]
    given_ = {"amplitude_um": amplitude, "period_mm": period, "phase_rad": phase}
    coefficients, shape = effect.from_reported(given_)
    back = effect.to_reported(coefficients, np.array(shape))
    assert {name: float(value) for name, value in back.items()} == pytest.approx(given_)


@pytest.mark.parametrize("name", CATALOGUE)
def test_the_displacement_is_linear_in_the_coefficients(name: str) -> None:
    effect = CATALOGUE[name]
    shape = [s.low * 10 for s in effect.shape]
    basis = effect.basis(on_table(POINTS, effect), shape)
    assert basis.shape == (len(POINTS), 3, len(effect.coefficients))
    assert np.all(np.isfinite(basis))


def test_an_unknown_effect_is_answered_with_the_nearest_name() -> None:
    with pytest.raises(CmmUqError, match=r"unknown effect 'scale_w'.*Did you mean"):
        effects(["scale_w"])


def test_an_effect_named_twice_is_refused() -> None:
    with pytest.raises(CmmUqError, match="named twice"):
        effects(["scale_x", "scale_x"])


def test_a_missing_column_is_named() -> None:
    bare = bars(np.random.default_rng(0), 3, 300.0, Machine())
    with pytest.raises(CmmUqError, match="no column 'approach_x'"):
        CATALOGUE["hysteresis_x"].basis(bare)


def test_an_effect_that_needs_the_travel_asks_for_it() -> None:
    bare = bars(np.random.default_rng(0), 3, 300.0, Machine())
    with pytest.raises(CmmUqError, match="travel of axis x is needed"):
        CATALOGUE["straightness_x_y"].basis(bare)


@pytest.mark.parametrize(
    ("wrong", "message"), [({"ppm": 1, "um": 1}, "no parameter 'um'"), ({}, "needs the parameter")]
)
def test_wrong_parameters_are_refused(wrong: dict[str, float], message: str) -> None:
    with pytest.raises(CmmUqError, match=message):
        CATALOGUE["scale_x"].displacement(POINTS, wrong)


def test_the_page_of_effects_is_up_to_date() -> None:
    """Written anew by ``python -m tests.machine.physics.effect_table``."""
    text = PAGE.read_text(encoding="utf-8")
    assert text.partition(START)[2].partition(END)[0].strip() == table()


def test_a_parameter_s_name_ends_in_its_unit_where_it_has_one() -> None:
    """What reads results.json, a digital certificate or QIF has nothing else."""
    for effect in EVERY.values():
        for one in effect.reported:
            said = printed_unit(one.name)
            assert said == NOTHING if one.unit == UNITS["1"] else isinstance(said, Unit) and said.dsi == one.unit.dsi
