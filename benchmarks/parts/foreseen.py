"""What a further recording is foretold to do to U of a part, beside what it then does.

Machines of :mod:`benchmarks.parts.curved` are calibrated and measure the part; then each proposal of ``cmm-uq part``
is recorded on the truth, taken together with the calibration, and the same part evaluated again.

Run: ``python -m benchmarks.parts.foreseen FOLDER [--machines N] [--only WORDS]``; a run can be stopped and taken up again;
``--page`` writes the table of the page.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import compress
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.coverage.measuring import counted, kept
from benchmarks.parts import curved, machines, truth
from benchmarks.parts.known_noise import joint_posterior
from benchmarks.parts.studied import CHARACTERISTICS, MACHINE, U_TIP_UM, WORDS, joined, plan
from cmm_uq.analysis.machine.conditional import further_recording, given_recording, own_noise, white
from cmm_uq.analysis.machine.recordings import FurtherRecording, FurtherRecordings
from cmm_uq.analysis.machine.regions import with_readings
from cmm_uq.analysis.machine.state import MachineState, StatedNoise, with_curves
from cmm_uq.analysis.parts.causes.surroundings import Surroundings
from cmm_uq.analysis.parts.foreseen import LEVELS, foreseen_ratios, foretold
from cmm_uq.analysis.parts.result import evaluated, stated
from cmm_uq.analysis.parts.virtual import MeasurementConditions, Virtual
from cmm_uq.app.commands.parts.proposals import (
    BALL_MM,
    BALL_UM,
    GAUGE_UM,
    RING_UM,
    ProposedMeasurement,
    bore_of,
    proposals,
)
from cmm_uq.artefacts.gauge_lines import StepGauge
from cmm_uq.artefacts.kinds import SphereFacts
from cmm_uq.artefacts.spheres.kind import RingFacts
from cmm_uq.artefacts.spheres.ring import RingGauge
from cmm_uq.artefacts.spheres.sphere import SphereArtefact
from cmm_uq.base.points import Floats
from cmm_uq.jobs.tables.artefact import ReferencedFacts
from cmm_uq.machine.model import RecordingModel
from cmm_uq.machine.model.artefact import Artefact
from cmm_uq.maths.uncertainty.propagation import Source, simulate

BEGIN, END = "<!-- written by benchmarks.parts.foreseen -->", "<!-- end of foreseen -->"
SORTS = [
    sort for sort in curved.SORTS if sort.name not in ("ten times better", "ten times worse", "as the priors have it")
]
WAYS = ("dense lines", "lines about the part", "lines through the range", "ball", "ring")
SIGMA = 0.7e-3
PLAN = replace(plan(), characteristics=tuple(compress(CHARACTERISTICS, foretold(plan()))))


@dataclass(frozen=True)
class Cell:
    """Machines of one class, calibrated alike."""

    sort: curved.Sort
    artefact: str
    noise: str

    @property
    def name(self) -> str:
        return f"{self.sort.name}, {self.artefact}, {self.noise}"

    @property
    def key(self) -> tuple[int, ...]:
        return SORTS.index(self.sort), *machines.Cell(self.artefact, self.noise, 0.0).key


CELLS = tuple(
    Cell(sort, artefact, noise)
    for noise in ("stated", "white")
    for artefact in ("bars", "step gauge")
    for sort in SORTS
)


def measured(task: tuple[Cell, int, int]) -> dict[str, Any]:
    """One machine, by characteristic: U before, mm and rad; of each way U found, and U foretold over U before at LEVELS."""
    cell, seed, number = task
    return counted(cell, seed, number, lambda random: _measured(cell, random))


def _measured(cell: Cell, random: np.random.Generator) -> dict[str, Any]:
    hidden, calibration = curved.drawn(cell.sort, random), machines.Cell(cell.artefact, cell.noise, 0.0)
    sigma = SIGMA if cell.noise == "stated" else None
    model = RecordingModel(machines.calibrated(calibration, hidden, SIGMA, 0.0, random), machines.NAMED)
    _, mean, _ = joint_posterior(model, (), SIGMA)
    noise, others = StatedNoise(np.full(3, SIGMA)), with_readings(machines.UNMODELLED, MACHINE)
    certificate = with_curves(
        MachineState(MACHINE, machines.NAMED, mean[None], noise, unmodelled=others, corrections=mean)
    )
    seed = int(random.integers(2**31))
    state = given_recording(certificate, model, sigma, machines.TRIALS, seed)
    corrected = truth.Truth.of_six(dict(zip(truth.SIX, mean, strict=True)))
    pose, part = machines.placed(random), truth.made_part(random)
    measuring = truth.Measuring(hidden, corrected, pose.rotation, pose.translation_mm, SIGMA, 0.0, 0.0)
    normals = np.concatenate([normal for _, normal in truth.nominal_part().values()])
    points = measuring.measured(joined(part), normals, random)

    def virtual_of(known: MachineState) -> tuple[Virtual, MeasurementConditions]:
        how = MeasurementConditions(known, (pose,), Surroundings(machines.PART), measured=points)
        return Virtual(PLAN, how, dict(machines.nominal()), machines.PILOT), how

    def expanded(virtual: Virtual) -> Floats:
        errors = virtual.errors(np.random.default_rng(seed), machines.TRIALS)
        drawn = simulate(Source(virtual.names, lambda _, n: np.ascontiguousarray(errors[:n].T)), machines.TRIALS)
        return np.array([one.U for one in stated(drawn, evaluated(PLAN, points), PLAN, errors)])

    virtual, how = virtual_of(state)
    before = expanded(virtual)
    known = None if sigma is None else white(sigma)
    first = FurtherRecording(model, own_noise(model, certificate.unmodelled, seed, known))
    found: dict[str, Any] = {"before": before.tolist(), "foretold": {}, "found": {}}
    ways = proposals(virtual.places[0].points, PLAN.styli[0], bore=bore_of(PLAN, [1]))
    for way, one in zip(WAYS, ways, strict=True):
        beside = FurtherRecordings((one.recording(model, state.noise),))
        found["foretold"][way] = np.quantile(
            foreseen_ratios(virtual, how, model, beside, seed), LEVELS, axis=0
        ).tolist()
        other = RecordingModel(recorded(one, hidden, random), (*machines.NAMED, *one.beside))
        taken = further_recording(first, other, certificate.unmodelled, seed, sigma)
        after = given_recording(certificate, model, sigma, machines.TRIALS, seed, beside=FurtherRecordings((taken,)))
        found["found"][way] = (expanded(virtual_of(after)[0])).tolist()
    return found


def recorded(one: ProposedMeasurement, hidden: truth.Truth, random: np.random.Generator) -> Artefact:
    """A proposal as the machine with the hidden truth reads it: an artefact that is off by as much as its u says."""
    planned = one.artefact.points
    tip = np.array([planned.columns[f"tip_{axis}_mm"][0] for axis in "xyz"])
    approach = np.column_stack([planned.columns[f"approach_{axis}"] for axis in "xyz"])
    xyz = planned.xyz
    off, ring = float(random.standard_normal()), isinstance(one.artefact, RingGauge)
    if isinstance(one.artefact, StepGauge):
        reference = planned.columns["reference_mm"]
        along = one.artefact.directions(planned.xyz)
        xyz = xyz + (1e-3 * GAUGE_UM * off / reference.max()) * reference[:, None] * along
    else:
        n = np.column_stack([planned.columns[f"n{axis}"] for axis in "xyz"])
        xyz = xyz + 0.5e-3 * off * (-RING_UM if ring else BALL_UM) * n
    read = hidden.read(xyz, tip, approach)
    if ring:  # by a tip that is as wrong as those of parts are
        read = read + 0.5e-3 * U_TIP_UM * float(random.standard_normal()) * n
    points = planned.at(read + tip + SIGMA * random.standard_normal(read.shape))
    if isinstance(one.artefact, StepGauge):
        longest = float(one.artefact.reference.max())
        return StepGauge(ReferencedFacts(kind="step_gauge", u_um=GAUGE_UM, length_mm=longest), points)
    if isinstance(one.artefact, RingGauge):
        return RingGauge(RingFacts(kind="ring", length_mm=one.artefact.sizes[0].nominal, u_um=RING_UM), points)
    return SphereArtefact(SphereFacts(kind="sphere", length_mm=BALL_MM, u_um=BALL_UM), points)


def tables(folder: Path) -> str:
    """By class and by characteristic: what U became, and what it was foretold to become."""
    records = [record for record in kept(folder) if "found" in record]
    sets = {sort.name: [r for r in records if r["cell"].startswith(f"{sort.name}, ")] for sort in SORTS}
    for word in ("bars", "step gauge", "stated", "white"):
        sets[f"all, {word}"] = [r for r in records if f", {word}" in r["cell"]]
    lines = [f"| machines | number | {' | '.join(WAYS)} |", "| --- " * (2 + len(WAYS)) + "|"]
    for name, some in {**sets, "all": records}.items():
        lines.append(f"| {name} | {len(some)} | " + " | ".join(_ratio(some, way) for way in WAYS) + " |")
    lines += ["", f"| characteristic | {' | '.join(WAYS)} |", "| --- " * (1 + len(WAYS)) + "|"]
    for i, one in enumerate(PLAN.characteristics):
        lines.append(f"| {WORDS[one.name]} | " + " | ".join(_ratio(records, way, i) for way in WAYS) + " |")
    faults, seconds = sum("fault" in r for r in kept(folder)), np.mean([r["seconds"] for r in kept(folder)])
    return "\n".join([*lines, "", f"{faults} faults; {seconds:.1f} s of CPU a machine"])


def _ratio(done: list[dict[str, Any]], way: str, only: int | None = None) -> str:
    some = slice(None) if only is None else slice(only, only + 1)
    found, before = (
        np.array([of(r) for r in done])[:, some] for of in (lambda r: r["found"][way], lambda r: r["before"])
    )
    _, middle, high = np.moveaxis(np.array([r["foretold"][way] for r in done])[:, :, some], 1, 0)
    ratio, holds = found / (before * np.minimum(middle, 1.0)), np.mean(found <= before * high)
    low, usual, most = np.quantile(ratio, [0.1, 0.5, 0.9])
    return f"{np.median(found / before):.2f}; **{usual:.2f}**, {low:.2f} to {most:.2f}; {100 * holds:.0f} %"


if __name__ == "__main__":
    curved.study(str(__doc__), CELLS, measured, tables, (BEGIN, END), 2052)
