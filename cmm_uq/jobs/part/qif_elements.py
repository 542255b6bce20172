"""Elements of a QIF document: numbers, units, datums, and what of a characteristic is refused."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from xml.etree.ElementTree import Element

from cmm_uq.base.errors import CmmUqError
from cmm_uq.jobs.importing.documents import child, length_unit, three
from cmm_uq.jobs.importing.encodings import local
from cmm_uq.jobs.importing.keys import UNITS, length_named
from cmm_uq.jobs.part.characteristic import What
from cmm_uq.jobs.part.datums import BETWEEN
from cmm_uq.jobs.part.drawing import Facts, NotUnderstoodError
from cmm_uq.jobs.part.feature import FREE_STATE, LINE_PROFILE, POINT_PROFILE, PROJECTED, SURFACE_PROFILE


def number_of(text: str) -> float:
    """A number."""
    try:
        return float(text)
    except ValueError:
        raise NotUnderstoodError(f"has {text!r} where a number belongs") from None


def inside(element: Element, name: str) -> Element | None:
    """The first element of this name in another; ``None`` where there is none."""
    return next((inner for inner in element if local(inner) == name), None)


def referred(element: Element, name: str, by_id: Mapping[str, Element]) -> Element:
    """The element to which another refers by a number."""
    found = by_id.get(child(element, name))
    if found is None:
        raise NotUnderstoodError(f"refers by {name} to nothing that is there")
    return found


def numbers_in(element: Element | None) -> list[str]:
    """Numbers of elements that a list of them names."""
    return [] if element is None else [(one.text or "").strip() for one in element]


def direction(text: str, place: str) -> list[float]:
    """A direction or a normal."""
    if not text:
        raise NotUnderstoodError("does not say its direction or normal")
    return [number_of(word) for word in three(text, place)]


def is_inner(definition: Element) -> bool:
    """Whether a feature is a hole."""
    said = child(definition, "InternalExternal")
    if said not in ("INTERNAL", "EXTERNAL"):
        raise NotUnderstoodError("does not say whether it is a hole or a shaft")
    return said == "INTERNAL"


_METRE_MM = 1000.0
_LINEAR, _ANGULAR = "LinearUnit", "AngularUnit"


class QifUnits:
    """What a number of a document is in mm and degrees.

    ``root``: of the document.
    """

    def __init__(self, root: Element, where: str) -> None:
        unit = length_unit(root, where)
        if unit is None:
            if inside(root, "ExternalQIFReferences") is not None:
                said = "does not say its unit of length, and refers to other QIF documents, which are not read"
                raise CmmUqError(said, where=where, fix="Export one document with everything in it")
            raise CmmUqError("does not say its unit of length", where=where, fix="Export the plan with FileUnits")
        name = UNITS[unit.casefold()]
        self._mm, self._degrees = name.up / name.down, math.degrees(1.0)
        units = next((element for element in root.iter() if local(element) == "FileUnits"), root)
        declared = [each for each in units.iter() if local(each).endswith((_LINEAR, _ANGULAR))]
        primary = inside(units, "PrimaryUnits")
        try:
            self._named = {(_sort(each), child(each, "UnitName")): _factor(each) for each in declared}
            own = {local(each): _factor(each) for each in ([] if primary is None else primary)}
        except NotUnderstoodError as error:
            raise CmmUqError(f"a unit {error}", where=f"{where}: FileUnits", fix="Export the plan again") from None
        self._degrees *= own.get(_ANGULAR, 1.0)
        self._pmi_mm = _METRE_MM * own["PMILinearUnit"] if "PMILinearUnit" in own else self._mm
        self._pmi_degrees = math.degrees(own["PMIAngularUnit"]) if "PMIAngularUnit" in own else self._degrees

    def mm(self, element: Element, *, pmi: bool = False) -> float:
        """A length."""
        return number_of(_text(element)) * self._scale(element, pmi=pmi)

    def degrees(self, element: Element, *, pmi: bool = False) -> float:
        """An angle; see :meth:`mm`."""
        given = element.get("angularUnit", "")
        scale = self._pmi_degrees if pmi else self._degrees
        if given:
            scale = math.degrees(self._declared(_ANGULAR, given))
        return number_of(_text(element)) * scale

    def place(self, element: Element | None, where: str) -> list[float]:
        """Coordinates."""
        scale = self._mm if element is None else self._scale(element, pmi=False)
        return [scale * number_of(word) for word in three("" if element is None else _text(element), where)]

    def _scale(self, element: Element, *, pmi: bool) -> float:
        given = element.get("linearUnit", "")
        if not given:
            return self._pmi_mm if pmi else self._mm
        known = length_named(given)
        return known.up / known.down if known is not None else _METRE_MM * self._declared(_LINEAR, given)

    def _declared(self, sort: str, name: str) -> float:
        if (sort, name) not in self._named:
            raise NotUnderstoodError(f"has the unit {name!r}, which the document does not explain")
        return self._named[sort, name]


def _sort(unit: Element) -> str:
    return _LINEAR if local(unit).endswith(_LINEAR) else _ANGULAR


def _factor(unit: Element) -> float:
    """Of a unit, in metres or radians."""
    return number_of(next((each.text or "" for each in unit.iter() if local(each) == "Factor"), "") or "1")


def _text(element: Element) -> str:
    return (element.text or "").strip()


_PLAIN = ("", "NONE", "REGARDLESS", "NOT_APPLICABLE")
_ORDER = ("PRIMARY", "SECONDARY", "TERTIARY")


def is_plain(condition: str) -> bool:
    """Whether a material condition leaves a tolerance or a datum as it is."""
    return condition in _PLAIN


def datums_of(
    frame: Element | None, by_id: Mapping[str, Element], of_nominal: Mapping[str, str], features: Sequence[Facts]
) -> list[str]:
    """Names of the features of a datum reference frame, in order of precedence; hyphens between those of a common one."""
    listed = (
        [] if frame is None else [each for group in frame for each in (group if local(group) == "Datums" else (group,))]
    )
    given = [each for each in listed if local(each) == "Datum"]
    found: list[str] = []
    for datum in sorted(given, key=_precedence):
        common = inside(datum, "CompoundDatum")
        parts = [datum] if common is None else [each for each in common if local(each) == "Datum"]
        found.append(BETWEEN.join(_simple(each, by_id, of_nominal, features) for each in parts))
    return found


def _precedence(datum: Element) -> int:
    given = inside(datum, "Precedence")
    word = "" if given is None else "".join(given.itertext()).strip()
    return _ORDER.index(word) if word in _ORDER else len(_ORDER)


def _simple(
    datum: Element, by_id: Mapping[str, Element], of_nominal: Mapping[str, str], features: Sequence[Facts]
) -> str:
    simple = inside(datum, "SimpleDatum")
    if simple is None:
        raise NotUnderstoodError("has a datum of a kind that is not read")
    condition = child(simple, "MaterialModifier")
    if not is_plain(condition):
        raise NotUnderstoodError(f"has a datum at {condition.lower()} material condition, which is not modelled")
    definition = referred(simple, "DatumDefinitionId", by_id)
    label = child(definition, "DatumLabel")
    if inside(definition, "DatumTargetIds") is not None:
        raise NotUnderstoodError(f"is about the datum {label} on datum targets, which are not read")
    named = numbers_in(inside(definition, "FeatureNominalIds"))
    if named and all(number in of_nominal for number in named):
        return BETWEEN.join(of_nominal[number] for number in named)
    pattern = re.compile(rf"(datum[ _-]?)?{re.escape(label)}", re.IGNORECASE)
    same = [one["name"] for one in features if pattern.fullmatch(one["name"])]
    if named or len(same) != 1:
        raise NotUnderstoodError(f"is about the datum {label}, which names no feature that is read")
    return str(same[0])


_READ = (
    "ToleranceValue", "Tolerance", "DatumReferenceFrameId", "MaterialCondition", "ZoneShape", "StatisticalCharacteristic",
    "Attributes", "DimensionType", "Name", "Description", "NonTolerance", "SeparateZone", "SizeCharacteristicDefinitionId",
    "UUID", "QPId", "CharacteristicDefinitionId", "TargetValue", "Direction", "AnalysisMode", "AnalysisVector", "Angle",
    "FeatureNominalIds", "FeatureNominalPairs", "CharacteristicDesignator", "CoordinateSystemId", "EntityInternalIds",
    "EntityExternalIds", "NotedIds", "Notes", "ScopeIds", "WorkInstructions", "KeyCharacteristic", "TargetValueCalculation",
)  # fmt: skip
"""Elements that are read, or that leave the characteristic as it is."""

_NAMED: Mapping[str, str] = {
    "FreeState": FREE_STATE,
    "ProjectedToleranceZone": PROJECTED,
    "ProjectedToleranceZoneValue": PROJECTED,
    "TangentPlane": 'is of a tangent plane: give its feature association = "tangent" by hand',
    "SecondCompositeSegmentPositionDefinition": "is a composite tolerance of several segments, which is not read",
    "UnequallyDisposedZone": "has an unequally disposed zone, which is not modelled",
    "DirectionalZoneLimit": "has a zone of one direction, which is not read",
    "FeatureZoneIds": "is of a restricted zone of its feature, which is not read",
}

SORTS: Mapping[str, str] = {
    "PointProfile": POINT_PROFILE,
    "LineProfile": LINE_PROFILE,
    "SurfaceProfile": SURFACE_PROFILE,
    "SurfaceProfileNonUniform": SURFACE_PROFILE,
}
"""Kinds of characteristics that are refused in words of their own, by the beginning of the element's name."""


def refuse_besides(element: Element) -> None:
    """Refuse what a definition or a nominal of a characteristic says besides what is read of it."""
    for inner in element:
        name, said = local(inner), "".join(inner.itertext()).strip()
        if name in _READ or said == "false":
            continue
        per_unit = "is toleranced per unit of length or area, which is not modelled" if "PerUnit" in name else ""
        raise NotUnderstoodError(_NAMED.get(name) or per_unit or f"says {name}, which is not read")


def refuse_condition(definition: Element) -> None:
    """Refuse a tolerance that holds at maximum or least material."""
    condition = child(definition, "MaterialCondition")
    if not is_plain(condition):
        raise NotUnderstoodError(f"holds at {condition.lower()} material condition, which is not modelled")


def refuse_zone(definition: Element, what: What, *, about_an_axis: bool) -> None:
    """Refuse a tolerance zone of another shape than the usual one."""
    zone = inside(definition, "ZoneShape")
    shape = "" if zone is None or not len(zone) else local(zone[0])
    usual: tuple[str, ...] = ("DiametricalZone",) if about_an_axis else ("PlanarZone",)
    if what == "position":
        usual = ("DiametricalZone", "SphericalZone")
    if shape and shape not in usual:
        raise NotUnderstoodError(f"has a tolerance zone of shape {shape}, which is not read")
