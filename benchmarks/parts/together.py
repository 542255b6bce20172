"""Machines with one certificate, and with a further one of another artefact whose recording is taken together with it.

Each machine is calibrated and measures the part by the same random numbers with one certificate and with two. Machines are
those of :mod:`benchmarks.parts.curved`; noise is to be found from three repeats.

Run: ``python -m benchmarks.parts.together FOLDER [--machines N] [--only WORDS]``; a run can be stopped and taken up again;
``--page`` writes the table of the page.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.coverage.measuring import counted
from benchmarks.parts import curved, machines
from cmm_uq.analysis.machine.recordings import CONTRADICTED

BEGIN, END = "<!-- written by benchmarks.parts.together -->", "<!-- end of together -->"
SORTS = [sort for sort in curved.SORTS if sort.name in ("ordinary", "periodic", "play", "crashed")]


@dataclass(frozen=True)
class Cell:
    """Machines of one class, with these certificates."""

    sort: curved.Sort
    artefacts: tuple[str, ...]

    @property
    def name(self) -> str:
        return f"{self.sort.name}, {' and '.join(self.artefacts)}"

    @property
    def key(self) -> tuple[int, ...]:
        """Seeds of its machine, the same with a further certificate."""
        return SORTS.index(self.sort), *machines.Cell(self.artefacts[0], "white", 0.0).key


CELLS = tuple(Cell(sort, artefacts) for sort in SORTS for artefacts in (("bars",), ("bars", "step gauge")))


def measured(task: tuple[Cell, int, int]) -> dict[str, Any]:
    """One machine, as :func:`benchmarks.parts.machines.measured` has it."""
    cell, seed, number = task
    calibration = machines.Cell(cell.artefacts[0], "white", 0.0)

    def measure(random: np.random.Generator) -> dict[str, Any]:
        hidden = curved.drawn(cell.sort, random)
        return machines.on_machine(calibration, hidden, random, machines.Made(), 0.7e-3, beside=cell.artefacts[1:])

    return counted(cell, seed, number, measure)


def tables(folder: Path) -> str:
    """As of :func:`benchmarks.parts.curved.tables`, and of how many machines a further certificate was contradicted."""

    def against(cell: Cell, done: list[dict[str, Any]]) -> list[str]:
        return [str(sum(min(r["chances"]) < CONTRADICTED for r in done)) if cell.artefacts[1:] else "–"]

    return curved.table_of(folder, CELLS, ("class, certificates", "machines", "contradicted"), against)


if __name__ == "__main__":
    curved.study(str(__doc__), CELLS, measured, tables, (BEGIN, END), 2046)
