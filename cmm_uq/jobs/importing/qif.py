"""QIF results (ANSI/DMSC QIF 3.0, ISO 23952): measured spheres, points and circles, or the measured points themselves."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from fractions import Fraction
from xml.etree.ElementTree import Element

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.messages import Verbatim, number, say
from cmm_uq.jobs.importing.encodings import begins_with, local, root_of
from cmm_uq.jobs.importing.format import Format
from cmm_uq.jobs.importing.keys import LENGTH, UNITS, ImportKeys, length_named
from cmm_uq.jobs.importing.sheet import Cell, Fact, Row, Sheet, sheets_of

_MEASUREMENT = "FeatureMeasurement"
PLACED = tuple(f"{sort}{_MEASUREMENT}" for sort in ("Sphere", "Point", "Circle"))
_HEADINGS = ["name", "x", "y", "z", "i", "j", "k"]


class Qif(Format):
    """A document with results."""

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
            elif local(element).endswith(_MEASUREMENT):
                others += 1
        if not rows:
            raise CmmUqError(f"holds no measured sphere, point or circle, and {others} other features", where=where,
                             fix="Export the results with the measured features and their locations")  # fmt: skip
        facts = [Fact("version", say("Version of QIF"), Verbatim(root.get("versionQIF", "")))]
        if others:
            facts.append(Fact("features_not_used", say("Features that are no place"), number(others)))
        return sheets_of(rows, _HEADINGS, unit=length_unit(root, where), decimal=".", facts=tuple(facts))


def length_unit(root: Element, where: str) -> str | None:
    """Name of the unit of length in ``FileUnits``, whose name must fit the factor beside it; ``None`` where there is none."""
    found = next((e for e in root.iter() if local(e) == "PrimaryUnits"), None)
    length = None if found is None else next((e for e in found if local(e) == "LinearUnit"), None)
    if length is None:
        return None
    name, given = child(length, "UnitName"), next((e.text for e in length.iter() if local(e) == "Factor"), None)
    factor = given or "1"
    unit = length_named(name)
    if unit is None:
        metres = float(factor)
        lengths = (one for one in UNITS.values() if one.sort == LENGTH)
        unit = next((one for one in lengths if abs(_metres(one.name) / metres - 1) < 1e-9), None)
    if unit is None or abs(_metres(unit.name) / float(factor) - 1) > 1e-6:
        said = (
            f"of {factor} m is not known"
            if given
            else "has no Factor to metres (UnitConversion), and is then the metre"
        )
        raise CmmUqError(f"the unit {name!r} {said}", where=f"{where}: FileUnits",
                         fix="Export the results in mm or inch")  # fmt: skip
    return unit.name


def _metres(name: str) -> float:
    unit = UNITS[name.casefold()]
    return float(Fraction(unit.up, unit.down * 1000))


def _feature(element: Element, named: dict[str, str], where: str) -> Row:
    sort, number_ = local(element).removesuffix(_MEASUREMENT).lower(), element.get("id", "")
    place = f"{where}: {local(element)} id {number_}"
    xyz = three(child(element, "Location"), place)
    label = named.get(child(element, "FeatureItemId"), "") or number_
    normal = child(element, "Normal") if sort == "point" else ""
    vector: list[Cell] = [*three(normal, place)] if normal else ["", "", ""]
    return sort, [label, *xyz, *vector], int(number_) if number_.isdigit() else 0


def _points(element: Element, where: str) -> Iterator[Row]:
    number_ = element.get("id", "")
    place = f"{where}: MeasuredPointSet id {number_}"
    points = next((e for e in element if local(e) == "Points"), None)
    if points is None:
        raise CmmUqError("holds its points in binary form, which is not read", where=place, fix="Export them as text")
    words = "".join(points.itertext()).split()
    if len(words) % 3 or (element.get("count", "").isdigit() and int(element.get("count", "0")) * 3 != len(words)):
        raise CmmUqError(f"has {len(words)} numbers where {element.get('count')} points have three each", where=place,
                         fix="Export it again: it was cut off or changed")  # fmt: skip
    normals = next((e for e in element if local(e) == "Normals"), None)
    vectors = [] if normals is None else "".join(normals.itertext()).split()
    for i in range(0, len(words), 3):
        vector: list[Cell] = [*vectors[i : i + 3]] if len(vectors) == len(words) else ["", "", ""]
        yield "measured point", [f"set {number_} point {i // 3 + 1}", *words[i : i + 3], *vector], int(number_ or 0)


def three(text: str, place: str) -> list[str]:
    """The three numbers of a place or a direction, as they are written."""
    words = text.split()
    if len(words) != 3:
        raise CmmUqError(f"has {len(words)} coordinates where a place has three", where=place,
                         fix="Export the results with the locations of the measured features")  # fmt: skip
    return words


def child(element: Element, name: str) -> str:
    """Text of the first element of this name in another; empty where there is none."""
    found = next((e for e in element if local(e) == name), None)
    return "" if found is None or found.text is None else found.text.strip()
