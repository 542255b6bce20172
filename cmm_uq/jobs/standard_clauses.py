"""A standard's clauses as a laboratory holds them against its own copy: a form that it fills in, beside job.toml."""

from __future__ import annotations

import datetime as dt
from typing import Annotated, Self

from pydantic import Field, model_validator

from cmm_uq.base.files.limits import LISTED
from cmm_uq.base.files.table import Table
from cmm_uq.jobs.replaced import Said


class HeldClause(Table):
    """One clause: what the program does of it, and whether that agrees with the laboratory's copy."""

    does: str
    """What the program does, as it wrote the form; a clause of which it does something else by now is not checked."""
    source: str = ""
    """Where that comes from."""
    agrees: bool | None = None
    """Whether it agrees with the copy; left out, nobody has looked."""
    differs: str = ""
    """How it differs."""
    stricter: bool = False
    """Whether the program asks for more than the copy where it differs, so that a pass stays one."""
    clause: str = ""
    """Number of the clause in the copy."""
    checked_by: Said | None = None
    """Who held this clause against the copy, where another than the form's."""
    on: dt.date | None = None
    """When, where another day than the form's."""
    edition: Said | None = None
    """Of which edition, where another than the form's."""

    @model_validator(mode="after")
    def _one_answer(self) -> Self:
        if (self.agrees is False) != bool(self.differs.strip()):
            raise ValueError("give agrees = true, or agrees = false with differs = how it does")
        if self.stricter and self.agrees is not False:
            raise ValueError("stricter belongs to agrees = false")
        return self


class ClausesForm(Table):
    """The form of a standard, filled in: ``cmm-uq standards NAME --form FILE`` writes it."""

    standard: str
    """The standard, by its name in `[[conformity]]`."""
    checked_by: Said
    """Who held the clauses against the laboratory's copy."""
    on: dt.date
    """When."""
    edition: Said
    """Edition of the copy, as its title page has it."""
    clauses: Annotated[dict[str, HeldClause], Field(max_length=LISTED.most)]
    """Each clause, by the name that the form has for it."""
