"""Zones, inscribed, circumscribed and tangent features against constructions, linear programming and exhaustive search."""

from __future__ import annotations

from itertools import combinations

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from scipy.optimize import linprog

from cmm_uq.base.errors import CmmUqError
from cmm_uq.maths.geometry import associate
from cmm_uq.maths.geometry.placed import placed
from tests.maths.geometry.reference_sets import points_with_known_fit, points_with_known_zone, surface

TURN = np.linalg.qr(np.random.default_rng(8).normal(size=(3, 3)))[0]
ROUND = ("circle", "sphere", "cylinder")


def placed_in_space(kind: str, points: np.ndarray, far: float = 300.0) -> np.ndarray:
    """Turned and carried away; a line and a circle stay in their plane."""
    return points[:, :2] if kind in ("line", "circle") else points @ TURN.T + far


@pytest.mark.parametrize("width", [0.02, 2e-4])
@pytest.mark.parametrize("kind", ["line", "plane", "circle", "sphere", "cylinder", "cone"])
def test_a_reference_set_gives_its_minimum_zone_to_a_picometre(kind, width):
    points, contacts = points_with_known_zone(*surface(kind, 60, seed=5), width, seed=6)
    found = associate(kind, placed_in_space(kind, points), "minimum_zone")
    assert abs(found.form - width) < 1e-9
    np.testing.assert_array_equal(np.sort(found.contacts), contacts)
    assert found.multipliers.sum() == pytest.approx(1, abs=1e-9)
    assert found.multipliers.min() > 0
    if kind in ROUND:
        assert abs(found.size - 40) < 1e-9
    if kind == "cone":
        assert abs(found.half_angle - 0.3) * 60 < 1e-9
    if kind in ("plane", "cylinder", "cone"):
        assert np.linalg.norm(np.cross(found.direction, TURN[:, 2])) * 60 < 1e-9
    assert found.gap == (0 if kind in ("line", "plane", "circle", "sphere") else np.inf)


@pytest.mark.parametrize(("association", "side"), [("minimum_circumscribed", 1.0), ("maximum_inscribed", -1.0)])
@pytest.mark.parametrize("kind", ROUND)
def test_a_reference_set_gives_its_circumscribed_and_inscribed_feature(kind, association, side):
    where, normals, growth = surface(kind, 60, seed=15)
    points, contacts = points_with_known_zone(where, normals, growth[:, :, :0], 0.02, seed=16, sides=(side,))
    found = associate(kind, placed_in_space(kind, points), association)
    assert abs(found.size - (40 + side * 0.02)) < 1e-9
    np.testing.assert_array_equal(np.sort(found.contacts), contacts)
    assert (side * found.deviations).max() < 1e-12
    if kind != "cylinder":
        centre = np.zeros(2) if kind == "circle" else np.full(3, 300.0)
        np.testing.assert_allclose(found.position, centre, rtol=0, atol=1e-9)
        assert found.gap == 0


@pytest.mark.parametrize("kind", ["plane", "circle", "cylinder", "cone"])
def test_least_squares_is_that_of_its_reference_set(kind):
    points = points_with_known_fit(*surface(kind, 40, seed=3), 0.01, seed=4)
    found = associate(kind, placed_in_space(kind, points))
    on = np.linalg.norm(points[:, :2], axis=1)
    if kind in ("circle", "cylinder"):
        assert abs(found.size - 40) < 1e-9
        assert abs(found.form - np.ptp(on)) < 1e-9
    if kind == "cone":
        assert abs(found.half_angle - 0.3) * 60 < 1e-9
    if kind == "plane":
        assert abs(found.form - np.ptp(points[:, 2])) < 1e-9


def scattered(kind: str, n: int, seed: int, scatter: float = 5e-3) -> np.ndarray:
    where, normals, _ = surface(kind, n, seed)
    points = where + np.random.default_rng(seed).normal(scale=scatter, size=(n, 1)) * normals[:, 0]
    return points[:, :2] if kind in ("line", "circle") else points


@pytest.mark.parametrize("kind", ["line", "plane", "circle", "sphere", "cylinder", "cone"])
def test_linear_programming_finds_no_narrower_zone_beside_the_one_found(kind):
    points = scattered(kind, 50, seed=31)
    found = associate(kind, points, "minimum_zone")
    of = placed(kind, points)
    d = found.deviations
    # distances follow any motion of the points as their nominal ways say: translations, turns, growth
    where, normals, growth = surface(kind, 50, seed=31)
    ways = np.concatenate([normals, np.cross(where[:, None], normals), growth], axis=2)[:, 0]
    ways = ways[:, np.abs(ways).max(axis=0) > 1e-9]
    A = np.vstack([np.column_stack([ways, -np.ones(50)]), np.column_stack([-ways, -np.ones(50)])])
    best = linprog(np.eye(A.shape[1])[-1], A, np.append(-d, d), bounds=(None, None), method="highs")
    # turned by the scatter over its length, 5e-3/60, the nominal ways are wrong by as much
    assert 2 * best.fun == pytest.approx(found.form, rel=2e-3)
    assert 2 * best.fun <= found.form + 1e-12
    assert of.shape.name == kind


def narrowest_ring(points: np.ndarray) -> float:
    """Over every centre that two and two, or three, of the points determine."""
    centres = [circumcentre(points[list(three)]) for three in combinations(range(len(points)), 3)]
    for a, b, c, d in combinations(range(len(points)), 4):
        for one, other in (((a, b), (c, d)), ((a, c), (b, d)), ((a, d), (b, c))):
            centres.append(equidistant(points[[one[0], other[0]]], points[[one[1], other[1]]]))
    radii = np.linalg.norm(points - np.array(centres)[:, None], axis=2)
    return float(np.ptp(radii, axis=1).min())


def circumcentre(three: np.ndarray) -> np.ndarray:
    return equidistant(three[[0, 0]], three[[1, 2]])


def equidistant(one: np.ndarray, other: np.ndarray) -> np.ndarray:
    """The point equally far from one[i] and other[i], for both i."""
    return np.linalg.solve(2 * (other - one), (other**2).sum(axis=1) - (one**2).sum(axis=1))


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("scatter", [1e-3, 0.5])
def test_roundness_is_that_of_exhaustive_search(seed, scatter):
    points = scattered("circle", 11, seed, scatter)
    found = associate("circle", points, "minimum_zone")
    assert found.form == pytest.approx(narrowest_ring(points), abs=1e-9)
    assert found.gap == 0


def narrowest_slab(points: np.ndarray) -> float:
    """Over every normal across three points, or across two and two."""
    steps = points[:, None] - points
    pairs = np.array([steps[i, j] for i, j in combinations(range(len(points)), 2)])
    normals = np.cross(pairs[:, None], pairs).reshape(-1, 3)
    length = np.linalg.norm(normals, axis=1)
    normals = normals[length > 1e-9] / length[length > 1e-9, None]
    return float(np.ptp(points @ normals.T, axis=0).min())


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("scatter", [1e-3, 5.0])
def test_flatness_is_that_of_exhaustive_search(seed, scatter):
    points = scattered("plane", 12, seed, scatter)
    found = associate("plane", points, "minimum_zone")
    assert found.form == pytest.approx(narrowest_slab(points), abs=1e-9)
    assert found.gap == 0


@pytest.mark.parametrize("seed", range(4))
def test_the_circles_inside_and_about_are_those_of_exhaustive_search(seed):
    points = scattered("circle", 14, seed, 0.3)
    threes = [list(three) for three in combinations(range(14), 3)]
    centres = np.array([circumcentre(points[three]) for three in threes])
    twos = [list(two) for two in combinations(range(14), 2)]
    about = np.vstack([centres, [points[two].mean(axis=0) for two in twos]])
    least = np.linalg.norm(points - about[:, None], axis=2).max(axis=1).min()
    assert associate("circle", points, "minimum_circumscribed").size == pytest.approx(2 * least, abs=1e-9)
    distances = np.linalg.norm(points - centres[:, None], axis=2)
    held = [
        np.linalg.solve(np.vstack([points[three].T, np.ones(3)]), np.append(c, 1)).min() > 0
        for three, c in zip(threes, centres, strict=True)
    ]
    empty = distances.min(axis=1) > distances[np.arange(len(threes)), np.array(threes)[:, 0]] - 1e-9
    largest = distances.min(axis=1)[np.array(held) & empty].max()
    assert associate("circle", points, "maximum_inscribed").size == pytest.approx(2 * largest, abs=1e-9)


def test_straightness_in_space_is_the_cylinder_through_its_contacts():
    # three points at 120° in one cross-section are held apart by a far point at each end on the axis side: symmetric
    turn = np.arange(3) * 2 * np.pi / 3
    ring = 0.01 * np.column_stack([np.cos(turn), np.sin(turn), np.zeros(3)])
    high = np.array([0.0, 0, 50])
    points = np.vstack([ring - high, -ring, ring + high, [[0, 0, 20], [0.001, 0, -20]]])
    found = associate("line", points @ TURN.T, "minimum_zone")
    assert found.form == pytest.approx(0.02, abs=1e-9)
    assert np.linalg.norm(np.cross(found.direction, TURN[:, 2])) * 50 < 1e-9
    # 4·0.01/(100 − 0.02) is the most that a narrower cylinder could lean
    assert found.gap == pytest.approx(0.02 * (1 - 1 / np.sqrt(1 + (0.04 / 99.98) ** 2)), rel=1e-3)


def test_a_tangent_plane_touches_outside_and_is_parallel_to_the_minimum_zone():
    points = scattered("plane", 40, seed=2) @ TURN.T
    zone = associate("plane", points, "minimum_zone")
    for out in (TURN[:, 2], -TURN[:, 2]):
        found = associate("plane", points, "tangent", outward=out)
        heights = (points - found.position) @ found.direction
        assert heights.max() == pytest.approx(0, abs=1e-12)
        assert heights.min() == pytest.approx(-zone.form, abs=1e-9)
        assert found.direction @ out > 0.99
        np.testing.assert_allclose(found.deviations, heights, atol=1e-12)


def test_a_tangent_line_touches_outside():
    points = scattered("line", 30, seed=4)
    for side in (1.0, -1.0):
        found = associate("line", points, "tangent", outward=[0, side])
        across = side * np.array([-found.direction[1], found.direction[0]]) * np.sign(found.direction[0])
        heights = (points - found.position) @ across
        assert heights.max() == pytest.approx(0, abs=1e-12)
        assert -heights.min() == pytest.approx(associate("line", points, "minimum_zone").form, abs=1e-9)
        np.testing.assert_allclose(np.abs(found.deviations), -heights, atol=1e-12)


KINDS = st.sampled_from(["line", "plane", "circle", "sphere", "cylinder"])


@pytest.mark.long
@settings(max_examples=12)
@given(kind=KINDS, seed=st.integers(0, 10_000), scale=st.sampled_from([1e-2, 1.0, 50.0]))
def test_turned_carried_mixed_and_scaled_points_have_the_same_zone(kind, seed, scale):
    points = scattered(kind, 25, seed)
    one = associate(kind, points, "minimum_zone")
    rng = np.random.default_rng(seed)
    d = points.shape[1]
    turn = np.linalg.qr(rng.normal(size=(d, d)))[0]
    order = rng.permutation(25)
    moved = scale * (points @ turn.T + rng.uniform(-100, 100, d))[order]
    other = associate(kind, moved, "minimum_zone")
    assert other.form == pytest.approx(scale * one.form, abs=1e-9)
    assert one.form <= associate(kind, points).form + 1e-12
    if one.size is not None:
        assert other.size == pytest.approx(scale * one.size, abs=1e-9)


@pytest.mark.long
@settings(max_examples=8)
@given(kind=st.sampled_from(ROUND), seed=st.integers(0, 10_000))
def test_the_inscribed_lies_inside_and_the_circumscribed_about_the_zone(kind, seed):
    points = scattered(kind, 30, seed)
    zone = associate(kind, points, "minimum_zone")
    inside, about = associate(kind, points, "maximum_inscribed"), associate(kind, points, "minimum_circumscribed")
    # the zone's own cylinders hold the points from both sides; the inscribed and circumscribed are the extremes of those
    assert inside.size >= zone.size - zone.form - 1e-9
    assert about.size <= zone.size + zone.form + 1e-9
    assert inside.deviations.min() > -1e-9
    assert about.deviations.max() < 1e-9
    assert zone.form <= min(inside.form, about.form) + 1e-9


@pytest.mark.parametrize("association", ["minimum_zone", "minimum_circumscribed", "maximum_inscribed"])
def test_perfect_points_give_the_feature_itself(association):
    turn = np.arange(12) * np.pi / 6
    found = associate("circle", 10 * np.column_stack([np.cos(turn), np.sin(turn)]), association)
    assert found.size == pytest.approx(20, abs=1e-12)
    assert found.form < 1e-13
    assert found.gap < 1e-13


def test_contacts_of_a_symmetric_ring_are_more_than_needed_and_prove_it_all_the_same():
    turn = np.arange(8) * np.pi / 4
    radius = 10 + np.array([0.001, -0.001] * 4)
    found = associate("circle", radius[:, None] * np.column_stack([np.cos(turn), np.sin(turn)]), "minimum_zone")
    assert found.form == pytest.approx(0.002, abs=1e-12)
    assert found.size == pytest.approx(20, abs=1e-9)
    assert found.gap == 0


def test_as_many_points_as_the_feature_needs_leave_no_form():
    assert associate("plane", [[0, 0, 0], [10, 0, 1], [0, 10, 2]], "minimum_zone").form < 1e-14
    # through the corners of a right angle: Thales
    assert associate("circle", [[0, 0], [8, 0], [0, 6]], "minimum_zone").size == pytest.approx(10, abs=1e-12)


ARC = 20 * np.column_stack([np.cos(np.linspace(0, 2, 30)), np.sin(np.linspace(0, 2, 30))])
FLAT = np.column_stack([np.arange(9.0) % 3, np.arange(9) // 3, np.random.default_rng(1).normal(scale=0.01, size=9)])


@pytest.mark.parametrize(
    ("ask", "message"),
    [
        (lambda: associate("torus", FLAT), "'torus' is no feature. Features are line, plane"),
        (lambda: associate("plane", FLAT, "best"), "'best' is no association. Associations are least_squares"),
        (lambda: associate("plane", FLAT[:2], "minimum_zone"), "2 points are too few. Measure at least 3"),
        (lambda: associate("plane", FLAT * [1, 1, np.nan], "minimum_zone"), "point 1 has a coordinate that is no finite"),
        (lambda: associate("circle", FLAT[:2, :2]), "2 points are too few"),
        (lambda: associate("sphere", [1.0, 2.0]), r"points have the shape \(2,\)"),
        (lambda: associate("sphere", np.zeros((0, 3))), "0 points are too few"),
        (lambda: associate("circle", np.outer(np.arange(5), [1, 2]), "minimum_zone"), "lie on one line"),
        (lambda: associate("plane", FLAT, "maximum_inscribed"), "no size to be inscribed or circumscribed"),
        (lambda: associate("circle", ARC, "tangent"), "a tangent feature is a plane, or a line in a plane"),
        (lambda: associate("plane", FLAT, "tangent"), "needs the side of the material"),
        (lambda: associate("plane", FLAT, "tangent", outward=[1, 0, 0.0]), "outward lies along it"),
        (lambda: associate("plane", FLAT, "tangent", outward=[1, 0]), "outward has to be 3 finite numbers"),
        (lambda: associate("circle", ARC + 1e-3 * np.sin(50 * ARC), "maximum_inscribed"), "surround no inscribed one"),
        (lambda: associate("circle", ARC[:6] + np.sin(50 * ARC[:6])), "do not determine"),
    ],
)  # fmt: skip
def test_what_cannot_be_associated_is_refused_with_what_is_missing(ask, message):
    with pytest.raises(CmmUqError, match=message):
        ask()


@pytest.mark.long
def test_a_half_shell_has_no_inscribed_cylinder():
    where, normals, _ = surface("cylinder", 40, 3, angle=2.5)
    points = where + 1e-3 * np.sin(where[:, :1] * 40) * normals[:, 0]
    with pytest.raises(CmmUqError, match=r"cylinder: no contact points hold it\. Cover more of the cylinder"):
        associate("cylinder", points, "maximum_inscribed")
