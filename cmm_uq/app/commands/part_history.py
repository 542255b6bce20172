"""The machine's history that its drift was read from: what of the records goes into a part's report, and comes out of it."""

from __future__ import annotations

import datetime as dt
import json
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from cmm_uq.base.errors import CmmUqError
from cmm_uq.laboratory.due.drift import DriftHistory, history
from cmm_uq.laboratory.due.drift_filter import change_since
from cmm_uq.laboratory.due.history import MachineHistory
from cmm_uq.laboratory.records.facts import Series

FILE = "machine-records/history.json"
"""By its name among the inputs of a part's report."""

SCHEMA = "cmm-uq/machine-history/1"

_COLUMNS: Mapping[str, type] = {
    "day": np.int64, "value": np.float64, "u": np.float64, "u_artefact": np.float64, "artefact": np.str_,
    "entry": np.int64, "adjusted_since": np.int64, "interim": np.bool_,
}  # fmt: skip


@dataclass(frozen=True, eq=False)
class Known:
    """What records say of how a machine changes.

    Parameters
    ----------
    adjusted : days of its adjustments.
    values : each over time, up to the calibration, by name, with the ordinal of the newest adjustment.
    """

    adjusted: tuple[dt.date, ...]
    values: Mapping[str, tuple[Series, int | None]]

    def change(self, name: str, days: float) -> float | None:
        """Root mean square change of a value by so many days after the calibration, in its unit; ``None`` if nobody knows."""
        if name not in self.values:
            return None
        series, adjusted_after = self.values[name]
        try:
            of: DriftHistory = history(series, adjusted_after)
            return change_since(of, days, limit=series.limit)
        except CmmUqError:
            return None


def kept(past: MachineHistory, until: dt.date) -> bytes:
    """The history up to the calibration, as JSON whose numbers are those of the records to the bit.

    Parameters
    ----------
    past : of the machine, on the day of the part's measurement.
    until : day of the calibration.
    """
    values = []
    for one in past.values:
        series, rows = one.series, np.asarray(one.series.day) <= until.toordinal()
        columns = {name: np.asarray(getattr(series, name))[rows].tolist() for name in _COLUMNS}
        values.append({
            "name": series.name, "quantity": series.quantity, "unit": series.unit, "limit": series.limit,
            "adjusted_after": one.adjusted_after, **columns,
        })  # fmt: skip
    said = {"schema": SCHEMA, "adjusted": [day.isoformat() for day in past.machine.adjusted], "values": values}
    return (json.dumps(said, ensure_ascii=False, indent=1, sort_keys=True) + "\n").encode()


def known_of(content: bytes) -> Known:
    """The history that :func:`kept` wrote.

    Raises
    ------
    CmmUqError : it is none.
    """
    try:
        said = json.loads(content)
        if said["schema"] != SCHEMA:
            raise ValueError(said["schema"])
        adjusted = tuple(map(dt.date.fromisoformat, said["adjusted"]))
        return Known(adjusted, {str(one["name"]): (_series(one), one["adjusted_after"]) for one in said["values"]})
    except (ValueError, KeyError, TypeError, RecursionError, OverflowError) as error:
        raise CmmUqError("is no history of a machine", where=FILE,
                         fix="Evaluate the part again, with --records") from error  # fmt: skip


def _series(one: Mapping[str, Any]) -> Series:
    columns: dict[str, Any] = {name: np.asarray(one[name], dtype=sort) for name, sort in _COLUMNS.items()}
    if len({column.shape for column in columns.values()}) != 1 or columns["day"].ndim != 1:
        raise ValueError("columns of different length")
    limit = None if one["limit"] is None else float(one["limit"])
    return Series(name=str(one["name"]), quantity=str(one["quantity"]), unit=str(one["unit"]), limit=limit, **columns)
