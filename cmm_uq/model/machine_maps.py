"""The error maps of a job's machine: what ``[machine] error_map`` names."""

from __future__ import annotations

from dataclasses import replace

from cmm_uq.errors import CmmUqError
from cmm_uq.jobs.job import Job
from cmm_uq.physics.error_map import ErrorMap
from cmm_uq.physics.error_map_file import parse_map_file

WHERE = "job.toml [machine] error_map"


def maps_of(job: Job) -> list[ErrorMap]:
    """The error maps that a job names, each with its squareness: its own, or that of the machine.

    Raises
    ------
    CmmUqError : there is none, one that is no error map, or one whose squareness is stated twice, or not at all beside others
        that have it.
    """
    machine, maps, without = job.facts.machine, [], []
    if not machine.error_map:
        raise CmmUqError("the job has no error map", where=WHERE,
                         fix='Name it: error_map = [ { file = "map.csv", temperature_c = 20.0 } ]')  # fmt: skip
    for given in machine.error_map:
        path = str(job.folder / given.file)
        found, has_squareness = parse_map_file(job.inputs[given.file], path, temperature=given.temperature_c)
        square = given.squareness_arcsec or machine.squareness_arcsec
        if square and has_squareness:
            raise CmmUqError("states its squareness, and the job gives it squareness_arcsec as well", where=path,
                             fix=f"Leave squareness_arcsec out in {WHERE}")  # fmt: skip
        if not (square or has_squareness):
            without.append(path)
        named = replace(found, source=given.file)  # as the job names it, wherever its folder lies
        maps.append(named.with_squareness_arcsec(square.xy, square.yz, square.zx) if square else named)
    if without and len(without) < len(maps):
        raise CmmUqError("has no squareness, and another map has: between them it would fall to zero", where=without[0],
                         fix=f"Give it squareness_arcsec in {WHERE}")  # fmt: skip
    return maps
