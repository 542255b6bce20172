"""What of a QIF characteristic would change its meaning and is not modelled: refused by its name."""

from __future__ import annotations

from collections.abc import Mapping
from xml.etree.ElementTree import Element

from cmm_uq.jobs.importing.qif import child
from cmm_uq.jobs.importing.xml_files import local
from cmm_uq.jobs.part.characteristic import What
from cmm_uq.jobs.part.drawing import NotUnderstoodError
from cmm_uq.jobs.part.not_modelled import FREE_STATE, LINE_PROFILE, POINT_PROFILE, PROJECTED, SURFACE_PROFILE
from cmm_uq.jobs.part.qif_datums import is_plain
from cmm_uq.jobs.part.qif_elements import inside

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
    "TangentPlane": "is of a tangent plane: give its feature association = \"tangent\" by hand",
    "SecondCompositeSegmentPositionDefinition": "is a composite tolerance of several segments, which is not read",
    "UnequallyDisposedZone": "has an unequally disposed zone, which is not modelled",
    "DirectionalZoneLimit": "has a zone of one direction, which is not read",
    "FeatureZoneIds": "is of a restricted zone of its feature, which is not read",
}  # fmt: skip

SORTS: Mapping[str, str] = {
    "PointProfile": POINT_PROFILE,
    "LineProfile": LINE_PROFILE,
    "SurfaceProfile": SURFACE_PROFILE,
    "SurfaceProfileNonUniform": SURFACE_PROFILE,
}  # fmt: skip
"""Kinds of characteristics that are refused in words of their own, by the beginning of the element's name."""


def refuse_besides(element: Element) -> None:
    """Refuse what a definition or a nominal of a characteristic says besides what is read of it.

    Raises
    ------
    NotUnderstoodError : it does, what.
    """
    for inner in element:
        name, said = local(inner), "".join(inner.itertext()).strip()
        if name in _READ or said == "false":
            continue
        per_unit = "is toleranced per unit of length or area, which is not modelled" if "PerUnit" in name else ""
        raise NotUnderstoodError(_NAMED.get(name) or per_unit or f"says {name}, which is not read")


def refuse_condition(definition: Element) -> None:
    """Refuse a tolerance that holds at maximum or least material.

    Raises
    ------
    NotUnderstoodError : it does.
    """
    condition = child(definition, "MaterialCondition")
    if not is_plain(condition):
        raise NotUnderstoodError(f"holds at {condition.lower()} material condition, which is not modelled")


def refuse_zone(definition: Element, what: What, *, about_an_axis: bool) -> None:
    """Refuse a tolerance zone of another shape than the usual one.

    Raises
    ------
    NotUnderstoodError : it is.
    """
    zone = inside(definition, "ZoneShape")
    shape = "" if zone is None or not len(zone) else local(zone[0])
    usual: tuple[str, ...] = ("DiametricalZone",) if about_an_axis else ("PlanarZone",)
    if what == "position":
        usual = ("DiametricalZone", "SphericalZone")
    if shape and shape not in usual:
        raise NotUnderstoodError(f"has a tolerance zone of shape {shape}, which is not read")
