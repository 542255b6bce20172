"""Errors of arms that are stated by screw axes: against finite differences of the product of exponentials, and its freedoms.

Kinematics are products of matrix exponentials (SciPy) of the screw axes, whatever rows the package makes of them.
"""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from scipy.linalg import expm, subspace_angles

from cmm_uq.base.arm import Arm, rows_of_screws
from cmm_uq.base.points import Floats, Points
from cmm_uq.machine.physics.effects.joints import OfRows, effects_of_arm

SECOND = np.pi / 180 / 3600
UP = np.array([0.2, 0.0, 1.0]) / np.hypot(0.2, 1.0)
TOOL = np.array([30.0, -20.0, 110.0])
# a robot whose axes 2, 3 and 4 are parallel, as those of a UR, and one whose axes are skew; the last with a prismatic joint
PARALLEL = (
    np.array([[0, 0, 1], [0, 1, 0], [0, 1, 0], [0, 1, 0], [0, 0, -1], [0, 1, 0.0]]),
    np.array([[0, 0, 0], [0, 0, 89], [425, 0, 89], [817, 0, 89], [817, 109, 0], [817, 0, -6.0]]),
    np.ones(6, dtype=bool),
)
SKEW = (
    np.array([[0.1, 0, 1], [0, 1, 0.2], [0.3, 1, 0], [1, 0.1, 0], [0, 1, -0.3], [1, 0, 0.2]]),
    np.array([[0, 10, 0], [40, 0, 300], [60, 5, 800], [300, 2, 900], [700, 0, 905], [800, 3, 910.0]]),
    np.array([True, True, True, True, True, True]),
)
SLIDING = (SKEW[0], SKEW[1], np.array([True, True, False, True, True, True]))
ROBOTS = {"parallel axes": PARALLEL, "skew axes": SKEW, "a prismatic joint": SLIDING}
Screws = tuple[Floats, Floats, np.ndarray]


def unit(directions: Floats) -> Floats:
    return np.asarray(directions / np.linalg.norm(directions, axis=1, keepdims=True))


def home() -> Floats:
    frame = np.eye(4)
    frame[:3, :3] = expm(_skew(np.array([0.3, -1.1, 0.4])))
    frame[:3, 3] = [850.0, 120.0, -30.0]
    return frame


def _skew(w: Floats) -> Floats:
    return np.array([[0, -w[2], w[1]], [w[2], 0, -w[0]], [-w[1], w[0], 0]])


@cache
def motion(direction: tuple[float, ...], through: tuple[float, ...], turns: bool, amount: float) -> Floats:
    """(4, 4) e^ξq of one axis."""
    w, twist = np.array(direction), np.zeros((4, 4))
    if turns:
        twist[:3, :3] = _skew(w)
        twist[:3, 3] = -np.cross(w, through)
    else:
        twist[:3, 3] = w
    return np.asarray(expm(twist * amount))


def exact(screws: Screws, q: Floats, tool: Floats = TOOL) -> Floats:
    """(n, 3) e^ξ₁q₁ … e^ξ₆q₆·M·tool for readings (n, 6) rad or mm."""
    directions, through, revolute = screws
    axes = [*zip(map(tuple, unit(directions)), map(tuple, through), map(bool, revolute), strict=True)]
    last = home() @ np.append(tool, 1.0)
    found = []
    for one in q:
        frame = np.eye(4)
        for axis, amount in zip(axes, one, strict=True):
            frame = frame @ motion(*axis, float(amount))
        found.append((frame @ last)[:3])
    return np.array(found)


def recorded(screws: Screws, count: int = 40) -> tuple[Points, Floats]:
    """Points of the arm as the package makes it, and its readings in rad or mm."""
    directions, through, revolute = screws
    q = np.random.default_rng(4).uniform(-60.0, 60.0, (count, 6))
    made = rows_of_screws(unit(directions), through, revolute, home())
    made["tool_mm"] = made["tool_mm"] + TOOL
    arm = Arm("r", **made, revolute=revolute, sense=np.ones(6), by_screws=True, up=UP, limits=np.full((6, 2), np.nan))
    columns = dict(zip(arm.columns_of_joints, q.T, strict=True))
    sides = np.random.default_rng(5).choice([-1.0, 1.0], (6, count))
    columns |= {f"approach_q{i + 1}": sides[i] for i in range(6)}
    one = np.ones(count, dtype=np.int64)
    xyz = arm.posed(columns).tool
    radians = q * np.where(revolute, np.pi / 180, 1.0)
    assert np.allclose(xyz, exact(screws, radians), atol=1e-9)
    return Points(xyz, one, np.arange(1, count + 1), one, arm, columns), radians


def differences(screws: Screws, q: Floats, change: Floats) -> Floats:
    """(n, 3) by how much the tool moves for changes (n, 6) of what the joints do, per unit of the step."""
    step = 1e-2
    return (exact(screws, q + step * change) - exact(screws, q - step * change)) / (2 * step)


def lever(screws: Screws, q: Floats, joint: int) -> Floats:
    """(n,) by how much the tool goes down per radian of a joint, mm: the lever of its weight."""
    step = 1e-5 * np.eye(6)[joint]
    return (exact(screws, q - step) - exact(screws, q + step)) @ UP / 2e-5


@pytest.mark.parametrize("robot", ROBOTS)
def test_errors_of_joints_are_those_of_the_screw_axes(robot: str) -> None:
    """Zero, eccentric encoder, its second harmonic, a gear, play and sag, of every joint."""
    screws = ROBOTS[robot]
    points, q = recorded(screws)
    every = effects_of_arm(points)
    for i, turns in enumerate(screws[2]):
        at, one = f"q{i + 1}", np.eye(6)[i]
        if not turns:
            moved = every[f"offset_{at}"].basis(points)[:, :, 0]
            assert np.allclose(moved, differences(screws, q, 1e-3 * np.tile(one, (len(q), 1))), atol=1e-9)
            moved = every[f"gain_{at}"].basis(points)[:, :, 0]
            assert np.allclose(moved, differences(screws, q, 1e-6 * q[:, i, None] * one), atol=1e-9)
            continue
        side = points.columns[f"approach_{at}"]
        expected = {
            ("zero", 0, ()): np.ones(len(q)), ("slack", 0, ()): 0.5 * side,
            ("eccentricity", 0, ()): np.sin(q[:, i]), ("eccentricity", 1, ()): np.cos(q[:, i]),
            ("ovality", 0, ()): np.sin(2 * q[:, i]), ("gear", 1, (12.0,)): np.cos(30 * q[:, i]),
            ("sag", 0, ()): lever(screws, q, i) / 1000,
        }  # fmt: skip
        for (kind, column, shape), amount in expected.items():
            found = every[f"{kind}_{at}"].basis(points, shape)[:, :, column]
            wanted = differences(screws, q, SECOND * amount[:, None] * one)
            assert np.allclose(found, wanted, atol=2e-7), (kind, at)


def moved_axes(screws: Screws, q: Floats) -> Floats:
    """(3n, k) what directions and places of all axes, tool and home do, by central differences."""
    directions, through, revolute = screws
    columns = []
    for i, turns in enumerate(revolute):
        across = np.linalg.svd(unit(directions)[i][None])[2][1:]
        for way in across:
            for of, step in ((0, 1e-5), (1, 1e-2)):
                if of == 1 and not turns:  # a shift has no place
                    continue
                ends = []
                for sign in (step, -step):
                    changed = [unit(directions).copy(), through.copy()]
                    changed[of][i] += sign * way
                    ends.append(exact((*changed, revolute), q))
                columns.append((ends[0] - ends[1]) / (2 * step))
    tools = ([exact(screws, q, TOOL + sign * way) for sign in (1e-2, -1e-2)] for way in np.eye(3))
    columns += [(one - other) / 2e-2 for one, other in tools]
    columns += [differences(screws, q, np.tile(one, (len(q), 1)) * 1e-2) for one in np.eye(6)]
    return np.array([column.ravel() for column in columns]).T


def placed(points: Points) -> Floats:
    """(3n, 6) what the place of the base does."""
    turns = np.cross(np.eye(3)[None], points.xyz[:, None])
    both = np.concatenate([np.broadcast_to(np.eye(3), turns.shape), turns], axis=1)
    return both.transpose(0, 2, 1).reshape(-1, 6)


def basis_of(columns: Floats) -> Floats:
    u, s, _ = np.linalg.svd(columns / np.linalg.norm(columns, axis=0), full_matrices=False)
    return u[:, s > 1e-6 * s[0]]


@pytest.mark.parametrize("robot", ROBOTS)
def test_effects_of_rows_are_directions_and_places_of_all_axes_and_no_others(robot: str) -> None:
    """With where the base stands both span the same moves of the tool, of the same rank: gauge freedoms are by rank alone.

    What stays open is the same of either: the first axis and its zero beside where the base stands, the last beside the tool.
    """
    screws = ROBOTS[robot]
    points, q = recorded(screws)
    every = effects_of_arm(points)
    rows = [effect.basis(points) for name, effect in every.items()
            if isinstance(effect, OfRows) and name.split("_q")[0] in ("zero", "length", "twist", "offset", "parallelism",
                                                                       "tool_offset")]  # fmt: skip
    base = placed(points)
    by_rows = basis_of(np.hstack([np.concatenate(rows, axis=2).reshape(3 * len(points), -1), base]))
    by_axes = basis_of(np.hstack([moved_axes(screws, q), base]))
    assert by_rows.shape == by_axes.shape
    assert np.max(subspace_angles(by_rows, by_axes)) < 1e-5
