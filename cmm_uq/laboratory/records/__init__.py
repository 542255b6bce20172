"""The history of machines, artefacts and certificates: entries with a hash chain, and tables that follow from them.

Entries are the truth: they are added and never changed. All else is an index of them, made again from them and compared
with them by :meth:`~cmm_uq.laboratory.records.store.Records.verify`. This room knows no statistics and renders nothing.
Nothing here imports SQLAlchemy before records are opened.
"""

from __future__ import annotations

from cmm_uq.laboratory.records.opening import open_records

__all__ = ["open_records"]
