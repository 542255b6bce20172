"""Tests on a ballbar: the range of its lengths, and what a stylus tip to the side changes (ASME B89.4.1-1997).

Both compare lengths of one bar with each other. What its certificate leaves uncertain is common to them and cancels;
uncertain is what of the bar changes from one position to the next: its temperature and fixturing. The distance of the centres
of two balls does not depend on how the bar is aligned. The machine's own scatter is part of what is tested, as it is of ISO
10360-2.
"""

from __future__ import annotations

from functools import partial

import numpy as np

from cmm_uq.analysis.conformity.length_conditions import tip_offsets
from cmm_uq.analysis.conformity.plans import OFFSET_TOLERANCE_MM, Condition, OffsetPlan, position_of
from cmm_uq.analysis.conformity.standard import NOT_STATED, Test
from cmm_uq.analysis.conformity.statement import Statement
from cmm_uq.analysis.conformity.uncertainty_lines import u_of_repeats
from cmm_uq.base.messages import Text, say
from cmm_uq.base.points import Floats
from cmm_uq.base.units import MICROMETRE, unit
from cmm_uq.machine.model.artefact import Artefact
from cmm_uq.maths.uncertainty.budget import CERTIFICATE, JUDGEMENT, Budget, BudgetLine
from cmm_uq.maths.uncertainty.quantity import nominal

_OPPOSITE = -0.9  # Cosine of the angle between two tips from which on they look away from each other
_RIGHT_ANGLE = 0.1  # Of a bar's direction, the part along a tip below which it is square to it


def volumetric_performance(test: Test) -> Statement:
    """Range of the ballbar's lengths (5.5.2)."""
    artefact, measured = test.artefact, test.accuracy["b89_range_um"]
    bar = artefact.sizes[0].nominal
    budget, remark = _budget(test)
    u = test.at_least(budget.u if budget.u > 0 or test.answered else measured.u, bar)
    lengths, aside = artefact.lengths(), bool(test.set_aside(artefact.rows).any())
    value = measured.value if lengths is None or not aside else float(np.ptp(lengths)) / MICROMETRE
    item = test.decided(value, u, test.limit_um(bar), signed=False, length_mm=bar, set_aside=aside)
    quantity = say("range of the ballbar lengths")
    return test.stated(quantity, say("lengths"), (item,), [remark], signed=False, budget=budget)


def _budget(test: Test) -> tuple[Budget, Text]:
    stated, size = test.circumstances.uncertainty, test.artefact.sizes[0]
    two = partial(BudgetLine, origin=JUDGEMENT, unit=unit("µm"), sensitivity=float(np.sqrt(2.0)))
    expansion = abs(test.circumstances.cte_per_k or 0.0) * size.nominal / MICROMETRE
    lines = [
        BudgetLine(say("temperature of the bar, twice"), stated.u_temperature_k, JUDGEMENT, unit=unit("K"),
                   sensitivity=float(np.sqrt(2.0)) * expansion),
        two(say("fixturing of the bar, twice"), stated.u_fixturing_um),
    ]  # fmt: skip
    if u_of_repeats(size.nominal, test.circumstances) == stated.u_repeat_um:
        lines = [BudgetLine(say("repeated readings of the bar"), stated.u_repeat_um, JUDGEMENT, unit=unit("µm"))]
    what = say("range of the lengths of a bar of {length} mm", length=nominal(size.nominal))
    budget = Budget(what, lines, unit=unit("µm"))
    if budget.u > 0:
        return budget, say(
            "u is the test uncertainty: what of the bar changed between its positions, {u:.3g} µm. "
            "What its certificate leaves uncertain is common to all and cancels; the machine's own scatter is part of what "
            "is tested.",
            u=budget.u,
        )
    if test.answered:
        return budget, NOT_STATED
    if size.certified and size.sd > 0:
        bound = Budget(what, [two(say("certificate of the bar, twice"), size.sd / MICROMETRE, origin=CERTIFICATE)],
                       unit=unit("µm"))  # fmt: skip
        return bound, say(
            "u is a bound of the test uncertainty, {u:.3g} µm: it is not stated what of the bar changed between its "
            "positions, and it is taken to be no more than its certificate leaves uncertain. The machine's own scatter is "
            "part of what is tested.",
            u=bound.u,
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
    asked = "a bar measured with the stylus tip to both sides (tip_x_mm, tip_y_mm, tip_z_mm)"
    test.refuse_nothing_measured(bool(found), asked)
    _, along = test.artefact.lines_of(test.artefact.rows)
    aside = {position_of(along[i]) for i in np.flatnonzero(test.set_aside(test.artefact.rows))}
    items = tuple(
        test.decided(value, test.at_least(u, bar), test.limit_um(bar), signed=True, measurement=number, length_mm=bar,
                     position=position, set_aside=position in aside)
        for position, number, value in found
    )  # fmt: skip
    remark = say("u is what of the bar changed between both readings.") if u > 0 else NOT_STATED
    quantity = say("difference of the bar's lengths with opposite offsets, worst against its limit")
    return test.stated(quantity, say("differences"), items, [remark])


def offset_positions(plan: OffsetPlan, artefact: Artefact, *, recorded: bool) -> tuple[Condition, ...]:
    """Which positions were measured with tips to both sides."""
    measured = {position for position, _, _ in _differences(artefact)}
    lacking = dict.fromkeys(position for position in plan.positions if position not in measured)
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
    for i in np.flatnonzero(~copied & (np.linalg.norm(tip, axis=1) > OFFSET_TOLERANCE_MM)):
        direction, side = along[i] / np.linalg.norm(along[i]), tip[i] / np.linalg.norm(tip[i])
        if abs(float(direction @ side)) > _RIGHT_ANGLE:
            continue
        here = sides.setdefault(position_of(direction), [])
        same = next((one for one in here if float(one[0] @ side) > -_OPPOSITE), None)
        if same is None:
            here.append((side, int(points.measurement[first[i]]), [float(lengths[i])]))
        else:
            same[2].append(float(lengths[i]))
    return [
        (position, one[1], (float(np.mean(one[2])) - float(np.mean(other[2]))) / MICROMETRE)
        for position, here in sides.items()
        for k, one in enumerate(here)
        for other in here[k + 1 :]
        if float(one[0] @ other[0]) < _OPPOSITE
    ]
