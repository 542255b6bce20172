"""The cells of the study: every artefact under every kind of noise that nobody states, and some where it is stated."""

from __future__ import annotations

from dataclasses import dataclass

from benchmarks.coverage.artefacts import ARTEFACTS
from benchmarks.coverage.noises import NOISES

STATED = {"unstated": (), "right": (1.0,), "20 % off": (0.8, 1.2), "half": (0.5,)}
"""Stated over true reading noise; each recording takes one of them."""
SCREENED = ("ballbar", "step gauge", "plate", "sphere")
SCREENED_NOISE = ("white", "set-up 1", "axis × 3", "walk")


@dataclass(frozen=True, order=True)
class Cell:
    """One artefact, one kind of noise, and how that is stated."""

    artefact: str
    noise: str
    stated: str = "unstated"

    @property
    def name(self) -> str:
        """In words, and of its file."""
        return ", ".join([self.artefact, self.noise, *([f"stated {self.stated}"] if self.stated != "unstated" else [])])

    @property
    def key(self) -> tuple[int, int, int]:
        """Its place among the kinds, from which its random numbers follow."""
        return list(ARTEFACTS).index(self.artefact), list(NOISES).index(self.noise), list(STATED).index(self.stated)


def cells() -> tuple[Cell, ...]:
    """All of them, at most one hundred.

    The stated ones are a Latin arrangement: each of four artefacts meets each statement, each statement each kind of noise.
    """
    unstated = [Cell(artefact, noise) for artefact in ARTEFACTS for noise in NOISES]
    levels = [level for level in STATED if level != "unstated"]
    stated = [
        Cell(artefact, SCREENED_NOISE[(i + j) % len(SCREENED_NOISE)], level)
        for i, artefact in enumerate(SCREENED)
        for j, level in enumerate(levels)
    ]
    return (*unstated, *stated)
