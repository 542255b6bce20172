"""Reports of measuring programs in text: Calypso (ZEISS), DMIS (ISO 22093) and traces of I++ DME."""

from __future__ import annotations

import re
from abc import abstractmethod
from collections import Counter
from collections.abc import Iterator, Sequence
from itertools import islice

import numpy as np

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.files.csv_table import number_problem
from cmm_uq.base.files.limits import LINE, ROWS
from cmm_uq.base.messages import Text, Verbatim, number, say
from cmm_uq.base.values import dataclass, field, replace
from cmm_uq.jobs.importing.cells.encodings import head_text, report_lines
from cmm_uq.jobs.importing.format import Cell, Fact, Format, ImportKeys, NotReadError, Row, Sheet, sheets_of
from cmm_uq.jobs.importing.lengths.dmis_distances import distances_in

AXES = ("X", "Y", "Z")
WITH_DIRECTION = ["name", "x", "y", "z", "i", "j", "k"]
_COMPARED = 1_000_000  # distances
_FEWEST, _FORM = 5, 0.005  # points about a centre that is their result, and by what part of its radius they are off
_CALYPSO = ("idsymbol", "actual", "featureid")
_CALYPSO_AXES = {"xvalue": "X", "yvalue": "Y", "zvalue": "Z"}


class TextReport(Format):
    """A report in lines of text, known by what its head shows."""

    shows: Sequence[re.Pattern[str]]

    def recognises(self, head: bytes) -> bool:
        text = head_text(head)
        return all(pattern.search(text) for pattern in self.shows)

    def read(self, content: bytes, where: str, keys: ImportKeys) -> Sequence[Sheet]:
        lines, encoding = report_lines(content, where, keys.encoding)
        return self.sheets(lines, where, keys, Fact("encoding", say("Encoding"), Verbatim(encoding)))

    @abstractmethod
    def sheets(self, lines: Sequence[str], where: str, keys: ImportKeys, encoding: Fact) -> Sequence[Sheet]:
        """Sheets of its lines."""


def facts_of(encoding: Fact, key: str, label: Text, count: int) -> tuple[Fact, ...]:
    """The encoding, and how much of the report is not used."""
    return (encoding, Fact(key, label, number(count))) if count else (encoding,)


def without_results(sheets: list[Sheet]) -> list[Sheet]:
    """The sheet of points, where each place of all others is the centre of points that lie on one sphere or circle."""
    most, *others = sorted(sheets, key=lambda sheet: -len(sheet.rows))
    rows = [[row[1:4] for one in own for row in one.rows[1:]] for own in ([most], others)]
    figures = (str(cell) for own in rows for row in own for cell in row)
    if not others or len(rows[0]) * len(rows[1]) > _COMPARED or any(map(number_problem, figures)):
        return sheets
    xyz, centres = (np.array(own, dtype=np.float64) for own in rows)
    away = np.linalg.norm(xyz[:, None] - centres, axis=2)
    radii = [away[away.argmin(axis=1) == k, k] for k in range(len(centres))]
    if any(len(own) < _FEWEST or np.ptp(own) > _FORM * own.mean() for own in radii):
        return sheets
    told = [f"line {line}: centre of points" for one in others for line in one.lines[1:]]
    return [replace(most, left_out=(*most.left_out, *told))]


@dataclass
class ReportedPlace:
    """The place of a feature, as far as it was read."""

    feature: str
    line: int
    unit: str = ""
    dimension: str = ""
    sort: str = ""
    xyz: dict[str, str] = field(default_factory=dict)
    run: tuple[str, str] = ("", "")  # plan and number of the part, of a Calypso table

    @property
    def row(self) -> Row:
        return self.sort.lower(), [self.feature, *(self.xyz[axis] for axis in AXES)], self.line


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
            fix = "Name the file ending in _chr.txt, or say which columns hold x, y, z: columns"
            raise NotReadError("is a Calypso table whose columns are not known here (fet.txt?)", where=where, fix=fix)
        places, units, others = _characteristics(rows, where)
        if not places or len(places) > ROWS.most:
            raise NotReadError(f"holds {others} characteristics and no coordinate of a feature", where=where,
                             fix="Report the X, Y and Z value of every ball or point as characteristics")  # fmt: skip
        for place in places:
            if missing := [axis for axis in AXES if axis not in place.xyz]:
                raise CmmUqError(f"{place.feature!r} has no {missing[0]} value", where=f"{where} line {place.line}",
                                 fix="Report X, Y and Z of every feature; if it is the last one, it was cut off")  # fmt: skip
        if len(units) > 1:
            first, second = islice(units, 2)
            raise CmmUqError(f"coordinates are in {first} and in {second}: the file mixes units",
                             where=f"{where} line {units[second]}", fix="Export it in one unit")  # fmt: skip
        facts = facts_of(encoding, "characteristics_not_used", say("Characteristics that are no coordinate"), others)
        head, rows_of = WITH_DIRECTION[:4], [place.row for place in places]
        if len(runs := list(dict.fromkeys(place.run for place in places))) > 1:
            plans = {plan: [run for run in runs if run[0] == plan] for plan, _ in runs}
            numbers = {run: ([*plans].index(run[0]) + 1, plans[run[0]].index(run) + 1) for run in runs}
            kept = 0 if len(plans) > 1 else 1  # of one plan, names say what its measurements are
            head = [*("measurement", "repeat")[kept:], *head]
            rows_of = [
                (sort, [*(f"{n}" for n in numbers[place.run][kept:]), *cells], line)
                for place, (sort, cells, line) in zip(places, rows_of, strict=True)
            ]
        return sheets_of(rows_of, head, unit=next(iter(units), None), facts=facts)


def _characteristics(rows: Sequence[Sequence[str]], where: str) -> tuple[list[ReportedPlace], dict[str, int], int]:
    """Places of features, first line of each unit, and the number of characteristics that are no coordinate."""
    index = {name: i for i, name in enumerate(rows[0])}
    symbol, actual, feature = (index[name] for name in _CALYPSO)
    unit, others = index.get("unit", len(rows[0])), 0
    places: dict[tuple[str, ...], ReportedPlace] = {}
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
        run = (cells[0], cells[1])
        place = places.setdefault((*run, cells[feature]), ReportedPlace(cells[feature], line, run=run))
        if axis in place.xyz:
            raise CmmUqError(f"{axis} of {place.feature!r} is there twice", where=at,
                             fix="Export each run as a file of its own, or name the features of each run")  # fmt: skip
        place.xyz[axis] = cells[actual]
        if len(cells) > unit and cells[unit]:
            units.setdefault(cells[unit], line)
    return list(places.values()), units, others


_DMIS_PLACES = ("SPHERE", "POINT", "CIRCLE", "ARC", "ELLIPS")  # features whose first three numbers are their place
DMIS_UNITS = {"MM": "mm", "CM": "cm", "M": "m", "INCH": "inch", "FEET": "ft"}
DMIS_UNIT = re.compile(r"^UNITS\s*/\s*(\w+)", re.IGNORECASE)
ACTUAL = re.compile(r"^FA\s*\((?P<name>[^)]*)\)\s*=\s*FEAT\s*/\s*(?P<sort>\w+)\s*,(?P<rest>.*)$", re.IGNORECASE)
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
            if match := DMIS_UNIT.match(statement):
                unit = one_unit(unit, match[1], f"{where} line {line}")
            elif match := ACTUAL.match(statement):
                row = _feature(match, line, where)
                rows += [row] if row else []
                others += row is None
        encoded = facts_of(encoding, "features_not_used", say("Features that are no place"), others)
        if found := distances_in(statements(lines, where), unit, encoded, where):
            return found
        if not rows:
            counted = f"{others} actual features, none of them a sphere, point or circle"
            raise CmmUqError(f"holds {counted if others else 'no actual feature'} (FA)", where=where,
                             fix="Put the spheres or points out: OUTPUT/FA(…)")  # fmt: skip
        return without_results(sheets_of(rows, WITH_DIRECTION, unit=unit, decimal=".", facts=encoded))


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
        if begun.endswith("$") and (not begun.endswith("$$") or begun[:-2].rstrip().endswith(",")):
            begun = begun.rstrip("$").rstrip() + " "
            continue
        yield start, begun
        begun = ""
    if begun:
        yield start, begun


def one_unit(before: str | None, word: str, place: str) -> str:
    if word.upper() not in DMIS_UNITS:
        fix = f"DMIS has {', '.join(DMIS_UNITS)}"
        raise CmmUqError(f"UNITS/{word} is no unit of length of DMIS", where=place, fix=fix)
    unit = DMIS_UNITS[word.upper()]
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
        facts = facts_of(encoding, "answers_not_used", say("Answers that are no measured point"), others)
        rows = [_probed(*answer, where) for answer in answers]
        return sheets_of(rows, WITH_DIRECTION, unit="mm", decimal=".", facts=facts)


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
            if set(AXES) <= set(terms):
                answers.append((match["tag"], terms, line))
            else:
                others += 1
    return requests, answers, others


def _probed(tag: str, terms: dict[str, str], line: int, where: str) -> Row:
    direction = [part.strip() for part in terms.get("IJK", ",,").split(",")]
    if len(direction) != 3:
        problem = f"IJK({terms['IJK']}) is no direction"
        raise CmmUqError(problem, where=f"{where} line {line}", fix="Record the trace again")
    return "", [tag, *(terms[axis].strip() for axis in AXES), *direction], line


# as ``target= 50.0``, or an axis ahead of its figure
_PAIR = re.compile(
    r"(?<!\w)([^\W\d]\w*)\s{0,9}=\s{0,9}([^\s=|]{1,40})|(?<![\w.])([XYZ])\s{0,9}:?\s{0,9}([-+]?\d+[.,]\d+)(?![\w.])"
)
# as ``block 20  true 20,00003  errors +0,5 +0,2``
_WORDED = re.compile(r"([^\W\d][\w.]*)[:=]?\s+((?:[-+]?\d[\d.,]*(?:\s+|$))+)")
_LEAST, _PART = 6, 3  # lines of one form, at least, and of how many of all one must have it


def _named_figures(line: str) -> tuple[str, list[tuple[str, str]]]:
    """What stands ahead of the figures of a line, and each with its name; none of another line."""
    found = [*_PAIR.finditer(line)] if len(line) < LINE.most else []
    if len(found) > 1:
        return line[: found[0].start()].strip(" |;,\t"), [(m[1] or m[3], m[2] or m[4]) for m in found]
    worded = [(m[1], m[2].split(), m[0]) for m in _WORDED.finditer(line)] if len(line) < LINE.most else []
    if len(worded) < 2 or "".join(whole for *_, whole in worded) != line:
        return "", []
    each = ((word, own, k) for word, own, _ in worded for k in range(len(own)))
    return "", [(f"{word} {k + 1}" if len(own) > 1 else word, own[k]) for word, own, k in each]


def in_pairs(text: str) -> list[tuple[int, list[str]]] | None:
    """Cells of every line of a log that names its figures (``run=1 target= 50.0``), by line; ``None`` of another text.

    The names stand ahead of the first; what stands ahead of all pairs of a line is a cell too.
    """
    lines = [line.strip() for line in text.splitlines()]
    found = [*map(_named_figures, lines)]
    forms = Counter(tuple(name for name, _ in own) for _, own in found if own)
    form, count = max(forms.items(), key=lambda one: one[1], default=((), 0))
    if count < _LEAST or _PART * count < sum(map(bool, lines)):
        return None
    rows: list[tuple[int, list[str]]] = []
    for n, (line, (ahead, own)) in enumerate(zip(lines, found, strict=True), 1):
        same = tuple(name for name, _ in own) == form
        if same and not any(len(cells) > 1 for _, cells in rows):
            rows.append((n, ["", *form]))
        rows.append((n, [ahead, *(value for _, value in own)] if same else [line]))
    return rows
