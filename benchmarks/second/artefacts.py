"""Artefacts of the second study as they stand: simulated ones, and the twenty bars that were really measured.

Beside what :class:`~benchmarks.concealed.designs.Design` has, each point knows where on the artefact it lies and how the
artefact lay, so that a fault of the artefact can be told from one of the machine.
"""

from __future__ import annotations

import csv
from dataclasses import dataclass, fields
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.concealed.designs import Design, ballbar as bars, surroundings, unit
from benchmarks.concealed.physics import KNOWN, TRAVEL

EXAMPLES = Path(__file__).parents[2] / "examples"
SIX = ("scale_x", "scale_y", "scale_z", "squareness_xy", "squareness_yz", "squareness_zx")
ORIGIN = np.array([805.0, 303.0, -294.0])
"""Of the real bars' coordinates, as in their job."""
LENGTH = 404.2357
"""Of the real bar, mm."""
COPIED = 18
"""Position of the real bars that repeats another one's figures in the source."""
WAYS = {
    "flat": [[1, 0, 0], [0, 1, 0], [0, 0, 1]],
    "flat, turned": [[0, 1, 0], [-1, 0, 0], [0, 0, 1]],
    "upright along X": [[1, 0, 0], [0, 0, 1], [0, -1, 0]],
    "upright along Y": [[0, 1, 0], [0, 0, 1], [1, 0, 0]],
}
"""How a plate lies: the machine's directions of its own axes."""


@dataclass
class Placed(Design):
    """A design with the artefact's own frame.

    Parameters
    ----------
    node : (n,) which ball, face or direction of the artefact a point is.
    own : (n, 3) where it lies on the artefact, mm.
    axes : (n, 3, 3) the machine's directions of the artefact's axes, in rows.
    origin : (3,) scale reading less recorded coordinate, mm.
    residuals : (m,) of a real recording, mm, where this is one.
    """

    node: np.ndarray
    own: np.ndarray
    axes: np.ndarray
    origin: np.ndarray
    residuals: np.ndarray | None = None


def _placed(design: Design, **more: Any) -> Placed:
    kept: dict[str, Any] = {each.name: getattr(design, each.name) for each in fields(Design)}
    return Placed(**kept, **({"origin": np.zeros(3)} | more))


def _timed(random: np.random.Generator, recorded: dict) -> dict:
    """Readings follow each other by a quarter to three quarters of a minute."""
    return recorded | {"time_s": np.cumsum(random.uniform(15, 45, len(recorded["time_s"])))}


def ballbar(random: np.random.Generator, placings: int = 20, repeats: int = 2) -> Placed:
    """A bar anyhow in the volume."""
    design = bars(random, placings, repeats)
    design.recorded = _timed(random, design.recorded)
    return _bar(design)


def _bar(design: Design, **more: object) -> Placed:
    outward = design.extra["outward"]
    along = np.where((design.point == 1)[:, None], -outward, outward)
    own = np.zeros_like(outward)
    own[:, 0] = np.where(design.point == 1, -0.5, 0.5) * design.length
    axes = np.zeros((len(own), 3, 3))
    axes[:, 0] = along
    return _placed(design, node=design.point.copy(), own=own, axes=axes, **more)


LINES = np.array([
    [1, 0, 0], [0, 1, 0], [0, 0, 1], [1, 1, 0], [1, 0, 1], [1, 1, 1], [1, -1, 1],
    [0, 1, 1], [1, -1, 0], [1, 0, -1], [0, 1, -1], [1, 1, -1],
], dtype=float)  # fmt: skip
"""Along which a step gauge lies."""


def gauge(random: np.random.Generator, *, equal: bool = False, count: int = 7) -> Placed:
    """Faces of a step gauge there and back, twice: some lines and unequal steps, or the axes and twelve equal steps."""
    lines = np.eye(3)
    faces = np.arange(12) * float(random.choice([25.0, 30.0, 36.0]))
    if not equal:
        lines = LINES[:count]
        faces = np.concatenate([[0.0], np.sort(random.choice(np.arange(1, 23) * 20.0, 5, replace=False))])
    parts: dict[str, list] = {
        "true": [],
        "measurement": [],
        "point": [],
        "repeat": [],
        "node": [],
        "sense": [],
        "line": [],
    }
    for number, line in enumerate(unit(lines), 1):
        room = np.ptp(TRAVEL, axis=1) - np.abs(line) * faces[-1]
        free = room * random.uniform(0.1, 0.9, 3)
        start = np.where(line < 0, TRAVEL[:, 1] - free, TRAVEL[:, 0] + free)
        for repeat in (1, 2):
            order = np.concatenate([np.arange(len(faces)), np.arange(len(faces))[::-1]])
            many = len(order)
            parts["true"].append(start + faces[order, None] * line)
            parts["node"].append(order + 1)
            parts["measurement"].append(np.full(many, number))
            parts["point"].append(np.arange(1, many + 1))
            parts["repeat"].append(np.full(many, repeat))
            parts["sense"].append(np.repeat([1.0, -1.0], many // 2)[:, None] * np.sign(line))
            parts["line"].append(np.tile(line, (many, 1)))
    one = {name: np.concatenate(values) for name, values in parts.items()}
    n, line, sense, node = len(one["true"]), one.pop("line"), one.pop("sense"), one.pop("node")
    D = np.zeros((n, n, 3))
    D[np.arange(n), np.arange(n)] = line
    own, axes = np.zeros((n, 3)), np.zeros((n, 3, 3))
    own[:, 0], axes[:, 0] = faces[node - 1], line
    series = 4 * one["measurement"] + one["repeat"]
    recorded = {"reference_mm": own[:, 0]} | _timed(random, surroundings(random, series, sense))
    free = (one["measurement"][:, None] == np.unique(one["measurement"])).astype(float)
    design = Design("step_gauge", **one, recorded=recorded, extra={}, D=D.reshape(n, -1), free=free, noise=1.0, size=None,
                    length=None)  # fmt: skip
    return _placed(design, node=node, own=own, axes=axes)


def plate(random: np.random.Generator, ways: int = 3) -> Placed:
    """Sixteen balls 110 mm apart, each way twice."""
    grid = np.array([[i, j, 0.0] for j in range(4) for i in range(4)]) * 110.0
    chosen = random.choice(list(WAYS), ways, replace=False)
    true, axes = [], []
    for name in chosen:
        way = np.array(WAYS[str(name)], dtype=float)
        one = (grid - grid.mean(axis=0)) @ way
        room = 0.5 * np.ptp(TRAVEL, axis=1) - np.abs(one).max(axis=0) - 5
        one = one + TRAVEL.mean(axis=1) + room * random.uniform(-0.9, 0.9, 3)
        true += [one, one]
        axes += [np.tile(way, (32, 1, 1))]
    t, count = np.vstack(true), len(grid)
    n = len(t)
    measurement = np.repeat(np.arange(1, ways + 1), 2 * count)
    repeat, node = np.tile(np.repeat([1, 2], count), ways), np.tile(np.arange(1, count + 1), 2 * ways)
    columns = []
    for k in np.unique(measurement):
        inside = (measurement == k)[:, None]
        centred = t - t[measurement == k].mean(axis=0)
        columns += [inside * np.eye(3)[i] for i in range(3)]
        columns += [inside * np.cross(np.eye(3)[i], centred) for i in range(3)]
    recorded = {f"reference_{a}_mm": np.tile(grid[:, i], 2 * ways) for i, a in enumerate("xyz")}
    recorded |= _timed(random, surroundings(random, 4 * measurement + repeat, random.choice([-1.0, 1.0], (n, 3))))
    design = Design("plate", t, measurement, node, repeat, recorded, {}, np.eye(3 * n),
                    np.column_stack([column.ravel() for column in columns]), 1.0, None, None)  # fmt: skip
    return _placed(design, node=node, own=np.tile(grid, (2 * ways, 1)), axes=np.concatenate(axes))


def sphere(random: np.random.Generator) -> Placed:
    """Twenty-five points of the upper half of a sphere in three places, twice each."""
    radius, places, count = 15.0, 3, 25
    height, turn = 1 - (np.arange(count) + 0.5) / (count + 2), np.pi * (1 + 5**0.5) * np.arange(count)
    flat = np.sqrt(1 - height**2)
    one = np.column_stack([flat * np.cos(turn), flat * np.sin(turn), height])
    centres = TRAVEL[:, 0] + 30 + random.random((places, 3)) * (np.ptp(TRAVEL, axis=1) - 60)
    normals = np.tile(one, (2 * places, 1))
    n = len(normals)
    measurement = np.repeat(np.arange(1, places + 1), 2 * count)
    repeat, node = np.tile(np.repeat([1, 2], count), places), np.tile(np.arange(1, count + 1), 2 * places)
    D = np.zeros((n, n, 3))
    D[np.arange(n), np.arange(n)] = normals
    towards = -np.sign(np.where(np.abs(normals) > 0.3, normals, 0.0))
    recorded = {f"n{a}": normals[:, i] for i, a in enumerate("xyz")}
    recorded |= _timed(random, surroundings(random, 4 * measurement + repeat, towards))
    design = Design(
        "sphere", np.repeat(centres, 2 * count, axis=0) + radius * normals, measurement, node, repeat, recorded, {},
        D.reshape(n, -1), np.hstack([(measurement == k)[:, None] * normals for k in np.unique(measurement)]), 1.0,
        np.ones((n, 1)), 2 * radius,
    )  # fmt: skip
    axes = np.zeros((n, 3, 3))
    axes[:, 0] = normals
    return _placed(design, node=node, own=np.tile([radius, 0, 0], (n, 1)), axes=axes)


@cache
def _read(example: str) -> tuple[np.ndarray, np.ndarray]:
    """Ends of the real bars as scale readings (bars, 2, 3), the copied one left out, and their lengths' residuals, mm."""
    with (EXAMPLES / example / "ballbar.csv").open(encoding="utf-8") as file:
        rows = [row for row in csv.DictReader(file) if int(row["measurement"]) != COPIED]
    ends = np.array([[float(row[f"{a}_mm"]) for a in "xyz"] for row in rows]).reshape(-1, 2, 3) + ORIGIN
    deviation = (
        np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1) - LENGTH
    )  # a size of its own would be the three scales again
    along, columns = unit(ends[:, 1] - ends[:, 0]), []
    for name in SIX:
        e = KNOWN[name](ends.reshape(-1, 3), {}).reshape(-1, 2, 3)
        columns.append(-np.sum(along * (e[:, 1] - e[:, 0]), axis=1))
    A = np.column_stack(columns)
    A = A / np.linalg.norm(A, axis=0)
    return ends, deviation - A @ np.linalg.lstsq(A, deviation, rcond=None)[0]


def real_bars(random: np.random.Generator) -> Placed:
    """The bars of the DEA Iota 1102 where they stood; what six factors leave of a recording is kept as its noise."""
    example = str(random.choice(["iota-1102-20C", "iota-1102-20C-compensated"]))
    (_, residuals), (ends, _) = _read(example), _read("iota-1102-20C-compensated")
    count, length = len(ends), LENGTH
    along = unit(ends[:, 1] - ends[:, 0])
    middle = ends.mean(axis=1)
    true = np.stack([middle - 0.5 * length * along, middle + 0.5 * length * along], axis=1).reshape(-1, 3)
    outward = np.stack([-along, along], axis=1).reshape(-1, 3)
    D = np.zeros((count, 2 * count, 3))
    rows = np.arange(count)
    D[rows, 2 * rows], D[rows, 2 * rows + 1] = -along, along
    design = Design(
        "ballbar", true, np.repeat(rows + 1, 2), np.tile([1, 2], count), np.ones(2 * count, dtype=int), {},
        {"outward": outward, "length": length}, D.reshape(count, -1), np.zeros((count, 0)), np.sqrt(2), np.ones((count, 1)),
        length,
    )  # fmt: skip
    signs = random.choice([-1.0, 1.0], count)
    return _bar(design, origin=ORIGIN, residuals=signs * residuals[random.permutation(count)])
