"""Statements of conformity: decision, evidence, and the budget of the test uncertainty."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from cmm_uq.analysis.conformity.own_rule import titled
from cmm_uq.analysis.conformity.statement import Decided, Statement, least_favourable
from cmm_uq.analysis.machine.performance import MachinePerformance
from cmm_uq.base import messages
from cmm_uq.base.messages import DASH, NOTHING, Text, Verbatim, number, plural, say
from cmm_uq.base.units import MICROMETRE, unit
from cmm_uq.certificate.document import Block, Column, DecisionBlock, Plot, Section, Table, columns
from cmm_uq.certificate.plots.residuals import trumpet
from cmm_uq.certificate.wording import OUTCOME_WORDS, interval_of, probability, stated_value
from cmm_uq.jobs.tables.conformity import ConformityFacts
from cmm_uq.maths.uncertainty.budget import Budget, BudgetLine
from cmm_uq.maths.uncertainty.quantity import figure, limit_in_full, nominal, rounded, significant


def budget_table(measurand: Text, budget: Budget) -> Table:
    """What contributes, in mm or µm, and how much; a column, or a line, of which nothing is to be said is left out."""
    scale = 1 / MICROMETRE if budget.unit == unit("mm") else 1.0
    there = [(line, share) for line, share in zip(budget.lines, budget.shares, strict=True) if line.part]
    turned = any(line.unit != budget.unit or line.sensitivity != 1.0 for line, _ in there)
    several = len(there) > 1
    rows = (
        (line.name, *(_turned(line, scale) if turned else ()), significant(scale * line.contribution),
         *((say("{share} %", share=messages.signed(100 * share, ".1f")),) if several else ()), line.origin)
        for line, share in there
    )  # fmt: skip
    notes = [say("Combined: u = {u} µm.", u=significant(scale * budget.u))] if several else []
    if absent := [line.name for line in budget.lines if not line.part]:
        notes.append(say("Without a contribution, or not stated: {absent}.", absent=messages.commas(absent)))
    heads = columns((
        say("Cause"), *((say("Standard uncertainty"), say("Sensitivity")) if turned else ()),
        Column(say("Contribution"), unit("µm")), *((Column(say("Share")),) if several else ()), say("Origin"),
    ))  # fmt: skip
    return Table(say("Contributions to {measurand}", measurand=measurand), heads, tuple(rows), tuple(notes))


def _turned(line: BudgetLine, scale: float) -> tuple[Text, Text]:
    """U of a quantity as it is shown, and the change of the value, µm, by one unit of that."""
    factor, shown = 1.0, line.unit
    if line.unit == unit("mm"):
        factor, shown = 1 / MICROMETRE, unit("µm")
    elif line.unit == unit("1/K"):
        factor, shown = 1e6, say("10⁻⁶ /K")
    per: Text = figure(scale / factor * (line.sensitivity or 0.0))
    if shown != unit("µm"):
        per = say("{per} µm per {unit}", per=per, unit=shown)
    return say("{u} {unit}", u=significant((line.u or 0.0) * factor), unit=shown), per


_LISTED = 250  # rows of a table of errors; of more only those nearest to their limits are listed, results.json has all.


def conformity_section(statements: Sequence[Statement], machine: MachinePerformance | None = None) -> Section:
    """Decisions first, what they rest on behind them; ``machine``: its figures without noise, beside the decided ones."""
    blocks: list[Block] = [decision_block(statement, machine) for statement in statements]
    for statement in statements:
        if len(statement.errors) > 1:
            blocks += [*([picture(statement)] if has_picture(statement) else []), _table(statement)]
        if statement.budget is not None:
            subject = say("the uncertainty of the test value named, {standard}", standard=named(statement))
            blocks.append(budget_table(subject, statement.budget))
    return Section(say("Statements of conformity"), tuple(blocks))


def decision_block(statement: Statement, machine: MachinePerformance | None = None) -> DecisionBlock:
    """One statement: what was compared with what, by which rule, and what follows."""
    value = stated_value(statement.value_um, 2 * statement.u_um, signed=statement.signed)
    measured = say("{value} µm (k = 2)", value=value) if statement.u_um > 0 else say("{value} µm", value=value)
    told = messages.sentences((*_what_follows(statement), *statement.remarks, *without_noise(statement, machine)))
    return DecisionBlock(named(statement), statement.quantity, measured, _limit(statement), statement.decision.rule,
                         statement.outcome, told, statement.missing)  # fmt: skip


def without_noise(statement: Statement, machine: MachinePerformance | None) -> tuple[Text, ...]:
    """How large of the machine alone is what was decided, with noise, as recorded."""
    found = None if machine is None else machine.of_statement(statement)
    if found is None:
        return ()
    recorded, own = found
    return (
        say(
            "Decided is what was recorded, noise included, {recorded} µm at most; of the machine without noise this is "
            "{interval} µm (95 % interval).",
            recorded=rounded(recorded, own.expanded)[0],
            interval=interval_of(own),
        ),
    )


def named(statement: Statement) -> Text:
    standard = titled(statement.facts.standard)
    if not statement.characteristic:
        return standard
    return say("{standard}, {characteristic}", standard=standard, characteristic=Verbatim(statement.characteristic))


def formula(facts: ConformityFacts) -> Text:
    """The maximum permissible error as the job states it; L in mm, the result in µm."""
    mpe = facts.mpe
    if facts.limit_arcsec is not None:
        return say("{limit} ″", limit=limit_in_full(facts.limit_arcsec))
    if mpe is None:
        return say("{limit} µm", limit=limit_in_full(facts.limit_um or 0.0))
    if mpe.a_um is None or mpe.k is None:
        return say("{b} µm", b=limit_in_full(mpe.b_um or 0.0))
    line = say("({a} + L/{k}) µm", a=limit_in_full(mpe.a_um), k=limit_in_full(mpe.k))
    if mpe.b_um is None:
        return say("{line}, L in mm", line=line)
    return say("the lesser of {line} and {b} µm, L in mm", line=line, b=limit_in_full(mpe.b_um))


def _limit(statement: Statement) -> Text:
    here = say("{limit} µm", limit=limit_in_full(statement.limit_um))
    if statement.facts.mpe is None and statement.facts.limit_arcsec is None:
        return here
    length = statement.named.length_mm
    if length is not None:
        here = say("{limit} at L = {length} mm", limit=here, length=nominal(length))
    if statement.facts.limit_arcsec is not None:
        return say("{here}; {formula}", here=here, formula=formula(statement.facts))
    return say("{here}; MPE = {formula}", here=here, formula=formula(statement.facts))


def _what_follows(statement: Statement) -> list[Text]:
    band, said = statement.decision.guard_band, list[Text]()
    if statement.outcome == "incomplete":
        said.append(say("The {measured} measured conform; the test lacks what is named as missing.",
                        measured=statement.measured))  # fmt: skip
    if band is None:
        said.append(say("The uncertainty is too large for any value to be accepted."))
    elif band > 0:
        said.append(say("The guard band is {guard_band} µm.", guard_band=significant(band)))
    count, risks = len(statement.errors), statement.risks
    if (p := statement.decision.probability_conforming) is not None:
        said.append(say("Probability that the quantity is within the limit: {chance}.", chance=probability(p)))
    if statement.joint is not None and count > 1:
        said.append(say(
            "Probability that all {count} are, with what they share, by the measurement alone: {chance}.", count=count,
            chance=probability(statement.joint),
        ))  # fmt: skip
    if risks is not None:
        said.append(say(
            "Of all such machines, by the prior stated, {consumer} would be wrongly accepted by this rule and {producer} "
            "wrongly not accepted.", consumer=probability(risks.consumer), producer=probability(risks.producer),
        ))  # fmt: skip
    return said


def has_picture(statement: Statement) -> bool:
    """Whether errors of several lengths stand against limits on both sides."""
    drawn = {item.length_mm for item in statement.errors if not item.set_aside}
    return statement.signed and len(drawn - {None}) > 1


def picture(statement: Statement) -> Plot:
    items = [item for item in statement.errors if not item.set_aside]
    far = len(statement.errors) - len(items)
    outside = [item.decision.outcome not in ("pass", "conditional pass") for item in items]
    beyond = say("Not drawn: the values that the screening set aside, {count}, which lie far outside.", count=far)
    bands = [(item.limit_um, item.decision.guard_band) for item in items]
    caption = say("{standard}: every error against ±MPE, {formula}, with the guard band.",
                  standard=named(statement), formula=formula(statement.facts))  # fmt: skip
    return trumpet(
        [item.length_mm or 0.0 for item in items], [item.error_um for item in items],
        limit_um=[limit for limit, _ in bands],
        acceptance_um=[None if band is None else max(0.0, limit - band) for limit, band in bands],
        expanded_um=[2 * item.u_um for item in items], outside=outside, quantity=say("Error / µm"),
        caption=messages.after(caption, beyond if far else NOTHING),
        alternative=say("{count} errors over length between the limits; {outside} of them are not accepted.",
                        count=len(items), outside=sum(outside)),
    )  # fmt: skip


_STANDING = {"counts": NOTHING, "again": say("to be measured again"), "replaced": say("measured again")}


def _table(statement: Statement) -> Table:
    """Every error; those of one length in one measurement in one row, in the order of their repeats."""
    together: dict[object, list[Decided]] = {}
    for item in statement.errors:
        key = (item.measurement, item.length_mm, round(item.u_um, 9), item.limit_um, item.standing, item.set_aside)
        together.setdefault(key, []).append(item)
    rows, count = list(together.values()), len(statement.errors)
    counted = plural(count, one=say("{count} value.", count=count), many=say("{count} values.", count=count))
    notes: list[Text] = [counted]
    if len(rows) > _LISTED:
        rows = sorted(rows, key=lambda row: min(item.limit_um - abs(item.error_um) for item in row))[:_LISTED]
        notes.append(say("The {count} rows nearest to their limits; results.json has all.", count=_LISTED))
    lengths = any(item.length_mm is not None for item in statement.errors)
    known = any(item.u_um > 0 for item in statement.errors)
    heads = columns((
        say("Measurement"), *((Column(say("Length"), unit("mm")),) if lengths else ()),
        Column(say("Errors") if statement.signed else say("Values"), unit("µm"), numeric=False),
        *((Column(say("U"), unit("µm")), say("P")) if known else ()), Column(say("Limit"), unit("µm")), say("Decision"),
    ))  # fmt: skip
    if known:
        told = say("U: expanded uncertainty, k = 2. P: lowest probability in the row that a value is within its limit.")
        notes.append(told)
    title = say("All values decided by {standard}", standard=named(statement))
    cells = tuple(_row(row, lengths=lengths, known=known, signed_values=statement.signed) for row in rows)
    return Table(title, heads, cells, tuple(notes))


def _row(row: Sequence[Decided], *, lengths: bool, known: bool, signed_values: bool) -> tuple[Text, ...]:
    worst = least_favourable([replace(item, standing="counts") for item in row])
    chance, standing = worst.decision.probability_conforming, _STANDING[row[0].standing]
    if worst.set_aside and not standing:
        standing = say("set aside by the screening")
    shown, spec = (messages.signed, "+.2f") if signed_values else (number, ".2f")
    values = messages.in_a_row(shown(item.error_um, spec) for item in row)
    decision = OUTCOME_WORDS[worst.outcome]
    return (
        DASH if worst.measurement is None else number(worst.measurement),
        *((DASH if worst.length_mm is None else nominal(worst.length_mm),) if lengths else ()), values,
        *((significant(2 * worst.u_um), DASH if chance is None else probability(chance)) if known else ()),
        limit_in_full(worst.limit_um),
        say("{decision}, {standing}", decision=decision, standing=standing) if standing else decision,
    )  # fmt: skip
