"""What is reproduced of the 2004 thesis' compensation, and what is not: the figures of docs/machine/harris-2004.md.

Run:  python benchmarks/compensation/harris_2004.py
"""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np
from scipy.optimize import differential_evolution, minimize

from cmm_uq.machine.physics.compensation import Compensation, PointConditions
from cmm_uq.machine.physics.digitizer import euler_313
from cmm_uq.machine.physics.error_map import read_error_map
from cmm_uq.machine.physics.map_interpolation import ErrorMaps

ROOT = Path(__file__).parents[2]
MAPS = ErrorMaps(
    [read_error_map(ROOT / "tests/machine/physics/harris2004/error_map_20C.csv").with_squareness_arcsec(-173, -19, 21)]
)
OFFSET = np.array([1.001, 264.505, 129.575])
GROUPS = np.array([0] * 4 + [1] * 6 + [0] * 4 + [1, 2, 2, 0, 3, 3])
"""Positions whose centres moved alike, hence one pose: 1–4, 11–14 and 18; 5–10 and 15; 16, 17; 19, 20."""


def centres(job: str) -> np.ndarray:
    with (ROOT / "examples" / job / "ballbar.csv").open(encoding="utf-8") as file:
        return np.array([[float(row[f"{a}_mm"]) for a in "xyz"] for row in csv.DictReader(file)]).reshape(20, 2, 3)


BEFORE, AFTER = centres("iota-1102-20C"), centres("iota-1102-20C-compensated")


def rms_um(values: np.ndarray) -> float:
    return float(np.sqrt(np.mean(values**2)) * 1e3)


def bars(spheres: np.ndarray) -> np.ndarray:
    return spheres[:, 1] - spheres[:, 0]


def errors(readings: np.ndarray, tip: np.ndarray | None = None) -> tuple[np.ndarray, int]:
    when = PointConditions(tip=None if tip is None else tip.reshape(-1, 3))
    e, outside = Compensation(MAPS, beyond="extrapolate").error(readings.reshape(-1, 3), when)
    return e.reshape(20, 2, 3), int(outside.sum())


def posed(parameters: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Scale readings, and the digitizer's offset, for the place of the reference sphere and one γ a group."""
    to_mount = np.array([euler_313(np.pi / 2, np.pi / 2, g) @ OFFSET for g in parameters[3:][GROUPS]])
    to_mount = np.repeat(to_mount[:, None], 2, axis=1)
    return BEFORE + parameters[:3] + to_mount, -to_mount


def report(title: str, readings: np.ndarray, tip: np.ndarray | None = None) -> None:
    e, outside = errors(readings, tip)
    ours = BEFORE + e
    lengths = [np.linalg.norm(bars(s), axis=1) for s in (BEFORE, AFTER, ours)]
    gap = bars(ours) - bars(AFTER)
    print(f"\n{title}; {outside} of 40 centres beyond the map")
    print(f"  bar vectors, a component: {rms_um(gap):.2f} µm of {rms_um(bars(BEFORE) - bars(AFTER)):.1f} µm;"
          f" without position 19: {rms_um(np.delete(gap, 18, axis=0)):.2f} µm")  # fmt: skip
    print(f"  lengths: {rms_um(lengths[2] - lengths[1]):.2f} µm of {rms_um(lengths[0] - lengths[1]):.1f} µm")
    print(f"  centres, a component: {rms_um(ours - AFTER):.2f} µm of {rms_um(BEFORE - AFTER):.1f} µm")
    before, published, found = (f"{s.std(ddof=1) * 1e3:.1f}" for s in lengths)
    print(f"  rms accuracy error: {before} → {found} µm (published {published})")


def main() -> None:
    report("one origin for all poses, as given: 805, 303, -294", BEFORE + np.array([805.0, 303.0, -294.0]))

    def bar_misfit(origin: np.ndarray) -> float:
        e, outside = errors(BEFORE + origin)
        return rms_um(bars(e) - bars(AFTER) + bars(BEFORE)) + outside

    starts = np.array([805.0, 303.0, -294.0]) + np.random.default_rng(1).normal(size=(8, 3)) * [40, 20, 40]
    fits = [minimize(bar_misfit, s, method="Nelder-Mead", options={"xatol": 0.1, "fatol": 1e-4}) for s in starts]
    best = min(fits, key=lambda f: f.fun)
    report(f"one origin, fitted to the bars: {np.round(best.x)}", BEFORE + best.x)

    for title, turned in (("offset not turned", False), ("offset turned with the mount, eq. 35", True)):

        def centre_misfit(parameters: np.ndarray, turned: bool = turned) -> float:
            readings, tip = posed(parameters)
            e, outside = errors(readings, tip if turned else None)
            return rms_um(e - AFTER + BEFORE) + outside

        bounds = [(550, 850), (230, 320), (-560, -480), *(np.radians([g - 10, g + 10]) for g in (0, 0, -45, -60))]
        rough = differential_evolution(centre_misfit, bounds, seed=1, maxiter=100, popsize=8, polish=False)
        best = minimize(
            centre_misfit, rough.x, method="Nelder-Mead", options={"maxiter": 6000, "xatol": 1e-3, "fatol": 1e-4}
        )
        print(f"\nplace of the sphere {np.round(best.x[:3])} mm, γ {np.round(np.degrees(best.x[3:]), 1)}°", end="")
        readings, tip = posed(best.x)
        report(f"four poses, fitted to the centres, {title}", readings, tip if turned else None)


if __name__ == "__main__":
    main()
