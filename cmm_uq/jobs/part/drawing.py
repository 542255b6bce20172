"""What another program's plan asks for, as tables of a part's job; what is not understood of it is refused by name.

A plan is read once, when a job is begun: features, characteristics, styli and alignment become tables that anybody can
read and correct. What such a file leaves open (how a feature is probed, how long it is) stands there as an example.

What of a drawing is sound by itself: the rest is told by name, instead of ending the whole.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from pydantic import ValidationError

from cmm_uq.base.errors import CmmUqError, Gathered, suggestion
from cmm_uq.jobs.part.characteristic import ASKS, CharacteristicFacts, What
from cmm_uq.jobs.part.checks import unfit
from cmm_uq.jobs.part.datums import members
from cmm_uq.jobs.part.feature import FeatureFacts
from cmm_uq.jobs.part.probed import Probed, probed

Facts = dict[str, Any]
_DIGITS = 9  # decimals of a limit: a picometre, which the sum of a size and a deviation keeps
_TOLD = 3  # reasons that are told where nothing is left
ALL = "*"  # in place of names: everything that is not understood
KEY = "[part] not_measured"


class NotUnderstoodError(Exception):
    """What of a feature, a characteristic or a statement is not understood, to follow its name."""


@dataclass(frozen=True)
class NotUnderstood:
    """Something that is not understood."""

    name: str  # of the feature or characteristic, or of the statement
    why: str  # what of it is not understood, to follow its name
    where: str  # file and line


@dataclass
class Drawing:
    """What was read."""

    program: str  # format that it was read from
    # features, characteristics, styli: tables, in order
    features: list[Facts] = field(default_factory=list)
    characteristics: list[Facts] = field(default_factory=list)
    styli: list[Facts] = field(default_factory=list)
    datums: list[str] = field(default_factory=list)  # names of features, of the alignment
    unknown: list[NotUnderstood] = field(default_factory=list)  # what was not understood
    # by the name of a feature, keys that the file leaves open, whose values are examples
    open_keys: dict[str, list[str]] = field(default_factory=dict)

    def settled(self, without: Sequence[str], where: str) -> list[str]:
        """Names of what is left out knowingly.

        ``without``: names that may be left out, or :data:`ALL`.
        """
        wrong = Gathered()
        for one in self.unknown:
            if ALL not in without and one.name not in without:
                wrong.add(CmmUqError(f"{one.name!r} {one.why}", where=one.where,
                                     fix=f"Leave it out knowingly: --set part.not_measured='[\"{one.name}\"]', or "
                                         f"'[\"{ALL}\"]' for all of these"))  # fmt: skip
        named = {*(one.name for one in self.unknown), *(f["name"] for f in (*self.features, *self.characteristics))}
        for name in without:
            if name not in (ALL, *named):
                wrong.add(CmmUqError(f"has nothing named {name!r}", where=where, fix=suggestion(name, named)))
        wrong.refuse()
        for table in (self.features, self.characteristics):
            table[:] = [one for one in table if one["name"] not in without]
        self._without_their_features()
        for table, what in ((self.features, "feature"), (self.characteristics, "tolerance")):
            if not table:
                why = "; ".join(f"{one.name!r} {one.why}" for one in self.unknown[:_TOLD])
                raise CmmUqError(f"holds no {what} that is understood{': ' if why else ''}{why}", where=where,
                                 fix="Write the job by hand: cmm-uq new part")  # fmt: skip
        return list(dict.fromkeys([*(one.name for one in self.unknown), *(name for name in without if name != ALL)]))

    def _without_their_features(self) -> None:
        """Leave out characteristics whose feature or datum was left out, by name."""
        there = {one["name"] for one in self.features}
        for one in list(self.characteristics):
            if not (there.issuperset(one["features"]) and all_there(one.get("datums", ()), there)):
                self.characteristics.remove(one)
                self.unknown.append(NotUnderstood(one["name"], "is of a feature that was left out", ""))
        self.datums[:] = self.datums if all_there(self.datums, there) else []


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


def usual_strategy(kind: str, count: int | None = None) -> Facts:
    """How a feature is probed where its plan does not say it."""
    if kind == "cylinder" and not count:
        return {"pattern": "sections", "sections": 3, "points": 8}
    return {"pattern": "points", "points": count or _USUAL[kind]}


# points where nothing is said; 25 of a sphere as in ISO 10360-5
_USUAL: Mapping[str, int] = {"line": 5, "plane": 12, "circle": 12, "sphere": 25, "cylinder": 24, "cone": 24}


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
    for given in list(drawing.features):
        try:
            features[given["name"]] = probed_of(given)
        except CmmUqError as error:
            drawing.features.remove(given)
            drawing.unknown.append(NotUnderstood(given["name"], _unsound(error.problem), where))
    for given in list(drawing.characteristics):
        try:
            facts = CharacteristicFacts.model_validate(dict(given))
            named = [*facts.features, *(each for name in facts.datums for each in members(name, features))]
            found = unfit(facts, features) if features.keys() >= set(named) else None
            problem = found[0] if found else ""
        except ValidationError as error:
            problem = _first(error)
        except CmmUqError:  # of a feature that was set aside: told where features are left out
            problem = ""
        if problem:
            drawing.characteristics.remove(given)
            drawing.unknown.append(NotUnderstood(given["name"], _unsound(problem), where))


def _unsound(problem: str) -> str:
    return f"is refused as it stands: {problem}"


def _first(error: ValidationError) -> str:
    first = error.errors()[0]
    return ": ".join(filter(None, (".".join(map(str, first["loc"])), first["msg"].removeprefix("Value error, "))))
