"""Recordings and predictions of them by plain equations, without any use of the code under test.

A bar in places of its own is seen by a machine with some errors, and by a simulation of that machine with others. What either
indicates of a true point follows by iteration from  true = indicated + e.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np
import pandas as pd

import cmm_uq
from cmm_uq.base.points import Floats
from cmm_uq.jobs.job import Job

ARCSEC = np.pi / 648000
LENGTH = 400.0
Errors = Callable[[Floats], Floats]


def errors(scale_x: float = 0.0, scale_y: float = 0.0, square_xy: float = 0.0, bow_x_y: float = 0.0) -> Errors:
    """E (n, 3), mm, of scales (ppm), a squareness (″) and a bow of X along Y (µm) over 900 mm."""

    def e(xyz: Floats) -> Floats:
        x, y, z = xyz.T
        bow = 1e-3 * bow_x_y * (1 - (2 * x / 900 - 1) ** 2)
        return np.column_stack([1e-6 * scale_x * x - square_xy * ARCSEC * y, 1e-6 * scale_y * y + bow, 0 * z])

    return e


def shown(true: Floats, e: Errors) -> Floats:
    """What a machine with these errors shows of true points."""
    found = true
    for _ in range(30):
        found = true - e(found)
    return found


def placed_bars(count: int = 24, seed: int = 7) -> Floats:
    """True ends (2·count, 3) of bars in random places of a machine of 900 × 550 × 500 mm."""
    random = np.random.default_rng(seed)
    direction = random.standard_normal((count, 3))
    half = 0.5 * LENGTH * direction / np.linalg.norm(direction, axis=1, keepdims=True)
    low, high = np.abs(half), np.array([900, 550, 500]) - np.abs(half)
    middle = low + (high - low) * random.random((count, 3))
    return np.stack([middle - half, middle + half], axis=1).reshape(-1, 3)


def table(xyz: Floats, **columns: Floats) -> pd.DataFrame:
    """Points of bars as a table: two a measurement."""
    numbers = {"measurement": np.arange(len(xyz)) // 2 + 1, "point": np.arange(len(xyz)) % 2 + 1}
    return pd.DataFrame(numbers | {f"{a}_mm": xyz[:, i] for i, a in enumerate("xyz")} | columns)


def recorded(true: Floats, e: Errors, noise_um: float = 1.0, seed: int = 1) -> pd.DataFrame:
    """A recording, with white noise."""
    noise = 1e-3 * noise_um * np.random.default_rng(seed).standard_normal(true.shape)
    return table(shown(true, e) + noise)


def predicted(true: Floats, e: Errors, aside_mm: float = 1.0, seed: int = 2) -> Floats:
    """What a simulation says of the bars, which it takes to lie by up to a millimetre or so elsewhere."""
    moved = true + aside_mm * np.repeat(np.random.default_rng(seed).uniform(-1, 1, (len(true) // 2, 3)), 2, axis=0)
    return shown(moved, e)


def job(points: pd.DataFrame, prediction: pd.DataFrame | None = None, **simulation: object) -> Job:
    """A job of such a recording; ``simulation`` are the keys of its table."""
    named: Mapping[str, object] = {"file": "predicted.csv", **simulation} if prediction is not None else simulation
    return cmm_uq.job(
        points, machine={"name": "M", "travel_mm": {"x": [0, 900], "y": [0, 550], "z": [0, 500]}},
        artefact={"kind": "ballbar", "length_mm": LENGTH, "u_um": 0.3}, effects=["scale_x"],
        files={} if prediction is None else {"predicted.csv": prediction}, **({"simulation": named} if named else {}),
    )  # fmt: skip
