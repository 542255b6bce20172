"""Triangle standard: its sides and angles, and what its placings tell of a machine."""

from __future__ import annotations

import numpy as np
import pytest

from cmm_uq.artefacts import artefact_facts
from cmm_uq.artefacts.triangle import (
    SEVEN_PLACINGS,
    Placing,
    Triangle,
    TriangleStandard,
    corner_changes,
    corners,
    placed_triangle,
)
from cmm_uq.artefacts.triangle_page import PARAMETERS, solve_equations
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.messages import Verbatim
from cmm_uq.base.points import Machine, Points
from cmm_uq.certificate.document import Plot
from tests.artefacts.constructions import estimated, free, indicated, model
from tests.artefacts.reading import number
from tests.artefacts.simulated import SCALE, SQUARE, blocks, recovered, table
from tests.recordings import with_columns

FACTS = artefact_facts(
    kind="triangle",
    blocks_mm=[480.0, 280.0, 380.0],
    u_blocks_um=0.1,
    cylinders_mm=[20.0, 20.0, 20.0],
    u_cylinders_um=0.1,
)
EXACT = FACTS.model_copy(update={"u_blocks_um": 0.0, "u_cylinders_um": 0.0})
STANDARD = TriangleStandard.of(FACTS)
TRAVEL = np.array([[0.0, 900.0], [0.0, 1200.0], [-600.0, 0.0]])
MACHINE = Machine("moving table Y", "YXZ", TRAVEL)
TRUTH = [30.0, -20.0, 15.0, 12.0, -7.0, 9.0, 5.0, -8.0, 6.0, 3.0, -4.0, 7.0, 2.0, 6.0, -9.0]
"""Scales in ppm, squareness in ″, rotations in ″/m, in the order of PARAMETERS."""
SHIFTED = Placing(Verbatim("horizontal, low, shifted along X"), "XY", (1.0, 0.5, 0.0))  # the eighth


def seven() -> Points:
    return placed_triangle(MACHINE, STANDARD.sides)


def without(measurement: int) -> Points:
    points = seven()
    return points.select(points.measurement != measurement)


def test_blocks_and_cylinders_make_a_three_four_five_triangle() -> None:
    """480 + 20, 280 + 20, 380 + 20: sides 500, 300, 400 mm, a right angle at 3, height 300 · 400 / 500 = 240 mm."""
    figures = STANDARD.figures()
    np.testing.assert_allclose(figures.sides, [500, 300, 400])
    np.testing.assert_allclose(figures.angles[2], np.pi / 2, atol=1e-15)
    assert figures.angles.sum() == pytest.approx(np.pi)
    assert figures.height == pytest.approx(240.0)
    x, y = corners(figures.sides)[2, :2]
    assert (x, y) == pytest.approx((320.0, 240.0))


def test_monte_carlo_agrees_with_the_law_of_propagation() -> None:
    """u(side)² = u² + 2(u/2)² by hand; angles by differentiating the cosine rule numerically over the six dimensions."""
    draws = STANDARD.draws(1)
    np.testing.assert_allclose(draws.sides.std(axis=0), 1e-4 * np.sqrt(1.5), rtol=0.01)
    step = 1e-4
    changes = np.array([
        TriangleStandard(STANDARD.dimensions + step * unit, STANDARD.u).figures().angles - STANDARD.figures().angles
        for unit in np.eye(6)
    ])  # fmt: skip
    np.testing.assert_allclose(
        draws.angles.std(axis=0), np.sqrt(np.sum((changes / step * 1e-4) ** 2, axis=0)), rtol=0.01
    )
    assert np.array_equal(draws.angles, STANDARD.draws(1).angles)


def test_corners_move_with_the_dimensions_as_differences_say() -> None:
    change, step = corner_changes(STANDARD.sides), 1e-4
    for i, unit in enumerate(np.eye(6)):
        moved = corners(TriangleStandard(STANDARD.dimensions + step * unit, STANDARD.u).sides)
        np.testing.assert_allclose((moved - corners(STANDARD.sides)) / step, change[:, :, i], atol=1e-5)


def test_seven_placings_determine_scale_rotations_and_squareness() -> None:
    found = estimated(FACTS, indicated(FACTS, seven(), PARAMETERS, TRUTH), PARAMETERS)
    assert free(found) == []
    np.testing.assert_allclose(found.value[:15], TRUTH, atol=1e-7)
    assert found.degrees_of_freedom == 7 * 3 - 15


def test_the_source_s_equations_recover_the_truth() -> None:
    """To first order: 30 ppm and 12″ leave less than a hundredth of a unit."""
    triangle = Triangle(FACTS, indicated(FACTS, seven(), PARAMETERS, TRUTH))
    np.testing.assert_allclose(solve_equations(triangle).values, TRUTH, atol=0.01)


@pytest.mark.long
def test_both_ways_cover_the_truth_and_the_joint_fit_is_never_the_wider() -> None:
    """100 recordings with 0.5 µm: squared distance over covariance is χ² with 15 degrees of freedom (95 %: 24.996)."""
    linear = solve_equations(Triangle(EXACT, seven())).per_coordinate
    by_equations = 0.25e-6 * linear @ linear.T
    inside = np.zeros(2, dtype=int)
    for seed in range(100):
        points = indicated(EXACT, seven(), PARAMETERS, TRUTH, sigma=5e-4, seed=seed)
        fitted = estimated(EXACT, points, PARAMETERS, sigma=5e-4)
        joint = fitted.covariance[:15, :15]
        for way, (value, covariance) in enumerate((
            (solve_equations(Triangle(EXACT, points)).values, by_equations), (fitted.value[:15], joint),
        )):  # fmt: skip
            off = value - TRUTH
            inside[way] += off @ np.linalg.solve(covariance, off) < 24.996
    assert np.all(inside >= 87)  # binomial(100, 0.95): fewer with probability 0.15 %
    assert np.all(np.diag(joint) <= np.diag(by_equations) * (1 + 1e-6))


def test_the_dimensions_of_the_standard_limit_what_the_equations_say() -> None:
    """Without noise, u(scale of X) is that of the side along X over its length: 0.1 µm · √1.5 on 500 mm is 0.245 ppm."""
    solution = solve_equations(Triangle(FACTS, seven()))
    assert solution.u(0.0, STANDARD.u)[0] == pytest.approx(0.1 * np.sqrt(1.5) / 500e3 * 1e6, rel=1e-3)


def test_bows_of_the_guides_hide_behind_squareness_and_scale() -> None:
    """With six bows named too, three are one with a squareness or a scale, and one is not seen at all."""
    bows = [f"straightness_{a}_{b}" for a in "xyz" for b in "xyz" if a != b]
    combinations = [set(c) for c in free(model(FACTS, seven(), [*PARAMETERS, *bows]).estimate().least_squares)]
    assert len(combinations) == 4
    assert {"squareness_zx", "straightness_z_x"} in combinations
    assert {"squareness_yz", "straightness_z_y"} in combinations
    assert {"scale_z", "straightness_x_z", "straightness_y_z"} in combinations
    assert {"straightness_y_x"} in combinations


@pytest.mark.parametrize(
    ("measurement", "wanted"),
    [
        (2, "horizontal again, higher"), (3, "at the other end of X"), (5, "with a longer tip along X"),
        (7, "with a longer tip along Y"), (1, "horizontal again"), (6, "with a longer tip along Y"),
    ],
)  # fmt: skip
def test_a_missing_placing_is_named(measurement: int, wanted: str) -> None:
    with pytest.raises(CmmUqError, match=f"Add a set-up: .*{wanted}"):
        solve_equations(Triangle(FACTS, without(measurement)))


def test_six_placings_do_for_the_joint_fit_unless_the_left_one_is_missing() -> None:
    """Without it the three rolls together look like squareness YZ; any other may be left out, at the cost of precision."""
    open_without = {k: [set(c) for c in free(estimated(FACTS, without(k), PARAMETERS))] for k in range(1, 8)}
    assert open_without.pop(3) == [{"squareness_yz", "rotation_x_x", "rotation_y_y", "rotation_z_z"}]
    assert all(combinations == [] for combinations in open_without.values())


def test_the_eighth_placing_of_the_source_adds_precision_only() -> None:
    eight = estimated(FACTS, placed_triangle(MACHINE, STANDARD.sides, (*SEVEN_PLACINGS, SHIFTED)), PARAMETERS)
    assert free(eight) == []
    assert np.all(np.diag(eight.covariance) <= np.diag(estimated(FACTS, seven(), PARAMETERS).covariance) * (1 + 1e-9))


@pytest.mark.parametrize("legs", [(300.0, 400.0), (250.0, 250.0 * np.sqrt(3)), (353.553, 353.553)])
def test_the_printed_perpendicularity_finds_half_of_the_squareness_at_most(legs: tuple[float, float]) -> None:
    """A right triangle sheared by 50 µrad by hand: the printed formula says h·(sin α1 cos α1 + sin α2 cos α2)/c of it."""
    one, other = legs
    base, height = np.hypot(one, other), one * other / np.hypot(one, other)
    foot, shear = one**2 / base, 5e-5
    angles = np.arctan([foot / height, (base - foot) / height])
    apex = foot + shear * height
    sides = np.hypot([apex, base - apex], height)
    # as printed: tan β = (L2 cos α2 − L1 cos α1) / (L1 sin α1 + L2 sin α2), the certified angles held while the sides change
    along, across = sides * np.cos(angles), sides * np.sin(angles)
    found = np.arctan((along[1] - along[0]) / across.sum())
    part = height * np.sum(np.sin(angles) * np.cos(angles)) / base
    assert abs(found) == pytest.approx(part * shear, rel=1e-3)
    assert part < 0.5 + 1e-9


def test_a_triangle_that_does_not_close_is_refused() -> None:
    with pytest.raises(CmmUqError, match="do not close to a triangle"):
        TriangleStandard.of(FACTS.model_copy(update={"blocks_mm": [900.0, 280.0, 380.0]}))
    points = seven()
    two_corners = points.select((points.measurement != 4) | (points.point != 3))
    with pytest.raises(CmmUqError, match="measurement 4, repeat 1 has no point 3: the triangle does not close"):
        Triangle(FACTS, two_corners)


def test_a_triangle_needs_blocks_and_cylinders() -> None:
    with pytest.raises(ValueError, match="cylinders_mm\n  Field required"):
        artefact_facts(kind="triangle", blocks_mm=[480.0, 280.0, 380.0])
    with pytest.raises(ValueError, match="cylinders_mm\n  Extra inputs are not permitted"):
        artefact_facts(kind="ballbar", cylinders_mm=[20.0, 20.0, 20.0])


@pytest.mark.parametrize(
    ("spoil", "message"),
    [
        (lambda p: p.at(p.xyz / 25.4), "look like inches"),
        (lambda p: Points(p.xyz, p.measurement, np.array([3, 1, 2])[p.point - 1], p.repeat, p.machine),
         "do not have the shape of this triangle standard"),
        (lambda p: Points(p.xyz, p.measurement, p.point + 1, p.repeat, p.machine), "there is a point 4"),
    ],
)  # fmt: skip
def test_a_recording_that_is_none_of_this_triangle_is_refused(spoil: object, message: str) -> None:
    assert callable(spoil)
    with pytest.raises(CmmUqError, match=message):
        Triangle(FACTS, spoil(seven()))


def test_the_equations_serve_aligned_triangles_and_one_chain_only() -> None:
    with pytest.raises(CmmUqError, match="those of the chain YXZ, not XYZ"):
        solve_equations(Triangle(FACTS, placed_triangle(Machine("m", "XYZ", TRAVEL), STANDARD.sides)))
    askew = seven()
    turn = np.array([[0.9, -0.435889894, 0], [0.435889894, 0.9, 0], [0, 0, 1]])
    askew = askew.at(np.where(askew.measurement[:, None] == 1, askew.xyz @ turn.T, askew.xyz))
    with pytest.raises(CmmUqError, match="measurement 1: side 1–2 and the height over it do not lie along"):
        solve_equations(Triangle(FACTS, askew))


def test_a_triangle_larger_than_the_machine_is_refused() -> None:
    with pytest.raises(CmmUqError, match="800 mm long along Y"):
        placed_triangle(Machine("small", "YXZ", TRAVEL / [[1], [2], [1]]), np.array([800.0, 500, 500]),
                        (Placing("vertical", "YZ", (0, 0, 0)),))  # fmt: skip


def test_the_tip_counts_for_every_carriage() -> None:
    """In ZX with a tip of 240 mm along Y, a yaw of X of 10″/m shortens 500 mm by 10″/m · 0.5 m · 240 mm = 5.8 µm."""
    triangle = Triangle(FACTS, with_columns(seven()))
    assert triangle.points.machine.tip_on_every_carriage
    points = indicated(FACTS, seven(), ["rotation_x_z"], [10.0])
    base = points.xyz[points.measurement == 7]
    expected = 500 + 10 * np.pi / 648000 * 0.5 * 240
    assert base[1, 0] - base[0, 0] == pytest.approx(expected, abs=1e-6)


JOB = "triangle-simulated"
ROTATIONS = {
    "rotation_x_x": 4.0, "rotation_x_y": -3.0, "rotation_x_z": 2.0, "rotation_y_x": 1.5, "rotation_y_y": -2.5,
    "rotation_y_z": 3.0, "rotation_z_x": -4.0, "rotation_z_y": 2.0, "rotation_z_z": 5.0,
}  # fmt: skip


def test_the_errors_put_into_the_example_are_found() -> None:
    recovered(JOB, {**SCALE, **SQUARE, **ROTATIONS})


def test_the_source_s_equations_find_them_too() -> None:
    rows = table(JOB, "Scale, squareness, pitch, yaw and roll").rows
    truth = {**SCALE, **SQUARE, **ROTATIONS}
    assert len(rows) == len(truth)
    for (_, by_equations, U, *_), value in zip(rows, truth.values(), strict=True):
        assert abs(number(by_equations) - value) < 2 * number(U)


def test_angles_are_printed_with_their_uncertainty() -> None:
    """A 3-4-5 triangle: 36.87°, 53.13°, 90°; the largest U at the right angle, 0.27″ for 0.1 µm and 0.1 µm; k = 1.96."""
    rows = {row[0]: row[1:] for row in table(JOB, "Sides and angles of the standard at 20 °C").rows}
    assert rows["Angle at 3"] == ("90.000000", "0.27″", "°")
    assert rows["Side 1–2"] == ("500.00000", "0.00024", "mm")


def test_the_picture_says_which_parameter_is_out() -> None:
    """Tolerances of 12 ppm and 8″: scale Z is 14 ppm, squareness XY 12″; YZ with 7.5″ is too near to call."""
    verdicts = {row[0]: row[-1] for row in table(JOB, "Parameters and tolerances").rows}
    assert {name for name, said in verdicts.items() if said == "fail"} == {"Scale error of Z", "Squareness X–Y"}
    assert verdicts["Squareness Y–Z"] == "undecided"
    picture = next(b for b in blocks(JOB) if isinstance(b, Plot) and b.caption.startswith("Each parameter over its"))
    assert picture.alternative == "Out of tolerance: Scale error of Z and Squareness X–Y."
