"""How often the interval of a zone holds, by the true zone over its uncertainty: zones of points without a machine.

    python -m benchmarks.parts.zones [MEASUREMENTS]

Errors of one along each coordinate, 1500 measurements of each true zone by default, 2000 draws of errors each; the table is
that of docs/machine/parts.md. Then how often the upper end fails of a sum of two sides, with errors of 3 and 1 along them and
a part that is off in any direction.
"""

from __future__ import annotations

import sys

import numpy as np

from cmm_uq.analysis.parts.result import possible_interval
from cmm_uq.base.points import Floats
from tests.analysis.parts.test_zones import WIDTHS, turned_round

TIMES = (0.0, 0.25, 0.5, 1.0, 2.0, 5.0, 20.0)
"""True zones, of the uncertainty."""

DRAWS = 2000


def forms(count: int) -> dict[str, Floats]:
    """By name, (count,) deviations of the true part."""
    i = np.arange(count)
    if count < 12:
        return {"": 1.0 * (i == 0)}
    return {
        ", sin 2.1i + 0.3 cos i": np.sin(2.1 * i) + 0.3 * np.cos(i),
        ", a tilt": i - 0.5 * (count - 1),
        ", cos 2.1i": np.cos(2.1 * i),
    }


def held(name: str, shape: Floats, times: float, measurements: int, seed: int = 17) -> tuple[float, float]:
    """Share of the intervals that hold, and the mean length of one over the uncertainty."""
    random, (count, width) = np.random.default_rng(seed), WIDTHS[name]
    u = float(width(random.standard_normal((100_000, count))).std()) if count > 2 else 1.0
    true = times * u
    part, inside, length = true * shape / width(shape), 0, 0.0
    for _ in range(measurements):
        measured = part + random.standard_normal(count)
        inverted = turned_round(width, measured, random.standard_normal((DRAWS, count)))
        low, high = possible_interval(inverted(width(measured + random.standard_normal((DRAWS, count)))), 0.95)
        inside += low <= true <= high
        length += (high - low) / u
    return inside / measurements, length / measurements


def short(times: float, measurements: int, seed: int = 11) -> float:
    """Share of upper ends below a true sum of two sides, so many times the median of what a perfect part is measured as."""
    random, sides = np.random.default_rng(seed), np.array([3.0, 1.0])

    def width(z: Floats) -> Floats:
        return np.asarray(np.abs(z).sum(axis=-1))

    true, failed = times * float(np.median(width(sides * random.standard_normal((5000, 2))))), 0
    for _ in range(measurements):
        part = random.standard_normal(2)
        measured = true * part / width(part) + sides * random.standard_normal(2)
        inverted = turned_round(width, measured, sides * random.standard_normal((DRAWS, 2)))
        failed += (
            possible_interval(inverted(width(measured + sides * random.standard_normal((DRAWS, 2)))), 0.95)[1] < true
        )
    return failed / measurements


def main(measurements: int = 1500) -> None:
    """Print the table."""
    print("true zone over u:", *TIMES)
    for name, (count, _) in WIDTHS.items():
        for form, shape in forms(count).items():
            found = [held(name, shape, times, measurements) for times in TIMES]
            print(f"{name}{form}:", *(f"{100 * share:.1f} % ({length:.2f} u)" for share, length in found), flush=True)
    for times in (1.0, 3.0):
        print(f"upper end of {times:g} times the median too low: {100 * short(times, measurements):.1f} %", flush=True)


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
