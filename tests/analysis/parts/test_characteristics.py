"""Characteristics of points that were moved by hand have the values that the drawing says, to a nanometre."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from cmm_uq.analysis.parts.association import ProbedFeature
from cmm_uq.analysis.parts.evaluation import Evaluator
from cmm_uq.analysis.parts.plan import Nominal, PartAlignment, PartCharacteristic, PartFeature, Plan
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.points import Floats
from cmm_uq.maths.geometry.association import Association
from tests.parts_drawn import UP, block, bore, circle, plane, ring, spot

NANOMETRE = 1e-6
Move = Callable[[Floats, Floats], Floats]


def measured(features: tuple[PartFeature, ...], one: PartCharacteristic, moves: dict[str, Move]) -> float:
    """Value of a characteristic where points p with normals n of some features stand at ``move(p, n)``."""
    plan = Plan(features, (one,))
    base = np.zeros_like(plan.points)
    for name, move in moves.items():
        rows = plan.rows[name]
        base[rows] = move(plan.points[rows], plan.normals[rows]) - plan.points[rows]
    return float(Evaluator(plan, base, [])([], exact=True)[0, 0])


def shifted(*by: float) -> Move:
    return lambda p, n: p + np.array(by)


def tilted(angle: float, about: tuple[float, float, float]) -> Move:
    """About an axis through the origin, by a small angle: turned exactly."""
    axis = np.array(about)
    K = np.array([[0, -axis[2], axis[1]], [axis[2], 0, -axis[0]], [-axis[1], axis[0], 0]])
    turn = np.eye(3) + np.sin(angle) * K + (1 - np.cos(angle)) * K @ K
    return lambda p, n: p @ turn.T


BLOCK = block()[0]
ABC = ("A", "B", "C")


@pytest.mark.parametrize(("one", "moves", "value"), [
    # a shaft whose points are all 5 µm farther out
    (PartCharacteristic("", "size", ("h1",)), {"h1": lambda p, n: p - 0.005 * n}, 20.01),
    (PartCharacteristic("", "distance", ("h1", "h2")), {"h2": shifted(0.0, 0.02, 0.0)}, np.hypot(140, 20.02)),
    (PartCharacteristic("", "distance", ("C", "D")), {"D": shifted(0.01, 0.7, 0.3)}, 200.01),
    (PartCharacteristic("", "distance", ("h1", "B")), {"h1": shifted(0.3, 0.01, 0.0)}, 40.01),
    (PartCharacteristic("", "x", ("h1",), ABC), {"h1": shifted(0.01, 0.02, 0.0)}, 30.01),
    (PartCharacteristic("", "y", ("h1",), ABC), {"h1": shifted(0.01, 0.02, 0.0)}, 40.02),
    # the datum face that moves away takes the coordinate with it
    (PartCharacteristic("", "x", ("h1",), ABC), {"C": shifted(0.01, 0.0, 0.0)}, 29.99),
    (PartCharacteristic("", "position", ("h1",), ABC), {"h1": shifted(0.003, 0.004, 0.0)}, 0.01),
    (PartCharacteristic("", "position", ("D",), ABC), {"D": shifted(0.004, 0.0, 0.0)}, 0.008),
    # a face of 200 mm that rises by 10 µm from end to end; parallel to the base, and as a tilt of its opposite
    (PartCharacteristic("", "parallelism", ("D",), ("C",)), {"D": tilted(1e-4, (0.0, 0.0, 1.0))}, 100 * np.sin(1e-4)),
    (PartCharacteristic("", "perpendicularity", ("D",), ("A",)), {"D": tilted(1e-4, (0.0, 1.0, 0.0))}, 20 * np.sin(1e-4)),
    # turned about the datum's normal a face stays at right angles to it
    (PartCharacteristic("", "perpendicularity", ("D",), ("A",)), {"D": tilted(1e-4, (0.0, 0.0, 1.0))}, 0.0),
    # an axis over 17 mm of measured depth
    (PartCharacteristic("", "perpendicularity", ("h1",), ("A",)), {"h1": tilted(1e-3, (1.0, 0.0, 0.0))}, 17 * np.sin(1e-3)),
    (PartCharacteristic("", "parallelism", ("h1",), ("h2",)), {"h1": tilted(1e-3, (1.0, 0.0, 0.0))}, 17 * np.sin(1e-3)),
    (PartCharacteristic("", "parallelism", ("h1",), ("B",)), {"h1": tilted(1e-3, (1.0, 0.0, 0.0))}, 17 * np.sin(1e-3)),
    (PartCharacteristic("", "parallelism", ("h1",), ("B",)), {"h1": tilted(1e-3, (0.0, 1.0, 0.0))}, 0.0),
    # normals −y and −x: a face whose normal turns from −x towards −y
    (PartCharacteristic("", "angle", ("B", "C")), {"C": tilted(1e-3, (0.0, 0.0, 1.0))}, np.pi / 2 - 1e-3),
])  # fmt: skip
def test_moved_features_of_a_block(one: PartCharacteristic, moves: dict[str, Move], value: float) -> None:
    assert measured(BLOCK, one, moves) == pytest.approx(value, abs=NANOMETRE)


def test_an_axis_that_leans_is_off_by_most_at_its_farther_end() -> None:
    """Held at the depth of 3 mm and leaning by 1 mrad it is 17 µm off at 20 mm, and that counts twice."""

    def lean(p: Floats, n: Floats) -> Floats:
        return p + 1e-3 * np.outer(p[:, 2] + 3, [1.0, 0, 0])

    value = measured(BLOCK, PartCharacteristic("", "position", ("h1",), ABC), {"h1": lean})
    assert value == pytest.approx(2 * 17e-3, rel=1e-5)


def stepped() -> tuple[PartFeature, ...]:
    """A journal, a collar above it, a shoulder."""
    at = [0.0, 0.0, 0.0]
    points, _ = ring(at, 30.0, 10.0, 12)
    shoulder = plane("shoulder", UP, [0, 0, 10], [[1, 0, 0], [0, 1, 0]], (2, 2))
    shoulder = PartFeature("shoulder", "plane", points, np.tile(UP, (12, 1)), "stylus", shoulder.nominal)
    return (
        bore("journal", at, 10.0, (-40.0, -20.0, 0.0), hole=False),
        circle("collar", at, 20.0, 12, hole=False),
        shoulder,
    )


@pytest.mark.parametrize(("one", "moves", "value"), [
    (PartCharacteristic("", "coaxiality", ("collar",), ("journal",)), {"collar": shifted(0.003, 0.004, 0.0)}, 0.01),
    # points at a whole number of steps from the direction of the offset: the range is twice the offset
    (PartCharacteristic("", "circular_runout", ("collar",), ("journal",)), {"collar": shifted(0.005, 0.0, 0.0)}, 0.01),
    (PartCharacteristic("", "circular_runout", ("shoulder",), ("journal",)), {"shoulder": tilted(1e-4, (0.0, 1.0, 0.0))},
     60 * np.sin(1e-4)),
    (PartCharacteristic("", "total_runout", ("journal",), ("journal",)), {"journal": lambda p, n: p * [1, 1, 1]}, 0.0),
])  # fmt: skip
def test_a_shaft_that_turns(one: PartCharacteristic, moves: dict[str, Move], value: float) -> None:
    assert measured(stepped(), one, moves) == pytest.approx(value, abs=2e-6)


def of_section(height: float, offset: float, wider: float) -> Move:
    """Points at one height are shifted along x, all others stand farther out."""

    def move(p: Floats, n: Floats) -> Floats:
        here = (np.abs(p[:, 2] - height) < 1)[:, None]
        return np.asarray(np.where(here, p + np.array([offset, 0, 0]), p + wider * n))

    return move


@pytest.mark.parametrize(("what", "value"), [("circular_runout", 0.010), ("total_runout", 0.025)])
def test_circular_runout_is_that_of_the_worst_section(what: str, value: float) -> None:
    """A section 5 µm off its axis runs out by 10 µm; another that is 20 µm wider all round runs out by nothing itself."""
    features = (*stepped()[:1], bore("pin", [0, 0, 0], 5.0, (60.0, 50.0), hole=False))
    one = PartCharacteristic("", what, ("pin",), ("journal",))
    assert measured(features, one, {"pin": of_section(60.0, 0.005, 0.020)}) == pytest.approx(value, abs=5e-6)


def test_a_face_runs_out_on_each_of_its_circles() -> None:
    """The outer circle of a shoulder lies 20 µm higher than the inner one, which is tilted by 0.1 mrad."""
    (inner, _), (outer, _) = ring([0, 0, 0], 20.0, 10.0, 8), ring([0, 0, 0], 30.0, 10.0, 8)
    points, up = np.vstack([inner, outer]), np.tile(UP, (16, 1))
    face = PartFeature("face", "plane", points, up, "stylus", Nominal(np.array([0.0, 0, 10]), UP))

    def lifted(p: Floats, n: Floats) -> Floats:
        return p + np.where(np.hypot(p[:, 0], p[:, 1]) > 25, 0.02, 1e-4 * p[:, 0])[:, None] * n

    for what, value in (("circular_runout", 1e-4 * 40), ("total_runout", 0.02 + 1e-4 * 20)):
        one = PartCharacteristic("", what, ("face",), ("journal",))
        assert measured((*stepped()[:1], face), one, {"face": lifted}) == pytest.approx(value, abs=NANOMETRE)


def test_coaxiality_of_an_axis_counts_its_lean() -> None:
    features = (bore("journal", [0, 0, 0], 10.0, (-40.0, 0.0)), bore("other", [0, 0, 0], 5.0, (100.0, 150.0)))
    one = PartCharacteristic("", "coaxiality", ("other",), ("journal",))
    assert measured(features, one, {"other": tilted(1e-4, (1.0, 0.0, 0.0))}) == pytest.approx(
        2 * 150 * np.sin(1e-4), rel=1e-6
    )


def wave(count: int, size: float) -> Move:
    """So many undulations about the part's axis, by ``size`` to either side."""
    return lambda p, n: p + size * np.cos(count * np.arctan2(p[:, 1], p[:, 0]))[:, None] * n


@pytest.mark.parametrize(("how", "size", "form"), [
    ("least_squares", 20.0, 0.008), ("minimum_zone", 20.0, 0.008), ("maximum_inscribed", 19.992, 0.008),
    ("minimum_circumscribed", 20.008, 0.008),
])  # fmt: skip
def test_three_lobes_by_every_association(how: Association, size: float, form: float) -> None:
    """±4 µm in three lobes at 12 points: the rims touch three points each, 120° apart."""
    ringed = (circle("c", [0, 0, 0], 10.0, 12, hole=False),)
    moves: dict[str, Move] = {"c": wave(3, 0.004)}
    of_size = measured(ringed, PartCharacteristic("", "size", ("c",), association=how), moves)
    of_form = measured(ringed, PartCharacteristic("", "roundness", ("c",), association=how), moves)
    assert [of_size, of_form] == pytest.approx([size, form], abs=NANOMETRE)


def test_a_datum_face_may_touch_from_outside() -> None:
    """One point of a face stands out by 8 µm in its middle: a tangent datum lies on it, least squares below."""
    face = plane("face", UP, [0, 0, 0], [[100, 0, 0], [0, 100, 0]], (3, 3), association="tangent")
    features = (face, spot("top", [50.0, 50.0, 30.0]))
    one = PartCharacteristic("", "distance", ("face", "top"))

    def bumped(p: Floats, n: Floats) -> Floats:
        return p + np.where(np.all(p[:, :2] == 50, axis=1), 0.008, 0.0)[:, None] * n

    assert measured(features, one, {"face": bumped}) == pytest.approx(30 - 0.008, abs=NANOMETRE)
    squares = PartCharacteristic("", "distance", ("face", "top"), association="least_squares")
    assert measured(features, squares, {"face": bumped}) == pytest.approx(30 - 0.008 / 9, abs=NANOMETRE)


def edge(name: str, start: Floats, end: Floats, out: Floats) -> PartFeature:
    """A line of five points on a side face."""
    points = start + np.linspace(0, 1, 5)[:, None] * (end - start)
    along = (end - start) / np.linalg.norm(end - start)
    return PartFeature(name, "line", points, np.tile(out, (5, 1)), "stylus", Nominal(start, along))


@pytest.mark.parametrize(("datums", "moves", "x", "y"), [
    # a face and two bores: the first says where, and where the second lies from it, (140, 20), how the part is turned
    (("A", "h1", "h2"), {"h1": shifted(0.14, 0.02, 0.0)}, -0.14, -0.02),
    (("A", "h1", "h2"), {"h2": shifted(0.7, 0.1, 5.0)}, 0.0, 0.0),
    # a second bore that moves across by a milliradian turns the point (100, 0), at (70, −40) from the first
    (("A", "h1", "h2"), {"h2": shifted(-0.02, 0.14, 0.0)}, -1e-3 * 40, -1e-3 * 70),
    # 3-2-1: a face, a line along x on the front, a point on the left; the point says x and nothing else
    (("A", "front", "left"), {"left": shifted(0.01, 3.0, 2.0)}, -0.01, 0.0),
    (("A", "front", "left"), {"front": shifted(3.0, 0.01, 2.0)}, 0.0, -0.01),
    (("A", "front", "left"), {"front": lambda p, n: p + np.outer(p[:, 0], [0, 1e-4, 0])}, 0.0, -1e-4 * 100),
])  # fmt: skip
def test_frames_of_datums_in_order(datums: tuple[str, ...], moves: dict[str, Move], x: float, y: float) -> None:
    """Where the point (100, 0, 0) of the part, which did not move, is then found; turns of a tenth of a millirad and less."""
    origin = np.zeros(3)
    features = (
        *BLOCK, spot("point", [100, 0, 0]), edge("front", origin, np.array([200.0, 0, 0]), np.array([0.0, -1, 0])),
        spot("left", [0, 0, -5], [-1, 0, 0]),
    )  # fmt: skip
    off = [
        measured(features, PartCharacteristic("", axis, ("point",), datums), moves) - at
        for axis, at in (("x", 100), ("y", 0))
    ]
    assert off == pytest.approx([x, y], abs=1.5e-4 if "h2" in moves and y else 1e-6)


def test_a_best_fit_takes_back_the_motion_of_all_points_and_shares_out_the_rest() -> None:
    """The block moved as a whole has no error; one of its two end faces, alike, 8 µm out moves it by half of it."""
    one = PartCharacteristic("", "x", ("h1",))
    plan = Plan(BLOCK, (one,), alignment=PartAlignment(best_fit=True))
    turn = Rotation.from_rotvec([1e-3, -2e-3, 1e-3]).as_matrix()
    whole = plan.points @ turn.T + [0.3, -0.2, 0.1] - plan.points
    assert Evaluator(plan, whole, [])([], exact=True)[0, 0] == pytest.approx(30.0, abs=NANOMETRE)
    ends = Plan(BLOCK[:4], (PartCharacteristic("", "position", ("C",)),), alignment=PartAlignment(best_fit=True))
    base = np.zeros_like(ends.points)
    base[ends.rows["D"], 0] = 0.008
    assert Evaluator(ends, base, [])([], exact=True)[0, 0] == pytest.approx(2 * 0.004, abs=NANOMETRE)


def test_a_best_fit_of_one_face_is_refused() -> None:
    with pytest.raises(CmmUqError, match="leave the part free to move by their best fit"):
        Evaluator(
            Plan(BLOCK[:1], (PartCharacteristic("", "x", ("A",)),), alignment=PartAlignment(best_fit=True)),
            np.zeros((16, 3)),
            [],
        )


@pytest.mark.parametrize(("one", "words"), [
    (PartCharacteristic("c", "flatness", ("h1",)), "a cylinder has no flatness"),
    (PartCharacteristic("c", "size", ("A",)), "a plane has no size"),
    (PartCharacteristic("c", "distance", ("A",)), "distance is of 2 features, not 1"),
    (PartCharacteristic("c", "parallelism", ("A",)), "needs a datum"),
    (PartCharacteristic("c", "coaxiality", ("h1",), ("A",)), "the datum of coaxiality is a plane"),
    (PartCharacteristic("c", "position", ("h1",)), "position needs datums"),
    (PartCharacteristic("c", "circular_runout", ("A",), ("h2",)), "no section of 'A' has 3 points"),
    (PartCharacteristic("c", "total_runout", ("round",), ("h2",)), "a circle has no total_runout"),
])  # fmt: skip
def test_what_a_feature_does_not_have_is_refused(one: PartCharacteristic, words: str) -> None:
    with pytest.raises(CmmUqError, match=words):
        measured((*BLOCK, circle("round", [100, 50, 0], 5.0)), one, {})


def cone(name: str, rings: tuple[float, ...] = (0.0, 8.0, 16.0)) -> PartFeature:
    """A cone of a half angle of 10° that widens upwards, of a radius of 10 mm at its position."""
    tangent = np.tan(np.radians(10.0))
    points = np.vstack([ring([0, 0, 0], 10.0 + tangent * z, z, 8, 0.2 * i)[0] for i, z in enumerate(rings)])
    out = np.column_stack(
        [points[:, :2] / np.hypot(points[:, 0], points[:, 1])[:, None], np.full(len(points), -tangent)]
    )
    nominal = Nominal(np.zeros(3), UP, 20.0, np.radians(10.0))
    return PartFeature(name, "cone", points, out / np.linalg.norm(out, axis=1)[:, None], "stylus", nominal)


PREPARED = {"cylinder": BLOCK[4], "cone": cone("cone")}


@pytest.mark.parametrize("kind", PREPARED)
@pytest.mark.parametrize("how", ["least_squares", "minimum_zone"])
def test_a_feature_prepared_at_its_nominal_points_is_the_same_a_little_elsewhere(kind: str, how: Association) -> None:
    """30 µm away, with form: the same axis, and the same point of it, over the middle of the measured points."""
    feature, random = PREPARED[kind], np.random.default_rng(1)
    points = feature.points + random.normal(0.03, 0.01, feature.points.shape)
    nominal = ProbedFeature(feature, feature.points, "least_squares")
    assert nominal.is_near(points)
    alone, shared = ProbedFeature(feature, points, how).base, ProbedFeature(feature, points, how, nominal).base
    np.testing.assert_allclose(shared[3:6], alone[3:6], atol=1e-9)
    assert shared[7] == pytest.approx(alone[7], abs=1e-9)
    along = (alone[:3] - shared[:3]) @ alone[3:6]
    np.testing.assert_allclose(shared[:3] + along * alone[3:6], alone[:3], atol=1e-8)
    assert alone[6] - shared[6] == pytest.approx(2 * along * np.tan(alone[7]), abs=1e-8)
    assert shared[:3] @ shared[3:6] == pytest.approx(points.mean(axis=0) @ shared[3:6], abs=1e-4)
    again = ProbedFeature(feature, feature.points, how, ProbedFeature(feature, points, how, nominal))
    np.testing.assert_allclose(again.base, ProbedFeature(feature, feature.points, how).base, atol=1e-8)


def test_a_feature_that_lies_far_away_is_prepared_anew() -> None:
    feature = PREPARED["cylinder"]
    nominal = ProbedFeature(feature, feature.points, "least_squares")
    far = feature.points * [1.1, 1.1, 1.0]
    assert not nominal.is_near(far)
    middle = feature.nominal.point * [1.1, 1.1, 1.0]
    found = ProbedFeature(feature, far, "least_squares", nominal).base
    assert found[6] == pytest.approx(22.0, abs=NANOMETRE)
    np.testing.assert_allclose(found[:2], middle[:2], atol=NANOMETRE)


SEAT = cone("seat")  # half an angle of 10°, widening upwards, 20 mm wide at z = 0


@pytest.mark.parametrize(("one", "moves", "value"), [
    # a circle lies as high as it is probed
    (PartCharacteristic("", "z", ("ring",), ABC), {"ring": shifted(0.0, 0.0, 0.02)}, -4.98),
    (PartCharacteristic("", "distance", ("ring", "A")), {"A": shifted(0.0, 0.0, 0.02)}, 5.02),
    (PartCharacteristic("", "distance", ("ring", "below")), {"below": shifted(0.3, 0.0, -0.02)}, np.hypot(0.3, 10.02)),
    (PartCharacteristic("", "z", ("h1",), ABC), {"h1": shifted(0.0, 0.0, 0.02)}, -35 / 3 + 0.02),
    # a cone where it is 20 mm wide: points that stand in or out by h move that place along the axis by h / sin 10°
    (PartCharacteristic("", "z", ("seat",), ABC), {}, 0.0),
    (PartCharacteristic("", "z", ("seat",), ABC), {"seat": lambda p, n: p + 0.01 * n}, -0.01 / np.sin(np.radians(10))),
    (PartCharacteristic("", "z", ("seat",), ABC), {"seat": shifted(0.0, 0.0, 0.02)}, 0.02),
    (PartCharacteristic("", "distance", ("D", "seat")), {"seat": shifted(0.02, 0.0, 0.0)}, 199.98),
])  # fmt: skip
def test_places_along_an_axis_are_measured_too(one: PartCharacteristic, moves: dict[str, Move], value: float) -> None:
    features = (*BLOCK, circle("ring", [100, 50, -5], 8.0), circle("below", [100, 50, -15], 8.0), SEAT)
    assert measured(features, one, moves) == pytest.approx(value, abs=2e-7)


@pytest.mark.parametrize("what", ["x", "y", "z"])
def test_what_carries_datums_and_feature_together_changes_no_coordinate(what: str) -> None:
    features = (*BLOCK, circle("ring", [100, 50, -5], 8.0), SEAT)
    for name in ("ring", "h2", "seat"):
        one = PartCharacteristic("", what, (name,), ABC)
        still = measured(features, one, {})
        carried = measured(features, one, {each.name: shifted(0.2, -0.1, 0.3) for each in features})
        assert carried == pytest.approx(still, abs=1e-8)
