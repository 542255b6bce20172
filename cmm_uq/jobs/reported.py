"""Of the results.json of a report, what a standard decided on and the error factors: for files of other formats."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import Field

from cmm_uq.jobs.results_named import Part


class Tested(Part):
    """One value of a test."""

    measurement: int | None = None
    repeat: int | None = None
    length_mm: float | None = None
    error_um: float
    u_um: float | None = None
    limit_um: float
    outcome: str
    position: str | None = None


class Stated(Part):
    """A statement of conformity."""

    standard: str
    characteristic: str | None = None
    decision: str
    errors: list[Tested] = []


class Figure(Part):
    """An estimate."""

    value: float
    u: float


class _Job(Part):
    id: str
    origin: str
    date: str
    machine: str
    inputs_sha256: dict[str, str]


class _Software(Part):
    version: str


class _Identifiability(Part):
    undetermined: list[dict[str, float]] = []


class Reported(Part):
    """What is needed of a results.json."""

    schema_: Annotated[Literal["cmm-uq/results/1"], Field(alias="schema")]
    software: _Software
    job: _Job
    conformity: list[Stated] = []
    estimates: dict[str, dict[str, Figure]] = {}
    tolerances: dict[str, dict[str, float | str]] = {}
    verdicts: dict[str, Any] | None = None
    identifiability: _Identifiability = _Identifiability()
