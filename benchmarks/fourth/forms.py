"""Errors that no catalogue has, by functions of their own: a dictionary's, with the names that it has, and strangers."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from benchmarks.concealed.physics import Error
from benchmarks.third.forms import POSITIONS, Outside, Parameters

WARMTH = ("temp_x_c", "temp_y_c", "temp_z_c")
Curve = tuple[Callable[..., Any], dict[str, tuple[float, float]], str]
"""A function, between what its parameters lie, and of what it may be: places s, time t, warmth w, sides of approach a, two
places 2, a place and time or warmth m."""


def _ringing(u: np.ndarray, at: float, fades: float, period: float) -> np.ndarray:
    after = np.clip(u - at, 0, None)
    return np.where(u > at, np.exp(-after / fades) * np.cos(2 * np.pi * after / period), 0.0)


def _stairs(u: np.ndarray, seed: float) -> np.ndarray:
    random = np.random.default_rng(int(seed))
    edges = np.sort(random.random(6))
    return np.concatenate([[0.0], np.cumsum(random.normal(0, 1, 6))])[np.digitize(u, edges)]


def _spline(u: np.ndarray, seed: float) -> np.ndarray:
    """Through nine heights at random, by cosines from each to the next."""
    heights = np.random.default_rng(int(seed)).normal(0, 1, 9)
    k = np.clip((8 * u).astype(int), 0, 7)
    part = (1 - np.cos(np.pi * (8 * u - k))) / 2
    return heights[k] * (1 - part) + heights[k + 1] * part


def _fractal(u: np.ndarray, base: float, phase: float) -> np.ndarray:
    return np.sum([0.6**k * np.cos(2 * np.pi * base**k * u + phase * (k + 1)) for k in range(6)], axis=0)


TURN = (0.0, 2 * np.pi)
DICTIONARY: Mapping[str, Curve] = {
    "step": (lambda u, at: np.where(u < at, 0.0, 1.0), {"at": (0.2, 0.8)}, "sstw"),
    "dent": (lambda u, at, wide: np.exp(-np.square((u - at) / wide) / 2), {"at": (0.2, 0.8), "wide": (0.04, 0.15)}, "s"),
    "ramp": (lambda u, at: np.clip(u - at, 0, None), {"at": (0.3, 0.8)}, "sstw"),
    "cubic": (lambda u: np.power(2 * u - 1, 3), {}, "sst"),
    "saturating": (lambda u, at, wide: 1 - 2 / (1 + np.exp(2 * (u - at) / wide)),
                   {"at": (0.0, 0.7), "wide": (0.06, 0.3)}, "sstw"),
    "sawtooth": (lambda u, period, start: np.modf(u / period + start)[0], {"period": (0.18, 0.55), "start": (0, 1)}, "s"),
    "exponential": (lambda u, time: np.exp(-u / time), {"time": (0.06, 0.4)}, "t"),
    "sine": (lambda u, period, phase, harmonic, other: np.sin(2 * np.pi * u / period + phase)
             + harmonic * np.sin(4 * np.pi * u / period + other),
             {"period": (0.12, 0.7), "phase": TURN, "harmonic": (0.0, 0.8), "other": TURN}, "sst"),
    "product": (lambda u, v: (u - 0.5) * (v - 0.5) * 4, {}, "22m"),
    "bowl": (lambda u, v: np.hypot(2 * u - 1, 2 * v - 1) ** 2, {}, "2"),
    "sign": (lambda u: np.round(2 * u - 1), {}, "a"),
    "dead_zone": (lambda u, at, wide: u - at - np.clip(u - at, -wide, wide),
                  {"at": (0.35, 0.65), "wide": (0.1, 0.3)}, "sw"),
}  # fmt: skip
SEED = {"seed": (0.0, 2.0**31)}
OTHERS: Mapping[str, Curve] = {
    "stairs": (_stairs, SEED, "sst"),
    "spline": (_spline, SEED, "sst"),
    "ringing": (_ringing, {"at": (0.1, 0.5), "fades": (0.1, 0.4), "period": (0.1, 0.3)}, "st"),
    "fractal": (_fractal, {"base": (1.6, 2.4), "phase": TURN}, "s"),
    "pulses": (lambda u, period, duty, start: np.where((u / period + start) % 1 < duty, 1.0, 0.0),
               {"period": (0.2, 0.5), "duty": (0.15, 0.4), "start": (0, 1)}, "s"),
    "trapezium": (lambda u, at, flat, slope: np.clip((flat + slope - np.abs(u - at)) / slope, 0, 1),
                  {"at": (0.3, 0.7), "flat": (0.08, 0.2), "slope": (0.05, 0.15)}, "sst"),
    "beat": (lambda u, one, two, phase: np.sin(2 * np.pi * one * u) + np.sin(2 * np.pi * two * u + phase),
             {"one": (2.0, 4.0), "two": (4.4, 7.0), "phase": TURN}, "s"),
    "hill": (lambda u, v, at, by, wide: np.exp(-((u - at) ** 2 + (v - by) ** 2) / (2 * wide**2)),
             {"at": (0.25, 0.75), "by": (0.25, 0.75), "wide": (0.12, 0.25)}, "2"),
    "egg box": (lambda u, v, one, two, phase: np.sin(2 * np.pi * one * u + phase) * np.cos(2 * np.pi * two * v),
                {"one": (0.7, 1.8), "two": (0.7, 1.8), "phase": TURN}, "2"),
}  # fmt: skip


@dataclass(frozen=True)
class Cause(Outside):
    """An error whose own form is one of these; of a form that is asked for it is what an oracle tries."""

    def error(self, form: str | None = None, parameters: Parameters | None = None) -> Error:
        """For one micrometre, or µm/m."""
        if form is not None:
            return super().error(form, parameters)
        curve = (DICTIONARY | OTHERS)[self.form][0]  # type: ignore[operator]
        along = np.eye(3)[self.along]

        def e(p: np.ndarray, c: dict) -> np.ndarray:
            arm = p @ along / 1000 if self.scale else 1.0
            return np.outer(1e-3 * arm * curve(*self.covariates(p, c), **self.parameters), along)

        return e


def drawn(random: np.random.Generator, form: str, true: np.ndarray, columns: Mapping[str, np.ndarray]) -> Cause | None:
    """An error of a form, of covariates that are there; nothing where they are not."""
    _, ranges, able = (DICTIONARY | OTHERS)[form]  # type: ignore[operator]
    along, what = int(random.integers(3)), str(random.choice(list(able)))
    place = [POSITIONS[i] for i in random.permutation(3)]
    beside = "xyz".replace("xyz"[along], "")[int(random.integers(2))]
    of = {
        "s": place[:1],
        "2": place[:2],
        "t": ["time_s"],
        "w": [str(random.choice(WARMTH))],
        "a": [f"approach_{beside}"],
        "m": [place[0], str(random.choice(["time_s", *WARMTH]))],
    }[what]
    values = [true[:, POSITIONS.index(name)] if name in POSITIONS else columns.get(name) for name in of]
    if any(value is None or np.ptp(value) < 1e-6 for value in values):
        return None
    spans = tuple((float(np.min(value)), float(np.max(value))) for value in values)  # type: ignore[arg-type]
    scale = what in "twa" and bool(random.random() < 0.6)
    return Cause(
        form, tuple(of), spans, along, scale, {name: float(random.uniform(*ends)) for name, ends in ranges.items()}
    )
