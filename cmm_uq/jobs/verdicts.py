"""Statements of conformity as one list: what each comes to, and the gravest of all; as results.json has them, and from it.

Every output that says whether something conforms takes it from here: a document, an exit code, a message, the records.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from types import MappingProxyType
from typing import Any, Literal

from cmm_uq.base.messages import NOTHING, Text, Verbatim, say
from cmm_uq.base.units import UNITS, printed_unit
from cmm_uq.base.values import dataclass

# verdicts of a diagnosis: nothing is found; noise and an error are not told apart; a cause, or part of it, is found; a
# function is, without a name; nothing that predicts is
DIAGNOSES = ("consistent", "undetermined", "explained", "partial", "empirical", "unexplained")
AGREES = ("consistent", "undetermined")  # nothing is found to be missing

# outcomes of statements, the gravest first: findings in their order; incomplete is what would pass, were it whole
GRAVEST = ("fail", "conditional fail", "remeasure", "undecided", "incomplete", "conditional pass", "pass")
NONE = "none"  # in place of an outcome where nothing is stated
BEYOND = frozenset({"fail", "conditional fail"})  # outcomes that find a machine beyond a limit

# by the word that results.json has beside a tolerance, and the rule by which parameters are held to it
TOLERANCE_OUTCOMES: Mapping[str, str] = MappingProxyType({"in": "pass", "out": "fail", "open": "undecided"})
TOLERANCE_RULE = "the whole 95 % interval within the tolerance: pass; beyond it: fail; otherwise undecided"


def standing_of(outcome: str) -> Literal["good", "open", "bad"]:
    """Whether an outcome leaves nothing to do, something open, or finds something beyond its limit."""
    return "good" if outcome == "pass" else "bad" if outcome in BEYOND else "open"


def gravest(outcomes: Iterable[str]) -> str:
    """The gravest outcome; ``none`` where nothing is stated. A word of another package is no better than undecided."""
    return min(outcomes, key=lambda one: (GRAVEST.index(one if one in GRAVEST else "undecided"), one), default=NONE)


@dataclass(frozen=True)
class Verdict:
    """One statement of conformity, by a standard and its edition or, where ``by`` is empty, by a limit of the job.

    ``name``: of what is decided, ``E0``, ``scale_x.ppm``, a characteristic of a part; ``missing``: sentences on what it lacks.
    """

    name: str
    outcome: str
    value: float | None
    U: float | None
    limit: float | None
    unit: Text
    by: str = ""
    title: Text = NOTHING
    missing: tuple[Text, ...] = ()

    @property
    def standing(self) -> Literal["good", "open", "bad"]:
        return standing_of(self.outcome)

    @property
    def called(self) -> str:
        """Standard and characteristic, or the name of what has a tolerance."""
        return f"{self.by} {self.name}".strip()

    def data(self) -> dict[str, Any]:
        return {
            "name": self.name, "by": self.by or None, "title": str.__str__(self.title) or None, "outcome": self.outcome,
            "value": self.value, "U": self.U, "limit": self.limit, "unit": str.__str__(self.unit),
            "missing": [str.__str__(one) for one in self.missing],
        }  # fmt: skip


class Verdicts(tuple[Verdict, ...]):
    """All statements of a result: those of standards in the job's order, then those of tolerances."""

    __slots__ = ()

    @property
    def overall(self) -> str:
        """The gravest outcome; ``none`` where nothing is stated."""
        return gravest(one.outcome for one in self)

    @property
    def conforming(self) -> bool:
        """Whether nothing that is stated is anything but a pass."""
        return self.overall in ("pass", NONE)

    def of(self, *outcomes: str) -> list[Verdict]:
        return [one for one in self if one.outcome in outcomes]

    def data(self) -> dict[str, Any]:
        """For results.json, key ``verdicts``."""
        return {"overall": self.overall, "statements": [one.data() for one in self]}

    @classmethod
    def of_results(cls, results: Mapping[str, Any]) -> Verdicts:
        """Of a results.json; of one without the key from what its standards and tolerances decided."""
        there = results.get("verdicts")
        if isinstance(there, Mapping) and "statements" in there:
            return cls(
                Verdict(str(one["name"]), str(one["outcome"]), one["value"], one["U"], one["limit"], Verbatim(one["unit"]),
                        one["by"] or "", Verbatim(one["title"] or ""), tuple(map(Verbatim, one["missing"])))
                for one in there["statements"]
            )  # fmt: skip
        return cls((*map(_by_standard, results.get("conformity") or ()), *_by_tolerance(results), *_of_part(results)))


NO_VERDICTS = Verdicts()  # of what states no conformity


def _by_standard(one: Mapping[str, Any]) -> Verdict:
    u = one.get("u_um")
    return Verdict(
        str(one.get("characteristic") or ""), str(one.get("decision")), one.get("value_um"), 2 * u if u else None,
        one.get("limit_um"), UNITS["µm"], str(one.get("standard") or ""), Verbatim(one.get("quantity") or ""),
        tuple(map(Verbatim, one.get("missing") or ())),
    )  # fmt: skip


def _by_tolerance(results: Mapping[str, Any]) -> Iterator[Verdict]:
    for effect, held in (results.get("tolerances") or {}).items():
        outcome = TOLERANCE_OUTCOMES.get(str(held.get("verdict")), "undecided")
        for parameter, limit in held.items():
            if parameter != "verdict":
                known = ((results.get("estimates") or {}).get(effect) or {}).get(parameter) or {}
                yield Verdict(f"{effect}.{parameter}", outcome, known.get("value"), known.get("U"), limit,
                              printed_unit(parameter))  # fmt: skip


def _of_part(results: Mapping[str, Any]) -> Iterator[Verdict]:
    """Of each characteristic that was decided, and of each that was not measured beside them."""
    decided = [one for one in results.get("characteristics") or () if isinstance(one, Mapping) and one.get("decision")]
    if not decided:
        return
    withheld = tuple(map(Verbatim, results.get("decision", {}).get("withheld", ())))
    for one in decided:
        value, limits, outcome = one.get("value"), one.get("limits") or {}, str(one["decision"]["outcome"])
        ends = [end for end in (limits.get("lower"), limits.get("upper")) if end is not None]
        # the limit that the value is nearest to, or farthest beyond
        far = len(ends) == 2 and value is not None and value - ends[0] >= ends[1] - value
        limit = ends[1] if far else next(iter(ends), None)
        yield Verdict(str(one["name"]), outcome, value, one.get("U"), limit, Verbatim(one.get("unit") or ""),
                      missing=withheld if outcome == "undecided" else ())  # fmt: skip
    for name in results.get("part", {}).get("not_measured", ()):
        yield Verdict(str(name), "incomplete", None, None, None, NOTHING, missing=(say("it was not measured"),))
