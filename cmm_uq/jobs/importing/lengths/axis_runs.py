"""Runs along axes and diagonals, as a reading has them: which line each is of, its sense, its number, and its unit."""

from __future__ import annotations

import re
from collections.abc import Sequence

import numpy as np

from cmm_uq.base.points import Floats, Ints
from cmm_uq.jobs.importing import factors, format as units
from cmm_uq.jobs.importing.cells.figures import unit_elsewhere
from cmm_uq.jobs.importing.factors import LINE, RUN, Label
from cmm_uq.jobs.importing.format import UNITS, NotReadError, Sheet, length_named
from cmm_uq.jobs.importing.lengths.deviation_sign import turned_by
from cmm_uq.jobs.importing.lengths.placing import DIAGONAL
from cmm_uq.jobs.importing.lines import LEAST_UM, AxisRun
from cmm_uq.jobs.importing.roles import SheetReading

_MILLIMETRES = 0.2  # deviations at targets that are all smaller may be in mm
_FINEST_UM = 0.002  # finer than machines are known in µm, where all are smaller than the least: in the unit of targets


def axis_runs(reading: SheetReading, sheets: Sequence[Sheet], where: str) -> list[AxisRun]:
    """Runs along axes, each with its targets in turn."""
    figures, labels = np.array(reading.figures), reading.every_label
    text = _other_error(reading, sheets)
    if text is not None and factors.says_of(text):
        fix = "Runs of positions and of straightness are read; state rotations as reading_arcsec (docs/reference/columns.md)"
        raise NotReadError(f"its deviations may be angles ({text!r})", where=where, fix=fix)
    stated = reading.unit or unit_elsewhere(sheets, small=False)
    unit = stated or UNITS["mm"]
    small = unit if reading.positions else reading.small or unit_elsewhere(sheets, small=True)
    small = small or length_named(sheets[0].unit or "")
    most, finest = np.abs(figures[:, 1]).max(), min(c.step for c in reading.taken["reading_um"])
    if small is None and finest < _FINEST_UM and most < LEAST_UM:
        small = stated
    if small is None and most < _MILLIMETRES:
        fix = "Write it above them: (µm) or (mm)"
        raise NotReadError("nothing says the unit of the deviations: µm or mm", where=where, fix=fix)
    target = units.converted(figures[:, 0], unit, "x_mm")
    of_head = (c.heading for c in reading.taken["reading_um"])
    turn = not (reading.positions or reading.checked) and turned_by(sheets, of_head, where, targets=True)
    deviation = units.converted(figures[:, 1], small or UNITS["um"], "reading_um") * (-1 if turn else 1)
    ways_to = [(find, label) for find in (axis_in, letter_in) for label in labels]
    named = [[find(value) or find(f"{label.words} {value}") for value in label.values] for find, label in ways_to]
    axes = next((own for own in named if all(own)), _lines_of(labels) or [_axis_of(sheets)] * len(target))
    ways = factors.senses(labels, target.tolist())
    split = ((one, *factors.run_apart(one, lengths=True), *factors.parts_of(one)) for one in labels)
    parts = [part for own in split for part in own]
    run = next((part for part in parts if factors.counted(part, lengths=True) == RUN and len({*part.values}) > 1), None)
    key = factors.codes([*zip(axes, ways or [0] * len(target), strict=True)])
    numbers = factors.in_turn(factors.together(key, factors.codes(target.tolist())))
    numbers = numbers if run is None else factors.numbered_runs(run.values)
    if ways is None:  # by the order of their targets; none where all are listed in one order
        ways, numbers = _by_order(key, target, numbers, where, numbered=run is not None)
    counts = [re.findall(r"\d+", value) for value in run.values] if run is not None else []
    if run is not None and {*map(len, counts)} == {1}:
        each = [*zip((one[0] for one in counts), ways, strict=True)]
        if len({*each}) == len({*run.values}):
            numbers = np.array([int(one) for one, _ in each])  # ``Run 1 +`` and ``Run 1 -`` are one, there and back
    runs: dict[tuple[str, int, int], AxisRun] = {}
    rows = zip(target.tolist(), deviation.tolist(), reading.lines, strict=True)
    for one, row in zip(zip(axes, ways, numbers.tolist(), strict=True), rows, strict=True):
        across = _across(one[0], text, reading, sheets, where) if text is not None and one not in runs else ""
        runs.setdefault(one, AxisRun(*one, [], across)).targets.append(row)
    if any(len({t for t, _, _ in run.targets}) < len(run.targets) for run in runs.values()):
        raise NotReadError("a run has a target twice", where=where, fix="Number the runs in a column")
    return list(runs.values())


def _by_order(key: Ints, target: Floats, numbers: Ints, where: str, *, numbered: bool) -> tuple[list[int], Ints]:
    """Sense of each target, by the order of those of its run, and number of the run, of its axis and sense if it has none."""
    each = factors.together(key, numbers)
    if not numbered and not all(_in_order(target[each == n]) for n in np.unique(each)):
        each = _passes(key, target, where)  # in turn of time, some of whose targets were left out
    ends = {n: (int(key[each == n][0]), *target[each == n][[0, -1]]) for n in np.unique(each).tolist()}
    turns = {n: (axis, int(np.sign(last - first))) for n, (axis, first, last) in ends.items()}
    both = len({way for _, way in turns.values()}) > 1
    of = {n: sum(turns[m] == turns[n] for m in turns if m <= n) for n in turns}
    return [turns[n][1] if both else 0 for n in each.tolist()], numbers if numbered else np.array([of[n] for n in each])


def _in_order(targets: Floats) -> bool:
    """Whether targets rise, or fall, from each to the next."""
    steps = np.diff(targets)
    return bool((steps > 0).all() or (steps < 0).all())


def _passes(key: Ints, target: Floats, where: str) -> Ints:
    """Number of the pass, from one end to the other, of each target in the order in which they were measured."""
    numbers, first = np.zeros(len(target), dtype=np.int64), 0
    for k in range(1, len(target)):
        anew = key[k] != key[k - 1] or not _in_order(target[first : k + 1])
        numbers[k], first = numbers[k - 1] + anew, k if anew else first
    if 2 * np.bincount(numbers).min() <= np.bincount(numbers).max():
        what = "its targets neither rise nor fall throughout a run"
        raise NotReadError(what, where=where, fix="Number the runs in a column: run")
    return numbers


def _lines_of(labels: Sequence[Label]) -> list[str]:
    """Names of lines that are no axes, as of diagonals; none where no label names them."""
    several = [
        one for one in labels if one.sort in ("title", "column", "sheet") and factors.ways_of(one.values) is None
    ]
    several = [one for one in several if len({*one.values}) > 1 + (one.sort == "column")]
    lines = (o for o in several if factors.counted(o, lengths=True) == LINE or all(map(DIAGONAL.search, o.values)))
    return [value.split(":")[0].strip() for value in next((one.values for one in lines), ())]


_AXES = "axis|achse|axe|asse|eje|eixo|osa|oś|axel|軸|轴|축"
_AXIS_NAME = re.compile(rf"(?:{_AXES})\W{{0,3}}([XYZ])\b|\b([XYZ])[- ]?(?:{_AXES})", re.IGNORECASE)


def _other_error(reading: SheetReading, sheets: Sequence[Sheet]) -> str | None:
    """A text that says that the deviations which are read are angles; of a whole file where nothing beside them denies it."""
    heads = [text for c in reading.taken["reading_um"] for text in c.path]
    told = any(factors.says_of(text) for text in reading.passed)  # of others
    labels = [one for one in reading.every_label if len({*one.values}) > 1 or not told]
    own = [text for label in labels for text in dict.fromkeys(label.values)]
    if reading.small is None and not reading.positions and not told:
        own += [text for sheet in sheets for row in sheet.rows for text in row if isinstance(text, str)]
    every = dict.fromkeys([*heads, *own])
    return next((text for text in every if factors.says_of(text) or factors.says_of(text, "straight")), None)


_ISO_NAME = re.compile(r"(?<![A-Za-z])E\s?_?([XYZ])_?([XYZ])(?![A-Za-z])")  # E_XY is along X where Y moves (ISO 230-1)


def _across(axis: str, said: str, reading: SheetReading, sheets: Sequence[Sheet], where: str) -> str:
    """The axis along which the straightness of another lies: by its symbol, its letter, or as vertical or horizontal."""
    first = min(reading.rows)
    rows = [" ".join(map(str, row)) for sheet in sheets for row in sheet.rows[:first]]
    of_head = [text for c in reading.taken["reading_um"] for text in c.path]
    told = [*of_head, *(value for label in reading.every_label for value in {*label.values}), *rows]
    sure = any(said in text for text in told) and not any(factors.says_of(text, "linear") for text in told)
    for text in told if sure else ():
        if (match := _ISO_NAME.search(text)) and match[1] != match[2] == axis:
            return str(match[1])
    known = ("vertical", "horizontal")
    about = [text for text in told if factors.says_of(text, "straight", *known)]
    letters = {letter for text in about for letter in re.findall(r"(?<![^\W_])[XYZ](?![^\W_])", text)} - {axis}
    if sure and len(letters) == 1 and len(axis) == 1:
        return str(letters.pop())
    ways = {way for way in known for text in about if factors.says_of(text, way)}
    if sure and len(ways) == 1 and axis in ("X", "Y") and not letters:
        return "Z" if ways == {"vertical"} else "Y" if axis == "X" else "X"
    what = f"its deviations are of straightness ({said!r}), and nothing says along which axis they lie"
    raise NotReadError(what, where=where, fix='Write it above the table, as "Straightness of Y, deviation along Z"')


def axis_in(text: str) -> str:
    found = _AXIS_NAME.search(text)
    return (found[1] or found[2]).upper() if found else ""


def letter_in(text: str) -> str:
    """The one letter of an axis that stands alone in a text."""
    found = {*re.findall(r"(?<![^\W_])[XYZ](?![^\W_])", text)}
    return found.pop() if len(found) == 1 else ""


def _axis_of(sheets: Sequence[Sheet]) -> str:
    """The axis that the first texts of a file name."""
    texts = (text for sheet in sheets for text in (sheet.name, *(" ".join(map(str, row)) for row in sheet.rows[:60])))
    return next(filter(None, map(axis_in, texts)), "1")
