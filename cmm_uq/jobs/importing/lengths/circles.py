"""Circular tests by telescoping ballbar (ISO 230-4): radial deviations, or radii, by angle, of each sense and round."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable, Sequence

import numpy as np

from cmm_uq.base.points import Floats
from cmm_uq.jobs.importing import format as units
from cmm_uq.jobs.importing.blocks import Block, CutSheet
from cmm_uq.jobs.importing.cells.figures import figure, unit_elsewhere, unit_of
from cmm_uq.jobs.importing.coordinates import EitherError
from cmm_uq.jobs.importing.factors import RUN, counted, says_of as of_angle
from cmm_uq.jobs.importing.format import LENGTH, UNITS, NotReadError, Sheet, unit_named
from cmm_uq.jobs.importing.header import plain_words, unspaced, words_of
from cmm_uq.jobs.importing.lengths.deviation_sign import turned_by
from cmm_uq.jobs.importing.lengths.places import said_in
from cmm_uq.jobs.importing.lines import AxisRun
from cmm_uq.jobs.importing.roles import FigureColumn, SheetReading, columns_in

DEGREES = re.compile(r"°|度|\b(?:deg|gra[dus]|stop|stup)|각도", re.IGNORECASE)
_MOST_OF_A_TURN, _TURN = 300.0, 360.0
_ARC = re.compile(r"(-?\d+(?:\.\d+)?)\s*°?\s*(?:/|\.{2,3}|–|→|\b[^\W\d]{1,3}\b)\s*(-?\d+(?:\.\d+)?)")
_PLANE = re.compile(r"(?<![A-Za-z])(XY|YZ|ZX|XZ|YX|ZY|G17|G18|G19)(?![A-Za-z])")
_LARGEST_MM = 2000.0
_LEAST_MM = 5.0  # of a radius; deviations are smaller
_FIGURE = re.compile(r"([^\W\d][^\d;]{0,40}?(?:\([^)]{1,12}\))?)[\s:;=]{1,20}(\d[\d.,]*)\s*([^\W\d]*)")
_POINT = re.compile(r"^\d+\.(?:\d{1,2}|\d{4,})$")  # of decimals, whatever the figures of the table have
_NEARLY = 0.8  # of rows, the others of which are results
_FEWEST = 8  # angles of a circle


def circles_in(grid: CutSheet, blocks: Sequence[Block], rows: Sequence[int]) -> SheetReading | None:
    """Radial deviations by angle of rows below one head; ``None`` where no column goes round a circle."""
    columns = columns_in(grid, blocks, rows)
    round_ = (
        c for c in columns if DEGREES.search(c.heading) and np.nanmax(c.values) - np.nanmin(c.values) > _MOST_OF_A_TURN
    )
    angle = next((c for c in round_ if np.isfinite(c.values).mean() > _NEARLY), None)
    if angle is None or len(rows) < _FEWEST:
        return None
    beside = [c for c in columns if c is not angle and c.may_be_length and c.role != "summary" and not c.counts]
    flags = [c for c in columns if {*c.values[np.isfinite(c.values)].tolist()} == {0.0, 1.0}]
    beside = [c for c in beside if c not in flags and not any(map(of_angle, c.path))]
    source = [c for c in beside if sense_of(c.path)] or [
        c for c in beside if c.minute or c.role in ("deviation", "measured")
    ]
    source = source or beside
    if not source or (len(source) > 1 and len({c.heading for c in source}) < len(source)):
        return None
    texts = [grid.line(row) for row in range(len(grid.sheet.rows))]
    if not any(map(sense_of, (c.path for c in source))) and not any(says(t, "test") or sense_of([t]) for t in texts):
        return None  # as how round a ring is
    if len(source) > 1 and not all(sense_of(c.path) for c in source):
        what = f"{', '.join(repr(c.heading) for c in source[:3])} may be the radial deviations"
        raise EitherError(what, where=grid.at(rows[0]), fix="Say which way round each goes: CW, or CCW")
    reading = SheetReading("circles", small=next((c.unit for c in source if c.unit), None))
    reading.taken = {"target": [angle], "reading_um": source}
    reading.collect(grid, rows, columns)
    inside = _inside(angle.values, flags, texts, grid.at(rows[0]))
    beyond = [row for row, own in zip(rows, inside, strict=True) if own is False]
    reading.others = beyond
    if beyond:
        lines = [grid.sheet.lines[row] for row in beyond]
        reading.told = [f"lines {min(lines)} to {max(lines)}: {len(lines)} of angles ahead of the circle, or behind it"]
    for k, row in enumerate(rows):
        for c in source if inside[k] else ():
            if np.isfinite(c.values[k]):
                reading.add(row, k, c, source, (float(angle.values[k]), float(c.values[k])))
            else:
                reading.blank.append((row, c.i))
    return reading if reading.figures else None


def _inside(angles: Floats, flags: Sequence[FigureColumn], texts: Sequence[str], place: str) -> list[bool | None]:
    """Whether each is of the circle, by a column of 0 and 1 or by the arc that a text says; ``None`` without angle."""
    there = np.isfinite(angles) & np.isfinite(flags[0].values if len(flags) == 1 else angles)
    low, high = float(angles[there].min()), float(angles[there].max())
    arcs = [(float(m[1]), float(m[2])) for text in texts for m in _ARC.finditer(text.replace(",", "."))]
    arcs = [*{(a, b) for a, b in map(sorted, arcs) if low <= a and b <= high and _MOST_OF_A_TURN < b - a <= _TURN}]
    if len(flags) == 1:
        own = flags[0].values != (0 if not says(flags[0].heading, "overshoot") else 1)
    elif high - low <= _TURN:
        own = there
    elif len(arcs) == 1:
        own = (angles >= arcs[0][0]) & (angles <= arcs[0][1])
    else:
        what = f"its angles go from {low:g}° to {high:g}°, and nothing says which arc of them is the circle"
        raise EitherError(what, where=place, fix="Write it above: Start/end angle (deg): 0 / 360")
    return [bool(one) if known else None for one, known in zip(own.tolist(), there.tolist(), strict=True)]


def says(text: str, table: str) -> bool:
    """Whether a text has words of a table of circles."""
    return in_words(" ".join(plain_words(text)), "circles", table)


def in_words(plain: str, *tables: str) -> bool:
    """Whether words are among those of a table: of a script without blanks as parts."""
    known = words_of(tables[0])[tables[1]]
    return any(f" {one} " in f" {plain} " or (unspaced(one) and one in plain) for one in known)


def sense_of(texts: Iterable[str]) -> int:
    """+1 counter-clockwise, −1 clockwise, by words, those for the one taken out of those for the other; 0 of none or both."""
    found = set[int]()
    for text in texts:
        plain = f" {' '.join(plain_words(text))} "
        words = ((one, sense) for name, sense in (("ccw", 1), ("cw", -1)) for one in words_of("circles")[name])
        for one, sense in sorted(words, key=lambda word: (-len(word[0]), -word[1])):
            if (own := one if unspaced(one) else f" {one} ") in plain:
                found.add(sense)
                plain = plain.replace(own, "  ")
    return found.pop() if len(found) == 1 else 0


def circles_of(reading: SheetReading, sheets: Sequence[Sheet], grid: CutSheet, where: str) -> list[AxisRun]:
    """Each round with its angles and deviations in turn."""
    texts = [cell for sheet in sheets for row in sheet.rows for cell in row if isinstance(cell, str)]
    radius = _radius(grid, min(reading.rows), where)
    labels = [one for one in reading.every_label if one.sort != "column" or counted(one, lengths=True) == RUN
              or all(sense_of([value]) or _plane([value]) for value in {*one.values})]  # fmt: skip
    named = [tuple(label.values[k] for label in labels) for k in range(len(reading.figures))]
    series = {key: [k for k, own in enumerate(named) if own == key] for key in dict.fromkeys(named)}
    values, rounds = np.array(reading.figures), Counter[tuple[str, int]]()
    runs: list[AxisRun] = []
    for key, own in series.items():
        angles, figures = values[own].T
        if len({*angles.tolist()}) < len(angles) or len(angles) < _FEWEST:
            raise NotReadError(
                "a round has an angle twice, or few angles", where=where, fix="Number the rounds in a column"
            )
        plane = _plane(key) or _plane(texts)
        of_head = [text for text, label in zip(key, labels, strict=True) if label.sort in ("head", "column")]
        if plane in ("", "XZ", "YX", "ZY"):  # of which nobody knows where its angles begin, and which way they go
            what = f"nothing says the {'way of angles in the ' if plane else ''}plane of the circle"
            raise NotReadError(what, where=where, fix='Write it above, as its angles go: "Plane;XY", "YZ" or "ZX"')
        of_column = sense_of(c.heading for c in reading.taken["reading_um"]) * (len(reading.source) == 1)
        sense = sense_of(of_head) or sense_of(key) or of_column
        rising = int(np.sign(np.median(np.diff(angles))))
        if sense and sense != rising and len(reading.source) == 1:
            what = "angles of a clockwise round rise, or of the other fall, and may be counted the way that it goes"
            fix = "List the angles as the machine went, counted counter-clockwise, or both senses side by side"
            raise NotReadError(what, where=where, fix=fix)
        sense = sense or rising
        if absolute := float(np.median(figures)) > _LEAST_MM and np.ptp(figures) < _LEAST_MM:
            figures = figures - radius
        small = reading.small if reading.small or absolute else unit_elsewhere(sheets, small=True)
        if small is None and not absolute:
            raise NotReadError("nothing says the unit of the deviations: µm or mm", where=where,
                               fix="Write it above them: (µm) or (mm)")  # fmt: skip
        rounds[plane, sense] += 1
        turn = not absolute and turned_by(sheets, (c.heading for c in reading.taken["reading_um"]), where, targets=True)
        deviations = (units.converted(figures, small or UNITS["mm"], "reading_um") * (-1 if turn else 1)).tolist()
        lines = [reading.lines[k] for k in own]
        targets = [*zip(angles.tolist(), deviations, lines, strict=True)]
        runs.append(AxisRun(plane, sense, rounds[plane, sense], targets, radius=radius))
    return runs


def _plane(texts: Iterable[str]) -> str:
    codes = {"G17": "XY", "G18": "ZX", "G19": "YZ"}
    found = {codes.get(match[1], match[1]) for text in texts for match in _PLANE.finditer(text)}
    return found.pop() if len(found) == 1 else ""


def _radius(grid: CutSheet, first: int, where: str) -> float:
    """The nominal radius, mm, that the rows above say."""
    for row in range(first):
        for match in _FIGURE.finditer(" ; ".join(grid.text(row, k) for k in range(len(grid.sheet.rows[row])))):
            words = plain_words(match[1])
            own = figure(match[2], "." if _POINT.search(match[2]) else grid.sign)
            ahead = f" {' '.join(words)} "
            known = words_of("circles")["radius"]
            last = (words or ("",))[-1]  # as Teststraal, in which the word stands behind another
            said = any(f" {one} " in ahead or (len(one) > len("sade") and last.endswith(one)) for one in known)
            unit = unit_of([match[1]]) or unit_named(match[3]) or UNITS["mm"]
            size = own[0] * unit.metres * 1000 if said and own is not None and unit.sort == LENGTH else 0.0
            if _LEAST_MM <= size < _LARGEST_MM:
                return size
    raise NotReadError("nothing says the radius of the circle", where=where, fix='Write it above: "Radius (mm);150"')


def centre_of(grid: CutSheet, runs: Sequence[AxisRun]) -> dict[str, tuple[str, str]]:
    """Where the one circle of a file has its centre by its texts, and these."""
    planes = {run.axis for run in runs}
    for row, kind in enumerate(grid.kinds):
        said = said_in([grid.line(row)], grid.sign) if kind == "text" and len(planes) == 1 else None
        if said is not None and len(said.centre) == len("XYZ"):
            (plane,) = planes
            at = ",".join(f"{said.centre[axis]:.10g}" for axis in "XYZ")
            return {plane: (f"along {plane[0]} from {at}", grid.line(row))}
    return {}
