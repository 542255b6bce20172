"""Writes ``predicted.csv`` of the example iota-1102-20C-against-simulation: by a simulation that is not this project's.

It stands for any program: equations written out here, without the package, and its own way of writing numbers, with
semicolons, decimal commas and exponents. It takes the bar at the recorded places, to a millimetre, and knows of the machine
what a laser interferometer said of its scales (Harris 2004, tables 8 to 10: the errors at the ends of travel), and nothing of
the angles between its axes.

    true = indicated + e,  e_x = s_x·x,  e_y = s_y·y,  e_z = s_z·z   (scale readings, so coordinates + origin)
"""

from __future__ import annotations

import csv
import math
import sys
from pathlib import Path

LENGTH = 404.2357
ORIGIN = (805.0, 303.0, -294.0)
SCALES = (0.0794 / 900, 0.0518 / 550, 0.0113 / 500)

EXAMPLES = Path(__file__).parents[2] / "examples"


def error(indicated: list[float]) -> list[float]:
    """E (mm) at indicated coordinates."""
    return [scale * (value + origin) for scale, value, origin in zip(SCALES, indicated, ORIGIN, strict=True)]


def shown(true: list[float]) -> list[float]:
    """What the machine would show of a true point."""
    found = list(true)
    for _ in range(20):
        found = [t - e for t, e in zip(true, error(found), strict=True)]
    return found


def ends(one: list[float], other: list[float]) -> list[list[float]]:
    """Both balls as the program places them: the recorded middle and direction to a millimetre, the bar's own length."""
    first, second = ([float(round(value)) for value in ball] for ball in (one, other))
    step = [b - a for a, b in zip(first, second, strict=True)]
    length = math.hypot(*step)
    return [
        [0.5 * (a + b) + sign * 0.5 * LENGTH * s / length for a, b, s in zip(first, second, step, strict=True)]
        for sign in (-1, 1)
    ]


def written(value: float) -> str:
    """A number as this program writes it: 1,234500000E+02."""
    return f"{value:.9E}".replace(".", ",")


def main() -> None:
    """Into the folder named on the command line, or the example's own."""
    with (EXAMPLES / "iota-1102-20C" / "ballbar.csv").open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    lines = ["measurement;point;X [mm];Y [mm];Z [mm]"]
    for one, other in zip(rows[::2], rows[1::2], strict=True):
        balls = ends(*([float(row[f"{axis}_mm"]) for axis in "xyz"] for row in (one, other)))
        for number, true in enumerate(balls, 1):
            lines.append(";".join([one["measurement"], str(number), *map(written, shown(true))]))
    place = Path(sys.argv[1]) if len(sys.argv) > 1 else EXAMPLES / "iota-1102-20C-against-simulation"
    place.mkdir(parents=True, exist_ok=True)
    (place / "predicted.csv").write_text("\n".join(lines) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
