"""Compensated recordings: a job's readings corrected by its machine's error maps."""

from __future__ import annotations

import json
import re
from pathlib import Path

from cmm_uq import __version__
from cmm_uq.commands.reading import read_job
from cmm_uq.commands.simulate import recording
from cmm_uq.errors import CmmUqError
from cmm_uq.jobs.job import Job
from cmm_uq.jobs.reading import sha256
from cmm_uq.kinds import kind_of
from cmm_uq.model.machine_maps import maps_of
from cmm_uq.physics.compensation import compensate_points, machine_compensation
from cmm_uq.physics.map_interpolation import Beyond, ErrorMaps
from cmm_uq.points import Points
from cmm_uq.writing import staging, write_whole


def compensate_job(job: Job, *, beyond: Beyond = "refuse") -> tuple[Points, dict[str, object]]:
    """The recording of a job at the coordinates that its error maps make of it, and how it came about.

    Parameters
    ----------
    job : with ``[machine] error_map``.
    beyond : ``refuse`` points outside the maps, or extrapolate and flag them.

    Raises
    ------
    CmmUqError : the job has no error map, or it does not serve these points.
    """
    maps = maps_of(job)
    if not job.facts.artefact.with_recording:
        raise kind_of(job).refused("compensated")
    compensation = machine_compensation(job.points, ErrorMaps(maps), beyond=beyond)
    try:
        return compensate_points(job.points, compensation), compensation.provenance()
    except CmmUqError as error:
        where = ", ".join(part for part in (job.recording_path, error.where) if part)
        raise CmmUqError(error.problem, where=where, fix=error.fix) from error


def write_compensated(job: Path, out: Path, *, beyond: Beyond = "refuse") -> dict[str, Path]:
    """Write a job folder with the compensated recording; its job.toml names no error map any more.

    Returns
    -------
    path of each file.

    Raises
    ------
    CmmUqError : bad input, or a folder that cannot be written to.
    """
    read = read_job(job)
    if out.resolve() == read.folder.resolve():
        raise CmmUqError("is the job that is compensated", where=str(out), fix="Choose another --out")
    points, provenance = compensate_job(read, beyond=beyond)
    note = f"# compensated by cmm-uq {__version__}; see compensation.json\n".encode()
    told = {"software": f"cmm-uq {__version__}", "inputs_sha256": sha256(read.inputs), **provenance}
    contents = {
        "job.toml": _without_maps(read.inputs["job.toml"]),
        read.facts.recording.file: note + recording(points),
        "compensation.json": (json.dumps(told, indent=2, ensure_ascii=False) + "\n").encode(),
    }
    with staging(out) as place:
        return write_whole(place, out, contents)


def _without_maps(toml: bytes) -> bytes:
    """job.toml without its error maps, so that what is compensated is not compensated again."""
    text = toml.decode("utf-8-sig")
    text = re.sub(r"(?ms)^\s*error_map\s*=\s*\[.*?\]\s*(#[^\n]*)?$\n?", "", text)
    text = re.sub(r"(?m)^\s*squareness_arcsec\s*=.*\n?", "", text)
    return text.encode()
