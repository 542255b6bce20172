"""``[job.replaces]``: the certificate in whose place a new one is issued (ISO/IEC 17025:2017, 7.8.8)."""

from __future__ import annotations

import datetime as dt
from typing import Annotated

from pydantic import Field

from cmm_uq.jobs.table import Table

Said = Annotated[str, Field(min_length=1, pattern=r"\S")]
"""Words that must not be left out."""


class Replaced(Table):
    """The certificate that this one replaces, why, and what changed."""

    number: Said
    """Number of the certificate that is replaced."""
    date: dt.date
    """Its date of issue."""
    reason: Said
    """Why it is replaced."""
    changed: Said
    """What is changed in this certificate against it (7.8.8.1)."""
