"""How time and memory of a report grow with its recording: ``python -m benchmarks.sizes.growth FOLDER [--page]``.

From 20 to 100 000 observations of each kind. The exponent is of what a recording takes beyond the smallest one, between ten
thousand observations and a hundred thousand: 1 where twice the recording takes twice as long. ``--page`` writes table and
picture into docs/waiting.md.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from math import log10
from pathlib import Path

import numpy as np

from benchmarks.marked import put
from benchmarks.sizes.recordings import Recorded, bars, plates, spheres, write
from benchmarks.sizes.study import measured

ROOT = Path(__file__).parents[2]
PAGE, PICTURE = ROOT / "docs" / "waiting.md", ROOT / "docs" / "images" / "growth.svg"
BEGIN, END = "<!-- written by python -m benchmarks.sizes.growth --page: edit that instead -->", "<!-- end of growth -->"
SIZES = (20, 100, 1000, 10_000, 100_000)
PLACINGS = 3
KINDS: dict[str, tuple[Callable[[int], Recorded], str]] = {
    "bars": (bars, "#1f6fb4"),
    "bars with their times": (lambda n: bars(n, timed=True), "#c2571a"),
    "points on a sphere": (lambda n: spheres(PLACINGS, round(n / PLACINGS)), "#2e8b57"),
    "balls of a plate": (lambda n: plates(PLACINGS, max(3, round(np.sqrt(n / 3 / PLACINGS)))), "#8a4fa3"),
}
# observations of a point; of bars one of two
OBSERVED = {"points on a sphere": 1.0, "balls of a plate": 3.0}
Measured = dict[str, list[tuple[int, float, float]]]  # by kind: observations, s, MiB


def run(folder: Path) -> Measured:
    found: Measured = {}
    for name, (made, _) in KINDS.items():
        for size in SIZES:
            recorded, job = made(size), folder / f"{name.replace(' ', '-')}-{size}"
            count = round(len(recorded.points) * OBSERVED.get(name, 0.5))
            if not (job / "job.toml").exists():
                write(recorded, job)
            seconds, memory, code = measured("report", job, folder / "out" / job.name)
            if code:
                raise RuntimeError(f"{job} ended with {code}")
            found.setdefault(name, []).append((count, seconds, memory))
            print(f"{name}: {count} observations, {seconds:.1f} s, {memory:.0f} MiB", flush=True)
    return found


def exponent(rows: list[tuple[int, float, float]], column: int) -> float:
    """Of what is beyond the smallest recording, between the two largest."""
    first, before, last = (np.array(rows[i], dtype=float) for i in (0, -2, -1))
    return float(log10((last - first)[column] / (before - first)[column]) / log10(last[0] / before[0]))


def table(found: Measured) -> str:
    lines = ["| observations | fewest | ten thousand | a hundred thousand | exponents: time, memory |",
             "| --- | ---: | ---: | ---: | ---: |"]  # fmt: skip
    for name, rows in found.items():
        each = " | ".join(f"{rows[i][0]}: {rows[i][1]:.1f} s, {rows[i][2]:.0f} MiB" for i in (0, -2, -1))
        lines.append(f"| {name} | {each} | {exponent(rows, 1):.2f}, {exponent(rows, 2):.2f} |")
    return "\n".join(lines)


def picture(found: Measured) -> str:
    """Time on the left, memory on the right, over observations, all by their logarithms."""
    wide, high, parts = 460.0, 300.0, list[str]()
    for side, (column, low, top, unit) in enumerate(((1, 0.0, 2.3, "s"), (2, 2.0, 3.3, "MiB"))):
        left, right, bottom = 60 + side * 490, 60 + side * 490 + wide - 100, high - 40

        def at(count: float, value: float, left: float = left, low: float = low, top: float = top) -> str:
            x = left + (log10(count) - 1) / 4.1 * (wide - 100)
            return f"{x:.1f},{20 + (high - 60) * (top - log10(value)) / (top - low):.1f}"

        parts.append(f'<path d="M{left} 20V{bottom}H{right}" fill="none" stroke="#888"/>')
        for power in range(2, 6):
            x = at(10**power, 10**low).split(",")[0]
            parts.append(f'<text x="{x}" y="{bottom + 16}" text-anchor="middle">10{"⁰¹²³⁴⁵"[power]}</text>')
        for value in [v for v in (1, 3, 10, 30, 100, 300, 1000) if low <= log10(v) <= top]:
            y = at(10, value).split(",")[1]
            parts.append(f'<path d="M{left} {y}H{right}" stroke="#ddd"/><text x="{left - 6}" y="{y}" dy="4" '
                         f'text-anchor="end">{value}</text>')  # fmt: skip
        parts.append(
            f'<text x="{left}" y="12">{unit}</text><text x="{right}" y="{high - 6}" text-anchor="end">observations</text>'
        )
        for i, (name, rows) in enumerate(found.items()):
            colour, drawn = KINDS[name][1], " ".join(at(row[0], row[column]) for row in rows)
            parts.append(f'<polyline points="{drawn}" fill="none" stroke="{colour}" stroke-width="2"/>')
            if not side:
                parts.append(f'<text x="{left + 12}" y="{36 + 17 * i}" fill="{colour}">{name}</text>')
    begin = f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 950 {high:.0f}" role="img">'
    title = "<title>Processor time and memory of a report over the observations of its recording</title>"
    return "\n".join([begin, "<style>text{font:12px sans-serif}</style>", title, *parts, "</svg>", ""])


def main() -> None:
    asked = argparse.ArgumentParser(description=__doc__)
    asked.add_argument("folder", type=Path)
    asked.add_argument("--page", action="store_true", help="write into docs/waiting.md, and the picture")
    chosen = asked.parse_args()
    found = run(chosen.folder)
    print(table(found))
    if chosen.page:
        PICTURE.write_text(picture(found), encoding="utf-8")
        put(PAGE, BEGIN, END, table(found))


if __name__ == "__main__":
    main()
