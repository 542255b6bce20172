"""The statements of conformity of a certificate: what was compared with which limit, by which rule, and what follows."""

from __future__ import annotations

from collections.abc import Sequence

from cmm_uq.conformity.statement import Statement
from cmm_uq.documents.document import Decision, Section
from cmm_uq.documents.wording import measured, probability
from cmm_uq.messages import NOTHING, Text, Verbatim, say, sentences
from cmm_uq.uncertainty.rounding import significant


def conformity_section(statements: Sequence[Statement]) -> Section:
    """Every statement that the job asks for, in its order."""
    return Section(say("Statements of conformity"), tuple(_decision(statement) for statement in statements))


def _decision(statement: Statement) -> Decision:
    decision = statement.decision
    value, u = measured(statement)
    said = []
    if statement.outcome == "incomplete":
        said.append(
            say(
                "The {measured} measured conform; the test lacks what is named as missing.", measured=statement.measured
            )
        )
    if decision.guard_band is None:
        said.append(say("The uncertainty is too large for any value to be accepted."))
    elif decision.guard_band > 0:
        said.append(say("The guard band is {guard_band} µm.", guard_band=significant(decision.guard_band)))
    if decision.probability_conforming is not None:
        chance = probability(decision.probability_conforming)
        said.append(say("Probability that the quantity is within the limit: {chance}.", chance=chance))
    known = say(", u = {u} µm", u=u) if u else NOTHING
    return Decision(
        Verbatim(statement.facts.standard),
        statement.quantity,
        say("{value} µm{known}", value=value, known=known),
        _limit(statement),
        decision.rule,
        statement.outcome,
        sentences((*said, *statement.remarks)),
        statement.missing,
    )


def _limit(statement: Statement) -> Text:
    """The limit, and the formula that it comes from."""
    limit = say("{limit_um:.4g} µm", limit_um=statement.limit_um)
    mpe, length = statement.facts.mpe, statement.named.length_mm
    if mpe is None:
        return limit
    formula = say("MPE = ({a:g} + L/{k:g}) µm, L in mm", a=mpe.a_um, k=mpe.k)
    if length is None:
        return say("{limit}; {formula}", limit=limit, formula=formula)
    return say("{limit} at L = {length:.6g} mm; {formula}", limit=limit, length=length, formula=formula)
