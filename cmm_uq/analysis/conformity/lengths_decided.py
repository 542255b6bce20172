"""Tests on calibrated lengths: errors of indication, and the range of their repeats."""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence

import numpy as np
from numpy.typing import NDArray

from cmm_uq.analysis.conformity.as_recorded import added_in_words
from cmm_uq.analysis.conformity.plan_conditions import nominals, with_offset
from cmm_uq.analysis.conformity.plans import Condition, position_on
from cmm_uq.analysis.conformity.shared_causes import Causes, causes_of_lengths, length_budget, temperatures
from cmm_uq.analysis.conformity.standard import NOT_STATED, Test
from cmm_uq.analysis.conformity.statement import Decided, Remeasurement, Statement, least_favourable, with_standing
from cmm_uq.analysis.conformity.uncertainty_lines import LENGTH_LINES, WARM, away_from_20, u_of_repeats
from cmm_uq.base.messages import NOTHING, Text, at_key, plural, say, semicolons
from cmm_uq.base.points import Ints
from cmm_uq.base.units import MICROMETRE, REFERENCE_TEMPERATURE
from cmm_uq.jobs.tables.artefact import ArtefactFacts
from cmm_uq.jobs.tables.circumstances import LINE_KEYS, TestUncertainty
from cmm_uq.machine.model.artefact import Artefact, Indications
from cmm_uq.maths.uncertainty.quantity import nominal

NORMAL_EXPANSION = (
    8e-6,
    13e-6,
)  # 1/K; a gauge outside is not of normal expansion (ISO 10360-2:2009, as commonly reported)
REPEATS_CANCEL = say(
    "What the gauge's certificate leaves uncertain is common to the repeats and cancels; u is what of the gauge "
    "changes between them."
)
Chosen = Callable[[Artefact, Indications], NDArray[np.bool_]]  # which lengths of a recording belong to a test, (m,)


def at_offset(offset_mm: float) -> Chosen:
    """Lengths measured with the stylus tip so far across the ram."""
    return lambda artefact, found: with_offset(artefact.points, found.rows, offset_mm)


def on_lines(positions: Collection[Text]) -> Chosen:
    return lambda artefact, found: np.array([line in positions for line in lines(artefact, found)], dtype=bool)


def short(longest_mm: float) -> Chosen:
    """Short lengths whose ends are reached from opposite sides, or may be."""

    def chosen(artefact: Artefact, found: Indications) -> NDArray[np.bool_]:
        both = artefact.bidirectional(found.rows)
        return np.asarray((found.lengths <= longest_mm) & (True if both is None else both))

    return chosen


def lines(artefact: Artefact, found: Indications) -> list[Text]:
    middles, along = artefact.lines_of(found.rows)
    return [position_on(artefact.points.machine, m, d) for m, d in zip(middles, along, strict=True)]


def errors_of_indication(test: Test, *, chosen: Chosen | None = None, again: Remeasurement | None = None) -> Statement:
    """Every error of indication against its own maximum permissible error."""
    found, under, points = test.indications(), test.circumstances, test.artefact.points
    rows, others = _of_this_test(test, found, chosen)
    first, position, aside = found.rows[:, 0], lines(test.artefact, found), test.set_aside(found.rows)
    errors, limits = found.errors / MICROMETRE, test.limits_um(found.lengths)
    causes = causes_of_lengths(found, test.artefact, under).at_least(test.least_u(found.lengths))
    test.refuse_without_uncertainty(float(causes.u[rows].min()), "u_um")
    items = tuple(
        test.decided(
            float(errors[i]), float(causes.u[i]), float(limits[i]), signed=True,
            measurement=int(points.measurement[first[i]]), repeat=int(points.repeat[first[i]]),
            length_mm=float(found.lengths[i]), position=position[i], set_aside=bool(aside[i]),
        )
        for i in rows
    )  # fmt: skip
    if again is not None:
        items = with_standing(items, nominals(found.lengths)[rows], again)
    worst = least_favourable(items)
    named, degrees = int(rows[items.index(worst)]), temperatures(found, test.artefact)
    remarks = [*_in_words(items, worst, under.uncertainty), *others, *_again_in_words(items, again)]
    remarks += [text for text in (unknown_expansion(test.artefact, under.cte_per_k),
                                  added_in_words(under.short_gauge, found)) if text]  # fmt: skip
    if test.artefact.bidirectional(found.rows) is None:
        remarks.append(say("Whether the lengths are bidirectional is not recorded."))
    if under.uncertainty.u_cte_per_k and degrees is None:
        remarks.append(
            say("Without temp_artefact_c the lengths are taken to be at 20 °C, where u_cte_per_k counts for nothing.")
        )
    budget = length_budget(
        float(found.lengths[named]), float(found.u[named]),
        REFERENCE_TEMPERATURE if degrees is None else float(degrees[named]), under,
        0.0 if found.u_beside is None else float(found.u_beside[named]),
    )  # fmt: skip
    return test.stated(
        say("error of indication of length, worst against its limit"), say("lengths"), items, remarks,
        causes=causes.of(rows), budget=budget, repeats=None if again is None else again.repeats,
    )  # fmt: skip


def repeatability_range(test: Test, *, repeats: int, chosen: Chosen | None = None) -> Statement:
    """Range of the first repeats of each length in each place, against the limit of repeatability."""
    found = test.indications()
    rows, others = _of_this_test(test, found, chosen)
    least = u_of_repeats(float(found.lengths[rows].min()), test.circumstances)
    test.refuse_without_uncertainty(least, "u_repeat_um")
    points, first, aside = test.artefact.points, found.rows[:, 0], test.set_aside(found.rows)
    position, both = lines(test.artefact, found), test.artefact.bidirectional(found.rows)
    kind = np.zeros(len(found.rows), dtype=np.int64) if both is None else both.astype(np.int64)
    keys = np.column_stack([points.measurement[first], nominals(found.lengths), kind])
    items, single = [], []
    for key in dict.fromkeys(map(tuple, keys[rows])):
        own = rows[np.all(keys[rows] == key, axis=1)]
        own = own[np.isin(points.repeat[first[own]], np.unique(points.repeat[first[own]])[:repeats])]
        length = float(found.lengths[own].mean())
        if len(np.unique(points.repeat[first[own]])) < 2:
            single.append(say("repeats of {length:.5g} mm in measurement {number}", length=length, number=int(key[0])))
            continue
        value = float(np.ptp(found.errors[own])) / MICROMETRE
        known = test.at_least(u_of_repeats(length, test.circumstances), length)
        items.append(test.decided(
            value, known, test.limit_um(length), signed=False, measurement=int(key[0]), length_mm=length,
            position=position[own[0]], set_aside=bool(aside[own].any()),
        ))  # fmt: skip
    test.refuse_nothing_measured(bool(items), "repeats of lengths")
    count = len(items)
    remarks = [
        say("The range of the first {repeats} repeats of each length: {count} ranges.", repeats=repeats, count=count),
        REPEATS_CANCEL if least > 0 else NOT_STATED,
        *others,
    ]
    causes = Causes(np.zeros((count, 0)), np.array([item.u_um for item in items]), np.arange(count))
    return test.stated(say("range of repeated lengths, worst against its limit"), say("ranges"), tuple(items), remarks,
                       signed=False, repeats=repeats, causes=causes, lacking=single)  # fmt: skip


def length_unstated(artefact: ArtefactFacts) -> str | None:
    """The key without which a calibrated length has no uncertainty."""
    return "u_um" if artefact.certified and not artefact.u_um else None


def normal_expansion(test: Test) -> tuple[Condition, ...]:
    """A length of normal expansion, where that of the gauge is stated and is another (ISO 10360-2:2009)."""
    cte, (low, high) = test.circumstances.cte_per_k, NORMAL_EXPANSION
    if not cte or low <= cte <= high:
        return ()
    what = say(
        "a length of normal expansion, {low:g} to {high:g} × 10⁻⁶ /K (that of the gauge is {cte:.3g} × 10⁻⁶ /K)",
        low=low * 1e6, high=high * 1e6, cte=cte * 1e6,
    )  # fmt: skip
    return (Condition(what, (what,)),)


def unknown_expansion(artefact: Artefact, cte_per_k: float | None) -> Text:
    """What a reader must know of lengths measured away from 20 °C on a gauge of unknown expansion; else nothing."""
    away = away_from_20(artefact)
    if cte_per_k or away < WARM:
        return NOTHING
    return say(
        "The artefact was up to {away:.2g} K from 20 °C and its expansion is not stated{key}: its lengths "
        "are taken as those at 20 °C, which for steel is {steel:.2g} µm wrong in a metre.",
        away=away, steel=11.5 * away, key=at_key("[artefact] cte_per_k"),
    )  # fmt: skip


def _of_this_test(test: Test, found: Indications, chosen: Chosen | None) -> tuple[Ints, list[Text]]:
    """Lengths that are decided, no copies among them; and how many of the recording belong to another test, in words."""
    copied = np.isin(test.recorded.points.group[found.rows[:, 0]], list(test.recorded.points.copies))
    own = ~copied & (True if chosen is None else chosen(test.artefact, found))
    test.refuse_nothing_measured(bool(own.any()), "lengths of its own positions, tips and sizes")
    count = int((~copied & ~own).sum())
    one = say("{count} length recorded beside them has another position, stylus tip or size, and is not decided.",
              count=count)  # fmt: skip
    many = say("{count} lengths recorded beside them have another position, stylus tip or size, and are not decided.",
               count=count)  # fmt: skip
    return np.flatnonzero(own), [plural(count, one=one, many=many)] if count else []


def _in_words(items: Sequence[Decided], worst: Decided, stated: TestUncertainty) -> tuple[Text, Text]:
    """Where u comes from, and how many lengths are decided with it."""
    uncertain = NOT_STATED
    if worst.u_um > 0 and any(getattr(stated, LINE_KEYS[line]) or stated.declared(line) for line in LENGTH_LINES[1:]):
        uncertain = say(
            "u is the test uncertainty (ISO/TS 23165), {u_um:.3g} µm for the length named.", u_um=worst.u_um
        )
    elif worst.u_um > 0:
        uncertain = say(
            "u is the part of the test uncertainty (ISO/TS 23165) that comes from the calibrated length, {u_um:.3g} µm for "
            "the length named; nothing else is stated.",
            u_um=worst.u_um,
        )
    least = say(
        "least favourable: measurement {measurement}, repeat {repeat}, {length} mm",
        measurement=worst.measurement or 0, repeat=worst.repeat or 0, length=nominal(worst.length_mm or 0.0),
    )  # fmt: skip
    one = say("{count} length decided, each by its own u and limit; {least}.", count=len(items), least=least)
    many = say("{count} lengths decided, each by its own u and limit; {least}.", count=len(items), least=least)
    return uncertain, plural(len(items), one=one, many=many)


def _again_in_words(items: Sequence[Decided], again: Remeasurement | None) -> list[Text]:
    if again is None:
        return []

    def named(standing: str) -> Text:
        places = [(item.measurement or 0, item.length_mm or 0.0) for item in items if item.standing == standing]
        return semicolons(say("measurement {measurement}, {length} mm", measurement=measurement, length=nominal(length))
                          for measurement, length in dict.fromkeys(places))  # fmt: skip

    told: list[Text] = []
    if which := named("again"):
        told.append(say(
            "One of {repeats} values lies outside: measure {readings} times more, as further repeats of the same "
            "measurement, all of which must lie inside: {which}.",
            repeats=again.repeats, readings=again.readings, which=which,
        ))  # fmt: skip
    if which := named("replaced"):
        told.append(say("One of {repeats} values lay outside and was measured {readings} times more, all inside: {which}.",
                        repeats=again.repeats, readings=again.readings, which=which))  # fmt: skip
    return told
