"""A plan in words: what its placings determine, what they leave open, how the operator sets the artefact up."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from cmm_uq.analysis.planning.identifiability import Determination, Identifiability
from cmm_uq.base.messages import DASH, Message, Text, Verbatim, listed, number, say
from cmm_uq.base.units import MICROMETRE, unit
from cmm_uq.machine.model.measurement import ARTEFACT
from cmm_uq.machine.physics.catalogue import every
from cmm_uq.maths.inference.linear_model import Unknown

STATUS = {
    "determined": say("determined"),
    "weak": say("weakly: hardly better than physics allows"),
    "free": say("not determined"),
}

CRITERIA = {
    "separation": say("effects told apart best"),
    "D": say("smallest volume of uncertainty (D)"),
    "A": say("smallest mean variance (A)"),
    "worst": say("smallest of the largest uncertainties (worst case)"),
}


def title_of(name: str) -> Text:
    """An effect in words."""
    return every()[name].title if name in every() else Verbatim(name)


def combination(parts: Mapping[tuple[str, str], float]) -> Text:
    """A free combination in words: ``scale error of X, Y and Z together, with the artefact's own length``."""
    effects = list(dict.fromkeys(owner for owner, _ in parts if owner != ARTEFACT))
    sizes = [name for owner, name in parts if owner == ARTEFACT]
    one = len(sizes) == 1
    if not effects:
        return say("The artefact's own length") if one else say("The artefact's own dimensions")
    words = listed(_families([title_of(effect) for effect in effects]))
    if sizes:
        own = say("the artefact's own length") if one else say("the artefact's own dimensions")
        together = say("{effects} together", effects=words) if len(effects) > 1 else words
        return say("{effects}, with {own}", effects=together, own=own)
    if len(effects) > 1:
        return say("{effects} together", effects=words)
    return say("{effect}: nothing shows of it", effect=words)


def _families(titles: Sequence[Text]) -> list[Text]:
    """Titles that differ in their last argument alone as one, in the order of the first: ``scale error of X, Y and Z``."""
    families: dict[tuple[object, ...], list[Text]] = {}
    for title in titles:
        key: tuple[object, ...] = (title,)
        if isinstance(title, Message) and title.pattern.endswith("}"):
            key = (title.pattern, *list(title.arguments.values())[:-1])
        families.setdefault(key, []).append(title)
    words: list[Text] = []
    for first, *others in families.values():
        if others and isinstance(first, Message):
            name = first.pattern.rpartition("{")[2].removesuffix("}")
            last = [member.arguments[name] for member in (first, *others) if isinstance(member, Message)]
            merged = listed([one for one in last if isinstance(one, Text)])
            words.append(Message(first.pattern, {**first.arguments, name: merged}))
        else:
            words.append(first)
    return words


def expected(parameter: Determination) -> Text:
    """Expected standard uncertainty, in the unit of :func:`unit_of`."""
    return _in_its_unit(parameter, parameter.u)


def expected_white(parameter: Determination) -> Text:
    """The same, if the noise were white."""
    return _in_its_unit(parameter, parameter.u_white)


def _in_its_unit(parameter: Determination, u: float | None) -> Text:
    return DASH if u is None else number(u / (MICROMETRE if parameter.unknown.unit == "mm" else 1.0), ".2g")


def unit_of(parameter: Determination) -> Text:
    """Unit of an expected uncertainty: sizes of the artefact in micrometres."""
    return parameter_unit(parameter.unknown)


def parameter_unit(unknown: Unknown) -> Text:
    """The same of an unknown."""
    return unit("µm") if unknown.unit == "mm" else unknown.unit


def _size_words(name: str) -> Text:
    """A size of the artefact by its name, which a kind of another package may choose as it likes."""
    plain = name.removesuffix("_mm")
    what, _, which = plain.partition("_")
    if plain == "length":
        return say("length")
    if which.isdigit() and what == "block":
        return say("block {which}", which=Verbatim(which))
    if which.isdigit() and what == "cylinder":
        return say("cylinder {which}", which=Verbatim(which))
    return Verbatim(plain.replace("_", " "))


def named(parameter: Determination) -> Text:
    """A parameter in words."""
    return parameter_name(parameter.unknown)


def parameter_name(unknown: Unknown) -> Text:
    """An unknown in words."""
    owner, name = unknown.key
    if owner == ARTEFACT:
        return say("Artefact, {size}", size=_size_words(name))
    effect = every()[owner]
    if len(effect.coefficients) == 1:
        return effect.title
    return say("{title}, {name}", title=effect.title, name=Verbatim(name))


def pairs(found: Identifiability) -> list[Text]:
    """Effects that could not be told apart, grouped where they all resemble each other."""
    groups: list[set[str]] = []
    for first, second, _ in found.alike:
        joined = [group for group in groups if first in group or second in group]
        merged = {first, second}.union(*joined)
        groups = [group for group in groups if group not in joined] + [merged]
    return [listed([title_of(name) for name in every() if name in group]) for group in groups]


def absorbed(found: Identifiability) -> list[Text]:
    """Effects that would be taken for others: ``sag of the artefact for scale error of X and scale error of Y``."""
    own = say("the artefact's own size")
    each = (
        (name, listed([own if other == ARTEFACT else title_of(other) for other in others]))
        for name, others in found.absorbed
        if others
    )
    return [say("{effect} for {others}", effect=title_of(name), others=others) for name, others in each]


def smallest(amplitude: float | None) -> Text:
    """Smallest size of an effect that is found."""
    return DASH if amplitude is None else number(amplitude, ".2g")
