"""The recording that the points so far make, in the format of every recording, and beside it how it was taken.

Only set-ups of which every point is there are in it, so that it can be reported at any time; the journal has the others.
"""

from __future__ import annotations

import csv
import datetime as dt
import hashlib
import io
from collections.abc import Mapping, Sequence
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
    taken, found = story.by_place, list[Row]()
    for run in lead.complete(story):
        steps = lead.steps(run)
        if all(taken[step.place].settled for step in steps):
            found += [Row(taken[step.place], step) for step in steps]
    return found


def as_recording(rows: Sequence[Row]) -> bytes:
    """The CSV; a cell is empty where a stream had nothing."""
    planned = list(dict.fromkeys(name for row in rows for name in row.step.columns))
    measured = list(dict.fromkeys(name for row in rows for name in row.point.columns if name not in COORDINATES))
    joined = list(dict.fromkeys(name for row in rows for name in (*row.point.joined, *row.point.missing)))
    names = [*_FIRST, *dict.fromkeys((*planned, "time_s", *measured, *joined))]
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(names)
    for row in rows:
        writer.writerow([*row.point.place[:1], *row.point.place[1:], *(_cell(row, name) for name in names[3:])])
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


def said_of(
    story: Story, rows: Sequence[Row], folder: Path, hashes: Sequence[str], *, simulated: bool
) -> dict[str, Any]:
    """How the recording was taken; with the hash of what it was before, lest a power cut leave the two files apart."""
    return {
        "program": PROGRAM,
        "simulated": simulated,
        "recording_sha256": list(hashes),
        "sessions": [
            {"number": session.number, "begin_utc": _utc(session.start.utc_ns), "journal": f"{FOLDER}/{path.name}",
             "sha256": sha256_of(path) or ""}
            for session in story.sessions
            for path in (folder / EVENTS.format(session.number),)
        ],
        "instruments": [_plain(identity) for identity in story.identities.values()],
        "typed": sum(row.point.how.startswith(TYPED) for row in rows),
        "files": dict(story.files),
        "columns": _columns(rows),
        "gaps": [
            {"instrument": source, "since_s": since, "lasted_s": lasted, "why": why}
            for source, since, lasted, why in story.gaps
        ],
        "undone": [
            {"measurement": point.place[0], "point": point.place[1], "repeat": point.place[2], "reason": reason}
            for point, reason in story.undone
        ],
        "clock_jumps_s": [by_s for _, by_s in story.clocks],
        "damaged": list(story.damaged),
        "left_out": len(story.points) - len(rows),
    }  # fmt: skip


class LiveRecording:
    """The recording of a job and what stands beside it, as they are written anew while they grow."""

    def __init__(self, path: Path, folder: Path, *, simulated: bool) -> None:
        self.path, self._folder, self._simulated = path, folder, simulated
        self._beside = path.with_name(provenance_name(path.name))
        self._last = sha256_of(path)
        self._rows = -1
        if path.exists() and (self._last is None or self._last not in self._own()):
            raise CmmUqError("was not written by cmm-uq acquire, or was changed since", where=str(path),
                             fix="Move it away, or name another file in [recording]; nothing is overwritten")  # fmt: skip

    def write(self, story: Story, lead: Lead) -> bool:
        """Write both where the points changed; whether they were written."""
        rows = rows_of(story, lead)
        content = as_recording(rows)
        own = hashlib.sha256(content).hexdigest()
        if own == self._last or (self._last is None and not rows):
            return False
        hashes = [own, *([self._last] if self._last else [])]
        said = said_of(story, rows, self._folder, hashes, simulated=self._simulated)
        written_whole(self._beside, as_file(said))
        written_whole(self.path, content)
        self._last = own
        return True

    def finish(self, story: Story, lead: Lead) -> None:
        """Write what stands beside the recording once more: gaps and notes since its last point."""
        self.write(story, lead)
        if self._last is not None and (rows := rows_of(story, lead)):
            written_whole(
                self._beside, as_file(said_of(story, rows, self._folder, [self._last], simulated=self._simulated))
            )

    def _own(self) -> list[str]:
        try:
            return AcquisitionRecord.model_validate_json(self._beside.read_bytes()).recording_sha256
        except (OSError, ValueError):
            return []


def _columns(rows: Sequence[Row]) -> dict[str, Any]:
    """Rms and largest standard uncertainty of each joined column, and the points without it."""
    names = dict.fromkeys(name for row in rows for name in (*row.point.joined, *row.point.missing))
    found = {}
    for name in names:
        u = np.array([row.point.joined[name].u for row in rows if name in row.point.joined])
        missing = [
            list(row.point.place) for row in rows if name not in row.point.joined and name not in row.point.columns
        ]
        found[name] = {
            "u": float(np.sqrt(np.mean(u**2))) if u.size else 0.0, "u_largest": float(u.max(initial=0.0)),
            "missing": [tuple(place) for place in missing],
        }  # fmt: skip
    if untimed := [row.point.place for row in rows if not row.point.timed]:
        found["time_s"] = {"u": 0.0, "u_largest": 0.0, "missing": untimed}
    return found


def _plain(identity: Mapping[str, Any]) -> dict[str, Any]:
    return {key: value for key, value in identity.items() if value is not None}


def _utc(ns: int) -> str:
    return dt.datetime.fromtimestamp(ns / 1e9, dt.UTC).isoformat(timespec="milliseconds").replace("+00:00", "Z")
