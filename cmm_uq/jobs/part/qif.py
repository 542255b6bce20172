"""QIF plans (ANSI/DMSC QIF 3.0, ISO 23952): nominal features, and the characteristics that the drawing asks for.

Read are points, lines, planes, circles, spheres, cylinders and cones that are to be measured, sizes, forms, orientations,
positions, coaxiality, runouts, distances and angles, with datums regardless of material. Where a datum does not name its
feature, the feature that is named as the datum is taken (``A``, ``DATUM A``, ``DATUM_A``). A model with product information
(PMI) plans no measurement: of it nominal features are taken that a datum or a characteristic is of.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterator, Mapping
from copy import copy
from xml.etree.ElementTree import Element, SubElement

from cmm_uq.base.errors import CmmUqError
from cmm_uq.jobs.importing.cells.encodings import local, root_of
from cmm_uq.jobs.importing.documents import child, three
from cmm_uq.jobs.part import drawing as drawings, feature as refused
from cmm_uq.jobs.part.checks import BETWEEN
from cmm_uq.jobs.part.drawing import PROGRAMS, Facts, NotUnderstoodError, listed, number_of, text, whole_text
from cmm_uq.jobs.part.feature import ASKS, What, with_article

PROGRAM = "QIF plan"
_KINDS = ("Point", "Line", "Plane", "Circle", "Sphere", "Cylinder", "Cone")
WHATS: Mapping[str, What] = PROGRAMS["qif"]["whats"]
ASSOCIATIONS: Mapping[str, str] = PROGRAMS["qif"]["associations"]
# kinds of characteristics that are refused in words of their own, by the beginning of the element's name
_SORTS: Mapping[str, str] = {
    "PointProfile": refused.POINT_PROFILE, "LineProfile": refused.LINE_PROFILE,
    "SurfaceProfile": refused.SURFACE_PROFILE, "SurfaceProfileNonUniform": refused.SURFACE_PROFILE,
}  # fmt: skip
# elements that are read, or that leave the characteristic or the datum as it is
_READ = frozenset(PROGRAMS["qif"]["read"].split())
_NAMED: Mapping[str, str] = {
    "FreeState": refused.FREE_STATE,
    "ProjectedToleranceZone": refused.PROJECTED,
    "ProjectedToleranceZoneValue": refused.PROJECTED,
    "TangentPlane": 'is of a tangent plane: give its feature association = "tangent" by hand',
    "SecondCompositeSegmentPositionDefinition": "is a composite tolerance of several segments, which is not read",
    "UnequallyDisposedZone": "has an unequally disposed zone, which is not modelled",
    "DirectionalZoneLimit": "has a zone of one direction, which is not read",
    "StatisticalCharacteristic": "is a statistical tolerance, which is not modelled",
    "SubstituteFeatureAlgorithm": "has an association of its own or of a datum (SubstituteFeatureAlgorithm), not read",
    "FeatureZoneIds": "is of a restricted zone of its feature, which is not read",
}
_PLAIN = ("", "NONE", "REGARDLESS", "NOT_APPLICABLE")  # material conditions that leave a tolerance or a datum as it is
_ANGLE_DEG = 0.01  # by which a basic angle may be rounded
_LENGTH_MM = 20.0  # of a plane or line whose length is not said: an example
# ends of the names of elements that a plan or a model is made of; statistics, rules and resources have none
_FEATURES = ("FeatureItem", "FeatureNominal")


def drawing_of_qif(content: bytes, where: str) -> drawings.Drawing:
    return _Document(root_of(content, where), where).read()


def _direction(element: Element, name: str, place: str) -> list[float]:
    text = child(element, name)
    if not text:
        raise NotUnderstoodError("does not say its direction or normal")
    return [number_of(word) for word in three(text, place)]


class _Document:
    """The elements of a document by their numbers."""

    def __init__(self, root: Element, where: str) -> None:
        if not any(local(element).endswith(_FEATURES) for element in root.iter()):
            raise CmmUqError("is of no feature: it has neither FeatureItem nor FeatureNominal", where=where,
                             fix="Export the plan, or the model with its product information (PMI)")  # fmt: skip
        self.root, self.where = root, where
        self.units, self.drawing = drawings.QifUnits(root, where), drawings.Drawing(PROGRAM)
        self.by_id = {element.get("id", ""): element for element in root.iter() if element.get("id")}
        # names of features that are read, by the number of their item, and of their nominal
        self.names: dict[str, str] = {}
        self.of_nominal: dict[str, str] = {}

    def read(self) -> drawings.Drawing:
        """Features first: characteristics name them."""
        planned = list(self._all("FeatureItem"))
        labels = {} if planned else self._asked()
        for item in planned or [one for one in self._all("FeatureNominal") if one.get("id", "") in labels]:
            self._named(item, "feature", self._feature, labels.get(item.get("id", ""), ""))
        for item in self._all("CharacteristicItem" if planned else "CharacteristicNominal"):
            ids = listed(item.find("{*}FeatureNominalIds"))
            what = WHATS.get(local(item).removesuffix("CharacteristicNominal"))
            if planned or len(ids) < 2 or (what is not None and ASKS[what].features > 1):
                self._named(item, "characteristic", self._characteristic)
                continue
            for number in ids:  # a pattern of features: each of them
                one = copy(item)
                for group in [each for each in one if local(each) == "FeatureNominalIds"]:
                    one.remove(group)
                    SubElement(SubElement(one, "FeatureNominalIds"), "Id").text = number
                self._named(one, "characteristic", self._characteristic, f"{child(item, 'Name')} {number}".strip())
        return self.drawing

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
        pairs = element.find("{*}FeatureNominalPairs")
        return [*listed(element.find("{*}FeatureNominalIds")),
                *(number for pair in ([] if pairs is None else pairs) for number in listed(pair))]  # fmt: skip

    def _all(self, ending: str) -> Iterator[Element]:
        return (element for element in self.root.iter() if local(element).endswith(ending))

    def _referred(self, element: Element, name: str) -> Element:
        """The element to which another refers by a number."""
        found = self.by_id.get(child(element, name))
        if found is None:
            raise NotUnderstoodError(f"refers by {name} to nothing that is there")
        return found

    def _named(self, item: Element, what: str, read: Callable[[Element, str, str], Facts], name: str = "") -> None:
        """Read an item, or keep what of it is not understood."""
        number = item.get("id", "")
        name = name or child(item, "FeatureName") or child(item, "Name") or f"{what} {number}"
        place = f"{self.where}: {local(item)} id {number}"
        taken = self.drawing.features if what == "feature" else self.drawing.characteristics
        with self.drawing.understanding(name, place):
            if any(one["name"] == name for one in taken):
                raise NotUnderstoodError(f"is the name of two {what}s")
            taken.append(read(item, name, place))

    def _feature(self, item: Element, name: str, place: str) -> Facts:
        sort = local(item).removesuffix("FeatureItem").removesuffix("FeatureNominal")
        if sort not in _KINDS:
            raise NotUnderstoodError(f"is a feature of kind {sort}, which is not read")
        if any(local(element) == "FromScan" and text(element) != "false" for element in item.iter()):
            raise NotUnderstoodError(refused.SCANNED)
        if item.find("{*}DeterminationMode/{*}Set") is not None:
            raise NotUnderstoodError("is set, not measured")
        if any(local(element) == "Constructed" for element in item.iter()):
            raise NotUnderstoodError("is constructed of other features, which is not read")
        nominal = item if local(item).endswith("FeatureNominal") else self._referred(item, "FeatureNominalId")
        definition = self._referred(nominal, "FeatureDefinitionId")
        if any(one.find("{*}PointList") is not None for one in (item, nominal)):
            raise NotUnderstoodError("has a list of points of its own (PointList), which is not read")
        found: Facts = {"name": name, "kind": sort.lower()}
        said = (one.find("{*}SubstituteFeatureAlgorithm") for one in (item, nominal))
        if (algorithm := next((each for each in said if each is not None), None)) is not None:
            if (word := whole_text(algorithm)) not in ASSOCIATIONS:
                raise NotUnderstoodError(f"is to be associated by {word}, which is not read")
            found["association"] = ASSOCIATIONS[word]
        found |= self._nominal(sort.lower(), nominal, definition, place)
        self._between_its_ends(found, nominal, definition)
        self.names[item.get("id", "")] = self.of_nominal[nominal.get("id", "")] = name
        return self._probed(found)

    def _nominal(self, kind: str, nominal: Element, definition: Element, place: str) -> Facts:
        axis = nominal.find("{*}Axis") if kind in ("cylinder", "cone") else nominal
        if axis is None:
            raise NotUnderstoodError("has no axis")
        point = axis.find("{*}Location" if axis is nominal else "{*}AxisPoint")
        found: Facts = {"point_mm": self.units.place(point, place)}
        if kind != "sphere":
            key = "Normal" if kind in ("plane", "circle", "point") else "Direction"
            found["direction"] = _direction(axis, key, place)
        if kind == "line":
            found["normal"] = _direction(nominal, "Normal", place)
        if kind in refused.ROUND:
            if (diameter := definition.find("{*}Diameter")) is None:
                raise NotUnderstoodError("does not say its Diameter")
            found["diameter_mm"], side = self.units.mm(diameter), child(definition, "InternalExternal")
            if side not in ("INTERNAL", "EXTERNAL"):
                raise NotUnderstoodError("does not say whether it is a hole or a shaft")
            found["inner"] = side == "INTERNAL"
        if kind == "cone":
            half, whole = definition.find("{*}HalfAngle"), definition.find("{*}FullAngle")
            angle = half if half is not None else whole
            if angle is None:
                raise NotUnderstoodError("does not say its angle")
            found["angle_deg"] = self.units.degrees(angle) * (1 if half is None else 2)
        return found

    def _between_its_ends(self, found: Facts, nominal: Element, definition: Element) -> None:
        """Put the point of a line, cylinder or cone from its start, or from anywhere on its axis, to its middle.

        A cone without a small end ends at its tip. A length that is not said is an example.
        """
        kind = found["kind"]
        if kind not in ("line", "cylinder", "cone"):
            return
        length = (nominal if kind == "line" else definition).find(
            "{*}LargeEndDistance" if kind == "cone" else "{*}Length"
        )
        start, slope = 0.0, math.tan(math.radians(found["angle_deg"] / 2)) if kind == "cone" else 0.0
        if slope and length is not None:
            small = definition.find("{*}SmallEndDistance")
            start = self.units.mm(small) if small is not None else -0.5 * found["diameter_mm"] / slope
        if length is None:
            self.drawing.open_keys[found["name"]] = ["length_mm", "point_mm"]
        end = self.units.mm(length) if length is not None else found.get("diameter_mm", _LENGTH_MM) / 2
        middle = 0.5 * (start + end)
        way = middle / (math.hypot(*found["direction"]) or 1.0)
        found["length_mm"] = end - start
        found["point_mm"] = [a + way * b for a, b in zip(found["point_mm"], found["direction"], strict=True)]
        if slope:
            found["diameter_mm"] += 2 * slope * middle

    def _probed(self, found: Facts) -> Facts:
        """With what the file leaves open."""
        if found["kind"] == "point":
            return found
        opened = ["strategy"]
        if found["kind"] == "plane":
            found |= {"length_mm": _LENGTH_MM, "width_mm": _LENGTH_MM}
            opened += ["length_mm", "width_mm"]
        self.drawing.open_keys[found["name"]] = [*opened, *self.drawing.open_keys.get(found["name"], ())]
        return found | {"strategy": drawings.usual_strategy(found["kind"])}

    def _characteristic(self, item: Element, name: str, place: str) -> Facts:
        sort = local(item).removesuffix("CharacteristicItem").removesuffix("CharacteristicNominal")
        alone = local(item).endswith("CharacteristicNominal")
        nominal = item if alone else self._referred(item, "CharacteristicNominalId")
        definition = self._referred(nominal, "CharacteristicDefinitionId")
        what = self._what(sort, nominal)
        features = self._features(item, what)
        kinds = [one["kind"] for one in self.drawing.features if one["name"] in features]
        for kind in kinds:
            drawings.refuse_other_kind(what, kind)
        found: Facts = {"name": name, "what": what, "features": features}
        zone = definition.find("{*}ZoneShape")
        for element in (definition, nominal, item, *([] if zone is None else zone)):
            _refuse_besides(element)
        if (condition := child(definition, "MaterialCondition")) not in _PLAIN:
            raise NotUnderstoodError(f"holds at {condition.lower()} material condition, which is not modelled")
        usual = "DiametricalZone" if kinds[:1] and kinds[0] in ("circle", "cylinder", "cone", "line") else "PlanarZone"
        shape = "" if zone is None or not len(zone) else local(zone[0])
        if shape and shape not in (("DiametricalZone", "SphericalZone") if what == "position" else (usual,)):
            raise NotUnderstoodError(f"has a tolerance zone of shape {shape}, which is not read")
        frame = None
        if child(definition, "DatumReferenceFrameId"):
            frame = self._referred(definition, "DatumReferenceFrameId")
        datums = self._datums(frame) if ASKS[what].datum_kinds and frame is not None else []
        if len(datums) < ASKS[what].datums:
            raise NotUnderstoodError("names no datum")
        if what == "angularity":
            for angle in (one.find("{*}Angle") for one in (nominal, definition)):
                self._refuse_other_angle(features[0], datums[0].split(BETWEEN)[0], angle)
        return found | ({"datums": datums} if datums else {}) | self._limits(what, nominal, definition)

    def _refuse_other_angle(self, feature: str, datum: str, angle: Element | None) -> None:
        """Refuse a basic angle that is not that of the nominal directions, its complement or its supplement."""
        at = {one["name"]: one["direction"] for one in self.drawing.features if "direction" in one}
        if angle is None or not {feature, datum} <= at.keys():
            return
        said, cosine = self.units.degrees(angle), abs(sum(a * b for a, b in zip(at[feature], at[datum], strict=True)))
        stand, folded = math.degrees(math.acos(min(cosine, 1.0))), abs((said + 90) % 180 - 90)
        if min(abs(stand - folded), abs(90 - stand - folded)) > _ANGLE_DEG:
            raise NotUnderstoodError(f"is an angularity of {said:g}°, and its nominal features stand at {stand:.4g}°")

    def _what(self, sort: str, nominal: Element) -> What:
        if sort == "LinearCoordinate":
            if child(nominal, "CoordinateSystemId"):
                raise NotUnderstoodError("is a coordinate in a system of its own, which is not read")
            axis = child(nominal, "Direction")
            axes: Mapping[str, What] = {"XAXIS": "x", "YAXIS": "y", "ZAXIS": "z"}
            if axis not in axes:
                raise NotUnderstoodError(f"is a coordinate along {axis or 'no axis'}, which is not read")
            return axes[axis]
        if sort not in WHATS:
            raise NotUnderstoodError(_SORTS.get(sort) or f"is a characteristic of kind {sort}, which is not read")
        mode = child(nominal, "AnalysisMode")
        if mode not in ("", "THREEDIMENSIONAL"):
            raise NotUnderstoodError(f"is {with_article(WHATS[sort])} in the analysis {mode}, which is not read")
        return WHATS[sort]

    def _features(self, item: Element, what: What) -> list[str]:
        numbers = listed(item.find("{*}FeatureItemIds")) or self._numbers(item)
        if len(numbers) != ASKS[what].features:
            raise NotUnderstoodError(f"is a {what} of {len(numbers) or 'no'} features")
        for number in numbers:
            if number not in self.names:
                of = self.by_id.get(number)
                unread = number if of is None else child(of, "FeatureName") or number
                raise NotUnderstoodError(f"is of the feature {unread!r}, which is not read")
        return [self.names[number] for number in numbers]

    def _limits(self, what: What, nominal: Element, definition: Element) -> Facts:
        if ASKS[what].limits == "zone":
            width = definition.find("{*}ToleranceValue")
            if width is None or self.units.mm(width, pmi=True) <= 0:
                raise NotUnderstoodError("has no tolerance above 0")
            return {"tolerance_mm": self.units.mm(width, pmi=True)}
        tolerance = definition.find("{*}Tolerance")
        if tolerance is None or child(
            definition, "DimensionType"
        ):  # exact by theory, set, or for reference: not toleranced
            return {}
        value = self.units.degrees if ASKS[what].limits == "angles" else self.units.mm
        low, high = tolerance.find("{*}MinValue"), tolerance.find("{*}MaxValue")
        if low is None or high is None:
            raise NotUnderstoodError("has a tolerance without two limits, which is not read")
        target, about = nominal.find("{*}TargetValue"), 0.0
        if child(tolerance, "DefinedAsLimit") != "true":
            if target is None:
                raise NotUnderstoodError("has limits about a value that is not there")
            about = value(target, pmi=True)
        return drawings.limits(what, about + value(low, pmi=True), about + value(high, pmi=True))

    def _datums(self, frame: Element) -> list[str]:
        """Names of the features of a datum reference frame, in order of precedence; hyphens between those of a common one."""
        listed = [each for group in frame for each in (group if local(group) == "Datums" else (group,))]
        found = []
        order = {word: i for i, word in enumerate(("PRIMARY", "SECONDARY", "TERTIARY"))}
        datums = [each for each in listed if local(each) == "Datum"]
        for datum in sorted(datums, key=lambda one: order.get(whole_text(one.find("{*}Precedence")), len(order))):
            common = datum.find("{*}CompoundDatum")
            parts = [datum]
            if common is not None:
                _refuse_besides(common)
                parts = [each for each in common if local(each) == "Datum"]
            found.append(BETWEEN.join(map(self._datum, parts)))
        return found

    def _datum(self, datum: Element) -> str:
        simple = datum.find("{*}SimpleDatum")
        if simple is None:
            raise NotUnderstoodError("has a datum of a kind that is not read")
        _refuse_besides(simple)
        if (condition := child(simple, "MaterialModifier")) not in _PLAIN:
            raise NotUnderstoodError(f"has a datum at {condition.lower()} material condition, which is not modelled")
        definition = self._referred(simple, "DatumDefinitionId")
        label = child(definition, "DatumLabel")
        if definition.find("{*}DatumTargetIds") is not None:
            raise NotUnderstoodError(f"is about the datum {label} on datum targets, which are not read")
        named = listed(definition.find("{*}FeatureNominalIds"))
        if named and all(number in self.of_nominal for number in named):
            return BETWEEN.join(self.of_nominal[number] for number in named)
        pattern = re.compile(rf"(datum[ _-]?)?{re.escape(label)}", re.IGNORECASE)
        same = [str(one["name"]) for one in self.drawing.features if pattern.fullmatch(one["name"])]
        if named or len(same) != 1:
            raise NotUnderstoodError(f"is about the datum {label}, which names no feature that is read")
        return same[0]


def _refuse_besides(element: Element) -> None:
    """Refuse what a characteristic, its definition, zone or nominal, or a datum says besides what is read of it."""
    for inner in element:
        name = local(inner)
        if name in _READ or whole_text(inner) == "false":
            continue
        per_unit = "is toleranced per unit of length or area, which is not modelled" if "PerUnit" in name else ""
        raise NotUnderstoodError(_NAMED.get(name) or per_unit or f"says {name}, which is not read")
