"""Reports of measuring programs in text: Calypso (ZEISS), PC-DMIS (Hexagon), DMIS (ISO 22093) and traces of I++ DME."""

from __future__ import annotations

import re
from abc import abstractmethod
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from itertools import islice

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.files.limits import LINE, ROWS
from cmm_uq.base.messages import Text, Verbatim, number, say
from cmm_uq.jobs.importing.encodings import decoded, head_text, report_lines
from cmm_uq.jobs.importing.format import Cell, Fact, Format, ImportKeys, Row, Sheet, sheets_of

_AXES = ("X", "Y", "Z")
_WITH_DIRECTION = ["name", "x", "y", "z", "i", "j", "k"]
_CALYPSO = ("idsymbol", "actual", "featureid")
_CALYPSO_AXES = {"xvalue": "X", "yvalue": "Y", "zvalue": "Z"}


class TextReport(Format):
    """A report in lines of text, known by what its head shows."""

    shows: Sequence[re.Pattern[str]]

    def recognises(self, head: bytes) -> bool:
        text = head_text(head)
        return all(pattern.search(text) for pattern in self.shows)

    def read(self, content: bytes, where: str, keys: ImportKeys) -> Sequence[Sheet]:
        text, encoding = decoded(content, where, keys.encoding)
        return self.sheets(
            report_lines(text, where), where, keys, Fact("encoding", say("Encoding"), Verbatim(encoding))
        )

    @abstractmethod
    def sheets(self, lines: Sequence[str], where: str, keys: ImportKeys, encoding: Fact) -> Sequence[Sheet]:
        """Sheets of its lines."""


def _facts(encoding: Fact, key: str, label: Text, count: int) -> tuple[Fact, ...]:
    """The encoding, and how much of the report is not used."""
    return (encoding, Fact(key, label, number(count))) if count else (encoding,)


@dataclass
class _Place:
    """The place of a feature, as far as it was read."""

    feature: str
    line: int
    unit: str = ""
    dimension: str = ""
    sort: str = ""
    xyz: dict[str, str] = field(default_factory=dict)

    @property
    def row(self) -> Row:
        return self.sort.lower(), [self.feature, *(self.xyz[axis] for axis in _AXES)], self.line


class Calypso(TextReport):
    """``…_chr.txt``, a characteristic a line; ``…_fet.txt``, a feature a line; ``…_hdr.txt``, the head.

    Of the characteristics those are taken whose ``idsymbol`` is the value of a coordinate (``xValue``, ``yValue``,
    ``zValue``): the ``actual`` of the three that have one ``featureid`` is a point.
    """

    name = "calypso"
    title = say("Calypso table of characteristics (chr.txt)")
    shows = (re.compile(r"\A\ufeff*[^\S\n]*planid\tpartnb", re.IGNORECASE),)

    def sheets(self, lines: Sequence[str], where: str, keys: ImportKeys, encoding: Fact) -> Sequence[Sheet]:
        rows = [[cell.strip() for cell in line.split("\t")] for line in lines]
        if keys.columns:
            filled = [i for i, row in enumerate(rows, 1) if any(row)]
            return [Sheet("", [rows[i - 1] for i in filled], filled, facts=(encoding,))]
        if not set(_CALYPSO) <= set(rows[0]):
            if len(rows) <= 3:
                raise CmmUqError("is the head of a Calypso table (hdr.txt), which has no measured value", where=where,
                                 fix="Name the file that ends in _chr.txt and was written with it")  # fmt: skip
            fix = "Name the file ending in _chr.txt, or columns = { x_mm = 9, y_mm = 10, z_mm = 11 }"
            raise CmmUqError("is a Calypso table whose columns are not known here (fet.txt?)", where=where, fix=fix)
        places, units, others = _characteristics(rows, where)
        if not places or len(places) > ROWS.most:
            raise CmmUqError(f"holds {others} characteristics and no coordinate of a feature", where=where,
                             fix="Report the X, Y and Z value of every ball or point as characteristics")  # fmt: skip
        for place in places:
            if missing := [axis for axis in _AXES if axis not in place.xyz]:
                raise CmmUqError(f"{place.feature!r} has no {missing[0]} value", where=f"{where} line {place.line}",
                                 fix="Report X, Y and Z of every feature; if it is the last one, it was cut off")  # fmt: skip
        if len(units) > 1:
            first, second = islice(units, 2)
            raise CmmUqError(f"coordinates are in {first} and in {second}: the file mixes units",
                             where=f"{where} line {units[second]}", fix="Export it in one unit")  # fmt: skip
        facts = _facts(encoding, "characteristics_not_used", say("Characteristics that are no coordinate"), others)
        rows_of = [place.row for place in places]
        return sheets_of(rows_of, _WITH_DIRECTION[:4], unit=next(iter(units), None), facts=facts)


def _characteristics(rows: Sequence[Sequence[str]], where: str) -> tuple[list[_Place], dict[str, int], int]:
    """Places of features, first line of each unit, and the number of characteristics that are no coordinate."""
    index = {name: i for i, name in enumerate(rows[0])}
    symbol, actual, feature = (index[name] for name in _CALYPSO)
    unit, others = index.get("unit", len(rows[0])), 0
    places: dict[str, _Place] = {}
    units: dict[str, int] = {}
    for line, cells in enumerate(rows[1:], 2):
        if not any(cells) or cells[0].casefold() == "end":
            continue
        at = f"{where} line {line}"
        if len(cells) <= max(symbol, actual, feature):
            raise CmmUqError(f"the row ends after {len(cells)} of {len(rows[0])} cells", where=at,
                             fix="Export it again: the file was cut off or changed")  # fmt: skip
        axis = _CALYPSO_AXES.get(cells[symbol].casefold())
        if axis is None:
            others += 1
            continue
        place = places.setdefault(cells[feature], _Place(cells[feature], line))
        if axis in place.xyz:
            raise CmmUqError(f"{axis} of {place.feature!r} is there twice", where=at,
                             fix="Export each run as a file of its own, or name the features of each run")  # fmt: skip
        place.xyz[axis] = cells[actual]
        if len(cells) > unit and cells[unit]:
            units.setdefault(cells[unit], line)
    return list(places.values()), units, others


_HEADING = re.compile(r"^[ \t]*AX[ \t]+(?=.*\bMEAS\b)", re.MULTILINE)
_LOCATED = re.compile(r"\s*(?P<what>[A-Z0-9 ]*?)\s*\bOF\s+(?P<sort>[A-Z]+)\s+(?P<of>\S+)", re.IGNORECASE)
_UNITS = re.compile(r"UNITS\s*=\s*(\w+)", re.IGNORECASE)
_DIMENSION = re.compile(r"^\s*(?:DIM\s|\S.*=\s.*UNITS\s*=)", re.IGNORECASE)
_FIGURES = re.compile(r"^\s*(?P<axis>[A-Z][A-Z0-9]?)\s+[-+\d.]", re.IGNORECASE)
_NUMBER = re.compile(r"(?<!\S)[-+]?\d*[.,]?\d+(?!\S)")


class PcDmis(TextReport):
    """The places of features, as ``LOCATION OF SPHERE SPH1`` with its lines X, Y and Z.

    The figures stand below the words of a heading line (``AX NOMINAL +TOL -TOL MEAS DEV OUTTOL``), flushed right; which are
    there and in which order is an option of the program, so each figure belongs to the word whose end is nearest to its own.
    """

    name = "pc-dmis"
    title = say("PC-DMIS text report")
    shows = (_HEADING, re.compile(r"^[ \t]*DIM\s|UNITS\s*=", re.MULTILINE))

    def sheets(self, lines: Sequence[str], where: str, keys: ImportKeys, encoding: Fact) -> Sequence[Sheet]:
        every, others = _places(lines, where)
        located = {place.sort.upper() for place in every if len(place.xyz) == len(_AXES)}
        places = [place for place in every if place.xyz and place.sort.upper() in located]
        odd = [place for place in places or every if 0 < len(place.xyz) < len(_AXES)]
        if odd:
            missing = next(axis for axis in _AXES if axis not in odd[0].xyz)
            problem = f"{odd[0].dimension}, the place of {odd[0].feature}, has no {missing}"
            fix = "Report X, Y and Z of every feature; if it is the last one, the file was cut off"
            raise CmmUqError(problem, where=f"{where} line {odd[0].line}", fix=fix)
        if not places:
            problem = f"reports {others + len(every)} dimensions and no place of a feature by X, Y and Z"
            raise CmmUqError(problem, where=where, fix="Report the location of every ball or point with its X, Y and Z")
        units = {place.unit.upper(): place for place in places}
        if len(units) > 1:
            first, second = islice(units.values(), 2)
            raise CmmUqError(f"{first.dimension} is in {first.unit} and {second.dimension} in {second.unit}",
                             where=f"{where} line {second.line}", fix="Report all dimensions in one unit")  # fmt: skip
        unused = others + len(every) - len(places)
        facts = _facts(encoding, "dimensions_not_used", say("Dimensions that are no place"), unused)
        return sheets_of([place.row for place in places], _WITH_DIRECTION[:4], unit=places[0].unit, facts=facts)


def _places(lines: Sequence[str], where: str) -> tuple[list[_Place], int]:
    """Locations of features, and the number of other dimensions."""
    places: list[_Place] = []
    others, ends = 0, dict[str, int]()
    current: _Place | None = None
    for line, content in enumerate(lines, 1):
        if _HEADING.match(content):
            ends = {word[0].upper(): word.end() for word in re.finditer(r"\S+", content)}
        elif _DIMENSION.match(content):
            current = _located(content, line)
            places += [current] if current else []
            others += current is None
        elif current is not None and (row := _FIGURES.match(content)) and row["axis"].upper() in _AXES:
            current.xyz[row["axis"].upper()] = _measured(content, ends, f"{where} line {line}")
    return places, others


def _located(content: str, line: int) -> _Place | None:
    """The place that a line announces; ``None`` where it is another dimension."""
    name, _, rest = content.partition("=")
    of, unit = _LOCATED.match(rest), _UNITS.search(rest)
    if of is None or unit is None or of["what"].strip().upper() not in ("LOCATION", ""):
        return None
    return _Place(of["of"], line, unit[1], re.sub(r"^DIM\s+", "", name.strip()), of["sort"])


def _measured(content: str, ends: dict[str, int], place: str) -> str:
    """The figure below MEAS, which differs from that below NOMINAL by that below DEV where these are printed."""
    if not ends:
        raise CmmUqError("figures stand ahead of any heading line AX … MEAS", where=place, fix="Print the report again")
    below: dict[str, str] = {}
    for figure in _NUMBER.finditer(content):
        below.setdefault(min(ends, key=lambda word: abs(ends[word] - figure.end())), figure[0])
    if "MEAS" not in below:
        raise CmmUqError("no measured value stands below MEAS", where=place, fix="Print the report again")
    if {"NOMINAL", "DEV"} <= set(ends) and not _agree(below):
        raise CmmUqError(f"MEAS {below['MEAS']} is not NOMINAL and DEV together: the line is damaged", where=place,
                         fix="Print the report again")  # fmt: skip
    return below["MEAS"]


def _agree(below: dict[str, str]) -> bool:
    """Whether the deviation is what it must be, to the last printed digits of the three."""
    if not {"NOMINAL", "DEV"} <= set(below):
        return False
    measured, nominal, deviation = (below[word].replace(",", ".") for word in ("MEAS", "NOMINAL", "DEV"))
    last = max(10.0 ** -len(figure.partition(".")[2]) for figure in (measured, nominal, deviation))
    return abs(float(measured) - float(nominal) - float(deviation)) <= 1.6 * last


_DMIS_PLACES = ("SPHERE", "POINT", "CIRCLE", "ARC", "ELLIPS")  # features whose first three numbers are their place
_DMIS_UNITS = {"MM": "mm", "CM": "cm", "M": "m", "INCH": "inch", "FEET": "ft"}
_UNIT = re.compile(r"^UNITS\s*/\s*(\w+)", re.IGNORECASE)
_ACTUAL = re.compile(r"^FA\s*\((?P<name>[^)]*)\)\s*=\s*FEAT\s*/\s*(?P<sort>\w+)\s*,(?P<rest>.*)$", re.IGNORECASE)
_DMIS = re.compile(
    r"^[ \t]*(?:FA\s*\([^)]*\)\s*=\s*FEAT\s*/|OUTPUT\s*/\s*FA|DMISMN\s*/|DMISMD\s*/|FILNAM\s*/)",
    re.IGNORECASE | re.MULTILINE,
)


class Dmis(TextReport):
    """Output of DMIS programs (ANSI/CAM-I 105.0): the actual features, ``FA(SPH1)=FEAT/SPHERE,OUTER,CART,x,y,z,d``."""

    name = "dmis"
    title = say("DMIS output (ISO 22093)")
    shows = (_DMIS,)

    def sheets(self, lines: Sequence[str], where: str, keys: ImportKeys, encoding: Fact) -> Sequence[Sheet]:
        unit, rows, others = None, [], 0
        for line, statement in statements(lines, where):
            if match := _UNIT.match(statement):
                unit = _one_unit(unit, match[1], f"{where} line {line}")
            elif match := _ACTUAL.match(statement):
                row = _feature(match, line, where)
                rows += [row] if row else []
                others += row is None
        if not rows:
            counted = f"{others} actual features, none of them a sphere, point or circle"
            raise CmmUqError(f"holds {counted if others else 'no actual feature'} (FA)", where=where,
                             fix="Put the spheres or points out: OUTPUT/FA(…)")  # fmt: skip
        facts = _facts(encoding, "features_not_used", say("Features that are no place"), others)
        return sheets_of(rows, _WITH_DIRECTION, unit=unit, decimal=".", facts=facts)


def statements(lines: Sequence[str], where: str) -> Iterator[tuple[int, str]]:
    """Statements without comments, those over several lines joined, with the line that each begins on."""
    begun, start = "", 0
    for line, content in enumerate(lines, 1):
        part = content.strip()
        if part.startswith("$$"):
            continue
        start = start if begun else line
        begun += part
        if len(begun) > LINE.most:
            raise CmmUqError(f"the statement goes on for more than {LINE.most} characters", where=f"{where} line {start}",
                             fix="Export it again: a line may not end in $ where its statement does")  # fmt: skip
        if begun.endswith("$"):
            begun = begun[:-1].rstrip() + " "
            continue
        yield start, begun
        begun = ""
    if begun:
        yield start, begun


def _one_unit(before: str | None, word: str, place: str) -> str:
    if word.upper() not in _DMIS_UNITS:
        fix = f"DMIS has {', '.join(_DMIS_UNITS)}"
        raise CmmUqError(f"UNITS/{word} is no unit of length of DMIS", where=place, fix=fix)
    unit = _DMIS_UNITS[word.upper()]
    if before not in (None, unit):
        raise CmmUqError(f"the unit changes from {before} to {unit}: the file mixes units", where=place,
                         fix="Put all features out in one unit")  # fmt: skip
    return unit


def _feature(match: re.Match[str], line: int, where: str) -> Row | None:
    """Name and place of an actual feature; ``None`` of one that is no place."""
    sort, place = match["sort"].upper(), f"{where} line {line}, FA({match['name']})"
    if sort not in _DMIS_PLACES:
        return None
    words = [word.strip() for word in match["rest"].split(",")]
    if any(word.upper() in ("POL", "CYL", "SPH") for word in words):
        raise CmmUqError("is given in polar coordinates", where=place, fix="Put it out with CART")
    numbers: list[Cell] = [word for word in words if not word[:1].isalpha()]
    if len(numbers) < 3 or "" in numbers:
        raise CmmUqError(f"has {len([cell for cell in numbers if cell])} of the three coordinates of its place", where=place,
                         fix="Export it again: the line is damaged or the file was cut off")  # fmt: skip
    direction = numbers[3:6] if sort == "POINT" and len(numbers) >= 6 else ["", "", ""]
    return sort.lower(), [match["name"], *numbers[:3], *direction], line


_LINE = re.compile(r"(?:^|[\s>\]:])(?P<tag>[E\d]\d{4})\s+(?P<what>[#&%!]|[A-Za-z]\w*\s*\()\s*(?P<rest>.*)$")
_TERM = re.compile(r"\b(X|Y|Z|IJK)\s*\(([^)]*)\)")
_IPP = re.compile(r"(?:\b\d{5}[ \t]+(?:StartSession[ \t]*\(|PtMeas[ \t]*\(|[&%#])(?s:.*?)){2}")
_Answer = tuple[str, dict[str, str], int]  # tag, terms, line


class Ipp(TextReport):
    """I++ DME 1.4 to 1.7: the answers to ``PtMeas``, as ``00169 # X(12.5), Y(0), Z(-3), IJK(0, 0, 1)``, in mm.

    An answer to ``Get`` looks like one to ``PtMeas``, so a trace without the requests is read only where all its answers
    report the same quantities.
    """

    name = "ipp"
    title = say("I++ DME trace")
    shows = (_IPP,)

    def sheets(self, lines: Sequence[str], where: str, keys: ImportKeys, encoding: Fact) -> Sequence[Sheet]:
        requests, answers, others = _dialogue(lines)
        if not answers:
            scans = sum(name.startswith(("ScanOn", "ScanIn", "ScanUnknown")) for _, name in requests)
            unread = f", and {scans} scans, which are not read" if scans else ""
            raise CmmUqError(f"reports no measured point{unread}", where=where,
                             fix="Record the answers of the server (lines with #) with the requests")  # fmt: skip
        measured = {tag for tag, name in dict(requests).items() if name == "PtMeas"}
        if requests:
            others += sum(tag not in measured for tag, *_ in answers)
            answers = [answer for answer in answers if answer[0] in measured]
        elif len({frozenset(terms) for _, terms, _ in answers}) > 1:
            raise CmmUqError("answers report different quantities, and no request tells which are measured points",
                             where=f"{where} line {answers[0][2]}", fix="Record the requests (PtMeas) too")  # fmt: skip
        if unanswered := sorted(measured - {tag for tag, *_ in answers}):
            problem = f"PtMeas {unanswered[0]} has no answer: the trace was cut off, or the probing failed"
            raise CmmUqError(problem, where=where, fix="Record the trace to its end, and measure the point again")
        facts = _facts(encoding, "answers_not_used", say("Answers that are no measured point"), others)
        rows = [_probed(*answer, where) for answer in answers]
        return sheets_of(rows, _WITH_DIRECTION, unit="mm", decimal=".", facts=facts)


def _dialogue(lines: Sequence[str]) -> tuple[list[tuple[str, str]], list[_Answer], int]:
    """Tags and names of requests, answers with a place, number of other answers."""
    requests, answers, others = [], [], 0
    for line, content in enumerate(lines, 1):
        match = _LINE.search(content)
        if match is None or match["tag"].startswith("E"):
            continue
        if match["what"] not in "#&%!":
            requests.append((match["tag"], match["what"].rstrip("( ")))
        elif match["what"] == "#":
            terms = dict(_TERM.findall(match["rest"]))
            if set(_AXES) <= set(terms):
                answers.append((match["tag"], terms, line))
            else:
                others += 1
    return requests, answers, others


def _probed(tag: str, terms: dict[str, str], line: int, where: str) -> Row:
    direction = [part.strip() for part in terms.get("IJK", ",,").split(",")]
    if len(direction) != 3:
        problem = f"IJK({terms['IJK']}) is no direction"
        raise CmmUqError(problem, where=f"{where} line {line}", fix="Record the trace again")
    return "", [tag, *(terms[axis].strip() for axis in _AXES), *direction], line
