"""How the figures of a replaced certificate and of the one that replaces it differ."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

from cmm_uq.base.messages import DASH, NOTHING, Text, Verbatim, foreign, plural, say, semicolons
from cmm_uq.certificate.document import Column, Document, Facts, Section, section, table

KEY = "replaced"  # of results.json.
COMPARED = say("Results compared")  # on the first page
NOT_COMPARED = say("No comparison of the results was made: those of the replaced certificate were not at hand.")
_NAMED = 6  # differences that the first page names one by one


@dataclass(frozen=True)
class ChangedFigure:
    """A decision or a figure that is not printed alike on both certificates, as printed; empty where one does not have it."""

    what: Text
    before: Text
    after: Text
    unit: Text = NOTHING

    @property
    def sentence(self) -> Text:
        before, after = (
            say("none") if not printed
            else say("{printed} {unit}", printed=printed, unit=self.unit) if self.unit else printed
            for printed in (self.before, self.after)
        )  # fmt: skip
        return say("{what}: {before} → {after}", what=self.what, before=before, after=after)

    @property
    def data(self) -> dict[str, str | None]:
        return {name: str.__str__(getattr(self, name)) or None for name in ("what", "before", "after", "unit")}


@dataclass(frozen=True)
class Reissue:
    """The results of a certificate beside those of the one that it replaces."""

    number: str  # of the one that is replaced
    compared: int | None = None  # figures that both have or it alone; ``None`` where its results are not at hand
    differences: tuple[ChangedFigure, ...] = ()  # decisions first, then figures
    added: tuple[ChangedFigure, ...] = ()  # figures that the replaced one does not state: no difference

    @property
    def sentence(self) -> Text:
        """For the first page, below what the laboratory says is changed."""
        if self.compared is None:
            return NOT_COMPARED
        if not self.differences:
            one = say("Both results were compared: the one decision or figure does not differ.")
            many = say(
                "Both results were compared: of {count} decisions and figures none differs.", count=self.compared
            )
            return plural(self.compared, one=one, many=many)
        named: list[Text] = [one.sentence for one in self.differences[:_NAMED]]
        if (more := len(self.differences) - _NAMED) > 0:
            named.append(say("{more} more in the table of differences", more=more))
        return say(
            "Both results were compared: of {count} decisions and figures {differ} differ: {named}.",
            count=self.compared, differ=len(self.differences), named=semicolons(named),
        )  # fmt: skip

    @property
    def section(self) -> Section:
        """The table of all differences; without blocks where there are none."""
        rows = ((one.what, one.before or DASH, one.after or DASH, one.unit) for one in (*self.differences, *self.added))
        heads = (say("Decision or figure"), Column(say("Before")), Column(say("After")), say("Unit"))
        caption = say("Differences from certificate {number}", number=Verbatim(self.number))
        note = say(
            "Figures are compared as they are printed, with the expanded uncertainty for a coverage probability of 95 %."
        )
        return section(say("Against the replaced certificate"), table(caption, heads, rows, note))

    @property
    def data(self) -> dict[str, Any]:
        return {
            "number": self.number, "compared": self.compared, "differences": [one.data for one in self.differences],
            "added": [one.data for one in self.added],
        }  # fmt: skip

    @classmethod
    def of_results(cls, results: Mapping[str, Any]) -> Reissue | None:
        """Of a results.json; ``None`` where it is of no certificate that replaces another."""
        there = results.get(KEY)
        if not isinstance(there, Mapping):
            return None
        lists = ([ChangedFigure(**{key: foreign(text or "") for key, text in one.items()}) for one in there[key]]
                 for key in ("differences", "added"))  # fmt: skip
        return cls(str(there["number"]), there["compared"], *map(tuple, lists))

    def on(self, document: Document) -> Document:
        """The certificate with the comparison on its first page, and the table of differences after its first section."""
        particulars = tuple(
            Facts(tuple((label, self.sentence if label == COMPARED else text) for label, text in facts.rows))
            for facts in document.particulars
        )
        first, *others = document.sections
        table = (self.section,) if self.section.blocks else ()
        return replace(document, particulars=particulars, sections=(first, *table, *others))
