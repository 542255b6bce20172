"""QIF plans (ANSI/DMSC QIF 3.0, ISO 23952): nominal features, and the characteristics that the drawing asks for.

Read are points, lines, planes, circles, spheres, cylinders and cones that are to be measured, sizes, forms, orientations,
positions, coaxiality, runouts, distances and angles, with datums regardless of material. Where a datum does not name its
feature, the feature that is named as the datum is taken (``A``, ``DATUM A``, ``DATUM_A``). A model with product information
(PMI) plans no measurement: of it nominal features are taken that a datum or a characteristic is of.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from copy import copy
from xml.etree.ElementTree import Element, SubElement

from cmm_uq.base.errors import CmmUqError
from cmm_uq.jobs.importing.documents import child
from cmm_uq.jobs.importing.encodings import local, root_of
from cmm_uq.jobs.part.characteristic import ASKS, What
from cmm_uq.jobs.part.drawing import (
    Drawing,
    Facts,
    NotUnderstood,
    NotUnderstoodError,
    limits,
    refuse_other_kind,
    usual_strategy,
)
from cmm_uq.jobs.part.feature import SCANNED
from cmm_uq.jobs.part.qif_elements import (
    SORTS,
    QifUnits,
    datums_of,
    direction,
    inside,
    is_inner,
    numbers_in,
    referred,
    refuse_besides,
    refuse_condition,
    refuse_zone,
)

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


def drawing_of_qif(content: bytes, where: str) -> Drawing:
    """A QIF plan."""
    return _Document(root_of(content, where), where).drawing()


_LENGTH_MM = 20.0  # of a plane or line whose length is not said: an example
# ends of the names of elements that a plan or a model is made of; statistics, rules and resources have none
_FEATURES = ("FeatureItem", "FeatureNominal")


class _Document:
    """The elements of a document by their numbers."""

    def __init__(self, root: Element, where: str) -> None:
        if not any(local(element).endswith(_FEATURES) for element in root.iter()):
            raise CmmUqError("is of no feature: it has neither FeatureItem nor FeatureNominal", where=where,
                             fix="Export the plan, or the model with its product information (PMI)")  # fmt: skip
        self.units = QifUnits(root, where)
        self.root, self.where = root, where
        self.by_id = {element.get("id", ""): element for element in root.iter() if element.get("id")}
        self.names: dict[str, str] = {}
        self.of_nominal: dict[str, str] = {}
        self.drawing_ = Drawing(PROGRAM)

    def drawing(self) -> Drawing:
        """Features first: characteristics name them."""
        planned = list(self._all("FeatureItem"))
        labels = {} if planned else self._asked()
        for item in planned or [one for one in self._all("FeatureNominal") if one.get("id", "") in labels]:
            self._named(item, "feature", self._feature, labels.get(item.get("id", ""), ""))
        for item in self._all("CharacteristicItem" if planned else "CharacteristicNominal"):
            ids = numbers_in(inside(item, "FeatureNominalIds"))
            if planned or len(ids) < 2 or self._features_of(item) > 1:
                self._named(item, "characteristic", self._characteristic)
                continue
            for number in ids:  # a pattern of features: each of them
                one = copy(item)
                for group in [each for each in one if local(each) == "FeatureNominalIds"]:
                    one.remove(group)
                    only = SubElement(one, "FeatureNominalIds")
                    SubElement(only, "Id").text = number
                self._named(one, "characteristic", self._characteristic, f"{child(item, 'Name')} {number}".strip())
        return self.drawing_

    def _asked(self) -> dict[str, str]:
        """Numbers of nominal features that a datum or a characteristic is of, with the label of their datum."""
        found = {number: "" for one in self._all("CharacteristicNominal") for number in self._numbers(one)}
        for datum in self._all("DatumDefinition"):
            numbers = self._numbers(datum)
            found |= dict.fromkeys(numbers, child(datum, "DatumLabel") if len(numbers) == 1 else "")
        return found

    @staticmethod
    def _numbers(element: Element) -> list[str]:
        """Of nominal features that an element names, alone or in pairs."""
        pairs = inside(element, "FeatureNominalPairs")
        return [*numbers_in(inside(element, "FeatureNominalIds")),
                *(number for pair in ([] if pairs is None else pairs) for number in numbers_in(pair))]  # fmt: skip

    @staticmethod
    def _features_of(item: Element) -> int:
        what = _WHATS.get(local(item).removesuffix("CharacteristicNominal"))
        return 1 if what is None else ASKS[what].features

    def _all(self, ending: str) -> Iterator[Element]:
        return (element for element in self.root.iter() if local(element).endswith(ending))

    def _named(self, item: Element, what: str, read: Callable[[Element, str, str], Facts], name: str = "") -> None:
        """Read an item, or keep what of it is not understood."""
        number = item.get("id", "")
        name = name or child(item, "FeatureName") or child(item, "Name") or f"{what} {number}"
        place = f"{self.where}: {local(item)} id {number}"
        taken = self.drawing_.features if what == "feature" else self.drawing_.characteristics
        try:
            if any(one["name"] == name for one in taken):
                raise NotUnderstoodError(f"is the name of two {what}s")
            taken.append(read(item, name, place))
        except NotUnderstoodError as error:
            self.drawing_.unknown.append(NotUnderstood(name, str(error), place))

    def _feature(self, item: Element, name: str, place: str) -> Facts:
        sort = local(item).removesuffix("FeatureItem").removesuffix("FeatureNominal")
        if sort not in _KINDS:
            raise NotUnderstoodError(f"is a feature of kind {sort}, which is not read")
        if any(local(element) == "FromScan" and (element.text or "").strip() != "false" for element in item.iter()):
            raise NotUnderstoodError(SCANNED)
        if any(local(element) == "Constructed" for element in item.iter()):
            raise NotUnderstoodError("is constructed of other features, which is not read")
        nominal = item if local(item).endswith("FeatureNominal") else self._referred(item, "FeatureNominalId")
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
            found |= {"point_mm": self.units.place(inside(axis, "AxisPoint"), place),
                      "direction": direction(child(axis, "Direction"), place)}  # fmt: skip
        else:
            found |= {"point_mm": self.units.place(inside(nominal, "Location"), place)}
        if kind in ("plane", "circle", "point"):
            found["direction"] = direction(child(nominal, "Normal"), place)
        if kind == "line":
            found |= {"direction": direction(child(nominal, "Direction"), place),
                      "normal": direction(child(nominal, "Normal"), place)}  # fmt: skip
        if kind in ("circle", "sphere", "cylinder", "cone"):
            found |= {"diameter_mm": self._length(definition, "Diameter"), "inner": is_inner(definition)}
        if kind == "cone":
            half, whole = inside(definition, "HalfAngle"), inside(definition, "FullAngle")
            angle = half if half is not None else whole
            if angle is None:
                raise NotUnderstoodError("does not say its angle")
            found["angle_deg"] = self.units.degrees(angle) * (1 if half is None else 2)
        if kind in ("line", "cylinder", "cone"):
            key = "LargeEndDistance" if kind == "cone" else "Length"
            length = inside(nominal if kind == "line" else definition, key)
            self._between_its_ends(found, length, inside(definition, "SmallEndDistance"))
        return found

    def _between_its_ends(self, found: Facts, length: Element | None, small: Element | None) -> None:
        """Put the point of a line, cylinder or cone from its start, or from anywhere on its axis, to its middle.

        A cone without a small end ends at its tip. A length that is not said is an example.
        """
        start = 0.0
        slope = math.tan(math.radians(found["angle_deg"] / 2)) if found["kind"] == "cone" else 0.0
        if slope and length is not None:
            start = self.units.mm(small) if small is not None else -0.5 * found["diameter_mm"] / slope
        if length is None:
            self.drawing_.open_keys[found["name"]] = ["length_mm", "point_mm"]
        end = self.units.mm(length) if length is not None else found.get("diameter_mm", _LENGTH_MM) / 2
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
        sort = local(item).removesuffix("CharacteristicItem").removesuffix("CharacteristicNominal")
        alone = local(item).endswith("CharacteristicNominal")
        nominal = item if alone else self._referred(item, "CharacteristicNominalId")
        definition = self._referred(nominal, "CharacteristicDefinitionId")
        what = self._what(sort, nominal)
        features = self._features(item, what)
        for kind in (one["kind"] for one in self.drawing_.features if one["name"] in features):
            refuse_other_kind(what, kind)
        found: Facts = {"name": name, "what": what, "features": features}
        refuse_besides(definition)
        refuse_besides(nominal)
        refuse_condition(definition)
        of = next((one["kind"] for one in self.drawing_.features if one["name"] in features), "")
        refuse_zone(definition, what, about_an_axis=of in ("circle", "cylinder", "cone", "line"))
        frame = self.by_id.get(child(definition, "DatumReferenceFrameId"))
        datums = datums_of(frame, self.by_id, self.of_nominal, self.drawing_.features) if ASKS[what].datum_kinds else []
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
            raise NotUnderstoodError(SORTS.get(sort) or f"is a characteristic of kind {sort}, which is not read")
        mode = child(nominal, "AnalysisMode")
        if sort == "DistanceBetween" and mode not in ("", "THREEDIMENSIONAL"):
            raise NotUnderstoodError(f"is a distance in the analysis {mode}, which is not read")
        return _WHATS[sort]

    def _features(self, item: Element, what: What) -> list[str]:
        given = numbers_in(inside(item, "FeatureItemIds")) or self._numbers(item)
        if len(given) != ASKS[what].features:
            raise NotUnderstoodError(f"is a {what} of {len(given) or 'no'} features")
        unread = [number for number in given if number not in self.names]
        if unread:
            raise NotUnderstoodError(f"is of the feature {self._item_name(unread[0])!r}, which is not read")
        return [self.names[number] for number in given]

    def _item_name(self, number: str) -> str:
        item = self.by_id.get(number)
        return number if item is None else child(item, "FeatureName") or number

    def _limits(self, what: What, nominal: Element, definition: Element) -> Facts:
        if ASKS[what].limits == "zone":
            width = inside(definition, "ToleranceValue")
            if width is None or self.units.mm(width, pmi=True) <= 0:
                raise NotUnderstoodError("has no tolerance above 0")
            return {"tolerance_mm": self.units.mm(width, pmi=True)}
        tolerance = inside(definition, "Tolerance")
        if tolerance is None:
            return {}
        value = self.units.degrees if ASKS[what].limits == "angles" else self.units.mm
        low, high = inside(tolerance, "MinValue"), inside(tolerance, "MaxValue")
        if low is None or high is None:
            raise NotUnderstoodError("has a tolerance without two limits, which is not read")
        target = inside(nominal, "TargetValue")
        about = 0.0
        if child(tolerance, "DefinedAsLimit") != "true":
            if target is None:
                raise NotUnderstoodError("has limits about a value that is not there")
            about = value(target, pmi=True)
        return limits(what, about + value(low, pmi=True), about + value(high, pmi=True))

    def _length(self, element: Element, name: str) -> float:
        given = inside(element, name)
        if given is None:
            raise NotUnderstoodError(f"does not say its {name}")
        return self.units.mm(given)

    def _referred(self, element: Element, name: str) -> Element:
        return referred(element, name, self.by_id)
