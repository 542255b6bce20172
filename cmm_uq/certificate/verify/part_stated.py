"""Whether the report of a part states the figures of its ``results.json``, in order, rounded and said as the package does.

Text of a page or of a PDF is searched for each row of its tables; both have the cells of a row one after the other.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from math import nan
from typing import Any

from cmm_uq.base.languages.translation import translated as said_in
from cmm_uq.base.messages import Text
from cmm_uq.certificate.part.figures import ANGLES, LENGTHS, PrintedFigures, PrintedUnits
from cmm_uq.certificate.part.page import verdict_words
from cmm_uq.certificate.verify.found import Inquiry
from cmm_uq.certificate.verify.views_agree import squashed
from cmm_uq.certificate.wording import OUTCOME_WORDS, probability


@dataclass(frozen=True, eq=False)
class _One(PrintedFigures):
    """A characteristic of results.json."""

    data: Mapping[str, Any]

    @property
    def scale(self) -> PrintedUnits:
        return ANGLES if self.angular else LENGTHS

    @property
    def angular(self) -> bool:
        return bool(self.data["unit"] == "°")

    @property
    def expanded(self) -> float:
        return self.inside("U")

    @property
    def one_sided(self) -> bool:
        return self.data.get("stated_by") == "interval"

    def inside(self, key: str) -> float:
        """A value in mm or rad."""
        return float(self.data[key]) * self.scale.per_value

    def pair(self, ends: Sequence[float | None]) -> tuple[float | None, float | None]:
        """Two ends in mm or rad."""
        low, high = (None if end is None else end * self.scale.per_value for end in ends)
        return low, high

    def results(self, *, measured: bool) -> list[Text]:
        """Cells of its row of results."""
        low, high = (end * self.scale.per_value for end in self.data["interval95"])
        value = [self.at(self.inside("value"))] if measured else []
        error = [] if measured else [self.error(self.inside("mean_error"))]
        k = nan if self.data["k"] is None else self.data["k"]
        before = () if "stated_by" in self.data else (self.small(self.inside("u")),)  # before 0.15.0 a page had u, too
        return [*value, *before, *self.with_factor(k),
                self.interval_of((low, high), measured=measured), *error]  # fmt: skip

    def decision(self) -> list[Text]:
        """Cells of its row of decisions behind the nominal value."""
        limits, said = self.data["limits"], self.data["decision"]
        low, high = self.pair((limits["lower"], limits["upper"]))
        accepted = None if limits["accepted"] is None else self.pair(limits["accepted"])
        decided: list[Text] = []
        if said is not None:
            decided = [OUTCOME_WORDS[said["outcome"]], probability(said["probability_conforming"])]
        return [self.limit(low), self.limit(high),
                self.accepted_of(accepted), *decided]  # fmt: skip


def check_part_stated(inquiry: Inquiry, data: Mapping[str, Any], text: str, *, files: tuple[str, str]) -> None:
    """Keep every result, limit and decision that a text states otherwise, or not in its place.

    Parameters
    ----------
    data : of results.json.
    text : of the page, or of all pages of a PDF.
    files : names of the document and of results.json.
    """
    name, source = files
    language = data["job"].get("language", "en")
    whole, at = squashed(text), 0
    for place, words in _expected(data):
        inquiry.looked("figures")
        wanted = squashed("".join(str.__str__(said_in(word, language)) for word in words))
        found = whole.find(wanted, at)
        if found < 0:
            inquiry.wrong("figures", name, place, f"does not state the figures of {source} in their place", "",
                          " ".join(str.__str__(said_in(word, language)) for word in words))  # fmt: skip
        else:
            at = found + len(wanted)


def _expected(data: Mapping[str, Any]) -> Iterator[tuple[str, list[Text]]]:
    """What follows each other on the page: the verdict, results, then decisions; lengths before angles."""
    every = [_One(one) for one in data["characteristics"]]
    measured = any(one.data["value"] is not None for one in every)
    outcomes = [one.data["decision"]["outcome"] for one in every if one.data["decision"] is not None]
    yield "verdict", [verdict_words(outcomes, measured=measured)]
    ordered = [one for one in every if not one.angular] + [one for one in every if one.angular]
    for one in ordered:
        yield f"results of {one.data['name']}", one.results(measured=measured)
    for one in ordered:
        if one.data["limits"] is not None:
            yield f"decision on {one.data['name']}", one.decision()
