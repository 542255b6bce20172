"""Figures of performance of machines without noise, and how wide those with it are stated.

Machines, artefacts and noise are drawn without the package (:mod:`benchmarks.parts.curved`,
:mod:`benchmarks.coverage.artefacts`, :mod:`benchmarks.coverage.noises`); the job names scales and squarenesses, whatever else
the machine has. Of each recording the figures without noise are known, and their distribution over recordings made anew.

Run: ``python -m benchmarks.coverage.performance FOLDER [--machines N] [--only WORDS]``; a run can be stopped and taken up
again; ``--page`` writes the table of the page.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.coverage.artefacts import ARTEFACTS, Placed
from benchmarks.coverage.measuring import counted, kept
from benchmarks.coverage.noises import IN_TIME, NOISES, Readings, displayed
from benchmarks.coverage.study import PAGE, measure, waiting
from benchmarks.parts import truth
from benchmarks.parts.curved import SORTS, drawn

BEGIN, END = "<!-- written by benchmarks.coverage.performance -->", "<!-- end of performance -->"
FIGURES = ("rms_accuracy_error_um", "b89_range_um", "b89_max_deviation_um")
LARGEST = "largest_error_um"
ALONE, CORRECTED = "six alone", "corrected"
REPETITIONS, EVERY = 400, 15
"""Of a recording, over which figures are averaged; and of how many machines one has the figures as recorded, too."""
SEED = 3101


@dataclass(frozen=True)
class Cell:
    """Machines of one class, calibrated alike.

    Parameters
    ----------
    sort : of the machine; ``six alone`` has scales of 20 ppm and squarenesses of 15″, ``corrected`` a hundredth of these.
    artefact : ``bars``, twenty of them; ``step gauge``, seven lines of five lengths.
    repeats : of each set-up.
    """

    sort: str
    artefact: str
    repeats: int
    noise: str

    @property
    def name(self) -> str:
        """Of its file too."""
        times = "once" if self.repeats == 1 else "thrice"
        return f"{self.sort}, {self.artefact} {times}, {self.noise}"

    @property
    def key(self) -> tuple[int, ...]:
        """Seeds of its own."""
        sorts = [ALONE, CORRECTED, *(one.name for one in SORTS)]
        return (
            sorts.index(self.sort),
            ("bars", "step gauge").index(self.artefact),
            self.repeats,
            list(NOISES).index(self.noise),
        )


def cells() -> tuple[Cell, ...]:
    """Every class of machines under white noise, and some under every other kind."""
    whole = (ALONE, "ordinary", "as the priors have it")
    classes = (*whole, "ten times better", "one curve eight times", "periodic", "crashed")
    others = ("set-up 2", "axis × 3", "growing", "correlated", "walk", "t3", "resolution")
    return (
        *(Cell(sort, artefact, 3, "white") for artefact in ("bars", "step gauge") for sort in classes),
        *(Cell(sort, artefact, 3, "set-up 1") for artefact in ("bars", "step gauge") for sort in whole),
        *(Cell(sort, "bars", 1, "white") for sort in whole),
        *(Cell("ordinary", "bars", 3, noise) for noise in others),
        *(Cell("ordinary", "step gauge", 3, noise) for noise in ("axis × 3", "growing", "correlated", "t3")),
        Cell("ordinary", "bars", 1, "set-up 1"), Cell(ALONE, "bars", 3, "correlated"), Cell(ALONE, "bars", 3, "t3"),
        *(Cell(CORRECTED, "bars", 3, noise) for noise in ("white", "t3")),
        Cell(CORRECTED, "bars", 1, "white"), Cell(CORRECTED, "step gauge", 3, "white"),
    )  # fmt: skip


def lengths(xyz: np.ndarray) -> np.ndarray:
    """Of bars, (m,) µm, by their ends (2m, 3), mm."""
    ends = xyz.reshape(-1, 2, 3)
    return 1e3 * np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)


def figures(of_bars: np.ndarray) -> np.ndarray:
    """Standard deviation, range and largest deviation from the mean of lengths (m,)."""
    about = of_bars - of_bars.mean()
    return np.array([np.sqrt(np.sum(about**2) / (len(about) - 1)), about.max() - about.min(), np.abs(about).max()])


def largest_error(xyz: np.ndarray, placed: Placed) -> np.ndarray:
    """The largest error of indication (1,), µm, of distances from the first face of each line and repeat."""
    found = 0.0
    for number, repeat in set(zip(placed.measurement.tolist(), placed.repeat.tolist(), strict=True)):
        own = np.flatnonzero((placed.measurement == number) & (placed.repeat == repeat))
        own = own[np.argsort(placed.point[own])]
        shown, true = xyz[own] - xyz[own[0]], placed.true[own] - placed.true[own[0]]
        along = true[-1] / np.linalg.norm(true[-1])
        found = max(found, float(np.abs((shown - true) @ along).max()))
    return np.array([1e3 * found])


def placed_for(cell: Cell, random: np.random.Generator) -> Placed:
    """The artefact where it stands, as often as the cell says."""
    placed = ARTEFACTS["ballbar" if cell.artefact == "bars" else cell.artefact](random)
    own = placed.repeat <= cell.repeats
    names = ("true", "measurement", "point", "repeat", "along", "reach")
    each: dict[str, Any] = {name: getattr(placed, name) for name in names}
    columns = {name: values[own] for name, values in placed.columns.items()}
    return replace(placed, columns=columns, **{k: None if v is None else v[own] for k, v in each.items()})


def machine_of(cell: Cell, random: np.random.Generator) -> truth.Truth:
    if cell.sort in (ALONE, CORRECTED):
        size = 1.0 if cell.sort == ALONE else 0.01
        errors = size * np.append(20.0 * random.standard_normal(3), 15.0 * random.standard_normal(3))
        return truth.Truth.of_six(dict(zip(truth.SIX, errors.tolist(), strict=True)))
    return drawn(next(sort for sort in SORTS if sort.name == cell.sort), random)


def measured(task: tuple[Cell, int, int]) -> dict[str, Any]:
    """One machine: of each figure what is true, and what is stated."""
    cell, seed, number = task
    before = number % EVERY == 0
    return counted(cell, seed, number, lambda random: {"figures": _measured(cell, random, before=before)})


def _measured(cell: Cell, random: np.random.Generator, *, before: bool) -> dict[str, Any]:
    placed = placed_for(cell, random)
    still = machine_of(cell, random).read(placed.true, np.zeros(3), np.zeros_like(placed.true))
    sigma = float(np.exp(random.uniform(np.log(0.7), np.log(2.0)))) * 1e-3
    time_s = np.cumsum(20.0 * random.uniform(0.7, 1.3, len(still)))
    readings, noise = Readings(placed, sigma, time_s, int(random.integers(3))), NOISES[cell.noise]

    def again() -> np.ndarray:
        return displayed(cell.noise, still + noise(readings, random))

    shown, seed = again(), int(random.integers(2**31))
    columns = dict(placed.columns) | ({"time_s": time_s} if cell.noise in IN_TIME else {})
    if cell.artefact != "bars":
        true, value = largest_error(still, placed), largest_error(shown, placed)
        own, _ = stated(cell, placed, shown, columns, seed, recorded=False)
        return {LARGEST: {"true": float(true[0]), "value": float(value[0]), "machine": own[LARGEST]}}
    true, value = figures(lengths(still)), figures(lengths(shown))
    own, old = stated(cell, placed, shown, columns, seed, recorded=before)
    found: dict[str, Any] = {
        name: {"true": float(true[i]), "value": float(value[i]), "machine": own[name]} for i, name in enumerate(FIGURES)
    }
    if before:
        every = np.array([figures(lengths(again())) for _ in range(REPETITIONS)])
        half = 0.5 * np.diff(np.quantile(every, [0.025, 0.975], axis=0), axis=0)[0]
        for i, name in enumerate(FIGURES):
            found[name] |= {"mean": float(every[:, i].mean()), "half": float(half[i]), "recorded": old[name]}
    return found


Rows = dict[str, list[float]]
"""Value, u and ends of the interval, by figure."""


def stated(
    cell: Cell, placed: Placed, shown: np.ndarray, columns: dict[str, np.ndarray], seed: int, *, recorded: bool
) -> tuple[Rows, Rows]:
    """What the package says of the machine, and of figures as recorded."""
    from benchmarks.parts.studied import MACHINE
    from cmm_uq.analysis.machine.regions import DrawnErrors
    from cmm_uq.app.commands.estimation import accuracy, with_noise
    from cmm_uq.artefacts.ballbar import Ballbar
    from cmm_uq.artefacts.gauge_lines import StepGauge
    from cmm_uq.base.points import Points
    from cmm_uq.jobs.tables.artefact import ArtefactFacts, ReferencedFacts
    from cmm_uq.machine.model import RecordingModel
    from cmm_uq.machine.model.noise import noise_of
    from cmm_uq.machine.physics.catalogue import effects
    from cmm_uq.maths.inference.posterior import Doubt, sample_with_noise
    from cmm_uq.maths.uncertainty.quantity import Quantity

    def rows(of: Any) -> Rows:
        each: dict[str, Quantity] = dict(of)
        return {name: [one.value, one.u, *one.interval95] for name, one in each.items()}

    points = Points(shown, placed.measurement, placed.point, placed.repeat, MACHINE, columns, start_s=0.0)
    artefact: Any
    if cell.artefact == "bars":
        certified = round(float(placed.sizes["length_mm"]), 3)
        artefact = Ballbar(ArtefactFacts(kind="ballbar", length_mm=certified, u_um=0.5), points)
    else:
        artefact = StepGauge(ReferencedFacts(kind="step_gauge", u_um=0.4), points)
    model, estimate, _ = with_noise(RecordingModel(artefact, effects(truth.SIX)))
    found = DrawnErrors.of(model, Doubt(()), lambda points: model.artefact, seed).performance(model)
    assert found is not None
    if cell.artefact != "bars":
        return {LARGEST: rows({LARGEST: found.largest(np.ones(len(found.rows), dtype=bool))})[LARGEST]}, {}
    old: Rows = {}
    if recorded:
        posterior = sample_with_noise(estimate.linear, noise_of(model), estimate.least_squares, seed)
        old = rows(accuracy(model, estimate, posterior, (), seed))
    return rows(found.figures), old


def _holds(stands: list[float], true: float) -> bool:
    return stands[2] <= true <= stands[3]


def about(stands: list[float]) -> list[float]:
    """The same, with value ± U in place of the interval."""
    value, u, low, high = stands
    U = max(high - value, value - low)
    return [value, u, value - U, value + U]


def tables(folder: Path) -> str:
    """By class and noise: how often intervals hold, and how wide they are."""
    records = kept(folder)
    heads = ("machine, artefact, noise", "machines", "machine without noise", "it in value ± U as recorded",
             "average in value ± U", "average in the interval", *(f"{what} of {figure}" for figure in
             ("range", "largest deviation") for what in ("U", "interval")))  # fmt: skip
    lines = ["| " + " | ".join(heads) + " |", "| --- " * len(heads) + "|"]
    pooled: dict[str, list[bool]] = {}
    for cell in cells():
        of = [record for record in records if record["cell"] == cell.name and "figures" in record]
        each = [one | {"figure": figure} for record in of for figure, one in record["figures"].items()]
        old = [one for one in each if "recorded" in one]
        held = {
            "own": [_holds(one["machine"], one["true"]) for one in each],
            "free": [_holds(about(one["recorded"]), one["true"]) for one in old],
            "U": [_holds(about(one["recorded"]), one["mean"]) for one in old],
            "interval": [_holds(one["recorded"], one["mean"]) for one in old],
        }
        for name, holds in held.items():
            pooled.setdefault(name, []).extend(holds)
        shares = [f"{100 * float(np.mean(holds)):.1f} %" if holds else "–" for holds in held.values()]
        wide = [
            [(stands[3] - stands[2]) / (2 * one["half"]) for one in old if one["figure"] == figure
             for stands in [about(one["recorded"]) if U else one["recorded"]]]
            for figure in FIGURES[1:] for U in (True, False)
        ]  # fmt: skip
        ratios = [f"{float(np.median(one)):.2f}" if one else "–" for one in wide]
        if of:
            lines.append("| " + " | ".join([cell.name, str(len(of)), *shares, *ratios]) + " |")
    count, faults = (sum(key in record for record in records) for key in ("figures", "fault"))
    own, free, U, interval = (f"{100 * float(np.mean(h)):.1f} % of {len(h)}" for h in pooled.values())
    return "\n".join([
        f"{count} machines. The machine's own figures lie in their intervals in {own}; in value ± U as recorded, which is",
        f"meant for the average over recordings, in {free}. That average lies in value ± U in {U}, in the interval in",
        f"{interval}.", "",
        *lines, "", f"{faults} faults; {np.mean([record['seconds'] for record in records]):.2f} s of CPU a machine.",
    ])  # fmt: skip


def main() -> None:
    """Run, or write the tables."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--machines", type=int, default=15, help="of each cell")
    parser.add_argument("--only", nargs="*", default=[], help="words of the cells' names")
    parser.add_argument("--processes", type=int, default=1)
    parser.add_argument("--page", action="store_true", help="write the tables of what is there, and run nothing")
    chosen = parser.parse_args()
    some = [cell for cell in cells() if not chosen.only or any(word in cell.name for word in chosen.only)]
    if not chosen.page:
        work: Callable[[Any], dict[str, Any]] = measured
        measure(waiting(some, chosen.folder, SEED, chosen.machines), chosen.folder, chosen.processes, work)
    text = tables(chosen.folder)
    if chosen.page:
        before, _, rest = PAGE.read_text(encoding="utf-8").partition(BEGIN)
        after = rest.partition(END)[2]
        PAGE.write_text(f"{before}{BEGIN}\n\n{text}\n\n{END}{after}", encoding="utf-8")
    print(text)


if __name__ == "__main__":
    main()
