"""Recordings of artefacts: where the true points lie, what is recorded beside them, and what their placing leaves free."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from benchmarks.concealed.physics import TRAVEL


@dataclass
class Design:
    """True points t (n, 3); D turns displacements (3n) into observations; ``free`` are columns (m, q) of the placing.

    ``noise`` is the standard deviation of an observation over that of a coordinate; ``size`` a column for the artefact's
    size, free without a certificate.
    """

    kind: str
    true: np.ndarray
    measurement: np.ndarray
    point: np.ndarray
    repeat: np.ndarray
    recorded: dict
    extra: dict
    D: np.ndarray
    free: np.ndarray
    noise: float
    size: np.ndarray | None
    length: float | None


def surroundings(random: np.random.Generator, series: np.ndarray, approach: np.ndarray | None) -> dict:
    """What is recorded beside n points; ``series`` (n,) tells which were measured under one load."""
    n = len(series)
    warm = 20 + np.cumsum(random.normal(0, 0.9 / np.sqrt(n), n))
    recorded = {} if approach is None else {f"approach_{a}": approach[:, i] for i, a in enumerate("xyz")}
    recorded |= {f"temp_{a}_c": warm + random.normal(0, 0.5) + 0.6 * random.standard_normal(n) for a in "xyz"}
    recorded["temp_artefact_c"] = warm + 0.7 * random.standard_normal(n)
    recorded["temp_table_top_c"] = warm + 0.8 * random.standard_normal(n)
    recorded["temp_table_bottom_c"] = warm + 0.8 * random.standard_normal(n) - 0.5
    recorded["time_s"] = np.arange(n) * 30.0
    recorded["load_kg"] = np.round(random.uniform(5, 60, series.max() + 1), 1)[series]
    return recorded


def unit(v: np.ndarray) -> np.ndarray:
    return v / np.linalg.norm(v, axis=-1, keepdims=True)


def ballbar(random: np.random.Generator, placings: int, repeats: int) -> Design:
    length = float(random.uniform(350, 450))
    half = 0.5 * length * unit(random.standard_normal((placings, 3)))
    room = np.maximum(TRAVEL[:, 1] - TRAVEL[:, 0] - 2 * np.abs(half), 0)
    middle = TRAVEL[:, 0] + np.abs(half) + room * random.random((placings, 3))
    one = np.stack([middle - half, middle + half], axis=1)
    true = np.repeat(one, repeats, axis=0).reshape(-1, 3)
    n = len(true)
    measurement = np.repeat(np.arange(1, placings + 1), 2 * repeats)
    repeat = np.tile(np.repeat(np.arange(1, repeats + 1), 2), placings)
    direction = np.repeat(unit(half), repeats, axis=0)
    D = np.zeros((n // 2, n, 3))
    rows = np.arange(n // 2)
    D[rows, 2 * rows], D[rows, 2 * rows + 1] = -direction, direction
    outward = np.empty((n, 3))
    outward[0::2], outward[1::2] = -direction, direction
    recorded = surroundings(random, 4 * measurement + np.array(repeat), random.choice([-1.0, 1.0], (n, 3)))
    for name, values in recorded.items():
        if name.startswith("temp"):
            recorded[name] = np.repeat(values[::2], 2)
    return Design(
        "ballbar", true, measurement, np.tile([1, 2], n // 2), repeat, recorded, {"outward": outward, "length": length},
        D.reshape(len(rows), -1), np.zeros((len(rows), 0)), np.sqrt(2), np.ones((len(rows), 1)), length,
    )  # fmt: skip


def step_gauge(random: np.random.Generator) -> Design:
    """Seven lines: the axes, the diagonals of two faces, two of the body; seven faces there and back, twice."""
    lines = np.array([[1, 0, 0], [0, 1, 0], [0, 0, 1], [1, 1, 0], [1, 0, 1], [1, 1, 1], [1, -1, 1]], dtype=float)
    pitch = np.sort(random.choice(np.arange(1, 23) * 20.0, 6, replace=False))
    faces = np.concatenate([[0.0], pitch])
    true, measurement, repeat, reference, approach, directions = [], [], [], [], [], []
    for k, line in enumerate(unit(lines), 1):
        room = TRAVEL[:, 1] - TRAVEL[:, 0] - np.abs(line) * faces[-1]
        start = np.where(line < 0, TRAVEL[:, 1], TRAVEL[:, 0]) + np.sign(line + 1e-9) * room * random.uniform(
            0.1, 0.9, 3
        )
        for r in (1, 2):
            for sense in (1, -1):
                order = faces[::sense]
                true += [start + f * line for f in order]
                reference += list(order)
                approach += [sense * np.sign(line)] * len(order)
                directions += [line] * len(order)
                measurement += [k] * len(order)
                repeat += [r] * len(order)
    n = len(true)
    directions = np.array(directions)
    D = np.zeros((n, n, 3))
    D[np.arange(n), np.arange(n)] = directions
    measurement = np.array(measurement)
    point = np.tile(np.arange(1, 2 * len(faces) + 1), n // (2 * len(faces)))
    free = (measurement[:, None] == np.unique(measurement)).astype(float)
    recorded = {"reference_mm": np.array(reference)} | surroundings(
        random, 4 * measurement + np.array(repeat), np.array(approach)
    )
    return Design(
        "step_gauge", np.array(true), measurement, point, np.array(repeat), recorded, {}, D.reshape(n, -1), free, 1.0, None,
        None,
    )  # fmt: skip


def plate(random: np.random.Generator) -> Design:
    """Twenty-five balls 90 mm apart: two heights of XY, XZ, YZ and one tilted, twice each."""
    grid = np.array([[i, j, 0.0] for j in range(5) for i in range(5)]) * 90.0
    frames = [
        (np.eye(3), [random.uniform(50, 480), random.uniform(30, 200), -60.0]),
        (np.eye(3), [random.uniform(50, 480), random.uniform(30, 200), -440.0]),
        (np.array([[1, 0, 0], [0, 0, 1], [0, 1, 0]]), [random.uniform(50, 480), random.uniform(100, 500), -450.0]),
        (np.array([[0, 1, 0], [0, 0, 1], [1, 0, 0]]), [random.uniform(100, 800), random.uniform(30, 200), -450.0]),
        (
            np.array([[0.8, 0, 0.6], [0, 1, 0], [0.6, 0, -0.8]]),
            [random.uniform(50, 500), random.uniform(30, 200), -350.0],
        ),
    ]
    true, measurement, repeat, free = [], [], [], []
    for k, (axes, start) in enumerate(frames, 1):
        one = np.array(start) + grid @ np.array(axes, dtype=float)
        for r in (1, 2):
            true.append(one)
            measurement += [k] * 25
            repeat += [r] * 25
    true = np.vstack(true)
    n = len(true)
    measurement = np.array(measurement)
    columns = []
    for k in np.unique(measurement):
        inside = (measurement == k)[:, None]
        centred = true - true[measurement == k].mean(axis=0)
        columns += [inside * np.eye(3)[i] for i in range(3)]
        columns += [inside * np.cross(np.eye(3)[i], centred) for i in range(3)]
    free = np.column_stack([column.ravel() for column in columns])
    recorded = {f"reference_{a}_mm": np.tile(grid[:, i], n // 25) for i, a in enumerate("xyz")}
    recorded |= surroundings(random, 4 * measurement + np.array(repeat), random.choice([-1.0, 1.0], (n, 3)))
    return Design(
        "plate", true, measurement, np.tile(np.arange(1, 26), n // 25), np.array(repeat), recorded, {}, np.eye(3 * n), free,
        1.0, None, None,
    )  # fmt: skip


def sphere(random: np.random.Generator) -> Design:
    """A sphere in four places, forty points on its upper half, twice each."""
    radius, places = 15.0, 4
    height = 1 - (np.arange(40) + 0.5) / 42
    turned = np.pi * (1 + 5**0.5) * np.arange(40)
    n_one = np.column_stack([np.sqrt(1 - height**2) * np.cos(turned), np.sqrt(1 - height**2) * np.sin(turned), height])
    centres = TRAVEL[:, 0] + 30 + random.random((places, 3)) * (TRAVEL[:, 1] - TRAVEL[:, 0] - 60)
    normals = np.tile(n_one, (2 * places, 1))
    n = len(normals)
    measurement = np.repeat(np.arange(1, places + 1), 80)
    repeat = np.tile(np.repeat([1, 2], 40), places)
    D = np.zeros((n, n, 3))
    D[np.arange(n), np.arange(n)] = normals
    free = np.hstack([(measurement == k)[:, None] * normals for k in np.unique(measurement)])
    recorded = {f"n{a}": normals[:, i] for i, a in enumerate("xyz")}
    recorded |= surroundings(
        random, 4 * measurement + np.array(repeat), -np.sign(np.where(np.abs(normals) > 0.3, normals, 0.0))
    )
    return Design(
        "sphere", np.repeat(centres, 80, axis=0) + radius * normals, measurement, np.tile(np.arange(1, 41), n // 40), repeat,
        recorded, {}, D.reshape(n, -1), free, 1.0, np.ones((n, 1)), 2 * radius,
    )  # fmt: skip
