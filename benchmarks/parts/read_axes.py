"""Machines whose axes are stated to be read in some way: rightly, wrongly, or not at all.

Each machine is calibrated and measures the part three times over, by the same random numbers: with nothing stated of its axes,
with what it truly has, and with a statement that is wrong. Machines are those of :mod:`benchmarks.parts.curved`, with periodic
errors and play of their kind of reading.

Run: ``python -m benchmarks.parts.read_axes FOLDER [--machines N] [--only WORDS]``; a run can be stopped and taken up again;
``--page`` writes the table of the page.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.coverage.measuring import counted
from benchmarks.parts import curved, machines
from benchmarks.parts.studied import MACHINE
from cmm_uq.base.points import AXES
from cmm_uq.jobs.tables.machine import AxisFacts

BEGIN, END = "<!-- written by benchmarks.parts.read_axes -->", "<!-- end of read_axes -->"
GRATING = AxisFacts(
    names=["x", "y", "z"],
    reading="exposed optical grating",
    source="study",
    period_mm=0.02,
    deviation=[[1000.0, 3.0], [10.0, 0.3]],
)
SCREW = AxisFacts(
    names=["x", "y", "z"],
    reading="ball screw and rotary encoder",
    source="study",
    period_mm=10.0,
    grade=5,
    play_um=15.0,
)
ROUGH = AxisFacts(names=["x", "y", "z"], reading="exposed optical grating", source="study")


@dataclass(frozen=True)
class Cell:
    """Machines of one class, calibrated alike, and what is stated of all of their axes."""

    sort: curved.Sort
    truly: str
    stated: AxisFacts | None
    words: str
    artefact: str

    @property
    def name(self) -> str:
        return f"{self.truly}, {self.artefact}, {self.words}"

    @property
    def key(self) -> tuple[int, ...]:
        """Seeds of its machine, the same whatever is stated."""
        return SORTS.index(self.truly), *machines.Cell(self.artefact, "white", 0.0).key


SORTS = ("gratings", "screws", "play", "periodic")
_GRATINGS = curved.Sort("ordinary", wave_um=0.2, periods_mm=(0.010, 0.020), gap_um=0.3)
_SCREWS = curved.Sort("ordinary", wave_um=3.0, periods_mm=(9.999, 10.0), gap_um=6.0)
_PLAY = curved.Sort("play", wave_um=0.2, periods_mm=(0.010, 0.020), gap_um=8.0)
_PERIODIC = curved.Sort("periodic", wave_um=4.0, gap_um=0.3)
_NOT, _RIGHT, _WRONG = "nothing stated", "stated rightly", "stated wrongly as gratings"
_STATEMENTS: dict[str, tuple[curved.Sort, tuple[tuple[AxisFacts | None, str], ...]]] = {
    "gratings": (_GRATINGS, ((None, _NOT), (ROUGH, "kind alone"), (GRATING, _RIGHT))),
    "screws": (_SCREWS, ((None, _NOT), (SCREW, _RIGHT))),
    "periodic": (_PERIODIC, ((None, _NOT), (GRATING, _WRONG))),
    "play": (_PLAY, ((None, _NOT), (GRATING, _WRONG))),
}
CELLS = tuple(
    Cell(sort, name, stated, words, artefact)
    for artefact, some in (
        ("bars", ("gratings", "screws", "periodic")), ("step gauge", ("gratings", "play")), ("dense gauge", ("periodic",)),
    )
    for name, (sort, each) in _STATEMENTS.items() if name in some
    for stated, words in each
    if words != "kind alone" or artefact == "bars"
)  # fmt: skip


def measured(task: tuple[Cell, int, int]) -> dict[str, Any]:
    """One machine, as :func:`benchmarks.parts.machines.measured` has it."""
    cell, seed, number = task
    calibration = machines.Cell(cell.artefact, "stated", 0.0)
    machine = replace(MACHINE, read_by={} if cell.stated is None else dict.fromkeys(AXES, cell.stated))

    def measure(random: np.random.Generator) -> dict[str, Any]:
        hidden = curved.drawn(cell.sort, random)
        return machines.on_machine(calibration, hidden, random, machines.Made(), 0.7e-3, machine)

    return counted(cell, seed, number, measure)


def tables(folder: Path) -> str:
    """As of :func:`benchmarks.parts.curved.tables`, and of how many machines an axis' statement was denied."""

    def denied(cell: Cell, done: list[dict[str, Any]]) -> list[str]:
        return ["–" if cell.stated is None else f"{100 * np.mean([bool(r['denied']) for r in done]):.0f} %"]

    return curved.table_of(folder, CELLS, ("axes truly, calibration, what is stated", "machines", "denied"), denied)


if __name__ == "__main__":
    curved.study(str(__doc__), CELLS, measured, tables, (BEGIN, END), 2044)
