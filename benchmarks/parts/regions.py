"""Error factors over the measuring range and in its eighths, beside those of machines with smooth curves of all errors.

The machines are those of :mod:`benchmarks.parts.curved`. What a factor truly is in a region is found here from the truth
alone: least squares of scales, squarenesses and a displacement as a whole, all by differences of the truth's own formula, on a
grid of 729 points where a certificate has 64.

Run: ``python -m benchmarks.parts.regions FOLDER [--machines N] [--only WORDS]``; a run can be stopped and taken up again;
``--page`` writes the table of the page.
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.coverage.measuring import counted, kept
from benchmarks.parts import machines, truth
from benchmarks.parts.curved import CELLS, SORTS, Cell, drawn, study
from cmm_uq.analysis.machine.conditional import further_recording, own_noise
from cmm_uq.analysis.machine.recordings import ALONE, FurtherRecording, FurtherRecordings
from cmm_uq.analysis.machine.regions import factor_regions, other_errors
from cmm_uq.app.commands.estimation import with_noise
from cmm_uq.machine.model.measurement import RecordingModel
from cmm_uq.machine.model.noise import noise_of
from cmm_uq.maths.inference.posterior import Doubt, NoisyPosterior, sample_with_noise

BEGIN, END = "<!-- written by benchmarks.parts.regions -->", "<!-- end of regions -->"
NOISE_MM, EACH = 0.7e-3, 9
EVERY = (
    *CELLS,
    *(Cell(sort, artefact, "set-up") for artefact in ("step gauge", "bars") for sort in (SORTS[0], SORTS[-1])),
    *(Cell(sort, one, "white") for one in ("bars", "bars and step gauge") for sort in (SORTS[0], SORTS[-1])),
    *(Cell(sort, "bars and step gauge", "set-up") for sort in (SORTS[0], SORTS[-1])),
)
KINDS = {"scale": slice(0, 3), "squareness": slice(3, 6)}
ENDS = (((0.0, 1.0),) * 3, *product(((0.0, 0.5), (0.5, 1.0)), repeat=3))


def factors(machine: truth.Truth, ends: tuple[tuple[float, float], ...]) -> np.ndarray:
    """Scales in ppm and squarenesses in seconds (6,), in a region by shares of the travels."""
    parts = (np.arange(EACH) + 0.5) / EACH
    along = [low + (high - low) * (a + (b - a) * parts) for (low, high), (a, b) in zip(truth.TRAVEL, ends, strict=True)]
    read, nothing = np.array(list(product(*along))), np.zeros(3)

    def errors(of: truth.Truth) -> np.ndarray:
        return (of.true(read, nothing, np.zeros_like(read)) - read).ravel()

    own = [errors(truth.Truth.of_six({name: float(name == one) for name in truth.SIX})) for one in truth.SIX]
    offsets = read - read.mean(axis=0)
    rigid = [np.tile(axis, len(read)) for axis in np.eye(3)] + [
        1e-3 * np.cross(axis, offsets).ravel() for axis in np.eye(3)
    ]
    return (
        np.linalg.lstsq(np.column_stack([*(1e3 * one for one in own), *rigid]), errors(machine), rcond=None)[0][:6]
        * 1e3
    )


def measured(task: tuple[Cell, int, int]) -> dict[str, Any]:
    """One machine: of each factor the truth, value, U and interval over the range; lowest and highest in eighths and told."""
    cell, seed, number = task
    return counted(cell, seed, number, lambda random: {"factors": _measured(cell, drawn(cell.sort, random), random)}, 7)


def offset(cell: Cell, random: np.random.Generator) -> float:
    """Standard deviation, mm, of what a set-up adds to each of its points."""
    return NOISE_MM * float(random.uniform(0.5, 2.0)) if cell.noise == "set-up" else 0.0


def calibrated(
    cell: Cell,
    hidden: truth.Truth,
    random: np.random.Generator,
    change: Callable[[Any], Any] = lambda artefact: artefact,
) -> tuple[RecordingModel, NoisyPosterior, int]:
    """The machine calibrated with the cell's artefact and noise: the named model, its posterior, and a seed for more.

    ``change``: of the artefact as recorded.
    """
    one = machines.Cell(cell.artefact.partition(" and ")[0], cell.noise, 0.0)
    artefact = change(machines.calibrated(one, hidden, NOISE_MM, offset(cell, random), random))
    model = RecordingModel(artefact, machines.NAMED, NOISE_MM if cell.noise == "stated" else None)
    model, estimate, _ = with_noise(model)
    seed = int(random.integers(2**31))
    return model, sample_with_noise(estimate.linear, noise_of(model), estimate.least_squares, seed), seed


def _measured(cell: Cell, hidden: truth.Truth, random: np.random.Generator) -> list[list[float]]:
    model, posterior, seed = calibrated(cell, hidden, random)
    beside = ALONE
    if further := cell.artefact.partition(" and ")[2]:  # calibrated on the same day with another artefact
        errors = other_errors(model)
        gauge = machines.calibrated(
            machines.Cell(further, cell.noise, 0.0), hidden, NOISE_MM, offset(cell, random), random
        )
        first = FurtherRecording(model, own_noise(model, errors, seed))
        beside = FurtherRecordings((further_recording(first, RecordingModel(gauge, machines.NAMED), errors, seed),))
    regions = factor_regions(model, posterior, Doubt(()), lambda points: model.artefact, seed, beside)
    whole, *eighths = (factors(hidden, ends) for ends in ENDS)
    rows = []
    for i, name in enumerate(truth.SIX):
        key = next(key for key in regions.whole if key[0] == name)
        quantity, stated = regions.whole[key], posterior.draws[:, i]
        parts = [float(each[i]) for each in eighths]
        rows.append([
            float(whole[i]), quantity.value, quantity.u, *quantity.interval95, min(parts), max(parts), *regions.eighths[key],
            float(stated.mean()), float(stated.std()),
        ])  # fmt: skip
    return rows


def tables(folder: Path) -> str:
    """By class: how often intervals hold, and what they are beside the errors that values really had."""
    records = kept(folder)
    heads = ("class, calibration, noise", "machines", "over the range", "in all eighths",
             *(f"{kind}: recorded mean, rms, U/2 over it" for kind in KINDS))  # fmt: skip
    lines = ["| " + " | ".join(heads) + " |", "| --- " * len(heads) + "|"]
    for cell in EVERY:
        done = np.array([r["factors"] for r in records if r["cell"] == cell.name and "factors" in r])
        if not len(done):
            continue
        true, value, _, low, high, least, most, lower, upper, mean, sd = np.moveaxis(done, 2, 0)
        row = [cell.name, str(len(done)), f"{100 * np.mean((low <= true) & (true <= high)):.1f} %",
               f"{100 * np.mean((lower <= least) & (most <= upper)):.1f} %"]  # fmt: skip
        for part in KINDS.values():
            rms = float(np.sqrt(np.mean((value - true)[:, part] ** 2)))
            half = np.quantile(0.25 * (high - low)[:, part] / rms, [0.5, 0.9])
            alone = 100 * np.mean(np.abs(mean - true)[:, part] <= 2 * sd[:, part])
            row.append(f"{alone:.0f} %, {rms:.2g}; {half[0]:.1f}, {half[1]:.1f}")
        lines.append("| " + " | ".join(row) + " |")
    faults = sum("fault" in r for r in records)
    return "\n".join(
        [*lines, "", f"{faults} faults; {np.mean([r['seconds'] for r in records]):.2f} s of CPU a machine"]
    )


if __name__ == "__main__":
    study(str(__doc__), EVERY, measured, tables, (BEGIN, END), 2042)
