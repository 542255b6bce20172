"""What a job says beside the name of a file that is to be imported: the keys that settle what the file leaves open."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Literal

from pydantic import Field, field_validator

from cmm_uq.base.files.limits import COLUMNS
from cmm_uq.base.files.table import Column, Table
from cmm_uq.jobs.importing.units import LENGTHS, length_named

Source = str | Annotated[int, Field(ge=1, le=COLUMNS.most)]
"""A column of the file: its heading, or its number from 1."""

Sources = Source | Annotated[list[Source], Field(min_length=1, max_length=COLUMNS.most)]
"""One, or several where a row holds several points, in their order."""

DELIMITERS: Mapping[str, str] = {",": ",", ";": ";", "tab": "\t", "blank": " ", "|": "|"}


class FileKeys(Table):
    """Of any table that is imported; each is needed only where the file leaves it open."""

    columns: Annotated[dict[Column, Sources], Field(max_length=COLUMNS.most)] = {}
    """The file's columns by the recording's names, as `{ x_mm = "X" }`: a heading, a number from 1, or a list of them where a
    row holds several points."""
    unit: str | None = None
    """Unit of the file's lengths, as `"inch"`, where the file does not say it."""
    sheet: str | None = None
    """Which sheet of a workbook, or which sort of feature of a report (`"spheres"`), where there are several."""
    decimal: Literal[".", ","] | None = None
    """The file's decimal sign, where its numbers can be read either way."""
    delimiter: Literal[",", ";", "tab", "blank", "|"] | None = None
    """What separates the cells of a text file, where that is not found."""
    encoding: Literal["utf-8", "utf-16", "cp1252", "latin-1"] | None = None
    """Encoding of a text file, where it is mistaken for another."""

    @field_validator("unit")
    @classmethod
    def _a_length(cls, unit: str | None) -> str | None:
        if unit is not None and length_named(unit) is None:
            raise ValueError(f"{unit!r} is no unit of length known here. Known: {', '.join(LENGTHS)}")
        return unit


class ImportKeys(FileKeys):
    """Of a recording in another format than the project's own."""

    points_per_measurement: Annotated[int, Field(ge=1, le=1_000_000)] | Literal["all"] | None = None
    """How many rows in turn are one measurement, where the file does not number them; `"all"` where they are one."""

    @property
    def asked(self) -> bool:
        """Whether anything is said, so that the file is to be imported whatever it looks like."""
        return any(getattr(self, name) not in (None, {}) for name in ImportKeys.model_fields)
