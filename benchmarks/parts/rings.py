"""Machines with one certificate, and with a further one of a ring that stood near a bore of the part.

The ring, 30 mm, lies within 20 mm of the larger bore and within 10 mm of its height, and is probed with the stylus of the
part, three times 25 points around; its diameter and roundness are off by as much as is stated. The effective radius of the
tip is off too, and estimated from the ring. Machines are those of :mod:`benchmarks.parts.curved`, the same with the ring and
without; noise is to be found.

Run: ``python -m benchmarks.parts.rings FOLDER [--machines N] [--only WORDS]``; a run can be stopped and taken up again;
``--page`` writes the table of the page.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from benchmarks.coverage.measuring import counted
from benchmarks.parts import curved, machines
from benchmarks.parts.together import Cell, tables

BEGIN, END = "<!-- written by benchmarks.parts.rings -->", "<!-- end of rings -->"
SORTS = [sort for sort in curved.SORTS if not sort.warm_k and "ten times" not in sort.name]
CELLS = tuple(
    Cell(sort, (artefact, *ring), tuple(SORTS))
    for artefact in ("bars", "step gauge")
    for sort in SORTS
    for ring in ((), ("ring",))
)


def measured(task: tuple[Cell, int, int]) -> dict[str, Any]:
    """One machine, as :func:`benchmarks.parts.machines.measured` has it."""
    cell, seed, number = task
    calibration, beside = machines.Cell(cell.artefacts[0], "white", 0.0), cell.artefacts[1:]

    def measure(random: np.random.Generator) -> dict[str, Any]:
        pose, hidden = machines.placed(random), curved.drawn(cell.sort, random)
        return machines.on_machine(calibration, hidden, random, machines.Made(), 0.7e-3, beside=beside, pose=pose)

    return counted(cell, seed, number, measure)


if __name__ == "__main__":
    curved.study(str(__doc__), CELLS, measured, lambda folder: tables(folder, CELLS), (BEGIN, END), 2058)
