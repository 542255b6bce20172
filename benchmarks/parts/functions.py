"""How often 95 % intervals of a function of one axis hold that is read at some places: a table in docs/machine/field.md.

Three functions at a time, drawn from a class and read with noise at places from 0.05 to 0.95 of the travel, are estimated by
the field's own waves and, beside them, by cosines over the travel alone, which have no slope at its ends; sizes of long and
short waves by the largest density of the readings. A constant is free, of a straightness a slope too, and no part of what
is counted, at 41 places of the travel; *ends* are the outer three at either side.

Run:  PYTHONPATH=. nice python benchmarks/parts/functions.py [TIMES]
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.optimize import minimize

from cmm_uq.base.points import Machine, Points
from cmm_uq.machine.model.field import curves

Array = np.ndarray
Draw = Callable[[np.random.Generator, Array], Array]
AT, NOISE, TOGETHER = np.linspace(0.0, 1.0, 41), 0.125, 3
ENDS = [0, 1, 2, -3, -2, -1]
CLASSES: Mapping[str, Draw] = {
    "bow": lambda random, u: random.normal(0, 4) * (1 - (2 * u - 1) ** 2),
    "straight line": lambda random, u: random.normal(0, 4) * (2 * u - 1),
    "bumps of random width": lambda random, u: np.sum(
        random.normal(0, 3, 6) * np.exp(-0.5 * ((u[:, None] - random.random(6)) / random.uniform(0.15, 0.6, 6)) ** 2),
        axis=1,
    ),
    "spline through four to seven knots": lambda random, u: (
        lambda n: CubicSpline(np.linspace(0, 1, n), random.normal(0, 2, n))(u)
    )(int(random.integers(4, 8))),
}


def waves(u: Array, name: str) -> tuple[Array, Array]:
    """The field's functions (n, k) for s = 1, µm or ″, and which of them are long, at places u of the travel of x."""
    machine = Machine(travel_mm=np.array([[0.0, 1000.0]] * 3))
    one = np.ones(len(u), dtype=np.int64)
    points = Points(np.column_stack([1000 * u, 1000 * np.ones((len(u), 2))]), one, np.arange(len(u)), one, machine)
    axis, per_unit = (1, 1e-3) if name == "straightness_x_y" else (0, -1000 * np.pi / 648000)
    parts = [curve for curve in curves() if curve.name == name]
    columns = [curve.basis(points)[:, axis] / per_unit * [c.prior_sd for c in curve.coefficients] for curve in parts]
    return np.hstack(columns), np.repeat(["long" in one.family for one in parts], [one.shape[1] for one in columns])


def cosines(u: Array, name: str) -> tuple[Array, Array]:
    k, allowed = np.arange(1, 9), 50 if name == "straightness_x_y" else 30
    return allowed * np.sqrt(2) * np.cos(np.pi * np.outer(u, k)) / k / np.sqrt(np.sum(1 / k**2.0)), k <= 2


def covariance(one: Array, other: Array, variances: Array) -> Array:
    return np.asarray(one * variances @ other.T)


def largest(seen: Array, columns: Array, long: Array, free: int) -> Array:
    """Variances of all columns, the last ``free`` wide open, where the density of the readings is largest."""

    def variances(log: Array) -> Array:
        return np.append(np.where(long, *np.exp(2 * log)), np.full(free, 1e4))

    def density(log: Array) -> float:
        L = np.linalg.cholesky(covariance(columns, columns, variances(log)) + NOISE**2 * np.eye(len(columns)))
        fit = 0.5 * np.sum(np.linalg.solve(L, seen.T) ** 2) + len(seen) * np.log(np.diag(L)).sum()
        return float(fit + 0.5 * np.sum(np.exp(2 * log)) - np.sum(log))

    return variances(minimize(density, np.log([0.1, 0.05]), method="Nelder-Mead").x)


def held(
    name: str, draw: Draw, basis: Callable[[Array, str], tuple[Array, Array]], count: int, times: int
) -> list[float]:
    """Parts of the intervals that hold, over the travel and at its ends; rms of the errors; rms of u."""
    read, free = np.linspace(0.05, 0.95, count), 2 if name.startswith("straightness") else 1
    (B, long), (E, _) = basis(read, name), basis(AT, name)
    B, E = np.hstack([B, np.vander(read, free)]), np.hstack([E, np.vander(AT, free)])
    less = np.eye(len(AT)) - E[:, -free:] @ np.linalg.pinv(E[:, -free:])
    found, errors, u = [], [], []
    for time in range(times):
        random = np.random.default_rng([time, count])
        true = np.array([draw(random, np.concatenate([read, AT])) for _ in range(TOGETHER)])
        seen = true[:, :count] + NOISE * random.standard_normal((TOGETHER, count))
        of = largest(seen, B, long, free)
        gain = np.linalg.solve(covariance(B, B, of) + NOISE**2 * np.eye(count), covariance(B, E, of)).T
        left = covariance(E, E, of) - gain @ covariance(B, E, of)
        off = (true[:, count:] - seen @ gain.T) @ less.T
        sd = np.sqrt(np.maximum(np.diag(less @ left @ less.T), 1e-12))
        found.append(np.abs(off) <= 1.96 * sd)
        errors.append(off**2)
        u.append(sd**2)
    every = np.array(found)
    return [
        100 * float(every.mean()),
        100 * float(every[..., ENDS].mean()),
        *(float(np.sqrt(np.mean(x))) for x in (errors, u)),
    ]


def main(times: int) -> None:
    print(
        "| function | read at | cosines over the travel: hold, at the ends, rms error, u | the field: the same |\n"
        + "| --- " * 4
        + "|"
    )
    for name in ("straightness_x_y", "rotation_x_z"):
        for kind, draw in CLASSES.items():
            if kind == "straight line" and name.startswith("straightness"):
                continue
            for count in (9, 20):
                each = [held(name, draw, basis, count, times) for basis in (cosines, waves)]
                cells = (f"{a:.1f}, {b:.1f} %, {c:.3f}, {d:.3f}" for a, b, c, d in each)
                print(f"| {name.partition('_')[0]}: {kind} | {count} | " + " | ".join(cells) + " |", flush=True)


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 200)
