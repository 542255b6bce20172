"""Text reports of PC-DMIS (Hexagon): the places of features, and every dimension with what was measured."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Sequence
from itertools import pairwise

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.messages import say
from cmm_uq.base.values import dataclass, replace
from cmm_uq.jobs.importing.factors import LINE, RUN, Label, codes, counted, hint, run_apart
from cmm_uq.jobs.importing.format import Fact, ImportKeys, NotReadError, Row, Sheet, sheets_of
from cmm_uq.jobs.importing.header import printed_words
from cmm_uq.jobs.importing.lengths.places import says_figures
from cmm_uq.jobs.importing.reports import AXES, WITH_DIRECTION, ReportedPlace, TextReport, facts_of

_WORDS = {name: "|".join(map(re.escape, words)) for name, words in printed_words("report").items()}
_HEADING = re.compile(
    rf"^[ \t]*(?:{_WORDS['axis']})[ \t]+(?=.*(?<!\S)(?:{_WORDS['measured']})(?!\S))", re.MULTILINE | re.IGNORECASE
)
_LOCATED = re.compile(rf"\s*(?P<what>[\w ]*?)\s*\b(?:{_WORDS['of']})\s+(?P<sort>\w+)\s+(?P<of>\S+)", re.IGNORECASE)
_UNITS = re.compile(rf"(?:{_WORDS['units']})\s*=\s*(\w+)", re.IGNORECASE)
_DIMENSION = re.compile(rf"^\s*(?:DIM\s|\S.*=\s.*(?:{_WORDS['units']})\s*=)", re.IGNORECASE)
_BELOW = {
    word: english
    for name, english in (("measured", "MEAS"), ("nominal", "NOMINAL"), ("deviation", "DEV"))
    for word in printed_words("report")[name]
}
_FIGURES = re.compile(r"^\s*(?P<axis>[A-Z][A-Z0-9]?)\s+(?:(?:RFS|MMC|LMC)\s+)?[-+\d.]", re.IGNORECASE)
_CONDITION = re.compile(r"^\s*[A-Z]+\s+(RFS|MMC|LMC)\s", re.IGNORECASE)
_NEARLY = 0.9  # of distances, whose names are of one form
_FEW = 10  # times as many lengths, beside which places are of something else
_NUMBER = re.compile(r"(?<!\S)(?:[-+]?\d*[.,]?\d+|[-+]?\d+[^\s\d.,]{1,3}\d+'\d+(?:[.,]\d+)?\")(?!\S)")


class PcDmis(TextReport):
    """The places of features, as ``LOCATION OF SPHERE SPH1`` with its lines X, Y and Z.

    The figures stand below the words of a heading line (``AX NOMINAL +TOL -TOL MEAS DEV OUTTOL``), flushed right; which are
    there and in which order is an option of the program, so each figure belongs to the word whose end is nearest to its own.
    """

    name = "pc-dmis"
    title = say("PC-DMIS text report")
    shows = (_HEADING, re.compile(rf"^[ \t]*DIM\s|(?:{_WORDS['units']})\s*=", re.MULTILINE | re.IGNORECASE))

    def sheets(self, lines: Sequence[str], where: str, keys: ImportKeys, encoding: Fact) -> Sequence[Sheet]:
        found = dimensions(lines, where)
        every = [
            ReportedPlace(of[1], one.line, one.unit, one.name, of[0],
                          {axis: one.measured(axis) for axis in AXES if axis in one.rows})
            for one in found if (of := one.location_of) is not None
        ]  # fmt: skip
        located = {place.sort.upper() for place in every if len(place.xyz) == len(AXES)}
        places = [place for place in every if place.xyz and place.sort.upper() in located]
        if odd := [place for place in places or every if 0 < len(place.xyz) < len(AXES)]:
            missing = next(axis for axis in AXES if axis not in odd[0].xyz)
            problem = f"{odd[0].dimension}, the place of {odd[0].feature}, has no {missing}"
            fix = "Report X, Y and Z of every feature; if it is the last one, the file was cut off"
            raise CmmUqError(problem, where=f"{where} line {odd[0].line}", fix=fix)
        if len({place.feature for place in places}) < len(places):  # one feature, measured again
            places = [replace(place, feature=place.dimension) for place in places]
        rows, headings = [place.row for place in places], WITH_DIRECTION[:4]
        if beside := _set_ups(lines, [place.line for place in places]):
            rows = [
                (sort, [*own, *cells], line) for (sort, cells, line), *own in zip(rows, *beside.values(), strict=True)
            ]
            headings = [*beside, *headings]
        if places and _FEW * len(places) < len(distances := _lengths(found)):  # of a qualified probe, beside lengths
            places, rows = [], distances
        if not places:
            rows, headings = _lengths(found), ["name", "nominal", "measured"]
        if not rows:
            problem = f"reports {len(found)} dimensions and no place of a feature by X, Y and Z"
            fix = "Report the location of every ball or point with its X, Y and Z"
            raise NotReadError(problem, where=where, fix=fix)
        if len(units := [*{place.unit.upper(): place for place in places}.values()]) > 1:
            problem = " and ".join(f"{one.dimension} {'is ' * (one is units[0])}in {one.unit}" for one in units[:2])
            raise CmmUqError(problem, where=f"{where} line {units[1].line}", fix="Report all dimensions in one unit")
        facts = facts_of(encoding, "dimensions_not_used", say("Dimensions that are no place"), len(found) - len(rows))
        unit = places[0].unit if places else found[0].unit or None
        if not places:  # comments may say where lines lie
            others = (one for one in enumerate(lines, 1) if not (_DIMENSION.match(one[1]) or _FIGURES.match(one[1])))
            rows += [("", [text.strip(), "", ""], line) for line, text in others if says_figures(text)]
            rows.sort(key=lambda row: row[2])
        sheets = sheets_of(rows, headings, unit=unit, facts=facts)
        return sheets if places else [replace(one, rows=[headings, *one.rows[1:]]) for one in sheets]


@dataclass(frozen=True)
class Dimension:
    """A dimension that a PC-DMIS report prints."""

    name: str
    text: str  # what it is of, after its name
    line: int
    rows: dict[str, tuple[str, dict[str, int], str]]  # by axis: line, ends of its heading's words, place in messages

    def measured(self, axis: str) -> str:
        """The figure below MEAS, which differs from that below NOMINAL by that below DEV where these are printed."""
        return _below(*self.rows[axis])["MEAS"]

    def at_material_condition(self, axis: str) -> bool:
        """Whether its tolerance grows with a size."""
        condition = _CONDITION.match(self.rows[axis][0])
        return condition is not None and condition[1].upper() != "RFS"

    @property
    def unit(self) -> str:
        found = _UNITS.search(self.text)
        return found[1] if found else ""

    @property
    def location_of(self) -> tuple[str, str] | None:
        """Sort and name of the feature whose location it is; ``None`` of another dimension."""
        of = _LOCATED.match(self.text)
        if of is None or not self.unit or of["what"].strip().upper() not in (*printed_words("report")["located"], ""):
            return None
        return of["sort"], of["of"]


def dimensions(lines: Sequence[str], where: str) -> list[Dimension]:
    """Dimensions of a PC-DMIS report; of each axis the last line."""
    found: list[Dimension] = []
    ends: dict[str, int] = {}
    for line, content in enumerate(lines, 1):
        if _HEADING.match(content):
            ends = _ends(content)
        elif _DIMENSION.match(content):
            name, _, text = content.partition("=")
            found.append(Dimension(re.sub(r"^DIM\s+", "", name.strip()), text, line, {}))
        elif found and (row := _FIGURES.match(content)):
            found[-1].rows[row["axis"].upper()] = content, ends, f"{where} line {line}"
    return found


def _set_ups(lines: Sequence[str], places: Sequence[int]) -> dict[str, list[str]]:
    """Measurement and repeat of places on these lines, where texts above them number both, as ``POSITION 1 - REPEAT 2``."""
    titles, last, read = list[str](), "", 0
    for line in places:
        numbered = [text for text in lines[read:line] if _numbers_line(text)]
        last, read = (numbered or [last])[-1], line
        titles.append(last)
    if len({*titles}) < 2 or "" in titles:
        return {}
    label = Label("", tuple(titles), "title")
    parts = {counted(one, lengths=True): one.values for one in run_apart(label, lengths=True)}
    if not parts.keys() >= {LINE, RUN}:
        return {}
    return {name: [f"{n + 1}" for n in codes(parts[of])] for name, of in (("measurement", LINE), ("repeat", RUN))}


def _numbers_line(text: str) -> bool:
    """Whether a text numbers a set-up and says no dimension."""
    words = re.findall(r"[^\W_]+", text)
    numbered = any(b.isdigit() and hint(a, lengths=True) == LINE for a, b in pairwise(words))
    return numbered and not (_DIMENSION.match(text) or _FIGURES.match(text))


def _lengths(found: Sequence[Dimension]) -> list[Row]:
    """Distances whose names number their line and their length, as ``LINE1_L2_RUN3``, with what is nominal and measured."""
    every = [one for one in found if "M" in one.rows]
    forms = Counter(re.sub(r"\d+", "0", one.name) for one in every)
    form, count = forms.most_common(1)[0] if forms else ("", 0)
    if count < max(2, _NEARLY * len(every)) or form.count("0") not in (2, 3):
        return []
    every = [one for one in every if re.sub(r"\d+", "0", one.name) == form]  # and no form of a sphere beside them
    below = [_below(*one.rows["M"]) for one in every]
    return [
        ("", [one.name, own.get("NOMINAL", ""), own["MEAS"]], one.line) for one, own in zip(every, below, strict=True)
    ]


def _ends(heading: str) -> dict[str, int]:
    """Where each word of a heading line ends."""
    return {_BELOW.get(word[0].upper(), word[0].upper()): word.end() for word in re.finditer(r"\S+", heading)}


def _below(content: str, ends: dict[str, int], place: str) -> dict[str, str]:
    """Figures by the word of the heading that they stand below."""
    problem, below = "", dict[str, str]()
    for figure in _NUMBER.finditer(content) if ends else ():
        below.setdefault(min(ends, key=lambda word: abs(ends[word] - figure.end())), figure[0])
    if not ends:
        problem = "figures stand ahead of any heading line AX … MEAS"
    elif "MEAS" not in below:
        problem = "no measured value stands below MEAS"
    elif {"NOMINAL", "DEV"} <= set(ends) and not _agree(below, toleranced=_CONDITION.match(content) is not None):
        problem = f"MEAS {below['MEAS']} is not NOMINAL and DEV together: the line is damaged"
    if problem:
        raise CmmUqError(problem, where=place, fix="Print the report again")
    return below


def _agree(below: dict[str, str], *, toleranced: bool) -> bool:
    """Whether the deviation is what it must be, to the last printed digits of the three; that of a position from 0."""
    below = {"NOMINAL": "0", **below} if toleranced else below
    if not {"NOMINAL", "DEV"} <= set(below):
        return False
    measured, nominal, deviation = (below[word] for word in ("MEAS", "NOMINAL", "DEV"))
    last = max(step_of(figure) for figure in (measured, nominal, deviation))
    return abs(figure_of(measured) - figure_of(nominal) - figure_of(deviation)) <= 1.6 * last


_SEXAGESIMAL = re.compile(r"([-+]?)(\d+)[^\d.,]{1,3}(\d+)'(\d+(?:[.,]\d+)?)\"")


def figure_of(text: str) -> float:
    """A printed figure; degrees of ``45°00'00"``."""
    if match := _SEXAGESIMAL.fullmatch(text):
        degrees, minutes, seconds = (float(part.replace(",", ".")) for part in match.groups()[1:])
        return (-1.0 if match[1] == "-" else 1.0) * (degrees + minutes / 60 + seconds / 3600)
    return float(text.replace(",", "."))


def step_of(text: str) -> float:
    """The step of its last digit."""
    if match := _SEXAGESIMAL.fullmatch(text):
        return step_of(match[4]) / 3600
    mantissa, _, power = text.lower().replace(",", ".").partition("e")
    return float(10.0 ** (int(power or 0) - len(mantissa.partition(".")[2])))
