"""The recording that the points so far make, in the format of every recording, and beside it how it was taken.

Only set-ups of which every point is there are in it, so that it can be reported at any time; the journal has the others.
"""

from __future__ import annotations

import csv
import datetime as dt
import hashlib
import io
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.output.manifest import sha256_of
from cmm_uq.jobs.acquired import AcquisitionRecord, as_file, provenance_name
from cmm_uq.jobs.derived_job import PROGRAM
from cmm_uq.laboratory.live.folder import EVENTS, FOLDER
from cmm_uq.laboratory.live.journal import written_whole
from cmm_uq.laboratory.live.lead import Lead, PlannedPoint
from cmm_uq.laboratory.live.recorder import COORDINATES
from cmm_uq.laboratory.live.story import Point, Story

_FIRST = ("measurement", "point", "repeat", *COORDINATES)
TYPED = "typed"  # how a point came that the operator typed; ``typed length`` where it was a distance


@dataclass(frozen=True)
class Row:
    """A point of the recording: as accepted, and as planned."""

    point: Point
    step: PlannedPoint


def rows_of(story: Story, lead: Lead) -> list[Row]:
    """Points of complete set-ups, all streams joined, in the order of the plan."""
    taken, rows = story.by_place, list[Row]()
    for steps in map(lead.steps, lead.complete(story)):
        if all(taken[step.place].settled for step in steps):
            rows += [Row(taken[step.place], step) for step in steps]
    return rows


def as_recording(rows: Sequence[Row]) -> bytes:
    """The CSV; a cell is empty where a stream had nothing."""
    names = [*_FIRST, *dict.fromkeys((
        *(name for row in rows for name in row.step.columns), "time_s",
        *(name for row in rows for name in row.point.columns if name not in COORDINATES),
        *(name for row in rows for name in (*row.point.joined, *row.point.missing)),
    ))]  # fmt: skip
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(names)
    for row in rows:
        writer.writerow([*row.point.place, *(_cell(row, name) for name in names[3:])])
    return text.getvalue().encode()


def _cell(row: Row, name: str) -> str:
    point = row.point
    if name == "time_s":
        return f"{point.time_s:.6f}" if point.timed else ""
    value = point.columns.get(name)
    if value is None and name in point.joined:
        value = point.joined[name].value
    if value is None and name not in point.missing:
        value = row.step.columns.get(name)
    if value is None:
        return ""
    return f"{value:.7f}" if name in COORDINATES else f"{value:.10g}"


class LiveRecording:
    """The recording of a job and what stands beside it, as they are written anew while they grow."""

    def __init__(self, path: Path, folder: Path, *, simulated: bool) -> None:
        self.path, self._folder, self._simulated = path, folder, simulated
        self._beside = path.with_name(provenance_name(path.name))
        self._last = sha256_of(path)
        try:
            own = AcquisitionRecord.model_validate_json(self._beside.read_bytes()).recording_sha256
        except (OSError, ValueError):
            own = []
        if path.exists() and (self._last is None or self._last not in own):
            fix = "Move it away, or name another file in [recording]; nothing is overwritten"
            raise CmmUqError("was not written by cmm-uq acquire, or was changed since", where=str(path), fix=fix)

    def write(self, story: Story, lead: Lead) -> None:
        """Write both where the points changed; beside with the hash of what it was, lest a power cut leave them apart."""
        rows = rows_of(story, lead)
        content = as_recording(rows)
        digest = hashlib.sha256(content).hexdigest()
        if digest != self._last and (self._last is not None or rows):
            hashes = [digest, *([self._last] if self._last else [])]
            written_whole(self._beside, as_file(self._provenance(story, rows, hashes)))
            written_whole(self.path, content)
            self._last = digest

    def finish(self, story: Story, lead: Lead) -> None:
        """Write what stands beside the recording once more: gaps and notes since its last point."""
        self.write(story, lead)
        if self._last is not None and (rows := rows_of(story, lead)):
            written_whole(self._beside, as_file(self._provenance(story, rows, [self._last])))

    def _provenance(self, story: Story, rows: Sequence[Row], hashes: Sequence[str]) -> dict[str, Any]:
        return {
            "program": PROGRAM,
            "simulated": self._simulated,
            "recording_sha256": hashes,
            "sessions": [
                {"number": session.number, "begin_utc": _utc(session.start.utc_ns), "journal": f"{FOLDER}/{path.name}",
                 "sha256": sha256_of(path) or ""}
                for session in story.sessions
                for path in (self._folder / EVENTS.format(session.number),)
            ],
            "instruments": [
                {key: value for key, value in identity.items() if value is not None}
                for identity in story.identities.values()
            ],
            "typed": sum(row.point.how.startswith(TYPED) for row in rows),
            "files": dict(story.files),
            "columns": _columns(rows),
            "gaps": [
                dict(zip(("instrument", "since_s", "lasted_s", "why"), gap, strict=True)) for gap in story.gaps
            ],
            "undone": [
                dict(zip(("measurement", "point", "repeat", "reason"), (*point.place, reason), strict=True))
                for point, reason in story.undone
            ],
            "clock_jumps_s": [by_s for _, by_s in story.clocks],
            "damaged": list(story.damaged),
            "left_out": len(story.points) - len(rows),
        }  # fmt: skip


def _columns(rows: Sequence[Row]) -> dict[str, Any]:
    """Rms and largest standard uncertainty of each joined column, and the points without it."""
    columns: dict[str, Any] = {}
    for name in dict.fromkeys(name for row in rows for name in (*row.point.joined, *row.point.missing)):
        u = np.array([row.point.joined[name].u for row in rows if name in row.point.joined])
        without = [row.point.place for row in rows if name not in {**row.point.joined, **row.point.columns}]
        columns[name] = {"u": float(np.sqrt(np.mean(u**2))) if u.size else 0.0,
                         "u_largest": float(u.max(initial=0.0)), "missing": without}  # fmt: skip
    if untimed := [row.point.place for row in rows if not row.point.timed]:
        columns["time_s"] = {"u": 0.0, "u_largest": 0.0, "missing": untimed}
    return columns


def _utc(ns: int) -> str:
    return dt.datetime.fromtimestamp(ns / 1e9, dt.UTC).isoformat(timespec="milliseconds").replace("+00:00", "Z")
