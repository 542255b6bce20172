from __future__ import annotations

import numpy as np
import pytest

from cmm_uq.base.errors import CmmUqError
from cmm_uq.maths.geometry import fit_line


@pytest.mark.parametrize("far", [0.0, 10_000.0])
def test_a_reference_set_gives_its_line_to_a_picometre(place, far):
    z = np.linspace(-250, 250, 41) ** 3 / 250**2
    normals = np.tile(np.eye(3)[:2], (41, 1, 1))
    surface = np.column_stack([np.zeros((41, 2)), z])
    placed = place(surface, normals, np.zeros((41, 2, 0)), form=0.01, seed=5, far=far)
    line = fit_line(placed.points)
    assert np.linalg.norm(np.cross(line.direction, placed.axis)) * 250 < 1e-9
    assert np.linalg.norm(np.cross(line.point - placed.origin, placed.axis)) < 1e-9


def test_in_a_plane_it_is_the_total_least_squares_line_of_its_closed_form():
    rng = np.random.default_rng(2)
    x, y = rng.normal(size=(2, 50)) * [[30.0], [1.0]]
    line = fit_line(np.column_stack([x, y + 0.3 * x]))
    sxx, syy, sxy = np.var(x), np.var(y + 0.3 * x), np.cov(x, y + 0.3 * x, ddof=0)[0, 1]
    assert np.arctan2(line.direction[1], line.direction[0]) == pytest.approx(
        0.5 * np.arctan2(2 * sxy, sxx - syy), abs=1e-14
    )


def test_the_uncertainty_of_direction_and_place_follow_from_the_spread_of_the_points():
    z = np.linspace(-100, 100, 21)
    line = fit_line(np.column_stack([0 * z, 0 * z, z]), u_point=1e-3)
    assert line.u("dx") == pytest.approx(1e-3 / np.sqrt(np.sum(z**2)), rel=1e-12)
    assert line.u("x") == pytest.approx(1e-3 / np.sqrt(21), rel=1e-12)
    assert max(line.u("z"), line.u("dz")) < 1e-15


def test_straightness_in_space_is_the_diameter_that_holds_all_points():
    z = np.arange(8.0)
    turn = z * np.pi / 2
    line = fit_line(np.column_stack([0.01 * np.cos(turn), 0.01 * np.sin(turn), 100 * z]))
    assert line.form_deviation == pytest.approx(0.02, rel=0.3)
    assert line.form_deviation == pytest.approx(2 * np.linalg.norm(line.residuals, axis=1).max(), rel=1e-12)


@pytest.mark.parametrize(
    ("points", "message"),
    [([[1.0, 2, 3]], "1 points are too few. Measure at least 2"), (np.ones((4, 3)), "in one place")],
)
def test_points_that_cannot_make_a_line_are_refused(points, message):
    with pytest.raises(CmmUqError, match=message):
        fit_line(points)
