"""Lengths and runs on lines, without coordinates: tests after ISO 10360-2 and B89, and laser interferometers along axes.

A length on a known line becomes two points a length apart, the first at the line's start, and is a measurement of its own: the
scatter of both ends stands at the second, so that it is right for their difference. Where lines and axes lie few files say: it
is asked for. Renishaw's form of runs (``.rtl``) is published nowhere; what is read of it is what three public programs that
read or write it agree on: sections in capitals with two colons; ``Targets :`` in mm, over several lines; below ``Run Target
Data:`` the numbers of run and target with the deviation in µm, actual less target.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cmm_uq.base.errors import CmmUqError, suggestion
from cmm_uq.base.files.csv_table import number_problem
from cmm_uq.base.messages import Verbatim, commas, say, semicolons
from cmm_uq.base.points import AXES, Floats
from cmm_uq.base.values import dataclass, field
from cmm_uq.jobs.columns import COORDINATES
from cmm_uq.jobs.importing import format as units
from cmm_uq.jobs.importing.format import LINE_PLACE, SAME_PLACE, UNITS, Fact, ImportKeys, Row, Sheet
from cmm_uq.jobs.importing.lengths.placing import DIAGONAL, place_of_axis
from cmm_uq.jobs.importing.reports import TextReport

REFERENCE = "reference_mm"
COLUMNS = ("line", "length_mm", "nominal_mm", "deviation_um", "deviation_mm", REFERENCE, "repeat")
"""Columns of a table of lengths, which a job may name."""


Stated = Mapping[str, tuple[str, str]]
"""Places of lines by name, as a file says them, with ? for what it leaves open, and its words."""


_SAME_TARGET = 0.5  # mm or °, by which targets of runs may differ where each was set anew
_SAME_LENGTH = 0.1  # mm, within which lengths of runs of their own are one length


@dataclass
class MeasuredLengths:
    """Lengths of a sheet, of each its line by name, reference, run, measured value, mm, and line of the file."""

    names: list[str]
    reference: list[float | None]
    repeat: list[int]
    measured: list[float]
    lines: list[int]
    beside: dict[str, list[float]]
    sources: dict[str, str]
    facts: tuple[Fact, ...]
    left_out: tuple[str, ...]
    places: Stated = field(default_factory=dict)
    words: Mapping[str, str] = field(default_factory=dict)  # that stand beside each line and no other


def placed(
    table: MeasuredLengths, keys: ImportKeys, where: str
) -> tuple[dict[str, NDArray[Any]], tuple[Fact, ...], list[int]]:
    """Columns of a recording, (2n,): both ends of every length, where the job says that its line lies; lines of the file."""
    wanted = list(dict.fromkeys(table.names))
    by_file = {name: own for name, own in table.places.items() if "?" not in own[0]}
    places = {**{name: place for name, (place, _) in by_file.items()}, **keys.lines}
    if lacking := [name for name in wanted if name not in places]:
        lie = f"lines {', '.join(map(repr, lacking))} lie" if len(lacking) > 1 else f"line {lacking[0]!r} lies"
        fix = f'Say it, with its start in mm: lines = {{ "{lacking[0]}" = "along X from 100,200,300" }}'
        raise CmmUqError(f"nothing says where {lie}, along which lengths were measured", where=where, fix=fix)
    if unknown := [name for name in keys.lines if name not in wanted]:
        raise CmmUqError(f"has no line {unknown[0]!r}", where=where, fix=suggestion(unknown[0], wanted))
    bare = [reference is None for reference in table.reference]
    if any(bare) and not all(bare):
        raise CmmUqError("a length has no nominal length, and others have one",
                         where=f"{where} line {table.lines[bare.index(True)]}",
                         fix="Give it for all, or read the sheets one by one: sheet")  # fmt: skip
    number: dict[tuple[str, float | None], int] = {}
    measurements = [number.setdefault(key, len(number) + 1) for key in _measured_again(table)]
    lines = [place_of(places[name]) for name in table.names]
    start, way = (np.array([line[k] for line in lines]) for k in (0, 1))
    xyz = np.stack([start, start + np.array(table.measured)[:, None] * way], axis=1).reshape(-1, 3)
    columns = {
        "measurement": np.repeat(measurements, 2), "point": np.tile([1, 2], len(lines)), "repeat": np.repeat(table.repeat, 2),
        **dict(zip(COORDINATES, xyz.T, strict=True)),
    }  # fmt: skip
    if not all(bare):
        columns[REFERENCE] = np.array([[0.0, reference] for reference in table.reference], dtype=np.float64).ravel()
    columns |= {name: np.repeat(values, 2) for name, values in table.beside.items()}
    facts = (_told(wanted, places, by_file), *_same_place(wanted, places))
    return columns, facts, [line for line in table.lines for _ in range(2)]


def _measured_again(table: MeasuredLengths) -> list[tuple[str, float | None]]:
    """Of each length its line and reference, of one that a laser measures anew in each run that of the shortest."""
    runs: dict[tuple[str, float], set[int]] = {}
    for name, reference, run in zip(table.names, table.reference, table.repeat, strict=True):
        if reference is not None:
            runs.setdefault((name, reference), set()).add(run)
    same: dict[tuple[str, float | None], tuple[str, float | None]] = {}
    first, taken = ("", -np.inf), set[int]()
    for key in sorted(runs):
        if key[0] != first[0] or key[1] - first[1] > _SAME_LENGTH or taken & runs[key]:
            first, taken = key, set()
        same[key], taken = first, taken | runs[key]
    return [same.get(key, key) for key in zip(table.names, table.reference, strict=True)]


def _told(names: Sequence[str], places: Mapping[str, str], by_file: Stated) -> Fact:
    """Where lines lie, of those that the file places with its words."""
    told = []
    for name in names:
        line, place = Verbatim(name), Verbatim(places[name])
        if by_file.get(name, ("",))[0] == place:
            words = Verbatim(by_file[name][1])
            told.append(say("{name}: {place}, as the file says: {words}", name=line, place=place, words=words))
        else:
            told.append(say("{name}: {place}", name=line, place=place))
    return Fact("lines", say("Lines"), semicolons(told))


def _same_place(names: Sequence[str], places: Mapping[str, str]) -> tuple[Fact, ...]:
    """Lines that begin at one place and go one way, so that whatever they differ by is no error of another place."""
    at: dict[tuple[float, ...], list[str]] = {}
    for name in names:
        at.setdefault(tuple(np.round(np.concatenate(place_of(places[name])), 6).tolist()), []).append(name)
    several = ((commas(map(Verbatim, own)), Verbatim(places[own[0]])) for own in at.values() if len(own) > 1)
    told = [say("{names} ({place})", names=those, place=place) for those, place in several]
    return (Fact(SAME_PLACE, say("Lines at the very same place"), semicolons(told)),) if told else ()


def place_of(text: str) -> tuple[Floats, Floats]:
    """Start (3,) and direction (3,) of a line."""
    parts = re.fullmatch(LINE_PLACE, text.strip())
    if parts is None:
        raise CmmUqError(f"{text!r} says no place", where="lines", fix='Write "along X from 100,200,300"')
    figures = [float(figure.replace("−", "-")) for figure in parts.groups()[2:] if figure]
    start = np.array(figures[:3])
    if parts[2]:
        direction = np.zeros(3)
        direction["xyz".index(parts[2].lower())] = 1.0 if parts[1] in ("", "+") else -1.0
    else:
        direction = np.array(figures[3:]) - start
        if not direction.any():
            raise CmmUqError(f"{text!r} begins where it ends", where="lines", fix="Say two places of the line")
        direction /= np.linalg.norm(direction)
    return start, direction


_SECTION, _KEY = (
    re.compile(r"([A-Z][A-Z -]{0,40})::(?:\s.*)?"),
    re.compile(r"([A-Za-z][\w -]{0,40}?)\s{0,9}:\s{0,9}(.{0,200})"),
)
LEAST_UM = 0.05  # that the deviations of an axis are, in µm, at least in one of its targets
_LINEAR, _TRIPLE = {"linear", "rtl", ""}, 3
_HEADS = (("run",), ("target", "point"), ("error", "deviation", "data"))  # of the columns of a run
_AGAIN, _SHOWN = "Export the runs anew", 40
HEADINGS = [
    "measurement", "point", "repeat", *(f"{a}_mm" for a in AXES), "reading_um", *(f"read_{a}" for a in AXES),
    *(f"approach_{a}" for a in AXES),
]  # fmt: skip


@dataclass
class AxisRun:
    """A run along an axis, or a round: sense (0 where nobody knows), number, targets, mm, with deviations, µm, and lines."""

    axis: str
    way: int
    number: int
    targets: list[tuple[float, float, int]]
    across: str = ""  # axis along which deviations lie, where that is another, as of straightness
    radius: float = 0.0  # mm, of a circle in the plane of two axes, whose targets are angles in °

    def at(self, target: float, start: Floats, direction: Floats) -> tuple[Floats, Floats, Floats]:
        """Place of a target (3,), direction in which its deviation lies, and signs of travel along the axes."""
        unit = dict(zip("XYZ", np.eye(3), strict=True))
        if not self.radius:
            read = unit[self.across] if self.across else direction
            return start + target * direction, read, self.way * np.sign(direction) + 0.0
        (u, v), (cos, sin) = (unit[axis] for axis in self.axis), (f(np.radians(target)) for f in (np.cos, np.sin))
        outward, along = cos * u + sin * v, cos * v - sin * u
        return start + self.radius * outward, outward, self.way * np.sign(np.round(along, 9)) + 0.0


class UnplacedRunsError(CmmUqError):
    """Runs were read whole, and nothing says where their axes lie: ``names`` of these, and the first reading in words."""

    names: Sequence[str] = ()
    example = ""


def placed_runs(
    runs: Sequence[AxisRun], keys: ImportKeys, where: str, facts: Sequence[Fact] = (), stated: Stated | None = None
) -> list[Sheet]:
    """Readings of runs as places along the lines that the file or the job gives; a run back has points of its own.

    stated : places of axes by the file, and its words.
    """
    rows: list[Row] = []
    axes, stated = [*dict.fromkeys(run.axis for run in runs)], stated or {}
    places = {**{axis: place for axis, (place, _) in stated.items()}, **keys.lines}
    for axis in axes:
        if axis not in places:
            example = axis_place(axis)[1]
            circle = bool(runs[0].radius)
            fix = f"Say it, with {'its centre' if circle else 'the place where its scale reads 0'}, in mm: "
            fix += f'lines = {{ "{axis}" = "{example}" }}'
            problem = f"nothing says where {'circle' if circle else 'line'} {axis!r} lies, along which was measured"
            error, (target, deviation, _) = UnplacedRunsError(problem, where=where, fix=fix), runs[0].targets[0]
            error.names = [one for one in axes if one not in places]
            unit = "°" if circle else " mm"
            error.example = f"axis {runs[0].axis}, run {runs[0].number}: {target:g}{unit}, {deviation:+.4g} µm"
            raise error
    for run in runs:
        start, direction = place_of(places[run.axis])
        there, own = (
            _targets([one for one in runs if (one.axis, one.way < 0) == (run.axis, back)])
            for back in (False, run.way < 0)
        )
        measurement, first = axes.index(run.axis) + 1, 0 if run.way >= 0 else len(there or own)
        for k, (target, deviation, line) in enumerate(run.targets):
            xyz, read, approach = run.at(target, start, direction)
            reading = (*xyz, deviation, *read, *approach)
            number = first + 1 + (k if len(run.targets) == len(own) else own.index(target))
            rows.append(("", [f"{cell:.10g}" for cell in (measurement, number, run.number, *reading)], line))
    return units.sheets_of(rows, HEADINGS, unit="mm", decimal=".", facts=(*facts, _told(axes, places, stated)))


def _targets(runs: Sequence[AxisRun]) -> list[float]:
    """Targets of runs of one sense in their turn, those too that one of them has and another leaves out."""
    each = [[target for target, *_ in run.targets] for run in runs]
    longest = max(each, key=len, default=[])
    sizes = {len(own) for own in each}
    if len(sizes) < 2 and (np.ptp(np.sort(each), axis=0) < _SAME_TARGET).all():
        return longest
    return sorted({target for own in each for target in own}, reverse=longest[0] > longest[-1])


class _Runs:
    """What a file says: facts by name in small letters, targets, mm, and of each run its targets and deviations in turn."""

    def __init__(self, lines: Sequence[str], where: str) -> None:
        self.facts: dict[str, str] = {}
        self.targets: list[float] = []
        self.runs: dict[int, list[tuple[int, float, int]]] = {}
        section = part = ""
        head, words = list[int](), list[str]()  # columns of runs, targets and deviations
        for number, line in enumerate(lines, 1):
            if not (text := line.strip()):
                continue
            if match := _SECTION.fullmatch(text):
                section, part = match[1], ""
            elif all(keys := [_KEY.fullmatch(one) for one in text.split(" ; ")]):
                for match in filter(None, keys):
                    part = match[1].lower()
                    self.facts.setdefault(part, match[2].strip())
            elif section in ("TARGET DATA", "TARGETDATA", "TARGETS") and part in ("targets", "target-count"):
                self.targets += self._figures(text, f"{where} line {number}")
            elif section == "DATA" and (words := text.lower().split())[0] == "run":
                head = [words.index(next(filter(own.__contains__, words), words[-1])) for own in _HEADS]
                part = "run target data"
            elif section in ("DEVIATIONS", "DATA", "RUN DATA", "TARGET DATA") and part.startswith("run target data"):
                cells = text.split()
                picked = [cells[k] for k in head if k < len(cells)] if head and len(cells) == len(words) else cells
                figures = self._figures(" ".join(picked), f"{where} line {number}")
                run, target, deviation = figures if len(figures) == _TRIPLE else (0.0, 0.0, 0.0)
                if run % 1 or target % 1 or not 1 <= target <= len(self.targets):
                    raise CmmUqError("is no run, target and deviation", where=f"{where} line {number}", fix=_AGAIN)
                self.runs.setdefault(int(run), []).append((int(target) - 1, deviation, number))
        self._check(where)

    def _check(self, where: str) -> None:
        kind = self.facts.get("owner", "")
        if (unit := self.facts.get("error-units")) and units.unit_named(unit) != UNITS["um"]:
            raise CmmUqError(f"has deviations in {unit!r}", where=where, fix="Export them in micrometres")
        names = ["owner", "filetype"] + ["file type"] * ("renishaw" in kind.lower())  # else its owner is its kind
        if not {self.facts.get(name, "").lower() for name in names} & _LINEAR:
            problem = f"holds a measurement of the kind {kind!r}, whose unit no public text says"
            raise CmmUqError(problem, where=where, fix="Export it as CSV, with reading_um or reading_arcsec")
        for name, count in (("target-count", len(self.targets)), ("run-count", len(self.runs))):
            if not count or self.facts.get(name, str(count)) != str(count):
                raise CmmUqError(f"has {count} of {self.facts.get(name, 'some')} ({name})", where=where, fix=_AGAIN)
        for run, rows in self.runs.items():
            if sorted(target for target, _, _ in rows) != list(range(len(self.targets))):
                raise CmmUqError(f"run {run} has not each target once", where=f"{where} line {rows[0][2]}", fix=_AGAIN)
        self._in_micrometres(where)

    def _in_micrometres(self, where: str) -> None:
        """Deviations finer than any machine's in µm are in the unit of the file; an error where it names none."""
        every = [abs(deviation) for rows in self.runs.values() for _, deviation, _ in rows]
        if max(every) >= LEAST_UM or not any(every):
            return
        if (unit := units.length_named(self.facts.get("units", ""))) is None:
            what = f"its deviations, {max(every):g} at most, are too small for µm, and nothing says their unit"
            raise CmmUqError(what, where=where, fix='Write it below the axis: "Units: mm"')
        by = unit.metres * 1e6
        self.runs = {n: [(k, deviation * by, line) for k, deviation, line in rows] for n, rows in self.runs.items()}

    @staticmethod
    def _figures(text: str, place: str) -> list[float]:
        figures = text.split()
        if any(number_problem(figure) for figure in figures):
            raise CmmUqError(f"{text[:_SHOWN]!r} holds no figures", where=place, fix=_AGAIN)
        return list(map(float, figures))


class Rtl(TextReport):
    name, title = "rtl", say("Laser interferometer (RTL)")
    shows = (
        re.compile(r"^\s{0,9}TARGET(?: ?DATA|S)::", re.M),
        re.compile(r"(?:^| ;)\s{0,9}Target-count\s{0,9}:", re.M | re.IGNORECASE),
    )

    def read(self, content: bytes, where: str, keys: ImportKeys) -> Sequence[Sheet]:
        sheets = super().read(content, where, keys)
        last = content.count(b"\n") + 1
        if not content.endswith((b"\n", b"\r", b"\0")) and any(last in sheet.lines for sheet in sheets):
            raise CmmUqError("ends within a figure: the file was cut off", where=f"{where} line {last}", fix=_AGAIN)
        return sheets

    def sheets(self, lines: Sequence[str], where: str, keys: ImportKeys, encoding: Fact) -> Sequence[Sheet]:
        found = _Runs(lines, where)
        axis, runs = found.facts.get("axis", "") or "1", list[AxisRun]()
        # the order of its targets says the sense of a run; none where all are listed in the same one
        senses = [int(np.sign(rows[-1][0] - rows[0][0])) for rows in found.runs.values()]
        for i, (sense, own) in enumerate(zip(senses, found.runs.values(), strict=True)):
            targets = [(found.targets[k], deviation, line) for k, deviation, line in own]
            way = sense if len(set(senses)) > 1 else 0
            runs.append(AxisRun(axis, way, senses[: i + 1].count(sense), targets))
        place = place_of_axis(
            axis, (f"{name}: {text}" for name, text in found.facts.items()), 1.0, ".", sorted(found.targets)
        )
        return placed_runs(runs, keys, where, (encoding,), {axis: place} if place else {})


def axis_place(name: str) -> tuple[str, str, str]:
    """Where an axis of runs lies, as far as its name says, and an example: it reads 0 where it lies at 0.

    Of a circle in a plane of two axes the radius at 0° lies along the first of them, from its centre.
    """
    if name in ("XY", "YZ", "ZX", "YX", "ZY", "XZ"):
        return "", f"along {name[0]} from 400,300,200", ""
    axis = name if name in [*"XYZ"] else ""
    known = ",".join("0" if one == axis else "?" for one in "XYZ")
    begins = ",".join("0" if one == (axis or "X") else str(100 * k) for k, one in enumerate("XYZ", 1))
    example = "from 100,200,300 to 500,600,700" if DIAGONAL.search(name) else f"along {axis or 'X'} from {begins}"
    return f"along {axis} from {known}" if axis else "", example, ""
