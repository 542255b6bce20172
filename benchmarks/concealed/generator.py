"""Concealed cases: ballbar jobs with hidden effects, from physics written a second time.

Shares no code with the package: its own kinematics, its own noise, its own projection for the oracle's noncentrality.
Indicated points solve p + e(p) = t, where t are true points of a bar in random places.
"""

from __future__ import annotations

import csv
import hashlib
import json
from collections.abc import Callable
from pathlib import Path

import numpy as np

TRAVEL = np.array([[0.0, 900.0], [0.0, 600.0], [-500.0, 0.0]])
SECOND = np.pi / 648000
Error = Callable[[np.ndarray, dict], np.ndarray]


def component(axis: int, value: np.ndarray) -> np.ndarray:
    e = np.zeros((len(value), 3))
    e[:, axis] = value
    return e


def bow(a: int, b: int) -> Error:
    low, high = TRAVEL[a]
    return lambda p, c: component(b, 1e-3 * (1 - (2 * (p[:, a] - low) / (high - low) - 1) ** 2))


def turn(a: int, b: int) -> Error:
    def e(p: np.ndarray, c: dict) -> np.ndarray:
        angle = np.zeros_like(p)
        angle[:, b] = SECOND * (p[:, a] - TRAVEL[a, 0]) / 1000
        carried = p.copy()
        carried[:, 0] = 0
        if a == 1:
            carried[:, 1] = 0
        return np.cross(angle, carried)

    return e


def backlash(a: int) -> Error:
    return lambda p, c: component(a, 5e-4 * c[f"approach_{'xyz'[a]}"])


def warm(a: int) -> Error:
    return lambda p, c: component(a, 1e-6 * (c[f"temp_{'xyz'[a]}_c"] - 20) * p[:, a])


def wave(a: int) -> Error:
    return lambda p, c: component(a, 1e-3 * np.sin(2 * np.pi * p[:, a] / c["period"] + c["phase"]))


KNOWN: dict[str, Error] = {
    "scale_x": lambda p, c: component(0, 1e-6 * p[:, 0]),
    "scale_y": lambda p, c: component(1, 1e-6 * p[:, 1]),
    "scale_z": lambda p, c: component(2, 1e-6 * p[:, 2]),
    "squareness_xy": lambda p, c: component(0, -SECOND * p[:, 1]),
    "squareness_yz": lambda p, c: component(1, -SECOND * p[:, 2]),
    "squareness_zx": lambda p, c: component(0, -SECOND * p[:, 2]),
    **{f"straightness_{'xyz'[a]}_{'xyz'[b]}": bow(a, b) for a in range(3) for b in range(3) if a != b},
    "rotation_x_x": turn(0, 0), "rotation_x_y": turn(0, 1), "rotation_x_z": turn(0, 2), "rotation_y_x": turn(1, 0),
    "rotation_y_y": turn(1, 1),
    **{f"hysteresis_{a}": backlash(i) for i, a in enumerate("xyz")},
    **{f"thermal_scale_{a}": warm(i) for i, a in enumerate("xyz")},
    **{f"periodic_scale_{a}": wave(i) for i, a in enumerate("xyz")},
}  # fmt: skip

OUTSIDE: dict[str, Error] = {
    "step in x": lambda p, c: component(1, 1e-3 * (p[:, 0] > 450)),
    "three waves of y along z": lambda p, c: component(2, 1e-3 * np.sin(3 * np.pi * p[:, 1] / 600)),
    "two waves of x along x, growing": lambda p, c: component(0, 1e-3 * np.sin(2 * np.pi * (p[:, 0] / 900) ** 2 * 2)),
    "cubic of z along y": lambda p, c: component(1, 1e-3 * 4 * ((p[:, 2] + 250) / 250) ** 3),
    "kink of y along y": lambda p, c: component(1, 1e-3 * np.abs(p[:, 1] - 300) / 100),
}

SIX = ["scale_x", "scale_y", "scale_z", "squareness_xy", "squareness_yz", "squareness_zx"]


def indicated(true: np.ndarray, error: Callable[[np.ndarray], np.ndarray]) -> np.ndarray:
    p = true.copy()
    for _ in range(30):
        p = true - error(p)
    return p


def lengths(p: np.ndarray) -> np.ndarray:
    ends = p.reshape(-1, 2, 3)
    return np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)


def case(seed: int, kind: str, folder: Path, placings: int, repeats: int) -> dict:
    """Write one job and return its truth."""
    random = np.random.default_rng(seed)
    length, sigma = float(random.uniform(350, 450)), float(random.uniform(0.7, 2.0)) * 1e-3
    true, columns, number, repeat = design(random, placings, repeats, length)
    columns |= {"period": float(np.exp(random.uniform(np.log(40), np.log(300)))), "phase": float(random.uniform(-3, 3))}
    named = list(SIX) if random.random() < 0.7 else list(random.choice(SIX, 3, replace=False))
    base = {name: random.normal(0, 40) for name in named}
    hidden = hide(random, kind, named)

    def e(p: np.ndarray, extra: dict[str, float]) -> np.ndarray:
        total = np.zeros_like(p)
        for name, size in (*base.items(), *extra.items()):
            total += size * (KNOWN.get(name) or OUTSIDE[name])(p, columns)
        return total

    plain = lengths(indicated(true, lambda p: e(p, {})))
    certified = random.random() < 0.7
    columns_of = [lengths(indicated(true, lambda p, n=n: e(p, {n: 0.0}) + KNOWN[n](p, columns))) - plain for n in named]
    if not certified:
        columns_of.append(np.ones_like(plain))
    rest = np.linalg.svd(np.column_stack(columns_of))[0][:, len(columns_of) :] if columns_of else np.eye(len(plain))
    root_lambda, sizes = {}, {}
    for name in hidden:
        unit = lengths(indicated(true, lambda p, n=name: e(p, {n: 1.0}))) - plain
        strength = np.linalg.norm(rest.T @ unit) / (sigma * np.sqrt(2))
        wanted = float(random.uniform(6, 15) if placings > 20 else random.uniform(4.5, 7))
        root_lambda[name] = wanted
        sizes[name] = float(np.clip(wanted / max(strength, 1e-12), 0, 1e6) * random.choice([-1, 1]))
    p = indicated(true, lambda p: e(p, sizes)) + noise(random, kind, sigma, number, repeat)
    stated = {"noise stated wrongly": 0.5}.get(kind, 1.0) * sigma * 1e3
    write(
        folder,
        p,
        columns,
        number,
        repeat,
        named,
        length if certified else None,
        stated if random.random() < 0.8 else None,
    )
    return {"kind": kind, "named": named, "hidden": sizes, "root_lambda": root_lambda, "sigma_um": sigma * 1e3,
            "period": columns["period"], "placings": placings}  # fmt: skip


def design(random: np.random.Generator, placings: int, repeats: int, length: float) -> tuple:
    direction = random.standard_normal((placings, 3))
    half = 0.5 * length * direction / np.linalg.norm(direction, axis=1, keepdims=True)
    room = np.maximum(TRAVEL[:, 1] - TRAVEL[:, 0] - 2 * np.abs(half), 0)
    middle = TRAVEL[:, 0] + np.abs(half) + room * random.random((placings, 3))
    one = np.stack([middle - half, middle + half], axis=1)
    true = np.repeat(one, repeats, axis=0).reshape(-1, 3)
    number = np.repeat(np.arange(1, placings + 1), 2 * repeats)
    repeat = np.tile(np.repeat(np.arange(1, repeats + 1), 2), placings)
    n = len(true)
    warm = 20 + np.cumsum(random.normal(0, 0.15, n))
    columns = {f"approach_{a}": random.choice([-1.0, 1.0], n) for a in "xyz"}
    columns |= {f"temp_{a}_c": warm + random.normal(0, 0.5) + 0.6 * random.standard_normal(n) for a in "xyz"}
    columns["time_s"] = np.arange(n) * 30.0
    return true, columns, number, repeat


def hide(random: np.random.Generator, kind: str, named: list[str]) -> list[str]:
    free = [name for name in KNOWN if name not in named]
    if kind in ("one", "two"):
        return list(random.choice(free, 1 if kind == "one" else 2, replace=False))
    return [str(random.choice(list(OUTSIDE)))] if kind == "outside" else []


def noise(random: np.random.Generator, kind: str, sigma: float, number: np.ndarray, repeat: np.ndarray) -> np.ndarray:
    n = len(number)
    if kind == "correlated":
        e = np.zeros((n, 3))
        e[0] = random.standard_normal(3)
        for i in range(1, n):
            e[i] = 0.8 * e[i - 1] + 0.6 * random.standard_normal(3)
        return sigma * e
    if kind == "tails":
        return sigma * random.standard_t(4, (n, 3)) / np.sqrt(2)
    e = sigma * random.standard_normal((n, 3))
    if kind == "set-up":
        _, which = np.unique(np.column_stack([number, np.tile([1, 2], n // 2)]), axis=0, return_inverse=True)
        e += 0.5 * sigma * random.standard_normal((which.max() + 1, 3))[which.ravel()]
    return e


def write(folder: Path, p: np.ndarray, columns: dict, number: np.ndarray, repeat: np.ndarray, named: list[str],
          length: float | None, stated_um: float | None) -> None:  # fmt: skip
    folder.mkdir(parents=True, exist_ok=True)
    recorded = {name: values for name, values in columns.items() if isinstance(values, np.ndarray)}
    with (folder / "bar.csv").open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(["measurement", "point", "repeat", "x_mm", "y_mm", "z_mm", *recorded])
        for i in range(len(p)):
            row = [
                number[i],
                i % 2 + 1,
                repeat[i],
                *(f"{v:.6f}" for v in p[i]),
                *(f"{v[i]:.4f}" for v in recorded.values()),
            ]
            writer.writerow(row)
    certified = f"length_mm = {length!r}\nu_um = 0.3\n" if length else ""
    stated = f"u_coordinate_um = {stated_um:.4f}\n" if stated_um else ""
    (folder / "job.toml").write_text(
        f'[job]\nid = "concealed"\ndate = 2026-01-01\n[machine]\nname = "simulated"\n'
        f"travel_mm = {{ x = [0, 900], y = [0, 600], z = [-500, 0] }}\n"
        f'[artefact]\nkind = "ballbar"\n{certified}[recording]\nfile = "bar.csv"\n{stated}'
        f"[model]\neffects = {json.dumps(named)}\n",
        encoding="utf-8",
    )


def seal(truths: list[dict]) -> str:
    """SHA-256 of the truth, to be written down before any case is diagnosed."""
    return hashlib.sha256(json.dumps(truths, sort_keys=True).encode()).hexdigest()
