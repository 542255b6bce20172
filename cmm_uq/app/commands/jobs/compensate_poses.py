"""Poses of a robot, corrected by what a recording of it shows: where the tool truly is, and what its joints are to be told."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np

from cmm_uq.app.commands.files import Stage, silent
from cmm_uq.app.commands.model import recorded_model, refuse_planned
from cmm_uq.app.commands.reading import read_job
from cmm_uq.app.commands.report import evaluate_job
from cmm_uq.artefacts import kind_of
from cmm_uq.artefacts.optical.corrected_poses import CorrectedPoses, corrected_poses
from cmm_uq.artefacts.optical.tracked import TrackedPoints, joined
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.files.csv_table import csv_table
from cmm_uq.base.files.limits import JOB_BYTES, content_of
from cmm_uq.base.output import Owner, sha256_of, staged
from cmm_uq.base.points import AXES, Points
from cmm_uq.base.units import MICROMETRE
from cmm_uq.certificate.result import Result
from cmm_uq.jobs.derived_job import PROGRAM
from cmm_uq.jobs.job import Job
from cmm_uq.jobs.machines import by_joints
from cmm_uq.jobs.source import sha256
from cmm_uq.jobs.tables.identification import first_line
from cmm_uq.machine.model import RecordingModel
from cmm_uq.machine.physics.stated import physics_of

PROVENANCE = "compensation.json"


def write_corrected_poses(
    job: Path, poses: Path, out: Path, *, seed: int = 0, force: bool = False, stage: Stage = silent
) -> tuple[dict[str, Path], list[str]]:
    """Write the poses of a file (q1_deg, … a row each), corrected by a job's recording, and what that is worth in sentences.

    Returns and raises as :func:`~cmm_uq.app.commands.jobs.simulate.write_simulation`.
    """
    read = read_job(job)
    refuse_planned(read)
    name, owner = f"{poses.stem}-compensated.csv", Owner("compensate", read.facts.job.id, read.origin)
    with staged(out, owner, inputs=(*read.paths, poses), force=force, expected=(name, PROVENANCE)) as place:
        stage("Estimating the errors", 0.0)
        if not joined(read.points.machine):
            fix = "Give [[machine.joint]] rows, or compensate by error maps without --poses"
            raise CmmUqError("the machine has no joints, so no poses", where=str(read.folder / "job.toml"), fix=fix)
        kind = kind_of(read)
        kind.observing("made a correction of poses of")
        with physics_of(read):
            points = commanded(read, poses, recorded_model(read)[0])
        result = evaluate_job(read, seed=seed)
        if not isinstance(result, Result) or not isinstance(result.artefact, TrackedPoints):
            raise kind.refused("made a correction of poses of")
        stage("Correcting the poses", 0.8)
        with physics_of(read):
            found = corrected_poses(result.model, points)
        head = first_line("compensate", PROGRAM, f"; see {PROVENANCE}") if read.origin != "measured" else ""
        told, said = _told(read, poses, result, found), _worth(result, found)
        files = {
            name: (head + _table(points, found)).encode(),
            PROVENANCE: (json.dumps(told, indent=2) + "\n").encode(),
        }
        return place.write(files), said


def commanded(read: Job, poses: Path, model: RecordingModel) -> Points:
    """Poses of a file, which the rows of the job have somewhere within the travels of the joints."""
    machine = read.points.machine
    if not joined(machine):
        raise ValueError("no joints, no poses")
    content = content_of(poses, JOB_BYTES, "Give fewer poses at once")
    table = csv_table(content, str(poses), machine.columns_of_joints)
    asked = {column for effect in model.effects for column in effect.columns}
    for column in sorted(asked - set(table.header)):
        raise CmmUqError(
            f"has no column {column!r}, by which an effect of the job goes",
            where=str(poses),
            fix="Give it for each pose",
        )
    known = (*machine.columns_of_joints, *sorted(asked), *(f"{of}{a}_mm" for of in ("", "tip_") for a in AXES))
    columns = {column: table.numbers(column) for column in known if column in table.header}
    xyz = by_joints(machine, columns, table.lines, str(poses))
    count = len(xyz)
    number = table.numbers("point") if "point" in table.header else np.arange(1, count + 1)
    one, own = np.ones(count, dtype=np.int64), {name: of for name, of in columns.items() if name[1:] != "_mm"}
    return Points(xyz, one, number.astype(np.int64), one, machine, own)


def _table(points: Points, found: CorrectedPoses) -> str:
    names = [name for name in points.columns if name.startswith("q")]
    heads = ["point", *names, *(f"{axis}_mm" for axis in AXES), *(f"u_{axis}_um" for axis in AXES)]
    heads += ["uncorrected_um", "left_um"]
    lines = [",".join(heads)]
    um = np.column_stack([found.u, found.uncorrected, found.left]) / MICROMETRE
    for number, read, xyz, others in zip(points.point, found.readings, found.xyz, um, strict=True):
        cells = [f"{number}", *(f"{value:.6f}" for value in read), *(f"{value:.4f}" for value in xyz)]
        lines.append(",".join([*cells, *(f"{value:.2f}" for value in others)]))
    return "\n".join(lines) + "\n"


def _told(read: Job, poses: Path, result: Result, found: CorrectedPoses) -> dict[str, object]:
    return {
        "software": PROGRAM,
        "origin": "compensated",
        "recording": read.origin,
        "inputs_sha256": sha256(read.inputs) | {poses.name: sha256_of(poses)},
        "effects": [effect.name for effect in result.model.effects],
        "frame": result.job.facts.artefact.model_dump()["frame"],
        "diagnosis": result.diagnosed.diagnosis.verdict,
        "poses": len(found.xyz),
        "u": "of parameters, placing, and what the fitted robot leaves at a pose",
        "coverage_factor": round(found.coverage_factor, 4),
        "sign": "true = indicated + e",
    }


def _worth(result: Result, found: CorrectedPoses) -> list[str]:
    before, after = (
        float(np.sqrt(np.mean(np.round(each, 6) ** 2))) / MICROMETRE for each in (found.uncorrected, found.left)
    )
    u = float(np.sqrt(np.mean(found.u**2) * 3)) / MICROMETRE
    lines = [
        f"By the recording the tool is off by {before:.3g} µm rms as commanded, by {after:.3g} µm with corrected readings; "
        f"what stays uncertain of a place is {u:.3g} µm rms"
    ]
    if not result.diagnosed.diagnosis.agrees:
        lines.append("The recording shows more than the named errors: cmm-uq diagnose says what; u is without it")
    machine = result.artefact.points.machine
    if joined(machine):
        beyond = (found.readings < machine.limits[:, 0]) | (found.readings > machine.limits[:, 1])
        if beyond.any():
            lines.append(f"{int(beyond.any(axis=1).sum())} corrected poses lie beyond the travel of a joint")
    return lines
