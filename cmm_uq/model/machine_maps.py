"""The error maps of a job's machine: what ``[machine] error_map`` names."""

from __future__ import annotations

from cmm_uq.errors import CmmUqError
from cmm_uq.jobs.job import Job
from cmm_uq.physics.error_map import ErrorMap, parse_error_map

WHERE = "job.toml [machine] error_map"


def maps_of(job: Job) -> list[ErrorMap]:
    """The error maps that a job names, each with its squareness: its own, or that of the machine.

    Raises
    ------
    CmmUqError : there is none, or one that is no error map.
    """
    machine, maps = job.facts.machine, []
    if not machine.error_map:
        raise CmmUqError("the job has no error map", where=WHERE,
                         fix='Name it: error_map = [ { file = "map.csv", temperature_c = 20.0 } ]')  # fmt: skip
    for given in machine.error_map:
        found = parse_error_map(job.inputs[given.file], str(job.folder / given.file), temperature=given.temperature_c)
        square = given.squareness_arcsec or machine.squareness_arcsec
        maps.append(found.with_squareness_arcsec(square.xy, square.yz, square.zx) if square else found)
    return maps
