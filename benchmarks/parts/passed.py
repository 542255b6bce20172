"""Machines that passed a test of lengths, with this stated beside their calibration and without.

Each machine is calibrated, tested as ISO 10360-2 has it and measures the part by the same random numbers, whether the test
is stated or not. Its maximum permissible error is what it just keeps, or up to 2.5 times that. The tested lines lie up to a
twentieth of the travel beside where the statement takes them. Machines are those of :mod:`benchmarks.parts.curved`.

Run: ``python -m benchmarks.parts.passed FOLDER [--machines N] [--only WORDS]``; a run can be stopped and taken up again;
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

BEGIN, END = "<!-- written by benchmarks.parts.passed -->", "<!-- end of passed -->"
WAYS = {"not stated": False, "stated": True}
SORTS = [sort for sort in curved.SORTS if sort.name not in ("ten times better", "crashed")]


@dataclass(frozen=True)
class Cell:
    """Machines of one class, calibrated alike, and whether it is stated that they passed their test."""

    sort: curved.Sort
    artefact: str
    way: str

    @property
    def name(self) -> str:
        return f"{self.sort.name}, {self.artefact}, test {self.way}"

    @property
    def key(self) -> tuple[int, ...]:
        """Seeds of its machine, the same whether the test is stated."""
        return SORTS.index(self.sort), *machines.Cell(self.artefact, "stated", 0.0).key


CELLS = tuple(Cell(sort, artefact, way) for artefact in ("bars", "step gauge") for sort in SORTS for way in WAYS)


def measured(task: tuple[Cell, int, int]) -> dict[str, Any]:
    """One machine, as :func:`benchmarks.parts.machines.measured` has it."""
    cell, seed, number = task
    calibration = machines.Cell(cell.artefact, "stated", 0.0)

    def measure(random: np.random.Generator) -> dict[str, Any]:
        hidden = curved.drawn(cell.sort, random)
        return machines.on_machine(calibration, hidden, random, machines.Made(), 0.7e-3, tested=WAYS[cell.way])

    return counted(cell, seed, number, measure)


def tables(folder: Path) -> str:
    """As of :func:`benchmarks.parts.curved.tables`, and of how many machines the test was contradicted."""

    def against(cell: Cell, done: list[dict[str, Any]]) -> list[str]:
        return [str(sum(r["chances"][-1] < CONTRADICTED for r in done))]

    return curved.table_of(folder, CELLS, ("class, calibration, test", "machines", "contradicted"), against)


if __name__ == "__main__":
    curved.study(str(__doc__), CELLS, measured, tables, (BEGIN, END), 2047)
