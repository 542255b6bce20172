"""What comes next of the plan, where a point belongs, and the recording that the points so far make, with how it was taken.

Only set-ups of which every point is there are in the recording, so that it can be reported at any time; the journal has the
others.

Instruments that are not there, for a first try without any: thermometers that drift, and a machine with known errors.

Nothing of it is ever taken for a measurement: a session with them runs only in a job whose origin is ``simulated``.
"""

from __future__ import annotations

import contextlib
import csv
import datetime as dt
import hashlib
import io
import queue
import threading
from collections.abc import Iterator, Mapping, Sequence
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.messages import Text, say
from cmm_uq.base.output.manifest import sha256_of
from cmm_uq.base.output.staging import replace_file
from cmm_uq.base.points import AXES, Floats, Points
from cmm_uq.base.values import dataclass, field
from cmm_uq.jobs.acquired import AcquisitionRecord, as_file, provenance_name
from cmm_uq.jobs.derived_job import PROGRAM
from cmm_uq.jobs.tables.plan import DeclaredSource
from cmm_uq.laboratory.live.instruments.source import Clock, Event, Identity, Reading
from cmm_uq.laboratory.live.recorder import COORDINATES
from cmm_uq.laboratory.live.story import EVENTS, FOLDER, Place, Point, Story

_ON_LINE = 1e-6  # of a set-up's length: what its points may lie off a line, for distances to be typed along it
Run = tuple[int, int]  # measurement and repeat


@dataclass(frozen=True, eq=False)
class PlannedPoint:
    place: Place
    xyz: Floats  # (3,) where the plan has it, mm, in the coordinates that are recorded
    columns: Mapping[str, float]  # what the plan says of it besides: references, approach, normals

    @property
    def run(self) -> Run:
        return self.place[0], self.place[2]


@dataclass(frozen=True, eq=False)
class Lead:
    """A plan, as it is followed; unmeasured columns say what will be measured, not what is known."""

    plan: Points  # nominal points, in the order in which they are measured
    titles: Mapping[int, Text]  # of measurements, in words, by their numbers
    unmeasured: frozenset[str] = frozenset({"time_s"})
    _steps: dict[Run, list[PlannedPoint]] = field(default_factory=dict)

    @cached_property
    def runs(self) -> tuple[Run, ...]:
        return tuple(self.plan.run_of(group) for group in range(len(self.plan.rows_of_groups)))

    def all_runs(self, story: Story) -> list[Run]:
        """Those planned and asked for, without those left out."""
        runs = list(self.runs)
        for run in story.asked:
            if run not in runs:
                last = max(i for i, (measurement, _) in enumerate(runs) if measurement == run[0])
                runs.insert(last + 1, run)
        return [run for run in runs if run not in story.skipped]

    def steps(self, run: Run) -> list[PlannedPoint]:
        """Points of a measurement and repeat; one that was asked for besides has those of the first."""
        if run not in self._steps:
            plan = self.plan
            same = plan.measurement == run[0]
            if not same.any():
                raise CmmUqError(f"the plan has no measurement {run[0]}", fix="Go on with one that it has")
            rows = np.flatnonzero(same & (plan.repeat == run[1]))
            if not rows.size:
                rows = np.flatnonzero(same & (plan.repeat == plan.repeat[same].min()))
            columns = {name: values for name, values in plan.columns.items() if name not in self.unmeasured}
            self._steps[run] = [
                PlannedPoint((run[0], int(plan.point[row]), run[1]), plan.xyz[row],
                             {name: float(values[row]) for name, values in columns.items()})
                for row in rows
            ]  # fmt: skip
        return self._steps[run]

    def missing(self, run: Run, story: Story) -> list[PlannedPoint]:
        return self._left(run, story.by_place)

    def next(self, story: Story, begin_with: Run | None = None) -> PlannedPoint | None:
        """The point that comes next, of a run, else of the one begun, else the first; ``None`` when all is measured."""
        runs, taken = self.all_runs(story), story.by_place
        last = next(reversed(story.points.values()), None)
        first = [begin_with, None if last is None else (last.place[0], last.place[2])]
        for run in (*(run for run in first if run in runs), *runs):
            if run is not None and (left := self._left(run, taken)):
                return left[0]
        return None

    def complete(self, story: Story) -> list[Run]:
        """Measurements and repeats of which every point is there."""
        taken = story.by_place
        begun = {(measurement, repeat) for measurement, _, repeat in taken}
        return [run for run in self.all_runs(story) if run in begun and not self._left(run, taken)]

    def more(self, run: Run, story: Story) -> Run:
        """The next repeat of a measurement that nobody has planned or asked for yet."""
        return run[0], 1 + max(repeat for measurement, repeat in (*self.runs, *story.asked) if measurement == run[0])

    def run_of(self, measurement: int, story: Story) -> Run:
        """The first measurement and repeat of a number that lacks a point."""
        runs = [run for run in self.all_runs(story) if run[0] == measurement]
        for run in runs:
            if self.missing(run, story):
                return run
        numbers = self.plan.measurement
        problem = f"measurement {measurement} is complete" if runs else f"the plan has no measurement {measurement}"
        fix = f"It has {numbers.min()} to {numbers.max()}; repeat asks for one more of the last"
        raise CmmUqError(problem, fix=fix)

    def places(
        self, story: Story, ahead: PlannedPoint | None, numbers: Sequence[Place | None]
    ) -> list[PlannedPoint] | Text:
        """Where a file's points belong, as far as the plan has room: by their numbers, else as it goes on; else why not."""
        runs, taken = self.all_runs(story), story.by_place
        start = runs.index(ahead.run) if ahead is not None else 0
        left = [step for run in (*runs[start:], *runs[:start]) for step in self._left(run, taken)]
        if None in numbers:
            return left[: len(numbers)]
        open_steps, steps = {step.place: step for step in left}, []
        for m, p, r in (place or (0, 0, 0) for place in numbers):
            if (m, p, r) not in open_steps:
                return say("measurement {m}, point {p}, repeat {r} is not open in the plan", m=m, p=p, r=r)
            steps.append(open_steps.pop((m, p, r)))
        return steps

    def at_distance(self, step: PlannedPoint, distance_mm: float, story: Story) -> list[tuple[PlannedPoint, Floats]]:
        """Where a point lies that is so far from the first of its set-up, and the first itself where that is not there yet."""
        steps = self.steps(step.run)
        first = steps[0]
        about = np.array([other.xyz for other in steps]) - first.xyz
        far = about[int(np.argmax(np.linalg.norm(about, axis=1)))]
        length = float(np.linalg.norm(far))
        beside = about - np.outer(about @ far, far) / (length**2 or 1.0)
        if length == 0 or float(np.linalg.norm(beside, axis=1).max()) > _ON_LINE * length:
            fix = "Type three coordinates: x y z"
            raise CmmUqError("the points of this set-up lie on no line, so a distance does not say where", fix=fix)
        begun = story.by_place.get(first.place)
        start = first.xyz if begun is None else np.array([begun.columns[f"{axis}_mm"] for axis in "xyz"])
        target = step if step.place != first.place else steps[1]
        along = target.xyz - first.xyz
        end = (target, start + distance_mm * along / np.linalg.norm(along))
        return [end] if begun is not None else [(first, start), end]

    def _left(self, run: Run, taken: Mapping[Place, Point]) -> list[PlannedPoint]:
        return [step for step in self.steps(run) if step.place not in taken]


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
            replace_file(self._beside, as_file(self._provenance(story, rows, hashes)))
            replace_file(self.path, content)
            self._last = digest

    def finish(self, story: Story, lead: Lead) -> None:
        """Write what stands beside the recording once more: gaps and notes since its last point."""
        self.write(story, lead)
        if self._last is not None and (rows := rows_of(story, lead)):
            replace_file(self._beside, as_file(self._provenance(story, rows, [self._last])))

    def _provenance(self, story: Story, rows: Sequence[Row], hashes: Sequence[str]) -> dict[str, Any]:
        return {
            "program": PROGRAM, "simulated": self._simulated, "recording_sha256": hashes,
            "sessions": [
                {"number": session.number, "begin_utc": _utc(session.start.utc_ns), "journal": f"{FOLDER}/{path.name}",
                 "sha256": sha256_of(path) or ""}
                for session in story.sessions
                for path in (self._folder / EVENTS.format(session.number),)
            ],
            "instruments": [
                {key: value for key, value in identity.items() if value is not None}
                | {"unasked": sum(n for (source, _), n in story.unasked.items() if source == name)}
                for name, identity in story.identities.items()
            ],
            "typed": sum(row.point.how.startswith(TYPED) for row in rows), "files": dict(story.files),
            "columns": _columns(rows),
            "gaps": [
                dict(zip(("instrument", "since_s", "lasted_s", "why"), gap, strict=True)) for gap in story.gaps
            ],
            "undone": [
                dict(zip(("measurement", "point", "repeat", "reason"), (*point.place, reason), strict=True))
                for point, reason in story.undone
            ],
            "clock_jumps_s": [by_s for _, by_s in story.clocks], "damaged": list(story.damaged),
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


MAKER = "simulated"
RATE_HZ = 10.0
NOISE_MM = 1e-3  # standard deviation of a coordinate

ERRORS = np.array([[30e-6, 20e-6, 0.0], [0.0, -20e-6, 15e-6], [0.0, 0.0, 10e-6]])
"""What the machine indicates too much: 30, −20, 10 ppm along x, y, z, and two axes that are not square by 20 and 15 µrad."""

TAKES_S = 0.7  # time to measure a point
_PLACED_MM = 5.0  # how far off the plan the artefact is set up
_USUAL = {"pressure_hpa": 1013.2, "humidity_pct": 45.0}


class SimulatedThermometer:
    """A stream: each quantity near a usual value, with a slow wave of a tenth and noise of a thousandth."""

    def __init__(
        self, name: str, quantities: Sequence[str], *, clock: Clock, seed: int, rate_hz: float = RATE_HZ
    ) -> None:
        self.name, self._quantities, self._clock, self._rate = name, tuple(quantities), clock, rate_hz
        self._random = np.random.default_rng([seed, *name.encode()])

    def identity(self) -> Identity:
        return Identity(self.name, MAKER, "thermometer", "0", "1", "none: simulated")

    def events(self, stop: threading.Event) -> Iterator[Event]:
        number, begin = 0, self._clock.monotonic_ns()
        while not stop.is_set():
            number += 1
            wait = number / self._rate - (self._clock.monotonic_ns() - begin) * 1e-9
            if wait > 0:
                self._clock.sleep(wait)
            wave = 0.1 * np.sin(2 * np.pi * number / self._rate / 1800)
            off = wave + 1e-3 * self._random.standard_normal(len(self._quantities))
            values = {name: round(_USUAL.get(name, 20.0) + float(e), 3)
                      for name, e in zip(self._quantities, off, strict=True)}  # fmt: skip
            raw = " ".join(f"{value:.3f}" for value in values.values()).encode() + b"\r\n"
            yield Reading(self.name, number, self._clock.utc_ns(), self._clock.monotonic_ns(), raw, values)

    def close(self) -> None: ...


class SimulatedMachine:
    def __init__(self, name: str, *, clock: Clock, seed: int, noise_mm: float = NOISE_MM) -> None:
        self.name, self._clock, self._seed, self._noise_mm = name, clock, seed, noise_mm
        self._asked: queue.Queue[PlannedPoint] = queue.Queue()
        self._number = 0

    def identity(self) -> Identity:
        return Identity(self.name, MAKER, "machine", "0", "1", "none: simulated")

    def measure(self, step: PlannedPoint) -> None:
        self._asked.put(step)

    def events(self, stop: threading.Event) -> Iterator[Event]:
        while not stop.is_set():
            with contextlib.suppress(queue.Empty):
                yield self._probed(self._asked.get(timeout=0.1))

    def close(self) -> None: ...

    def _probed(self, step: PlannedPoint) -> Reading:
        self._clock.sleep(TAKES_S)
        self._number += 1
        placed = _PLACED_MM * np.random.default_rng([self._seed, step.place[0]]).standard_normal(3)
        noise = self._noise_mm * np.random.default_rng([self._seed, *step.place]).standard_normal(3)
        xyz = step.xyz + placed
        indicated = np.round(xyz + ERRORS @ xyz + noise, 5)
        raw = "PtMeas(" + ", ".join(f"{a.upper()}({v:.5f})" for a, v in zip(AXES, indicated, strict=True)) + ")\r\n"
        values = dict(zip(COORDINATES, indicated.tolist(), strict=True))
        return Reading(self.name, self._number, self._clock.utc_ns(), self._clock.monotonic_ns(), raw.encode(), values,
                       point="PtMeas")  # fmt: skip


def simulated(
    declared: Sequence[DeclaredSource], *, clock: Clock, seed: int, noise_mm: float = NOISE_MM
) -> tuple[list[SimulatedThermometer | SimulatedMachine], SimulatedMachine]:
    """In place of what a job declares, and the machine among them; a thermometer and a machine where it declares nothing."""
    streams = {one.name: [name for name in one.values if name not in COORDINATES] for one in declared}
    name = "simulated-machine" if "machine" in streams else "machine"
    machine = SimulatedMachine(name, clock=clock, seed=seed, noise_mm=noise_mm)
    if not any(streams.values()):
        streams = {"thermometer": ["temp_artefact_c", "temp_air_c"]}
    thermometers = [SimulatedThermometer(name, columns, clock=clock, seed=seed)
                    for name, columns in streams.items() if columns]  # fmt: skip
    return [*thermometers, machine], machine
