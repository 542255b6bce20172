"""QIF plans (ANSI/DMSC QIF 3.0, ISO 23952): nominal features, and the characteristics that the drawing asks for.

Read are points, lines, planes, circles, spheres, cylinders and cones that are to be measured, sizes, forms, orientations,
positions, coaxiality, runouts, distances and angles, with datums regardless of material. Where a datum does not name its
feature, the feature that is named as the datum is taken (``A``, ``DATUM A``, ``DATUM_A``).
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterator, Mapping
from xml.etree.ElementTree import Element

from cmm_uq.errors import CmmUqError
from cmm_uq.jobs.importing.qif import child, length_unit, three
from cmm_uq.jobs.importing.units import UNITS
from cmm_uq.jobs.importing.xml_files import local, root_of
from cmm_uq.jobs.part.characteristic import ASKS, What
from cmm_uq.jobs.part.drawing import (
    Drawing,
    Facts,
    NotUnderstoodError,
    Unknown,
    limits,
    refuse_other_kind,
    usual_strategy,
)
from cmm_uq.jobs.part.qif_elements import direction, inside, is_inner, number_of, radians_of

PROGRAM = "QIF plan"

_KINDS = ("Point", "Line", "Plane", "Circle", "Sphere", "Cylinder", "Cone")
_WHATS: Mapping[str, What] = {
    "Diameter": "size", "SphericalDiameter": "size", "Straightness": "straightness", "Flatness": "flatness",
    "Circularity": "roundness", "Cylindricity": "cylindricity", "Sphericity": "sphericity", "Position": "position",
    "Parallelism": "parallelism", "Perpendicularity": "perpendicularity", "Angularity": "angularity",
    "Coaxiality": "coaxiality", "CircularRunout": "circular_runout", "TotalRunout": "total_runout",
    "DistanceBetween": "distance", "AngleBetween": "angle",
}  # fmt: skip
_ASSOCIATIONS = {
    "LEASTSQUARES": "least_squares", "MINMAX": "minimum_zone", "MAXINSCRIBED": "maximum_inscribed",
    "MINCIRCUMSCRIBED": "minimum_circumscribed",
}  # fmt: skip
_PLAIN = ("", "NONE", "REGARDLESS", "NOT_APPLICABLE")
"""Modifiers that leave a tolerance or a datum as it is."""


def drawing_of_qif(content: bytes, where: str) -> Drawing:
    """A QIF plan.

    Parameters
    ----------
    content : of the file.
    where : its path, for messages.

    Raises
    ------
    CmmUqError : it is damaged, or does not say its units.
    """
    return _Document(root_of(content, where), where).drawing()


_LENGTH_MM = 20.0
"""Of a plane or line whose length is not said: an example."""


class _Document:
    """The elements of a document by their numbers."""

    def __init__(self, root: Element, where: str) -> None:
        unit = length_unit(root, where)
        if unit is None:
            raise CmmUqError("does not say its unit of length", where=where, fix="Export the plan with FileUnits")
        name = UNITS[unit.casefold()]
        self.millimetres = name.up / name.down
        try:
            self.degrees = math.degrees(radians_of(root))
        except NotUnderstoodError as error:
            raise CmmUqError(
                f"the unit of angle {error}", where=f"{where}: FileUnits", fix="Export the plan again"
            ) from None
        self.root, self.where = root, where
        self.by_id = {element.get("id", ""): element for element in root.iter() if element.get("id")}
        self.names: dict[str, str] = {}
        self.of_nominal: dict[str, str] = {}
        self.drawing_ = Drawing(PROGRAM)

    def drawing(self) -> Drawing:
        """Features first: characteristics name them."""
        for item in self._all("FeatureItem"):
            self._named(item, "feature", self._feature)
        for item in self._all("CharacteristicItem"):
            self._named(item, "characteristic", self._characteristic)
        return self.drawing_

    def _all(self, ending: str) -> Iterator[Element]:
        return (element for element in self.root.iter() if local(element).endswith(ending))

    def _named(self, item: Element, what: str, read: Callable[[Element, str, str], Facts]) -> None:
        """Read an item, or keep what of it is not understood."""
        number = item.get("id", "")
        name = child(item, "FeatureName") or child(item, "Name") or f"{what} {number}"
        place = f"{self.where}: {local(item)} id {number}"
        taken = self.drawing_.features if what == "feature" else self.drawing_.characteristics
        try:
            if any(one["name"] == name for one in taken):
                raise NotUnderstoodError(f"is the name of two {what}s")
            taken.append(read(item, name, place))
        except NotUnderstoodError as error:
            self.drawing_.unknown.append(Unknown(name, str(error), place))

    def _feature(self, item: Element, name: str, place: str) -> Facts:
        sort = local(item).removesuffix("FeatureItem")
        if sort not in _KINDS:
            raise NotUnderstoodError(f"is a feature of kind {sort}, which is not read")
        if any(local(element) == "Constructed" for element in item.iter()):
            raise NotUnderstoodError("is constructed of other features, which is not read")
        nominal = self._referred(item, "FeatureNominalId")
        definition = self._referred(nominal, "FeatureDefinitionId")
        if inside(nominal, "PointList") is not None:
            raise NotUnderstoodError("has a list of points of its own (PointList), which is not read")
        kind = sort.lower()
        found: Facts = {"name": name, "kind": kind}
        found |= {} if (association := self._association(nominal)) is None else {"association": association}
        found = self._nominal(found, nominal, definition, place)
        self.names[item.get("id", "")] = name
        self.of_nominal[nominal.get("id", "")] = name
        return self._probed(found)

    def _association(self, nominal: Element) -> str | None:
        given = inside(nominal, "SubstituteFeatureAlgorithm")
        if given is None:
            return None
        word = "".join(given.itertext()).strip()
        if word not in _ASSOCIATIONS:
            raise NotUnderstoodError(f"is to be associated by {word}, which is not read")
        return _ASSOCIATIONS[word]

    def _nominal(self, found: Facts, nominal: Element, definition: Element, place: str) -> Facts:
        kind, axis = found["kind"], inside(nominal, "Axis")
        if kind in ("cylinder", "cone"):
            if axis is None:
                raise NotUnderstoodError("has no axis")
            found |= {"point_mm": self._place(child(axis, "AxisPoint"), place),
                      "direction": direction(child(axis, "Direction"), place)}  # fmt: skip
        else:
            found |= {"point_mm": self._place(child(nominal, "Location"), place)}
        if kind in ("plane", "circle", "point"):
            found["direction"] = direction(child(nominal, "Normal"), place)
        if kind == "line":
            found |= {"direction": direction(child(nominal, "Direction"), place),
                      "normal": direction(child(nominal, "Normal"), place)}  # fmt: skip
        if kind in ("circle", "sphere", "cylinder", "cone"):
            found |= {"diameter_mm": self._length(definition, "Diameter"), "inner": is_inner(definition)}
        if kind == "cone":
            half, whole = child(definition, "HalfAngle"), child(definition, "FullAngle")
            if not (half or whole):
                raise NotUnderstoodError("does not say its angle")
            found["angle_deg"] = self.degrees * (2 * number_of(half) if half else number_of(whole))
        if kind in ("line", "cylinder", "cone"):
            length = child(
                nominal if kind == "line" else definition, "LargeEndDistance" if kind == "cone" else "Length"
            )
            self._between_its_ends(found, length, child(definition, "SmallEndDistance"))
        return found

    def _between_its_ends(self, found: Facts, length: str, small: str) -> None:
        """Put the point of a line, cylinder or cone from its start, or from anywhere on its axis, to its middle.

        A cone without a small end ends at its tip. A length that is not said is an example.
        """
        start = 0.0
        slope = math.tan(math.radians(found["angle_deg"] / 2)) if found["kind"] == "cone" else 0.0
        if slope and length:
            start = self.millimetres * number_of(small) if small else -0.5 * found["diameter_mm"] / slope
        if not length:
            self.drawing_.open_keys[found["name"]] = ["length_mm", "point_mm"]
        end = self.millimetres * number_of(length) if length else found.get("diameter_mm", _LENGTH_MM) / 2
        middle = 0.5 * (start + end)
        way = middle / (math.hypot(*found["direction"]) or 1.0)
        found["length_mm"] = end - start
        found["point_mm"] = [a + way * b for a, b in zip(found["point_mm"], found["direction"], strict=True)]
        if slope:
            found["diameter_mm"] += 2 * slope * middle

    def _probed(self, found: Facts) -> Facts:
        """With what the file leaves open."""
        kind, name = found["kind"], found["name"]
        if kind == "point":
            return found
        opened = ["strategy"]
        if kind == "plane":
            found |= {"length_mm": _LENGTH_MM, "width_mm": _LENGTH_MM}
            opened += ["length_mm", "width_mm"]
        found["strategy"] = usual_strategy(kind)
        self.drawing_.open_keys[name] = [*opened, *self.drawing_.open_keys.get(name, ())]
        return found

    def _characteristic(self, item: Element, name: str, place: str) -> Facts:
        sort = local(item).removesuffix("CharacteristicItem")
        nominal = self._referred(item, "CharacteristicNominalId")
        definition = self._referred(nominal, "CharacteristicDefinitionId")
        what = self._what(sort, nominal)
        features = self._features(item, what)
        for kind in (one["kind"] for one in self.drawing_.features if one["name"] in features):
            refuse_other_kind(what, kind)
        found: Facts = {"name": name, "what": what, "features": features}
        self._refuse_modified(definition, what, features)
        frame = child(definition, "DatumReferenceFrameId")
        datums = self._datums(frame) if frame and ASKS[what].datum_kinds else []
        if len(datums) < ASKS[what].datums:
            raise NotUnderstoodError("names no datum")
        found |= {"datums": datums} if datums else {}
        return found | self._limits(what, nominal, definition)

    def _what(self, sort: str, nominal: Element) -> What:
        if sort == "LinearCoordinate":
            if child(nominal, "CoordinateSystemId"):
                raise NotUnderstoodError("is a coordinate in a system of its own, which is not read")
            direction = child(nominal, "Direction")
            axes: Mapping[str, What] = {"XAXIS": "x", "YAXIS": "y", "ZAXIS": "z"}
            if direction not in axes:
                raise NotUnderstoodError(f"is a coordinate along {direction or 'no axis'}, which is not read")
            return axes[direction]
        if sort not in _WHATS:
            raise NotUnderstoodError(f"is a characteristic of kind {sort}, which is not read")
        mode = child(nominal, "AnalysisMode")
        if sort == "DistanceBetween" and mode not in ("", "THREEDIMENSIONAL"):
            raise NotUnderstoodError(f"is a distance in the analysis {mode}, which is not read")
        return _WHATS[sort]

    def _features(self, item: Element, what: What) -> list[str]:
        ids = inside(item, "FeatureItemIds")
        given = [] if ids is None else [(element.text or "").strip() for element in ids]
        if len(given) != ASKS[what].features:
            raise NotUnderstoodError(f"is a {what} of {len(given) or 'no'} features")
        unread = [number for number in given if number not in self.names]
        if unread:
            raise NotUnderstoodError(f"is of the feature {self._item_name(unread[0])!r}, which is not read")
        return [self.names[number] for number in given]

    def _item_name(self, number: str) -> str:
        item = self.by_id.get(number)
        return number if item is None else child(item, "FeatureName") or number

    def _refuse_modified(self, definition: Element, what: What, features: list[str]) -> None:
        condition = child(definition, "MaterialCondition")
        if condition not in _PLAIN:
            raise NotUnderstoodError(f"holds at {condition.lower()} material condition, which is not read")
        zone = inside(definition, "ZoneShape")
        shape = "" if zone is None or not len(zone) else local(zone[0])
        round_feature = any(one["name"] in features and one["kind"] in ("circle", "cylinder", "cone", "line")
                            for one in self.drawing_.features)  # fmt: skip
        usual = {"position": ("DiametricalZone", "SphericalZone")}.get(
            what, ("DiametricalZone",) if round_feature else ("PlanarZone",)
        )
        if shape and shape not in usual:
            raise NotUnderstoodError(f"has a tolerance zone of shape {shape}, which is not read")

    def _datums(self, frame: str) -> list[str]:
        found: list[str] = []
        reference = self.by_id.get(frame)
        for datum in [] if reference is None else [each for each in reference.iter() if local(each) == "Datum"]:
            simple = inside(datum, "SimpleDatum")
            if simple is None:
                raise NotUnderstoodError("has a compound datum, which is not read")
            modifier = child(simple, "MaterialModifier")
            if modifier not in _PLAIN:
                raise NotUnderstoodError(f"has a datum at {modifier.lower()} material condition, which is not read")
            found.append(self._datum(self._referred(simple, "DatumDefinitionId")))
        return found

    def _datum(self, definition: Element) -> str:
        label = child(definition, "DatumLabel")
        ids = inside(definition, "FeatureNominalIds")
        named = [] if ids is None else [(element.text or "").strip() for element in ids]
        if len(named) == 1 and named[0] in self.of_nominal:
            return self.of_nominal[named[0]]
        pattern = re.compile(rf"(datum[ _-]?)?{re.escape(label)}", re.IGNORECASE)
        same = [one["name"] for one in self.drawing_.features if pattern.fullmatch(one["name"])]
        if named or len(same) != 1:
            raise NotUnderstoodError(f"is about the datum {label}, which names no feature that is read")
        return str(same[0])

    def _limits(self, what: What, nominal: Element, definition: Element) -> Facts:
        if ASKS[what].limits == "zone":
            width = child(definition, "ToleranceValue")
            if not width or number_of(width) <= 0:
                raise NotUnderstoodError("has no tolerance above 0")
            return {"tolerance_mm": self.millimetres * number_of(width)}
        tolerance = inside(definition, "Tolerance")
        if tolerance is None:
            return {}
        scale = self.degrees if ASKS[what].limits == "angles" else self.millimetres
        low, high = child(tolerance, "MinValue"), child(tolerance, "MaxValue")
        if not (low and high):
            raise NotUnderstoodError("has a tolerance without two limits, which is not read")
        target = child(nominal, "TargetValue")
        about = 0.0
        if child(tolerance, "DefinedAsLimit") != "true":
            if not target:
                raise NotUnderstoodError("has limits about a value that is not there")
            about = number_of(target)
        return limits(what, scale * (about + number_of(low)), scale * (about + number_of(high)))

    def _length(self, element: Element, name: str) -> float:
        text = child(element, name)
        if not text:
            raise NotUnderstoodError(f"does not say its {name}")
        return self.millimetres * number_of(text)

    def _place(self, text: str, place: str) -> list[float]:
        return [self.millimetres * number_of(word) for word in three(text, place)]

    def _referred(self, element: Element, name: str) -> Element:
        found = self.by_id.get(child(element, name))
        if found is None:
            raise NotUnderstoodError(f"refers by {name} to nothing that is there")
        return found
