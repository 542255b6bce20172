"""Tests on calibrated lengths, on a ballbar (ASME B89.4.1-1997), whose certificate cancels, and on a test sphere."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Collection, Iterator, Sequence
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from cmm_uq.analysis.conformity import plans, uncertainty
from cmm_uq.analysis.conformity.as_recorded import added_in_words
from cmm_uq.analysis.conformity.plan_conditions import nominals, tip_offsets, with_offset
from cmm_uq.analysis.conformity.plans import Condition
from cmm_uq.analysis.conformity.standard import NOT_STATED, Test
from cmm_uq.analysis.conformity.statement import Decided, Remeasurement, Statement, least_favourable, with_standing
from cmm_uq.analysis.conformity.uncertainty import Causes, causes_of_lengths, length_budget, temperatures, u_of_repeats
from cmm_uq.base.messages import Text, at_key, plural, say, semicolons
from cmm_uq.base.points import Floats, Ints
from cmm_uq.base.units import MICROMETRE, REFERENCE_TEMPERATURE, unit
from cmm_uq.jobs.tables.conformity import LINE_KEYS, TestUncertainty
from cmm_uq.machine.model.artefact import Artefact, Forms, Indications
from cmm_uq.maths.uncertainty.budget import CERTIFICATE, JUDGEMENT, Budget, BudgetLine
from cmm_uq.maths.uncertainty.quantity import nominal, significant

_OPPOSITE = -0.9  # Cosine of the angle between two tips from which on they look away from each other
_RIGHT_ANGLE = 0.1  # Of a bar's direction, the part along a tip below which it is square to it
REPEATS_CANCEL = say(
    "What the gauge's certificate leaves uncertain is common to the repeats and cancels; u is what of the gauge "
    "changes between them."
)
Chosen = Callable[[Artefact, Indications], NDArray[np.bool_]]  # which lengths of a recording belong to a test, (m,)


def at_offset(offset_mm: float) -> Chosen:
    return lambda artefact, found: with_offset(artefact.points, found.rows, offset_mm)


def on_lines(these: Collection[Text]) -> Chosen:
    """Lengths in these positions, or in their directions elsewhere, which no test needs and none may leave out."""
    positions = set(these)

    def chosen(artefact: Artefact, found: Indications) -> NDArray[np.bool_]:
        _, along = artefact.lines_of(found.rows)
        named = zip(lines(artefact, found), map(plans.position_of, along), strict=True)
        return np.array([not positions.isdisjoint(each) for each in named], dtype=bool)

    return chosen


def short(longest_mm: float) -> Chosen:
    """Short lengths whose ends are reached from opposite sides, or may be."""

    def chosen(artefact: Artefact, found: Indications) -> NDArray[np.bool_]:
        both = artefact.bidirectional(found.rows)
        return np.asarray((found.lengths <= longest_mm) & (True if both is None else both))

    return chosen


def lines(artefact: Artefact, found: Indications) -> list[Text]:
    middles, along = artefact.lines_of(found.rows)
    return [plans.position_on(artefact.points.machine, m, d) for m, d in zip(middles, along, strict=True)]


def errors_of_indication(test: Test, *, chosen: Chosen | None = None, again: Remeasurement | None = None) -> Statement:
    """Every error of indication against its own maximum permissible error."""
    found, under, points = test.indications(), test.circumstances, test.artefact.points
    rows, others = _of_this_test(test, found, chosen)
    first, position, aside = found.rows[rows, 0], lines(test.artefact, found), test.set_aside(found.rows)
    causes = causes_of_lengths(found, test.artefact, under).at_least(test.least_u(found.lengths))
    test.refuse_without_uncertainty(float(causes.u[rows].min()), "u_um")
    items = test.each_decided(
        found.errors[rows] / MICROMETRE,
        causes.u[rows],
        found.lengths[rows],
        signed=True,
        set_aside=aside[rows],
        measurement=points.measurement[first].tolist(),
        repeat=points.repeat[first].tolist(),
        position=[position[i] for i in rows],
    )
    if again is not None:
        items = with_standing(items, nominals(found.lengths)[rows], again)
    worst = least_favourable(items)
    named, degrees = int(rows[items.index(worst)]), temperatures(found, test.artefact)
    remarks = [*_in_words(items, worst, under.uncertainty), *others, *_again_in_words(items, again)]
    about = uncertainty.unknown_expansion(test.artefact, under.cte_per_k), added_in_words(under.short_gauge, found)
    remarks += [text for text in about if text]
    if test.artefact.bidirectional(found.rows) is None:
        remarks.append(say("Whether the lengths are bidirectional is not recorded."))
    if under.uncertainty.u_cte_per_k and degrees is None:
        remarks.append(
            say("Without temp_artefact_c the lengths are taken to be at 20 °C, where u_cte_per_k counts for nothing.")
        )
    length, u, at = found.lengths[named], found.u[named], REFERENCE_TEMPERATURE if degrees is None else degrees[named]
    beside = 0.0 if found.u_beside is None else float(found.u_beside[named])
    budget = length_budget(float(length), float(u), float(at), under, beside)
    quantity, repeats = say("error of indication of length, worst against its limit"), again.repeats if again else None
    return test.stated(quantity, say("lengths"), items, remarks, causes=causes.of(rows), budget=budget, repeats=repeats)


def repeatability_range(test: Test, *, repeats: int, chosen: Chosen | None = None) -> Statement:
    """Range of the first repeats of each length in each place, against the limit of repeatability."""
    found, under = test.indications(), test.circumstances
    rows, others = _of_this_test(test, found, chosen)
    least = u_of_repeats(float(found.lengths[rows].min()), under)
    test.refuse_without_uncertainty(least, "u_repeat_um")
    points, first, aside = test.artefact.points, found.rows[:, 0], test.set_aside(found.rows)
    position, both = lines(test.artefact, found), test.artefact.bidirectional(found.rows)
    kind = np.zeros(len(found.rows), dtype=np.int64) if both is None else both.astype(np.int64)
    keys = np.column_stack([points.measurement[first], nominals(found.lengths), kind])
    items, single = [], []
    for key in dict.fromkeys(map(tuple, keys[rows])):
        own = rows[np.all(keys[rows] == key, axis=1)]
        own = own[np.isin(points.repeat[first[own]], np.unique(points.repeat[first[own]])[:repeats])]
        length, number = float(found.lengths[own].mean()), int(key[0])
        if len(np.unique(points.repeat[first[own]])) < 2:
            single.append(say("repeats of {length:.5g} mm in measurement {number}", length=length, number=number))
            continue
        items.append(test.decided(
            float(np.ptp(found.errors[own])) / MICROMETRE, test.at_least(u_of_repeats(length, under), length),
            test.limit_um(length), signed=False, measurement=number, length_mm=length, position=position[own[0]],
            set_aside=bool(aside[own].any()),
        ))  # fmt: skip
    test.refuse_nothing_measured(bool(items), "repeats of lengths")
    count = len(items)
    what = say("The range of the first {repeats} repeats of each length: {count} ranges.", repeats=repeats, count=count)
    causes = Causes(np.zeros((count, 0)), np.array([item.u_um for item in items]), np.arange(count))
    return test.stated(
        say("range of repeated lengths, worst against its limit"), say("ranges"), tuple(items),
        [what, REPEATS_CANCEL if least > 0 else NOT_STATED, *others], signed=False, repeats=repeats, causes=causes,
        lacking=single,
    )  # fmt: skip


def _of_this_test(test: Test, found: Indications, chosen: Chosen | None) -> tuple[Ints, list[Text]]:
    """Lengths that are decided, no copies among them; and how many of the recording belong to another test, in words."""
    copied = np.isin(test.recorded.points.group[found.rows[:, 0]], list(test.recorded.points.copies))
    own = ~copied & (True if chosen is None else chosen(test.artefact, found))
    test.refuse_nothing_measured(bool(own.any()), "lengths of its own positions, tips and sizes")
    count = int((~copied & ~own).sum())
    one = say(
        "{count} length recorded beside them has another position, stylus tip or size, and is not decided.", count=count
    )
    many = say(
        "{count} lengths recorded beside them have another position, stylus tip or size, and are not decided.",
        count=count,
    )
    return np.flatnonzero(own), [plural(count, one=one, many=many)] if count else []


def _in_words(items: Sequence[Decided], worst: Decided, stated: TestUncertainty) -> tuple[Text, Text]:
    """Where u comes from, and how many lengths are decided with it."""
    uncertain, u, shown = NOT_STATED, worst.u_um, significant(worst.u_um)
    beside = uncertainty.LENGTH_LINES[1:]
    if u > 0 and any(getattr(stated, LINE_KEYS[line]) or stated.declared(line) for line in beside):
        uncertain = say("u is the test uncertainty (ISO/TS 23165), {u_um} µm for the length named.", u_um=shown)
    elif u > 0:
        uncertain = say(
            "u is the part of the test uncertainty (ISO/TS 23165) that comes from the calibrated length, {u_um} µm for "
            "the length named; nothing else is stated.",
            u_um=shown,
        )
    least = say(
        "least favourable: measurement {measurement}, repeat {repeat}, {length} mm",
        measurement=worst.measurement or 0, repeat=worst.repeat or 0, length=nominal(worst.length_mm or 0.0),
    )  # fmt: skip
    one = say("{count} length decided, each by its own u and limit; {least}.", count=len(items), least=least)
    many = say("{count} lengths decided, each by its own u and limit; {least}.", count=len(items), least=least)
    return uncertain, plural(len(items), one=one, many=many)


def _again_in_words(items: Sequence[Decided], again: Remeasurement | None) -> Iterator[Text]:
    for standing in ("again", "replaced") if again else ():
        of = [item for item in items if item.standing == standing]
        places = dict.fromkeys((one.measurement or 0, nominal(one.length_mm or 0.0)) for one in of)
        each = (say("measurement {measurement}, {length} mm", measurement=m, length=length) for m, length in places)
        if again and places:
            repeats, readings, which = again.repeats, again.readings, semicolons(each)
            further = say(
                "One of {repeats} values lies outside: measure {readings} times more, as further repeats of the same "
                "measurement, all of which must lie inside: {which}.", repeats=repeats, readings=readings, which=which,
            )  # fmt: skip
            done = say("One of {repeats} values lay outside and was measured {readings} times more, all inside: {which}.",
                       repeats=repeats, readings=readings, which=which)  # fmt: skip
            yield further if standing == "again" else done


def volumetric_performance(test: Test) -> Statement:
    artefact, measured = test.artefact, test.accuracy["b89_range_um"]
    bar = artefact.sizes[0].nominal
    budget, remark = _bar_budget(test)
    u = test.at_least(budget.u if budget.u > 0 or test.answered else measured.u, bar)
    lengths, aside = artefact.lengths(), bool(test.set_aside(artefact.rows).any())
    value = measured.value if lengths is None or not aside else float(np.ptp(lengths)) / MICROMETRE
    item = test.decided(value, u, test.limit_um(bar), signed=False, length_mm=bar, set_aside=aside)
    quantity = say("range of the ballbar lengths")
    return test.stated(quantity, say("lengths"), (item,), [remark], signed=False, budget=budget)


def _bar_budget(test: Test) -> tuple[Budget, Text]:
    stated, size = test.circumstances.uncertainty, test.artefact.sizes[0]
    micrometre, two = unit("µm"), float(np.sqrt(2.0))
    expansion = abs(test.circumstances.cte_per_k or 0.0) * size.nominal / MICROMETRE
    lines = [
        BudgetLine(say("temperature of the bar, twice"), stated.u_temperature_k, JUDGEMENT, unit=unit("K"),
                   sensitivity=two * expansion),
        BudgetLine(say("fixturing of the bar, twice"), stated.u_fixturing_um, JUDGEMENT, unit=micrometre, sensitivity=two),
    ]  # fmt: skip
    if u_of_repeats(size.nominal, test.circumstances) == stated.u_repeat_um:
        lines = [BudgetLine(say("repeated readings of the bar"), stated.u_repeat_um, JUDGEMENT, unit=micrometre)]
    what = say("range of the lengths of a bar of {length} mm", length=nominal(size.nominal))
    budget = Budget(what, lines, unit=micrometre)
    if budget.u > 0:
        return budget, say(
            "u is the test uncertainty: what of the bar changed between its positions, {u} µm. What its certificate leaves "
            "uncertain is common to all and cancels; the machine's own scatter is part of what is tested.",
            u=significant(budget.u),
        )
    if test.answered:
        return budget, NOT_STATED
    if size.certified and size.sd > 0:
        twice = say("certificate of the bar, twice")
        line = BudgetLine(twice, size.sd / MICROMETRE, CERTIFICATE, unit=micrometre, sensitivity=two)
        bound = Budget(what, [line], unit=micrometre)
        return bound, say(
            "u is a bound of the test uncertainty, {u} µm: it is not stated what of the bar changed between its "
            "positions, and it is taken to be no more than its certificate leaves uncertain. The machine's own scatter is "
            "part of what is tested.",
            u=significant(bound.u),
        )
    return budget, say(
        "Nothing is stated of what the bar leaves uncertain: in its place u is the machine's own "
        "scatter, by which the range would differ if the test were made again."
    )


def offset_probe(test: Test) -> Statement:
    """Difference of the bar's lengths with the stylus tip to one side and to the other, in each position."""
    bar = test.artefact.sizes[0].nominal
    u = u_of_repeats(bar, test.circumstances)
    test.refuse_without_uncertainty(u, "u_repeat_um")
    found = _differences(test.artefact)
    tips = "a bar measured with the stylus tip to both sides (tip_x_mm, tip_y_mm, tip_z_mm)"
    test.refuse_nothing_measured(bool(found), tips)
    _, along = test.artefact.lines_of(test.artefact.rows)
    aside = {plans.position_of(along[i]) for i in np.flatnonzero(test.set_aside(test.artefact.rows))}
    items = tuple(
        test.decided(value, test.at_least(u, bar), test.limit_um(bar), signed=True, measurement=number, length_mm=bar,
                     position=position, set_aside=position in aside)
        for position, number, value in found
    )  # fmt: skip
    remark = say("u is what of the bar changed between both readings.") if u > 0 else NOT_STATED
    quantity = say("difference of the bar's lengths with opposite offsets, worst against its limit")
    return test.stated(quantity, say("differences"), items, [remark])


def offset_positions(positions: Collection[Text], artefact: Artefact, *, recorded: bool) -> tuple[Condition, ...]:
    measured = {position for position, _, _ in _differences(artefact)}
    lacking = dict.fromkeys(position for position in positions if position not in measured)
    missing = tuple(say("{position} with the stylus tip to both sides", position=position) for position in lacking)
    return (Condition(say("four diagonals in vertical planes, each with two offsets"), missing),)


def _differences(artefact: Artefact) -> list[tuple[Text, int, float]]:
    """Position, measurement of the first reading, and the difference, µm, of each bar read with opposite tips."""
    lengths, tips = artefact.lengths(), tip_offsets(artefact.points)
    if lengths is None or tips is None:
        return []
    points, first = artefact.points, artefact.rows[:, 0]
    _, along = artefact.lines_of(artefact.rows)
    tip, copied = tips[first], np.isin(points.group[first], list(points.copies))
    sides: dict[Text, list[tuple[Floats, int, list[float]]]] = {}
    for i in np.flatnonzero(~copied & (np.linalg.norm(tip, axis=1) > plans.OFFSET_TOLERANCE_MM)):
        direction, side = along[i] / np.linalg.norm(along[i]), tip[i] / np.linalg.norm(tip[i])
        if abs(float(direction @ side)) > _RIGHT_ANGLE:
            continue
        here = sides.setdefault(plans.position_of(direction), [])
        same = next((values for other, _, values in here if float(other @ side) > -_OPPOSITE), None)
        if same is None:
            here.append((side, int(points.measurement[first[i]]), [float(lengths[i])]))
        else:
            same.append(float(lengths[i]))
    return [
        (position, one[1], (float(np.mean(one[2])) - float(np.mean(other[2]))) / MICROMETRE)
        for position, here in sides.items()
        for one, other in combinations(here, 2)
        if float(one[0] @ other[0]) < _OPPOSITE
    ]


def form_error(test: Test) -> Statement:
    """Range of the radial distances of each sphere from its least-squares sphere (ISO/TS 23165)."""
    from cmm_uq.maths.uncertainty.budgets.machine import probing_test_uncertainty

    probed, u_form_um = _probed(test), test.circumstances.uncertainty.u_form_um
    u = float(np.hypot(probed.certified / MICROMETRE / 2, u_form_um))
    test.refuse_without_uncertainty(u, "form_um")
    if u > 0 and u_form_um:
        text = say("u is the test uncertainty (ISO/TS 23165): half the form deviation of the sphere, and what its "
                   "calibration leaves uncertain, {u:.2g} µm.", u=u)  # fmt: skip
    elif u > 0:
        text = say("u is the test uncertainty (ISO/TS 23165): half the form deviation of the sphere, {u:.2g} µm.", u=u)
    else:
        key = at_key("form_um")
        text = say("The test sphere is taken as perfectly round: its form deviation{key} is not given.", key=key)
    budget = probing_test_uncertainty(probed.certified, u_form_um * MICROMETRE)
    return _of_spheres(test, probed, say("probing form error"), probed.form, u, text, budget, signed=False)


def size_error(test: Test) -> Statement:
    """Diameter of each least-squares sphere minus the certified one, from the same points as the form."""
    probed, sphere = _probed(test), test.artefact.sizes[0]
    if probed.size is None:
        problem = f"{test.characteristic.name} of {test.facts.standard} compares with a certified diameter"
        raise test.error(problem, "characteristic", "Give length_mm and u_um in [artefact], or leave the statement out")
    recorded = test.artefact.points.columns.get("temp_artefact_c")
    degrees = REFERENCE_TEMPERATURE if recorded is None else float(recorded.mean())
    budget = length_budget(sphere.nominal, sphere.sd, degrees, test.circumstances)
    u = budget.u / MICROMETRE
    test.refuse_without_uncertainty(u, "u_um")
    evaluated = say("u is the test uncertainty (ISO/TS 17865, as that of a length by ISO/TS 23165): {u:.2g} µm.", u=u)
    remark = evaluated if u > 0 else NOT_STATED
    return _of_spheres(test, probed, say("probing size error"), probed.size, u, remark, budget, signed=True)


def _of_spheres(
    test: Test, probed: Forms, quantity: Text, values: Floats, u: float, remark: Text, budget: Budget, *, signed: bool
) -> Statement:
    """Every sphere (q,) decided on its value, mm, all with one u, µm, which they share."""
    size = test.artefact.sizes[0].nominal
    u = test.at_least(u, size)
    own = np.flatnonzero(_originals(test, probed))
    runs = list(zip(probed.measurement[own].tolist(), probed.repeat[own].tolist(), strict=True))
    items = test.each_decided(
        values[own] / MICROMETRE, np.full(len(own), u), np.full(len(own), size), signed=signed,
        measurement=[m for m, _ in runs], repeat=[r for _, r in runs],
        set_aside=np.array([test.set_aside_in(*run) for run in runs], dtype=bool),
    )  # fmt: skip
    remarks, count, largest = [remark], len(items), least_favourable(items).measurement or 0
    if count > 1:
        remarks += [say("The largest of {count} spheres: measurement {measurement}.", count=count, measurement=largest)]
    causes = Causes(np.full((count, 1), u), np.zeros(count), np.arange(count))
    return test.stated(quantity, say("points"), items, remarks, signed=signed, causes=causes, budget=budget)


def range_of_centres(test: Test) -> Statement:
    """Largest range, along an axis, of the middle of a sphere that was probed again and again (ASME B89.4.1-1997)."""
    probed, size = _probed(test), test.artefact.sizes[0].nominal
    if probed.centres is None:
        raise test.error(f"{test.facts.standard} compares middles of a sphere, and the {test.artefact.kind} has none")
    u = u_of_repeats(size, test.circumstances)
    test.refuse_without_uncertainty(u, "u_repeat_um")
    items = []
    for number in np.unique(probed.measurement).tolist():
        own = _originals(test, probed) & (probed.measurement == number)
        if own.sum() > 1:
            value = float(np.ptp(probed.centres[own], axis=0).max()) / MICROMETRE
            items.append(test.decided(value, test.at_least(u, size), test.limit_um(size), signed=False,
                                      measurement=number, set_aside=test.set_aside_in(number)))  # fmt: skip
    test.refuse_nothing_measured(bool(items), "repeats of one sphere in its place")
    remark = say("u is what of the sphere changed between the repeats.") if u > 0 else NOT_STATED
    return test.stated(say("range of the middle of a fixed ball"), say("ranges"), tuple(items), [remark], signed=False)


def repeats_of_sphere(repeats: int, artefact: Artefact, *, recorded: bool) -> tuple[Condition, ...]:
    what, points = say("{repeats} repeats of the fixed ball", repeats=repeats), artefact.points
    if artefact.forms() is None:
        return (Condition(what, (what,)),)
    groups = set(range(int(points.group.max()) + 1)) - set(points.copies if recorded else ())
    most = max(Counter(points.run_of(group)[0] for group in groups).values())
    return (Condition(what, () if most >= repeats else (say("{what} ({most})", what=what, most=most),)),)


def _probed(test: Test) -> Forms:
    probed = test.artefact.forms()
    if probed is None:
        raise test.error(f"{test.facts.standard} compares the form of spheres, and the {test.artefact.kind} has none")
    return probed


def _originals(test: Test, probed: Forms) -> NDArray[np.bool_]:
    """Spheres (q,) that are no copies."""
    points = test.recorded.points
    copies = {points.run_of(group) for group in points.copies}
    return np.array([(int(m), int(r)) not in copies for m, r in zip(probed.measurement, probed.repeat, strict=True)])
