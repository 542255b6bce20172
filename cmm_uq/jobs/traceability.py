"""What a job says of a certificate that its results rest on: number, issuer and by what right it calibrates, and dates.

The certificates of the artefact and of the short gauge are tables of theirs; thermometers stand in ``[[thermometer]]``.
What follows from them is said in :mod:`cmm_uq.jobs.chain`.
"""

from __future__ import annotations

import datetime as dt
from calendar import monthrange
from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from cmm_uq.base.files.table import Column, Table

NATIONAL, ACCREDITED, OTHER, IN_HOUSE = "national institute", "accredited", "not accredited", "in-house"
MATERIAL, CONSENSUS = "reference material", "consensus"
Issuer = Literal["national institute", "accredited", "not accredited", "in-house", "reference material", "consensus"]
Arrangement = Literal["CIPM MRA", "ILAC MRA", "AFRAC MRA", "APAC MRA", "ARAC MRA", "EA MLA", "IAAC MLA"]
CIPM: Arrangement = "CIPM MRA"
"""The arrangement of national institutes; the others are those of accreditation bodies, of ILAC or recognised by it."""


class Traceability(Table):
    """A certificate of the artefact, the short gauge or a thermometer.

    Attributes
    ----------
    machine : measuring machine that the artefact was certified on, by its name or its serial number.
    """

    number: str = ""
    """Number of the certificate, for the statement of traceability."""
    laboratory: str = ""
    """Who issued the certificate."""
    machine: str = ""
    """Measuring machine that the artefact was certified on, by its name or serial number: the machine that it tests
    is warned of."""
    date: dt.date | None = None
    """Date of the certificate."""
    due: dt.date | None = None
    """Last day on which the calibration holds, by the laboratory that uses it; `interval_months` may stand for it."""
    interval_months: Annotated[int, Field(ge=1, le=600)] | None = None
    """How long the calibration holds from its date, in months, by the laboratory that uses it."""
    issuer: Issuer | None = None
    """What the issuer is: `national institute`, `accredited`, `not accredited`, `in-house` (the laboratory itself),
    `reference material` (its producer) or `consensus`."""
    accreditation: str = ""
    """Number of the issuer's accreditation."""
    accredited_by: str = ""
    """Body that accredited the issuer."""
    arrangement: Arrangement | None = None
    """What covers this calibration: `CIPM MRA` of a national institute; of an accredited laboratory the arrangement that its
    accreditation body has signed, as `ILAC MRA` or `EA MLA`."""
    evidence: str = ""
    """Evidence of the issuer's competence that the laboratory holds, where no arrangement covers the calibration."""

    @model_validator(mode="after")
    def _one_end(self) -> Self:
        if self.due is not None and self.interval_months is not None:
            raise ValueError("due and interval_months both say until when the calibration holds: give one of them")
        return self

    @model_validator(mode="after")
    def _arranged(self) -> Self:
        if self.arrangement is not None and (self.arrangement == CIPM) != (self.issuer == NATIONAL):
            raise ValueError(
                f'arrangement = "{self.arrangement}" does not fit issuer = "{self.issuer or ""}": the CIPM MRA covers '
                "national institutes, the others accredited laboratories"
            )
        return self

    @property
    def until(self) -> dt.date | None:
        """Last day on which the calibration holds; the last of the month where a month has no such day."""
        if self.interval_months is None or self.date is None:
            return self.due
        years, month = divmod(self.date.month - 1 + self.interval_months, 12)
        year = min(self.date.year + years, dt.MAXYEAR)
        return dt.date(year, month + 1, min(self.date.day, monthrange(year, month + 1)[1]))


class ThermometerFacts(Table):
    """``[[thermometer]]``: a thermometer that recorded temperatures were read from."""

    columns: Annotated[list[Column], Field(min_length=1, max_length=50)] = ["temp_artefact_c"]
    """Columns of the recording that it gave."""
    name: str = ""
    """Name of the thermometer on the certificate."""
    serial: str = ""
    """Serial number of the thermometer."""
    certificate: Traceability = Traceability()
    """The thermometer's own certificate."""
