"""The history of machines, artefacts and certificates: entries with a hash chain, and tables that follow from them.

Entries are the truth: they are added and never changed. All else is an index of them, made again from them and compared
with them by :meth:`~cmm_uq.laboratory.records.store.Records.verify`. This room knows no statistics and renders nothing.
Nothing here imports SQLAlchemy before records are opened.
"""

from __future__ import annotations

from cmm_uq.laboratory.records.entries import KINDS, Entry
from cmm_uq.laboratory.records.facts import ArtefactRow, Certificate, Finding, Machine, Series, Signature, Value
from cmm_uq.laboratory.records.opening import open_records
from cmm_uq.laboratory.records.place import DEFAULT, ENVIRONMENT, NONE

__all__ = [
    "DEFAULT", "ENVIRONMENT", "KINDS", "NONE", "ArtefactRow", "Certificate", "Entry", "Finding", "Machine", "Series",
    "Signature", "Value", "open_records",
]  # fmt: skip
