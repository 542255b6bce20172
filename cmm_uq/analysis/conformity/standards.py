"""The standards that a job may name, each with what is decided on it."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from dataclasses import replace
from functools import partial
from types import MappingProxyType

import numpy as np

from cmm_uq.analysis.conformity.as_recorded import OutsideReadings, repeats_of_gauge, supplemented
from cmm_uq.analysis.conformity.bars_and_spheres import (
    diameter_allowed,
    form_error,
    form_unstated,
    offset_positions,
    offset_probe,
    range_of_centres,
    repeats_of_sphere,
    sensing_stated,
    size_error,
    volumetric_performance,
)
from cmm_uq.analysis.conformity.clauses import CLAUSES
from cmm_uq.analysis.conformity.lengths_decided import (
    at_offset,
    errors_of_indication,
    length_unstated,
    normal_expansion,
    on_lines,
    repeatability_range,
    short,
)
from cmm_uq.analysis.conformity.plan_conditions import best_of, conditions
from cmm_uq.analysis.conformity.plans import (
    B89,
    B89_BIDIRECTIONAL,
    B89_LINEAR,
    B89_OFFSET,
    B89_REPEATABILITY,
    ISO_10360_2,
    ISO_10360_2_OFFSET,
    ISO_10360_5,
    ISO_10360_8,
    VDI_2617_2_1,
    Condition,
    ShortLengthPlan,
    SpherePlan,
)
from cmm_uq.analysis.conformity.standard import Characteristic, Standard, Test, characteristic_of
from cmm_uq.analysis.conformity.statement import Remeasurement, Statement
from cmm_uq.analysis.conformity.uncertainty_lines import FORM_LINES, LENGTH_LINES, REPEAT_LINES, SIZE_LINES
from cmm_uq.base.errors import CmmUqError, suggestion
from cmm_uq.base.messages import Text, Verbatim, say
from cmm_uq.base.plugins import STANDARDS, Plugin, named, offered
from cmm_uq.jobs.tables.circumstances import Circumstances
from cmm_uq.jobs.tables.conformity import ConformityFacts
from cmm_uq.machine.model.artefact import Artefact
from cmm_uq.machine.model.kind import BARS, FORMS, LENGTHS
from cmm_uq.maths.uncertainty.quantity import Quantity


def orientations(plan: ShortLengthPlan, artefact: Artefact, *, recorded: bool) -> tuple[Condition, ...]:
    """Orientations that differ, and how often the gauge was measured in each."""
    found, wanted = artefact.indications(), plan.orientations
    what = say("a length of at most {longest:g} mm in {count} orientations", longest=plan.longest_mm, count=wanted)
    if found is None:
        return (Condition(what, (what,)),)
    points, first = artefact.points, found.rows[:, 0]
    copied = np.isin(points.group[first], list(points.copies) if recorded else [])
    rows = np.flatnonzero(short(plan.longest_mm)(artefact, found) & ~copied)
    _, along = artefact.lines_of(found.rows)
    kept: list[tuple[np.ndarray, set[int]]] = []
    for i in rows:
        direction, group = along[i] / np.linalg.norm(along[i]), int(points.group[first[i]])
        alike = np.cos(np.radians(plan.apart_deg))
        near = next((groups for other, groups in kept if abs(float(other @ direction)) > alike), None)
        if near is None:
            kept.append((direction, {group}))
        else:
            near.add(group)
    lacking = wanted - len(kept)
    lacks = () if lacking <= 0 else (say("{lacking} of {count} orientations", lacking=lacking, count=wanted),)
    least = min(sorted((len(groups) for _, groups in kept), reverse=True)[:wanted], default=0)
    repeats = say("{repeats} repetitions in each orientation", repeats=plan.repeats)
    fewer = () if least >= plan.repeats else (say("{what} ({least})", what=repeats, least=least),)
    unknown = say("bidirectional lengths: from which side each end was reached is not recorded")
    sides = Condition(
        say("ends of each length reached from opposite sides"),
        (unknown,) if len(rows) and artefact.bidirectional(found.rows) is None else (),
        Verbatim("columns approach_x, approach_y, approach_z"),
    )
    return (Condition(what, lacks), Condition(repeats, fewer), sides)


AGAIN = Remeasurement(repeats=3, outside=1, lengths=5, readings=10)  # Of ISO 10360-2:2009; see docs/standards.md


def _short_gauge_repeated(test: Test) -> tuple[Condition, ...]:
    gauge, plan = test.circumstances.short_gauge, ISO_10360_2
    return repeats_of_gauge(gauge, test.indications(), plan.repeats, plan.shortest_mm)


def _asked_of_gauges(test: Test) -> tuple[Condition, ...]:
    return (*normal_expansion(test), *_short_gauge_repeated(test))


_E0 = Characteristic(
    "E0", LENGTHS, partial(errors_of_indication, chosen=at_offset(0.0), again=AGAIN), partial(conditions, ISO_10360_2),
    length_unstated, _asked_of_gauges, beside=supplemented, lines=LENGTH_LINES,
)  # fmt: skip
_R0 = Characteristic(
    "R0", LENGTHS, partial(repeatability_range, repeats=3, chosen=at_offset(0.0)), partial(conditions, ISO_10360_2),
    asks=_short_gauge_repeated, needs="u_repeat_um", beside=supplemented, lines=REPEAT_LINES,
)  # fmt: skip
_E150 = Characteristic(
    "E150", LENGTHS, partial(errors_of_indication, chosen=at_offset(150.0), again=AGAIN),
    partial(best_of, ISO_10360_2_OFFSET), length_unstated, _asked_of_gauges, beside=supplemented, lines=LENGTH_LINES,
)  # fmt: skip


def _of_sphere(
    form: tuple[str, ...], size: tuple[str, ...], plan: SpherePlan, asks: Callable[[Test], tuple[Condition, ...]]
) -> tuple[Characteristic, ...]:
    """Form and size error of a test sphere, each by its name and its other names."""
    return tuple(
        Characteristic(name, FORMS, decided, partial(conditions, plan), unstated, asks, tuple(also), lines=lines)
        for (name, *also), decided, unstated, lines in (
            (form, form_error, form_unstated, FORM_LINES), (size, size_error, length_unstated, SIZE_LINES))
    )  # fmt: skip


_DIAMETER = partial(diameter_allowed, plan=ISO_10360_5)


def _superseded(by: str) -> tuple[Text, ...]:
    return (say("This edition is superseded by {by}.", by=Verbatim(by)),)


_STANDARDS = (
    Standard("ASME B89.4.1-1997", (
        Characteristic("volumetric performance", BARS, volumetric_performance, partial(conditions, B89),
                       lines=REPEAT_LINES),
        Characteristic("repeatability", FORMS, range_of_centres, partial(repeats_of_sphere, B89_REPEATABILITY),
                       needs="u_repeat_um", lines=REPEAT_LINES),
        Characteristic("linear displacement accuracy", LENGTHS,
                       partial(errors_of_indication, chosen=on_lines(B89_LINEAR.positions)),
                       partial(conditions, B89_LINEAR), length_unstated, lines=LENGTH_LINES),
        Characteristic("offset probe performance", BARS, offset_probe, partial(offset_positions, B89_OFFSET),
                       needs="u_repeat_um", lines=REPEAT_LINES),
        Characteristic("bidirectional length", LENGTHS,
                       partial(errors_of_indication, chosen=short(B89_BIDIRECTIONAL.longest_mm)),
                       partial(orientations, B89_BIDIRECTIONAL), length_unstated, lines=LENGTH_LINES),
    ), _superseded("ASME B89.4.10360.2-2008")),
    Standard("ASME B89.4.10360.2-2008", (_E0, _R0, _E150), (
        say("ASME B89.4.10360.2-2008 takes over ISO 10360-2; what it adds to it is not tested here."),
    ), "contacting"),
    Standard("ISO 10360-2:2009", (_E0, _R0, _E150), sensing="contacting"),
    Standard("ISO 10360-5:2010", _of_sphere(("P_FTU",), ("P_STU",), ISO_10360_5, _DIAMETER),
             _superseded("ISO 10360-5:2020"), "contacting"),
    Standard("ISO 10360-5:2020", _of_sphere(
        ("P_Form.Sph.1x25:SS:Tact", "P_Form.Sph.1x25", "P_Form"), ("P_Size.Sph.1x25:SS:Tact", "P_Size.Sph.1x25", "P_Size"),
        ISO_10360_5, _DIAMETER,
    ), sensing="contacting"),
    Standard("ISO 10360-8:2013", _of_sphere(
        ("P_Form.Sph.1x25:Tr:ODS", "P_Form.Sph.1x25", "P_Form"), ("P_Size.Sph.1x25:Tr:ODS", "P_Size.Sph.1x25", "P_Size"),
        ISO_10360_8, sensing_stated,
    ), sensing="optical"),
    Standard("VDI/VDE 2617", (_E0,), (
        say("VDI/VDE 2617 is decided like ISO 10360-2:2009 here, with the same positions, lengths and repetitions."),
        say("VDI/VDE 2617 alone names no part: that of the length measuring uncertainty is VDI/VDE 2617-2.1."),
    ), "contacting"),
    Standard("VDI/VDE 2617-2.1", tuple(
        Characteristic(name, LENGTHS, partial(errors_of_indication, chosen=on_lines(VDI_2617_2_1[name].positions)),
                       partial(conditions, VDI_2617_2_1[name]), length_unstated, lines=LENGTH_LINES)
        for name in ("U3", "U1", "U2")
    ), sensing="contacting"),
)  # fmt: skip

BUILT_IN: Mapping[str, Standard] = MappingProxyType(  # by name
    {standard.name: replace(standard, clauses=CLAUSES[standard.name]) for standard in _STANDARDS}
)


def statement(
    facts: ConformityFacts, artefact: Artefact, accuracy: Mapping[str, Quantity], key: str, tested: Collection[str],
    recorded: Artefact | None = None, circumstances: Circumstances | None = None,
    left_out: OutsideReadings | None = None,
) -> Statement:  # fmt: skip
    """Compare what the standard asks for with its limit, and decide; ``recorded`` is the artefact before a correction."""
    under = circumstances or Circumstances()
    standard, characteristic = decidable(facts, artefact.kind, key, tested, under)
    whole, beside = recorded or artefact, characteristic.beside
    if left_out is not None:
        artefact, whole = left_out.whole(artefact), left_out.whole(whole)
    if beside is not None:
        artefact, whole = beside(artefact, under.short_gauge), beside(whole, under.short_gauge)
    return characteristic.statement(
        Test(standard, characteristic, facts, artefact, whole, accuracy, key, under, left_out)
    )


def decidable(
    facts: ConformityFacts, kind: str, key: str, tested: Collection[str], under: Circumstances
) -> tuple[Standard, Characteristic]:
    """The standard that a job names, and its characteristic, where they can be decided on a kind of measurement."""
    standard = standard_named(facts.standard)
    if standard is None:
        raise CmmUqError(f"no standard {facts.standard!r} is decided", where=f"job.toml {key} standard",
                         fix=suggestion(facts.standard, names()))  # fmt: skip
    characteristic = characteristic_of(standard, facts, key)
    if characteristic.observed not in tested:
        raise CmmUqError(f"{facts.standard} is not decided on a {kind}", where=f"job.toml {key} standard",
                         fix="Leave the statement out, or record the artefact that the standard asks for")  # fmt: skip
    if None not in (standard.sensing, under.probe.sensing) and standard.sensing != under.probe.sensing:
        raise CmmUqError(f"{facts.standard} is for {standard.sensing} probes, and the recording was made with one that is not",
                         where=f"job.toml {key} standard",
                         fix="State ISO 10360-8:2013 of optical probes, or leave the statement out")  # fmt: skip
    return standard, characteristic


def standard_named(name: str) -> Standard | None:
    """A standard by its name; ``None`` where there is none. A built-in one cannot be replaced."""
    if name in BUILT_IN:
        return BUILT_IN[name]
    outside = named(offered(STANDARDS, Plugin), name)
    return None if outside is None else outside.loaded(Standard)


def names() -> tuple[str, ...]:
    """Of all standards, those of other packages last; none of these is imported."""
    return (*BUILT_IN, *(plugin.name for plugin in offered(STANDARDS, Plugin) if plugin.name not in BUILT_IN))
