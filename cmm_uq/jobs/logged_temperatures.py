"""``[machine] temperature_log`` joined to the recording: temperatures of the scales at the time of each point."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.points import AXES, Points
from cmm_uq.jobs.machine import MachineFacts
from cmm_uq.jobs.temperature_log import TemperatureLog, parse_temperature_log

COLUMNS = tuple(f"temp_{axis}_c" for axis in AXES)
"""What a log gives the recording."""

KEY = "[machine] temperature_log"


def log_of(machine: MachineFacts, inputs: Mapping[str, bytes], folder: Path) -> TemperatureLog | None:
    """The log that a job names, ``None`` where it names none.

    Parameters
    ----------
    inputs : contents of the job's files by their names.
    folder : of the job, for messages.

    Raises
    ------
    CmmUqError : it is no temperature log, or its clock is not the recording's.
    """
    given = machine.temperature_log
    if given is None:
        return None
    sensors = given.columns.model_dump() if given.columns is not None else None
    where = str(folder / given.file)
    log = parse_temperature_log(
        inputs[given.file], where, sensors, start=given.start, max_gap=given.max_gap_s
    )  # fmt: skip
    if log.dated and given.start is None:
        raise CmmUqError("gives dates, and the recording's time_s counts seconds", where=where,
                         fix=f"Say in {KEY} when time_s was 0: start = 2004-06-01T14:30:00")  # fmt: skip
    return log


def with_logged(points: Points, log: TemperatureLog | None, toml: Path, recording: str) -> Points:
    """The points of a recording with the temperatures of their scales.

    Parameters
    ----------
    toml : the job's, for messages.
    recording : its recording, for messages.

    Raises
    ------
    CmmUqError : the recording has temperatures of the scales itself, or no times, or a time that the log does not know.
    """
    if log is None:
        return points
    own = next((name for name in COLUMNS if name in points.columns), None)
    if own is not None:
        raise CmmUqError(f"the recording has {own}, and the log gives it as well", where=f"{toml}: {KEY}",
                         fix=f"Leave out the log, or {', '.join(COLUMNS)} in {recording}")  # fmt: skip
    if "time_s" not in points.columns:
        raise CmmUqError("the recording has no times to be joined by", where=f"{toml}: {KEY}",
                         fix=f"Record time_s in {recording}, by the clock of the log")  # fmt: skip
    found = log.at(points.columns["time_s"], lambda row: f"{recording} line {points.lines[row]}, column time_s")
    return replace(points, columns={**points.columns, **dict(zip(COLUMNS, found.T, strict=True))})
