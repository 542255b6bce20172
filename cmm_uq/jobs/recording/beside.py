"""What is recorded beside a recording: temperatures of the scales, from a log of thermocouples, and ``[short_gauge]``.

A log is a CSV with ``time_s`` (seconds) or ``time`` (ISO 8601) and a column for each thermocouple. Which of them sit on
which scale is told, or read off their names: ``x1_c``, ``temp_x_2_c`` … An empty cell is a thermocouple that fell out for a
moment; the others of its scale stand in for it.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, NoReturn

import numpy as np
from numpy.typing import ArrayLike
from pydantic import model_validator

from cmm_uq.base.errors import CmmUqError, suggestion
from cmm_uq.base.files.csv_table import CsvTable, csv_table
from cmm_uq.base.files.table import Expansion, JobTable, Length, Limit, key, required
from cmm_uq.base.points import AXES, Floats, Ints, Machine, Points
from cmm_uq.base.units import MICROMETRE, REFERENCE_TEMPERATURE
from cmm_uq.base.values import dataclass, replace
from cmm_uq.jobs.recording.own import read_recording
from cmm_uq.jobs.tables.artefact import Traceability
from cmm_uq.jobs.tables.length_formula import Factor, Freedom, with_standard_uncertainty
from cmm_uq.jobs.tables.machine import MachineFacts

SHORT_GAUGE, LOG = "[short_gauge]", "[machine] temperature_log"
COLUMNS = tuple(f"temp_{axis}_c" for axis in AXES)  # what a log gives the recording

FARTHEST_MM = 1.0
"""From the certified length, or from the first repeat: a gauge farther off is another one, or in another place."""


class ShortGaugeFacts(JobTable):
    """``[short_gauge]``: a gauge block, or another gauge of two opposite faces, and the recording of it."""

    file: str
    """Its recording: points 1 and 2, the middles of its two faces, in every measurement and repeat."""
    length_mm: Length = required("Certified length at 20 °C.")
    u_um: Limit
    """Standard uncertainty (k = 1) of that length as it was met: of the certificate and of the gauge's temperature;
    `U_um` with `k` may stand for it."""
    U_um: Limit | None = None
    """Expanded uncertainty, as a certificate states it, in place of `u_um`; needs `k` or `degrees_of_freedom`."""
    k: Factor | None = key(None, "Coverage factor of `U_um`.")
    degrees_of_freedom: Freedom | None = None
    """Effective degrees of freedom by the certificate; without `k` the factor is Student's t for 95 % by them. Figures and
    decisions take u of the normal distribution with the same 95 % interval."""
    cte_per_k: Expansion = key(0.0, "Coefficient of thermal expansion of the gauge, 1/K.")
    name: str = key("", "Name of the gauge on the certificate.")
    serial: str = key("", "Serial number of the gauge.")
    certificate: Traceability | None = key(None, "The gauge's own certificate.")

    @model_validator(mode="before")
    @classmethod
    def _expanded(cls, data: Any) -> Any:
        return with_standard_uncertainty(data)


@dataclass(frozen=True, eq=False)
class ShortGauge:
    """A short gauge as recorded: rows (q, 2) of points 1 and 2 of each (measurement, repeat)."""

    facts: ShortGaugeFacts
    points: Points
    rows: Ints

    @property
    def errors_mm(self) -> Floats:
        """Measured minus certified length at 20 °C, (q,) mm."""
        found = np.linalg.norm(self.lines_mm[1], axis=1)
        recorded = self.points.columns.get("temp_artefact_c")
        if recorded is not None:
            found = found / (1 + self.facts.cte_per_k * (recorded[self.rows].mean(axis=1) - REFERENCE_TEMPERATURE))
        return np.asarray(found - self.facts.length_mm, dtype=np.float64)

    @property
    def u_mm(self) -> float:
        """Standard uncertainty of the certified length."""
        return self.facts.u_um * MICROMETRE

    @property
    def lines_mm(self) -> tuple[Floats, Floats]:
        """Middle of each, and the way from its first face to its second, (q, 3) mm."""
        first, last = self.points.xyz[self.rows[:, 0]], self.points.xyz[self.rows[:, 1]]
        return 0.5 * (first + last), last - first


def short_gauge_of(facts: ShortGaugeFacts, content: bytes, where: str, machine: Machine) -> ShortGauge:
    points = read_recording(content, where, machine)

    def refuse(problem: str, row: int, fix: str) -> NoReturn:
        raise CmmUqError(problem, where=f"{where} line {points.lines[row]}", fix=fix)

    for own in points.rows_of_groups:
        if sorted(points.point[own].tolist()) != [1, 2]:
            number, repeat = points.measurement[own[0]], points.repeat[own[0]]
            refuse(f"measurement {number}, repeat {repeat} does not have points 1 and 2 alone", own[0],
                   "Record the middle of either face of the short gauge as points 1 and 2")  # fmt: skip
    ordered = sorted(points.rows_of_groups, key=lambda own: (points.measurement[own[0]], points.repeat[own[0]]))
    gauge = ShortGauge(facts, points, np.array([own[np.argsort(points.point[own])] for own in ordered], dtype=np.int64))
    errors, first = gauge.errors_mm, gauge.rows[:, 0]
    off = int(np.argmax(np.abs(errors)))
    if abs(errors[off]) > FARTHEST_MM:
        length = errors[off] + facts.length_mm
        refuse(f"a length of {length:.5g} mm, where {SHORT_GAUGE} length_mm is {facts.length_mm:g}", first[off],
               "Give the length of the gauge that was recorded, in mm")  # fmt: skip
    for number in np.unique(points.measurement[first]):  # one place: its repeats stand for each other
        rows = gauge.rows[points.measurement[first] == number]
        apart = np.linalg.norm(points.xyz[rows] - points.xyz[rows[0]], axis=2).max(axis=1)
        off = int(np.argmax(apart))
        if apart[off] > FARTHEST_MM:
            refuse(f"measurement {number} has the short gauge in two places, {apart[off]:.3g} mm apart", rows[off, 0],
                   "Number each place as a measurement of its own, and its repeats in it")  # fmt: skip
    # where the senses of travel are recorded they must tell a length that was met from both sides
    if all(f"approach_{axis}" in points.columns for axis in AXES):
        approach = np.column_stack([points.columns[f"approach_{axis}"] for axis in AXES])
        along = np.einsum("qji,qi->qj", approach[gauge.rows], gauge.lines_mm[1])
        if (same := np.flatnonzero(along[:, 0] * along[:, 1] >= 0)).size:
            refuse("both faces of the short gauge were reached from the same side", first[same[0]],
                   "Record a gauge whose faces are met from opposite sides, or mend approach_x, …")  # fmt: skip
    return gauge


_SENSOR = re.compile(r"(?:temp_)?([xyz])_?(\d+)_c")

BRIDGED = 2.5
"""Median intervals of a log that are still interpolated over: one entry may be missing, two in a row are a gap."""


@dataclass(frozen=True, eq=False)
class TemperatureLog:
    """Mean temperature of the thermocouples on scales x, y, z, (m, 3) °C, and their spread, K, over times (m,), s.

    Times are since the start that was told, or since 1970, where the log is ``dated``; over ``max_gap``, s, it interpolates.
    """

    times: Floats
    scales: Floats
    spread: Floats
    source: str = ""
    max_gap: float = np.inf
    dated: bool = False

    def at(self, times: ArrayLike, place: Callable[[int], str] | None = None) -> Floats:
        """Temperatures (n, 3) of the scales at times (n,), linear between the entries of the log, °C."""
        return self._between(self._inside(times, place), self.scales)

    def spread_at(self, times: ArrayLike) -> Floats:
        """Spread (n, 3) of the thermocouples of each scale at times (n,), K."""
        return self._between(self._inside(times), self.spread)

    def u_at(self, times: ArrayLike) -> Floats:
        """Standard uncertainty (n, 3) of :meth:`at` for what a scale did between two entries, K; 0 at an entry.

        Between them the temperature is taken to lie anywhere between theirs (GUM 4.3.7: their difference over √12). What the
        thermocouples do not see, their own calibration and the temperature between them along the scale, is not in it.
        """
        moments = self._inside(times)
        after = np.searchsorted(self.times, moments)
        steps = np.abs(self.scales[after] - self.scales[np.maximum(after - 1, 0)]) / np.sqrt(12)
        return np.where((self.times[after] == moments)[:, None], 0.0, steps)

    def _between(self, moments: Floats, values: Floats) -> Floats:
        return np.column_stack([np.interp(moments, self.times, column) for column in values.T])

    def _inside(self, times: ArrayLike, place: Callable[[int], str] | None = None) -> Floats:
        """Times (n,), none of them outside the log or in a gap of it; ``place`` of one by its index, for messages."""
        moments = np.atleast_1d(np.asarray(times, dtype=np.float64))
        after = np.searchsorted(self.times, moments)
        outside = (moments < self.times[0]) | (moments > self.times[-1]) | np.isnan(moments)
        if outside.any():
            problem = f"the log reaches from {self.times[0]:.10g} to {self.times[-1]:.10g} s"
            fix = "Log temperatures from before the first point until after the last, by the same clock"
        else:
            before = np.where(self.times[after] == moments, after, after - 1)
            outside = self.times[after] - self.times[before] > self.max_gap
            if not outside.any():
                return moments
            i = int(np.argmax(outside))
            problem = f"the log has a gap from {self.times[before[i]]:.10g} to {self.times[after[i]]:.10g} s"
            fix = f"Gaps of up to {self.max_gap:.10g} s are interpolated over; longer ones where max_gap_s allows it"
        i = int(np.argmax(outside))
        where = place(i) if place is not None else self.source or None
        raise CmmUqError(f"no temperature at {moments[i]:.10g} s: {problem}", where=where, fix=fix)


def parse_temperature_log(
    content: bytes, where: str, sensors: Mapping[str, Sequence[str]] | None = None, *, start: datetime | None = None,
    max_gap: float | None = None,
) -> TemperatureLog:  # fmt: skip
    """Temperature log of a CSV file; ``max_gap``, s, is :data:`BRIDGED` median intervals when left out."""
    table = csv_table(content, where, ())
    times = _seconds(table, start)
    early = np.flatnonzero(np.diff(times) <= 0)
    if len(early):
        fix = "Sort by time, each once"
        raise CmmUqError("is not later than the line before", where=table.at(early[0] + 1), fix=fix)
    on_scale = [_columns(table, axis, sensors) for axis in AXES]
    readings = [[_readings(table, row, columns) for columns in on_scale] for row in range(len(times))]
    scales, spread = (np.array([[of(scale) for scale in row] for row in readings]) for of in (np.mean, np.ptp))
    if max_gap is None:
        max_gap = BRIDGED * float(np.median(np.diff(times))) if len(times) > 1 else np.inf
    return TemperatureLog(times, scales, spread, where, max_gap, dated="time_s" not in table.header)


def _columns(table: CsvTable, axis: str, sensors: Mapping[str, Sequence[str]] | None) -> tuple[str, ...]:
    named = [name for name in table.header if (match := _SENSOR.fullmatch(name)) and match[1] == axis]
    columns = tuple(named if sensors is None else sensors.get(axis, ()))
    if not columns:
        fix = f'Name its columns {axis}1_c, {axis}2_c …, or say which: columns = {{ {axis} = ["…"], … }}'
        raise CmmUqError(f"no thermocouple of scale {axis}", where=table.where, fix=fix)
    for name in columns:
        if name not in table.header:
            raise CmmUqError(f"no column {name!r}", where=table.where, fix=suggestion(name, table.header))
    return columns


def _readings(table: CsvTable, row: int, columns: Sequence[str]) -> list[float]:
    """Temperatures of one scale that are there."""
    values = {name: table.number(row, name) for name in columns if table.rows[row][table.header.index(name)]}
    if not values:
        raise CmmUqError(f"no temperature of {', '.join(columns)}", where=table.at(row), fix="Remove the line")
    for name, value in values.items():
        if not -50 < value < 100:
            fix = "Give °C; leave the cell empty where the thermocouple failed"
            raise CmmUqError(f"{name} = {value:g} °C", where=table.at(row), fix=fix)
    return [values[name] for name in columns if name in values]


def _seconds(table: CsvTable, start: datetime | None) -> Floats:
    """Times (m,) of the rows."""
    if "time_s" in table.header:
        if start is not None:
            fix = "Leave out start, or give dates (time)"
            raise CmmUqError("gives time_s, seconds that need no start", where=table.where, fix=fix)
        return np.array([table.number(row, "time_s") for row in range(len(table.rows))])
    if "time" not in table.header:
        fix = "Give seconds (time_s) or dates in ISO 8601 (time)"
        raise CmmUqError("no column time_s or time", where=table.where, fix=fix)
    moments = [_moment(table, row) for row in range(len(table.rows))]
    first = start or moments[0]
    for row, moment in enumerate(moments):
        if (moment.tzinfo is None) != (first.tzinfo is None):
            has, other = ("no zone", "has one") if moment.tzinfo is None else ("a zone", "has none")
            said = f"time = {moment.isoformat()!r} has {has}, and {'start' if start else 'the first line'} {other}"
            fix = "Give the zone of all of them, such as +02:00, or of none"
            raise CmmUqError(said, where=table.at(row), fix=fix)
    # without a zone the clock is taken as it is, so that no change to summer time tears the log
    begin = start or datetime(1970, 1, 1, tzinfo=UTC if first.tzinfo else None)
    return np.array([(moment - begin).total_seconds() for moment in moments])


def _moment(table: CsvTable, row: int) -> datetime:
    text = table.rows[row][table.header.index("time")]
    try:
        return datetime.fromisoformat(text)
    except ValueError:
        fix = "Write it as 2004-06-01T14:30:00"
        raise CmmUqError(f"time = {text!r} is no date", where=table.at(row), fix=fix) from None


def log_of(machine: MachineFacts, inputs: Mapping[str, bytes], folder: Path) -> TemperatureLog | None:
    """The log that a job names, ``None`` where it names none."""
    facts = machine.temperature_log
    if facts is None:
        return None
    sensors, where = facts.columns.model_dump() if facts.columns is not None else None, str(folder / facts.file)
    log = parse_temperature_log(inputs[facts.file], where, sensors, start=facts.start, max_gap=facts.max_gap_s)
    if log.dated and facts.start is None:
        raise CmmUqError("gives dates, and the recording's time_s counts seconds", where=where,
                         fix=f"Say in {LOG} when time_s was 0: start = 2004-06-01T14:30:00")  # fmt: skip
    return log


def with_logged(points: Points, log: TemperatureLog | None, toml: Path, recording: str) -> Points:
    """The points of a recording with the temperatures of their scales."""
    if log is None:
        return points
    recorded, problem = [name for name in COLUMNS if name in points.columns], ""
    if recorded:
        problem = f"the recording has {recorded[0]}, and the log gives it as well"
        fix = f"Leave out the log, or {', '.join(COLUMNS)} in {recording}"
    elif "time_s" not in points.columns:
        problem = "the recording has no times to be joined by"
        fix = f"Record time_s in {recording}, by the clock of the log"
    if problem:
        raise CmmUqError(problem, where=f"{toml}: {LOG}", fix=fix)
    scales = log.at(points.columns["time_s"], lambda row: f"{recording} line {points.lines[row]}, column time_s")
    return replace(points, columns={**points.columns, **dict(zip(COLUMNS, scales.T, strict=True))})
