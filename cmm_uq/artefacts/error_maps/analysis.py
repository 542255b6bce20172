"""A job whose recording is the machine's error maps, carried from data to diagnosis."""

from __future__ import annotations

from dataclasses import dataclass

from cmm_uq.analysis.screening.finding import Finding
from cmm_uq.artefacts.error_maps.columns import MapColumn, columns_of
from cmm_uq.artefacts.error_maps.diagnosis import MapsDiagnosis, diagnose_maps
from cmm_uq.artefacts.error_maps.fit import squareness_findings
from cmm_uq.base.errors import CmmUqError
from cmm_uq.jobs.job import Job
from cmm_uq.machine.model.machine_maps import WHERE, maps_of
from cmm_uq.machine.physics.catalogue import effects
from cmm_uq.machine.physics.effects.thermal import ThermalScale
from cmm_uq.machine.physics.error_map import ErrorMap
from cmm_uq.maths.inference.ensembles import Progress


@dataclass(frozen=True, eq=False)
class MapsDiagnosed:
    """A job of error maps with its diagnosis."""

    job: Job  # what was read
    maps: tuple[ErrorMap, ...]  # its error maps, in the order in which it names them
    findings: tuple[Finding, ...]  # what is odd among the maps' figures
    diagnosis: MapsDiagnosis  # what changes with temperature, and which maps contradict the others


def diagnose_error_maps(job: Job, *, seed: int, alpha: float, progress: Progress | None = None) -> MapsDiagnosed:
    maps, columns, findings = compared_maps(job)
    findings += squareness_findings(maps)
    found = diagnose_maps(columns, job.facts.model.effects, alpha=alpha, seed=seed, progress=progress)
    return MapsDiagnosed(job, tuple(maps), tuple(findings), found)


def compared_maps(job: Job) -> tuple[tuple[ErrorMap, ...], list[MapColumn], list[Finding]]:
    maps = maps_of(job)
    if len(maps) < 2:
        raise CmmUqError("one error map has nothing to be compared with", where=WHERE,
                         fix="Name two or more maps of the machine; with three it shows which of them differs")  # fmt: skip
    for effect in effects(job.facts.model.effects, where="job.toml [model] effects"):
        if effect.columns and not isinstance(effect, ThermalScale):
            raise CmmUqError(f"{effect.name} needs {', '.join(effect.columns)}, which error maps do not have",
                             where="job.toml [model] effects", fix="Leave it out")  # fmt: skip
    if job.facts.conformity:
        raise CmmUqError("error maps are diagnosed, no standard here decides on them",
                         where="job.toml [[conformity]]", fix="Leave it out")  # fmt: skip
    columns, findings = columns_of(maps)
    if not columns:
        why = "; ".join(finding.why for finding in findings)
        raise CmmUqError(f"the error maps have nothing in common to compare: {why}", where=WHERE,
                         fix="Map the same errors at the same positions each time")  # fmt: skip
    return tuple(maps), columns, findings


def refuse_unfit(job: Job) -> None:
    compared_maps(job)
