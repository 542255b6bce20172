"""``[job] as_found``: what the machine showed before it was adjusted, from the results.json of its report."""

from __future__ import annotations

import datetime as dt
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import Field

from cmm_uq.base.errors import CmmUqError
from cmm_uq.jobs.origin import Origin
from cmm_uq.jobs.results_named import Part, read_results
from cmm_uq.jobs.verdicts import Verdicts

KEY = "[job] as_found"

_FIX = "Name the results.json that cmm-uq report wrote of the machine as it was found, or the folder it lies in"


class Figure(Part):
    """A quantity as results.json has it."""

    value: float
    u: float
    interval95: Annotated[list[float], Field(min_length=2, max_length=2)]


class Found(Part):
    """A statement of conformity as results.json has it."""

    standard: str
    characteristic: str = ""
    decision: str


class _Job(Part):
    id: str
    origin: Origin
    date: Annotated[dt.date, Field(strict=False)] | None = None
    machine: str = ""
    serial: str = ""


class _Identifiability(Part):
    undetermined: list[dict[str, float]] = []


class AsFound(Part):
    """What was found before the adjustment: of which job, the estimates, the figures of the lengths, and the decisions."""

    schema_: Annotated[Literal["cmm-uq/results/1"], Field(alias="schema")]
    job: _Job
    estimates: dict[str, dict[str, Figure]]
    accuracy_uncertainty: dict[str, Figure] = {}
    conformity: list[Found] = []
    tolerances: dict[str, dict[str, float | str]] = {}
    verdicts: dict[str, Any] | None = None
    identifiability: _Identifiability = _Identifiability()

    @property
    def stated(self) -> Verdicts:
        """All that it states of conformity."""
        return Verdicts.of_results(self.model_dump())

    def figure(self, group: str, name: str) -> Figure | None:
        """An estimate, or of the group ``accuracy`` a figure of the lengths; ``None`` where nothing determined it."""
        if group == "accuracy":
            return self.accuracy_uncertainty.get(name)
        free = any(f"{group}.{name}" in combination for combination in self.identifiability.undetermined)
        return None if free else self.estimates.get(group, {}).get(name)


def as_found_of(
    name: str | None, inputs: Mapping[str, bytes], folder: Path, origin: Origin, machine: str, serial: str
) -> AsFound | None:
    """What was found; ``None`` where the job names nothing.

    Parameters
    ----------
    name : of the results.json, among ``inputs``.
    folder : of the job, for messages.
    origin, machine, serial : of the job.

    Raises
    ------
    CmmUqError : it is no results.json of a report, of another machine, or of a recording of another origin.
    """
    if name is None:
        return None
    where = str(folder / name)
    found = read_results(AsFound, inputs[name], where, "results.json of a report", _FIX)
    for what, then, now in (("machine", found.job.machine, machine), ("serial number", found.job.serial, serial)):
        if then and now and then != now:
            raise CmmUqError(f"is of {what} {then!r}, and this job of {now!r}", where=where, fix=_FIX)
    if found.job.origin != origin:
        raise CmmUqError(f"is of a {found.job.origin} recording, and this one is {origin}", where=where, fix=_FIX)
    return found
