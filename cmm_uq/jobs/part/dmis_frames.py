"""The frames of a DMIS program by their nominals, and the words of its statements."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from cmm_uq.base.points import AXES, Floats
from cmm_uq.jobs.part.drawing import NotUnderstoodError

Nominals = Mapping[str, Mapping[str, Any]]  # features that were defined, by name, in the frame of the part
_REFERRED = re.compile(r"^(\w+)\s*\(([^)]*)\)$")
_SPLIT = re.compile(r",(?![^(]*\))")
_NONE = 1e-6  # length below which a vector has no direction
_DIGITS = 9  # decimals of a place, mm: a picometre


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
    """Numbers."""
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
