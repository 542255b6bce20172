"""The error map that all errors of a machine together make, given a recording."""

from __future__ import annotations

from copy import copy
from dataclasses import replace
from functools import cache, partial

import numpy as np
import pytest

from cmm_uq.analysis.machine import correction as room
from cmm_uq.analysis.machine.correction import FieldMap, field_map
from cmm_uq.artefacts import kind_of
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.points import Machine
from cmm_uq.machine.model.field import curves
from cmm_uq.machine.physics.catalogue import effects, every
from cmm_uq.machine.physics.compensation import NOMINAL, Compensation, PointConditions
from cmm_uq.machine.physics.effect import along
from cmm_uq.machine.physics.error_map import ErrorMap
from cmm_uq.machine.physics.map_interpolation import ErrorMaps, MapCovariance
from cmm_uq.machine.physics.superposition import Superposition
from cmm_uq.maths.inference.posterior import Doubt
from tests.artefacts.simulated import SCALE, SQUARE, analysed

TRAVEL = np.array([[0.0, 900.0], [0.0, 600.0], [-500.0, 0.0]])


@cache
def mapped(job: str) -> FieldMap:
    found = analysed(job)
    observe = partial(
        kind_of(found.job).observing("reported"), found.job.facts.artefact, where=found.job.recording_path
    )
    return field_map(found.model, found.posterior, found.doubt, observe, 0)


def positions(blank: ErrorMap, count: int) -> np.ndarray:
    random = np.random.default_rng(5)
    return np.column_stack([random.choice(each.positions, count) for each in blank.axes])


PLACED = [name for name, one in every().items() if room._of_place(one)]


@pytest.mark.parametrize("tip", [None, np.array([120.0, -40.0, -200.0])], ids=["bare", "tip"])
@pytest.mark.parametrize("leaning", [0.0, 1.0])
@pytest.mark.parametrize("chain", ["XYZ", "YXZ", "ZXY", "XFYZ", "YFXZ"])
def test_a_map_moves_points_by_what_the_errors_themselves_do(
    chain: str, leaning: float, tip: np.ndarray | None
) -> None:
    """All errors of the catalogue that follow from the place, and the curves of the field, at once: the compensation by the
    map beside the superposition of effects, where a map has its positions. Axes that lean by some 50″ (2.4·10⁻⁴) turn what
    goes along them, to which order both are the same. With a tip turns of what carries nothing show, of the ram too."""
    machine = Machine(chain=chain, travel_mm=TRAVEL, origin_mm=np.array([100.0, -20.0, 30.0]))
    machine = replace(machine, tip_on_every_carriage=tip is not None)
    blank = room._blank([tuple(each) for each in TRAVEL.tolist()], 20.0)
    acting = [*effects(PLACED), *curves()]
    tables = [room._figures(one, machine, blank) for one in acting]
    held = [(one, table) for one, table in zip(acting, tables, strict=True) if table is not None]
    assert {one.name for one, _ in held} >= {*SCALE, *SQUARE, "rotation_x_z", "straightness_y_z", "scale_curvature_z"}
    random = np.random.default_rng(6)
    sizes = [
        0.1 * (leaning if one.plane else 1.0) * np.array([c.prior_sd for c in one.coefficients]) for one, _ in held
    ]
    coefficients = np.concatenate([size * random.standard_normal(len(size)) for size in sizes])
    made = room._filled(blank, np.hstack([table for _, table in held]) @ coefficients)
    points = room._points(machine, positions(blank, 50), tip)
    expected = Superposition(tuple(one for one, _ in held)).errors(points, coefficients)
    when = NOMINAL if tip is None else PointConditions(tip=np.tile(tip, (50, 1)))
    e, _ = Compensation(ErrorMaps([made]), chain, machine.origin_mm).error(points.xyz, when)
    np.testing.assert_allclose(e, expected, atol=(1e-9 + 3e-4 * leaning) * np.abs(expected).max())


def test_an_error_that_depends_on_two_carriages_stands_in_no_map() -> None:
    both = copy(effects(["scale_x"])[0])
    both.basis = lambda points, shape=(): along(  # type: ignore[method-assign]
        "x", points.readings["x"] * points.readings["y"] * 1e-9
    )
    machine = Machine(travel_mm=TRAVEL)
    assert room._figures(both, machine, room._blank([tuple(each) for each in TRAVEL.tolist()], 20.0)) is None


@pytest.mark.parametrize("chain", ["XYZ", "YXZ", "XFYZ"])
def test_a_displacement_and_a_turn_of_everything_move_all_points_as_one_body(chain: str) -> None:
    """By hand: e = d + ω × r, r the scale readings."""
    blank = room._blank([tuple(each) for each in TRAVEL.tolist()], 20.0)
    readings = positions(blank, 30)
    root = MapCovariance(room._rigid(blank, chain), np.zeros(3)).root(blank, readings, chain=chain)
    for k in range(3):
        np.testing.assert_allclose(root[:, :, k], np.broadcast_to(np.eye(3)[k], (30, 3)), atol=1e-12)
        np.testing.assert_allclose(root[:, :, 3 + k], np.cross(np.eye(3)[k], readings), atol=1e-9)


@pytest.mark.long
def test_the_map_of_a_step_gauge_corrects_distances_to_within_their_uncertainty() -> None:
    """The example was simulated with nine-fold scales and squarenesses that are known, and nothing else: what they truly make
    of distances between 40 pairs of places, 2·u of which at least nine in ten hold, and of which little is left."""
    found, machine = mapped("step-gauge-simulated"), analysed("step-gauge-simulated").artefact.points.machine
    covariance = found.error_map.covariance
    assert covariance is not None
    random = np.random.default_rng(7)
    low, high = np.transpose(machine.travel_mm)
    readings = random.uniform(low, high, (80, 3))
    points = room._points(machine, readings)
    true = points.xyz + Superposition(effects([*SCALE, *SQUARE])).errors(
        points, np.array([*SCALE.values(), *SQUARE.values()])
    )
    corrected, _ = Compensation(ErrorMaps([found.error_map]), machine.chain, machine.origin_mm).compensate(points.xyz)
    pairs = np.arange(40), np.arange(40, 80)
    asread, now, truly = (np.linalg.norm(of[pairs[1]] - of[pairs[0]], axis=1) for of in (points.xyz, corrected, true))
    u = covariance.of_distances(covariance.root(found.error_map, readings, chain=machine.chain), readings, pairs)
    assert np.mean(np.abs(now - truly) <= 2 * u) >= 0.9
    assert np.std(now - truly) < 0.2 * np.std(asread - truly)


@pytest.mark.long
def test_set_ups_that_were_held_out_are_predicted_as_well_as_was_foretold() -> None:
    """Twenty bars of a real machine. Uncorrected, or corrected with the sign turned round, they are off by far more."""
    held = mapped("iota-1102-20C").held_out
    assert held is not None
    assert held.corrected < held.named < 0.3 * held.uncorrected
    assert held.uncorrected == pytest.approx(held.predicted[0], rel=0.15)
    assert held.corrected < 1.2 * held.predicted[1]


def test_a_map_says_which_errors_it_does_not_hold() -> None:
    """Without directions of approach a recording shows no play, without times no drift."""
    assert {"hysteresis_x", "drift_z"} <= set(mapped("iota-1102-20C").omitted)
    assert not {*SCALE, *SQUARE} & set(mapped("iota-1102-20C").omitted)


@pytest.mark.long
def test_a_plate_that_lies_flat_leaves_the_axis_across_it_uncorrected() -> None:
    before, after = mapped("plate-simulated").range_um
    assert after > 0.9 * before > 100


def test_without_a_travel_there_is_no_map() -> None:
    found = analysed("iota-1102-20C")
    points = found.artefact.points
    artefact = copy(found.artefact)
    artefact.points = replace(points, machine=replace(points.machine, travel_mm=np.full((3, 2), np.nan)))
    with pytest.raises(CmmUqError, match="the travel of axis x is needed"):
        field_map(replace(found.model, artefact=artefact), found.posterior, found.doubt, lambda points: artefact, 0)


@pytest.mark.long
def test_distances_by_a_map_are_in_doubt_by_what_the_gauge_expanded() -> None:
    """5.75 ppm of all scales alike, besides what the example's own certificate leaves open: L·5.75 ppm in quadrature."""
    found = analysed("step-gauge-simulated")
    observe = partial(
        kind_of(found.job).observing("reported"), found.job.facts.artefact, where=found.job.recording_path
    )
    expands = np.zeros((len(found.model.unknowns), 1))
    expands[:3] = 5.75
    warm = field_map(
        found.model, found.posterior, Doubt((*found.doubt.carried, (expands, 0 * expands))), observe, 0
    ).error_map
    readings = np.array([[100.0, 100.0, -400.0], [700.0, 100.0, -400.0]])
    u = []
    for one in (mapped("step-gauge-simulated").error_map, warm):
        assert one.covariance is not None
        root = one.covariance.root(one, readings, chain=found.artefact.points.machine.chain)
        u.append(float(one.covariance.of_distances(root, readings, (np.array([0]), np.array([1])))[0]))
    assert u[1] == pytest.approx(np.hypot(u[0], 600 * 5.75e-6), rel=0.05)
