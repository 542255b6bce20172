"""Multilateration: errors, stations, dead paths and targets come out of distances that a simulator of its own makes.

Its machine is `benchmarks/artefacts/multilateration_coverage.py`: kinematics written out, no code of the package.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest
from scipy.optimize import least_squares

from benchmarks.artefacts.multilateration_coverage import ARMS, MACHINE, NAMES, SET_UPS, Square, read, recorded, targets
from cmm_uq.artefacts import artefact_facts
from cmm_uq.artefacts.multilateration.artefact import READING, Multilateration, first_station, nearest_station, shape_of
from cmm_uq.artefacts.multilateration.page import FreePoints, free_points, standpoints
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.points import Floats, Points
from cmm_uq.machine.model import RecordingModel
from cmm_uq.machine.physics.catalogue import effects
from cmm_uq.maths.inference.linear_model import LeastSquares
from cmm_uq.maths.uncertainty.air.state import harris_2004
from tests.artefacts.constructions import free

KNOWN = artefact_facts(kind="multilateration", u_scale_um_per_m=0.0)
SMALL = 0.01  # of a machine's usual errors: what these change over their own size is then nothing
DEAD = np.array([120.0, -250.0, 30.0, 290.0, -10.0, 75.0])
COUNT, STATIONS = len(targets()), len(SET_UPS)


@cache
def machine(size: float = SMALL) -> Square:
    return Square(np.random.default_rng(3), size=size)


def recording(off: Floats | float = 0.0, size: float = SMALL) -> Points:
    points = recorded(machine(size), DEAD, np.zeros(COUNT * STATIONS) + off)
    return replace(points, lines=np.arange(2, len(points) + 2))


def estimated(points: Points, names: list[str] = NAMES, facts: Any = KNOWN, sigma: float | None = 1e-3) -> LeastSquares:
    return RecordingModel(Multilateration(facts, points), effects(names), sigma).estimate().least_squares


def of(points: Points, *numbers: int) -> Points:
    return points.select(np.isin(points.measurement, numbers))


def test_a_place_and_its_dead_path_are_those_of_a_published_example() -> None:
    """Sauer, Numerical Analysis (2nd ed., 2012), Reality Check 4: four satellites, the receiver at
    (−41.77271, −16.78919, 6370.0596) km, its clock wrong by −3.201566 ms."""
    satellites = np.array(
        [[15600, 7540, 20140], [18760, 2750, 18610], [17610, 14630, 13480], [19170, 610, 18390]], float
    )
    light = 299792.458
    ranges = light * np.array([0.07074, 0.07220, 0.07690, 0.07242])
    found = nearest_station(satellites, ranges, np.zeros((4, 0)), np.array([0.0, 0.0, 6370.0, 0.0]))
    assert found[:3] == pytest.approx([-41.77271, -16.78919, 6370.0596], abs=5e-5)
    assert -found[3] / light == pytest.approx(-3.201566e-3, abs=5e-10)


def test_errors_stations_and_dead_paths_come_out_of_exact_distances() -> None:
    """All 21 errors; places to a nanometre."""
    points = recording()
    model = RecordingModel(Multilateration(KNOWN, points), effects(NAMES), 1e-3)
    estimate = model.estimate()
    found = estimate.least_squares
    assert found.value[:21] == pytest.approx(machine().true, abs=2e-6)
    for one, (place, _), dead in zip(
        standpoints(model, found.value, found.covariance, 0.0), SET_UPS, DEAD, strict=True
    ):
        assert one.position == pytest.approx(place, abs=2e-6)
        assert one.dead_path == pytest.approx(dead, abs=2e-6)
        assert (one.readings, one.drift) == (COUNT, None)
        assert one.residual_rms < 1e-7


def test_a_machine_as_they_are_is_found_to_a_part_of_a_thousand() -> None:
    """What errors of some 8 ppm and 8″ change over their own size is the rest."""
    assert np.abs(estimated(recording(size=1.0)).value[:21] - machine(1.0).true).max() < 0.01


def dense(points: Points) -> tuple[Floats, Floats]:
    """Values (21 + 4s,) and covariance of least squares over all unknowns at once, µm and mm, by SciPy and the simulator."""
    tips = np.column_stack([points.columns[f"tip_{a}_mm"] for a in "xyz"])
    station, xyz = points.measurement - 1, points.xyz
    columns = []
    for k in range(21):
        one = Square(np.random.default_rng(0), size=0.0)
        flat = np.eye(21)[k]
        one.scale, one.angles, one.turn = flat[:3], flat[3:6], flat[12:].reshape(3, 3)
        one.bow[[0, 0, 1, 1, 2, 2], [1, 2, 0, 2, 0, 1]] = flat[6:12]
        columns.append(one.off(xyz, tips))
    basis = np.stack(columns, axis=-1)

    def off(values: Floats) -> Floats:
        places = values[21:].reshape(-1, 4)[station]
        reflector = xyz + tips + basis @ values[:21]
        return 1e3 * (np.linalg.norm(reflector - places[:, :3], axis=1) - places[:, 3] - points.columns[READING])

    start = np.column_stack([[place for place, _ in SET_UPS], DEAD]) + 3.0
    tight = {"xtol": 1e-15, "ftol": 1e-15, "gtol": 1e-15}
    found = least_squares(off, np.append(np.zeros(21), start), x_scale="jac", jac="3-point", **tight)
    freedom = len(points) - len(found.x)
    return found.x, np.linalg.inv(found.jac.T @ found.jac) * np.sum(found.fun**2) / freedom


def test_estimates_and_uncertainties_are_those_of_dense_least_squares_over_all_unknowns() -> None:
    points = recording(np.random.default_rng(5).normal(0, 3e-7, COUNT * STATIONS), size=0.001)
    model = RecordingModel(Multilateration(KNOWN, points), effects(NAMES))
    estimate = model.estimate()
    found, (values, covariance) = estimate.least_squares, dense(points)
    assert found.degrees_of_freedom == STATIONS * COUNT - 21 - 4 * STATIONS
    u = np.sqrt(np.diag(covariance))
    assert found.value[:21] == pytest.approx(values[:21], abs=1e-6)
    assert np.abs((found.value[:21] - values[:21]) / u[:21]).max() < 1e-3
    assert np.sqrt(np.diag(found.covariance))[:21] == pytest.approx(u[:21], rel=1e-4)
    stations = standpoints(model, found.value, found.covariance, found.sigma)
    for i, one in enumerate(stations):
        own = slice(21 + 4 * i, 25 + 4 * i)
        assert [*one.position, one.dead_path] == pytest.approx(values[own], abs=1e-8)
        assert one.u == pytest.approx(u[own], rel=1e-4)


def test_a_station_stands_where_the_readings_that_are_used_put_it() -> None:
    off = 0.05 * (np.arange(COUNT * STATIONS) == 60)
    model = RecordingModel(Multilateration(KNOWN, recording(off)), effects(NAMES), 1e-3, off == 0)
    estimate = model.estimate()
    found = estimate.least_squares
    one = standpoints(model, found.value, found.covariance, 0.0)[1]
    assert one.position == pytest.approx(SET_UPS[1][0], abs=2e-6)
    assert one.dead_path == pytest.approx(DEAD[1], abs=2e-6)
    assert one.readings == COUNT - 1


def test_without_its_scale_known_all_scales_stay_open_together() -> None:
    facts = artefact_facts(kind="multilateration")
    (found,) = free(estimated(recording(), ["scale_x", "scale_y", "scale_z", "squareness_xy"], facts))
    assert set(found) == {"scale_x", "scale_y", "scale_z", "artefact"}
    assert [found[f"scale_{a}"] for a in "xyz"] == pytest.approx([1.0] * 3, rel=1e-5)
    longest = Multilateration(facts, recording()).sizes[0].nominal
    assert found["artefact"] == pytest.approx(1e-6 * longest, rel=1e-4)


def test_one_reflector_leaves_rotations_open_that_arms_of_their_own_show_and_one_station_far_more() -> None:
    """By hand, of an arm of 120 mm below the ram: a rotation of Z by 1″/m is a squareness of 0.12″."""
    points = recording(size=0.0)
    one_arm = free(estimated(of(points, 1, 2, 3, 4)))
    assert one_arm[:2] == [{"rotation_z_z": 1.0}, {"rotation_y_z": 1.0}]
    yz, zx = one_arm[2:]
    assert yz == pytest.approx({"squareness_yz": 1.0, "rotation_z_x": 1000 / 120}, rel=1e-6)
    assert zx == pytest.approx({"squareness_zx": 1.0, "rotation_z_y": -1000 / 120}, rel=1e-6)
    assert not free(estimated(points))
    assert len(free(estimated(of(points, 1)))) == 8


def test_a_motion_of_the_machine_as_a_whole_is_no_error() -> None:
    """Stations moved and turned with all that is measured give the same errors."""
    turn = np.linalg.qr(np.random.default_rng(2).normal(size=(3, 3)))[0]
    turn *= np.sign(np.linalg.det(turn))
    xyz, one = targets(), machine()
    tip = np.array(ARMS[0], dtype=float)
    truly = xyz + tip + one.off(xyz, tip)
    parts, moved = [], np.array([[5.0], [-3.0], [8.0]])
    for place, _ in SET_UPS[:4]:
        away = turn @ truly.T + moved - (turn @ np.array(place)[:, None] + moved)
        parts.append(np.linalg.norm(away, axis=0))
    points = of(recording(), 1, 2, 3, 4)
    again = replace(points, columns={**points.columns, READING: np.concatenate(parts) - 1000.0})
    names = [
        name for name in NAMES if not name.startswith("rotation_z") and name not in ("squareness_yz", "squareness_zx")
    ]
    assert estimated(again, names).value == pytest.approx(estimated(points, names).value, abs=1e-6)


def test_a_dead_path_that_drifts_is_told_apart_where_the_job_says_so() -> None:
    points = recording()
    hours, growth = points.columns["time_s"] / 3600, 0.02 * points.measurement
    drifting = replace(points, columns={**points.columns, READING: points.columns[READING] - growth * hours})
    facts = artefact_facts(kind="multilateration", u_scale_um_per_m=0.0, dead_path_drifts=True)
    model = RecordingModel(Multilateration(facts, drifting), effects(NAMES), 1e-3)
    found = model.estimate()
    assert found.least_squares.value[:21] == pytest.approx(machine().true, abs=1e-4)
    stations = standpoints(model, found.least_squares.value, found.least_squares.covariance, 0.0)
    assert [one.drift for one in stations] == pytest.approx([0.02 * i for i in range(1, 7)], rel=1e-3)
    assert np.abs(estimated(drifting).value[:21] - machine().true).max() > 0.1
    assert found.least_squares.degrees_of_freedom == STATIONS * COUNT - 21 - 5 * STATIONS


def test_readings_in_air_are_corrected_by_its_index_over_the_whole_path() -> None:
    points = recording()
    warm = {"temp_air_c": 24.0, "pressure_hpa": 980.0, "humidity_pct": 40.0}
    light = (450.0, 632.991)
    index, standard = (
        harris_2004(*map(np.array, air), *map(np.array, light))
        for air in ((24.0, 98000.0, 40.0), (20.0, 101325.0, 50.0))
    )
    path = points.columns[READING] + np.repeat(DEAD, COUNT)
    read_in_air = points.columns[READING] + (index - standard) * path
    columns = {**points.columns, READING: read_in_air, **{k: np.full(len(points), v) for k, v in warm.items()}}
    facts = artefact_facts(kind="multilateration", u_scale_um_per_m=0.0, air_corrected=False)
    assert estimated(replace(points, columns=columns), facts=facts).value[:21] == pytest.approx(
        machine().true, abs=1e-4
    )


def test_a_simulated_machine_stands_at_its_targets_and_the_interferometer_reads_how_far_they_truly_are() -> None:
    points = recorded(Square(np.random.default_rng(0), size=0.0), DEAD, np.zeros(COUNT * STATIONS))
    model = RecordingModel(Multilateration(KNOWN, points), effects(NAMES), 1e-3)
    drawn = model.predicted(np.append(machine().true, model.artefact.sizes[0].nominal))
    found = model.artefact.recorded(points, drawn)
    np.testing.assert_array_equal(found.xyz, points.xyz)
    assert estimated(found).value[:21] == pytest.approx(machine().true, abs=1e-5)
    apart = found.columns[READING] - recording().columns[READING]
    free_columns = model.artefact.placing(model.artefact.points.xyz).dense()  # a station is drawn nowhere in particular
    left = apart - free_columns @ np.linalg.lstsq(free_columns, apart, rcond=None)[0]
    assert np.abs(left).max() < 1e-7 < 1e-4 < np.abs(apart).max()


def alone(points: Points, u_scale: float | None = 0.0) -> FreePoints:
    found = free_points(Multilateration(KNOWN, points), u_scale)
    assert isinstance(found, FreePoints)
    return found


def test_targets_of_four_stations_are_found_without_the_machine() -> None:
    """Whatever its errors; but for a motion of all."""
    xyz, tip = targets(), np.array(ARMS[0], dtype=float)
    bumps = 1e-4 * np.random.default_rng(8).normal(size=xyz.shape)  # of no machine that anybody has a model for
    parts = [np.linalg.norm(xyz + tip + bumps - place, axis=1) for place, _ in SET_UPS[:4]]
    points = of(recording(), 1, 2, 3, 4)
    points = replace(points, columns={**points.columns, READING: np.concatenate(parts) - np.repeat(DEAD[:4], COUNT)})
    found = alone(points)
    assert found.errors == pytest.approx(found.without_motion(bumps), abs=2e-8)
    assert found.degrees_of_freedom == 4 * COUNT - 3 * COUNT - 16 + 6
    assert found.residual_sd < 1e-8
    about = xyz - xyz.mean(axis=0)
    for motion in (np.tile([1.0, 0, 0], (COUNT, 1)), np.cross([0, 1.0, 0], about)):
        assert np.abs(found.without_motion(motion)).max() < 1e-6 * np.abs(motion).max()
        assert abs(np.sum(found.errors * motion)) < 1e-9 * np.abs(motion).sum()
    assert np.abs(found.without_motion(1e-6 * about)).max() > 1e-4
    open_scale = alone(points, None)
    assert open_scale.gauge.shape[1] == 7
    assert np.abs(open_scale.without_motion(1e-6 * about)).max() < 1e-9
    assert open_scale.degrees_of_freedom == found.degrees_of_freedom + 1


def test_the_covariance_of_targets_is_that_of_dense_least_squares_seen_without_a_motion() -> None:
    """By any generalized inverse of the normal equations in all unknowns, from differences of the distances themselves."""
    random = np.random.default_rng(9)
    points = of(recording(random.normal(0, 1e-6, COUNT * STATIONS)), 1, 2, 3, 4)
    points = points.select((points.point - 1) % 3 != 1)
    found, q = alone(points), 4
    t, xyz = len(found.point), points.xyz[: len(found.point)] + np.array(ARMS[0])

    def distances(values: Floats) -> Floats:
        places = values[3 * t :].reshape(q, 4)
        away = (xyz + values[: 3 * t].reshape(t, 3))[None] - places[:, None, :3]
        return (np.linalg.norm(away, axis=2) - places[:, 3:]).ravel()

    start = np.append(np.zeros(3 * t), np.column_stack([[place for place, _ in SET_UPS[:q]], DEAD[:q]]))
    steps = 1e-3 * np.eye(len(start))
    J = np.column_stack([(distances(start + step) - distances(start - step)) / 2e-3 for step in steps])
    still = np.eye(3 * t) - found.gauge @ found.gauge.T
    inverse = still @ np.linalg.pinv(J.T @ J, rcond=1e-10)[: 3 * t, : 3 * t] @ still
    assert found.covariance == pytest.approx(found.residual_sd**2 * inverse, abs=1e-5 * found.covariance.max())
    assert found.residual_sd == pytest.approx(1e-6, rel=0.5)
    wider = alone(points, 0.5)
    growth = 0.5e-6 * (xyz - xyz.mean(axis=0)).ravel()
    assert wider.covariance - found.covariance == pytest.approx(np.outer(growth, growth), abs=1e-13)


@pytest.mark.parametrize(
    ("points", "said"),
    [
        (lambda: of(recording(), 1, 2, 3), "No target was read from 4 stations."),
        (lambda: of(recording(), 1, 2, 3, 5), "No target was read from 4 stations."),  # one with another arm
        (lambda: of(recording(), 1, 2, 3, 4).select(np.tile(np.arange(COUNT) % 7 == 0, 4)), "do not determine each other"),
    ],
)  # fmt: skip
def test_why_targets_are_not_found_is_said(points: Any, said: str) -> None:
    assert said in str(free_points(Multilateration(KNOWN, points()), 0.0))


def changed(**columns: Any) -> Points:
    points = recording()
    return replace(points, columns={**points.columns, **{name: np.asarray(v(points)) for name, v in columns.items()}})


@pytest.mark.parametrize(
    ("points", "said", "fix"),
    [
        (lambda: of(recording(), 1).select(np.arange(5)), "measurement 1 has 5 targets", "or leave the station"),
        (lambda: recording().select(recording().xyz[:, 2] < -500), "targets in one plane", "all three axes"),
        (lambda: changed(reading_mm=lambda p: p.columns[READING] / 25.4), "off what one station", "another unit or sign"),
        (lambda: changed(reading_mm=lambda p: -p.columns[READING]), "off what one station", "another unit or sign"),
        (lambda: changed(tip_x_mm=lambda p: p.columns["tip_x_mm"] + (p.point == 3)), "several offsets", "of its own"),
    ],
)  # fmt: skip
def test_what_no_station_reads_is_refused_with_its_line(points: Any, said: str, fix: str) -> None:
    with pytest.raises(CmmUqError) as told:
        Multilateration(KNOWN, points())
    assert said in told.value.problem
    assert fix in str(told.value.fix)
    assert "line" in str(told.value.where)


def test_readings_in_metres_are_held_against_nothing_before_they_are_refused() -> None:
    """Positions a thousand times as large would fit them as well, and are not what is wrong."""
    assert shape_of(KNOWN, recording()) is not None
    metres = changed(reading_mm=lambda p: p.columns[READING] / 1000)
    assert shape_of(KNOWN, metres) is None
    with pytest.raises(CmmUqError, match="off what one station"):
        Multilateration(KNOWN, metres)


@pytest.mark.parametrize(("name", "keys"), [(READING, {}), ("time_s", {"dead_path_drifts": True})])
def test_a_missing_column_is_named(name: str, keys: dict[str, bool]) -> None:
    points = recording()
    less = {key: values for key, values in points.columns.items() if key != name}
    with pytest.raises(CmmUqError, match=f"no column '{name}'"):
        Multilateration(artefact_facts(kind="multilateration", **keys), replace(points, columns=less))


def test_a_first_place_needs_targets_in_space() -> None:
    xyz = targets()
    far = np.linalg.norm(xyz - SET_UPS[0][0], axis=1)
    assert first_station(xyz, far - 7.0) == pytest.approx([*SET_UPS[0][0], 7.0], abs=1e-6)
    assert first_station(xyz[:4], far[:4]) is None
    assert first_station(xyz * [1, 1, 0], np.linalg.norm(xyz * [1, 1, 0] - SET_UPS[0][0], axis=1)) is None


def test_every_station_was_read_by_the_simulator_from_its_own_place() -> None:
    place, tip = (np.array(each, dtype=float) for each in SET_UPS[4])
    ideal = read(Square(np.random.default_rng(0), size=0.0), place, tip, targets())
    assert ideal == pytest.approx(np.linalg.norm(targets() + tip - place, axis=1), abs=1e-12)
    assert MACHINE.chain == "XYZ"
