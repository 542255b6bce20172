"""Machines with one certificate, and with a further one of a ring that stood near a bore of the part.

The ring, 30 mm, lies within 20 mm of the larger bore and within 10 mm of its height, and is probed with the stylus of the
part, 25 points around; diameter and roundness are off by as much as is stated. The effective radius of the tip is off too, and
estimated from the ring. Machines are those of :mod:`benchmarks.parts.curved`, each with the ring and without; noise, 0.7 µm,
is stated. Of the first five of each cell it is foretold too what a ring in place of that bore will do.

Run: ``python -m benchmarks.parts.rings FOLDER [--machines N] [--only WORDS]``; a run can be stopped and taken up again;
``--page`` writes the table of the page.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.coverage.measuring import counted, kept
from benchmarks.parts import curved, machines, truth
from benchmarks.parts.foreseen import PLAN, SIGMA
from benchmarks.parts.known_noise import joint_posterior
from benchmarks.parts.studied import MACHINE, U_TIP_UM, WORDS, joined
from cmm_uq.analysis.machine.conditional import further_recording, given_recording, own_noise, white
from cmm_uq.analysis.machine.recordings import CONTRADICTED, FurtherRecording, FurtherRecordings
from cmm_uq.analysis.machine.regions import with_readings
from cmm_uq.analysis.machine.state import MachineState, StatedNoise, with_curves
from cmm_uq.analysis.parts.causes.surroundings import Surroundings
from cmm_uq.analysis.parts.foreseen import LEVELS, foreseen_ratios
from cmm_uq.analysis.parts.result import evaluated, stated
from cmm_uq.analysis.parts.virtual import MeasurementConditions, Virtual
from cmm_uq.app.commands.parts.proposals import bore_of, proposals
from cmm_uq.base.points import Floats
from cmm_uq.jobs.tables.conformity import Circumstances
from cmm_uq.machine.model import RecordingModel
from cmm_uq.machine.model.artefact_doubt import causes_of
from cmm_uq.maths.uncertainty.propagation import Source, simulate

BEGIN, END = "<!-- written by benchmarks.parts.rings -->", "<!-- end of rings -->"
SORTS = [sort for sort in curved.SORTS if not sort.warm_k and "ten times" not in sort.name]
TRIALS, FORETOLD = 4000, 5
SHOWN = ("d1", "d2", "apart", "x1", "length", "z ball")


@dataclass(frozen=True)
class Cell:
    """Machines of one class, calibrated alike."""

    sort: curved.Sort
    artefact: str

    @property
    def name(self) -> str:
        return f"{self.sort.name}, {self.artefact}"

    @property
    def key(self) -> tuple[int, ...]:
        return SORTS.index(self.sort), *machines.Cell(self.artefact, "stated", 0.0).key


CELLS = tuple(Cell(sort, artefact) for artefact in ("bars", "step gauge") for sort in SORTS)


def measured(task: tuple[Cell, int, int]) -> dict[str, Any]:
    """One machine: of each characteristic what is true, its value, u and interval, without the ring and with it."""
    cell, seed, number = task
    return counted(cell, seed, number, lambda random: _measured(cell, random, foretell=number < FORETOLD))


def _measured(cell: Cell, random: np.random.Generator, *, foretell: bool) -> dict[str, Any]:
    pose, hidden, calibration = (
        machines.placed(random),
        curved.drawn(cell.sort, random),
        machines.Cell(cell.artefact, "stated", 0),
    )
    model = RecordingModel(machines.calibrated(calibration, hidden, SIGMA, 0.0, random), machines.NAMED)
    _, mean, _ = joint_posterior(model, (), SIGMA)
    noise, others = StatedNoise(np.full(3, SIGMA)), with_readings(machines.UNMODELLED, MACHINE)
    certificate = with_curves(
        MachineState(MACHINE, machines.NAMED, mean[None], noise, unmodelled=others, corrections=mean)
    )
    seed = int(random.integers(2**31))
    near = pose.of(machines.RING_AT) + [20, 20, 10] * random.uniform(-1, 1, 3)
    ring = machines.calibrated(machines.Cell("ring", "stated", 0.0), hidden, SIGMA, 0.0, random, near=near)
    part, tip = truth.made_part(random), 1e-3 * U_TIP_UM * float(random.standard_normal())
    corrected = truth.Truth.of_six(dict(zip(truth.SIX, mean, strict=True)))
    measuring = truth.Measuring(hidden, corrected, pose.rotation, pose.translation_mm, SIGMA, tip, 0.0)
    normals = np.concatenate([normal for _, normal in truth.nominal_part().values()])
    points, true = measuring.measured(joined(part), normals, random), truth.characteristics(part)

    def virtual_of(known: MachineState) -> tuple[Virtual, MeasurementConditions]:
        how = MeasurementConditions(known, (pose,), Surroundings(), measured=points)
        return Virtual(PLAN, how, dict(machines.nominal()), machines.PILOT), how

    def rows(virtual: Virtual) -> dict[str, list[float]]:
        errors = virtual.errors(np.random.default_rng(seed), TRIALS)
        drawn = simulate(Source(virtual.names, lambda _, n: np.ascontiguousarray(errors[:n].T)), TRIALS)
        found = stated(drawn, evaluated(PLAN, points), PLAN, errors)
        return {one.name: [true[one.name], one.value, one.u, *one.interval] for one in found}

    state = given_recording(certificate, model, SIGMA, TRIALS, seed)
    virtual, how = virtual_of(state)
    first = FurtherRecording(model, own_noise(model, certificate.unmodelled, seed, white(SIGMA)))
    other = RecordingModel(ring, (*machines.NAMED, *machines.PROBED))
    doubts = causes_of(ring, Circumstances())
    taken = further_recording(first, other, certificate.unmodelled, seed, SIGMA, doubts)
    beside = FurtherRecordings((taken,))
    after = given_recording(certificate, model, SIGMA, TRIALS, seed, beside=beside)
    before, then = rows(virtual), rows(virtual_of(after)[0])
    chance = taken.contradiction(state)
    used = then if chance >= CONTRADICTED else before  # as ``cmm-uq part`` does
    found: dict[str, Any] = {"without": before, "with": used, "taken anyway": then, "chance": chance}
    if foretell:
        *_, way = proposals(virtual.places[0].points, PLAN.styli[0], bore=bore_of(PLAN, [1]))
        one = FurtherRecordings((way.recording(model, state.noise),))
        found["foretold"] = np.quantile(foreseen_ratios(virtual, how, model, one, seed), LEVELS, axis=0).tolist()
    return found


def tables(folder: Path) -> str:
    """By class: how often intervals hold, U over the errors that values really had, U with the ring over U without it."""
    records = [record for record in kept(folder) if "with" in record]
    chosen = {cell.name: [r for r in records if r["cell"] == cell.name] for cell in CELLS}
    heads = (
        "class, calibration",
        "machines",
        "contradicted",
        "all hold, without",
        "with",
        *(WORDS[name] for name in SHOWN),
    )
    lines = [f"| {' | '.join(heads)} |", "| --- " * len(heads) + "|"]
    for name, done in {**chosen, "all": records}.items():
        if not done:
            continue
        each = {which: {one: _rows(done, which, one) for one in done[0][which]} for which in ("without", "with")}
        hold = [f"{100 * np.mean([curved.holds(a) for a in e.values()]):.1f} %" for e in each.values()]
        cells = (_cell(each["without"][one], each["with"][one], of_all=done is records) for one in SHOWN)
        against = str(sum(r["chance"] < CONTRADICTED for r in done))
        lines.append("| " + " | ".join([name, str(len(done)), against, *hold, *cells]) + " |")
    lines += [
        "",
        "| foretold of machines | number | found over foretold | U does not exceed the upper end |",
        "| --- " * 4 + "|",
    ]
    for name, done in {**chosen, "all": records}.items():
        if some := [r for r in done if "foretold" in r]:
            lines.append(f"| {name} | {len(some)} | {_told(some)} |")
    faults, seconds = sum("fault" in r for r in kept(folder)), np.mean([r["seconds"] for r in kept(folder)])
    return "\n".join([*lines, "", f"{faults} faults; {seconds:.1f} s of CPU a machine"])


def _rows(done: list[dict[str, Any]], which: str, one: str) -> Floats:
    return np.array([r[which][one] for r in done]).T


def _cell(before: Floats, after: Floats, *, of_all: bool) -> str:
    """How often it holds with the ring; rms of the errors; U/2 over it, without and with the ring; U with over U without."""
    rms = float(np.sqrt(np.mean((after[1] - after[0]) ** 2)))
    half = [0.25 * (rows[4] - rows[3]) for rows in (before, after)]
    without, then = (float(np.median(each)) / rms for each in half)
    ratio = float(np.median(half[1] / half[0]))
    if of_all:  # classes together have no one size of errors
        return f"{100 * curved.holds(after).mean():.0f} %; **{ratio:.2f}**"
    return f"{100 * curved.holds(after).mean():.0f} %, {1e3 * rms:.2g} µm; {without:.1f} → {then:.1f}; **{ratio:.2f}**"


def _told(some: list[dict[str, Any]]) -> str:
    U = {
        which: np.array([[0.5 * (row[4] - row[3]) for row in r[which].values()] for r in some])
        for which in ("without", "taken anyway")
    }
    _, middle, high = np.moveaxis(np.minimum([r["foretold"] for r in some], 1.0), 1, 0)
    ratio = U["taken anyway"] / (U["without"] * middle)
    low, usual, most = np.quantile(ratio, [0.1, 0.5, 0.9])
    return f"**{usual:.2f}**, {low:.2f} to {most:.2f} | {100 * np.mean(U['taken anyway'] <= U['without'] * high):.0f} %"


if __name__ == "__main__":
    curved.study(str(__doc__), CELLS, measured, tables, (BEGIN, END), 2058)
