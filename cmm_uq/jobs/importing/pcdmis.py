"""Text reports of PC-DMIS (Hexagon): the places of features, as ``LOCATION OF SPHERE SPH1`` with its lines X, Y and Z.

The figures stand below the words of a heading line (``AX NOMINAL +TOL -TOL MEAS DEV OUTTOL``), flushed right; which are there
and in which order is an option of the program, so each figure belongs to the word whose end is nearest to its own.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.messages import Verbatim, number, say
from cmm_uq.jobs.importing.encodings import decoded, head_text, report_lines
from cmm_uq.jobs.importing.format import Format
from cmm_uq.jobs.importing.keys import ImportKeys
from cmm_uq.jobs.importing.sheet import Fact, Row, Sheet, sheets_of

_HEADING = re.compile(r"^[ \t]*AX[ \t]+(?=.*\bMEAS\b)", re.MULTILINE)
_LOCATED = re.compile(r"\s*(?P<what>[A-Z0-9 ]*?)\s*\bOF\s+(?P<sort>[A-Z]+)\s+(?P<of>\S+)", re.IGNORECASE)
_UNITS = re.compile(r"UNITS\s*=\s*(\w+)", re.IGNORECASE)
_DIMENSION = re.compile(r"^\s*(?:DIM\s|\S.*=\s.*UNITS\s*=)", re.IGNORECASE)
_FIGURES = re.compile(r"^\s*(?P<axis>[A-Z][A-Z0-9]?)\s+[-+\d.]", re.IGNORECASE)
_NUMBER = re.compile(r"(?<!\S)[-+]?\d*[.,]?\d+(?!\S)")
_WORD = re.compile(r"\S+")
AXES = ("X", "Y", "Z")
_PRINT_AGAIN = "Print the report again"


@dataclass
class _Place:
    """A feature's place, as far as it was read."""

    dimension: str
    sort: str
    feature: str
    unit: str
    line: int
    found: dict[str, str] = field(default_factory=dict)


class PcDmis(Format):
    """A report."""

    name = "pc-dmis"
    title = say("PC-DMIS text report")

    def recognises(self, head: bytes) -> bool:
        """See :meth:`Format.recognises`: by the heading of its figures, and the lines that name dimensions."""
        text = head_text(head)
        return (
            _HEADING.search(text) is not None and re.search(r"^[ \t]*DIM\s|UNITS\s*=", text, re.MULTILINE) is not None
        )

    def read(self, content: bytes, where: str, keys: ImportKeys) -> Sequence[Sheet]:
        text, encoding = decoded(content, where, keys.encoding)
        places, others = _places(text, where)
        located = {place.sort.upper() for place in places if len(place.found) == len(AXES)}
        whole = [place for place in places if place.found and place.sort.upper() in located]
        partly = [place for place in whole if len(place.found) < len(AXES)]
        if partly or not whole:
            raise _incomplete(partly or [place for place in places if place.found], others + len(places), where)
        units = {place.unit.upper(): place for place in whole}
        if len(units) > 1:
            first, second = list(units.values())[:2]
            raise CmmUqError(f"{first.dimension} is in {first.unit} and {second.dimension} in {second.unit}",
                             where=f"{where} line {second.line}", fix="Report all dimensions in one unit")  # fmt: skip
        facts = [Fact("encoding", say("Encoding"), Verbatim(encoding))]
        if skipped := others + len(places) - len(whole):
            facts.append(Fact("dimensions_not_used", say("Dimensions that are no place"), number(skipped)))
        rows: list[Row] = [
            (place.sort.lower(), [place.feature, *(place.found[axis] for axis in AXES)], place.line) for place in whole
        ]
        return sheets_of(rows, ["name", "x", "y", "z"], unit=whole[0].unit, facts=tuple(facts))


def _incomplete(partly: Sequence[_Place], dimensions: int, where: str) -> CmmUqError:
    if not partly:
        return CmmUqError(f"reports {dimensions} dimensions and no place of a feature by X, Y and Z", where=where,
                          fix="Report the location of every ball or point with its X, Y and Z")  # fmt: skip
    place = partly[0]
    missing = next(axis for axis in AXES if axis not in place.found)
    return CmmUqError(f"{place.dimension}, the place of {place.feature}, has no {missing}", where=f"{where} line {place.line}",
                      fix="Report X, Y and Z of every feature; if it is the last one, the file was cut off")  # fmt: skip


def _places(text: str, where: str) -> tuple[list[_Place], int]:
    """Locations of features, and the number of other dimensions."""
    places: list[_Place] = []
    others, ends = 0, {}
    current: _Place | None = None
    for line, content in enumerate(report_lines(text, where), 1):
        if _HEADING.match(content):
            ends = dict(_ends(content))
        elif _DIMENSION.match(content):
            current = _located(content, line)
            places += [current] if current else []
            others += current is None
        elif current is not None and (row := _FIGURES.match(content)) and row["axis"].upper() in AXES:
            current.found[row["axis"].upper()] = _measured(content, ends, f"{where} line {line}")
    return places, others


def _located(content: str, line: int) -> _Place | None:
    """The place that a line announces; ``None`` where it is another dimension."""
    name, _, rest = content.partition("=")
    found, unit = _LOCATED.match(rest), _UNITS.search(rest)
    if found is None or unit is None or found["what"].strip().upper() not in ("LOCATION", ""):
        return None
    return _Place(re.sub(r"^DIM\s+", "", name.strip()), found["sort"], found["of"], unit[1], line)


def _ends(content: str) -> Iterator[tuple[str, int]]:
    for word in _WORD.finditer(content):
        yield word[0].upper(), word.end()


def _measured(content: str, ends: dict[str, int], place: str) -> str:
    """The figure below MEAS, which differs from that below NOMINAL by that below DEV where these are printed."""
    below: dict[str, str] = {}
    for found in _NUMBER.finditer(content):
        below.setdefault(min(ends, key=lambda word: abs(ends[word] - found.end())), found[0])
    if "MEAS" not in below:
        raise CmmUqError("no measured value stands below MEAS", where=place, fix=_PRINT_AGAIN)
    if {"NOMINAL", "DEV"} <= set(ends) and not _agree(below):
        raise CmmUqError(f"MEAS {below['MEAS']} is not NOMINAL and DEV together: the line is damaged", where=place,
                         fix=_PRINT_AGAIN)  # fmt: skip
    return below["MEAS"]


def _agree(below: dict[str, str]) -> bool:
    """Whether the deviation is what it must be, to the last printed digits of the three."""
    if not {"NOMINAL", "DEV"} <= set(below):
        return False
    measured, nominal, deviation = (below[word].replace(",", ".") for word in ("MEAS", "NOMINAL", "DEV"))
    last = max(10.0 ** -len(figure.partition(".")[2]) for figure in (measured, nominal, deviation))
    return abs(float(measured) - float(nominal) - float(deviation)) <= 1.6 * last
