"""What another program's plan asks for, as tables of a part's job; what is not understood of it is refused by name.

A plan is read once, when a job is begun: features, characteristics, styli and alignment become tables that anybody can
read and correct. What such a file leaves open (how a feature is probed, how long it is) stands there as an example.


Units of a QIF document and frames of a DMIS program say what their numbers are in mm in the frame of the part.
"""

from __future__ import annotations

import math
import re
import tomllib
from collections.abc import Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any
from xml.etree.ElementTree import Element

import numpy as np
from pydantic import ValidationError

from cmm_uq.base.errors import CmmUqError, Gathered, suggestion
from cmm_uq.base.points import AXES, Floats
from cmm_uq.base.values import dataclass, field, replace
from cmm_uq.jobs.importing.cells.encodings import local
from cmm_uq.jobs.importing.documents import child, length_unit, three
from cmm_uq.jobs.importing.format import UNITS, length_named
from cmm_uq.jobs.part.checks import members, unfit
from cmm_uq.jobs.part.feature import ASKS, CharacteristicFacts, FeatureFacts, What
from cmm_uq.jobs.part.probed import Probed, probed

Facts = dict[str, Any]
PROGRAMS = tomllib.loads(Path(__file__).with_name("programs.toml").read_text(encoding="utf-8"))
_DIGITS = 9  # decimals of a place or limit: a picometre, which the sum of a size and a deviation keeps
_TOLD = 3  # reasons that are told where nothing is left
ALL = "*"  # in place of names: everything that is not understood
KEY = "[part] not_measured"


class NotUnderstoodError(Exception):
    """What of a feature, a characteristic or a statement is not understood, to follow its name."""


@dataclass(frozen=True)
class NotUnderstood:
    name: str  # of the feature or characteristic, or of the statement
    why: str  # what of it is not understood, to follow its name
    where: str  # file and line


@dataclass
class Drawing:
    program: str  # format that it was read from
    # features, characteristics, styli: tables, in order
    features: list[Facts] = field(default_factory=list)
    characteristics: list[Facts] = field(default_factory=list)
    styli: list[Facts] = field(default_factory=list)
    datums: list[str] = field(default_factory=list)  # names of features, of the alignment
    unknown: list[NotUnderstood] = field(default_factory=list)  # what was not understood
    # by the name of a feature, keys that the file leaves open, whose values are examples
    open_keys: dict[str, list[str]] = field(default_factory=dict)

    @contextmanager
    def understanding(self, name: str, where: str) -> Iterator[None]:
        """Keep what is not understood of something, by its name, and go on."""
        try:
            yield
        except NotUnderstoodError as error:
            self.unknown.append(NotUnderstood(name, str(error), where))

    def settled(self, without: Sequence[str], where: str) -> list[str]:
        """Names of what is left out knowingly.

        ``without``: names that may be left out, or :data:`ALL`.
        """
        wrong, every = Gathered(), (*self.features, *self.characteristics)
        for one in self.unknown:
            if ALL not in without and one.name not in without:
                ways = f"--set part.not_measured='[\"{one.name}\"]', or '[\"{ALL}\"]' for all of these"
                wrong.tell(f"{one.name!r} {one.why}", where=one.where, fix=f"Leave it out knowingly: {ways}")
        named = {*(one.name for one in self.unknown), *(one["name"] for one in every)}
        for name in without:
            if name not in (ALL, *named):
                wrong.tell(f"has nothing named {name!r}", where=where, fix=suggestion(name, named))
        wrong.refuse()
        for table in (self.features, self.characteristics):
            table[:] = [one for one in table if one["name"] not in without]
        there = {one["name"] for one in self.features}
        for asked in list(self.characteristics):
            if not (there.issuperset(asked["features"]) and all_there(asked.get("datums", ()), there)):
                self.characteristics.remove(asked)
                self.unknown.append(NotUnderstood(asked["name"], "is of a feature that was left out", ""))
        self.datums[:] = self.datums if all_there(self.datums, there) else []
        for table, what in ((self.features, "feature"), (self.characteristics, "tolerance")):
            if not table:
                why = "; ".join(f"{one.name!r} {one.why}" for one in self.unknown[:_TOLD])
                problem = f"holds no {what} that is understood{why and f': {why}'}"
                raise CmmUqError(problem, where=where, fix="Write the job by hand: cmm-uq new part")
        return list(dict.fromkeys([*(one.name for one in self.unknown), *(name for name in without if name != ALL)]))


def all_there(datums: Sequence[str], features: Collection[str]) -> bool:
    """Whether all features of datums are there, of common ones too."""
    try:
        return all(members(name, features) for name in datums)
    except CmmUqError:
        return False


def limits(what: str, low: float, high: float) -> Facts:
    """Keys of two limits of a size, distance or coordinate, or of an angle in degrees."""
    unit = "deg" if what == "angle" else "mm"
    return {f"lower_{unit}": round(low, _DIGITS), f"upper_{unit}": round(high, _DIGITS)}


def refuse_other_kind(what: What, kind: str) -> None:
    """Refuse a characteristic of a feature that has none of the kind."""
    if kind not in ASKS[what].kinds:
        raise NotUnderstoodError(f"is a {what} of a {kind}, which is not read")


# points where nothing is said; 25 of a sphere as in ISO 10360-5
_USUAL: Mapping[str, int] = {"line": 5, "plane": 12, "circle": 12, "sphere": 25, "cylinder": 24, "cone": 24}


def usual_strategy(kind: str, count: int | None = None) -> Facts:
    """How a feature is probed where its plan does not say it."""
    if kind == "cylinder" and not count:
        return {"pattern": "sections", "sections": 3, "points": 8}
    return {"pattern": "points", "points": count or _USUAL[kind]}


def probed_of(given: Mapping[str, Any]) -> Probed:
    """A feature's table with its contact points."""
    where = f"feature {given['name']!r}"
    try:
        facts = FeatureFacts.model_validate(dict(given))
    except ValidationError as error:
        raise CmmUqError(_first(error), where=where) from None
    return probed(facts, where)


def set_aside_unsound(drawing: Drawing, where: str) -> None:
    """Move features and characteristics that the readers of a job would refuse to what is not understood."""
    features: dict[str, Probed] = {}

    def set_aside(table: list[Facts], given: Facts, problem: str) -> None:
        table.remove(given)
        drawing.unknown.append(NotUnderstood(given["name"], f"is refused as it stands: {problem}", where))

    for given in list(drawing.features):
        try:
            features[given["name"]] = probed_of(given)
        except CmmUqError as error:
            set_aside(drawing.features, given, error.problem)
    for given in list(drawing.characteristics):
        try:
            facts = CharacteristicFacts.model_validate(dict(given))
            named = [*facts.features, *(each for name in facts.datums for each in members(name, features))]
            if features.keys() >= set(named) and (found := unfit(facts, features)):
                set_aside(drawing.characteristics, given, found[0])
        except ValidationError as error:
            set_aside(drawing.characteristics, given, _first(error))
        except CmmUqError:  # of a feature that was set aside: told where features are left out
            continue


def _first(error: ValidationError) -> str:
    first = error.errors()[0]
    return ": ".join(filter(None, (".".join(map(str, first["loc"])), first["msg"].removeprefix("Value error, "))))


_METRE_MM = 1000.0
_LINEAR, _ANGULAR = "LinearUnit", "AngularUnit"
Nominals = Mapping[str, Mapping[str, Any]]  # features that were defined, by name, in the frame of the part
_REFERRED = re.compile(r"^(\w+)\s*\(([^)]*)\)$")
_SPLIT = re.compile(r",(?![^(]*\))")
_NONE = 1e-6  # length below which a vector has no direction


def number_of(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        raise NotUnderstoodError(f"has {text!r} where a number belongs") from None


def text(element: Element) -> str:
    return (element.text or "").strip()


def whole_text(element: Element | None) -> str:
    return "" if element is None else "".join(element.itertext()).strip()


def listed(element: Element | None) -> list[str]:
    """Numbers of elements that a list of them names."""
    return [] if element is None else [text(one) for one in element]


class QifUnits:
    """What a number of a document is in mm and degrees."""

    def __init__(self, root: Element, where: str) -> None:
        unit = length_unit(root, where)
        if unit is None:
            linked = root.find("{*}ExternalQIFReferences") is not None
            also = ", and refers to other QIF documents, which are not read" if linked else ""
            fix = "Export one document with everything in it" if linked else "Export the plan with FileUnits"
            raise CmmUqError(f"does not say its unit of length{also}", where=where, fix=fix)
        name = UNITS[unit.casefold()]
        units = next((element for element in root.iter() if local(element) == "FileUnits"), root)
        primary = units.find("{*}PrimaryUnits")
        try:  # factors, in metres or radians
            sorts = (
                (each, sort) for each in units.iter() for sort in (_LINEAR, _ANGULAR) if local(each).endswith(sort)
            )
            self._named = {(sort, child(each, "UnitName")): _factor(each) for each, sort in sorts}
            own = {local(each): _factor(each) for each in ([] if primary is None else primary)}
        except NotUnderstoodError as error:
            raise CmmUqError(f"a unit {error}", where=f"{where}: FileUnits", fix="Export the plan again") from None
        self._usual = {_LINEAR: name.up / name.down, _ANGULAR: math.degrees(1.0) * own.get(_ANGULAR, 1.0)}
        scales = ((_LINEAR, "PMILinearUnit", _METRE_MM), (_ANGULAR, "PMIAngularUnit", math.degrees(1.0)))
        self._pmi = {sort: scale * own[key] if key in own else self._usual[sort] for sort, key, scale in scales}

    def mm(self, element: Element, *, pmi: bool = False) -> float:
        return number_of(text(element)) * self._scale(element, _LINEAR, pmi=pmi)

    def degrees(self, element: Element, *, pmi: bool = False) -> float:
        return number_of(text(element)) * self._scale(element, _ANGULAR, pmi=pmi)

    def place(self, element: Element | None, where: str) -> list[float]:
        scale = self._usual[_LINEAR] if element is None else self._scale(element, _LINEAR, pmi=False)
        return [scale * number_of(word) for word in three("" if element is None else text(element), where)]

    def _scale(self, element: Element, sort: str, *, pmi: bool) -> float:
        unit = element.get("linearUnit" if sort == _LINEAR else "angularUnit", "")
        if not unit:
            return (self._pmi if pmi else self._usual)[sort]
        if sort == _LINEAR and (known := length_named(unit)) is not None:
            return known.up / known.down
        if (sort, unit) not in self._named:
            raise NotUnderstoodError(f"has the unit {unit!r}, which the document does not explain")
        factor = self._named[sort, unit]
        return _METRE_MM * factor if sort == _LINEAR else math.degrees(factor)


def _factor(unit: Element) -> float:
    return number_of(unit.findtext(".//{*}Factor") or "1")


@dataclass(frozen=True, eq=False)
class DmisFrame:
    """The frame in which a program speaks, in that of the part."""

    axes: Floats = field(default_factory=lambda: np.eye(3))  # (3, 3) unit vectors, a row each
    origin: Floats = field(default_factory=lambda: np.zeros(3))  # (3,) mm
    # millimetres, degrees: in the program's units of length and angle
    millimetres: float = 1.0
    degrees: float = 1.0

    def place(self, number: list[float]) -> list[float]:
        """A place that the program gives, in the frame of the part, mm."""
        if len(number) < 3:
            raise NotUnderstoodError("has fewer than three coordinates")
        found = self.origin + self.millimetres * np.array(number) @ self.axes
        return [float(value) for value in np.round(found, _DIGITS) + 0.0]

    def vector(self, number: list[float]) -> list[float]:
        """A direction that the program gives, in the frame of the part."""
        return [float(value) for value in np.round(np.array(number) @ self.axes, _DIGITS) + 0.0]

    def changed(self, major: str, words: list[str], nominal: Nominals, datum: str) -> DmisFrame:
        """The frame after ``D(…)=MAJOR/WORDS``."""
        if major == "DATSET":
            return self._set(words, nominal, datum)
        if major == "TRANS":
            return self._shifted(words, nominal)
        if major == "ROTATE":
            return self._turned(words, nominal)
        raise NotUnderstoodError(f"is {major}")

    def _set(self, words: list[str], nominal: Nominals, datum: str) -> DmisFrame:
        """One axis along the direction of a datum, by the shortest way."""
        if words and words[0].upper() == "MCS":
            if nominal:
                raise NotUnderstoodError("goes back to the machine's")
            return self
        if len(words) != 2:
            raise NotUnderstoodError("is by more than one datum")
        sign, axis = _axis(words[1], "DIR")
        wanted, own = sign * _direction(nominal, datum), self.axes[axis]
        (x, y, z), cosine = np.cross(own, wanted), float(own @ wanted)
        if cosine < _NONE - 1:
            raise NotUnderstoodError("is turned over by its datum, about no axis that is said")
        skew = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
        rotation = np.eye(3) + skew + skew @ skew / (1 + cosine)
        return replace(self, axes=self.axes @ rotation.T)

    def _shifted(self, words: list[str], nominal: Nominals) -> DmisFrame:
        if not words or len(words) % 2:
            raise NotUnderstoodError("is shifted without saying by what")
        origin = self.origin
        for key, value in zip(words[::2], words[1::2], strict=True):
            sign, axis = _axis(key, "ORIG")
            of, name = reference(value)
            if of and name not in nominal:
                raise NotUnderstoodError(f"is by {name!r}, which is not read")
            if of:
                along = float((np.array(nominal[name]["point_mm"]) - origin) @ self.axes[axis])
            else:
                along = sign * self.millimetres * numbers_of([value])[0]
            origin = origin + along * self.axes[axis]
        return replace(self, origin=origin)

    def _turned(self, words: list[str], nominal: Nominals) -> DmisFrame:
        """About one of its axes, by an angle or so that another axis lies along a feature."""
        if len(words) < 2:
            raise NotUnderstoodError("is turned without saying by what")
        _, about = _axis(words[0], "AXIS")
        first, second = (about + 1) % 3, (about + 2) % 3
        of, name = reference(words[1])
        if not of:
            angle = math.radians(self.degrees * numbers_of([words[1]])[0])
        else:
            sign, axis = _axis(words[2] if len(words) > 2 else "", "DIR")
            direction = sign * self.axes @ _direction(nominal, name)
            if axis == about or np.hypot(direction[first], direction[second]) < _NONE:
                raise NotUnderstoodError(f"is turned by {name!r}, which lies along the axis")
            angle = math.atan2(direction[second], direction[first]) - (0.0 if axis == first else math.pi / 2)
        axes = self.axes.copy()
        axes[first] = math.cos(angle) * self.axes[first] + math.sin(angle) * self.axes[second]
        axes[second] = math.cos(angle) * self.axes[second] - math.sin(angle) * self.axes[first]
        return replace(self, axes=axes)


def _direction(nominal: Nominals, name: str) -> Floats:
    direction = nominal.get(name, {}).get("direction")
    if direction is None:
        raise NotUnderstoodError(f"is by {name!r}, which has no direction")
    return np.asarray(np.array(direction) / np.linalg.norm(direction))


def words_of(text: str) -> list[str]:
    """What stands between commas."""
    return [word.strip() for word in _SPLIT.split(text)] if text.strip() else []


def reference(word: str) -> tuple[str, str]:
    """``FA(PLN1)`` as FA and PLN1; a plain word with nothing before it."""
    found = _REFERRED.match(word)
    return (found[1].upper(), found[2].strip()) if found else ("", word)


def numbers_of(words: list[str]) -> list[float]:
    try:
        found = [float(word) for word in words]
    except ValueError:
        found = [math.nan]
    if not all(map(math.isfinite, found)):
        raise NotUnderstoodError(f"has {', '.join(words)[:60]!r} where numbers belong, which is not read")
    return found


def _axis(word: str, ending: str) -> tuple[float, int]:
    """``-XDIR`` as −1 and 0."""
    found = re.fullmatch(rf"(-?)([XYZ]){ending}", word.upper())
    if found is None:
        raise NotUnderstoodError(f"says {word!r} where an axis belongs")
    return (-1.0 if found[1] else 1.0), AXES.index(found[2].lower())
