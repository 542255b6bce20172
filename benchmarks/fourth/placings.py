"""How artefacts stand in the fourth study: as in the studies before, and light along axes and diagonals."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import cache

import numpy as np

from benchmarks.concealed.designs import surroundings
from benchmarks.fourth.machine import HIGH, LOW
from benchmarks.second import artefacts, maps
from benchmarks.second.artefacts import Placed
from benchmarks.second.cases import RUNS

Line = tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]
"""Where it starts, its unit vector, the ways of its targets from the start, and along what is read there."""
MIDDLE, ALL = (LOW + HIGH) / 2, HIGH - LOW


def _light(random: np.random.Generator, lines: Sequence[Line], repeats: int, back: bool = True) -> Placed:
    """Targets there and back; of each line the zero is free, and of what is read across it the slope."""
    rows = []
    for number, (start, line, ways, read) in enumerate(lines, 1):
        there = np.concatenate([ways, ways[::-1]]) if back else ways
        sense = np.where(np.arange(len(there)) < len(ways), 1.0, -1.0)
        rows += [(number, i, r, way, *(start + way * line), *(s * np.sign(np.round(line, 9))), *read)
                 for r in range(1, repeats + 1) for i, (way, s) in enumerate(zip(there, sense, strict=True), 1)]  # fmt: skip
    table = np.array(rows, dtype=float)
    measurement, point, repeat = table[:, :3].astype(int).T
    way, true, sense, read, n = table[:, 3], table[:, 4:7], table[:, 7:10], table[:, 10:], len(table)
    own = measurement[:, None] == np.unique(measurement)
    across = np.array([abs(line @ each) < 1e-9 for _, line, _, each in lines])
    D = np.zeros((n, n, 3))
    D[np.arange(n), np.arange(n)] = read
    recorded = surroundings(random, 4 * measurement + repeat, sense) | {"time_s": np.cumsum(random.gamma(4.0, 6.0, n))}
    recorded = {f"read_{a}": read[:, i] for i, a in enumerate("xyz")} | recorded
    del recorded["temp_artefact_c"]
    return Placed(
        RUNS, true, measurement, point, repeat, recorded, {}, D.reshape(n, -1),
        np.hstack([own, (own * way[:, None])[:, across]]).astype(float), 1.0, None, None,
        node=point, own=np.zeros((n, 3)), axes=np.zeros((n, 3, 3)), origin=np.zeros(3),
    )  # fmt: skip


def axes(random: np.random.Generator) -> Placed:
    """Two or three axes by a laser, 8 to 15 targets there and back two or three times; of some also a straightness."""
    lines: list[Line] = []
    for a in random.permutation(3)[: int(random.integers(2, 4))]:
        start, count = LOW + ALL * random.uniform(0.1, 0.9, 3), int(random.integers(8, 16))
        start[a] = LOW[a] + 0.03 * ALL[a]
        ways = (np.arange(count) + random.uniform(-0.25, 0.25, count)) / count
        across = [b for b in range(3) if b == a or random.random() < 0.4]
        lines += [(start, np.eye(3)[a], np.round((ways - ways[0]) * ALL[a], 1), np.eye(3)[b]) for b in across]
    return _light(random, lines, int(random.integers(2, 4)))


def diagonals(random: np.random.Generator) -> Placed:
    """A laser along three axes and the four diagonals of the volume, 7 to 10 targets there and back twice."""
    count, lines = int(random.integers(7, 11)), []
    for sign in np.array([*np.eye(3), *([1.0, b, c] for b in (-1.0, 1.0) for c in (-1.0, 1.0))]):
        whole = ALL * 0.96 * sign
        start, length = (
            MIDDLE + np.where(sign == 0, ALL * random.uniform(-0.4, 0.4, 3), -whole / 2),
            np.linalg.norm(whole),
        )
        lines.append((start, whole / length, np.round(np.linspace(0, length, count), 1), whole / length))
    return _light(random, lines, 2)


@cache
def _real() -> tuple[list[Line], np.ndarray]:
    """The real machine's axes with the targets of its runs; and of all these, at three temperatures, what their mean and a
    straight line leave, mm."""
    lines, left = [], []
    for a, name in enumerate("xyz"):
        tables = np.array([maps.tables(temperature)[name] for temperature in maps.SQUARENESS])
        tables = tables[:, ~np.isin(tables[0, :, 0], maps.JUMPS.get(name, ()))]
        place, errors = tables[0, :, 0], tables[:, :, 1 + a] - tables[:, :, 1 + a].mean(axis=0)
        left.append([np.sqrt(1.5) * (row - np.polyval(np.polyfit(place, row, 1), place)) for row in errors])
        start = np.where(np.arange(3) == a, place.min(), MIDDLE)
        lines.append((start, np.eye(3)[a], np.sort(place) - place.min(), np.eye(3)[a]))
    return lines, np.concatenate([np.ravel(each) for each in left])


def real_axes(random: np.random.Generator) -> Placed:
    """The runs of a laser along the DEA Iota's axes at their targets, out alone; what they left is dealt anew as noise."""
    lines, left = _real()
    placed = _light(random, lines, 3, back=False)
    placed.recorded = {name: value for name, value in placed.recorded.items() if name.startswith("read")}
    placed.residuals = random.choice([-1.0, 1.0], len(left)) * random.permutation(left)
    return placed


DESIGNS: Mapping[str, Callable[[np.random.Generator], Placed]] = {
    "ballbar": lambda r: artefacts.ballbar(r, int(r.integers(18, 37))),
    "step gauge": lambda r: artefacts.gauge(r, count=int(r.integers(5, 13))),
    "plate": lambda r: artefacts.plate(r, int(r.integers(1, 5))),
    "sphere": artefacts.sphere, "axis runs": axes, "laser diagonals": diagonals,
    "real bars": artefacts.real_bars, "real axis runs": real_axes,
}  # fmt: skip
