"""``[acquire]``: which instruments a recording is taken from, and what of each goes into which column."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field, field_validator

from cmm_uq.base.files.table import Column, Table, at_least


class DeclaredSource(Table):
    """One ``[[acquire.source]]``: an instrument, the port it is at, and what of it is recorded."""

    name: Annotated[str, Field(pattern=r"^[A-Za-z0-9._-]+$", max_length=60)]
    """Name of the source in this job, unique: letters, digits, `.`, `_` and `-`."""
    profile: Annotated[str, Field(min_length=1, max_length=200)]
    """How the instrument speaks: a ready profile (`cmm-uq instruments list`), or a TOML file of one's own beside job.toml."""
    port: Annotated[str, Field(max_length=300)] = ""
    """Where it is: `/dev/ttyUSB0`, `COM3`, `socket://host:port`, `rfc2217://host:port`, `tcp://host:port`,
    `visa://RESOURCE`, or `file:NAME` to replay bytes.
    """
    serial: str = ""
    """Serial number of the instrument; one that it gives itself must be the same."""
    certificate: str = ""
    """Number of its calibration certificate."""
    values: Annotated[dict[str, Column], Field(max_length=100)] = {}
    """Column of the recording by the quantity that the instrument gives; without it each goes into the column of its name."""
    latency_ms: Annotated[float, Field(ge=0, le=1e6)] = 0.0
    """How long before the last byte of a message came its quantities were measured."""


class AcquireFacts(Table):
    """``[acquire]``: a recording taken live, by `cmm-uq acquire`."""

    plan: str | None = None
    """Plan to be measured, a CSV of `cmm-uq plan` beside job.toml; without it the one that `[plan]` asks for."""
    folder: str | None = None
    """Folder that the machine's program drops results into, as seen from job.toml; each file is read once it stands still."""
    max_gap_s: Annotated[float, Field(gt=0, le=1e6), at_least(1e-3)] = 10.0
    """Longest time between two readings of an instrument that is interpolated over; in a longer one a point has no value."""
    soak_k_per_h: Annotated[float, Field(gt=0, le=1000)] | None = None
    """Largest change of each temperature in an hour before the measurement begins; that of `[rated_conditions]` without it."""
    soak_min: Annotated[float, Field(gt=0, le=1e5), at_least(0.01)] = 30.0
    """Time over which that change is taken, min."""
    repeats_most: Annotated[int, Field(ge=1, le=100)] = 5
    """How often a set-up is measured at most, where the scatter of its repeats asks for more."""
    source: Annotated[list[DeclaredSource], Field(max_length=100)] = []
    """The instruments, each a table of its own."""

    @field_validator("source")
    @classmethod
    def _names_differ(cls, sources: list[DeclaredSource]) -> list[DeclaredSource]:
        names = [source.name for source in sources]
        for name in names:
            if names.count(name) > 1:
                raise ValueError(f"two sources are called {name!r}: give each a name of its own")
        return sources
