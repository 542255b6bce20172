"""Large features by few coefficients err as they do by a coefficient a coordinate."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy import stats

from cmm_uq.analysis.machine.state import MachineState, StatedNoise
from cmm_uq.analysis.parts import virtual
from cmm_uq.analysis.parts.causes import cause as condensing
from cmm_uq.analysis.parts.causes.surroundings import SurfaceForm
from cmm_uq.analysis.parts.plan import Nominal, PartAlignment, PartCharacteristic, PartFeature, Plan
from cmm_uq.analysis.parts.virtual import MeasurementConditions, Virtual
from cmm_uq.base.points import Floats, Machine
from cmm_uq.machine.physics.catalogue import effects
from cmm_uq.maths.geometry import minimax
from cmm_uq.maths.geometry.repeated import Raised, Repeated

UP = np.array([0.0, 0.0, 1.0])


def face(rows: int, columns: int) -> PartFeature:
    x, y = np.meshgrid(np.linspace(0, 110, columns), np.linspace(0, 70, rows))
    points = np.column_stack([x.ravel(), y.ravel(), np.zeros(x.size)])
    return PartFeature("A", "plane", points, np.tile(UP, (len(points), 1)), "stylus", Nominal(points.mean(axis=0), UP))


def bore(sections: int, count: int) -> PartFeature:
    z, angle = (
        each.ravel() for each in np.meshgrid(np.linspace(2, 18, sections), 2 * np.pi * np.arange(count) / count)
    )
    normals = -np.column_stack([np.cos(angle), np.sin(angle), np.zeros(len(z))])
    points = np.array([50.0, 30.0, -20.0]) + np.column_stack([np.zeros((len(z), 2)), z]) - 15 * normals
    return PartFeature("bore", "cylinder", points, normals, "stylus", Nominal(np.array([50.0, 30.0, -10.0]), UP, 30.0))


PLAN = Plan(
    (face(15, 16), bore(15, 14)),
    (
        PartCharacteristic("flatness", "flatness", ("A",), association="minimum_zone"),
        PartCharacteristic("size", "size", ("bore",)),
        PartCharacteristic("squareness", "perpendicularity", ("bore",), ("A",)),
    ),
    alignment=PartAlignment(("A",)),
)


def circumstances(measured: Floats | None) -> MeasurementConditions:
    draws = np.random.default_rng(1).standard_normal((2000, 2)) * [3.0, 2.0]
    noise = StatedNoise(np.tile([[1e-3, 2e-3, 1.5e-3], [2e-3, 1e-3, 1e-3]], (1000, 1)))
    machine = MachineState(Machine("mine"), effects(["scale_x", "squareness_zx"]), draws, noise)
    return MeasurementConditions(machine, forms=(SurfaceForm("A", roughness_um=0.5),), measured=measured)


def lighter(monkeypatch: pytest.MonkeyPatch, given: MeasurementConditions) -> Virtual:
    for module in (condensing, virtual):
        monkeypatch.setattr(module, "LARGE", 200)
    return Virtual(PLAN, given)


@pytest.mark.long
@pytest.mark.parametrize("form", [None, 0.004])
def test_errors_of_large_features_are_distributed_as_those_of_every_coordinate(
    monkeypatch: pytest.MonkeyPatch, form: float | None
) -> None:
    """Means, standard deviations and correlations of 20 000 draws each way, to four standard deviations."""
    wave = np.sin(PLAN.points[:, :1] / 15) * np.cos(PLAN.points[:, 1:2] / 11)
    given = circumstances(None if form is None else PLAN.points + form * wave * PLAN.normals)
    every = Virtual(PLAN, given)
    few = lighter(monkeypatch, given)
    assert sum(len(cause.factors) for cause in few.places[0].causes) < 0.4 * sum(
        len(cause.factors) for cause in few.whole[0].causes
    )
    one, other = (each.errors(np.random.default_rng(seed), 20_000) for each, seed in ((every, 2), (few, 3)))
    u = one.std(axis=0)
    limit = 4 * np.sqrt(2 / 20_000)
    # a zone that is turned round is known to its pilot of 10 000 draws, each way its own
    pilot = 4 * np.sqrt(2 / 10_000) if form else 0.0
    np.testing.assert_allclose(one.mean(axis=0) / u, other.mean(axis=0) / u, atol=limit + pilot)
    np.testing.assert_allclose(other.std(axis=0) / u, 1, atol=limit + pilot)
    np.testing.assert_allclose(np.corrcoef(one.T), np.corrcoef(other.T), atol=limit)


@pytest.mark.parametrize("association", ["least_squares", "minimum_zone"])
@pytest.mark.parametrize("feature", [face(12, 12), bore(12, 12)], ids=["plane", "cylinder"])
def test_points_along_their_normals_are_those_points(feature: PartFeature, association: str) -> None:
    repeated, random = Repeated(feature.kind, feature.points), np.random.default_rng(4)
    heights, offset = 2e-3 * random.standard_normal((5, 144)), 1e-3 * random.standard_normal((144, 3))
    every = getattr(repeated, association)(offset + heights[:, :, None] * feature.normals)
    along = getattr(repeated, association)(Raised(heights, feature.normals, offset))
    for name in ("position", "direction", "form"):
        np.testing.assert_allclose(getattr(along, name), getattr(every, name), rtol=0, atol=1e-9)


@pytest.mark.parametrize("feature", [face(35, 36), bore(35, 36)], ids=["plane", "cylinder"])
def test_zones_of_points_that_stand_out_are_those_of_all_points(
    monkeypatch: pytest.MonkeyPatch, feature: PartFeature
) -> None:
    repeated, random = Repeated(feature.kind, feature.points), np.random.default_rng(5)
    errors = 1e-3 * random.standard_normal((8, 1260, 3)) + 0.01 * np.sin(feature.points / 20)
    screened = repeated.minimum_zone(errors)
    monkeypatch.setattr(minimax, "SCREENED", 10_000)
    every = repeated.minimum_zone(errors)
    np.testing.assert_allclose(screened.form, every.form, rtol=0, atol=1e-12)
    np.testing.assert_allclose(screened.direction, every.direction, rtol=0, atol=1e-12)


def test_what_moves_points_on_its_own_is_drawn_as_one_cause_as_it_is_as_several() -> None:
    """Squares of all points together, which the common factor of a draw makes vary, and heights of one of them."""
    flat = Plan((face(35, 36),), PLAN.characteristics[:1])
    place, rows = Virtual(flat, circumstances(flat.points)).places[0], flat.rows["A"]
    assert place.summed is not None
    several, random = place.causes, np.random.default_rng(6)
    one, count = condensing.together(several), 3000
    assert len(several) - len(one) == 1
    heights = [
        sum(each.raised(np.asarray(each.draw(random, count)), rows, flat.normals) for each in causes)
        for causes in ([each for each in several if each not in one], one[-1:])
    ]
    for of in (lambda each: np.mean(each**2, axis=1), lambda each: each[:, 7]):
        assert stats.ks_2samp(*map(of, heights)).pvalue > 1e-4


def test_places_are_compared_by_some_points_of_a_large_feature() -> None:
    times, order = np.arange(3000.0)[::-1], np.arange(3000)[::-1]
    plan = replace(PLAN, features=(face(40, 75), bore(3, 8)), order=np.append(order, 3000 + np.arange(24)),
                   times_s=np.append(times, 4000.0 + np.arange(24)))  # fmt: skip
    few, given = virtual.thinned(plan, circumstances(plan.points + 1.0))
    np.testing.assert_array_equal(few.feature("A").points, plan.points[:3000:3])
    np.testing.assert_array_equal(few.feature("bore").points, plan.points[3000:])
    np.testing.assert_array_equal(given.measured, few.points + 1.0)
    assert np.all(np.diff(few.times_s[few.order]) > 0)
    assert virtual.thinned(PLAN, given) == (PLAN, given)


def test_what_acts_on_small_features_stays_as_it_is() -> None:
    few = Virtual(replace(PLAN, features=(face(3, 4), bore(3, 8))), circumstances(None))
    assert few.places == few.whole
