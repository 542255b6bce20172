"""How often U = 2u of a triangle's and a bar's figures by the laboratory's own rule holds them: a table in docs/standards.md.

Run:  PYTHONPATH=. nice python benchmarks/artefacts/own_rule_coverage.py [RECORDINGS]

Blocks, cylinders and the bar's length are drawn anew for each recording, within what the job states; the figure that is true
is that of the same readings against what was drawn, worked out here. Readings scatter white, walk, have heavy tails (t of
three degrees of freedom) or shift with each placing, 1 µm each: scatter is tested, and must not change how often U holds.
"""

from __future__ import annotations

import sys
from collections import Counter
from collections.abc import Callable

import numpy as np

from cmm_uq.artefacts import artefact_facts
from cmm_uq.artefacts.bryan import Bryan
from cmm_uq.artefacts.triangle import Triangle
from cmm_uq.base.points import Floats, Machine, Points

MACHINE = Machine("bridge", "XYZ", np.array([[0.0, 900.0], [0.0, 1200.0], [-600.0, 0.0]]))
BLOCKS, CYLINDERS, BAR, U_UM = np.array([480.0, 280.0, 380.0]), np.full(3, 20.0), 250.0, 0.2
Noise = Callable[[np.random.Generator, int], Floats]
NOISES: dict[str, Noise] = {
    "white": lambda random, n: random.standard_normal((n, 3)),
    "walk": lambda random, n: np.cumsum(random.standard_normal((n, 3)), axis=0) / np.sqrt(n / 4),
    "heavy tails": lambda random, n: random.standard_t(3, (n, 3)) / np.sqrt(3),
    "by set-up": lambda random, n: np.sqrt(0.5) * (random.standard_normal((n, 3))
                                                   + np.repeat(random.standard_normal((n // 9 + 1, 3)), 9, axis=0)[:n]),
}  # fmt: skip


def sides_of(blocks: Floats, cylinders: Floats) -> Floats:
    return np.asarray(blocks + 0.5 * (cylinders + np.roll(cylinders, -1)))


def corner_angles(a: Floats) -> Floats:
    """Angles (3,) at the corners of points (3, 3)."""
    to = [np.stack([a[(i + 1) % 3] - a[i], a[i - 1] - a[i]]) for i in range(3)]
    return np.array([np.arccos(u @ v / np.linalg.norm(u) / np.linalg.norm(v)) for u, v in to])


def body_of(sides: Floats) -> Floats:
    c, a, b = sides
    x = (b**2 + c**2 - a**2) / (2 * c)
    return np.array([[0.0, 0.0, 0.0], [c, 0.0, 0.0], [x, np.sqrt(b**2 - x**2), 0.0]])


def triangle(random: np.random.Generator, noise: Noise) -> dict[str, tuple[Floats, Floats, Floats]]:
    """Of each figure what is stated, its u, and what is true, mm."""
    blocks, cylinders = (nominal + U_UM * 1e-3 * random.standard_normal(3) for nominal in (BLOCKS, CYLINDERS))
    sides, nominal = sides_of(blocks, cylinders), sides_of(BLOCKS, CYLINDERS)
    placed = [body_of(sides)[:, list(axes)] + [100.0, 200.0, -550.0] for axes in ((0, 1, 2), (2, 0, 1), (0, 2, 1))]
    xyz = np.vstack([one for one in placed for _ in range(3)])
    xyz = xyz + 1e-3 * noise(random, len(xyz))
    n = len(xyz)
    points = Points(xyz, np.arange(n) // 9 + 1, np.tile([1, 2, 3], n // 3), np.arange(n) // 3 % 3 + 1, MACHINE)
    facts = artefact_facts(kind="triangle", blocks_mm=BLOCKS.tolist(), cylinders_mm=CYLINDERS.tolist(),
                           u_blocks_um=U_UM, u_cylinders_um=U_UM)  # fmt: skip
    found = Triangle(facts, points).figures(np.ones(n, dtype=bool))
    each = xyz.reshape(-1, 3, 3)
    errors = np.linalg.norm(np.roll(each, -1, axis=1) - each, axis=2) - sides
    arms = np.minimum(nominal, np.roll(nominal, 1))
    arcs = np.array([corner_angles(one) - corner_angles(body_of(sides)) for one in each]) * arms
    true = {"error": errors.ravel(), "mean error": errors.mean(), "angle error": arcs.ravel(),
            "standard deviation of errors": errors.std(ddof=1)}  # fmt: skip
    return {f"triangle, {name}": (found[name].values, np.asarray(found[name].u), np.atleast_1d(value))
            for name, value in true.items()}  # fmt: skip


def bar(random: np.random.Generator, noise: Noise) -> dict[str, tuple[Floats, Floats, Floats]]:
    """Radii of a Bryan gauge about the centre that fits best with the length that is certified, and with the true one."""
    length, n = BAR + U_UM * 1e-3 * random.standard_normal(), 60
    directions = random.standard_normal((n, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    xyz = np.array([440.0, 500.0, -300.0]) + length * directions + 1e-3 * noise(random, n)
    points = Points(xyz, np.arange(1, n + 1), np.ones(n, dtype=np.int64), np.ones(n, dtype=np.int64), MACHINE)
    found = Bryan(artefact_facts(kind="bryan", length_mm=BAR, u_um=U_UM), points).figures(np.ones(n, dtype=bool))
    centre = np.array([440.0, 500.0, -300.0])
    for _ in range(20):
        away = xyz - centre
        radii = np.linalg.norm(away, axis=1)
        centre = centre + np.linalg.lstsq(away / radii[:, None], radii - length, rcond=None)[0]
    errors = np.linalg.norm(xyz - centre, axis=1) - length
    return {"Bryan gauge, error": (found["error"].values, np.asarray(found["error"].u), errors)}


def main(recordings: int) -> None:
    for name, noise in NOISES.items():
        held, half, count = Counter[str](), Counter[str](), Counter[str]()
        for seed in range(recordings):
            random = np.random.default_rng(seed)
            for figure, (value, u, true) in (triangle(random, noise) | bar(random, noise)).items():
                held[figure] += int(np.sum(np.abs(value - true) <= 2 * u))
                half[figure] += int(np.sum(np.abs(value - true) <= u))
                count[figure] += len(true)
        cells = (f"{name} {100 * held[name] / n:.1f} % (half {100 * half[name] / n:.1f})" for name, n in count.items())
        print(f"{name}: {'; '.join(cells)}")


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 300)
