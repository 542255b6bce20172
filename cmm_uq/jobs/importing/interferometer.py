"""Runs of a laser interferometer in Renishaw's form (``.rtl``): targets, and the deviation of each run at each target.

The form is published nowhere. What is read here is what three public programs that read or write it agree on: sections in
capitals with two colons; ``Targets :`` in mm, over several lines; below ``Run Target Data:`` the numbers of run and target
with the deviation in µm, actual less target. Where the axis lies no file says: it is asked for.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.files.csv_table import number_problem
from cmm_uq.base.messages import Verbatim, say, semicolons
from cmm_uq.base.points import AXES, Floats, Ints
from cmm_uq.jobs.importing import format as units
from cmm_uq.jobs.importing.blocks import unit_elsewhere
from cmm_uq.jobs.importing.factors import (
    RUN,
    Label,
    codes,
    counted,
    in_turn,
    numbered_runs,
    parts_of,
    together,
    ways_of,
)
from cmm_uq.jobs.importing.format import UNITS, Fact, ImportKeys, NotReadError, Row, Sheet, length_named, sheets_of
from cmm_uq.jobs.importing.header import plain_words, unspaced, words_of
from cmm_uq.jobs.importing.lengths import place_of
from cmm_uq.jobs.importing.reports import TextReport
from cmm_uq.jobs.importing.roles import SheetReading

_SECTION, _KEY = re.compile(r"([A-Z][A-Z -]{0,40})::"), re.compile(r"([A-Za-z][\w -]{0,40}?)\s{0,9}:\s{0,9}(.{0,200})")
_LINEAR, _TRIPLE = {"linear", ""}, 3
_AGAIN, _SHOWN = "Export the runs anew", 40
HEADINGS = [
    "measurement", "point", "repeat", *(f"{a}_mm" for a in AXES), "reading_um", *(f"read_{a}" for a in AXES),
    *(f"approach_{a}" for a in AXES),
]  # fmt: skip


@dataclass
class AxisRun:
    """A run along an axis: its sense (0 where nobody knows), its number, and targets in mm with deviations in µm and lines."""

    axis: str
    way: int
    number: int
    targets: list[tuple[float, float, int]]


def placed_runs(runs: Sequence[AxisRun], keys: ImportKeys, where: str, facts: Sequence[Fact] = ()) -> list[Sheet]:
    """Readings of runs as places along the lines that the job gives for their axes; a run back has points of its own."""
    rows: list[Row] = []
    axes = [*dict.fromkeys(run.axis for run in runs)]
    for axis in axes:
        if axis not in keys.lines:
            fix = f'Say it, with the place where its scale reads 0, in mm: lines = {{ "{axis}" = "along X from 0,200,300" }}'
            raise CmmUqError(f"nothing says where line {axis!r} lies, along which was measured", where=where, fix=fix)
    for run in runs:
        start, direction = place_of(keys.lines[run.axis])
        first = 0 if run.way >= 0 else len(run.targets)
        for k, (target, deviation, line) in enumerate(run.targets, 1):
            place = start + target * direction
            cells = [
                axes.index(run.axis) + 1,
                first + k,
                run.number,
                *place,
                deviation,
                *direction,
                *(run.way * np.sign(direction) + 0.0),
            ]
            rows.append(("", [f"{cell:.10g}" for cell in cells], line))
    told = Fact("lines", say("Lines"), semicolons([Verbatim(f"{axis}: {keys.lines[axis]}") for axis in axes]))
    return sheets_of(rows, HEADINGS, unit="mm", decimal=".", facts=(*facts, told))


class _Runs:
    """What a file says: facts by name in small letters, targets, mm, and of each run its targets and deviations in turn."""

    def __init__(self, lines: Sequence[str], where: str) -> None:
        self.facts: dict[str, str] = {}
        self.targets: list[float] = []
        self.runs: dict[int, list[tuple[int, float, int]]] = {}
        section = part = ""
        for number, line in enumerate(lines, 1):
            if not (text := line.strip()):
                continue
            if match := _SECTION.fullmatch(text):
                section, part = match[1], ""
            elif match := _KEY.fullmatch(text):
                part = match[1].lower()
                self.facts.setdefault(part, match[2].strip())
            elif section == "TARGET DATA" and part == "targets":
                self.targets += self._figures(text, f"{where} line {number}")
            elif section == "DEVIATIONS" and part.startswith("run target data"):
                figures = self._figures(text, f"{where} line {number}")
                if (
                    len(figures) != _TRIPLE
                    or figures[0] % 1
                    or not 1 <= figures[1] <= len(self.targets)
                    or figures[1] % 1
                ):
                    raise CmmUqError("is no run, target and deviation", where=f"{where} line {number}", fix=_AGAIN)
                self.runs.setdefault(int(figures[0]), []).append((int(figures[1]) - 1, figures[2], number))
        self._check(where)

    def _check(self, where: str) -> None:
        kind = self.facts.get("owner", "")
        if not {kind.lower(), self.facts.get("filetype", "").lower()} & _LINEAR:
            problem = f"holds a measurement of the kind {kind!r}, whose unit no public text says"
            raise CmmUqError(problem, where=where, fix="Export it as CSV, with reading_um or reading_arcsec")
        for name, count in (("target-count", len(self.targets)), ("run-count", len(self.runs))):
            if not count or self.facts.get(name, str(count)) != str(count):
                raise CmmUqError(f"has {count} of {self.facts.get(name, 'some')} ({name})", where=where, fix=_AGAIN)
        for run, rows in self.runs.items():
            if sorted(target for target, _, _ in rows) != list(range(len(self.targets))):
                raise CmmUqError(f"run {run} has not each target once", where=f"{where} line {rows[0][2]}", fix=_AGAIN)

    @staticmethod
    def _figures(text: str, place: str) -> list[float]:
        figures = text.split()
        if any(number_problem(figure) for figure in figures):
            raise CmmUqError(f"{text[:_SHOWN]!r} holds no figures", where=place, fix=_AGAIN)
        return list(map(float, figures))

    def ways(self) -> Iterator[tuple[int, float]]:
        """Number and sense of each run: by the order of its targets; none where all are listed in the same one."""
        senses = [float(np.sign(rows[-1][0] - rows[0][0])) for rows in self.runs.values()]
        both = len(set(senses)) > 1
        for i, sense in enumerate(senses):
            yield senses[: i + 1].count(sense), sense if both else 0.0


class Rtl(TextReport):
    name, title = "rtl", say("Laser interferometer (RTL)")
    shows = (re.compile(r"^\s{0,9}TARGET DATA::", re.M), re.compile(r"^\s{0,9}Target-count\s{0,9}:", re.M))

    def read(self, content: bytes, where: str, keys: ImportKeys) -> Sequence[Sheet]:
        sheets = super().read(content, where, keys)
        last = content.count(b"\n") + 1
        if not content.endswith((b"\n", b"\r", b"\0")) and any(last in sheet.lines for sheet in sheets):
            raise CmmUqError("ends within a figure: the file was cut off", where=f"{where} line {last}", fix=_AGAIN)
        return sheets

    def sheets(self, lines: Sequence[str], where: str, keys: ImportKeys, encoding: Fact) -> Sequence[Sheet]:
        found = _Runs(lines, where)
        axis = found.facts.get("axis", "") or "1"
        runs = [AxisRun(axis, int(way), number, [(found.targets[k], deviation, line) for k, deviation, line in own])
                for own, (number, way) in zip(found.runs.values(), found.ways(), strict=True)]  # fmt: skip
        return placed_runs(runs, keys, where, (encoding,))


_MILLIMETRES = 0.2  # deviations at targets that are all smaller may be in mm


def axis_runs(reading: SheetReading, labels: Sequence[Label], sheets: Sequence[Sheet], where: str) -> list[AxisRun]:
    """Runs along axes, each with its targets in turn."""
    figures = np.array(reading.figures)
    if (angle := _angle_in(sheets)) is not None:
        fix = "Runs of positions are read; state rotations as reading_arcsec (docs/reference/columns.md)"
        raise NotReadError(f"its deviations may be angles ({angle!r})", where=where, fix=fix)
    unit = reading.unit or unit_elsewhere(sheets, small=False) or UNITS["mm"]
    small = unit if reading.positions else reading.small or unit_elsewhere(sheets, small=True)
    small = small or length_named(sheets[0].unit or "")
    if small is None and np.abs(figures[:, 1]).max() < _MILLIMETRES:
        fix = "Write it above them: (µm) or (mm)"
        raise NotReadError("nothing says the unit of the deviations: µm or mm", where=where, fix=fix)
    small = small or UNITS["um"]
    target = units.converted(figures[:, 0], unit, "x_mm")
    deviation = units.converted(figures[:, 1], small, "reading_um")
    texts = ([f"{label.words} {value}" for value in label.values] for label in labels)
    named = ([axis_in(text) for text in own] for own in texts)
    axes = next((own for own in named if all(own)), [_axis_of(sheets)] * len(target))
    ways = next((found for label in labels if (found := ways_of(label.values)) is not None), None)
    parts = [part for label in labels for part in (label, *parts_of(label))]
    run = next((part for part in parts if counted(part, lengths=True) == RUN and len({*part.values}) > 1), None)
    key = codes([*zip(axes, ways or [0] * len(target), strict=True)])
    numbers = numbered_runs(run.values) if run is not None else in_turn(together(key, codes(target.tolist())))
    if ways is None:
        ways = _by_order(target, numbers)
    runs: dict[tuple[str, int, int], AxisRun] = {}
    for k, one in enumerate(zip(axes, ways, numbers.tolist(), strict=True)):
        runs.setdefault(one, AxisRun(*one, [])).targets.append(
            (float(target[k]), float(deviation[k]), reading.lines[k])
        )
    if any(len({t for t, _, _ in one.targets}) < len(one.targets) for one in runs.values()):
        raise NotReadError("a run has a target twice", where=where, fix="Number the runs in a column")
    return list(runs.values())


_AXES = "axis|achse|axe|asse|eje|eixo|osa|oś|axel|軸|轴|축"
_AXIS_NAME = re.compile(rf"(?:{_AXES})\W{{0,3}}([XYZ])\b|\b([XYZ])[- ]?(?:{_AXES})", re.IGNORECASE)


def _angle_in(sheets: Sequence[Sheet]) -> str | None:
    """A text that says that deviations are angles."""
    known = {f" {word} " for words in words_of("angles").values() for word in words}
    for text in (cell for sheet in sheets for row in sheet.rows for cell in row if isinstance(cell, str) and cell):
        plain = f" {' '.join(plain_words(text))} "
        if any(word in plain or (unspaced(word.strip()) and word.strip() in plain) for word in known):
            return text
    return None


def axis_in(text: str) -> str:
    found = _AXIS_NAME.search(text)
    return (found[1] or found[2]).upper() if found else ""


def _axis_of(sheets: Sequence[Sheet]) -> str:
    """The axis that the first texts of a file name."""
    texts = (text for sheet in sheets for text in (sheet.name, *(" ".join(map(str, row)) for row in sheet.rows[:60])))
    return next(filter(None, map(axis_in, texts)), "1")


def _by_order(target: Floats, numbers: Ints) -> list[int]:
    """Senses of runs by the order of their targets; 0 where all are listed in one order."""
    senses = {n: int(np.sign(target[numbers == n][-1] - target[numbers == n][0])) for n in np.unique(numbers).tolist()}
    return [senses[n] if len({*senses.values()}) > 1 else 0 for n in numbers.tolist()]
