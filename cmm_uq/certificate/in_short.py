"""What a command found in a few lines: decisions first, then figures, remarks and warnings, for a terminal or a notebook."""

from __future__ import annotations

from dataclasses import dataclass

from cmm_uq.base.messages import NOTHING, Text, say
from cmm_uq.certificate.document import Standing
from cmm_uq.certificate.wording import NO_FACTOR, expanded, with_uncertainty
from cmm_uq.maths.uncertainty.quantity import Quantity

Figure = tuple[Text, Text, Text]
"""Name of a quantity, its value with U and unit, its coverage factor."""


@dataclass(frozen=True)
class Verdict:
    """A decision, or what a diagnosis comes to.

    Parameters
    ----------
    word : the outcome in capitals.
    standing : what that means for the machine.
    subject : what was decided.
    remarks : the figures it rests on, and what is missing.
    """

    word: str
    standing: Standing
    subject: Text
    remarks: tuple[Text, ...]


@dataclass(frozen=True)
class Summary:
    """An outcome for the end of a command.

    Parameters
    ----------
    subject, date : what was measured, and when.
    verdicts : what it comes to.
    figures : quantities with their uncertainty.
    remarks : further sentences.
    details : rows of a table that only who asks for everything wants to see.
    warnings : what the reader must know before using a figure.
    """

    subject: Text = NOTHING
    date: Text = NOTHING
    verdicts: tuple[Verdict, ...] = ()
    figures: tuple[Figure, ...] = ()
    remarks: tuple[Text, ...] = ()
    details: tuple[tuple[Text, ...], ...] = ()
    warnings: tuple[Text, ...] = ()

    @property
    def rows(self) -> tuple[tuple[str, ...], ...]:
        """The same, without the details, as rows of one table: what, figure, remark."""
        measured = (say("Measured"), self.subject, self.date) if self.date else (self.subject,)
        decided = ((each.subject, each.word, "; ".join(each.remarks)) for each in self.verdicts)
        told = ((text,) for text in self.remarks)
        warned = ((say("Warning"), text, NOTHING) for text in self.warnings)
        return (*((measured,) if self.subject else ()), *self.figures, *decided, *told, *warned)


def figure_row(name: Text, quantity: Quantity, *, known: bool = True) -> Figure:
    """A quantity with its expanded uncertainty; ``known`` is false where a recording says nothing of it."""
    if not known:
        return name, say("not determined"), NOTHING
    figure, k = say("{figure} {unit}", figure=with_uncertainty(quantity), unit=quantity.unit), expanded(quantity)[2]
    if quantity.one_sided:
        return name, figure, say("95 % interval")
    return name, figure, NOTHING if k == NO_FACTOR else say("k = {k}", k=k)
