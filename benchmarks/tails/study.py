"""What would weights of readings gain under heavy tails: ``python -m benchmarks.tails.study FOLDER --only WORDS``.

The posterior with normal readings, with tails weighed, and with three degrees of freedom told, of recordings of the coverage
study without the time. Every recording is appended to ``FOLDER/<cell>.jsonl``; ``--tally`` counts what is there.
docs/noise.md has what was found.
"""

from __future__ import annotations

import argparse
import tempfile
import time
from collections import defaultdict
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.coverage.cells import Cell, cells
from benchmarks.coverage.measuring import kept
from benchmarks.coverage.recordings import Recording, recording
from benchmarks.coverage.study import measure
from benchmarks.tails.joint import DOF, Found, Readings, prior, sample
from cmm_uq.app.commands.diagnose import screened_model
from cmm_uq.app.commands.estimation import with_noise
from cmm_uq.app.commands.reading import read_job
from cmm_uq.machine.model.measurement import RecordingModel
from cmm_uq.machine.model.noise import noise_of
from cmm_uq.maths.inference.posterior import sample_with_noise

HALF, FEW = 0.5, 0.05
"""Probabilities of tails beforehand; that of diagnoses is the second."""
_TOLD = int(np.flatnonzero(DOF == 3.0)[0])
WAYS = ("normal", "weighed", "half", "told", "report")


def weighed(task: tuple[Cell, int, int]) -> dict[str, Any]:
    """u, whether the interval holds and the error of each parameter that has a truth, in every way."""
    cell, seed, number = task
    start = time.perf_counter()
    made = recording(cell, seed, 2 * number)  # every second one has no time in it
    with tempfile.TemporaryDirectory() as folder:
        screened, _ = screened_model(read_job(made.write(Path(folder) / "tails")))
        model, estimate, _ = with_noise(screened)
    of = Readings.of(model)
    told = np.where(np.arange(len(DOF)) == _TOLD, 0.0, -np.inf)
    each = {"normal": sample(of, prior(0.0), number), "half": sample(of, prior(HALF), number)}
    each["told"] = sample(of, told, number)
    posterior = sample_with_noise(estimate.linear, noise_of(model), estimate.least_squares, number)
    normal = each["half"].dof == len(DOF) - 1
    weight = np.where(normal, (1 - FEW) / (1 - HALF), FEW / HALF)
    found: dict[str, Any] = {
        name: _said(model, made, draws.draws, np.ones(len(weight))) for name, draws in each.items()
    }
    found["weighed"] = _said(model, made, each["half"].draws, weight)
    found["report"] = _said(model, made, posterior.draws, np.ones(len(posterior.draws)))
    tails = {"half": each["half"].tails, "weighed": float(np.sum(weight[~normal]) / np.sum(weight))}
    return {
        "cell": cell.name, "number": number, "readings": len(of.whole), "ways": found, "tails": tails,
        "sizes": {name: _present(draws) for name, draws in each.items()},
        "rhat": {name: draws.rhat for name, draws in each.items()},
        "ess": {name: draws.ess for name, draws in each.items()}, "seconds": time.perf_counter() - start,
    }  # fmt: skip


def _present(found: Found) -> dict[str, float]:
    sizes = found.sizes
    return {
        "axes": float(np.mean(np.ptp(sizes.reading, axis=1) > 0)), "placing": float(np.mean(sizes.placing > 0)),
        "growth": float(np.mean(sizes.growth > 0)),
    }  # fmt: skip


def _said(model: RecordingModel, made: Recording, values: np.ndarray, weight: np.ndarray) -> dict[str, list[float]]:
    """Of each parameter: u, whether its interval holds, error."""
    found = {}
    for (owner, name), (draws, _) in model.reported(values).items():
        truth = made.truth.get(f"{owner}.{name}")
        if truth is None or name == "phase_rad":
            continue
        order = np.argsort(draws)
        part = np.cumsum(weight[order]) / np.sum(weight)
        low, high = np.interp([0.025, 0.975], part, draws[order])
        mean = np.average(draws, weights=weight)
        u = np.sqrt(np.average((draws - mean) ** 2, weights=weight))
        found[f"{owner}.{name}"] = [float(u), float(low <= truth <= high), float(mean - truth)]
    return found


def tally(records: list[dict[str, Any]]) -> str:
    """One line for each artefact, and one for all: of factors alone u over that of normal readings, and what holds."""
    groups = defaultdict(list)
    for record in records:
        artefact, noise = record["cell"].split(", ")
        groups[noise, artefact].append(record)
        groups[noise, "all"].append(record)
    return "\n".join(f"{noise}, {artefact}: {_line(own)}" for (noise, artefact), own in sorted(groups.items()))


def _line(records: list[dict[str, Any]]) -> str:
    ratio: dict[str, list[float]] = defaultdict(list)
    error: dict[str, list[float]] = defaultdict(list)
    hold: dict[str, list[float]] = defaultdict(list)
    for record in records:
        factors = [name for name in record["ways"]["normal"] if not name.startswith("artefact")]
        for way in WAYS:
            pairs = [(record["ways"][way][name], record["ways"]["normal"][name]) for name in factors]
            ratio[way].append(float(np.mean([np.log(a[0] / b[0]) for a, b in pairs])))
            error[way].append(float(np.mean([(a[2] / b[0]) ** 2 for a, b in pairs])))
            hold[way] += [a[1] for a, _ in pairs]
    texts = [f"{len(records)} recordings"]
    for way in WAYS:
        spread = np.std(ratio[way], ddof=1) / np.sqrt(len(records)) if len(records) > 1 else 0.0
        texts.append(
            f"{way} u {np.exp(np.mean(ratio[way])):.3f} ± {spread:.3f}, error {np.sqrt(np.mean(error[way])):.2f}, "
            f"hold {100 * np.mean(hold[way]):.1f}"
        )
    texts.append(f"{len(hold['normal'])} intervals")
    chance = np.array([record["tails"]["weighed"] for record in records])
    texts.append(f"tails: median {np.median(chance):.2f}, above ½ {np.mean(chance > 0.5):.2f}")
    texts.append(f"R-hat {np.median([max(record['rhat'].values()) for record in records]):.3f}")
    texts.append(f"{np.median([record['seconds'] for record in records]):.0f} s")
    return "; ".join(texts)


def main() -> None:
    """Run, and count."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--only", nargs="*", default=["t3"], help="words of the cells' names")
    parser.add_argument("--recordings", type=int, default=12, help="of each cell")
    parser.add_argument("--processes", type=int, default=1)
    parser.add_argument("--seed", type=int, default=5101)
    parser.add_argument("--tally", action="store_true", help="count what is there, and run nothing")
    chosen = parser.parse_args()
    if not chosen.tally:
        done = {(record["cell"], record["number"]) for record in kept(chosen.folder)}
        some = [
            cell for cell in cells() if any(word in cell.name for word in chosen.only) and cell.stated == "unstated"
        ]
        tasks = [(c, chosen.seed, i) for i in range(chosen.recordings) for c in some if (c.name, i) not in done]
        measure(tasks, chosen.folder, chosen.processes, weighed)
    print(tally(kept(chosen.folder)))


if __name__ == "__main__":
    main()
