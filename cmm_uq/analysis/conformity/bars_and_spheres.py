"""Tests on a ballbar (ASME B89.4.1-1997), whose certificate cancels, and on a test sphere (form and size, ISO/TS 23165)."""

from __future__ import annotations

from functools import partial

import numpy as np

from cmm_uq.analysis.conformity.plan_conditions import tip_offsets
from cmm_uq.analysis.conformity.plans import (
    OFFSET_TOLERANCE_MM,
    Condition,
    OffsetPlan,
    RepeatPlan,
    SpherePlan,
    position_of,
)
from cmm_uq.analysis.conformity.shared_causes import Causes, length_budget
from cmm_uq.analysis.conformity.standard import NOT_STATED, Test
from cmm_uq.analysis.conformity.statement import Statement, least_favourable
from cmm_uq.analysis.conformity.uncertainty_lines import u_of_repeats
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.messages import Text, at_key, say
from cmm_uq.base.points import Floats
from cmm_uq.base.units import MICROMETRE, REFERENCE_TEMPERATURE, unit
from cmm_uq.jobs.tables.artefact import ArtefactFacts
from cmm_uq.machine.model.artefact import Artefact, Forms
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


def form_error(test: Test) -> Statement:
    """Range of the radial distances of each sphere from its least-squares sphere."""
    from cmm_uq.maths.uncertainty.budgets.machine import probing_test_uncertainty

    probed, size, u_form_um = _probed(test), test.artefact.sizes[0].nominal, test.circumstances.uncertainty.u_form_um
    u = float(np.hypot(probed.certified / MICROMETRE / 2, u_form_um))
    test.refuse_without_uncertainty(u, "form_um")
    if u > 0 and u_form_um:
        remark = say("u is the test uncertainty (ISO/TS 23165): half the form deviation of the sphere, and what its "
                     "calibration leaves uncertain, {u:.2g} µm.", u=u)  # fmt: skip
    elif u > 0:
        remark = say(
            "u is the test uncertainty (ISO/TS 23165): half the form deviation of the sphere, {u:.2g} µm.", u=u
        )
    else:
        remark = say(
            "The test sphere is taken as perfectly round: its form deviation{key} is not given.", key=at_key("form_um")
        )
    budget = probing_test_uncertainty(probed.certified, u_form_um * MICROMETRE)
    values = probed.form / MICROMETRE
    return _stated(
        test, probed, say("probing form error"), values, test.at_least(u, size), remark, budget, signed=False
    )


def size_error(test: Test) -> Statement:
    """Diameter of each least-squares sphere minus the certified one, from the same points as the form."""
    probed, sphere = _probed(test), test.artefact.sizes[0]
    if probed.size is None:
        raise CmmUqError(f"{test.characteristic.name} of {test.facts.standard} compares with a certified diameter",
                         where=f"job.toml {test.key} characteristic",
                         fix="Give length_mm and u_um in [artefact], or leave the statement out")  # fmt: skip
    recorded = test.artefact.points.columns.get("temp_artefact_c")
    degrees = REFERENCE_TEMPERATURE if recorded is None else float(recorded.mean())
    budget = length_budget(sphere.nominal, sphere.sd, degrees, test.circumstances)
    u = budget.u / MICROMETRE
    test.refuse_without_uncertainty(u, "u_um")
    remark = NOT_STATED
    if u > 0:
        remark = say("u is the test uncertainty (ISO/TS 17865, as that of a length by ISO/TS 23165): {u:.2g} µm.", u=u)
    values, known = probed.size / MICROMETRE, test.at_least(u, sphere.nominal)
    return _stated(test, probed, say("probing size error"), values, known, remark, budget, signed=True)


def _stated(
    test: Test,
    probed: Forms,
    quantity: Text,
    values: np.ndarray,
    u: float,
    remark: Text,
    budget: Budget,
    *,
    signed: bool,
) -> Statement:
    """Every sphere (q,) decided on its value, µm, all with one u, which they share."""
    size = test.artefact.sizes[0].nominal
    runs = [(i, int(probed.measurement[i]), int(probed.repeat[i])) for i in np.flatnonzero(_originals(test, probed))]
    items = tuple(
        test.decided(float(values[i]), u, test.limit_um(size), signed=signed, measurement=measurement, repeat=repeat,
                     length_mm=size, set_aside=test.set_aside_in(measurement, repeat))
        for i, measurement, repeat in runs
    )  # fmt: skip
    remarks, count, worst = [remark], len(items), least_favourable(items)
    if count > 1:
        remarks.append(say("The largest of {count} spheres: measurement {measurement}.", count=count,
                           measurement=worst.measurement or 0))  # fmt: skip
    causes = Causes(np.full((count, 1), u), np.zeros(count), np.arange(count))
    return test.stated(quantity, say("points"), items, remarks, signed=signed, causes=causes, budget=budget)


def range_of_centres(test: Test) -> Statement:
    """Largest range, along an axis, of the middle of a sphere that was probed again and again (ASME B89.4.1-1997)."""
    probed, size = _probed(test), test.artefact.sizes[0].nominal
    if probed.centres is None:
        raise CmmUqError(f"{test.facts.standard} compares middles of a sphere, and the {test.artefact.kind} has none",
                         where=f"job.toml {test.key} standard", fix="Leave the statement out")  # fmt: skip
    u = u_of_repeats(size, test.circumstances)
    test.refuse_without_uncertainty(u, "u_repeat_um")
    items = []
    for number in np.unique(probed.measurement):
        own = _originals(test, probed) & (probed.measurement == number)
        if own.sum() > 1:
            value = float(np.ptp(probed.centres[own], axis=0).max()) / MICROMETRE
            items.append(test.decided(value, test.at_least(u, size), test.limit_um(size), signed=False,
                                      measurement=int(number), set_aside=test.set_aside_in(int(number))))  # fmt: skip
    test.refuse_nothing_measured(bool(items), "repeats of one sphere in its place")
    remark = say("u is what of the sphere changed between the repeats.") if u > 0 else NOT_STATED
    return test.stated(say("range of the middle of a fixed ball"), say("ranges"), tuple(items), [remark], signed=False)


def form_unstated(artefact: ArtefactFacts) -> str | None:
    """The key without which a form has no uncertainty."""
    key = artefact.form_key
    return key if key is not None and not getattr(artefact, key) else None


def diameter_allowed(test: Test, plan: SpherePlan) -> tuple[Condition, ...]:
    """A test sphere of the size that the standard asks for."""
    (low, high), diameter = plan.diameter_mm, test.artefact.sizes[0].nominal
    what = say("test sphere of {low:g} to {high:g} mm", low=low, high=high)
    lacks = say("{what} ({diameter} mm)", what=what, diameter=nominal(diameter))
    return (Condition(what, () if low <= diameter <= high else (lacks,)),)


def sensing_stated(test: Test) -> tuple[Condition, ...]:
    """That the probe is optical, for a standard of optical probes alone."""
    what = say('an optical probe ([probe] sensing = "optical")')
    return (Condition(what, () if test.circumstances.probe.sensing == "optical" else (what,)),)


def repeats_of_sphere(plan: RepeatPlan, artefact: Artefact, *, recorded: bool) -> tuple[Condition, ...]:
    """How often each sphere was probed in its place."""
    probed = artefact.forms()
    what = say("{repeats} repeats of the fixed ball", repeats=plan.repeats)
    if probed is None:
        return (Condition(what, (what,)),)
    points = artefact.points
    copies = points.copies if recorded else {}
    runs = [points.run_of(group) for group in range(int(points.group.max()) + 1) if group not in copies]
    most = int(max(np.bincount([number - min(runs)[0] for number, _ in runs])))
    return (Condition(what, () if most >= plan.repeats else (say("{what} ({most})", what=what, most=most),)),)


def _probed(test: Test) -> Forms:
    probed = test.artefact.forms()
    if probed is None:
        raise CmmUqError(f"{test.facts.standard} compares the form of spheres, and the {test.artefact.kind} has none",
                         where=f"job.toml {test.key} standard", fix="Leave the statement out")  # fmt: skip
    return probed


def _originals(test: Test, probed: Forms) -> np.ndarray:
    """Spheres (q,) that are no copies."""
    points = test.recorded.points
    copies = {points.run_of(group) for group in points.copies}
    return np.array([(int(m), int(r)) not in copies for m, r in zip(probed.measurement, probed.repeat, strict=True)])
