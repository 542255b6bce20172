"""Simulated recordings: drawn from exactly the model that the estimator fits."""

from __future__ import annotations

import contextlib
import csv
import io
from collections.abc import Iterator, Mapping
from dataclasses import replace
from math import inf
from pathlib import Path
from typing import Any

import numpy as np

from cmm_uq.app.commands.reading import job_of, read_job
from cmm_uq.artefacts import kind_of
from cmm_uq.base.errors import CmmUqError, suggestion
from cmm_uq.base.files.limits import JOB_BYTES, content_of
from cmm_uq.base.files.table import LONGEST_MM
from cmm_uq.base.files.toml_file import as_toml, checked
from cmm_uq.base.output import Owner, staged
from cmm_uq.base.overflow import refusing_overflow
from cmm_uq.base.plugins import naming_package
from cmm_uq.base.points import AXES, Floats, Points
from cmm_uq.base.units import MICROMETRE
from cmm_uq.certificate.origin import program
from cmm_uq.jobs.derived_job import IN_THE_RECORDING, NoiseFacts, Truth, derived_toml, kept_inputs, recording_name
from cmm_uq.jobs.job import Job
from cmm_uq.jobs.tables.identification import PLANNED, first_line
from cmm_uq.machine.model import Noise, RecordingModel
from cmm_uq.machine.model.artefact import Artefact
from cmm_uq.machine.physics.catalogue import effects
from cmm_uq.machine.physics.stated import physics_of

TRUTH = "truth.toml"  # name of the truth in the folder of a simulated job
_TRUTH_GIVES = "It gives the effects, the noise and the seed"
_ROUNDS = 4  # each brings the errors of an arm's joints nearer by what they are over its reach
_FIX = "Give effects, sizes and noise that a machine can have"


@naming_package()
def simulate(job: Job, truth: Truth, *, seed: int | None = None, truth_path: str = TRUTH) -> Points:
    """The points of a recording with the placings of the job's own."""
    with physics_of(job, *truth.columns):
        return _simulated(job, truth, seed, truth_path)


def _simulated(job: Job, truth: Truth, seed: int | None, truth_path: str) -> Points:
    columns = {name: np.full(len(job.points), value) for name, value in truth.columns.items()}
    points = replace(job.points, columns={**job.points.columns, **columns})
    observe = kind_of(job).observing("simulated")
    if not job.planned:
        from cmm_uq.app.commands.model import refuse_unfit  # the screening, which a plan's coordinates need not pass

        refuse_unfit(job)
    artefact = observe(job.facts.artefact, points, where=job.recording_path)
    where = f"{truth_path} [effects]"
    named = effects(tuple(truth.effects), where=where)
    with _placed(where, always=True):
        acting = tuple(map(artefact.acting, named))
    needed = [(f"[effects.{effect.name}]", effect.name, column) for effect in acting for column in effect.columns]
    needed += [("[noise] slow_um", "slow noise", "time_s")] if truth.noise.slow_um else []
    for key, what, column in needed:
        if column not in points.columns:
            raise CmmUqError(f"{what} needs the column {column}, which the recording has not", where=f"{truth_path} {key}",
                             fix=f"Record {column}, give it in [columns], or leave this out")  # fmt: skip
    coefficients, shapes = [np.zeros(0)], {}
    for effect in acting:
        with _placed(f"{truth_path} [effects.{effect.name}]"):
            values, shapes[effect.name] = effect.from_reported(truth.effects[effect.name])
        coefficients.append(values)
    sizes = _sizes(artefact, truth, truth_path)
    for _ in range(_ROUNDS):
        model = RecordingModel(artefact, acting, shapes=shapes)
        random = np.random.default_rng(truth.seed if seed is None else seed)
        with refusing_overflow(truth_path, _FIX):
            drawn = model.simulate(np.concatenate(coefficients), sizes, _noise(truth.noise), random)
        if not np.all(np.abs(drawn) <= LONGEST_MM):
            raise CmmUqError(f"the coordinates would go beyond {LONGEST_MM:g} mm", where=truth_path, fix=_FIX)
        found = artefact.recorded(points, drawn)
        moved = [
            name
            for name, values in found.columns.items()
            if name.startswith("q") and values is not points.columns[name]
        ]
        if not moved:
            break
        # an arm errs as its joints stand, and these are where they bring the tool to what is indicated
        points = replace(points, columns={**points.columns, **{name: found.columns[name] for name in moved}})
        artefact = observe(job.facts.artefact, points, where=job.recording_path)
    return found


@contextlib.contextmanager
def _placed(where: str, *, always: bool = False) -> Iterator[None]:
    """What is refused of the truth, with where it stands in its file."""
    try:
        yield
    except CmmUqError as error:
        raise CmmUqError(error.problem, where=where if always else error.where or where, fix=error.fix) from None


def write_simulation(
    job: Path, truth: Path, out: Path, *, seed: int | None = None, force: bool = False
) -> dict[str, Path]:
    """Write a job folder with a simulated recording, marked as such, and the truth that it was drawn from."""
    read = read_job(job)
    kind_of(read).observing("simulated")
    content = content_of(truth, JOB_BYTES, _TRUTH_GIVES)
    checked(content, truth, Truth)
    owner, expected = Owner("simulate", read.facts.job.id, read.origin), (*read.inputs, TRUTH)
    with staged(out, owner, inputs=(*read.paths, truth), force=force, expected=expected) as place:
        return place.write(_files(read, content, truth, seed))


def simulated_job(job: Job, truth: Path | Mapping[str, Any], *, seed: int | None = None) -> Job:
    """The job that :func:`write_simulation` writes, in memory."""
    kind_of(job).observing("simulated")
    path = truth if isinstance(truth, Path) else Path(TRUTH)
    content = content_of(path, JOB_BYTES, _TRUTH_GIVES) if isinstance(truth, Path) else as_toml(truth, TRUTH)
    return job_of(_files(job, content, path, seed))


def _files(job: Job, content: bytes, truth: Path, seed: int | None) -> dict[str, bytes]:
    """Every file of the simulated job; ``truth`` is where ``content`` was read, for messages."""
    drawn = checked(content, truth, Truth)
    points = simulate(job, drawn, seed=seed, truth_path=str(truth))
    how = f", seed {drawn.seed if seed is None else seed}, from {TRUTH}"
    files = {
        **kept_inputs(job),
        recording_name(job): first_line("simulate", program(job, drawn.effects), how).encode() + recording(points),
        TRUTH: content,
    }
    return {"job.toml": derived_toml(job, "simulate", files, without=IN_THE_RECORDING), **files}


def recording(points: Points) -> bytes:
    """Points as a recording's CSV: coordinates to 0.1 nm, everything else as it was read."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    columns = points.machine.columns_as_recorded(points.columns)
    names = ["measurement", "point", "repeat", *(f"{axis}_mm" for axis in AXES), *columns]
    writer.writerow(names)
    xyz = points.machine.as_recorded(points.xyz, points.columns)
    for i in range(len(points)):
        numbers = [points.measurement[i], points.point[i], points.repeat[i]]
        coordinates = [f"{value:.7f}" for value in xyz[i]]
        writer.writerow([*numbers, *coordinates, *(f"{values[i]:.10g}" for values in columns.values())])
    return text.getvalue().encode()


def to_fill_in(points: Points) -> bytes:
    """Points at nominal coordinates as the CSV of a recording that is still to be measured."""
    return PLANNED.encode() + recording(points)


def _noise(given: NoiseFacts) -> Noise:
    x, y, z = (sd * MICROMETRE for sd in given.coordinates_um)
    return Noise(
        (x, y, z), given.placing_um * MICROMETRE, given.growth_um * MICROMETRE, given.slow_um * MICROMETRE,
        inf if given.slow_time_s == "never" else given.slow_time_s, given.tails_dof or 0.0, given.resolution_um * MICROMETRE,
    )  # fmt: skip


def _sizes(artefact: Artefact, truth: Truth, path: str) -> Floats:
    names = [size.name for size in artefact.sizes]
    for name in truth.artefact:
        if name not in names:
            raise CmmUqError(f"a {artefact.kind} has no size {name!r}", where=f"{path} [artefact]",
                             fix=suggestion(name, names) if names else "Leave it out")  # fmt: skip
    return np.array([truth.artefact.get(size.name, size.nominal) for size in artefact.sizes], dtype=np.float64)
