"""Statements of conformity: decision, evidence, and the budget of the test uncertainty; figures of performance.

These as recorded, and of the machine alone, without noise; and the errors of a machine by what each made of the recording, as
a picture: what to correct first.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

from cmm_uq.analysis.conformity.accuracy import TITLES
from cmm_uq.analysis.conformity.own_rule import titled
from cmm_uq.analysis.conformity.statement import Decided, Statement, least_favourable
from cmm_uq.analysis.machine.performance import MachinePerformance, contributions
from cmm_uq.analysis.machine.regions import FactorRegions
from cmm_uq.base import messages
from cmm_uq.base.messages import DASH, NOTHING, Text, Verbatim, commas, number, plural, say, semicolons, signed
from cmm_uq.base.units import MICROMETRE, unit
from cmm_uq.certificate import wording
from cmm_uq.certificate.document import Block, Column, DecisionBlock, Plot, Section, Table, columns, section
from cmm_uq.certificate.origin import quantity_data
from cmm_uq.certificate.plots.residuals import budget_bars, trumpet
from cmm_uq.certificate.result import Result
from cmm_uq.certificate.wording import OUTCOME_WORDS, effect_title, interval_of, probability, stated_value
from cmm_uq.jobs.tables.conformity import ConformityFacts
from cmm_uq.jobs.tables.length_formula import MaximumPermissibleError
from cmm_uq.machine.model.measurement import ARTEFACT
from cmm_uq.maths.uncertainty.budget import Budget, BudgetLine
from cmm_uq.maths.uncertainty.quantity import Quantity, figure, limit_in_full, nominal, rounded, significant


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


def without_noise(statement: Statement, machine: MachinePerformance | None) -> list[Text]:
    """How large of the machine alone is what was decided, with noise, as recorded."""
    found = None if machine is None else machine.of_statement(statement)
    return [] if found is None else [say(
        "The largest recorded value, noise included, is {recorded} µm; that of the machine alone is {interval} µm (95 % "
        "interval).", recorded=rounded(found[0], found[1].expanded)[0], interval=interval_of(found[1]),
    )]  # fmt: skip


def named(statement: Statement) -> Text:
    standard, what = titled(statement.facts.standard), Verbatim(statement.characteristic)
    return say("{standard}, {characteristic}", standard=standard, characteristic=what) if what else standard


def formula(facts: ConformityFacts) -> Text:
    """The maximum permissible error as the job states it; L in mm, the result in µm."""
    if facts.limit_deg is not None:
        return say("{limit}°", limit=limit_in_full(facts.limit_deg))
    if facts.limit_arcsec is not None:
        return say("{limit} ″", limit=limit_in_full(facts.limit_arcsec))
    return say("{limit} µm", limit=limit_in_full(facts.limit_um or 0.0)) if facts.mpe is None else mpe_words(facts.mpe)


def mpe_words(mpe: MaximumPermissibleError) -> Text:
    b = limit_in_full(mpe.b_um or 0.0)
    if mpe.a_um is None or mpe.k is None:
        return say("{b} µm", b=b)
    line = say("({a} + L/{k}) µm", a=limit_in_full(mpe.a_um), k=limit_in_full(mpe.k))
    least = say("the lesser of {line} and {b} µm, L in mm", line=line, b=b)
    return say("{line}, L in mm", line=line) if mpe.b_um is None else least


def _limit(statement: Statement) -> Text:
    facts, length = statement.facts, statement.named.length_mm
    here = say("{limit} µm", limit=limit_in_full(statement.limit_um))
    if facts.mpe is None and facts.angle_arcsec is None:
        return here
    if length is not None:
        here = say("{limit} at L = {length} mm", limit=here, length=nominal(length))
    by = say("{here}; {formula}", here=here, formula=formula(facts))
    return say("{here}; MPE = {formula}", here=here, formula=formula(facts)) if facts.angle_arcsec is None else by


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
        *((DASH if worst.length_mm is None else nominal(worst.length_mm),) if lengths else ()),
        values,
        *((significant(2 * worst.u_um), DASH if chance is None else probability(chance)) if known else ()),
        limit_in_full(worst.limit_um),
        say("{decision}, {standing}", decision=decision, standing=standing) if standing else decision,
    )


def machine_alone(result: Result) -> MachinePerformance | None:
    """``None`` where nothing is stated of the machine without noise, or other statements of it contradict it."""
    regions = result.regions
    return regions.performance if isinstance(regions, FactorRegions) and not regions.agreement.disagree else None


def own_figures(result: Result) -> Mapping[str, Quantity]:
    """Of the machine, without noise; U not below the laboratory's capability."""
    machine = machine_alone(result)
    found: Mapping[str, Quantity] = {} if machine is None else machine.figures
    return found if result.stating is None else result.stating.all("performance_of_machine", found)


_LESS = 0.9  # part of U below which it is said what U would be


def returning_figures(result: Result) -> dict[str, Quantity]:
    """Whose U would be less by a tenth or more if what named errors leave at each set-up were the machine's."""
    found = result.returning if result.stating is None else result.stating.all("accuracy", result.returning)
    each = ((name, one, result.accuracy[name]) for name, one in found.items())
    return {name: one for name, one, stated in each if one.expanded < _LESS * stated.expanded}


def performance(result: Result) -> Section:
    """Figures of the lengths; without blocks for an artefact that has none."""
    title, own, regions = say("Figures of performance"), own_figures(result), result.regions
    if not result.accuracy:
        return section(title)
    machine = (say("Machine alone from"), say("to")) if own else ()
    figures = (say("Value"), say("U"), say("k"), *machine)
    heads: tuple[Text | Column, ...] = (say("Quantity"), *map(Column, figures), say("Unit"))
    rows = []
    for name, one in result.accuracy.items():
        ends: tuple[Text, ...] = (NOTHING, NOTHING) if own else ()
        if name in own:
            ends = tuple(rounded(end, own[name].expanded)[0] for end in own[name].interval95)
        rows.append((TITLES[name], *wording.stated(one), *ends, one.unit))
    notes: list[Text] = [wording.UNCERTAINTY, say(
        "Each figure estimates what the machine would show on average if the recording were "
        "repeated; all recorded lengths count. The test value of a statement of conformity is another quantity, that of "
        "this recording alone, and its U is the test uncertainty."
    )]  # fmt: skip
    if again := returning_figures(result):
        would = semicolons(
            say("{figure:small} {U} {unit}", figure=TITLES[name], U=rounded(one.value, one.expanded)[1], unit=one.unit)
            for name, one in again.items()
        )
        notes.append(say(
            "U counts what the named errors leave at each set-up, and its repeats share, as noise that would be another if "
            "the recording were repeated. If it is other errors of the machine, which would be there again, U is too wide, "
            "and would be: {figures}.", figures=would,
        ))  # fmt: skip
    if own:
        notes.append(say("Machine alone: 95 % interval of the figure by all errors of the machine, without noise and errors "
                         "of artefact or reading; it decides nothing."))  # fmt: skip
    elif regions and (not isinstance(regions, FactorRegions) or regions.agreement.disagree):
        why = say("statements of it contradict each other") if isinstance(regions, FactorRegions) else regions
        notes.append(say("What of them is the machine's alone, without noise, is not stated: {why}.", why=why))
    notes += wording.skewed_note(result.accuracy.values())
    return section(title, Table(title, columns(heads), tuple(rows), tuple(notes)))


def with_performance(data: Mapping[str, Any], result: Result) -> dict[str, Any]:
    """Contents of results.json with the machine's own figures, and those of each statement."""
    own, machine = {name: quantity_data(one) for name, one in own_figures(result).items()}, machine_alone(result)
    found = dict(data) | ({"performance_of_machine": own} if own else {})
    if again := returning_figures(result):
        found["accuracy_if_left_returns"] = {name: quantity_data(one) for name, one in again.items()}
    if machine is None:
        return found
    each = [machine.of_statement(statement) for statement in result.statements]
    found["conformity"] = [
        stated if one is None else {**stated, "largest_um": one[0], "largest_without_noise_um": quantity_data(one[1])}
        for stated, one in zip(found["conformity"], each, strict=True)
    ]
    return found


def ranking_plot(result: Result) -> Plot:
    """Share of every named error in what the recording deviates by, the largest first."""
    ranked = contributions(result.model, result.posterior.draws.mean(axis=0))
    names = [say("{what}, {rms} µm", what=_called(one.owner, result), rms=significant(one.rms_um)) for one in ranked]
    shares = [one.share for one in ranked]
    parts = ((name, signed(100 * share, ".0f")) for name, share in zip(names, shares, strict=True))
    told = commas(say("{name}: {share} %", name=name, share=share) for name, share in parts)
    caption = say(
        "What each error makes of the recorded deviations: its share of their sum of squares, and its root mean square in one "
        "coordinate. A share below zero takes away from what others make."
    )
    return budget_bars(names, shares, caption=caption, alternative=told)


def _called(owner: str | None, result: Result) -> Text:
    if owner is None:
        return say("What no named error explains")
    return say("Sizes of the artefact") if owner == ARTEFACT else effect_title(owner, result.model.effects)
