"""Machines with smooth curves of all 21 errors, by classes: how large u of a part is beside the errors that its values have.

A machine here has scales and squarenesses, and of each axis three displacements and three rotations that are smooth functions
of its reading: splines through random knots, which are no cosines. Nothing of it comes from the package but what
:mod:`benchmarks.parts.studied` makes of it.

Run: ``python -m benchmarks.parts.curved FOLDER [--machines N] [--only WORDS]``; a run can be stopped and taken up again;
``--page`` writes the table of the page.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from scipy.interpolate import CubicSpline

from benchmarks.coverage.measuring import counted, kept
from benchmarks.coverage.study import measure, waiting
from benchmarks.parts import machines, truth
from benchmarks.parts.studied import CHARACTERISTICS, WORDS

PAGE = Path(__file__).parents[2] / "docs" / "parts-study.md"
BEGIN, END = "<!-- written by benchmarks.parts.curved -->", "<!-- end of curved -->"
Curves = Callable[[np.ndarray], np.ndarray]


@dataclass(frozen=True, eq=False)
class Smooth(truth.Truth):
    """A machine whose errors are curves.

    Parameters
    ----------
    curves : of each axis six splines of its reading: displacements along x, y, z in µm, rotations about them in seconds.
    """

    curves: tuple[Curves, ...] = field(default_factory=tuple)

    def true(self, read: np.ndarray, tip: np.ndarray, approach: np.ndarray) -> np.ndarray:
        found = super().true(read, tip, approach)
        moved = read[:, :, None] * truth.axes_that_enclose(truth.SECOND * self.squareness)
        for a, curve in enumerate(self.curves):
            each = curve(read[:, a])
            found = found + 1e-3 * each[:, :3]
            found = found + np.cross(truth.SECOND * each[:, 3:], moved[:, a + 1 :].sum(axis=1) + tip)
        return found


@dataclass(frozen=True)
class Sort:
    """Machines of one class.

    Parameters
    ----------
    size : of all its smooth errors, over those of an ordinary machine: 1.5 µm along, 2 µm across, 2″, 30 ppm, 20″.
    odd : times one curve of all, drawn at random.
    wave_um, periods_mm : amplitude of a periodic error of each axis, and between which its period lies.
    gap_um : play of each axis.
    warm_k : standard uncertainty of temperatures, as is stated (:func:`benchmarks.parts.machines.on_machine`).
    by_prior : whether each kind of error has a size of its own, half-normal with what physics allows, instead.
    """

    name: str
    size: float = 1.0
    odd: float = 1.0
    wave_um: float = 0.2
    periods_mm: tuple[float, float] = (2.0, 80.0)
    gap_um: float = 0.5
    crashed: bool = False
    warm_k: float = 0.0
    by_prior: bool = False


SORTS = (
    Sort("ordinary"),
    Sort("ten times better", size=0.1, wave_um=0.02, gap_um=0.05),
    Sort("ten times worse", size=10.0),
    Sort("one curve eight times", odd=8.0),
    Sort("periodic", wave_um=4.0),
    Sort("play", gap_um=8.0),
    Sort("crashed", crashed=True),
    Sort("as the priors have it", by_prior=True),
    Sort("thermal", warm_k=0.5),
    Sort("thermal, four times", warm_k=2.0),
)
PRIOR = {"along": 20.0, "across": 50.0, "turn": 30.0, "gap": 30.0, "wave": 10.0, "scale": 300.0, "square": 500.0}
"""What physics allows, in µm, ″ and ppm, as docs/machine/field.md states it."""
SHOWN = ("d2", "apart", "x1", "length", "position 1", "flat")
ALONG_UM, ACROSS_UM, TURN_ARCSEC, SCALE_PPM, SQUARE_ARCSEC = 1.5, 2.0, 2.0, 30.0, 20.0


def drawn(sort: Sort, random: np.random.Generator) -> Smooth:
    """A machine of a class."""
    sizes = np.full((3, 6), sort.size)
    sizes[:, :3] *= np.where(np.eye(3, dtype=bool), ALONG_UM, ACROSS_UM)
    sizes[:, 3:] *= TURN_ARCSEC
    sizes[random.integers(3), random.integers(6)] *= sort.odd
    square = sort.size * SQUARE_ARCSEC * random.standard_normal(3)
    if sort.crashed:  # the last axis stands askew, and turns and bends more than before
        square[1:] += random.choice([-1, 1], 2) * random.uniform(60, 150, 2)
        sizes[2] *= random.uniform(3, 6)
    wave, gap, scale, periods = random.standard_normal((3, 2)), sort.gap_um, sort.size * SCALE_PPM, sort.periods_mm
    if sort.by_prior:
        kinds = {name: most * abs(float(random.standard_normal())) for name, most in PRIOR.items()}
        sizes[:, :3] = np.where(np.eye(3, dtype=bool), kinds["along"], kinds["across"])
        sizes[:, 3:] = kinds["turn"]
        sizes *= np.abs(random.standard_normal((3, 6)))
        square, scale = PRIOR["square"] * random.standard_normal(3), PRIOR["scale"]
        gap, wave, periods = kinds["gap"], kinds["wave"] * wave, truth.PERIODS
    else:
        wave *= sort.wave_um / np.linalg.norm(wave, axis=1, keepdims=True)
    none = np.zeros((3, 3))
    return Smooth(
        scale * random.standard_normal(3), square, none, none, gap * random.standard_normal(3), wave,
        np.exp(random.uniform(*np.log(periods), 3)), tuple(_curve(a, sizes[a], random) for a in range(3)),
    )  # fmt: skip


def _curve(axis: int, sizes: np.ndarray, random: np.random.Generator) -> Curves:
    """Six splines through four to eight random knots, of their own root mean square each."""
    low, high = truth.TRAVEL[axis]
    where = np.linspace(low, high, 200)
    parts = []
    for size in sizes:
        knots = np.linspace(low - 20, high + 20, int(random.integers(4, 9)))
        spline = CubicSpline(knots, random.standard_normal(len(knots)))
        values = spline(where)
        parts.append((spline, float(values.mean()), size / float(values.std())))
    return lambda at: np.column_stack([times * (spline(at) - middle) for spline, middle, times in parts])


@dataclass(frozen=True)
class Cell:
    """Machines of one class, calibrated alike."""

    sort: Sort
    artefact: str
    noise: str

    @property
    def name(self) -> str:
        """Of its file too."""
        return f"{self.sort.name}, {self.artefact}, {self.noise}"

    @property
    def key(self) -> tuple[int, ...]:
        """Seeds of its own."""
        return SORTS.index(self.sort), *machines.Cell(self.artefact.partition(" and ")[0], self.noise, 0.0).key


CELLS = tuple(
    Cell(sort, artefact, noise)
    for artefact, noise in (("step gauge", "stated"), ("bars", "stated"), ("step gauge", "white")) for sort in SORTS
)  # fmt: skip


def measured(task: tuple[Cell, int, int]) -> dict[str, Any]:
    """One machine, as :func:`benchmarks.parts.machines.measured` has it."""
    cell, seed, number = task
    one = machines.Cell(cell.artefact, cell.noise, 0.0)
    return counted(
        cell, seed, number,
        lambda random: machines.on_machine(
            one, drawn(cell.sort, random), random, machines.Made(), 0.7e-3, warm_k=cell.sort.warm_k
        ),
    )  # fmt: skip


def tables(folder: Path) -> str:
    """By class: how often all intervals hold, and of some what they are beside the errors that values really had."""
    return table_of(folder, CELLS, ("class, calibration, noise", "machines"), lambda cell, done: ())


def table_of(
    folder: Path, cells: Sequence[Any], heads: Sequence[str], more: Callable[[Any, list[dict[str, Any]]], Sequence[str]]
) -> str:
    """A row a cell, with ``more`` by its records between how many machines there are and how often their intervals hold."""
    records, shown = kept(folder), " | ".join(WORDS[name] for name in SHOWN)
    lines = [f"| {' | '.join(heads)} | all 15 hold | {shown} |", "| --- " * (len(heads) + 1 + len(SHOWN)) + "|"]
    for cell in cells:
        done = [r for r in records if r["cell"] == cell.name and "intervals" in r]
        if not done:
            continue
        each = {one.name: np.array([r["intervals"][one.name] for r in done]).T for one in CHARACTERISTICS}
        hold = f"{100 * np.mean([holds(rows).mean() for rows in each.values()]):.1f} %"
        row = [cell.name, str(len(done)), *more(cell, done), hold, *(figures(each[name]) for name in SHOWN)]
        lines.append("| " + " | ".join(row) + " |")
    faults, seconds = sum("fault" in r for r in records), np.mean([r["seconds"] for r in records])
    return "\n".join([*lines, "", f"{faults} faults; {seconds:.2f} s of CPU a machine"])


def figures(rows: np.ndarray) -> str:
    """How often it holds, the root mean square of errors, U/2 over it: its median, and what nine of ten do not exceed."""
    true, value, _, low, high = rows
    rms = float(np.sqrt(np.mean((value - true) ** 2)))
    middle, most = np.quantile(0.25 * (high - low) / rms, [0.5, 0.9])
    return f"{100 * holds(rows).mean():.0f} %, {1e3 * rms:.2g} µm; {middle:.1f}, {most:.1f}"


def holds(rows: np.ndarray) -> np.ndarray:
    """Of true values, values, u and ends of intervals (5, n)."""
    return (rows[3] <= rows[0]) & (rows[0] <= rows[4])


def study(about: str, cells: Sequence[Any], work: Callable[[Any], dict[str, Any]], table: Callable[[Path], str],
          ends: tuple[str, str], seed: int) -> None:  # fmt: skip
    """Run, or write the table between its two marks on the page, then say what there is."""
    parser = argparse.ArgumentParser(description=about)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--machines", type=int, default=100, help="of each cell")
    parser.add_argument("--only", nargs="*", default=[], help="words of the cells' names")
    parser.add_argument("--processes", type=int, default=2)
    parser.add_argument("--seed", type=int, default=seed)
    parser.add_argument("--page", action="store_true", help="write the table of the page, and run nothing")
    chosen = parser.parse_args()
    if chosen.page:
        before, _, rest = PAGE.read_text(encoding="utf-8").partition(ends[0])
        text = f"{before}{ends[0]}\n\n{table(chosen.folder)}.\n\n{ends[1]}{rest.partition(ends[1])[2]}"
        PAGE.write_text(text, encoding="utf-8")
    else:
        some = [cell for cell in cells if not chosen.only or any(word in cell.name for word in chosen.only)]
        measure(waiting(some, chosen.folder, chosen.seed, chosen.machines), chosen.folder, chosen.processes, work)
    print(table(chosen.folder))


if __name__ == "__main__":
    study(str(__doc__), CELLS, measured, tables, (BEGIN, END), 2041)
