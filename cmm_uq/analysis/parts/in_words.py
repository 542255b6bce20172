"""Kinds of features and of characteristics, and the causes of the budget, in words."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from cmm_uq.analysis.parts.budget import PLACE
from cmm_uq.analysis.parts.causes.form import FORM
from cmm_uq.analysis.parts.causes.machine import MACHINE, NOISE
from cmm_uq.analysis.parts.causes.stylus import STYLUS
from cmm_uq.analysis.parts.causes.surroundings import TEMPERATURE
from cmm_uq.analysis.parts.plan import FeatureKind
from cmm_uq.base.messages import Text, Verbatim, say

KINDS: Mapping[FeatureKind, Text] = {
    "point": say("point"), "line": say("line"), "plane": say("plane"), "circle": say("circle"), "sphere": say("sphere"),
    "cylinder": say("cylinder"), "cone": say("cone"),
}  # fmt: skip

CHARACTERISTICS: Mapping[str, Text] = {
    "size": say("diameter"), "straightness": say("straightness"), "flatness": say("flatness"),
    "roundness": say("roundness"), "cylindricity": say("cylindricity"), "sphericity": say("sphericity"),
    "distance": say("distance"), "angle": say("angle"), "parallelism": say("parallelism"),
    "perpendicularity": say("perpendicularity"), "angularity": say("angularity"), "position": say("position"),
    "coaxiality": say("coaxiality"), "x": say("x coordinate"), "y": say("y coordinate"), "z": say("z coordinate"),
    "circular_runout": say("circular runout"), "total_runout": say("total runout"),
}  # fmt: skip

ASSOCIATIONS: Mapping[str, Text] = {
    "least_squares": say("least squares"), "minimum_zone": say("minimum zone"),
    "maximum_inscribed": say("maximum inscribed"), "minimum_circumscribed": say("minimum circumscribed"),
    "tangent": say("tangent"),
}  # fmt: skip

FAMILIES: Mapping[str, Text] = {
    MACHINE: say("Errors of the machine"), NOISE: say("Noise of readings"), STYLUS: say("Stylus"),
    TEMPERATURE: say("Temperature"), FORM: say("Form of the part"), "fixture": say("Clamping"),
    "operator": say("Operator and set-up"), PLACE: say("Place on the table"),
}  # fmt: skip
"""Causes by what their lines in the budget begin with, in the order in which they are drawn."""

_FACTORS: Mapping[str, Text] = {
    "noise: reading": say("Noise of a reading"), "noise: set-up": say("Noise that a set-up adds"),
    "noise: slow": say("Slow noise"), "noise: growing": say("Noise that grows with length"),
    "temperature: part": say("Temperature and expansion of the part"),
    "temperature: gradient in the part": say("Gradient of temperature in the part"),
    "temperature: scale x": say("Temperature of the scale of X"),
    "temperature: scale y": say("Temperature of the scale of Y"),
    "temperature: scale z": say("Temperature of the scale of Z"),
    "temperature: warming of the part": say("Warming of the part while it is probed"),
    "temperature: warming of scale x": say("Warming of the scale of X while the part is probed"),
    "temperature: warming of scale y": say("Warming of the scale of Y while the part is probed"),
    "temperature: warming of scale z": say("Warming of the scale of Z while the part is probed"),
    "fixture: fixture": say("Clamping"), "fixture: movement of the part": say("Movement of the part"),
    "operator: reproducibility of points": say("Reproducibility of a point"),
}  # fmt: skip

_NAMED: Mapping[str, Callable[[Text], Text]] = {
    "stylus: tip size ": lambda name: say("Size of the tip of {name}", name=name),
    "stylus: tip offset ": lambda name: say("Offset of the tip of {name}", name=name),
    "stylus: lobing ": lambda name: say("Pre-travel over directions, {name}", name=name),
    "form: form of ": lambda name: say("Form of {name}", name=name),
    "form: roughness of ": lambda name: say("Roughness of {name}", name=name),
    "operator: reproducibility of ": lambda name: say("Reproducibility of {name}", name=name),
}
"""Beginnings of lines that go on with a name of the user's."""


def family_of(line: str) -> str:
    """The cause to which a line of the budget belongs."""
    return line if line == PLACE else line.partition(": ")[0]


def line_in_words(line: str, effects: Mapping[str, Text]) -> Text:
    """A line of the budget: a cause, or one factor of it."""
    if line in _FACTORS:
        return _FACTORS[line]
    for begin, words in _NAMED.items():
        if line.startswith(begin):
            return words(Verbatim(line.removeprefix(begin)))
    family, _, factor = line.partition(": ")
    if line in FAMILIES:
        return FAMILIES[line]
    if family == MACHINE:
        return effects.get(factor, Verbatim(factor))
    return Verbatim(line)
