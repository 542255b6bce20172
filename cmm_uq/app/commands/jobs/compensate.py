"""Recordings and clouds of a digitizer, corrected by their machine's error maps."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np

from cmm_uq.app.commands.jobs.simulate import recording
from cmm_uq.app.commands.model import refuse_planned
from cmm_uq.app.commands.reading import job_of, read_job, read_machine
from cmm_uq.artefacts import kind_of
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.output import Owner, sha256_of, staged
from cmm_uq.base.points import AXES, Points
from cmm_uq.jobs.derived_job import IN_THE_RECORDING, PROGRAM, derived_toml, is_compensated, kept_inputs, recording_name
from cmm_uq.jobs.job import Job
from cmm_uq.jobs.recording.beside import log_of
from cmm_uq.jobs.reports import DescribedDigitizer, digitizer_of
from cmm_uq.jobs.source import sha256
from cmm_uq.jobs.tables.identification import first_line
from cmm_uq.machine.model.predicted_errors import maps_of
from cmm_uq.machine.physics.compensation import Compensation, compensate_points, machine_compensation
from cmm_uq.machine.physics.digitizer import DigitizedCloud, Digitizer, columns_for
from cmm_uq.machine.physics.error_map import error_map_text
from cmm_uq.machine.physics.kinematics import euler_313
from cmm_uq.machine.physics.map_interpolation import Beyond, ErrorMaps
from cmm_uq.machine.physics.point_cloud import cloud_files, cloud_header, transform_cloud

PROVENANCE = "compensation.json"  # how the coordinates were corrected, in the folder of a compensated job


def compensate_job(job: Job, *, beyond: Beyond = "refuse") -> tuple[Points, dict[str, object]]:
    """The recording of a job at the coordinates that its error maps make of it, and how it came about.

    ``beyond``: ``refuse`` points outside the maps, or extrapolate and flag them.
    """
    maps = maps_of(job)
    refuse_planned(job)
    if not job.facts.artefact.with_recording:
        raise kind_of(job).refused("compensated")
    log = log_of(job.facts.machine, job.inputs, job.folder)
    compensation = machine_compensation(job.points, ErrorMaps(maps), beyond=beyond)
    provenance = compensation.provenance()
    try:
        points = compensate_points(_with_probe(job), compensation)
        if log is not None:  # which gave the temperatures of the scales
            times = job.points.columns["time_s"]
            provenance |= {"temperature_log": {
                "file": log.source, "rule": "mean of the thermocouples of each scale, linear in time",
                "largest_u_interpolation_k": round(float(log.u_at(times).max()), 6),
                "largest_spread_k": round(float(log.spread_at(times).max()), 6),
            }}  # fmt: skip
    except CmmUqError as error:
        where = ", ".join(part for part in (job.recording_path, error.where) if part)
        raise CmmUqError(error.problem, where=where, fix=error.fix) from error
    return points, provenance


def write_compensated(
    job: Path, out: Path, *, beyond: Beyond = "refuse", map_text_c: float | None = None, force: bool = False
) -> dict[str, Path]:
    """Write a job folder with the compensated recording, marked as such; its job.toml names no error map any more.

    map_text_c : temperature, °C, at which the error map is written beside it in the contractors' text form.
    Returns and raises as :func:`~cmm_uq.app.commands.jobs.simulate.write_simulation`.
    """
    read = read_job(job)
    _refuse(read)
    text: dict[str, bytes] = {}  # the error map at one temperature, by the name of its file
    if map_text_c is not None:
        name = f"error-map-{map_text_c:g}C.txt"
        if name in read.inputs:
            clash = f"has a file {name!r}, the name of the map to be written"
            raise CmmUqError(clash, where=str(read.folder), fix="Rename it")
        found = ErrorMaps(maps_of(read)).map_at(map_text_c, beyond=beyond)
        text[name] = error_map_text(found, name=name).encode()
    owner = Owner("compensate", read.facts.job.id, read.origin)
    with staged(out, owner, inputs=read.paths, force=force, expected=(*read.inputs, *text, PROVENANCE)) as place:
        return place.write(_files(read, beyond, text))


def compensated_job(job: Job, *, beyond: Beyond = "refuse") -> Job:
    """The job that :func:`write_compensated` writes, in memory."""
    _refuse(job)
    return job_of(_files(job, beyond, {}))


def _refuse(read: Job) -> None:
    if is_compensated(read):
        raise CmmUqError("is compensated already", where=f"{read.folder / 'job.toml'} [job] origin",
                         fix="Compensate the measured recording")  # fmt: skip
    if read.facts.recording.earlier is not None:
        raise CmmUqError("the recordings of two dates are not compensated together",
                         where=f"{read.folder / 'job.toml'} [recording] earlier",
                         fix="Compensate each as a job of its own, then name the earlier result")  # fmt: skip


def _files(read: Job, beyond: Beyond, text: Mapping[str, bytes]) -> dict[str, bytes]:
    """Every file of the compensated job; ``text`` are maps written in the contractors' form."""
    points, provenance = compensate_job(read, beyond=beyond)
    told = {"software": PROGRAM, "inputs_sha256": sha256(read.inputs), **provenance}
    files = {
        **kept_inputs(read),
        recording_name(read): first_line("compensate", PROGRAM, f"; see {PROVENANCE}").encode() + recording(points),
        **text,
        PROVENANCE: (json.dumps(told, indent=2, ensure_ascii=False) + "\n").encode(),
    }
    toml = derived_toml(read, "compensate", files, without=("error_map", "squareness_arcsec", *IN_THE_RECORDING))
    return {"job.toml": toml, **files}


def _with_probe(job: Job) -> Points:
    """The recording, with tip offsets where its kind finds them from what it recorded."""
    facts = job.facts.artefact
    if not facts.carries_probe or "tip_x_mm" in job.points.columns:
        return job.points
    found = kind_of(job).observing("compensated")(facts, job.points, where=job.recording_path).points.columns
    tips = {name: found[name] for name in (f"tip_{axis}_mm" for axis in AXES)}
    return replace(job.points, columns={**job.points.columns, **tips})


FORMS = (".csv", ".npy", ".parquet")  # endings of what is read and written; a folder of ``.npy`` files becomes one


def write_compensated_cloud(
    job: Path, cloud: Path, out: Path, *, beyond: Beyond = "refuse", force: bool = False,
    progress: Callable[[float], None] | None = None,
) -> dict[str, Path]:  # fmt: skip
    """Write the coordinates of a cloud, x, y, z in mm in the frame of the scales, and how they came about.

    job : of which ``[machine]`` names the error maps and describes the digitizer; its recording is not read.
    cloud : columns u_mm, v_mm in the scan plane and scale readings d_mm, e_mm, f_mm; pose, time_s, temp_x_c … where needed.
    beyond : ``refuse`` points outside the maps, or extrapolate and flag them.
    Returns and raises as :func:`~cmm_uq.app.commands.jobs.simulate.write_simulation`.
    """
    read = read_machine(job)
    files = cloud_files(cloud)
    if cloud.suffix not in FORMS and not cloud.is_dir():
        raise CmmUqError("is no cloud by its ending", where=str(cloud), fix=f"Clouds are {', '.join(FORMS)}")
    maps = ErrorMaps(maps_of(read))
    compensation = replace(machine_compensation(read.points, maps, beyond=beyond), origin=np.zeros(3))
    chain, digitizer = _chain(read, cloud, compensation)
    name = f"{cloud.stem}-compensated{'.npy' if cloud.is_dir() else cloud.suffix}"
    owner = Owner("compensate", read.facts.job.id, read.origin)
    inputs = (*read.paths, *files)
    with staged(out, owner, inputs=inputs, force=force, expected=(name, PROVENANCE)) as place:
        mark = first_line("compensate", PROGRAM, f"; see {PROVENANCE}")
        count = transform_cloud(cloud, place.room(name), chain, columns=chain.columns, names=chain.names, mark=mark,
                                progress=progress)  # fmt: skip
        machine = read.facts.machine
        told = {
            "software": PROGRAM, "origin": "compensated", "points": count,
            "inputs_sha256": sha256(read.inputs) | {file.name: sha256_of(file) for file in files},
            "columns": list(chain.columns), **compensation.provenance(), "digitizer": digitizer.as_data(),
            "temperature_log": machine.temperature_log.file if machine.temperature_log is not None else None,
        }  # fmt: skip
        return place.write({PROVENANCE: (json.dumps(told, indent=2, ensure_ascii=False) + "\n").encode()}, [name])


def _chain(job: Job, cloud: Path, compensation: Compensation) -> tuple[DigitizedCloud, DescribedDigitizer]:
    digitizer = digitizer_of(job.facts.machine.digitizer, job.inputs, job.folder, job.origin)
    if digitizer is None:
        raise CmmUqError(
            "the job describes no digitizer", where="job.toml [machine] digitizer",
            fix="digitizer = { offset_mm = [U1, V1, W1], poses = [ { alpha_deg = …, beta_deg = …, gamma_deg = … } ] }, "
            'or { calibration = "FOLDER" }',
        )  # fmt: skip
    offset = np.array(digitizer.offset_mm)
    angles = {one.pose: np.radians([one.alpha_deg, one.beta_deg, one.gamma_deg]) for one in digitizer.poses}
    poses = {pose: Digitizer(euler_313(*each), offset, compensation) for pose, each in angles.items()}
    log = log_of(job.facts.machine, job.inputs, job.folder)
    columns = columns_for(cloud_header(cloud), len(poses), logged=log is not None, where=str(cloud))
    at = None if log is None else lambda times: log.at(times, lambda row: f"point {row + 1}")
    return DigitizedCloud(poses, columns, at, compensation.beyond == "extrapolate"), digitizer
