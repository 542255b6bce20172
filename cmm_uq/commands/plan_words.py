"""A plan in words: what its placings determine, what they leave open, how the operator sets the artefact up."""

from __future__ import annotations

from collections.abc import Mapping

from cmm_uq.commands.planning import RECORDED, Plan
from cmm_uq.documents.wording import listed
from cmm_uq.model.measurement import ARTEFACT
from cmm_uq.physics.catalogue import every
from cmm_uq.planning.identifiability import Determined, Identifiability
from cmm_uq.units import MICROMETRE

STATUS = {"determined": "determined", "weak": "weakly: hardly better than physics allows", "free": "not determined"}

CRITERIA = {
    "separation": "effects told apart best",
    "D": "smallest volume of uncertainty (D)",
    "A": "smallest mean variance (A)",
    "worst": "smallest of the largest uncertainties (worst case)",
}


def title_of(name: str) -> str:
    """An effect in words."""
    return every()[name].title if name in every() else name


def combination(parts: Mapping[tuple[str, str], float]) -> str:
    """A free combination in words: ``scale error of X, Y and Z together, with the artefact's own length``."""
    effects = list(dict.fromkeys(owner for owner, _ in parts if owner != ARTEFACT))
    sizes = [name for owner, name in parts if owner == ARTEFACT]
    families: dict[str, list[str]] = {}
    for effect in effects:
        head, _, tail = title_of(effect).rpartition(" ")
        families.setdefault(head, []).append(tail)
    words = listed([f"{head} {listed(tails)}" for head, tails in families.items()]) if families else ""
    own = "the artefact's own length" if len(sizes) == 1 else "the artefact's own dimensions"
    if not effects:
        return own[0].upper() + own[1:]
    if sizes:
        return f"{words}{' together' if len(effects) > 1 else ''}, with {own}"
    return f"{words} together" if len(effects) > 1 else f"{words}: nothing shows of it"


def expected(parameter: Determined) -> str:
    """Expected standard uncertainty, in the unit of :func:`unit_of`."""
    if parameter.u is None:
        return "–"
    return f"{parameter.u / (MICROMETRE if parameter.unknown.unit == 'mm' else 1.0):.2g}"


def unit_of(parameter: Determined) -> str:
    """Unit of an expected uncertainty: sizes of the artefact in micrometres."""
    return "µm" if parameter.unknown.unit == "mm" else parameter.unknown.unit


def named(parameter: Determined) -> str:
    """A parameter in words."""
    owner, name = parameter.unknown.key
    if owner == ARTEFACT:
        return f"Artefact, {name.removesuffix('_mm').replace('_', ' ')}"
    effect = every()[owner]
    return effect.title if len(effect.coefficients) == 1 else f"{effect.title}, {name}"


def pairs(found: Identifiability) -> list[str]:
    """Effects that could not be told apart, grouped where they all resemble each other."""
    groups: list[set[str]] = []
    for first, second, _ in found.alike:
        joined = [group for group in groups if first in group or second in group]
        merged = {first, second}.union(*joined)
        groups = [group for group in groups if group not in joined] + [merged]
    return [listed([title_of(name) for name in every() if name in group]) for group in groups]


def absorbed(found: Identifiability) -> list[str]:
    """Effects that would be taken for others: ``sag of the artefact for scale error of X and scale error of Y``."""
    own = "the artefact's own size"
    return [
        f"{title_of(name)} for {listed([own if other == ARTEFACT else title_of(other) for other in others])}"
        for name, others in found.absorbed
        if others
    ]


def base_name(plan: Plan) -> str:
    """Of the placings to start from."""
    count = len(plan.start.placings)
    return f"the recording ({count} placings)" if plan.name == RECORDED else f"{plan.name} ({count} placings)"


def smallest(amplitude: float | None) -> str:
    """Smallest size of an effect that is found."""
    return "–" if amplitude is None else f"{amplitude:.2g}"
