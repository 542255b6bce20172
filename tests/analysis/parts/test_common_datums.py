"""Common datums: one axis, plane or place of several features, against exact constructions and a general least squares."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from cmm_uq.analysis.parts.causes.cause import PointScatter
from cmm_uq.analysis.parts.datums import ProbedCommon
from cmm_uq.analysis.parts.evaluation import Evaluator
from cmm_uq.analysis.parts.plan import CommonDatum, Nominal, PartCharacteristic, PartFeature, Plan
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.points import Floats
from cmm_uq.maths.geometry.fits import fit_plane
from tests.parts_drawn import UP, ball, block, bore, circle, plane, spot

AXIS = CommonDatum("A-B", ("A", "B"), "line", Nominal(np.zeros(3), UP))


def shaft(*more: PartFeature) -> tuple[PartFeature, ...]:
    """Two seats of 20 and 30 mm about the z axis, 100 mm apart, each of two sections of eight points."""
    low = bore("A", [0, 0, 0], 10.0, (-5.0, 5.0), hole=False)
    high = bore("B", [0, 0, 0], 15.0, (95.0, 105.0), hole=False)
    return (low, high, *more)


def plan_of(
    features: tuple[PartFeature, ...], *wanted: PartCharacteristic, common: tuple[CommonDatum, ...] = (AXIS,)
) -> Plan:
    return Plan(features, wanted, common=common)


def value(plan: Plan, base: Floats) -> float:
    return float(Evaluator(plan, base, [])([], exact=True)[0, 0])


def moved(plan: Plan, **by: Floats) -> Floats:
    base = np.zeros_like(plan.points)
    for name, shift in by.items():
        base[plan.rows[name]] = shift
    return base


COLLAR = circle("collar", [0, 0, 50], 25.0, 12, hole=False)


@pytest.mark.parametrize(("low", "high", "coaxiality"), [
    # the seats shift together: the collar is off by as much
    (0.01, 0.01, 0.02),
    # one seat alone: the axis through both passes half way, at half of the height
    (0.0, 0.01, 0.01),
    # to either side: the axis crosses the collar's centre
    (0.01, -0.01, 0.0),
])  # fmt: skip
def test_a_collar_between_two_seats_lies_off_the_axis_through_both(low: float, high: float, coaxiality: float) -> None:
    """Seats whose centres are off by a and b: the axis goes through both, being rigid, at (a + b)/2 half way."""
    plan = plan_of(shaft(COLLAR), PartCharacteristic("c", "coaxiality", ("collar",), ("A-B",)))
    base = moved(plan, A=np.array([low, 0, 0]), B=np.array([high, 0, 0]))
    assert value(plan, base) == pytest.approx(coaxiality, abs=2e-6)


def test_seats_turned_about_a_line_through_both_axes_leave_no_runout_of_the_collar_that_turns_with_them() -> None:
    plan = plan_of(shaft(COLLAR), PartCharacteristic("r", "circular_runout", ("collar",), ("A-B",)))
    turn = Rotation.from_rotvec([3e-4, -2e-4, 0.1]).as_matrix()
    assert value(plan, plan.points @ turn.T + [0.3, 0.1, -0.2] - plan.points) == pytest.approx(0.0, abs=1e-9)


def test_a_seat_runs_out_about_the_axis_of_both() -> None:
    """Seat B eccentric by 8 µm to A: the axis tilts until it passes through both centres, and B runs out by a lean alone."""
    plan = plan_of(shaft(), PartCharacteristic("r", "circular_runout", ("B",), ("A-B",)))
    base = moved(plan, B=np.array([0.008, 0, 0]))
    tilted = value(plan, base)
    alone = Plan(plan.features, (PartCharacteristic("r", "circular_runout", ("B",), ("A",)),))
    assert value(alone, base) == pytest.approx(0.016, abs=1e-5)
    assert tilted < 0.002


def general(features: tuple[PartFeature, ...], points: Floats) -> tuple[Floats, Floats]:
    """Axis of coaxial cylinders by a solver from elsewhere: (point at z = 0, slopes) and a radius each."""
    ends = np.cumsum([0, *(len(one.points) for one in features)])

    def off(x: Floats) -> Floats:
        w = np.array([x[2], x[3], 1.0])
        w /= np.linalg.norm(w)
        away = np.linalg.norm(np.cross(points - [x[0], x[1], 0.0], w), axis=1)
        return np.concatenate([away[a:b] - x[4 + i] for i, (a, b) in enumerate(pairwise(ends.tolist()))])

    found = least_squares(off, [0, 0, 0, 0, *(0.5 * (f.nominal.diameter_mm or 0) for f in features)],
                          xtol=1e-15, ftol=1e-15, gtol=1e-15)  # fmt: skip
    return found.x[:2], found.x[2:4]


def test_the_axis_of_two_seats_is_that_of_a_general_least_squares() -> None:
    """Form of 20 µm, sizes 0.1 mm off, the whole 0.5 mm beside and turned: beside scipy's solver with a radius each."""
    features, random = shaft(), np.random.default_rng(5)
    plan = plan_of(features)
    turn = Rotation.from_rotvec([2e-3, 1e-3, 0.0]).as_matrix()
    points = (plan.points + random.normal(0.0, 0.02, plan.points.shape) + 0.1 * plan.normals) @ turn.T + [
        0.5,
        -0.3,
        0.2,
    ]
    found = ProbedCommon(plan.feature("A-B"), points).undisturbed
    place, slopes = general(features, points)
    direction = found.direction[0] / found.direction[0, 2]
    np.testing.assert_allclose(direction[:2], slopes, atol=1e-9)
    np.testing.assert_allclose((found.position[0] - found.position[0, 2] * direction)[:2], place, atol=1e-7)
    drawn = ProbedCommon(plan.feature("A-B"), plan.points).of((points - plan.points)[None])
    np.testing.assert_allclose(drawn.direction[0], found.direction[0], atol=1e-10)


def test_circles_at_two_heights_have_an_axis_together() -> None:
    rings = (circle("A", [0, 0, 0], 10.0, hole=False), circle("B", [0, 0, 100], 15.0, hole=False))
    plan = plan_of(rings)
    found = ProbedCommon(plan.feature("A-B"), plan.points + moved(plan, B=np.array([0.01, 0.0, 0.0]))).undisturbed
    assert found.direction[0, 0] == pytest.approx(1e-4, rel=1e-4)


def test_two_faces_have_one_plane_which_is_that_of_all_their_points() -> None:
    """A step of 5 mm between them is nominal: taken away, the plane is the one of all points together."""
    faces = (plane("A", UP, [0, 0, 0], [[40, 0, 0], [0, 40, 0]]), plane("B", UP, [100, 0, 5], [[40, 0, 0], [0, 40, 0]]))
    plan = plan_of(faces, common=(CommonDatum("A-B", ("A", "B"), "plane", Nominal(np.zeros(3), UP)),))
    points = plan.points + np.random.default_rng(2).normal(0.0, 0.01, plan.points.shape) * [0, 0, 1]
    found = ProbedCommon(plan.feature("A-B"), points).undisturbed
    alone = fit_plane(points - np.where(points[:, :1] > 80, [0.0, 0, 5], 0.0))
    np.testing.assert_allclose(found.direction[0], alone.normal * np.sign(alone.normal[2]), atol=1e-7)


def test_a_part_stands_on_three_points_together() -> None:
    """The first datum A1-A2-A3: a stop 10 µm low tilts the plane about the line through the other two."""
    stops = (spot("A1", [0, 0, 0]), spot("A2", [100, 0, 0]), spot("A3", [0, 50, 0]))
    datum = CommonDatum("A1-A2-A3", ("A1", "A2", "A3"), "plane", Nominal(np.zeros(3), UP))
    features = (*stops, *block()[0][1:3], spot("top", [50, 100, 30]))
    plan = plan_of(features, PartCharacteristic("z", "z", ("top",), ("A1-A2-A3", "B", "C")), common=(datum,))
    assert value(plan, moved(plan, A3=np.array([0, 0, -0.01]))) == pytest.approx(30.02, abs=1e-5)


def test_three_balls_together_fix_the_frame_and_share_out_what_does_not_fit() -> None:
    """Ball B 9 µm too far along x. By hand, of shift t and turn ω: 9 − 3t + 60ω = 0 and ω = t/150, so t = 9/2.6 at the origin.

    The same balls as datums in order leave the first where it is.
    """
    toward = np.array([[1.0, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1]])
    balls = tuple(ball(n, at, 5.0, toward) for n, at in (("A", [0, 0, 0]), ("B", [90, 0, 0]), ("C", [0, 60, 0])))
    datum = CommonDatum("A-B-C", ("A", "B", "C"), "point", Nominal(np.zeros(3)))
    features = (*balls, spot("p", [0, 0, 40]))
    plan = plan_of(features, PartCharacteristic("x", "x", ("p",), ("A-B-C",)), common=(datum,))
    assert value(plan, moved(plan, B=np.array([0.009, 0, 0]))) == pytest.approx(-0.009 / 2.6, abs=1e-6)
    ordered = Plan(features, (PartCharacteristic("x", "x", ("p",), ("A", "B", "C")),))
    assert value(ordered, moved(plan, B=np.array([0.009, 0, 0]))) == pytest.approx(0.0, abs=1e-9)


def test_first_order_is_the_derivative_of_the_whole() -> None:
    """Noise a tenth as large leaves a hundredth of the difference from associating each draw."""
    plan = plan_of(shaft(COLLAR), PartCharacteristic("c", "coaxiality", ("collar",), ("A-B",)))
    base, off = moved(plan, collar=np.array([0.05, 0, 0])), []
    for size in (0.02, 0.002):
        noise = PointScatter.of("noise", "noise", np.full((len(plan.points), 3), size))
        evaluator, given = Evaluator(plan, base, [noise]), noise.draw(np.random.default_rng(1), 50)
        off.append(float(np.abs(evaluator([given]) - evaluator([given], exact=True)).max()))
    assert off[1] < 0.015 * off[0]


@pytest.mark.parametrize(("common", "words"), [
    (CommonDatum("A-B", ("A", "X"), "line", Nominal(np.zeros(3), UP)), "there is no feature 'X'"),
    (CommonDatum("A", ("A", "B"), "line", Nominal(np.zeros(3), UP)), "the feature 'A' stands twice"),
])  # fmt: skip
def test_a_common_datum_of_nothing_is_refused(common: CommonDatum, words: str) -> None:
    with pytest.raises(CmmUqError, match=words):
        plan_of(shaft(), common=(common,))


def test_a_member_that_is_not_associated_by_least_squares_is_refused() -> None:
    low, high = shaft()
    with pytest.raises(CmmUqError, match="'B' by minimum zone"):
        plan_of((low, replace(high, association="minimum_zone")))


def test_three_points_in_a_row_are_no_plane() -> None:
    names = ("A", "B", "C")
    stops = tuple(spot(name, [50 * i, 0, 0]) for i, name in enumerate(names))
    plan = plan_of(stops, common=(CommonDatum("A-B-C", names, "plane", Nominal(np.zeros(3), UP)),))
    with pytest.raises(CmmUqError, match="its members leave 'A' free to move"):
        ProbedCommon(plan.feature("A-B-C"), plan.points)
