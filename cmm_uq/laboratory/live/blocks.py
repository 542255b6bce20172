"""Readings as records: several of one instrument together, each with its bytes as received, its values and both clocks."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from typing import Any

from cmm_uq.base.messages import Verbatim
from cmm_uq.laboratory.live.instruments.reading import Reading
from cmm_uq.laboratory.live.journal import Journal, Moment

READINGS = "readings"
"""Kind of such a record."""


class Blocks:
    """Readings that came since the last commit, by instrument."""

    def __init__(self) -> None:
        self._open: dict[str, list[Reading]] = {}

    def add(self, reading: Reading) -> None:
        """A reading."""
        self._open.setdefault(reading.source, []).append(reading)

    def put(self, journal: Journal, moment: Moment) -> None:
        """Move everything into a journal, a record for each instrument."""
        for source, readings in self._open.items():
            for run in _runs(readings):
                journal.append(READINGS, _as_data(source, run), moment)
        self._open.clear()


def _runs(readings: list[Reading]) -> Iterator[list[Reading]]:
    """Readings whose numbers follow each other."""
    start = 0
    for i in range(1, len(readings) + 1):
        if i == len(readings) or readings[i].number != readings[i - 1].number + 1:
            yield readings[start:i]
            start = i


def _as_data(source: str, readings: list[Reading]) -> dict[str, Any]:
    told = {str(i): str.__str__(reading.status) for i, reading in enumerate(readings) if reading.status is not None}
    probed = {str(i): reading.point for i, reading in enumerate(readings) if reading.point is not None}
    names = list(readings[0].values)
    alike = all(list(reading.values) == names for reading in readings)
    return {
        "source": source,
        "first": readings[0].number,
        "utc_ns": [reading.utc_ns for reading in readings],
        "monotonic_ns": [reading.monotonic_ns for reading in readings],
        "raw": [reading.raw.decode("latin-1") for reading in readings],
        **({"names": names, "values": [list(reading.values.values()) for reading in readings]} if alike
           else {"values": [dict(reading.values) for reading in readings]}),
        **({"status": told} if told else {}),
        **({"point": probed} if probed else {}),
    }  # fmt: skip


def readings_of(data: Mapping[str, Any]) -> Iterable[Reading]:
    """The readings of a record, as they came."""
    names, told, probed = data.get("names"), data.get("status", {}), data.get("point", {})
    rows = zip(data["utc_ns"], data["monotonic_ns"], data["raw"], data["values"], strict=True)
    for i, (utc_ns, monotonic_ns, raw, values) in enumerate(rows):
        given = values if names is None else dict(zip(names, values, strict=True))
        status = Verbatim(told[str(i)]) if str(i) in told else None
        yield Reading(
            data["source"],
            data["first"] + i,
            utc_ns,
            monotonic_ns,
            raw.encode("latin-1"),
            given,
            status,
            probed.get(str(i)),
        )
