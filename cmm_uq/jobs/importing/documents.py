"""Documents: QIF (ANSI/DMSC QIF 2 and 3.0, ISO 23952), digital calibration certificates (DCC 3, PTB), web pages, JSON, XML.

Of QIF measured spheres, points and circles are read, or the measured points themselves; of a certificate the quantities of a
result, a column each, by the names that it gives; of a web page its tables; of any other JSON or XML its records, a row each.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from html.parser import HTMLParser
from itertools import groupby
from typing import TYPE_CHECKING, Any
from xml.etree.ElementTree import Element

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.files.limits import COLUMNS, ROWS
from cmm_uq.base.messages import Verbatim, say
from cmm_uq.base.units import UNITS as PRINTED
from cmm_uq.jobs.importing import format as formats
from cmm_uq.jobs.importing.cells.encodings import begins_with, decoded, head_text, local, root_of
from cmm_uq.jobs.importing.format import DCC, LENGTHS, UNITS, Cell, Fact, Format, ImportKeys, Row, Sheet, sheets_of
from cmm_uq.jobs.importing.lengths.qif_lengths import lengths_of_qif
from cmm_uq.jobs.importing.reports import WITH_DIRECTION, facts_of, without_results

if TYPE_CHECKING:
    from cmm_uq.jobs.dcc.figures import QuantityFigures

_MEASUREMENT = ("FeatureMeasurement", "FeatureActual")  # as QIF 3 and as QIF 2 call them
PLACED = tuple(f"{sort}{one}" for sort in ("Sphere", "Point", "Circle") for one in _MEASUREMENT)
_DEEPEST = 40  # records within records
_HIDDEN = ("script", "style")  # of a web page, as those within a text
_WITHIN = ("a", "b", "br", "em", "i", "small", "span", "strong", "sub", "sup")
_EXPORT = "Export the table as CSV or .xlsx"


class Qif(Format):
    name = "qif"
    title = say("QIF results")

    def recognises(self, head: bytes) -> bool:
        return begins_with(head, "QIFDocument")

    def read(self, content: bytes, where: str, keys: ImportKeys) -> Sequence[Sheet]:
        root = root_of(content, where)
        items = [element for element in root.iter() if local(element).endswith("FeatureItem")]
        named = {item.get("id", ""): child(item, "FeatureName") for item in items}
        rows: list[Row] = []
        beside: list[dict[str, str]] = []  # what the results of each row say of themselves, as which placement
        others, own = 0, dict[str, str]()
        for element in root.iter():
            if local(element) == "MeasurementResults":
                own = {one.get("name", ""): one.get("value", "") for one in element.iterfind("{*}Attributes/*")}
            elif local(element) in PLACED:
                rows.append(_feature(element, named, where))
            elif local(element) == "MeasuredPointSet":
                rows += _points(element, where)
            else:
                others += local(element).endswith(_MEASUREMENT)
            beside += [own] * (len(rows) - len(beside))
        if not rows and (found := lengths_of_qif(root)):
            return sheets_of(found, ["run", "name", "nominal", "measured"], unit=length_unit(root, where), decimal=".")
        if not rows:
            problem = f"holds no measured sphere, point or circle, and {others} other features"
            fix = "Export the results with the measured features and their locations"
            raise CmmUqError(problem, where=where, fix=fix)
        facts = facts_of(Fact("version", say("Version of QIF"), Verbatim(root.get("versionQIF", ""))),
                         "features_not_used", say("Features that are no place"), others)  # fmt: skip
        further = [*dict.fromkeys(name for one in beside for name in one)]
        of_all = zip(rows, beside, strict=True)
        rows = [(sort, [*cells, *(one.get(k, "") for k in further)], line) for (sort, cells, line), one in of_all]
        heads = [*WITH_DIRECTION, *further]
        return without_results(sheets_of(rows, heads, unit=length_unit(root, where), decimal=".", facts=facts))


def length_unit(root: Element, where: str) -> str | None:
    """Name of the unit of length in ``FileUnits``, whose name must fit the factor beside it; ``None`` where there is none."""
    primary = root.find(".//{*}PrimaryUnits")
    length = None if primary is None else primary.find("{*}LinearUnit")
    if length is None:
        return None
    name, factor = child(length, "UnitName"), length.findtext(".//{*}Factor")
    metres, unit = float(factor or "1"), formats.length_named(name)
    if unit is None:
        unit = next((one for one in map(UNITS.get, LENGTHS) if one and abs(one.metres / metres - 1) < 1e-9), None)
    if unit is None or abs(unit.metres / metres - 1) > 1e-6:
        unknown = f"of {factor} m is not known"
        problem = unknown if factor else "has no Factor to metres (UnitConversion), and is then the metre"
        what = f"the unit {name!r} {problem}"
        raise CmmUqError(what, where=f"{where}: FileUnits", fix="Export the results in mm or inch")
    return unit.name


def _feature(element: Element, named: dict[str, str], where: str) -> Row:
    sort, number_ = local(element).partition("Feature")[0].lower(), element.get("id", "")
    place = f"{where}: {local(element)} id {number_}"
    xyz = three(child(element, "Location"), place)
    label = named.get(child(element, "FeatureItemId"), "") or number_
    normal = child(element, "Normal") if sort == "point" else ""
    direction = three(normal, place) if normal else ["", "", ""]
    return sort, [label, *xyz, *direction], int(number_) if number_.isdigit() else 0


def _points(element: Element, where: str) -> Iterator[Row]:
    number_, count = element.get("id", ""), element.get("count", "")
    place = f"{where}: MeasuredPointSet id {number_}"
    points, normals = element.find("{*}Points"), element.find("{*}Normals")
    if points is None:
        raise CmmUqError("holds its points in binary form, which is not read", where=place, fix="Export them as text")
    words, directions = ([] if one is None else "".join(one.itertext()).split() for one in (points, normals))
    if len(words) % 3 or (count.isdigit() and int(count) * 3 != len(words)):
        problem = f"has {len(words)} numbers where {element.get('count')} points have three each"
        raise CmmUqError(problem, where=place, fix="Export it again: it was cut off or changed")
    directions = directions if len(directions) == len(words) else [""] * len(words)
    for i in range(0, len(words), 3):
        label = f"set {number_} point {i // 3 + 1}"
        yield "measured point", [label, *words[i : i + 3], *directions[i : i + 3]], int(number_ or 0)


def three(text: str, place: str) -> list[str]:
    """The three numbers of a place or a direction, as they are written."""
    if len(words := text.split()) != 3:
        raise CmmUqError(f"has {len(words)} coordinates where a place has three", where=place,
                         fix="Export the results with the locations of the measured features")  # fmt: skip
    return words


def child(element: Element, name: str) -> str:
    """Text of the first element of this name in another; empty where there is none."""
    return (element.findtext(f"{{*}}{name}") or "").strip()


_BY_DSI = {unit.dsi: str.__str__(unit) for unit in PRINTED.values()}


class Dcc(Format):
    name = "dcc"
    title = say("digital calibration certificate (DCC)")

    def recognises(self, head: bytes) -> bool:
        return begins_with(head, DCC)

    def read(self, content: bytes, where: str, keys: ImportKeys) -> Sequence[Sheet]:
        """A sheet for each result that has more than one value of something."""
        from cmm_uq.jobs.dcc import read  # the model of a certificate is made for who has one
        from cmm_uq.jobs.dcc.figures import figures

        sheets = []
        for place, of_result in groupby(figures(read(content, where)), key=lambda one: one.place[:2]):
            columns = [_column(one, where) for one in of_result]
            if any(len(cells) > 1 for _, cells in columns):
                sheets.append(_sheet(place[1], columns, where))
        fix = "Give the certified values as a CSV with the columns point and reference_mm"
        if not sheets:
            raise CmmUqError("holds no result with lists of values", where=where, fix=fix)
        return sheets


def heading(quantity: QuantityFigures) -> str:
    """Of the column of a quantity: its name, or what it is by its refType, with its unit."""
    name = quantity.name or " ".join(quantity.ref_types)
    symbol = _BY_DSI.get(quantity.units[0], quantity.units[0]) if quantity.units else ""
    return f"{name} [{symbol}]" if symbol not in ("", "1") else name


def _column(quantity: QuantityFigures, where: str) -> tuple[str, list[str]]:
    units = sorted(set(quantity.units))
    if len(units) > 1:
        raise CmmUqError(f"{quantity.name!r} is in {' and '.join(units)}: the list mixes units", where=where,
                         fix="Ask the laboratory for one unit a list")  # fmt: skip
    return heading(quantity), [str(value) for value in quantity.values] or list(quantity.words)


def _sheet(name: str, columns: Sequence[tuple[str, list[str]]], where: str) -> Sheet:
    count = max(len(values) for _, values in columns)
    odd = next((heading for heading, values in columns if len(values) not in (1, count)), None)
    if odd is not None or count > ROWS.most:
        raise CmmUqError(f"the lists of {name!r} differ in length ({odd!r})", where=where,
                         fix="Ask the laboratory for a certificate whose lists belong together")  # fmt: skip
    full = ([heading, *(values if len(values) == count else values * count)] for heading, values in columns)
    return Sheet(name, list(zip(*full, strict=True)), [1, *range(1, count + 1)], decimal=".")


class Html(Format):
    """A web page: its tables and the texts between them, in one sheet."""

    name = "html"
    title = say("web page (HTML)")

    def recognises(self, head: bytes) -> bool:
        return head_text(head)[:512].lstrip("\ufeff \r\n\t").lower().startswith(("<!doctype html", "<html"))

    def read(self, content: bytes, where: str, keys: ImportKeys) -> Sequence[Sheet]:
        text, encoding = decoded(content, where, keys.encoding)
        page = _Page()
        page.feed(text)
        page.close()
        page.end()
        return [_of_rows(page.rows, page.lines, where, Fact("encoding", say("Encoding"), Verbatim(encoding)))]


class _Page(HTMLParser):
    """Rows of cells of all tables of a page, and its other texts in rows of their own."""

    def __init__(self) -> None:
        super().__init__()
        self.rows, self.lines = list[list[Cell]](), list[int]()
        self.row: list[str] | None = None
        self.text: list[str] = []  # of a cell or a text that has begun
        self.down: dict[int, int] = {}  # rows that a cell above still reaches into, by column
        self.spans = (1, 1)
        self.hidden = False

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.hidden |= tag in _HIDDEN
        if tag in ("tr", "table") or (self.row is None and tag not in _WITHIN):
            self.end()
        if tag == "table":
            self.down = {}
        elif tag == "tr":
            self.row = []
        elif tag in ("td", "th"):
            self.cell()
            given = dict(attrs)
            down, across = (given.get(key) or "1" for key in ("rowspan", "colspan"))
            self.spans, self.text = (_span(down, ROWS.most), _span(across, COLUMNS.most)), [""]
        elif tag == "br":
            self.text.append(" ")

    def handle_endtag(self, tag: str) -> None:
        self.hidden &= tag not in _HIDDEN
        if tag in ("td", "th"):
            self.cell()
        elif tag in ("tr", "table") or (self.row is None and tag not in _WITHIN):
            self.end()

    def handle_data(self, data: str) -> None:
        self.text += [] if self.hidden else [data]

    def cell(self) -> None:
        """A cell ends."""
        if self.row is None or not self.text:
            return
        for k in range(self.spans[1]):
            self.skip()
            self.down[len(self.row)] = self.spans[0]
            self.row.append("" if k else " ".join("".join(self.text).split()))
        self.text = []

    def skip(self) -> None:
        """Cells above reach into these columns."""
        while self.row is not None and self.down.get(len(self.row), 0) > 0 and len(self.row) <= COLUMNS.most:
            self.row.append("")

    def end(self) -> None:
        """A row of a table ends, or a text between tables."""
        if self.row is not None:
            self.cell()
            self.skip()
            self.down = {k: n - 1 for k, n in self.down.items() if n > 1}
        cells = [" ".join("".join(self.text).split())] if self.row is None else self.row
        if any(cells):
            self.rows.append([*cells])
            self.lines.append(self.getpos()[0])
        self.row, self.text = None, []


def _span(text: str, most: int) -> int:
    """Columns or rows that a cell reaches over."""
    return min(int(text), most) if text.isascii() and text.isdecimal() and 0 < len(text) < len("1000000") else 1


class Json(Format):
    """Records of JSON (RFC 8259)."""

    name = "json"
    title = say("records (JSON)")

    def recognises(self, head: bytes) -> bool:
        return head_text(head).lstrip("\ufeff \r\n\t")[:1] in ("{", "[") and b'"' in head

    def read(self, content: bytes, where: str, keys: ImportKeys) -> Sequence[Sheet]:
        text, encoding = decoded(content, where, keys.encoding)
        try:
            as_text: Any = dict.fromkeys(("parse_float", "parse_int", "parse_constant"), str)
            whole = json.loads(text.lstrip("\ufeff"), object_pairs_hook=_once, **as_text)
        except (ValueError, RecursionError) as error:
            at = f"{where} line {error.lineno}" if isinstance(error, json.JSONDecodeError) else where
            fix = "Export it again: it was cut off or changed"
            raise CmmUqError(f"is damaged JSON: {error}", where=at, fix=fix) from None
        of_file = Fact("encoding", say("Encoding"), Verbatim(encoding))
        return [_of_rows(_Records(whole, where).rows, None, where, of_file)]


def _once(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    if len(found := dict(pairs)) < len(pairs):  # neither value is left out unsaid
        raise ValueError("a record has a name twice")
    return found


class Xml(Format):
    """Records of any XML: elements with attributes, texts and other elements."""

    name = "xml"
    title = say("records (XML)")

    def recognises(self, head: bytes) -> bool:
        return head_text(head).lstrip("\ufeff \r\n\t").startswith("<?xml")

    def read(self, content: bytes, where: str, keys: ImportKeys) -> Sequence[Sheet]:
        return [_of_rows(_Records(_nested(root_of(content, where), where, 0), where).rows, None, where)]


def _nested(element: Element, where: str, depth: int) -> Any:
    """An element as JSON would have it: one that has nothing but a text is that."""
    _check_depth(depth, where)
    texts, inside = [element.text or "", *(one.tail or "" for one in element)], dict[str, list[Any]]()
    text = " ".join(" ".join(texts).split())
    for one in element:
        inside.setdefault(local(one), []).append(_nested(one, where, depth + 1))
    if not inside and not element.attrib:
        return text
    named = ((name.rpartition("}")[2], value) for name, value in element.attrib.items())  # a number by what it counts
    own: dict[str, Any] = {f"{local(element)} {name}" if value.isdigit() else name: value for name, value in named}
    own |= {local(element): text} if text else {}
    for name, values in inside.items():
        plain = len(values) == 1 and not isinstance(values[0], dict)
        own[name if name not in own else f"{name} {len(own)}"] = values[0] if plain else values
    return own


def _check_depth(depth: int, where: str) -> None:
    if depth > _DEEPEST:
        raise CmmUqError(f"has records within records, more than {_DEEPEST} deep", where=where, fix=_EXPORT)


class _Records:
    """A row for each innermost record, with what the records around it say; what is said once stands above as text."""

    def __init__(self, whole: Any, where: str) -> None:
        self.rows: list[list[Cell]] = []
        self.head: list[str] = []
        self.where = where
        for node in (nodes := whole if isinstance(whole, list) else [whole]):
            self.walk(node, "", {}, 0, one=len(nodes) == 1)

    def walk(self, node: Any, name: str, around: Mapping[str, str], depth: int, *, one: bool) -> None:
        """A record: ``around``, what those around it say; ``one``: whether it stands alone, and what it says holds for all."""
        _check_depth(depth, self.where)
        fields = {f"{k}": part for k, part in enumerate(node, 1)} if isinstance(node, list) else node
        if not isinstance(fields, dict):
            self.tell(name, node)
            return
        own, inner = dict(around), [(key, value) for key, value in fields.items() if _inner(value)]
        for key, value in ((key, value) for key, value in fields.items() if not _inner(value)):
            if one:
                self.tell(f"{name} {key}".strip(), value)
            for label, part in _parts(key, value).items() if not one else ():
                own[label if label not in own else f"{name} {label}"] = "" if part is None else str(part)
        of_all = [] if one or not any(isinstance(value, list) for _, value in inner) else [*filter(_plain, inner)]
        own |= {f"{key} {label}": str(part) for key, value in of_all for label, part in value.items()}
        inner = [field for field in inner if field not in of_all]
        for key, value in inner:
            for record in (values := value if isinstance(value, list) else [value]):
                self.walk(record, key, own, depth + 1, one=one and len(values) == 1)
        if not inner and not one:
            self.add(own)

    def tell(self, name: str, value: Any) -> None:
        text = ", ".join(map(str, value)) if isinstance(value, list) else str(value)
        self.rows.append([f"{name}: {text}" if name else text])

    def add(self, own: Mapping[str, str]) -> None:
        if self.head != [*own]:
            self.head = [*own]
            self.rows.append([*own])
        self.rows.append([*own.values()])
        if len(self.rows) > ROWS.most or len(own) > COLUMNS.most:
            raise CmmUqError("has more records than are read", where=self.where, fix="Split it")


def _inner(value: Any) -> bool:
    """Whether it holds records."""
    return isinstance(value, dict) or (isinstance(value, list) and any(isinstance(part, dict | list) for part in value))


def _plain(field: tuple[str, Any]) -> bool:
    """Whether it is a record without others in it: what one says beside several holds for all of them."""
    return isinstance(field[1], dict) and not any(map(_inner, field[1].values()))


def _parts(key: str, value: Any) -> dict[str, Any]:
    """Columns of one field, of several values one each."""
    return {f"{key} {k}": part for k, part in enumerate(value, 1)} if isinstance(value, list) else {key: value}


def _of_rows(rows: list[list[Cell]], lines: list[int] | None, where: str, *facts: Fact) -> Sheet:
    if not rows or len(rows) > ROWS.most:
        raise CmmUqError("holds no table" if not rows else "is too long", where=where, fix=_EXPORT)
    return Sheet("", rows, lines or [*range(1, len(rows) + 1)], facts=facts)
