"""What a standard is: what it tests, on which observations, what a complete test consists of, and what is decided.

A standard decides one characteristic or several (E0, R0, P_FTU). Each goes by observations that a kind of measurement offers
(``Kind.tested``), not by the kind's name: a standard of another package can be stated of every kind that offers them.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from cmm_uq.conformity.copies import copies_in_words
from cmm_uq.conformity.decision import needs_uncertainty
from cmm_uq.conformity.plans import Condition
from cmm_uq.conformity.statement import Decided, Statement
from cmm_uq.errors import CmmUqError
from cmm_uq.jobs.artefact import ArtefactFacts
from cmm_uq.jobs.conformity import ConformityFacts, needed
from cmm_uq.messages import Text, say
from cmm_uq.model.artefact import Artefact, Indications
from cmm_uq.points import Floats
from cmm_uq.uncertainty.quantity import Quantity

NOT_CONSIDERED = say(
    "Simple acceptance takes no account of the uncertainty: at the limit itself conforming is as likely as not."
)


def _nothing_asked(artefact: Artefact, *, recorded: bool) -> tuple[Condition, ...]:
    return ()


def _nothing_needed(artefact: ArtefactFacts) -> str | None:
    return None


@dataclass(frozen=True)
class Characteristic:
    """One thing that a standard decides.

    Parameters
    ----------
    name : as in ``[[conformity]] characteristic``.
    observed : what it is decided on, one of ``Kind.tested``.
    statement : compares and decides; see :meth:`Test.stated`.
    conditions : what a complete test consists of, and what is missing of it, for an artefact with its points; ``recorded``
        says whether these were measured or are a plan's.
    unstated : the key of ``[artefact]`` that a rule with an uncertainty needs and that is not stated; ``None`` when nothing is
        missing.
    """

    name: str
    observed: str
    statement: Callable[[Test], Statement]
    conditions: Callable[..., tuple[Condition, ...]] = _nothing_asked
    unstated: Callable[[ArtefactFacts], str | None] = _nothing_needed


@dataclass(frozen=True)
class Standard:
    """A standard as it can be stated.

    Parameters
    ----------
    name : with its part and edition, as in ``[[conformity]] standard``.
    characteristics : that are decided; the first is meant where the job names none.
    remarks : what every statement by it says.
    """

    name: str
    characteristics: tuple[Characteristic, ...]
    remarks: tuple[Text, ...] = ()

    def characteristic(self, name: str | None) -> Characteristic:
        """One of them by name; without one the first.

        Raises
        ------
        ValueError : it is not decided here.
        """
        found = next((each for each in self.characteristics if name in (None, each.name)), None)
        if found is None:
            known = ", ".join(each.name for each in self.characteristics)
            raise ValueError(f"characteristic = {name!r} of {self.name} is not decided here: only {known}")
        return found

    def uncertainty_missing(self, wish: ConformityFacts, artefact: ArtefactFacts) -> str | None:
        """See :meth:`cmm_uq.jobs.conformity.Asked.uncertainty_missing`."""
        return None if wish.rule == "simple" else self.characteristic(wish.characteristic).unstated(artefact)


@dataclass(frozen=True, eq=False)
class Test:
    """A test that is to be decided.

    Parameters
    ----------
    standard, characteristic : what is tested.
    facts : limit and rule.
    artefact : with its recording.
    recorded : the artefact as it was recorded, where ``artefact`` has been corrected: that makes no copy a measurement.
    accuracy : figures of performance with uncertainty, by name.
    key : of job.toml, for messages.
    """

    __test__ = False  # no test of pytest's

    standard: Standard
    characteristic: Characteristic
    facts: ConformityFacts
    artefact: Artefact
    recorded: Artefact
    accuracy: Mapping[str, Quantity]
    key: str

    def indications(self) -> Indications:
        """Errors of indication of the calibrated lengths.

        Raises
        ------
        CmmUqError : there is no calibration.
        """
        found = self.artefact.indications()
        if found is None:
            raise CmmUqError(f"{self.facts.standard} compares with calibrated lengths, and the {self.artefact.kind} has none",
                             where=f"job.toml {self.key} standard",
                             fix="Give length_mm and u_um in [artefact], or leave the statement out")  # fmt: skip
        return found

    def limits_um(self, lengths_mm: Floats) -> Floats:
        """The limit of each of some lengths (m,), µm."""
        if self.facts.mpe is not None:
            return np.asarray(self.facts.mpe.a_um + lengths_mm / self.facts.mpe.k, dtype=np.float64)
        return np.full(len(lengths_mm), self.facts.limit_um, dtype=np.float64)

    def refuse_without_uncertainty(self, u: float, name: str) -> None:
        """Refuse a rule that needs an uncertainty where there is none.

        Parameters
        ----------
        u : the least of all.
        name : the key of ``[artefact]`` that would state it.

        Raises
        ------
        CmmUqError : with the key and the fix.
        """
        if u <= 0 and needs_uncertainty(self.facts.rule):
            problem, fix = needed(name, self.facts)
            raise CmmUqError(problem, where=f"job.toml {self.key} rule", fix=fix)

    def stated(self, quantity: Text, measured: Text, items: tuple[Decided, ...], remarks: Sequence[Text]) -> Statement:
        """What was decided, with what the test lacks, and what the rule leaves out.

        Parameters
        ----------
        quantity : what is compared, in words.
        measured : what was measured, in the plural, for "… conform".
        items : all that was decided, in the recording's order.
        remarks : what the reader must know of this use of the standard.
        """
        asked = self.characteristic.conditions(self.recorded, recorded=True)
        more: list[Text] = []
        if self.facts.rule == "simple" and items[0].u_um > 0:
            more.append(NOT_CONSIDERED)
        more += self.standard.remarks
        if copies := copies_in_words(self.recorded.points):
            more.append(copies)
        missing = tuple(text for condition in asked for text in condition.missing)
        return Statement(
            self.facts, self.characteristic.name, quantity, measured, items, missing, (*remarks, *more)
        )  # fmt: skip


def characteristic_of(standard: Standard, facts: ConformityFacts, key: str) -> Characteristic:
    """The characteristic that a job wishes to be decided.

    Raises
    ------
    CmmUqError : it is not decided here.
    """
    try:
        return standard.characteristic(facts.characteristic)
    except ValueError as error:
        raise CmmUqError(str(error), where=f"job.toml {key} characteristic", fix="Leave it out") from None
