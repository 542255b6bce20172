"""Do 95 % intervals of parts hold? Machines with a hidden truth, calibrated and corrected, then measuring a part as made.

Truth, recordings, the measured part and what a drawing asks of it come from :mod:`benchmarks.parts.truth`, which shares no
code with the package. Every machine has all common errors, as large as physics allows. The calibration models six of them;
the machine corrects its estimates; parts are measured on the truth, and their intervals stated given the recording, as
``cmm-uq part`` does.

Run: ``python -m benchmarks.parts.machines FOLDER [--machines N] [--only WORDS]``, of other parts with ``--place-um``,
``--form-um``; ``--page`` writes the table of the page of what is there.
Every machine is appended to ``FOLDER/<cell>.jsonl`` as it is done: a run can be stopped and taken up again.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache, partial
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.coverage.measuring import counted, kept
from benchmarks.coverage.study import measure, waiting
from benchmarks.parts import truth
from benchmarks.parts.known_noise import joint_posterior
from benchmarks.parts.studied import CHARACTERISTICS, MACHINE, U_TIP_UM, WORDS, as_points, joined, plan
from cmm_uq.analysis.machine.conditional import further_recording, given_recording, own_noise, white
from cmm_uq.analysis.machine.passed import LengthsUnderTest, passed_test, prescribed
from cmm_uq.analysis.machine.recordings import CONTRADICTED, FurtherRecording, FurtherRecordings
from cmm_uq.analysis.machine.regions import with_readings
from cmm_uq.analysis.machine.state import MachineState, StatedNoise, unmodelled_errors, with_curves
from cmm_uq.analysis.parts.causes.surroundings import Expansion, Surroundings
from cmm_uq.analysis.parts.evaluation import Evaluator, Known
from cmm_uq.analysis.parts.plan import PartPose
from cmm_uq.analysis.parts.result import evaluated, stated
from cmm_uq.analysis.parts.virtual import MeasurementConditions, Virtual
from cmm_uq.app.commands.estimation import doubt_of
from cmm_uq.artefacts.ballbar import Ballbar
from cmm_uq.artefacts.gauge_lines import StepGauge
from cmm_uq.artefacts.spheres.kind import RingFacts
from cmm_uq.artefacts.spheres.ring import RingGauge
from cmm_uq.base.points import Machine
from cmm_uq.jobs.tables.artefact import ArtefactFacts, ReferencedFacts
from cmm_uq.jobs.tables.conformity import Circumstances, TestUncertainty
from cmm_uq.machine.model import RecordingModel
from cmm_uq.machine.model.artefact import Artefact
from cmm_uq.machine.model.artefact_doubt import causes_of
from cmm_uq.machine.physics.catalogue import effects
from cmm_uq.maths.uncertainty.propagation import Source, simulate

PAGE = Path(__file__).parents[2] / "docs" / "parts-study.md"
BEGIN, END = "<!-- written by benchmarks.parts.machines -->", "<!-- end -->"
TRIALS, PILOT = 10_000, 2000
NAMED, PROBED = effects(truth.SIX), effects(("probe_radius",))
UNMODELLED = tuple(one for one in unmodelled_errors(truth.SIX, {}) if "time_s" not in one.effect.columns)
BAR_MM, U_BAR_UM = 400.0, 0.5
GAUGE_MM, U_GAUGE_UM = 800.0, 0.4
RING_MM, U_RING_UM, RING_FORM_UM = 30.0, 0.2, 0.2
RING_AT = np.array(
    [*truth.CENTRES["h2"], float(np.mean(truth.DEPTHS))]
)  # beside a bore of its size, in the part's frame
FACES = {"step gauge": 6, "dense gauge": 41}
"""On each of the seven lines of a gauge."""
U_TEST_UM, MPE_K = 0.5, 750.0  # of a tested length; mm in which a permissible error grows by itself
PART = Expansion(11.5e-6, 1e-6, 21.0, 0.3)
SCALE = Expansion(8e-6, 1e-6, 22.0)  # of machines in a warm room


@dataclass(frozen=True)
class Cell:
    """Machines that are calibrated alike.

    Parameters
    ----------
    artefact : bars, free bars (whose length nobody certified), a step gauge, or a dense gauge of many more faces.
    noise : ``stated``: white, and the job says how large; ``white``, ``set-up``: to be found, of an offset of each set-up too.
    share : of all machines.
    """

    artefact: str
    noise: str
    share: float

    @property
    def name(self) -> str:
        """Of its file too."""
        return f"{self.artefact}, {self.noise}"

    @property
    def key(self) -> tuple[int, int]:
        """Seeds of its own."""
        return ("bars", "free bars", *FACES).index(self.artefact), ("stated", "white", "set-up").index(self.noise)


@dataclass(frozen=True)
class Made:
    """What is made, the same for all machines.

    Parameters
    ----------
    place_um, form_um : by how much the part is off (:func:`benchmarks.parts.truth.made_part`).
    periods : whether machines have periodic errors, and reckon with them.
    """

    place_um: float = 20.0
    form_um: float = 2.0
    periods: bool = True


CELLS = (
    *(Cell(artefact, "stated", 0.2375) for artefact in ("bars", "free bars", *FACES)),
    *(
        Cell(artefact, noise, 0.01 if artefact not in FACES else 0.005)
        for noise in ("white", "set-up") for artefact in ("bars", "free bars", "step gauge")
    ),
)  # fmt: skip


@cache
def nominal() -> Known:
    """The part's features at their nominal points, which are those of every machine."""
    known: Known = {}
    Evaluator(plan(), np.zeros_like(plan().points), (), known)
    return known


def calibrated(
    cell: Cell, hidden: truth.Truth, sigma: float, offset: float, random: np.random.Generator, warm: float = 0.0,
    near: np.ndarray | None = None,
) -> Artefact:  # fmt: skip
    """The recording of a calibration as the package reads it; ``warm``: relative expansion of the artefact that is left.

    ``near``: place of a ring, mm.
    """
    repeats = 1 if cell.noise == "stated" else 3
    if near is not None and cell.artefact == "ring":
        diameter, larger = (
            RING_MM + 1e-3 * U_RING_UM * random.standard_normal(),
            0.5e-3 * U_TIP_UM * random.standard_normal(),
        )
        made = truth.ring(hidden, near, diameter, 1e-3 * RING_FORM_UM, larger, repeats, sigma, random)
        return RingGauge(
            RingFacts(kind="ring", length_mm=RING_MM, u_um=U_RING_UM, form_um=RING_FORM_UM), as_points(made)
        )
    if cell.artefact in FACES:
        growth = 1e-3 * U_GAUGE_UM / GAUGE_MM * random.standard_normal() + warm
        made = truth.step_gauge(hidden, growth, repeats, sigma, offset, random, FACES[cell.artefact])
        return StepGauge(ReferencedFacts(kind="step_gauge", u_um=U_GAUGE_UM, length_mm=GAUGE_MM), as_points(made))
    length = (BAR_MM + 1e-3 * U_BAR_UM * random.standard_normal()) * (1 + warm)
    made = truth.bars(hidden, length, repeats, sigma, offset, random)
    certified = {} if cell.artefact == "free bars" else {"length_mm": BAR_MM, "u_um": U_BAR_UM}
    return Ballbar(ArtefactFacts(kind="ballbar", **certified), as_points(made))


def placed(random: np.random.Generator) -> PartPose:
    """Anywhere in the volume, turned anyhow about z."""
    angle = random.uniform(0, 2 * np.pi)
    turn = np.array([[np.cos(angle), -np.sin(angle), 0], [np.sin(angle), np.cos(angle), 0], [0, 0, 1]])
    middle = random.uniform([120, 120, -450], [780, 480, -150])
    return PartPose(turn, middle - turn @ [100.0, 50, 0])


def measured(task: tuple[Cell, int, int], made: Made = Made()) -> dict[str, Any]:
    """One machine: of each characteristic what is true, its value, u and interval; what was refused is kept in words."""
    cell, seed, number = task
    return counted(cell, seed, number, lambda random: _measured(cell, random, made))


def _measured(cell: Cell, random: np.random.Generator, made: Made) -> dict[str, Any]:
    hidden = truth.Truth.drawn(random, periods=made.periods)
    return on_machine(cell, hidden, random, made, 1e-3 * float(np.exp(random.uniform(*np.log([0.7, 2.0])))))


def on_machine(
    cell: Cell,
    hidden: truth.Truth,
    random: np.random.Generator,
    made: Made,
    sigma: float,
    machine: Machine = MACHINE,
    beside: Sequence[str] = (),
    *,
    tested: bool | None = None,
    warm_k: float = 0.0,
) -> dict[str, Any]:
    """A machine with a hidden truth, calibrated, corrected, measuring the part.

    ``sigma``: its noise, mm. ``machine``: as it is known, its axes read as is stated. ``beside``: artefacts of further
    certificates, in order; how probable each is by those before is kept, and one that is not is left out. ``tested``: whether
    a test of lengths that the corrected machine passed is stated besides; ``None`` for no test, which is made else anyhow.
    ``warm_k``: standard uncertainty, as stated, of the temperatures of the artefact in the calibration and of each scale on
    the day of the part, when these are at 22 °C.
    """
    unmodelled = tuple(one for one in UNMODELLED if made.periods or not one.effect.name.startswith("periodic"))
    offset = sigma * float(random.uniform(0.5, 2.0)) if cell.noise == "set-up" else 0.0
    of_artefact = PART.cte_per_k * warm_k * float(random.standard_normal()) if warm_k else 0.0
    model = RecordingModel(calibrated(cell, hidden, sigma, offset, random, of_artefact), NAMED)
    stated_k = Circumstances(cte_per_k=PART.cte_per_k, uncertainty=TestUncertainty(u_temperature_k=warm_k))
    causes = causes_of(model.artefact, stated_k) if warm_k else ()
    given = sigma if cell.noise == "stated" else None
    _, mean, _ = joint_posterior(model, (), sigma)
    certificate = with_curves(MachineState(machine, NAMED, mean[None], StatedNoise(np.full(3, sigma)),
                                           unmodelled=with_readings(unmodelled, machine), corrections=mean))  # fmt: skip
    seed, taken, chances = int(random.integers(2**31)), list[FurtherRecording](), list[float]()
    doubt = doubt_of(model, model.estimate(), sigma, causes)
    state = given_recording(certificate, model, given, TRIALS, seed, doubt)
    known = None if given is None else white(given)
    for artefact in beside:
        first = FurtherRecording(model, own_noise(model, certificate.unmodelled, seed, known))
        other = RecordingModel(calibrated(replace(cell, artefact=artefact), hidden, sigma, offset, random), NAMED)
        found = further_recording(first, other, certificate.unmodelled, seed, given)
        chances.append(found.contradiction(state))
        if chances[-1] >= CONTRADICTED:
            taken.append(found)
            state = given_recording(certificate, model, given, TRIALS, seed, beside=FurtherRecordings(tuple(taken)))
    corrected = truth.Truth.of_six(dict(zip(truth.SIX, mean, strict=True)))
    if tested is not None:
        lengths, errors = truth.tested_lengths(hidden, corrected, sigma, U_TEST_UM, random)
        times = float(np.max(np.abs(errors) / (1 + lengths / MPE_K)[:, None])) / float(random.uniform(0.4, 1.0))
        artefact = LengthsUnderTest(prescribed(machine), machine, bidirectional=True)
        limit, u = times * (1 + artefact.nominal / MPE_K), np.full(len(artefact.nominal), 1e-3 * U_TEST_UM)
        keys = [(effect.name, one.name) for effect in NAMED for one in effect.coefficients]
        corrects = dict(zip(keys, mean.tolist(), strict=True))
        found = replace(passed_test(model, artefact, limit, u, sigma, 3), corrections=corrects)
        chances.append(found.passing(state))
        if tested and chances[-1] >= CONTRADICTED:
            state = given_recording(certificate, model, given, TRIALS, seed, beside=FurtherRecordings((*taken, found)))
    growth = (PART.cte_per_k + PART.u_cte_per_k * random.standard_normal()) * (
        PART.temperature_c - 20 + PART.u_temperature_k * random.standard_normal()
    ) - PART.cte_per_k * (PART.temperature_c - 20)
    scales, today = Surroundings().scales, hidden
    if warm_k:
        scales, cte = (replace(SCALE, u_temperature_k=warm_k),) * 3, SCALE.u_cte_per_k * random.standard_normal()
        kelvin = SCALE.excess + warm_k * random.standard_normal(3)
        expanded = (SCALE.cte_per_k + cte) * kelvin - SCALE.cte_per_k * SCALE.excess
        today = replace(hidden, scale=hidden.scale + 1e6 * expanded)
    pose = placed(random)
    part = truth.made_part(random, made.place_um, made.form_um)
    measuring = truth.Measuring(today, corrected, pose.rotation, pose.translation_mm, float(np.hypot(sigma, offset)),
                                1e-3 * U_TIP_UM * float(random.standard_normal()), float(growth))  # fmt: skip
    normals = np.concatenate([normal for _, normal in truth.nominal_part().values()])
    points = measuring.measured(joined(part), normals, random)
    true = truth.characteristics(part)
    how = MeasurementConditions(state, (pose,), Surroundings(PART, scales), measured=points)
    virtual = Virtual(plan(), how, dict(nominal()), PILOT)
    errors = virtual.errors(random, TRIALS)
    simulated = simulate(Source(virtual.names, lambda _, n: np.ascontiguousarray(errors[:n].T)), TRIALS)
    rows = {one.name: [true[one.name], one.value, one.u, *one.interval]
            for one in stated(simulated, evaluated(plan(), points), plan(), errors)}  # fmt: skip
    denied = [one.of for one in state.statements if one.denied]
    return {
        "intervals": rows,
        **({"denied": denied} if machine.read_by else {}),
        **({"chances": chances} if chances else {}),
        "sigma_um": round(1e3 * sigma, 3),
        "offset_um": round(1e3 * offset, 3),
    }


GROUPS = {"all": ("",), "bars": ("bars, ",), "free bars": ("free bars, ",), "step gauge": ("step gauge, ",),
          "dense gauge": ("dense gauge, ",), "noise to be found": (", white", ", set-up")}  # fmt: skip
"""Columns of the page: cells whose name has one of these in it; "bars, " at its beginning."""


def tables(folder: Path) -> str:
    """What holds, by calibration and over all: coverage, and the median u."""
    records = kept(folder)
    done = [record for record in records if "intervals" in record]
    lines = ["| characteristic | " + " | ".join(GROUPS) + " |", "| --- " * (len(GROUPS) + 1) + "|"]
    chosen = {name: [r for r in done if _in(r["cell"], words)] for name, words in GROUPS.items()}
    for one in CHARACTERISTICS:
        unit, word = (1e6, "µrad") if one.what == "angle" else (1e3, "µm")
        cells = []
        for some in chosen.values():
            true, _, u, low, high = np.array([r["intervals"][one.name] for r in some]).T
            cells.append(f"{100 * np.mean((low <= true) & (true <= high)):.1f} %, {unit * np.median(u):.3g} {word}")
        lines.append(f"| {WORDS[one.name]} | " + " | ".join(cells) + " |")
    lines.append("| machines | " + " | ".join(str(len(some)) for some in chosen.values()) + " |")
    scatter = [f"{100 * np.sqrt(0.05 * 0.95 / len(some)):.1f} %" for some in chosen.values()]
    lines.append("| a coverage of 95 % scatters by | " + " | ".join(scatter) + " |")
    seconds = np.mean([r["seconds"] for r in records])
    return "\n".join([*lines, "", f"{len(records) - len(done)} faults; {seconds:.2f} s of CPU a machine"])


def written(folder: Path, page: Path = PAGE) -> None:
    """The page with its table anew; what is said of it in words is by hand."""
    before, _, rest = page.read_text(encoding="utf-8").partition(BEGIN)
    page.write_text(f"{before}{BEGIN}\n\n{tables(folder)}.\n\n{END}{rest.partition(END)[2]}", encoding="utf-8")


def _in(cell: str, words: tuple[str, ...]) -> bool:
    return any(cell.startswith(word) if word.endswith(", ") else word in cell for word in words)


def main() -> None:
    """Run, then say what there is."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--machines", type=int, default=10_000)
    parser.add_argument("--only", nargs="*", default=[], help="words of the cells' names")
    parser.add_argument("--processes", type=int, default=2)
    parser.add_argument("--seed", type=int, default=2026)
    parser.add_argument("--page", action="store_true", help="write the table of the page, and run nothing")
    parser.add_argument("--place-um", type=float, default=Made.place_um, help="by how much features are off")
    parser.add_argument("--form-um", type=float, default=Made.form_um, help="form of every feature")
    parser.add_argument("--without-periods", action="store_true", help="machines have no periodic errors")
    chosen = parser.parse_args()
    made = Made(chosen.place_um, chosen.form_um, not chosen.without_periods)
    if not chosen.page:
        some = [cell for cell in CELLS if not chosen.only or any(word in cell.name for word in chosen.only)]
        tasks = [
            task
            for cell in some
            for task in waiting([cell], chosen.folder, chosen.seed, round(cell.share * chosen.machines))
        ]
        tasks.sort(key=lambda task: task[2] / task[0].share)
        measure(tasks, chosen.folder, chosen.processes, partial(measured, made=made))
    else:
        written(chosen.folder)
    print(tables(chosen.folder))


if __name__ == "__main__":
    main()
