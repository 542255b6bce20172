"""What a job of any sort says of itself: its id and date, whose it is, and free text for the certificate."""

from __future__ import annotations

import datetime as dt
from typing import Annotated, Self

from pydantic import Field, model_validator

from cmm_uq.base.files.table import Table
from cmm_uq.base.languages.language import ENGLISH, Code
from cmm_uq.jobs.file_names import device_name
from cmm_uq.jobs.replaced import Replaced


class Identification(Table):
    """Identification, and free text for the certificate."""

    id: Annotated[str, Field(pattern=r"^[A-Za-z0-9._-]+$", max_length=100)]
    """Name of the job and of the folder its reports go to: letters, digits, `.`, `_` and `-`."""
    date: dt.date
    """Date of the measurement."""
    number: str = ""
    """Number of the certificate; the id where it is left out."""
    replaces: Replaced | None = None
    """The certificate that this one replaces (7.8.8), in a table of its own."""
    issued: dt.date | None = None
    """Date on which the certificate is issued (ISO/IEC 17025:2017, 7.8.2.1 j)."""
    customer: str = ""
    """Name of the customer (7.8.2.1 e)."""
    address: str = ""
    """How to reach the customer (7.8.2.1 e)."""
    place: str = ""
    """Where the measurement was made (7.8.2.1 c)."""
    operator: str = ""
    """Who measured."""
    procedure: str = ""
    """The method of the measurement (7.8.2.1 f)."""
    order: str = ""
    """Number of the customer's order."""
    conditions: str = ""
    """Conditions that influence the results, in words (7.8.4.1 b)."""
    received: dt.date | None = None
    """Day on which the item was received, where that matters for the results (7.8.2.1 h)."""
    deviations: str = ""
    """Additions to, deviations from and exclusions from the method (7.8.2.1 n)."""
    external: str = ""
    """Results that external providers gave, and who they are (7.8.2.1 p)."""
    from_customer: str = ""
    """Data that the customer gave and the results may rest on; the certificate says that they are the customer's (7.8.2.2)."""
    remarks: str = ""
    """Free text of the certificate."""
    language: Code = ENGLISH
    """Language of the documents: `en`, `de`, `fr` or `ja`; files for programs stay English."""

    @model_validator(mode="after")
    def _numbered_anew(self) -> Self:
        if self.replaces is not None and self.replaces.number == (self.number or self.id):
            raise ValueError(
                f"replaces.number = {self.replaces.number!r} is the number of this certificate itself: give the new one "
                "a number of its own"
            )
        return self

    @model_validator(mode="after")
    def _names_a_folder(self) -> Self:
        if set(self.id) == {"."}:
            raise ValueError("must name a folder of its own, so it cannot consist of dots")
        if device_name(self.id):
            raise ValueError("must name a folder of its own, and Windows takes this name for a device")
        return self
