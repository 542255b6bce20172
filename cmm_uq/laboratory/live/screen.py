"""The operator's screen as texts: what is typed and to be seen, the set-up drawn, and whether temperatures have settled.

A change in an hour, over the time that the job states, is within its limit with twice its standard uncertainty, by the
straight line through means of ten seconds.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence

import numpy as np

from cmm_uq.base.errors import CmmUqError, suggestion
from cmm_uq.base.files.csv_table import number_problem
from cmm_uq.base.files.table import LONGEST_MM
from cmm_uq.base.messages import Text, Verbatim, commas, number, say, signed
from cmm_uq.base.points import Floats, Machine
from cmm_uq.base.values import dataclass, field
from cmm_uq.laboratory.live.lead import Lead, PlannedPoint
from cmm_uq.laboratory.live.story import NS

WORDS = {
    "undo": "takes the last point back: undo REASON", "repeat": "measures the last set-up once more",
    "skip": "leaves the set-up out: skip REASON", "go": "goes on with a measurement: go 5",
    "note": "writes something down: note TEXT", "clear": "lets a machine go on after an error that you have looked at",
    "pause": "stops taking points: pause REASON", "resume": "goes on taking points", "help": "says all this",
    "quit": "ends; the same command goes on later",
}  # fmt: skip
"""What each does."""

WITH_TEXT = ("undo", "skip", "note")  # those that say nothing without a text


@dataclass(frozen=True)
class OperatorInput:
    word: str  # of :data:`WORDS`, ``take``, or ``point``
    text: str = ""
    numbers: tuple[float, ...] = ()  # three coordinates, or one distance, mm


def understood(line: str) -> OperatorInput:
    parts = line.replace(";", " ").split()
    if not parts:
        return OperatorInput("take")
    if parts[0][0] in "+-.0123456789":
        return OperatorInput("point", line.strip(), _numbers(parts))
    word = parts[0].lower()
    found = [name for name in WORDS if name == word] or [name for name in WORDS if name.startswith(word)]
    if len(found) != 1:
        raise CmmUqError(f"{parts[0]!r} is no word of this screen", fix=suggestion(word, WORDS))
    text = line.strip()[len(parts[0]) :].strip()
    if found[0] in WITH_TEXT and not text:
        raise CmmUqError(f"{found[0]} without a text", fix=f"It {WORDS[found[0]]}")
    return OperatorInput(found[0], text)


def _numbers(parts: list[str]) -> tuple[float, ...]:
    if len(parts) not in (1, 3):
        fix = "Type three coordinates x y z, or one distance from the first point, in mm"
        raise CmmUqError(f"{len(parts)} numbers", fix=fix)
    for part in parts:
        if problem := number_problem(part):
            raise CmmUqError(problem[0], fix=problem[1])
        if abs(float(part)) > LONGEST_MM:
            raise CmmUqError(f"{part} mm is more than anything that is measured", fix="Type mm")
    return tuple(map(float, parts))


@dataclass(frozen=True)
class SessionView:
    head: Text
    next: Text  # what comes next, with its coordinates
    picture: tuple[str, ...]  # of the set-up in the machine
    shown: tuple[Text, ...]  # live figures of the newest point and set-up
    again: Text  # why a repeat is asked for
    temperatures: tuple[Text, ...]
    instruments: tuple[Text, ...]  # each with how many readings came, and what ails it
    said: tuple[Text, ...]


def coming(step: PlannedPoint | None, lead: Lead) -> Text:
    if step is None:
        return say("all of the plan is measured")
    at = commas(signed(value, ".1f") for value in step.xyz)
    m, p, r = step.place
    where = say("measurement {m}", m=m)
    if (title := lead.titles.get(m)) is not None:
        where = say("{where}, {title}", where=where, title=title)
    return say("{where}, point {p}, repeat {r}, near {at} mm", where=where, p=p, r=r, at=at)


WIDTH, HEIGHT = 30, 9  # characters of each of the two views, without its frame
_VIEWS = ((0, 1, "from above: x right, y up"), (0, 2, "from the front: x right, z up"))
_MARKS = "123456789abcdefghijklmnopqrstuvwxyz*"  # of points by their number, the last of all further ones


def picture(machine: Machine, steps: Sequence[PlannedPoint], ahead: PlannedPoint | None) -> tuple[str, ...]:
    """Both views side by side, framed by the machine's travel or the points; next is an ``X``, others their numbers."""
    if not steps:
        return ()
    readings = np.array([step.xyz for step in steps]) + machine.origin_mm
    low, high = machine.travel_mm.T
    known = ~(np.isnan(low) | np.isnan(high))
    low, high = np.where(known, low, readings.min(axis=0) - 1.0), np.where(known, high, readings.max(axis=0) + 1.0)
    part = (readings - low) / np.where(high > low, high - low, 1.0)
    far = int(np.argmax(np.linalg.norm(readings - readings[0], axis=1)))
    line = part[0] + np.linspace(0, 1, 4 * WIDTH)[:, None] * (part[far] - part[0])
    marks = [_MARKS[min(step.place[1], len(_MARKS)) - 1] if step.place[1] > 0 else "*" for step in steps]
    if ahead is not None:
        marks = ["X" if step.place == ahead.place else mark for step, mark in zip(steps, marks, strict=True)]
    views = [_view(part[:, [across, up]], line[:, [across, up]], marks, title) for across, up, title in _VIEWS]
    return tuple(f"{left}  {right}" for left, right in zip(*views, strict=True))


def _view(points: Floats, line: Floats, marks: Sequence[str], title: str) -> list[str]:
    """Points and a line through them, (n, 2) parts of the frame across and up."""
    cells = [[" "] * WIDTH for _ in range(HEIGHT)]
    for across, up in line.tolist():
        row, column = round((1 - up) * (HEIGHT - 1)), round(across * (WIDTH - 1))
        if 0 <= row < HEIGHT and 0 <= column < WIDTH:
            cells[row][column] = "·"
    columns = np.clip(np.round(points[:, 0] * (WIDTH - 1)), 0, WIDTH - 1).astype(int)
    rows = np.clip(np.round((1 - points[:, 1]) * (HEIGHT - 1)), 0, HEIGHT - 1).astype(int)
    for i in sorted(range(len(marks)), key=lambda i: marks[i] == "X"):  # nothing hides what comes next
        cells[rows[i]][columns[i]] = marks[i]
    return [title.ljust(WIDTH + 2), f"┌{'─' * WIDTH}┐", *(f"│{''.join(row)}│" for row in cells), f"└{'─' * WIDTH}┘"]


_MEAN_S = 10.0
_FEWEST = 4
_HOUR = 3600.0
_WHOLE = 0.95  # part of the stated time that must have been seen


@dataclass
class Soak:
    """The temperatures of one column over the last while."""

    column: str
    limit_k_per_h: float | None  # largest change in an hour; ``None``: none is stated
    over_min: float  # time over which it is taken, min
    _means: deque[tuple[float, float]] = field(default_factory=deque)
    _sum: float = 0.0
    _count: int = 0
    _times: float = 0.0
    _begin_ns: int = 0
    _latest: float | None = None

    def add(self, monotonic_ns: int, value: float) -> None:
        time_s = monotonic_ns * NS
        if self._count and monotonic_ns - self._begin_ns >= _MEAN_S / NS:
            self._means.append((self._times / self._count, self._sum / self._count))
            self._sum, self._times, self._count = 0.0, 0.0, 0
            while self._means[0][0] < time_s - 60 * self.over_min:
                self._means.popleft()
        if not self._count:
            self._begin_ns = monotonic_ns
        self._sum, self._times, self._count = self._sum + value, self._times + time_s, self._count + 1
        self._latest = value

    @property
    def change(self) -> tuple[float, float] | None:
        """Change in an hour and its standard uncertainty, K/h; ``None`` before the stated time has been seen."""
        if len(self._means) < _FEWEST:
            return None
        times, values = np.array(self._means).T / np.array([[_HOUR], [1.0]])
        if (times[-1] - times[0]) * _HOUR + _MEAN_S < _WHOLE * 60 * self.over_min:
            return None
        about = times - times.mean()
        slope = float(about @ values / (about @ about))
        left = values - values.mean() - slope * about
        return slope, float(np.sqrt(left @ left / (len(values) - 2) / (about @ about)))

    @property
    def settled(self) -> bool | None:
        """Whether the criterion is kept; ``None`` where there is none, or it cannot be said yet."""
        if self.limit_k_per_h is None or (change := self.change) is None:
            return None
        return abs(change[0]) + 2 * change[1] <= self.limit_k_per_h

    @property
    def unsettled(self) -> bool:
        """Whether there is a criterion that it does not keep, or of which that cannot be said yet."""
        return self.limit_k_per_h is not None and self.settled is not True

    @property
    def words(self) -> Text:
        """Temperature, change and what is asked of it."""
        if self._latest is None:
            return say("{column}: nothing yet", column=Verbatim(self.column))
        now = say("{column} {value} °C", column=Verbatim(self.column), value=number(self._latest, ".3f"))
        change = self.change
        if change is None:
            seen = (len(self._means) * _MEAN_S) / 60
            return say("{now}, seen for {seen:.0f} of {over:g} min", now=now, seen=seen, over=self.over_min)
        told = say("{now}, {slope} K/h over {over:g} min", now=now, slope=signed(change[0], "+.2f"), over=self.over_min)
        if self.limit_k_per_h is None:
            return told
        within = say("{told}: within {limit:g} K/h", told=told, limit=self.limit_k_per_h)
        return within if self.settled else say("{told}: NOT within {limit:g} K/h", told=told, limit=self.limit_k_per_h)
