"""Temperatures of a machine's scales at any moment, from a log of several thermocouples a scale.

A log is a CSV with ``time_s`` (seconds) or ``time`` (ISO 8601) and a column for each thermocouple. Which of them sit on
which scale is told, or read off their names: ``x1_c``, ``temp_x_2_c`` … An empty cell is a thermocouple that fell out for a
moment; the others of its scale stand in for it.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from cmm_uq.errors import CmmUqError, suggestion
from cmm_uq.files.content import content_of
from cmm_uq.files.limits import TABLE_BYTES
from cmm_uq.physics.csv_table import CsvTable, csv_table
from cmm_uq.points import AXES, Floats

_SENSOR = re.compile(r"(?:temp_)?([xyz])_?(\d+)_c")


@dataclass(frozen=True, eq=False)
class TemperatureLog:
    """Mean temperature of each scale over time.

    Parameters
    ----------
    times : (m,) s, increasing; seconds since 1970 where the log gives dates.
    scales : (m, 3) mean of the thermocouples on scales x, y, z, °C.
    spread : (m, 3) largest less smallest of them, K: how far one number describes a scale.
    source : file.
    """

    times: Floats
    scales: Floats
    spread: Floats
    source: str = ""

    def at(self, times: ArrayLike) -> Floats:
        """Temperatures (n, 3) of the scales at times (n,), linear between the entries of the log, °C.

        Raises
        ------
        CmmUqError : a time lies before or after the log.
        """
        return self._between(times, self.scales)

    def spread_at(self, times: ArrayLike) -> Floats:
        """Spread (n, 3) of the thermocouples of each scale at times (n,), K."""
        return self._between(times, self.spread)

    def _between(self, times: ArrayLike, values: Floats) -> Floats:
        wanted = np.atleast_1d(np.asarray(times, dtype=np.float64))
        inside = (wanted >= self.times[0]) & (wanted <= self.times[-1])
        if not inside.all():
            first = wanted[~inside][0]
            raise CmmUqError(
                f"no temperature at {first:.10g} s: the log reaches from {self.times[0]:.10g} to {self.times[-1]:.10g} s",
                where=self.source or None,
                fix="Log temperatures from before the first point until after the last, by the same clock",
            )
        return np.column_stack([np.interp(wanted, self.times, column) for column in values.T])


def read_temperature_log(path: Path, sensors: Mapping[str, Sequence[str]] | None = None) -> TemperatureLog:
    """Temperature log from a CSV file; see :func:`parse_temperature_log`."""
    content = content_of(path, TABLE_BYTES, "Check the name of the log")
    return parse_temperature_log(content, str(path), sensors)


def parse_temperature_log(
    content: bytes, where: str, sensors: Mapping[str, Sequence[str]] | None = None
) -> TemperatureLog:
    """Temperature log from the content of a CSV file.

    Parameters
    ----------
    content : of the file, UTF-8.
    where : its name, for messages.
    sensors : columns of the thermocouples on scales x, y and z; by their names when left out.

    Raises
    ------
    CmmUqError : what is wrong, with its line.
    """
    table = csv_table(content, where, ())
    clock = next((name for name in ("time_s", "time") if name in table.header), None)
    if clock is None:
        raise CmmUqError(
            "no column time_s or time", where=where, fix="Give seconds (time_s) or dates in ISO 8601 (time)"
        )
    times = np.array([_time(table, row, clock) for row in range(len(table.rows))])
    early = np.flatnonzero(np.diff(times) <= 0)
    if len(early):
        raise CmmUqError(
            "is not later than the line before", where=table.at(early[0] + 1), fix="Sort by time, each once"
        )
    on_scale = [_columns(table, axis, sensors) for axis in AXES]
    readings = [[_readings(table, row, columns) for columns in on_scale] for row in range(len(times))]
    scales = np.array([[np.mean(scale) for scale in row] for row in readings])
    spread = np.array([[np.ptp(scale) for scale in row] for row in readings])
    return TemperatureLog(times, scales, spread, where)


def _columns(table: CsvTable, axis: str, sensors: Mapping[str, Sequence[str]] | None) -> tuple[str, ...]:
    if sensors is None:
        matches = [(_SENSOR.fullmatch(name), name) for name in table.header]
        found = tuple(name for match, name in matches if match and match[1] == axis)
    else:
        found = tuple(sensors.get(axis, ()))
    if not found:
        raise CmmUqError(
            f"no thermocouple of scale {axis}",
            where=table.where,
            fix=f"Name its columns {axis}1_c, {axis}2_c …, or say which",
        )
    for name in found:
        if name not in table.header:
            raise CmmUqError(f"no column {name!r}", where=table.where, fix=suggestion(name, table.header))
    return found


def _readings(table: CsvTable, row: int, columns: Sequence[str]) -> list[float]:
    """Temperatures of one scale that are there."""
    given = [name for name in columns if table.rows[row][table.header.index(name)]]
    if not given:
        raise CmmUqError(f"no temperature of {', '.join(columns)}", where=table.at(row), fix="Remove the line")
    values = [table.number(row, name) for name in given]
    for name, value in zip(given, values, strict=True):
        if not -50 < value < 100:
            raise CmmUqError(
                f"{name} = {value:g} °C",
                where=table.at(row),
                fix="Give °C; leave the cell empty where the thermocouple failed",
            )
    return values


def _time(table: CsvTable, row: int, clock: str) -> float:
    if clock == "time_s":
        return table.number(row, clock)
    text = table.rows[row][table.header.index(clock)]
    try:
        moment = datetime.fromisoformat(text)
    except ValueError:
        raise CmmUqError(
            f"time = {text!r} is no date", where=table.at(row), fix="Write it as 2004-06-01T14:30:00"
        ) from None
    # without a zone the clock is taken as it is, so that no change to summer time tears the log
    return (moment if moment.tzinfo else moment.replace(tzinfo=UTC)).timestamp()
