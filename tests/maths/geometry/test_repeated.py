"""Many draws at once against fits one by one, reference sets and the covariance of the fits."""

from __future__ import annotations

from itertools import combinations

import numpy as np
import pytest

from cmm_uq.base.errors import CmmUqError
from cmm_uq.maths.geometry import (
    Repeated,
    associate,
    fit_circle,
    fit_cone,
    fit_cylinder,
    fit_line,
    fit_plane,
    fit_sphere,
    minimax,
)  # fmt: skip
from tests.maths.geometry.reference_sets import points_with_known_fit, points_with_known_zone, surface

FITS = {"line": fit_line, "plane": fit_plane, "circle": fit_circle, "sphere": fit_sphere, "cylinder": fit_cylinder,
        "cone": fit_cone}  # fmt: skip
TURN = np.linalg.qr(np.random.default_rng(8).normal(size=(3, 3)))[0]
AWAY = np.array([400.0, -200, 100])


def nominal(kind: str, n: int = 40) -> np.ndarray:
    if kind == "line in a plane":
        return surface("line", n, seed=1)[0][:, :2]
    if kind == "circle in a plane":
        return surface("circle", n, seed=1)[0][:, :2]
    return surface(kind, n, seed=1)[0] @ TURN.T + AWAY


def errors(points: np.ndarray, draws: int, scatter: float = 5e-3) -> np.ndarray:
    return np.random.default_rng(2).normal(scale=scatter, size=(draws, *points.shape))


ALL = [*FITS, "line in a plane", "circle in a plane"]


@pytest.mark.parametrize("kind", [kind for kind in ALL if kind != "circle"])
def test_each_draw_is_the_least_squares_feature_of_its_points(kind):
    points = nominal(kind)
    name = kind.split(" ", maxsplit=1)[0]
    displaced = errors(points, 6)
    drawn = Repeated(name, points).least_squares(displaced)
    for i in range(6):
        fit = FITS[name](points + displaced[i])
        assert abs(drawn.form[i] - fit.form_deviation) < 1e-9
        if name in ("circle", "sphere"):
            np.testing.assert_allclose(drawn.position[i], fit.centre, rtol=0, atol=1e-9)
        if name in ("circle", "sphere", "cylinder"):
            assert abs(drawn.size[i] - 2 * fit.radius) < 1e-9
        if name in ("line", "cylinder", "cone"):
            assert np.linalg.norm(drawn.direction[i] - fit.direction) * 60 < 1e-9
            off = drawn.position[i] - fit.point
            assert np.linalg.norm(off - (off @ fit.direction) * fit.direction) < 1e-9
        if name == "plane":
            assert np.linalg.norm(drawn.direction[i] - fit.normal) * 100 < 1e-9
            assert abs((drawn.position[i] - fit.point) @ fit.normal) < 1e-9
        if name == "cone":
            assert abs(drawn.half_angle[i] - fit.half_angle) * 60 < 1e-9
            along = (drawn.position[i] - fit.point) @ fit.direction
            assert abs(drawn.size[i] - 2 * (fit.radius + along * np.tan(fit.half_angle))) < 1e-9


@pytest.mark.long
def test_a_bore_that_is_off_along_its_axis_by_a_part_of_its_length_settles_where_fits_one_by_one_do():
    angle, height = np.meshgrid(np.arange(8) * np.pi / 4, [0.0, 9.0, 17.0])
    points = np.stack([10 * np.cos(angle), 10 * np.sin(angle), height], axis=-1).reshape(-1, 3)
    displaced = errors(points, 50, 0.05) + np.array([0.0, 0, 7])
    drawn = Repeated("cylinder", points).least_squares(displaced)
    for i in range(50):
        fit = fit_cylinder(points + displaced[i])
        assert abs(drawn.size[i] - 2 * fit.radius) < 1e-9
        assert abs(drawn.form[i] - fit.form_deviation) < 1e-9


def test_a_circle_in_space_is_that_of_the_points_projected_along_its_nominal_normal():
    flat = surface("circle", 30, seed=1)[0]
    displaced = errors(flat, 5)
    drawn = Repeated("circle", flat @ TURN.T + AWAY).least_squares(displaced @ TURN.T)
    for i in range(5):
        fit = fit_circle((flat + displaced[i])[:, :2])
        assert abs(drawn.size[i] - 2 * fit.radius) < 1e-9
        assert abs(drawn.form[i] - fit.form_deviation) < 1e-9
        np.testing.assert_allclose((drawn.position[i] - AWAY) @ TURN, [*fit.centre, 0], rtol=0, atol=1e-9)


@pytest.mark.parametrize("kind", ["plane", "sphere", "cylinder", "cone"])
def test_points_carried_far_off_the_nominal_ones_are_still_fitted_exactly(kind):
    where, normals, growth = surface(kind, 60, seed=5)
    reference = points_with_known_fit(where, normals, growth, 0.5, seed=6)
    # a known feature with half a millimetre of form, carried by 0.3 mm and turned by 5 mrad: far beyond linearisation
    a = 5e-3
    turn = np.array([[1, 0, 0], [0, np.cos(a), -np.sin(a)], [0, np.sin(a), np.cos(a)]])
    moved = reference @ turn.T + np.array([0.3, -0.2, 0.1])
    drawn = Repeated(kind, where).least_squares((moved - where)[None])
    assert np.linalg.norm(np.cross(drawn.direction[0], turn[:, 2])) * 60 < 1e-9 if kind != "sphere" else True
    if kind in ("sphere", "cylinder"):
        assert abs(drawn.size[0] - 40) < 1e-9
    if kind == "cone":
        assert abs(drawn.half_angle[0] - 0.3) * 60 < 1e-9


@pytest.mark.parametrize("kind", ["plane", "cylinder"])
def test_the_spread_of_the_draws_is_the_covariance_of_the_fit(kind):
    points = nominal(kind)
    draws = 4000
    drawn = Repeated(kind, points).least_squares(errors(points, draws, 1e-3))
    fit = FITS[kind](points, u_point=1e-3)
    spread = np.cov(drawn.direction, rowvar=False)
    expected = fit.covariance[3:6, 3:6]
    # a variance of 4000 draws has a relative standard uncertainty of 2.2 %; four of them
    assert np.trace(spread) == pytest.approx(np.trace(expected), rel=0.09)
    if kind == "cylinder":
        assert np.std(drawn.size) / 2 == pytest.approx(fit.u("r"), rel=0.045)


@pytest.mark.parametrize("kind", ALL)
def test_each_draw_has_the_minimum_zone_that_it_has_alone(kind):
    points = nominal(kind, 30)
    name = kind.split(" ", maxsplit=1)[0]
    displaced = errors(points, 5)
    drawn = Repeated(name, points).minimum_zone(displaced)
    for i in range(5):
        if kind == "circle":  # alone, its points would be projected along the normal of their own plane
            turned = (points + displaced[i] - AWAY) @ TURN
            alone = associate(name, turned[:, :2], "minimum_zone")
        else:
            alone = associate(name, points + displaced[i], "minimum_zone")
        assert abs(drawn.form[i] - alone.form) < 1e-9
        if alone.size is not None and kind != "cone":
            assert abs(drawn.size[i] - alone.size) < 1e-9
        if alone.direction is not None:
            assert np.linalg.norm(drawn.direction[i] - alone.direction) * 60 < 1e-9
    assert (drawn.form <= Repeated(name, points).least_squares(displaced).form + 1e-12).all()


@pytest.mark.parametrize("kind", ["plane", "sphere", "cylinder", "cone"])
def test_a_reference_set_gives_its_minimum_zone_among_other_draws(kind):
    where, normals, growth = surface(kind, 50, seed=11)
    known, _ = points_with_known_zone(where, normals, growth, 0.01, seed=12)
    displaced = np.concatenate([errors(where, 3), (known - where)[None], errors(where, 2)])
    assert abs(Repeated(kind, where).minimum_zone(displaced).form[3] - 0.01) < 1e-9


def test_draws_that_the_exchange_leaves_open_are_found_one_by_one(monkeypatch):
    points = nominal("cylinder", 30)
    displaced = errors(points, 3)
    of = Repeated("cylinder", points)
    expected = of.minimum_zone(displaced)
    monkeypatch.setattr(minimax, "MOST_STEPS", 0)
    found = of.minimum_zone(displaced)
    np.testing.assert_allclose(found.form, expected.form, rtol=0, atol=1e-9)
    np.testing.assert_allclose(found.size, expected.size, rtol=0, atol=1e-9)


@pytest.mark.parametrize("kind", ["plane", "circle in a plane", "sphere"])
def test_the_exchange_leaves_no_plane_circle_or_sphere_open(kind):
    points = nominal(kind, 30)
    of = Repeated(kind.split(" ", maxsplit=1)[0], points)
    local = of.placed.local(points + errors(points, 200))
    start = np.tile(of.placed.state, (200, 1))
    left = minimax.least_zones(of.placed.shape, start, local, of.placed.units())[2]
    assert not len(left)


def exhaustively(points, *, inscribed):
    """Diameters of the circles that two or three of the points hold: about all of them the least, within them the largest."""
    held = []
    for i, j, k in combinations(range(len(points)), 3):
        a, b, c = points[i], points[j], points[k]
        centre = a + np.linalg.solve(2 * np.array([b - a, c - a]), [(b - a) @ (b - a), (c - a) @ (c - a)])
        corners = np.column_stack([points[[i, j, k]], np.ones(3)])
        if (np.linalg.solve(corners.T, np.append(centre, 1)) >= 0).all():  # the three surround it
            held.append((centre, np.linalg.norm(a - centre)))
    if not inscribed:
        held += [(0.5 * (a + b), 0.5 * np.linalg.norm(a - b)) for a, b in combinations(points, 2)]
    side = -1 if inscribed else 1
    kept = [r for c, r in held if (side * (np.linalg.norm(points - c, axis=1) - r)).max() < 1e-9]
    return 2 * (max(kept) if inscribed else min(kept))


@pytest.mark.parametrize("count", [6, 9])
@pytest.mark.parametrize("inscribed", [True, False])
def test_extreme_circles_are_those_of_an_exhaustive_search(count, inscribed):
    """With an even number of points two opposite ones may hold a circumscribed circle."""
    angles = 2 * np.pi * np.arange(count) / count
    points = 10 * np.column_stack([np.cos(angles), np.sin(angles)])
    displaced = np.random.default_rng(5).normal(0, 0.01, (40, count, 2))
    drawn = Repeated("circle", points).one_sided(displaced, inscribed=inscribed)
    expected = [exhaustively(points + one, inscribed=inscribed) for one in displaced]
    # of several inscribed circles that points hold another may be larger, by the square of the errors over the radius
    np.testing.assert_allclose(drawn.size, expected, rtol=0, atol=2 * 0.02**2 / 10 if inscribed else 1e-9)
    assert np.mean(np.abs(drawn.size - expected) < 1e-9) > 0.9


@pytest.mark.parametrize("kind", ["sphere", "cylinder"])
@pytest.mark.parametrize("inscribed", [True, False])
def test_each_draw_has_the_extreme_size_that_it_has_alone(kind, inscribed, monkeypatch):
    points, how = nominal(kind, 30), "maximum_inscribed" if inscribed else "minimum_circumscribed"
    of, displaced = Repeated(kind, points), errors(points, 3)
    drawn = of.one_sided(displaced, inscribed=inscribed)
    for i in range(3):
        alone = associate(kind, points + displaced[i], how)
        assert abs(drawn.size[i] - alone.size) < 1e-9
        assert abs(drawn.form[i] - alone.form) < 1e-6  # where it stands is held less well than how large it is
    monkeypatch.setattr("cmm_uq.maths.geometry.minimax.MOST_BOXES", 0)
    one_by_one = of.one_sided(displaced[:1], inscribed=inscribed)
    np.testing.assert_allclose(one_by_one.size, drawn.size[:1], rtol=0, atol=1e-8)


@pytest.mark.parametrize("inscribed", [True, False])
def test_no_neighbour_of_an_extreme_cylinder_is_better(inscribed):
    """Regular sections of eight points, opposite in pairs, so that curvature holds many."""
    angles, heights = np.meshgrid(2 * np.pi * np.arange(8) / 8, [0.0, 10.0, 20.0])
    points = np.column_stack([10 * np.cos(angles.ravel()), 10 * np.sin(angles.ravel()), heights.ravel()])
    random = np.random.default_rng(6)
    displaced = random.normal(0, 1e-3, (20, 24, 3))
    of = Repeated("cylinder", points)
    drawn, side = of.one_sided(displaced, inscribed=inscribed), -1.0 if inscribed else 1.0
    for i in range(20):
        apart = points + displaced[i] - drawn.position[i]
        best = side * 0.5 * drawn.size[i]
        for reach in (1e-3, 1e-5):
            for _ in range(100):
                w = drawn.direction[i] + reach / 10 * random.standard_normal(3)
                w /= np.linalg.norm(w)
                moved = apart - reach * random.standard_normal(3)
                radii = np.linalg.norm(moved - np.outer(moved @ w, w), axis=1)
                assert (side * radii).max() > best - 1e-10


def test_a_plane_has_no_extreme_size():
    with pytest.raises(CmmUqError, match="no size to be inscribed or circumscribed"):
        Repeated("plane", PLANE).one_sided(errors(PLANE, 1), inscribed=True)


def test_blocks_change_nothing(monkeypatch):
    points = nominal("sphere")
    displaced = errors(points, 7)
    of = Repeated("sphere", points)
    whole, zones = of.least_squares(displaced), of.minimum_zone(displaced)
    monkeypatch.setattr("cmm_uq.maths.geometry.repeated.BLOCK", 80)
    np.testing.assert_allclose(of.least_squares(displaced).position, whole.position, rtol=0, atol=1e-9)
    np.testing.assert_allclose(of.minimum_zone(displaced).form, zones.form, rtol=0, atol=1e-9)


def test_as_many_points_as_parameters_leave_no_zone():
    points = np.array([[0.0, 0, 0], [10, 0, 0], [0, 10, 0]])
    assert Repeated("plane", points).minimum_zone(errors(points, 4)).form.max() < 1e-9


PLANE = nominal("plane")
NARROW = 20 * np.column_stack([np.cos(np.linspace(0, 1e-3, 9)), np.sin(np.linspace(0, 1e-3, 9))])


@pytest.mark.parametrize(
    ("ask", "message"),
    [
        (lambda: Repeated("plane", np.eye(3)[:2]), "2 points are too few"),
        (lambda: Repeated("circle", NARROW), r"circle: the nominal points (hardly|do not) determine it"),
        (lambda: Repeated("plane", PLANE).least_squares(np.zeros((3, 7, 3))), r"shape \(3, 7, 3\). Give them as \(N, 40, 3\)"),
        (lambda: Repeated("plane", PLANE).least_squares(np.full((3, 40, 3), np.nan)), "draw 1 has a displacement"),
        (lambda: Repeated("sphere", nominal("sphere")).least_squares(errors(nominal("sphere"), 2, 500.0)),
         "sphere: draw . does not settle. Draw errors that are small"),
    ],
)  # fmt: skip
def test_what_cannot_be_repeated_is_refused_with_what_is_wrong(ask, message):
    with pytest.raises(CmmUqError, match=message):
        ask()
