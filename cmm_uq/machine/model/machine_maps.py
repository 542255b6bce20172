"""The error maps of a job's machine: what ``[machine] error_map`` names."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from cmm_uq.base.errors import CmmUqError
from cmm_uq.jobs.job import Job
from cmm_uq.jobs.tables.machine import ErrorMapFile, SquarenessFacts
from cmm_uq.machine.physics.error_map import ErrorMap, parse_map_file

WHERE = "job.toml [machine] error_map"


def maps_of(job: Job) -> list[ErrorMap]:
    """The error maps that a job names, each with its squareness: its own, or that of the machine."""
    machine = job.facts.machine
    if not machine.error_map:
        raise CmmUqError("the job has no error map", where=WHERE,
                         fix='Name it: error_map = [ { file = "map.csv", temperature_c = 20.0 } ]')  # fmt: skip
    return maps_named(job, machine.error_map, machine.squareness_arcsec, WHERE)


def maps_named(
    job: Job, named: Sequence[ErrorMapFile], squareness: SquarenessFacts | None, where: str
) -> list[ErrorMap]:
    maps, without = [], []
    for given in named:
        path = str(job.folder / given.file)
        found, has_squareness = parse_map_file(job.inputs[given.file], path, temperature=given.temperature_c)
        square = given.squareness_arcsec or squareness
        if square and has_squareness:
            raise CmmUqError("states its squareness, and the job gives it squareness_arcsec as well", where=path,
                             fix=f"Leave squareness_arcsec out in {where}")  # fmt: skip
        if not (square or has_squareness):
            without.append(path)
        source = replace(found, source=given.file)  # as the job names it, wherever its folder lies
        maps.append(source.with_squareness_arcsec(square.xy, square.yz, square.zx) if square else source)
    if without and len(without) < len(maps):
        raise CmmUqError("has no squareness, and another map has: between them it would fall to zero", where=without[0],
                         fix=f"Give it squareness_arcsec in {where}")  # fmt: skip
    return maps
