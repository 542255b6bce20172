"""Artefacts as they truly stand: points, what is recorded beside them, and the certificate, drawn without the package.

Every artefact has a true size that its certificate does not know exactly; placings and repeats are ordinary ones.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from benchmarks.concealed.physics import TRAVEL

SIX = ("scale_x", "scale_y", "scale_z", "squareness_xy", "squareness_yz", "squareness_zx")
ROTATIONS = tuple(f"rotation_{a}_{b}" for a in "xyz" for b in "xyz")
MIDDLE = TRAVEL.mean(axis=1)


@dataclass(frozen=True, eq=False)
class Placed:
    """An artefact in all its placings.

    Parameters
    ----------
    kind : of ``[artefact]``.
    true : (n, 3) true points, mm, in the order of measuring.
    measurement, point, repeat : (n,).
    effects : that act, and that the job names.
    facts : further lines of ``[artefact]``.
    sizes : true sizes by their names in results.json, mm.
    columns : (n,) each, recorded beside the coordinates.
    along : (n, 3) of a bar: half of its direction outwards, so that a slow change is one of its length.
    reach : (n,) distance from the first face, mm, where noise may grow with it.
    chain : of the machine.
    """

    kind: str
    true: np.ndarray
    measurement: np.ndarray
    point: np.ndarray
    repeat: np.ndarray
    effects: tuple[str, ...]
    facts: str
    sizes: Mapping[str, float]
    columns: Mapping[str, np.ndarray] = field(default_factory=dict)
    along: np.ndarray | None = None
    reach: np.ndarray | None = None
    chain: str = "XYZ"


def unit(v: np.ndarray) -> np.ndarray:
    """Vectors of length one."""
    return v / np.linalg.norm(v, axis=-1, keepdims=True)


def numbered(placings: int, repeats: int, points: int) -> dict[str, np.ndarray]:
    """Numbers of measurement, repeat and point, the point running fastest."""
    m, r, p = np.meshgrid(np.arange(placings), np.arange(repeats), np.arange(points), indexing="ij")
    return {"measurement": 1 + m.ravel(), "repeat": 1 + r.ravel(), "point": 1 + p.ravel()}


def ballbar(random: np.random.Generator) -> Placed:
    """Twenty placings anyhow in the volume, three times each."""
    certified = float(np.round(random.uniform(350, 450), 4))
    true_length = certified + 0.5e-3 * random.standard_normal()
    half = 0.5 * true_length * unit(random.standard_normal((20, 3)))
    room = np.ptp(TRAVEL, axis=1) - 2 * np.abs(half)
    middle = TRAVEL[:, 0] + np.abs(half) + np.maximum(room, 0) * random.random((20, 3))
    one = np.stack([middle - half, middle + half], axis=1)
    outward = np.stack([-unit(half), unit(half)], axis=1)
    return Placed(
        "ballbar", np.repeat(one, 3, axis=0).reshape(-1, 3), **numbered(20, 3, 2), effects=SIX,
        facts=f"length_mm = {certified}\nu_um = 0.5\n", sizes={"length_mm": true_length},
        along=np.repeat(outward, 3, axis=0).reshape(-1, 3) / np.sqrt(2),
    )  # fmt: skip


def _gauge_lines(
    kind: str, lines: list[tuple[np.ndarray, np.ndarray]], scale: float, random: np.random.Generator, **more: object
) -> Placed:
    """Lines, each a direction and the certified distances of its faces, three times; ``scale`` is true over certified.

    Every second time the whole line is measured three times over, else each face three times before the next: what drifts
    then looks like a scale.
    """
    order = np.arange(3 * len(lines[0][1]))
    if random.random() < 0.5:
        order = order.reshape(3, -1).T.ravel()
    parts: dict[str, list[np.ndarray]] = {"true": [], "measurement": [], "point": [], "repeat": [], "reference": []}
    sense = []
    for number, (direction, faces) in enumerate(lines, 1):
        extent = np.abs(direction) * faces[-1]
        free = np.maximum(np.ptp(TRAVEL, axis=1) - extent, 0) * random.uniform(0.2, 0.8, 3)
        start = np.where(direction < 0, TRAVEL[:, 1] - free, TRAVEL[:, 0] + free)
        count = len(faces)
        parts["true"].append(np.tile(start + scale * faces[:, None] * direction, (3, 1))[order])
        parts["measurement"].append(np.full(3 * count, number))
        parts["point"].append(np.tile(np.arange(1, count + 1), 3)[order])
        parts["repeat"].append(np.repeat([1, 2, 3], count)[order])
        parts["reference"].append(np.tile(faces, 3)[order])
        sense.append(np.tile(np.where(np.arange(count)[:, None] == 0, -direction, direction), (3, 1))[order])
    joined: dict[str, Any] = {name: np.concatenate(values) for name, values in parts.items()}
    reference, outward = joined.pop("reference"), np.concatenate(sense)
    columns = {"reference_mm": reference}
    if kind == "gauge_blocks":
        columns |= {f"n{a}": outward[:, i] for i, a in enumerate("xyz")}
    return Placed(kind, **joined, columns=columns, reach=reference, **more)


def step_gauge(random: np.random.Generator) -> Placed:
    """Seven lines of five lengths, three times: the axes and the diagonals of the body."""
    diagonals = [unit(np.array([x, y, 1.0]) * np.ptp(TRAVEL, axis=1)) for x in (1, -1) for y in (1, -1)]
    lines = []
    for direction in [*diagonals, *np.eye(3)]:
        room = float(np.min(np.ptp(TRAVEL, axis=1)[direction != 0] / np.abs(direction[direction != 0])))
        longest = 20.0 * np.floor(0.75 * min(room, 1000) / 20)
        lines.append((direction, np.concatenate([[0.0], np.round(np.linspace(0.2, 1, 5) * longest, -1)])))
    length = max(faces[-1] for _, faces in lines)
    true_length = length + 0.4e-3 * random.standard_normal()
    return _gauge_lines("step_gauge", lines, true_length / length, random, effects=SIX, facts="u_um = 0.4\n",
                        sizes={"length_mm": true_length})  # fmt: skip


def gauge_blocks(random: np.random.Generator) -> Placed:
    """Four blocks along each axis, their outer faces three times."""
    lines = [
        (direction, np.array([0.0, length]))
        for direction, lengths in zip(
            np.eye(3), ([100, 250, 500, 800], [80, 200, 350, 500], [60, 150, 300, 400]), strict=True
        )
        for length in lengths
    ]
    true_length = 800 + 0.15e-3 * random.standard_normal()
    return _gauge_lines("gauge_blocks", lines, true_length / 800, random, effects=(*SIX[:3], "probe_radius"),
                        facts="u_um = 0.15\n", sizes={"length_mm": true_length})  # fmt: skip


def bryan(random: np.random.Generator) -> Placed:
    """A bar of a certified length swept over sixty positions of the upper half of its sphere, once."""
    true_length = 270 + 0.5e-3 * random.standard_normal()
    fixed = np.array([450.0, 300.0, -400.0]) + random.uniform(-25, 25, 3)
    return Placed("bryan", fixed + true_length * spiral(60), **numbered(60, 1, 1), effects=SIX,
                  facts="length_mm = 270.0\nu_um = 0.5\n", sizes={"length_mm": true_length})  # fmt: skip


def spiral(count: int) -> np.ndarray:
    """Directions spread evenly over the upper half of a sphere."""
    z = 1 - (np.arange(count) + 0.5) / count
    turn = np.pi * (3 - np.sqrt(5)) * np.arange(count)
    flat = np.sqrt(1 - z**2)
    return np.column_stack([flat * np.cos(turn), flat * np.sin(turn), z])


def plate(random: np.random.Generator) -> Placed:
    """Twenty-five balls 80 mm apart: flat, upright along X and along Y, and tilted, twice each."""
    grid = np.array([[i, j, 0.0] for j in range(5) for i in range(5)]) * 80.0
    longest = float(np.linalg.norm(grid[-1]))
    true_length = longest + 0.5e-3 * random.standard_normal()
    axes = np.array([[[1, 0, 0], [0, 1, 0], [0, 0, 1]], [[1, 0, 0], [0, 0, 1], [0, -1, 0]],
                     [[0, 1, 0], [0, 0, 1], [1, 0, 0]], [[0.8, 0, 0.6], [0, 1, 0], [-0.6, 0, 0.8]]])  # fmt: skip
    ways = [(grid - grid.mean(axis=0)) * (true_length / longest) @ frame for frame in axes]
    room = [np.ptp(TRAVEL, axis=1) / 2 - np.abs(way).max(axis=0) - 10 for way in ways]
    placed = [MIDDLE + free * random.uniform(-0.8, 0.8, 3) + way for way, free in zip(ways, room, strict=True)]
    return Placed(
        "plate", np.repeat(np.array(placed), 2, axis=0).reshape(-1, 3), **numbered(4, 2, 25), effects=SIX,
        facts="u_um = 0.5\n", sizes={"length_mm": true_length},
        columns={f"reference_{a}_mm": np.tile(grid[:, i], 8) for i, a in enumerate("xyz")},
    )  # fmt: skip


def sphere(random: np.random.Generator) -> Placed:
    """Twenty-five points of a test sphere in three places, twice each."""
    normals = spiral(25)
    true_length = 25.0012 + 0.1e-3 * random.standard_normal()
    centres = TRAVEL[:, 0] + 50 + random.random((3, 3)) * (np.ptp(TRAVEL, axis=1) - 100)
    points = np.repeat(centres, 50, axis=0) + 0.5 * true_length * np.tile(normals, (6, 1))
    return Placed("sphere", points, **numbered(3, 2, 25), effects=("probe_radius", "probe_lobing"),
                  facts="length_mm = 25.0012\nu_um = 0.1\n", sizes={"length_mm": true_length},
                  columns={f"n{a}": np.tile(normals[:, i], 6) for i, a in enumerate("xyz")})  # fmt: skip


def plane(random: np.random.Generator) -> Placed:
    """A surface plate probed at seven by five points, three times."""
    x, y = np.meshgrid(np.linspace(60, 840, 7), np.linspace(50, 550, 5))
    tilt = 2e-4 * random.standard_normal(2)
    z = -450 + random.uniform(-20, 20) + tilt[0] * x.ravel() + tilt[1] * y.ravel()
    return Placed("plane", np.tile(np.column_stack([x.ravel(), y.ravel(), z]), (3, 1)), **numbered(1, 3, 35),
                  effects=("straightness_x_z", "straightness_y_z"), facts="", sizes={})  # fmt: skip


def triangle(random: np.random.Generator) -> Placed:
    """A triangle of blocks and cylinders in seven placings, two of them with a longer tip, three times each."""
    blocks = np.array([480.0, 280.0, 380.0]) + 0.1e-3 * random.standard_normal(3)
    cylinders = 20.0 + 0.1e-3 * random.standard_normal(3)
    c, a, b = blocks + 0.5 * (cylinders + np.roll(cylinders, -1))
    foot = (b**2 + c**2 - a**2) / (2 * c)
    body = np.array([[0, 0], [c, 0], [foot, np.sqrt(b**2 - foot**2)]])
    ways = [((0, 1), (0, 0.5, 0), 80), ((0, 1), (0, 0.5, 1), 80), ((1, 2), (0, 0.5, 0), 80), ((1, 2), (1, 0.5, 0), 80),
            ((1, 2), (1, 0.5, 0), 240), ((0, 2), (0.5, 0.5, 0), 80), ((0, 2), (0.5, 0.5, 0), 240)]  # fmt: skip
    placed, tips = [], []
    for (along, up), place, length in ways:
        size = np.zeros(3)
        size[[along, up]] = body.max(axis=0)
        start = TRAVEL[:, 0] + 0.05 * np.ptp(TRAVEL, axis=1) + (0.9 * np.ptp(TRAVEL, axis=1) - size) * place
        corners = np.tile(start, (3, 1))
        corners[:, [along, up]] += body
        tip = np.zeros(3)
        tip[3 - along - up] = -length if (along, up) == (0, 1) else length
        placed.append(np.tile(corners, (3, 1)))
        tips.append(np.tile(tip, (9, 1)))
    sizes = dict(zip(("block_12_mm", "block_23_mm", "block_31_mm"), blocks.tolist(), strict=True))
    sizes |= {f"cylinder_{i}_mm": float(value) for i, value in enumerate(cylinders, 1)}
    return Placed(
        "triangle", np.vstack(placed), **numbered(7, 3, 3), effects=(*SIX, *ROTATIONS),
        facts="blocks_mm = [480.0, 280.0, 380.0]\nu_blocks_um = 0.1\n"
        "cylinders_mm = [20.0, 20.0, 20.0]\nu_cylinders_um = 0.1\n",
        sizes=sizes, columns={f"tip_{a}_mm": np.vstack(tips)[:, i] for i, a in enumerate("xyz")}, chain="YXZ",
    )  # fmt: skip


ARTEFACTS: Mapping[str, Callable[[np.random.Generator], Placed]] = {
    "ballbar": ballbar, "step gauge": step_gauge, "gauge blocks": gauge_blocks, "bryan": bryan, "plate": plate,
    "sphere": sphere, "triangle": triangle, "plane": plane,
}  # fmt: skip
