"""Everything compared with the chain: entries with each other, tables with entries, files with what was recorded of them."""

from __future__ import annotations

from typing import TYPE_CHECKING

from cmm_uq.records.entries import BEGINNING
from cmm_uq.records.facts import Finding

if TYPE_CHECKING:
    from cmm_uq.records.store import Records

MOST = 1000
"""Findings after which no more are looked for."""


def verified(records: Records, head: str | None, *, files: bool) -> list[Finding]:
    """What is wrong; see :meth:`cmm_uq.records.store.Records.verify`."""
    return _chain(records, head)


def _chain(records: Records, head: str | None) -> list[Finding]:
    found: list[Finding] = []
    number, previous, met = 0, BEGINNING, head is None
    for entry in records.entries():
        if entry.number != number + 1:
            found.append(Finding("chain", f"entries {number + 1} to {entry.number - 1} are missing", number + 1))
        elif entry.previous != previous:
            found.append(Finding("chain", "does not follow the entry before it", entry.number))
        if not entry.true:
            found.append(Finding("chain", "was altered", entry.number))
        number, previous, met = entry.number, entry.hash, met or entry.hash == head
        if len(found) >= MOST:
            return found
    if not met:
        found.append(
            Finding("chain", f"no entry has the hash {head}: entries are missing at the end, or all were written anew")
        )
    return found
