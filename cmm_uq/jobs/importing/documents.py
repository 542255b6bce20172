"""Documents in XML: results of QIF (ANSI/DMSC QIF 3.0, ISO 23952), and digital calibration certificates (DCC 3, PTB).

Of QIF measured spheres, points and circles are read, or the measured points themselves; of a certificate the quantities of a
result, a column each, by the names that it gives.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import groupby
from typing import TYPE_CHECKING
from xml.etree.ElementTree import Element

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.files.limits import ROWS
from cmm_uq.base.messages import Verbatim, say
from cmm_uq.base.units import UNITS as PRINTED
from cmm_uq.jobs.importing.cells.encodings import begins_with, local, root_of
from cmm_uq.jobs.importing.format import LENGTHS, UNITS, Fact, Format, ImportKeys, Row, Sheet, length_named, sheets_of
from cmm_uq.jobs.importing.reports import WITH_DIRECTION, facts_of, without_results

if TYPE_CHECKING:
    from cmm_uq.jobs.dcc.figures import QuantityFigures

_MEASUREMENT = "FeatureMeasurement"
PLACED = tuple(f"{sort}{_MEASUREMENT}" for sort in ("Sphere", "Point", "Circle"))


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
        others = 0
        for element in root.iter():
            if local(element) in PLACED:
                rows.append(_feature(element, named, where))
            elif local(element) == "MeasuredPointSet":
                rows += _points(element, where)
            else:
                others += local(element).endswith(_MEASUREMENT)
        if not rows:
            problem = f"holds no measured sphere, point or circle, and {others} other features"
            fix = "Export the results with the measured features and their locations"
            raise CmmUqError(problem, where=where, fix=fix)
        facts = facts_of(Fact("version", say("Version of QIF"), Verbatim(root.get("versionQIF", ""))),
                         "features_not_used", say("Features that are no place"), others)  # fmt: skip
        return without_results(sheets_of(rows, WITH_DIRECTION, unit=length_unit(root, where), decimal=".", facts=facts))


def length_unit(root: Element, where: str) -> str | None:
    """Name of the unit of length in ``FileUnits``, whose name must fit the factor beside it; ``None`` where there is none."""
    primary = root.find(".//{*}PrimaryUnits")
    length = None if primary is None else primary.find("{*}LinearUnit")
    if length is None:
        return None
    name, factor = child(length, "UnitName"), length.findtext(".//{*}Factor")
    metres, unit = float(factor or "1"), length_named(name)
    if unit is None:
        unit = next((one for one in map(UNITS.get, LENGTHS) if one and abs(one.metres / metres - 1) < 1e-9), None)
    if unit is None or abs(unit.metres / metres - 1) > 1e-6:
        unknown = f"of {factor} m is not known"
        problem = unknown if factor else "has no Factor to metres (UnitConversion), and is then the metre"
        fix = "Export the results in mm or inch"
        raise CmmUqError(f"the unit {name!r} {problem}", where=f"{where}: FileUnits", fix=fix)
    return unit.name


def _feature(element: Element, named: dict[str, str], where: str) -> Row:
    sort, number_ = local(element).removesuffix(_MEASUREMENT).lower(), element.get("id", "")
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
    words = text.split()
    if len(words) != 3:
        raise CmmUqError(f"has {len(words)} coordinates where a place has three", where=place,
                         fix="Export the results with the locations of the measured features")  # fmt: skip
    return words


def child(element: Element, name: str) -> str:
    """Text of the first element of this name in another; empty where there is none."""
    return (element.findtext(f"{{*}}{name}") or "").strip()


_BY_DSI = {unit.dsi: str.__str__(unit) for unit in PRINTED.values()}
DCC = "digitalCalibrationCertificate"  # root of a certificate


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
        if not sheets:
            raise CmmUqError("holds no result with lists of values", where=where,
                             fix="Give the certified values as a CSV with the columns point and reference_mm")  # fmt: skip
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
