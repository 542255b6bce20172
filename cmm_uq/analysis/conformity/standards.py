"""The standards that a job may name, each with what is decided on it."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from dataclasses import replace
from functools import partial
from types import MappingProxyType

import numpy as np

from cmm_uq.analysis.conformity import arms, decided, four_axis, own_rule, plans, positioning, robots
from cmm_uq.analysis.conformity.as_recorded import OutsideReadings, repeats_of_gauge, supplemented
from cmm_uq.analysis.conformity.own_rule import form_unstated
from cmm_uq.analysis.conformity.plan_conditions import best_of, conditions
from cmm_uq.analysis.conformity.plans import Condition
from cmm_uq.analysis.conformity.standard import (
    Characteristic,
    Standard,
    Test,
    characteristic_of,
    diameter_allowed,
    length_unstated,
)
from cmm_uq.analysis.conformity.statement import CHOSEN, ITS_RULE, REPORTED, Clause, Remeasurement, Statement
from cmm_uq.analysis.conformity.uncertainty import FORM_LINES, LENGTH_LINES, REPEAT_LINES, SIZE_LINES, normal_expansion
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.messages import Text, Verbatim, say
from cmm_uq.base.plugins import STANDARDS, Plugin, named, offered
from cmm_uq.jobs.tables.adoptions import adopted, nearest, taken_for
from cmm_uq.jobs.tables.conformity import Circumstances, ConformityFacts
from cmm_uq.machine.model.artefact import Artefact
from cmm_uq.machine.model.kind import BARS, FORMS, LENGTHS
from cmm_uq.maths.uncertainty.quantity import Quantity


def sensing_stated(test: Test) -> tuple[Condition, ...]:
    what = say('an optical probe ([probe] sensing = "optical")')
    return (Condition(what, () if test.circumstances.probe.sensing == "optical" else (what,)),)


def orientations(plan: plans.ShortLengthPlan, artefact: Artefact, *, recorded: bool) -> tuple[Condition, ...]:
    """Orientations that differ, and how often the gauge was measured in each."""
    found, wanted = artefact.indications(), plan.orientations
    what = say("a length of at most {longest:g} mm in {count} orientations", longest=plan.longest_mm, count=wanted)
    if found is None:
        return (Condition(what, (what,)),)
    points, first, (_, along) = artefact.points, found.rows[:, 0], artefact.lines_of(found.rows)
    copied = np.isin(points.group[first], list(points.copies) if recorded else [])
    rows = np.flatnonzero(decided.short(plan.longest_mm)(artefact, found) & ~copied)
    each: list[tuple[np.ndarray, set[int]]] = []  # direction of every orientation, and the groups measured in it
    for i in rows:
        direction, alike = along[i] / np.linalg.norm(along[i]), np.cos(np.radians(plan.apart_deg))
        near = next((groups for other, groups in each if abs(float(other @ direction)) > alike), None)
        if near is None:
            each.append((direction, near := set[int]()))
        near.add(int(points.group[first[i]]))
    lacking = wanted - len(each)
    lacks = () if lacking <= 0 else (say("{lacking} of {count} orientations", lacking=lacking, count=wanted),)
    least = min(sorted((len(groups) for _, groups in each), reverse=True)[:wanted], default=0)
    repeats = say("{repeats} repetitions in each orientation", repeats=plan.repeats)
    fewer = () if least >= plan.repeats else (say("{what} ({least})", what=repeats, least=least),)
    unknown = say("bidirectional lengths: from which side each end was reached is not recorded")
    sides = Condition(
        say("ends of each length reached from opposite sides"),
        (unknown,) if len(rows) and artefact.bidirectional(found.rows) is None else (),
        Verbatim("columns approach_x, approach_y, approach_z"),
    )
    return (Condition(what, lacks), Condition(repeats, fewer), sides)


_LENGTHS = ("E0", "E150")

_UNCERTAINTY = Clause(
    "test_uncertainty",
    say("test uncertainty"),
    "Calibration, expansion, temperature, alignment and fixturing of "
    "the artefact, root of the sum of squares; the machine's own errors and scatter are no part of it.",
    "ISO/TS 23165:2006, as commonly reported",
)
_ASME_RULE = Clause(
    "decision_rule",
    say("default decision rule"),
    'ISO 14253-1, where the job names no other; "ASME B89.7.3.1" is simple acceptance at 4 : 1.',
    "that 4 : 1 by ASME B89.7.3.1 is its own default: as commonly reported; ISO "
    "14253-1 is the stricter for whoever states a pass",
)
_SET_ASIDE = Clause(
    "data_rejection",
    say("readings that are left out"),
    "None is left out of a decision: what is set aside counts as outside.",
    "ASME B89.7.3.1-2001, 2, as quoted publicly: rejected only by a documented policy or with a physical cause",
    True,
)
_ISO_10360_2 = (
    Clause("scope", say("scope"), "Cartesian machines with contacting probes, point by point; an optical probe is "
           "refused.", "its publisher's abstract", True),
    Clause("positions", say("positions"), "Four space diagonals and a line parallel to each axis. Three other positions "
           "that the user may choose in place of the axes are not accepted.", "seven: Harris 2004, of the edition of "
           "2000; which: as commonly reported", of=("E0", "R0")),
    Clause("positions_offset", say("positions with the offset tip"), "Both face diagonals of Y–Z, or of X–Z, with the "
           "stylus tip 150 mm to the side.", REPORTED, of=("E150",)),
    Clause("space_diagonal", say("what a space diagonal is"), "Produced to the ends of travel it crosses 75 % of the "
           "travel of every axis; a face diagonal, or a line within 10° of an axis, of the axes that it is named by.", CHOSEN),
    Clause("longest", say("longest length"), "At least 66 % of the travel along a line through it.", "Harris 2004, of the "
           "edition of 2000, there of the diagonal; that 66 % of the longest body diagonal are asked for: publisher's "
           "words on VDI/VDE 2617-2.3"),
    Clause("shortest", say("shortest length"), "At most 30 mm in every position.", "Harris 2004, of the edition of 2000; "
           "whether the edition of 2009 asks for it is not known"),
    Clause("lengths_and_repeats", say("lengths and repeats"), "Five lengths, more than 1 mm apart, in each position, "
           "each three times, the shortest and the longest among them.", "five, three and seven positions: Harris 2004 and "
           "summaries of manufacturers; 1 mm: this project"),
    Clause("bidirectional", say("bidirectional lengths"), "Ends approached in opposite senses; distances of balls with a "
           "short gauge beside them.", REPORTED),
    Clause("expansion", say("normal expansion"), "8 to 13 × 10⁻⁶ /K.", REPORTED, of=_LENGTHS),
    Clause("short_gauge", say("short gauge beside centre distances"), "Its error is added to that of the length, repeat "
           "by repeat; at most 30 mm, three times in every position, within 10° and 100 mm of the line.", CHOSEN),
    Clause("remeasuring", say("measuring again"), "At most five lengths may have one of their three values outside; each "
           "is measured ten times more, all inside; two of three, or a sixth length, fail.", "as commonly reported: ten "
           "of the edition of 2001, three of that of 2009 by some; ten is asked for, the stricter of both", of=_LENGTHS),
    Clause("range", say("range of repeats"), "Range of the first three repeats of each length, not measured again.",
           REPORTED, of=("R0",)),
    _UNCERTAINTY,
    ITS_RULE,
)  # fmt: skip
_ISO_10360_5 = (
    Clause("scope", say("scope"), "Contacting probes, point by point.", "its publisher's abstract", True),
    Clause("points", say("points on the sphere"), "25 different ones at least on every sphere recorded, by one stylus.",
           "25: names of the characteristics, and summaries of manufacturers; that more do not hinder, and that a sphere has "
           "one stylus: this project"),
    Clause("pattern", say("where on the sphere the points lie"), "No direction of the hemisphere is farther than 45° "
           "from the nearest point.", CHOSEN),
    Clause("sphere_size", say("size of the sphere"), "10 to 50 mm.", "Harris 2004, 2.6.3, of ISO 10360-2:2000; not less "
           "than 10 mm: clause 6.2.1 of the edition of 2020, as quoted by a reseller"),
    Clause("every_sphere", say("every sphere by itself"), "Every sphere recorded is decided, form and size from the same "
           "points; nothing is measured again.", CHOSEN),
    _UNCERTAINTY,
    ITS_RULE,
)  # fmt: skip
_B89 = (
    Clause("positions", say("positions of the bar"), "Twenty in a nearly cubic volume (up to 2 : 1), ten for each "
           "further cube; three axes, six face and four space diagonals, within 10°, ends 10 mm apart.", "twenty and the "
           "directions: Harris 2004, 6.3, by figure 26 of the standard; the rest: this project",
           of=("volumetric performance",)),
    Clause("range_of_bar", say("range of the bar's lengths"), "Of all lengths recorded.", "5.5.2, Harris 2004",
           of=("volumetric performance",)),
    Clause("repeatability", say("repeatability"), "Ten repeats of a fixed sphere, largest range along an axis.",
           "fixed ball, range: Harris 2004, 2.6.1; ten: this project", of=("repeatability",)),
    Clause("linear", say("linear displacement accuracy"), "Lines parallel to X, Y, Z; ten lengths, three repeats, 66 % "
           "of the travel.", "each axis: Harris 2004, 2.6.1; the rest: this project", of=("linear displacement accuracy",)),
    Clause("offset", say("offset probe performance"), "Face diagonals of Y–Z and X–Z, each with the tip to opposite "
           "sides.", "Harris 2004, 2.6.1; which diagonals: this project", of=("offset probe performance",)),
    Clause("bidirectional", say("bidirectional length"), "A length of at most 50 mm in four orientations, three repeats.",
           "four orientations: Harris 2004, 2.6.1; the rest: this project", of=("bidirectional length",)),
    Clause("test_uncertainty", say("test uncertainty"), "That of the artefact alone.", CHOSEN),
    _SET_ASIDE,
    ITS_RULE,
)  # fmt: skip
_VDI = (
    Clause("positions", say("positions"), "U1: the axes; U2: all six face diagonals; U3: all four space diagonals; "
           "each crosses 75 % of the travel of its axes.",
           "Harris 2004, 2.6.2, and the guideline's abstract; that all are asked for: this project"),
    Clause("lengths_and_repeats", say("lengths and repeats"), "Five lengths, three repeats of each, the longest 66 % "
           "of the travel, the shortest at most 30 mm, as of ISO 10360-2.", CHOSEN),
    Clause("share_outside", say("share of values outside"), "None may lie outside, and none is measured again.", CHOSEN),
    _UNCERTAINTY,
    ITS_RULE,
)  # fmt: skip
_RULES = {
    "ISO/TS 23165:2006": (
        Clause("budget", say("terms of the budget"), "Calibration, expansion, temperature, alignment and fixturing of "
               "the artefact, root of the sum of squares; the machine's own errors and scatter are no part of it.", REPORTED),
        Clause("form", say("test uncertainty of a form"), "√((F/2)² + u(F)²)", REPORTED),
        Clause("range", say("test uncertainty of a range"), "What of the artefact changes between the repeats; nothing "
               "of its calibration.", CHOSEN),
    ),
    "ISO/TS 17865:2016": (
        Clause("size", say("test uncertainty of a size"), "As of a length.", REPORTED),
    ),
    "ASME B89.7.3.1-2001": (
        Clause("ratio", say("N : 1"), "The whole zone of the specification is N times as wide as ±U, k = 2.",
               "its definition, as quoted publicly", True),
        Clause("one_limit", say("N : 1 with one limit"), "The zone goes from 0 to the limit.", CHOSEN),
        _SET_ASIDE,
    ),
    "ISO 14253-1:2017": (
        Clause("probability", say("probability of conforming"), "95 %.", "5.2, as commonly reported"),
    ),
    "ANSI/NCSL Z540.3-2006": (
        Clause("share", say("share of false acceptance"), "2 % of all items.", "5.3 b, as quoted in public papers", True),
        Clause("between", say("between acceptance limit and limit"), "Undecided.", CHOSEN),
    ),
}  # fmt: skip


# Of each standard that is decided here, and of the documents that decisions and budgets go by
CLAUSES: Mapping[str, tuple[Clause, ...]] = MappingProxyType({
    **positioning.CLAUSES,
    four_axis.NAME: four_axis.CLAUSES,
    **arms.CLAUSES,
    robots.NAME: robots.CLAUSES,
    "ISO 10360-2:2009": _ISO_10360_2,
    "ASME B89.4.10360.2-2008": (
        Clause("additions", say("what it adds to ISO 10360-2"), "Not tested.", "its abstract: it incorporates the entire ISO "
               "document"),
        *_ISO_10360_2[1:-1], _SET_ASIDE, _ASME_RULE,
    ),
    "ISO 10360-5:2010": _ISO_10360_5,
    "ISO 10360-5:2020": _ISO_10360_5,
    "ISO 10360-8:2013": (
        Clause("scope", say("scope"), "Cartesian machines with optical distance sensors.", "its publisher's abstract", True),
        *(one for one in _ISO_10360_5[1:] if one.name != "sphere_size"),
    ),
    "ASME B89.4.1-1997": _B89,
    "VDI/VDE 2617-2.1": _VDI,
    "VDI/VDE 2617": _ISO_10360_2[1:],
    **_RULES,
})  # fmt: skip

AGAIN = Remeasurement(repeats=3, outside=1, lengths=5, readings=10)  # Of ISO 10360-2:2009; see docs/standards.md


def _short_gauge_repeated(test: Test) -> tuple[Condition, ...]:
    plan = plans.ISO_10360_2
    return repeats_of_gauge(test.circumstances.short_gauge, test.indications(), plan.repeats, plan.shortest_mm)


def _asked_of_gauges(test: Test) -> tuple[Condition, ...]:
    return (*normal_expansion(test.circumstances.cte_per_k), *_short_gauge_repeated(test))


def _lengths(name: str, chosen: decided.Chosen, conditions: Callable[..., tuple[Condition, ...]]) -> Characteristic:
    errors = partial(decided.errors_of_indication, chosen=chosen)
    return Characteristic(name, LENGTHS, errors, conditions, length_unstated, lines=LENGTH_LINES)


_E0, _E150 = (
    Characteristic(
        name, LENGTHS, partial(decided.errors_of_indication, chosen=decided.at_offset(offset), again=AGAIN), asked,
        length_unstated, _asked_of_gauges, beside=supplemented, lines=LENGTH_LINES,
    )
    for name, offset, asked in (("E0", 0.0, partial(conditions, plans.ISO_10360_2)),
                                ("E150", 150.0, partial(best_of, plans.ISO_10360_2_OFFSET)))
)  # fmt: skip
_R0 = Characteristic(
    "R0", LENGTHS, partial(decided.repeatability_range, repeats=3, chosen=decided.at_offset(0.0)),
    partial(conditions, plans.ISO_10360_2), asks=_short_gauge_repeated, needs="u_repeat_um", beside=supplemented,
    lines=REPEAT_LINES,
)  # fmt: skip


def _of_sphere(
    form: tuple[str, ...], size: tuple[str, ...], plan: plans.SpherePlan, asks: Callable[[Test], tuple[Condition, ...]]
) -> tuple[Characteristic, ...]:
    return tuple(
        Characteristic(name, FORMS, errors, partial(conditions, plan), unstated, asks, tuple(also), lines=lines)
        for (name, *also), errors, unstated, lines in (
            (form, decided.form_error, form_unstated, FORM_LINES),
            (size, decided.size_error, length_unstated, SIZE_LINES),
        )
    )


_DIAMETER = partial(diameter_allowed, plan=plans.ISO_10360_5)


def _superseded(by: str) -> tuple[Text, ...]:
    return (say("This edition is superseded by {by}.", by=Verbatim(by)),)


_STANDARDS = (
    Standard("ASME B89.4.1-1997", (
        Characteristic("volumetric performance", BARS, decided.volumetric_performance, partial(conditions, plans.B89),
                       lines=REPEAT_LINES),
        Characteristic("repeatability", FORMS, decided.range_of_centres,
                       partial(decided.repeats_of_sphere, plans.B89_REPEATABILITY), needs="u_repeat_um", lines=REPEAT_LINES),
        _lengths("linear displacement accuracy", decided.on_lines(plans.B89_LINEAR.positions),
                 partial(conditions, plans.B89_LINEAR)),
        Characteristic("offset probe performance", BARS, decided.offset_probe,
                       partial(decided.offset_positions, plans.B89_OFFSET), needs="u_repeat_um", lines=REPEAT_LINES),
        _lengths("bidirectional length", decided.short(plans.B89_BIDIRECTIONAL.longest_mm),
                 partial(orientations, plans.B89_BIDIRECTIONAL)),
    ), _superseded("ASME B89.4.10360.2-2008")),
    Standard("ASME B89.4.10360.2-2008", (_E0, _R0, _E150), (
        say("ASME B89.4.10360.2-2008 takes over ISO 10360-2; what it adds to it is not tested here."),
    ), "contacting"),
    Standard("ISO 230-2:2014", positioning.ISO_230_2),
    Standard("ISO 230-4:1996", positioning.ISO_230_4_1996),
    Standard("ISO 230-4:2005", positioning.ISO_230_4_2005),
    Standard("ISO 230-6:2002", positioning.ISO_230_6),
    Standard("ISO 10360-2:2009", (_E0, _R0, _E150), sensing="contacting"),
    Standard(four_axis.NAME, four_axis.CHARACTERISTICS),
    *arms.STANDARDS,
    robots.STANDARD,
    Standard("ISO 10360-5:2010", _of_sphere(("P_FTU",), ("P_STU",), plans.ISO_10360_5, _DIAMETER),
             _superseded("ISO 10360-5:2020"), "contacting"),
    Standard("ISO 10360-5:2020", _of_sphere(
        ("P_Form.Sph.1x25:SS:Tact", "P_Form.Sph.1x25", "P_Form"), ("P_Size.Sph.1x25:SS:Tact", "P_Size.Sph.1x25", "P_Size"),
        plans.ISO_10360_5, _DIAMETER,
    ), sensing="contacting"),
    Standard("ISO 10360-8:2013", _of_sphere(
        ("P_Form.Sph.1x25:Tr:ODS", "P_Form.Sph.1x25", "P_Form"), ("P_Size.Sph.1x25:Tr:ODS", "P_Size.Sph.1x25", "P_Size"),
        plans.ISO_10360_8, sensing_stated,
    ), sensing="optical"),
    Standard("VDI/VDE 2617", (_E0,), (
        say("VDI/VDE 2617 is decided like ISO 10360-2:2009 here, with the same positions, lengths and repetitions."),
        say("VDI/VDE 2617 alone names no part: that of the length measuring uncertainty is VDI/VDE 2617-2.1."),
    ), "contacting"),
    Standard("VDI/VDE 2617-2.1", tuple(
        _lengths(name, decided.on_lines(plans.VDI_2617_2_1[name].positions), partial(conditions, plans.VDI_2617_2_1[name]))
        for name in ("U3", "U1", "U2")
    ), sensing="contacting"),
    own_rule.STANDARD,
)  # fmt: skip

BUILT_IN: Mapping[str, Standard] = MappingProxyType(  # by name
    {standard.name: replace(standard, clauses=CLAUSES.get(standard.name, ())) for standard in _STANDARDS}
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
    test = Test(standard, characteristic, facts, artefact, whole, accuracy, key, under, left_out)
    return characteristic.statement(test)


def decidable(
    facts: ConformityFacts, kind: str, key: str, tested: Collection[str], under: Circumstances
) -> tuple[Standard, Characteristic]:
    """The standard that a job names, and its characteristic, where they can be decided on a kind of measurement."""
    standard, where = standard_named(facts.standard), f"job.toml {key} standard"
    if standard is None:
        fix = nearest(facts.standard, names())
        raise CmmUqError(f"no standard {facts.standard!r} is decided", where=where, fix=fix)
    characteristic = characteristic_of(standard, facts, key)
    if characteristic.observed not in tested:
        problem, fix = f"{facts.standard} is not decided on a {kind}", standard.instead(tested)
        raise CmmUqError(problem, where=where, fix=fix)
    if None not in (standard.sensing, under.probe.sensing) and standard.sensing != under.probe.sensing:
        problem = f"{facts.standard} is for {standard.sensing} probes, and the recording was made with one that is not"
        fix = "State ISO 10360-8:2013 of optical probes, or leave the statement out"
        raise CmmUqError(problem, where=where, fix=fix)
    if facts.angle_arcsec is not None and not characteristic.angle:
        where = f"job.toml {key} {'limit_arcsec' if facts.limit_deg is None else 'limit_deg'}"
        raise CmmUqError(f"{characteristic.name} of {facts.standard} is no angle", where=where,
                         fix="Give limit_um in its place")  # fmt: skip
    return standard, characteristic


def standard_named(name: str) -> Standard | None:
    """A standard by its name or that of an adoption; ``None`` where there is none. A built-in one cannot be replaced."""
    if name in BUILT_IN:
        return BUILT_IN[name]
    if (outside := named(offered(STANDARDS, Plugin), name)) is not None:
        return outside.loaded(Standard)
    adoption = adopted(name, BUILT_IN)
    if adoption is None or adoption.name not in BUILT_IN:
        return None
    own = BUILT_IN[adoption.name]
    return replace(own, remarks=(*own.remarks, *taken_for(name, adoption)))


def names() -> tuple[str, ...]:
    """Of all standards, those of other packages last; none of these is imported."""
    return (*BUILT_IN, *(plugin.name for plugin in offered(STANDARDS, Plugin) if plugin.name not in BUILT_IN))
