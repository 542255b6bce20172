"""Effects of an arm, each by its formula written out a second time as products of 4 × 4 matrices."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from numpy.testing import assert_allclose

from cmm_uq.base.arm import Arm
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.points import Floats, Machine, Points
from cmm_uq.machine.physics.effects.joints import ToolOffset, Zero, effects_of_arm
from cmm_uq.machine.physics.superposition import Superposition

SECOND, UM = np.pi / 180 / 3600, 1e-3
ROWS = np.array([
    [150.0, -90, 475, 0], [600, 0, 0, -90], [120, -90, 0, 0], [0, 90, 720, 0], [0, -90, 0, 0], [0, 0, 85, 180],
])  # fmt: skip
TOOL, N = np.array([30.0, 0.0, 120.0]), 7


def turn(axis: int, angle: float) -> Floats:
    c, s, i, j = np.cos(angle), np.sin(angle), (axis + 1) % 3, (axis + 2) % 3
    found = np.eye(4)
    found[i, i], found[j, j], found[i, j], found[j, i] = c, c, -s, s
    return found


def shift(axis: int, by: float) -> Floats:
    found = np.eye(4)
    found[axis, 3] = by
    return found


def tool_at(q: Floats, change: dict[tuple[int, str], float], tool: Floats = TOOL) -> Floats:
    """By Rz(θ) Tz(d) Tx(a) Rx(α) Ry(β) of every joint, with changes of (joint from 1, parameter) in mm and rad."""
    frame = np.eye(4)
    for i, ((a, alpha, d, theta), reading) in enumerate(zip(ROWS, q, strict=True), 1):
        of = {name: change.get((i, name), 0.0) for name in ("a", "alpha", "d", "theta", "beta")}
        frame = frame @ turn(2, np.radians(theta + reading) + of["theta"]) @ shift(2, d + of["d"])
        frame = frame @ shift(0, a + of["a"]) @ turn(0, np.radians(alpha) + of["alpha"]) @ turn(1, of["beta"])
    return np.asarray((frame @ np.append(tool, 1.0))[:3])


def points_of(**further: Floats) -> Points:
    random = np.random.default_rng(3)
    q = random.uniform(-80, 80, (N, 6))
    rows = np.column_stack([ROWS[:, 0], np.radians(ROWS[:, 1]), ROWS[:, 2], np.radians(ROWS[:, 3]), np.zeros(6)])
    arm = Arm("arm", rows=rows, revolute=np.ones(6, dtype=bool), sense=np.ones(6), tool_mm=TOOL)
    columns = {f"q{i + 1}_deg": q[:, i] for i in range(6)} | further
    one = np.ones(N, dtype=np.int64)
    return Points(arm.posed(columns).tool, one, np.arange(1, N + 1), one, arm, columns)


def readings(points: Points) -> Floats:
    return np.column_stack([points.columns[f"q{i}_deg"] for i in range(1, 7)])


Change = Callable[[Floats], dict[tuple[int, str], float]]  # of the readings of one pose, rad where they are angles


def of_sag(q: Floats) -> dict[tuple[int, str], float]:
    """Joint 2 turns about the horizontal axis that joint 1 has turned; its lever is the tool's horizontal distance."""
    axis = np.array([-np.sin(np.radians(q[0])), np.cos(np.radians(q[0])), 0])  # z of the first row, after α = −90°
    shoulder = np.array([150 * np.cos(np.radians(q[0])), 150 * np.sin(np.radians(q[0])), 475.0])
    lever = axis @ np.cross(tool_at(q, {}) - shoulder, [0, 0, -1.0])
    return {(2, "theta"): 30 * SECOND * lever / 1000}


CASES: dict[str, tuple[dict[str, float], Change]] = {
    "zero_q3": ({"arcsec": 40.0}, lambda q: {(3, "theta"): 40 * SECOND}),
    "length_q2": ({"um": 70.0}, lambda q: {(2, "a"): 70 * UM}),
    "twist_q4": ({"arcsec": 30.0}, lambda q: {(4, "alpha"): 30 * SECOND}),
    "offset_q5": ({"um": -50.0}, lambda q: {(5, "d"): -50 * UM}),
    "parallelism_q2": ({"arcsec": 20.0}, lambda q: {(2, "beta"): 20 * SECOND}),
    "eccentricity_q1": ({"amplitude_arcsec": 25.0, "phase_rad": 0.7},
                        lambda q: {(1, "theta"): 25 * SECOND * np.sin(np.radians(q[0]) + 0.7)}),
    "ovality_q4": ({"amplitude_arcsec": 25.0, "phase_rad": -1.2},
                   lambda q: {(4, "theta"): 25 * SECOND * np.sin(2 * np.radians(q[3]) - 1.2)}),
    "gear_q2": ({"amplitude_arcsec": 15.0, "phase_rad": 0.4, "period_deg": 3.6},
                lambda q: {(2, "theta"): 15 * SECOND * np.sin(2 * np.pi * q[1] / 3.6 + 0.4)}),
    "sag_q2": ({"arcsec_per_m": 30.0}, of_sag),
}  # fmt: skip


@pytest.mark.parametrize("name", CASES)
def test_an_effect_moves_the_tool_as_its_changed_row_does(name: str) -> None:
    points, (parameters, change) = points_of(), CASES[name]
    e = effects_of_arm(points)[name].displacement(points, parameters)
    for q, moved in zip(readings(points), e, strict=True):
        assert_allclose(moved, tool_at(q, change(q)) - tool_at(q, {}), rtol=0, atol=3e-5)
    assert np.abs(e).max() > 5e-3


def test_play_goes_by_the_side_that_a_joint_came_from() -> None:
    approach = np.array([1.0, -1, 0, 1, -1, 1, -1])
    points = points_of(approach_q3=approach)
    e = effects_of_arm(points)["slack_q3"].displacement(points, {"gap_arcsec": 60.0})
    for q, side, moved in zip(readings(points), approach, e, strict=True):
        assert_allclose(moved, tool_at(q, {(3, "theta"): 30 * SECOND * side}) - tool_at(q, {}), rtol=0, atol=3e-5)


def test_a_payload_bends_a_joint_by_its_weight_and_the_lever_of_the_tool() -> None:
    """As sag of so many ″/m does, times what each pose carries; nothing without a payload."""
    payload = np.array([0.0, 2.0, 5.0, 0.5, 3.0, 1.0, 0.0])
    points = points_of(payload_kg=payload)
    e = effects_of_arm(points)["compliance_q2"].displacement(points, {"arcsec_per_m_kg": 30.0})
    for q, mass, moved in zip(readings(points), payload, e, strict=True):
        ((of, angle),) = of_sag(q).items()
        assert_allclose(moved, tool_at(q, {of: mass * angle}) - tool_at(q, {}), rtol=0, atol=2e-4)
    assert np.abs(e[payload == 0]).max() == 0 < np.abs(e[payload > 1]).max()


def test_links_sag_by_the_mean_of_the_joints_beyond() -> None:
    """At zero joint 4's origin is that of joint 3's row end, and 5 and 6 lie 720 mm farther: lever (1.12 + 2·1.12+…)/3."""
    points = points_of()
    effect = effects_of_arm(points)["sag_links_q3"]
    pose = points.machine.posed(points.columns)  # type: ignore[attr-defined]
    middle = pose.origins[:, 3:, 3].mean(axis=1)
    lever = np.einsum("ni,ni->n", pose.axes[:, 2, 3], np.cross(middle - pose.origins[:, 2, 3], [0, 0, -1.0])) / 1000
    zero = effects_of_arm(points)["zero_q3"].basis(points)[:, :, 0]
    assert_allclose(effect.basis(points)[:, :, 0], zero * lever[:, None], atol=1e-12)


def test_each_reflector_has_an_offset_of_its_own() -> None:
    tips = np.where(np.arange(N)[:, None] % 2, [0.0, 50.0, 0.0], 0.0)
    points = points_of(**{f"tip_{axis}_mm": tips[:, i] for i, axis in enumerate("xyz")})
    effect = effects_of_arm(points)["tool_offset"]
    assert [c.name for c in effect.coefficients] == ["x_1_um", "y_1_um", "z_1_um", "x_2_um", "y_2_um", "z_2_um"]
    e = effect.displacement(points, dict.fromkeys((c.name for c in effect.coefficients), 0.0) | {"z_2_um": 80.0})
    for i, q in enumerate(readings(points)):
        there = tool_at(q, {}, TOOL + tips[i] + [0, 0, 80 * UM * (i % 2)])
        assert_allclose(e[i], there - tool_at(q, {}, TOOL + tips[i]), atol=1e-9)


def test_large_changes_of_all_rows_act_together_without_approximation() -> None:
    """Zeros of 0.5° and more: to first order the tool would be 0.04 mm off."""
    points = points_of()
    every = effects_of_arm(points)
    effects = (every["zero_q2"], every["length_q3"], every["tool_offset"], every["zero_q3"])
    coefficients = np.array([2500.0, 800.0, 5000.0, -3000.0, 2000.0, -3600.0])
    together = Superposition(effects)
    change = {(2, "theta"): 2500 * SECOND, (3, "a"): 0.8, (3, "theta"): -3600 * SECOND}
    for q, e in zip(readings(points), together.errors(points, coefficients), strict=True):
        assert_allclose(e, tool_at(q, change, TOOL + np.array([5.0, -3.0, 2.0])) - tool_at(q, {}), atol=1e-9)
    columns = together.derivatives(together.about(points, coefficients))
    for k in range(6):
        step = np.where(np.arange(6) == k, 0.5, 0.0)
        difference = together.errors(points, coefficients + step) - together.errors(points, coefficients - step)
        assert_allclose(columns[:, :, k], difference, atol=1e-9)
    linear = together.derivatives(together.about(points, np.zeros(6))) @ coefficients
    assert np.abs(linear - together.errors(points, coefficients)).max() > 0.03


def test_what_has_no_joints_has_none_of_these_effects() -> None:
    one = np.ones(1, dtype=np.int64)
    points = Points(np.zeros((1, 3)), one, one, one, Machine("m"))
    for effect in (Zero("q1"), ToolOffset()):
        with pytest.raises(CmmUqError, match="the machine has no joints"):
            effect.basis(points)


def test_parallelism_is_looked_for_between_nearly_parallel_axes_alone() -> None:
    """Elsewhere it is another name of zero, twist, length and offset: a joint off by its zero was said to be not parallel."""
    alphas = np.radians([-90.0, 0.0, 3.0, 90.0, 180.0, 60.0])
    rows = np.column_stack([np.full(6, 100.0), alphas, np.full(6, 50.0), np.zeros((6, 2))])
    arm = Arm("r", rows=rows, revolute=np.ones(6, dtype=bool), sense=np.ones(6), limits=np.full((6, 2), np.nan))
    one = np.ones(1, dtype=np.int64)
    columns = {f"q{i}_deg": np.full(1, 10.0) for i in range(1, 7)}
    points = Points(arm.posed(columns).tool, one, one, one, arm, columns)
    shown = [effects_of_arm(points)[f"parallelism_q{i}"].shown_in(points) for i in range(1, 7)]
    assert shown == [False, True, True, False, True, False]
