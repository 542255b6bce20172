"""Counts of a study: how often intervals hold, how often a diagnosis cries, with exact binomial intervals."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from scipy.stats import beta

from benchmarks.coverage.cells import Cell, cells

LEVEL = 0.999
"""Of the exact binomial intervals."""
GROUPS = {"artefact": "sizes", "figures": "figures", "lines": "figures", "noise": "noise"}
"""Group of a quantity by the first part of its name; factors else."""
POOLED = ("factors", "sizes", "figures")


@dataclass
class Count:
    """How many of how many."""

    hits: int = 0
    of: int = 0

    def add(self, hit: bool) -> None:
        """One more."""
        self.hits += hit
        self.of += 1

    def __add__(self, other: Count) -> Count:
        return Count(self.hits + other.hits, self.of + other.of)

    @property
    def share(self) -> float:
        """In per cent; not finite of none."""
        return 100 * self.hits / self.of if self.of else float("nan")

    @property
    def interval(self) -> tuple[float, float]:
        """Exact binomial interval (Clopper and Pearson 1934), per cent.

        It takes all that was counted for independent. Intervals of one recording are not, so a pooled one is too narrow.
        """
        tail = (1 - LEVEL) / 2
        low = beta.ppf(tail, self.hits, self.of - self.hits + 1) if self.hits else 0.0
        high = beta.isf(tail, self.hits + 1, self.of - self.hits) if self.hits < self.of else 1.0
        return 100 * float(low), 100 * float(high)


@dataclass
class Tally:
    """Of one cell or of several.

    Parameters
    ----------
    recordings : done, faults included.
    quantities : of each quantity by its name, how often its interval holds the truth.
    noisy : the same of the scale of the axis that reads worse.
    cries : recordings of which the diagnosis finds something; one that cannot tell noise of set-ups from it finds nothing.
    faults : what went wrong, and how often.
    seconds : of each recording.
    u : ln(u) of each quantity by recording.
    """

    recordings: int = 0
    quantities: dict[str, Count] = field(default_factory=lambda: defaultdict(Count))
    noisy: Count = field(default_factory=Count)
    cries: Count = field(default_factory=Count)
    faults: dict[str, int] = field(default_factory=lambda: defaultdict(int))
    seconds: list[float] = field(default_factory=list)
    u: dict[tuple[str, int], float] = field(default_factory=dict)

    def add(self, record: Mapping[str, Any]) -> None:
        """Count one recording."""
        self.recordings += 1
        self.seconds.append(record["seconds"])
        if "fault" in record:
            self.faults[record["fault"]] += 1
            return
        self.cries.add(record["verdict"] not in ("consistent", "undetermined"))
        for name, (_, u, low, high, truth) in record["intervals"].items():
            held = holds(name, low, high, truth)
            self.quantities[name].add(held)
            if name == f"scale_{record['noisy_axis']}.ppm":
                self.noisy.add(held)
            if u > 0:
                self.u[name, record["number"]] = float(np.log(u))

    def group(self, *names: str) -> Count:
        """Of all quantities of some groups."""
        return sum((count for name, count in self.quantities.items() if group_of(name) in names), Count())

    @property
    def worst(self) -> tuple[str, Count]:
        """The factor that is held least often."""
        factors = {name: count for name, count in self.quantities.items() if group_of(name) == "factors"}
        return min(factors.items(), key=lambda item: item[1].share, default=("", Count()))


def holds(name: str, low: float, high: float, truth: float) -> bool:
    """Whether an interval holds the truth; a phase is the same a turn further."""
    if name.endswith("phase_rad"):
        truth = low + (truth - low) % (2 * np.pi)
    return low <= truth <= high


def group_of(name: str) -> str:
    """Factors, sizes, figures or noise."""
    return GROUPS.get(name.split(".")[0], "factors")


def tallies(records: Iterable[Mapping[str, Any]]) -> dict[str, Tally]:
    """By the name of the cell; each recording once."""
    found: dict[str, Tally] = defaultdict(Tally)
    seen = set()
    for record in records:
        key = record["cell"], record["number"]
        if key not in seen:
            seen.add(key)
            found[record["cell"]].add(record)
    return dict(found)


def pooled(found: Mapping[str, Tally], chosen: Callable[[Cell], bool]) -> Tally:
    """All cells of a kind as one."""
    total = Tally()
    for cell in cells():
        if cell.name not in found or not chosen(cell):
            continue
        one = found[cell.name]
        total.recordings += one.recordings
        total.noisy += one.noisy
        total.cries += one.cries
        total.seconds += one.seconds
        for name, count in one.quantities.items():
            total.quantities[name] += count
        for words, times in one.faults.items():
            total.faults[words] += times
    return total


def wider(one: Tally, other: Tally) -> float | None:
    """Geometric mean of u over that of another run, of the factors of the same recordings; ``None`` without any."""
    ratios = [value - other.u[key] for key, value in one.u.items() if key in other.u and group_of(key[0]) == "factors"]
    return float(np.exp(np.mean(ratios))) if ratios else None
