"""Compensated clouds: what a digitizer recorded, by the whole chain, from disk to disk."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np

from cmm_uq.app.commands.compensate import PROVENANCE
from cmm_uq.app.commands.reading import read_machine
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.output import Owner, sha256_of, staged
from cmm_uq.jobs.derived_job import PROGRAM
from cmm_uq.jobs.digitizer_calibration import DescribedDigitizer, digitizer_of
from cmm_uq.jobs.job import Job
from cmm_uq.jobs.logged_temperatures import log_of
from cmm_uq.jobs.origin import first_line
from cmm_uq.jobs.reading import sha256
from cmm_uq.machine.model.machine_maps import maps_of
from cmm_uq.machine.physics.compensation import Compensation, machine_compensation
from cmm_uq.machine.physics.digitized_cloud import DigitizedCloud, columns_for
from cmm_uq.machine.physics.digitizer import Digitizer, euler_313
from cmm_uq.machine.physics.map_interpolation import Beyond, ErrorMaps
from cmm_uq.machine.physics.point_cloud import cloud_files, cloud_header, transform_cloud

FORMS = (".csv", ".npy", ".parquet")
"""Endings of what is read and written; a folder of ``.npy`` files becomes one."""


def write_compensated_cloud(
    job: Path,
    cloud: Path,
    out: Path,
    *,
    beyond: Beyond = "refuse",
    force: bool = False,
    progress: Callable[[float], None] | None = None,
) -> dict[str, Path]:
    """Write the coordinates of a cloud, x, y, z in mm in the frame of the scales, and how they came about.

    Parameters
    ----------
    job : of which ``[machine]`` names the error maps and describes the digitizer; its recording is not read.
    cloud : columns u_mm, v_mm in the scan plane and scale readings d_mm, e_mm, f_mm; pose, time_s, temp_x_c … where needed.
    beyond : ``refuse`` points outside the maps, or extrapolate and flag them.
    progress : told the part done.

    Returns and raises as :func:`~cmm_uq.app.commands.simulate.write_simulation`.
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
            "columns": list(chain.columns), **compensation.provenance(),
            "digitizer": digitizer.as_data(),
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
    poses = {
        given.pose: Digitizer(
            euler_313(*np.radians([given.alpha_deg, given.beta_deg, given.gamma_deg])), offset, compensation
        )
        for given in digitizer.poses
    }
    log = log_of(job.facts.machine, job.inputs, job.folder)
    columns = columns_for(cloud_header(cloud), len(poses), logged=log is not None, where=str(cloud))
    at = None if log is None else lambda times: log.at(times, lambda row: f"point {row + 1}")
    return DigitizedCloud(poses, columns, at, compensation.beyond == "extrapolate"), digitizer
