"""Certificates, machines and series made up for tests of the room."""

from __future__ import annotations

import datetime as dt
from collections.abc import Sequence
from typing import Any

import numpy as np

from cmm_uq.laboratory.records.facts import RecordedCertificate, RecordedMachine, RecordedValue, Series

FIRST = dt.date(2024, 3, 1)
MACHINE = RecordedMachine("1102", "Iota", "DEA", "Iota 1102", "Hall 1")


def value(
    number: float, *, name: str = "scale_x.ppm", u: float = 0.5, u_artefact: float = 0.0, limit: float | None = 8.0
) -> RecordedValue:
    return RecordedValue(name, f"quantity {name}", "ppm", number, u, number - 2 * u, number + 2 * u, u_artefact, limit)


def certificate(day: dt.date, *values: RecordedValue, entry: int = 1, **further: Any) -> RecordedCertificate:
    usual: dict[str, Any] = {
        "job": f"job-{day}", "machine": "1102", "artefact": "BB-7", "kind": "some kind", "origin": "measured",
        "recorded": dt.datetime.combine(day, dt.time(12), dt.UTC), "adjusted_since": None, "state": "released",
        "decision": "pass", "diagnosis": "consistent", "interim": False, "folder": "f", "version": "0.5.0",
        "results_sha256": "", "number": f"K-{day}", "command": "report",
    }  # fmt: skip
    return RecordedCertificate(entry=entry, day=day, values=values or (value(1.0),), **(usual | further))


def series(
    days: Sequence[int],
    values: Sequence[float],
    u: Sequence[float] | float = 0.5,
    u_artefact: Sequence[float] | float = 0.0,
    artefact: Sequence[str] | str = "BB-7",
    adjusted_since: Sequence[int] | int = 0,
    limit: float | None = 8.0,
) -> Series:
    n, start = len(days), FIRST.toordinal()
    since = np.broadcast_to(np.asarray(adjusted_since), n)
    return Series(
        "scale_x.ppm", "Scale error of x", "ppm", limit, np.asarray(days) + start, np.asarray(values, dtype=float),
        np.broadcast_to(np.asarray(u, dtype=float), n), np.broadcast_to(np.asarray(u_artefact, dtype=float), n),
        np.broadcast_to(np.asarray(artefact), n), np.arange(1, n + 1), np.where(since > 0, since + start, 0),
        np.zeros(n, dtype=bool),
    )  # fmt: skip
