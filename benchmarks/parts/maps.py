"""Distances corrected by the error map of a calibration, beside those of machines with smooth curves of all errors.

The machines are those of :mod:`benchmarks.parts.curved`. Each is calibrated, a map is made of it, and 60 distances
between places drawn in the measuring range, read without noise, are corrected by it. What they truly are says the truth's own
formula. How often |corrected − true| ≤ 2·u holds is counted, and what is left is set beside what was there.

Run: ``python -m benchmarks.parts.maps FOLDER [--machines N] [--only WORDS]``; a run can be stopped and taken up again;
``--page`` writes the table of the page.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.coverage.measuring import counted, kept
from benchmarks.parts import truth
from benchmarks.parts.curved import Cell, drawn, study
from benchmarks.parts.regions import EVERY as REGIONS, calibrated
from cmm_uq.analysis.machine.correction import field_map
from cmm_uq.machine.physics.compensation import Compensation
from cmm_uq.machine.physics.map_interpolation import ErrorMaps
from cmm_uq.maths.inference.posterior import Doubt

BEGIN, END = "<!-- written by benchmarks.parts.maps -->", "<!-- end of maps -->"
PAIRS = 60
EVERY = tuple(cell for cell in REGIONS if " and " not in cell.artefact)  # of one calibration each


def measured(task: tuple[Cell, int, int]) -> dict[str, Any]:
    """One machine: of each distance its length, error as read, error as corrected and u; and what was held out."""
    cell, seed, number = task
    return counted(cell, seed, number, lambda random: _measured(cell, drawn(cell.sort, random), random), 11)


def _measured(cell: Cell, hidden: truth.Truth, random: np.random.Generator) -> dict[str, Any]:
    model, posterior, seed = calibrated(cell, hidden, random)
    found = field_map(model, posterior, Doubt(()), lambda points: model.artefact, seed)
    made, machine = found.error_map, model.artefact.points.machine
    low, high = np.transpose(truth.TRAVEL)
    read = random.uniform(low, high, (2 * PAIRS, 3))
    true = hidden.true(read, np.zeros(3), np.zeros_like(read))
    corrected, _ = Compensation(ErrorMaps([made]), machine.chain).compensate(read)
    pairs = np.arange(PAIRS), np.arange(PAIRS, 2 * PAIRS)
    lengths, asread, now = (np.linalg.norm(of[pairs[1]] - of[pairs[0]], axis=1) for of in (true, read, corrected))
    covariance = made.covariance
    u = covariance.of_distances(covariance.root(made, read, chain=machine.chain), read, pairs)
    rows = np.column_stack([lengths, 1e3 * (asread - lengths), 1e3 * (now - lengths), 1e3 * u])
    held = found.held_out
    out = None if held is None else [held.uncorrected, held.named, held.corrected, *held.predicted]
    return {"distances": np.round(rows, 5).tolist(), "held_out": out, "disagree": len(found.agreement.disagree)}


def tables(folder: Path) -> str:
    """By class: how often u holds, what is left of the errors, and what was predicted of set-ups held out."""
    records = kept(folder)
    heads = ("class, calibration, noise", "machines", "2·u holds", "distances: rms as read", "corrected", "median u",
             "held out: as read (predicted)", "named errors", "all (predicted)")  # fmt: skip
    lines = ["| " + " | ".join(heads) + " |", "| --- " * len(heads) + "|"]
    for cell in EVERY:
        mine = [r for r in records if r["cell"] == cell.name and "distances" in r]
        if not mine:
            continue
        _, before, after, u = np.moveaxis(np.array([r["distances"] for r in mine]), 2, 0)
        out = np.array([r["held_out"] for r in mine if r["held_out"]])
        rms = np.sqrt(np.mean(out**2, axis=0)) if len(out) else np.full(5, np.nan)
        lines.append(
            f"| {cell.name} | {len(mine)} | {100 * np.mean(np.abs(after) <= 2 * u):.1f} % | {_rms(before)} | {_rms(after)} | "
            f"{np.median(u):.2g} | {rms[0]:.2g} ({rms[3]:.2g}) | {rms[1]:.2g} | {rms[2]:.2g} ({rms[4]:.2g}) |"
        )
    records = [r for r in records if any(r["cell"] == cell.name for cell in EVERY)]
    faults, denied = sum("fault" in r for r in records), sum(bool(r.get("disagree")) for r in records)
    return "\n".join([
        *lines, "", f"{faults} faults; {denied} of {len(records)} maps would be refused, since named errors and all together "
        f"disagree; {np.mean([r['seconds'] for r in records]):.1f} s of CPU a machine",
    ])  # fmt: skip


def _rms(errors: np.ndarray) -> str:
    return f"{np.sqrt(np.mean(errors**2)):.2g}"


if __name__ == "__main__":
    study(str(__doc__), EVERY, measured, tables, (BEGIN, END), 2043)
