"""DMIS part programs (ISO 22093): nominal features with the points at which they are measured, tolerances, datums, styli.

Read are ``F(…)=FEAT/…`` in Cartesian coordinates, measured by ``MEAS`` with ``PTMEAS``; ``T(…)=TOL/…`` that ``OUTPUT`` or
``EVAL`` gives to a feature; ``DATDEF``; styli by ``SNSDEF/PROBE``; and the frames of the program (``DATSET``, ``TRANS``,
``ROTATE``), which are followed by their nominals, so that all stands in the frame of the first feature. Motion and machine
settings say nothing of a plan and are passed over.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np

from cmm_uq.base.errors import CmmUqError
from cmm_uq.jobs.importing.cells.encodings import report_lines
from cmm_uq.jobs.importing.reports import statements
from cmm_uq.jobs.part import drawing as drawings, feature as refused
from cmm_uq.jobs.part.checks import BETWEEN
from cmm_uq.jobs.part.drawing import Drawing, Facts, NotUnderstoodError, numbers_of, reference, words_of
from cmm_uq.jobs.part.feature import ASKS, What

MILLIMETRES = {"MM": 1.0, "CM": 10.0, "M": 1000.0, "INCH": 25.4, "FEET": 304.8}
DEGREES = {"ANGDEC": 1.0, "ANGRAD": math.degrees(1.0)}
KINDS = {name.upper(): name for name in ("point", "line", "plane", "circle", "sphere")} | {"CYLNDR": "cylinder"}
# that a feature has at least: its place, its direction, its diameter
NUMBERS = {"point": 6, "line": 9, "plane": 6, "circle": 7, "sphere": 4, "cylinder": 7}

# first words of statements that say nothing of what is measured, or that are read elsewhere
PASSED = frozenset(drawings.PROGRAMS["dmis"]["passed"].split())

_TOLERANCES: Mapping[str, What] = drawings.PROGRAMS["dmis"]["tolerances"]

# words that change what a tolerance means, refused in words of their own
_REFUSED: Mapping[str, str] = {
    "PROFL": refused.LINE_PROFILE, "PROFS": refused.SURFACE_PROFILE, "PROFP": refused.POINT_PROFILE,
    "MMC": refused.MAXIMUM_MATERIAL, "LMC": refused.LEAST_MATERIAL, "LP": refused.TWO_POINT, "FREE": refused.FREE_STATE,
    "PROJ": refused.PROJECTED,
}  # fmt: skip
_PLAIN = ("RFS", "2D", "3D")  # words that leave a tolerance as it is, or say what its feature says already


def toleranced(words: list[str], feature: Facts, millimetres: float, datums: Mapping[str, str]) -> Facts:
    """Keys of the characteristic that a tolerance is of a feature, but its name."""
    sort = words[0].upper() if words else ""
    if sort not in _TOLERANCES:
        raise NotUnderstoodError(_REFUSED.get(sort) or f"is a tolerance {sort or 'of no kind'}, which is not read")
    what, kind = _TOLERANCES[sort], feature["kind"]
    drawings.refuse_other_kind(what, kind)
    plain = [word.upper() for word in words[1:] if not reference(word)[0]]
    if why := next((_REFUSED[word] for word in plain if word in _REFUSED), None):
        raise NotUnderstoodError(why)
    number = numbers_of([word for word in plain if word not in _PLAIN])
    if len(number) > (2 if what == "size" else 1):
        raise NotUnderstoodError("has further numbers, as of a zone for each length or area, which are not read")
    if what == "size":
        if len(number) < 2:
            raise NotUnderstoodError("has a diameter without two limits, which is not read")
        low, high = (feature["diameter_mm"] + millimetres * limit for limit in number[:2])
        return {"what": what, "features": [feature["name"]], **drawings.limits(what, low, high)}
    if what == "position" and ("3D" in plain) != (kind in ("point", "sphere")):
        said = "3D" if "3D" in plain else "2D"
        raise NotUnderstoodError(f"is a position in {said} of a {kind}, which is not read")
    if not number or number[0] <= 0:
        raise NotUnderstoodError("is a tolerance of 0, which nothing conforms with")
    about = [_datum(name, datums) for of, name in map(reference, words[1:]) if of in ("DAT", "FA")]
    if len(about) < ASKS[what].datums:
        raise NotUnderstoodError("names no datum")
    if about and not ASKS[what].datum_kinds:
        raise NotUnderstoodError(f"is a {what} with a datum, which has none")
    named = {"datums": about} if about else {}
    return {"what": what, "features": [feature["name"]], **named, "tolerance_mm": millimetres * number[0]}


def _datum(label: str, datums: Mapping[str, str]) -> str:
    if label in datums:
        return datums[label]
    if label in datums.values():
        return label
    parts = label.split(BETWEEN)
    if len(parts) > 1:
        return BETWEEN.join(_datum(each.strip(), datums) for each in parts)
    raise NotUnderstoodError(f"is about the datum {label}, which is no feature that is read")


PROGRAM = "DMIS program"
STATEMENT = re.compile(r"^\s*(?:\w+\s*\([^)]*\)\s*=\s*)?[A-Z]{4,6}\s*/", re.MULTILINE)
"""Of a text that is a program: a statement of the language, such as UNITS/MM or F(BORE)=FEAT/…"""
_LABELLED = re.compile(r"^(?P<of>\w+)\s*\((?P<name>[^)]*)\)\s*=\s*(?P<major>\w+)\s*/\s*(?P<rest>.*)$")
_UNLABELLED = re.compile(r"^(?P<major>\w+)\s*(?:/\s*(?P<rest>.*))?$")


def drawing_of_dmis(content: bytes, where: str) -> Drawing:
    said = statements(report_lines(content, where)[0], where)
    return _Program(where).whole([(line, statement.partition("$$")[0].strip()) for line, statement in said])


class _Program:
    def __init__(self, where: str) -> None:
        self.where = self.place = where
        self.line, self.drawing, self.frame = 0, Drawing(PROGRAM), drawings.DmisFrame()
        self.nominal: dict[str, Facts] = {}
        self.tolerances: dict[str, tuple[int, list[str]]] = {}
        self.datums: dict[str, str] = {}
        self.styli: dict[str, Facts] = {}
        self.mount, self.stylus, self.unit = np.zeros(3), "", False
        self.measuring: tuple[str, list[list[float]]] | None = None
        # line, features and tolerance of each output, with what the tolerance and the datums were at that line
        self.given: list[tuple[int, list[str], str, tuple[int, list[str]] | None, dict[str, str]]] = []
        self.scanning, self.scanned = False, set[str]()
        self.read: Mapping[str, Callable[[list[str]], None]] = {
            "SCNMOD": self._scanning, "PAMEAS": self._scanned, "UNITS": self._units, "SNSMNT": self._mounted,
            "SNSLCT": self._selected, "MEAS": self._begun, "PTMEAS": self._point, "ENDMES": self._ended,
            "DATDEF": self._datum, "OUTPUT": self._output, "EVAL": self._output, "CONST": self._constructed,
        }  # fmt: skip

    def whole(self, said: list[tuple[int, str]]) -> Drawing:
        for self.line, statement in said:
            if statement:
                self._one(statement)
        if not self.unit and (self.nominal or self.tolerances):
            fix = "Say it before the first feature: UNITS/MM, ANGDEC"
            raise CmmUqError("the program does not say its unit", where=self.where, fix=fix)
        for one in self.given:
            self._characteristic(*one)
        self._left_over()
        used = dict.fromkeys(one["stylus"] for one in self.drawing.features)
        self.drawing.styli = [self.styli[name] for name in used if name in self.styli]
        self.drawing.datums = list(dict.fromkeys(self.datums.values()))
        return self.drawing

    def _one(self, statement: str) -> None:
        labelled, plain = _LABELLED.match(statement), _UNLABELLED.match(statement)
        self.place = f"{self.where} line {self.line}"
        with self.drawing.understanding(labelled["name"].strip() if labelled else statement[:60], self.place):
            if labelled:
                self._labelled(labelled)
                return
            if plain is None:
                raise NotUnderstoodError("is no statement of DMIS that is read")
            major = plain["major"].upper()
            if major == "RECALL":
                self._frame(major, words_of(plain["rest"] or ""))
            elif major in self.read:
                self.read[major](words_of(plain["rest"] or ""))
            elif major not in PASSED:
                raise NotUnderstoodError(f"is a statement {major}, which is not read")

    def _labelled(self, found: re.Match[str]) -> None:
        of, name, major = found["of"].upper(), found["name"].strip(), found["major"].upper()
        words = words_of(found["rest"])
        if of == "F" and major == "FEAT":
            self.nominal[name] = self._feature(name, words)
        elif of == "T" and major == "TOL":
            self.tolerances[name] = (self.line, words)
        elif of == "S" and major == "SNSDEF":
            self.styli[name] = self._stylus(name, words)
        elif of == "D":
            self._frame(major, words)
        elif of not in PASSED and major not in PASSED:
            raise NotUnderstoodError(f"is a statement {of}(…)={major}/, which is not read")

    def _unknown(self, name: str, why: str, place: str = "") -> None:
        self.drawing.unknown.append(drawings.NotUnderstood(name, why, place or self.place))

    def _units(self, words: list[str]) -> None:
        length, angle = (*words, "ANGDEC")[:2]
        if length.upper() not in MILLIMETRES or angle.upper() not in DEGREES:
            raise CmmUqError(f"UNITS/{','.join(words)} is not read", where=self.place,
                             fix=f"Write it in {', '.join(MILLIMETRES)} and {' or '.join(DEGREES)}")  # fmt: skip
        if self.nominal or self.tolerances:
            said = "the unit changes after features or tolerances were defined"
            raise CmmUqError(said, where=self.place, fix="Say UNITS once, at first")
        self.unit = True
        self.frame = replace(self.frame, millimetres=MILLIMETRES[length.upper()], degrees=DEGREES[angle.upper()])

    def _feature(self, name: str, words: list[str]) -> Facts:
        sort = words[0].upper() if words else ""
        if sort not in KINDS:
            raise NotUnderstoodError(f"is a feature {sort or 'of no kind'}, which is not read")
        kind, said = KINDS[sort], [word.upper() for word in words[1:]]
        sides = [word for word in said if word in ("INNER", "OUTER", "BND", "UNBND")]
        if "CART" not in said:
            raise NotUnderstoodError("is not given in Cartesian coordinates, which alone are read")
        number = numbers_of([word for word in words[1:] if word.upper() not in (*sides, "CART")])
        if "BND" in sides:
            raise NotUnderstoodError("is a line with ends (BND), which is not read")
        if len(number) < NUMBERS[kind]:
            raise NotUnderstoodError(f"has {len(number)} of the {NUMBERS[kind]} numbers that a {kind} has")
        found: Facts = {"name": name, "kind": kind, "point_mm": self.frame.place(number[:3])}
        if kind != "sphere":
            found["direction"] = self.frame.vector(number[3:6])
        if kind == "line":
            found["normal"] = self.frame.vector(number[6:9])
        if kind in ("circle", "sphere", "cylinder"):
            found["diameter_mm"] = self.frame.millimetres * number[3 if kind == "sphere" else 6]
            if not {"INNER", "OUTER"} & set(sides):
                raise NotUnderstoodError("does not say INNER or OUTER")
            found["inner"] = "INNER" in sides
        return found

    def _stylus(self, name: str, words: list[str]) -> Facts:
        """``SNSDEF/PROBE, …, i, j, k, length, diameter``: the tip stands along i, j, k from where the probe is mounted."""
        if not words or words[0].upper() != "PROBE":
            raise NotUnderstoodError(f"is a sensor {words[0] if words else ''}, which is not read")
        number = numbers_of([word for word in words if not word[:1].isalpha()])
        if len(number) < 5:
            raise NotUnderstoodError("does not give direction, length and diameter of its tip")
        if any(number[:-5]):
            raise NotUnderstoodError("is turned by the angles of a wrist, which is not read")
        *along, length, diameter = number[-5:]
        offset = self.mount + self.frame.millimetres * length * np.array(along)
        return {"name": name, "diameter_mm": self.frame.millimetres * diameter, "offset_mm": offset.tolist()}

    def _mounted(self, words: list[str]) -> None:
        upper = [word.upper() for word in words]
        if "MNTLEN" in upper:
            number = numbers_of(words[upper.index("MNTLEN") + 1 :][:3])
            self.mount = self.frame.millimetres * np.array((*number, 0.0, 0.0, 0.0)[:3])

    def _selected(self, words: list[str]) -> None:
        self.stylus = name = reference(words[0] if words else "")[1]
        if name not in self.styli:
            self.styli[name] = {"name": name, "diameter_mm": 0.0}
            why = f"selects {name!r}, which this program does not define: its tip is taken as a point"
            raise NotUnderstoodError(why)

    def _scanning(self, words: list[str]) -> None:
        self.scanning = bool(words) and words[0].upper() == "ON"

    def _scanned(self, words: list[str]) -> None:
        if self.measuring is not None:
            self.scanned.add(self.measuring[0])

    def _begun(self, words: list[str]) -> None:
        _, name = reference(words[1] if len(words) > 1 else "")
        if name not in self.nominal:
            raise NotUnderstoodError(f"measures {name!r}, which is not read")
        if not self.stylus:
            self.stylus = "stylus"
            self.styli[self.stylus] = {"name": self.stylus, "diameter_mm": 0.0}
            self._unknown("stylus", "is not said: its tip is taken as a point")
        self.measuring = (name, [])

    def _point(self, words: list[str]) -> None:
        if self.measuring is None:
            return
        if not words or words[0].upper() != "CART":
            raise NotUnderstoodError("is a point that is not given in Cartesian coordinates")
        self.measuring[1].append(self.frame.place(numbers_of(words[1:4])))

    def _ended(self, words: list[str]) -> None:
        if self.measuring is None:
            return
        (name, points), self.measuring = self.measuring, None
        if name in self.scanned or self.scanning:
            self._unknown(name, refused.SCANNED)
            return
        found: Facts = {**self.nominal[name], "stylus": self.stylus}
        if found["kind"] == "point":
            found["point_mm"] = points[0] if points else found["point_mm"]
        elif points:
            found["points_mm"] = points
        else:
            found["strategy"] = drawings.usual_strategy(found["kind"])
            if found["kind"] == "plane":
                found |= {"length_mm": 20.0, "width_mm": 20.0}
            elif found["kind"] in ("line", "cylinder"):
                found["length_mm"] = found.get("diameter_mm", 20.0) / 2
            self.drawing.open_keys[name] = ["strategy", "length_mm", "width_mm"]
        if any(one["name"] == name for one in self.drawing.features):
            raise NotUnderstoodError(f"measures {name!r} a second time, which is not read")
        self.drawing.features.append(found)

    def _datum(self, words: list[str]) -> None:
        features, labels = _named(words, "FA", "F"), _named(words, "DAT")
        if len(labels) == 1 and len(features) > 1:
            features = [BETWEEN.join(features)]
        self.datums |= dict(zip(labels, features, strict=False))

    def _constructed(self, words: list[str]) -> None:
        name = reference(words[1] if len(words) > 1 else "")[1]
        self._unknown(name, "is constructed of other features, which is not read")

    def _output(self, words: list[str]) -> None:
        of = _named(words, "FA", "F")
        for name in _named(words, "TA", "T") if of else ():
            self.given.append((self.line, of, name, self.tolerances.get(name), dict(self.datums)))

    def _characteristic(
        self, line: int, of: list[str], tolerance: str, there: tuple[int, list[str]] | None, datums: dict[str, str]
    ) -> None:
        features = {one["name"]: one for one in self.drawing.features}
        defined, feature = there or self.tolerances.get(tolerance), of[0]
        place = f"{self.where} line {defined[0] if defined and feature in features else line}"
        with self.drawing.understanding(tolerance, place):
            if defined is None:
                raise NotUnderstoodError("is a tolerance that is not defined")
            if len(of) > 1:
                raise NotUnderstoodError(f"is a tolerance of {' and '.join(of)} together, which is not read")
            if feature not in features:
                raise NotUnderstoodError(f"is a tolerance of {feature!r}, which is not read")
            known = {**self.datums, **datums}
            known = {label: name for label, name in known.items() if drawings.all_there([name], features)}
            found = toleranced(defined[1], features[feature], self.frame.millimetres, known)
            same = [one["name"] for one in self.drawing.characteristics]
            name = tolerance if tolerance not in same else f"{tolerance} {feature}"
            self.drawing.characteristics.append({"name": name, **found})

    def _left_over(self) -> None:
        """Features that are never measured, and tolerances that are never given to a feature."""
        told = {one.name for one in self.drawing.unknown} | {one["name"] for one in self.drawing.features}
        for name in self.nominal:
            if name not in told:
                self._unknown(name, "is a feature that is not measured", self.where)
        given = {tolerance for _, _, tolerance, *_ in self.given}
        for name, (line, _) in self.tolerances.items():
            if name not in given:
                self._unknown(name, "is a tolerance without a feature", f"{self.where} line {line}")

    def _frame(self, major: str, words: list[str]) -> None:
        """Follow a change of frame; before the first feature it is the machine's, and places the part."""
        label = reference(words[0])[1] if words else ""
        try:
            self.frame = self.frame.changed(major, words, self.nominal, self.datums.get(label, label))
        except NotUnderstoodError as error:
            said = f"a frame {error}, which is not read: what follows would stand in no frame"
            fix = "Write the program with all its features in one frame"
            raise CmmUqError(said, where=self.place, fix=fix) from None
        if not self.nominal:
            self.frame = replace(self.frame, axes=np.eye(3), origin=np.zeros(3))


def _named(words: list[str], *of: str) -> list[str]:
    """Names to which words refer that are of these sorts."""
    return [name for sort, name in map(reference, words) if sort in of]
