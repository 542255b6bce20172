"""Other methods on a part's job: figures beside each other, Eₙ between their values, why they differ, what tests lack."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from itertools import combinations
from math import hypot, sqrt

import numpy as np
from scipy.special import gammaincinv

from cmm_uq.analysis.parts.budget import FAMILIES, PLACE, VarianceShares, family_of
from cmm_uq.analysis.parts.causes.machine import MACHINE, NOISE, STYLUS
from cmm_uq.analysis.parts.causes.surroundings import FIXTURE, FORM, OPERATOR, TEMPERATURE
from cmm_uq.analysis.parts.methods import method as methods
from cmm_uq.analysis.parts.plan import ZONES, Plan
from cmm_uq.analysis.parts.result import StatedCharacteristic, evaluated
from cmm_uq.analysis.parts.setup import plan_of
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.messages import Text, Verbatim, listed, names, number, say
from cmm_uq.base.points import Floats
from cmm_uq.base.units import ARCSECOND, MICROMETRE, unit
from cmm_uq.base.values import dataclass, replace
from cmm_uq.jobs.part.job import PartJob
from cmm_uq.jobs.part.readings import Repeats, StandardReadings
from cmm_uq.jobs.part.tables import CalibratedFacts, CalibratedPartFacts, OrientationsFacts
from cmm_uq.maths.uncertainty.budgets.machine import FEWEST_READINGS
from cmm_uq.maths.uncertainty.quantity import significant

_STEP_MM = 1e-3  # by which the farthest point moves, or a tip grows, to see what follows


@dataclass(frozen=True, eq=False)
class Sensitivities:
    """Derivatives of c characteristics."""

    scale: Floats  # (c,) by the scale of all coordinates, mm and rad: of a length itself
    tips: dict[str, Floats]  # by stylus, (c,) by the effective diameter of its tip, mm/mm and rad/mm


def sensitivities(plan: Plan) -> Sensitivities:
    """Of the characteristics of a plan, at its nominal points, by central differences.

    A position or a form, which is zero at the nominal and grows to both sides, has none to first order.
    """
    reach = max(1.0, float(np.linalg.norm(plan.points, axis=1).max()))
    step = _STEP_MM / reach
    scale = (evaluated(plan, plan.points * (1 + step)) - evaluated(plan, plan.points * (1 - step))) / (2 * step)
    tips = {}
    for place, stylus in enumerate(plan.styli):
        out = 0.5 * _STEP_MM * (plan.stylus_of == place)[:, None] * plan.normals
        grown, shrunk = evaluated(plan, plan.points + out), evaluated(plan, plan.points - out)
        tips[stylus.name] = (grown - shrunk) / (2 * _STEP_MM)
    return Sensitivities(scale, tips)


# orientations, and measurements in each, that descriptions of the method of several orientations ask for
ORIENTATIONS_ASKED, REPEATS_ASKED = 4, 5
_NO_LENGTH = (*ZONES, "angle")  # characteristics that are none or deviations: their expansion does not count
# change of a characteristic, mm or rad, for one millimetre of a tip or the whole of its own scale, that is none
_FELT = 1e-6


def methods_of(job: PartJob, plan: Plan, measured: Floats | None) -> tuple[methods.MethodResult, ...]:
    """What other methods say of a part's characteristics; empty where the job has none.

    ``measured``: (c,) values of the part; ``None`` where nothing was measured.
    """
    facts, found = job.facts, []
    slopes = sensitivities(plan) if facts.by_calibrated_part or facts.by_orientations else None
    if facts.by_calibrated_part is not None and job.others.calibrated is not None and slopes is not None:
        found.append(_calibrated(job, facts.by_calibrated_part, job.others.calibrated, plan, slopes, measured))
    if facts.by_orientations is not None and job.others.orientations is not None and slopes is not None:
        found.append(_orientations(job, facts.by_orientations, job.others.orientations, plan, slopes))
    return tuple(found)


def lacking(job: PartJob) -> tuple[tuple[str, Text, str], ...]:
    """What the tests of other methods lack: table of the job, what is asked for, what to do."""
    if job.facts.by_calibrated_part is None and job.facts.by_orientations is None:
        return ()
    plan = plan_of(job)
    return tuple(
        (f"by_{method.method}", say("{asked}: {met}", asked=one.text, met=_MET[one.met]), _FIXES[one.met])
        for method in methods_of(job, plan, None) for one in method.conditions if not one.met
    )  # fmt: skip


_MET = {False: say("not met"), None: say("not stated")}
_FIXES = {False: "Complete the test; the report says so as long as it is not", None: "State whether it was so"}


def _values(repeats: Repeats, plan: Plan) -> Mapping[str, Floats]:
    """(n,) of each characteristic, mm or rad."""
    if repeats.points is None:
        return repeats.values
    table = np.array([evaluated(plan, points) for points in repeats.points])
    return {one.name: table[:, i] for i, one in enumerate(plan.characteristics)}


def _calibrated(
    job: PartJob, facts: CalibratedPartFacts, repeats: Repeats, plan: Plan, slopes: Sensitivities, measured: Floats | None
) -> methods.MethodResult:  # fmt: skip
    values, figures = _values(repeats, plan), []
    warm = methods.Warmth(facts.temperature_c, facts.u_cte_per_k, job.facts.part.u_cte_per_k)
    place = {one.name: i for i, one in enumerate(plan.characteristics)}
    for one in facts.characteristic:
        i = place[one.name]
        length = 0.0 if plan.characteristics[i].what in _NO_LENGTH else float(slopes.scale[i])
        try:
            figure = methods.by_calibrated_part(
                one.name, values[one.name], repeats.group, _certified(one, length), warm,
                measured=None if measured is None else float(measured[i]), corrected=facts.corrected,
            )  # fmt: skip
        except CmmUqError as error:
            where = f"{job.folder / 'job.toml'}: [by_calibrated_part]"
            raise CmmUqError(error.problem, where=where, fix=error.fix) from error
        figures.append(replace(figure, zone=plan.characteristics[i].what in ZONES))
    form = any(one.u_part_um or one.u_part_arcsec for one in facts.characteristic)
    seen: dict[str, methods.Seen] = {
        MACHINE: "systematic", NOISE: "varied", STYLUS: "varied" if facts.qualified_anew else "systematic",
        TEMPERATURE: "stated", FORM: "stated" if form else "unseen", FIXTURE: "varied",
        OPERATOR: "varied" if facts.conditions_varied else "unseen", PLACE: "varied" if facts.place_varied else "unseen",
    }  # fmt: skip
    return methods.MethodResult("calibrated_part", tuple(figures), _conditions_calibrated(facts, repeats), seen)


def _certified(one: CalibratedFacts, length: float) -> methods.CalibratedCharacteristic:
    if one.value_deg is not None:
        return methods.CalibratedCharacteristic(
            float(np.radians(one.value_deg)), ARCSECOND * (one.u_arcsec or 0.0), ARCSECOND * one.u_part_arcsec, angle=True
        )  # fmt: skip
    return methods.CalibratedCharacteristic(
        one.value_mm or 0.0, MICROMETRE * (one.u_um or 0.0), MICROMETRE * one.u_part_um, expanding_mm=length
    )


def _conditions_calibrated(facts: CalibratedPartFacts, repeats: Repeats) -> tuple[methods.TestCondition, ...]:
    cycles, readings = len(np.unique(repeats.group)), len(repeats.group)
    asked = (
        (say("{count} measurements or more of the calibrated part, in {cycles} set-ups or more", count=FEWEST_READINGS,
             cycles=methods.FEWEST_CYCLES), readings >= FEWEST_READINGS and cycles >= methods.FEWEST_CYCLES),
        (say("The calibrated part is measured as the part is: points, styli, clamping"), facts.same_procedure),
        (say("The calibrated part is like the part: size within 10 % (25 mm below 250 mm), angles within 5°, form, "
             "roughness and material alike"), facts.similar),
        (say("The part is measured in place of the calibrated part, or both lie in many places"),
         True if facts.place_varied else facts.substitution),
        (say("The repeats show what varies in use: times of day, temperatures, operators"), facts.conditions_varied),
        (say("The calibrated part has a certificate that the job names"), bool(facts.certificate)),
    )  # fmt: skip
    return tuple(methods.TestCondition(text, met) for text, met in asked)


def _orientations(
    job: PartJob, facts: OrientationsFacts, repeats: Repeats, plan: Plan, slopes: Sensitivities
) -> methods.MethodResult:
    values, standards = _values(repeats, plan), _standards(job, facts)
    room, part = job.facts.environment, job.facts.part
    warm = methods.PartWarmth(room.part_c, room.u_part_k, part.cte_per_k, part.u_cte_per_k)
    figures = []
    for i, one in enumerate(plan.characteristics):
        if one.name in values:
            own = methods.Slopes(_felt(slopes.scale[i]), {name: _felt(slope[i]) for name, slope in slopes.tips.items()})
            figure = methods.by_orientations(
                one.name, values[one.name], repeats.group, own, standards, warm, angle=one.what == "angle"
            )
            figures.append(replace(figure, zone=one.what in ZONES))
    seen: dict[str, methods.Seen] = {
        MACHINE: "varied", NOISE: "varied",
        STYLUS: "corrected" if facts.probe_standard else "varied" if facts.qualified_anew else "unseen",
        TEMPERATURE: "stated", FORM: "varied" if facts.points_varied else "unseen", FIXTURE: "varied", OPERATOR: "unseen",
        PLACE: "varied" if facts.place_varied else "unseen",
    }  # fmt: skip
    conditions = _conditions_orientations(facts, repeats, plan, slopes, [figure.name for figure in figures])
    return methods.MethodResult("orientations", tuple(figures), conditions, seen)


def _felt(slope: float) -> float:
    return 0.0 if abs(slope) < _FELT else float(slope)


def _standards(job: PartJob, facts: OrientationsFacts) -> methods.CalibratedStandards:
    length = None
    if facts.length_standard is not None and job.others.length is not None:
        one = facts.length_standard
        length = _standard(one.length_mm, one.u_um, job.others.length, temperature_c=one.temperature_c,
                           u_cte_per_k=one.u_cte_per_k)  # fmt: skip
    tips = {}
    for probe in facts.probe_standard:
        name = probe.stylus or job.facts.stylus[0].name
        if name in job.others.tips:
            tips[name] = _standard(probe.diameter_mm, probe.u_um, job.others.tips[name], inner=probe.inner)
    return methods.CalibratedStandards(length, tips)


def _standard(size_mm: float, u_um: float, read: StandardReadings, **more: float) -> methods.CalibratedStandard:
    inner = bool(more.pop("inner", False))
    return methods.CalibratedStandard(size_mm, MICROMETRE * u_um, read.values, read.group, inner, **more)


def _conditions_orientations(
    facts: OrientationsFacts, repeats: Repeats, plan: Plan, slopes: Sensitivities, tested: Sequence[str]
) -> tuple[methods.TestCondition, ...]:
    counts = np.unique(repeats.group, return_counts=True)[1]
    rows = [i for i, one in enumerate(plan.characteristics) if one.name in tested]
    styli = [name for name, slope in slopes.tips.items() if np.any(np.abs(slope[rows]) >= _FELT)]
    without = [name for name in styli if name not in {one.stylus or plan.styli[0].name for one in facts.probe_standard}]
    asked = [
        (say("{count} orientations or more, with {repeats} measurements or more in each", count=ORIENTATIONS_ASKED,
             repeats=REPEATS_ASKED), len(counts) >= ORIENTATIONS_ASKED and int(counts.min()) >= REPEATS_ASKED),
    ]  # fmt: skip
    if np.any(np.abs(slopes.scale[rows]) >= _FELT):
        scale = say("A calibrated length standard, for the scale that all orientations have in common")
        asked.append((scale, facts.length_standard is not None))
    if styli:
        which = listed(names(without or styli))
        asked.append((say("A calibrated ring, sphere or plug for the tips of {styli}", styli=which), not without))
    certificates = [one.certificate for one in (*facts.probe_standard, facts.length_standard) if one is not None]
    if certificates:
        asked.append((say("Each standard has a certificate that the job names"), all(certificates)))
    asked.append((say("Other points in each orientation, so that the part's form is seen"), facts.points_varied))
    return tuple(methods.TestCondition(text, met) for text, met in asked)


MATTERS = 0.05  # share of the variance from which on a cause is told by name
CHANCE = 0.05  # probability at which a scatter counts as another than the one that is expected
NEAR = 3.0  # scatters below which a zone counts as nearly nothing

METHODS: Mapping[methods.Method, Text] = {
    "virtual": say("the virtual measurements"), "calibrated_part": say("the calibrated part"),
    "orientations": say("several orientations"),
}  # fmt: skip


def compare_methods(
    stated: Sequence[StatedCharacteristic], shares: VarianceShares, results: Sequence[methods.MethodResult]
) -> methods.MethodComparison | None:
    """Other results beside the virtual measurement; ``None`` where there are none."""
    if not results:
        return None
    found = []
    for one in stated:
        figures = [(other, figure) for other in results if (figure := other.of(one.name)) is not None]
        if not figures:
            continue
        virtual = methods.MethodStatement("virtual", one.value, one.u, one.U, one.error)
        others = (methods.MethodStatement(other.method, figure.value, figure.u, figure.U) for other, figure in figures)
        all_stated = (virtual, *others)
        pairs = tuple(_pairs(all_stated))
        by_family = family_shares(shares, one.name)
        why = [words for other, figure in figures for words in _why(virtual, other, figure, by_family)]
        why += [_apart(pair) for pair in pairs if abs(pair.normalised) > 1]
        found.append(methods.ComparedCharacteristic(one.name, all_stated, pairs, tuple(why)))
    return methods.MethodComparison(tuple(results), tuple(found))


def family_shares(shares: VarianceShares, name: str) -> dict[str, float]:
    """Share of the variance of a characteristic by family of causes; they add up to one."""
    column = shares.characteristics.index(name)
    found: dict[str, float] = {}
    for line, share in zip(shares.causes, shares.total[:, column].clip(0).tolist(), strict=True):
        found[family_of(line)] = found.get(family_of(line), 0.0) + share
    whole = sum(found.values())
    return {family: share / whole for family, share in found.items()} if whole else {}


def _pairs(stated: Sequence[methods.MethodStatement]) -> Iterable[methods.MethodPair]:
    for one, other in combinations(stated, 2):
        expanded = hypot(one.U, other.U)
        if one.value is not None and other.value is not None and expanded:
            yield methods.MethodPair(one.method, other.method, (one.value - other.value) / expanded)


def _why(
    virtual: methods.MethodStatement,
    method: methods.MethodResult,
    figure: methods.MethodFigure,
    shares: Mapping[str, float],
) -> Iterable[Text]:
    """Sentences on why one method's uncertainty is another than the virtual measurement's."""
    if not virtual.u:
        return
    name = METHODS[method.method]
    grouped = _grouped(method.seen, shares)
    yield say("By {method} u is {ratio} times that of the virtual measurements.", method=name,
              ratio=number(figure.u / virtual.u, ".2f"))  # fmt: skip
    if figure.single is not None and figure.single > figure.u:
        yield say("That is u of the mean of all its measurements; one of them alone would have {single}.",
                  single=small(figure.single, angle=figure.angle))  # fmt: skip
    bias = abs((figure.systematic or 0.0) - virtual.error)
    if bias > virtual.U and method.method == "calibrated_part":
        yield say("Its systematic error differs from the mean error of the virtual measurements by {bias}, more than their U: "
                  "the machine is not as its certificate states it, or the calibrated value is wrong.",
                  bias=small(bias, angle=figure.angle))  # fmt: skip
    for seen, words in (("unseen", _unseen), ("systematic", _systematic), ("corrected", _corrected)):
        if (share := sum(grouped.get(seen, {}).values())) >= MATTERS:
            yield words(name, _named(grouped[seen]), number(100 * share, ".0f"), figure)
    yield from _zone(name, method, figure)
    yield from _scatter(name, virtual, figure, sum(grouped.get("varied", {}).values()))


def _zone(name: Text, method: methods.MethodResult, figure: methods.MethodFigure) -> Iterable[Text]:
    """What errors do to the width of a zone, which is a size without direction."""
    if not figure.zone:
        return
    if method.method == "calibrated_part":
        if abs(figure.systematic or 0.0) > figure.u:
            yield say("{name} is the width of a zone: its systematic error is that of a part which deviates as the calibrated "
                      "part does, in size and direction, and is wrong for another.", name=Verbatim(figure.name))  # fmt: skip
    elif figure.value is not None and figure.value < NEAR * figure.scatter:
        yield say("{name} is the width of a zone and nearly nothing: errors make it larger on average, by a part of its "
                  "scatter that {method} does not take off.", name=Verbatim(figure.name), method=name)  # fmt: skip


def _grouped(seen: Mapping[str, methods.Seen], shares: Mapping[str, float]) -> dict[str, dict[str, float]]:
    """Shares by how a method takes hold of them, then by family."""
    found: dict[str, dict[str, float]] = {}
    for family, share in shares.items():
        found.setdefault(seen.get(family, "unseen"), {})[family] = share
    return found


def _named(families: Mapping[str, float]) -> Text:
    """Families that matter, the largest first; the largest alone where only all together do."""
    order = sorted(families, key=lambda family: -families[family])
    kept = [family for family in order if families[family] >= MATTERS] or order[:1]
    return listed([say("{family:small}", family=FAMILIES[family]) for family in kept])


def _unseen(name: Text, families: Text, share: Text, figure: methods.MethodFigure) -> Text:
    return say("{method:capital} does not show {families}: {share} % of the variance of the virtual measurements.",
               method=name, families=families, share=share)  # fmt: skip


def _systematic(name: Text, families: Text, share: Text, figure: methods.MethodFigure) -> Text:
    bias = small(abs(figure.systematic or 0.0), angle=figure.angle)
    told = say(
        "{method:capital} has {families}, {share} % of the variance of the virtual measurements, in its systematic error of "
        "{bias}, which is the same in all repeats and holds for this place and this strategy alone.",
        families=families, share=share, method=name, bias=bias,
    )  # fmt: skip
    return told if figure.corrected else say("{told} It is not corrected, and is added to U.", told=told)


def _corrected(name: Text, families: Text, share: Text, figure: methods.MethodFigure) -> Text:
    return say(
        "Standards correct {method} for {families}, {share} % of the variance of the virtual measurements: by {bias}.",
        families=families, share=share, method=name,
        bias=small(abs(figure.systematic or 0.0), angle=figure.angle),
    )  # fmt: skip


def _scatter(
    name: Text, virtual: methods.MethodStatement, figure: methods.MethodFigure, share: float
) -> Iterable[Text]:
    """What scattered, beside what the virtual measurement expects to scatter."""
    expected = sqrt(share) * virtual.u
    if share < MATTERS or not expected:
        return
    ratio, dof = (figure.scatter / expected) ** 2, figure.scatter_dof
    tails = CHANCE / 2, 1 - CHANCE / 2
    low, high = (2 * float(gammaincinv(0.5 * dof, tail)) / dof for tail in tails)  # quantiles of χ² over its mean
    told = say("What varied between its measurements would scatter by {expected} by the virtual measurements; it scattered by "
               "{seen}",
               expected=small(expected, angle=figure.angle), seen=small(figure.scatter, angle=figure.angle))  # fmt: skip
    if ratio > high:
        yield say(
            "{told}, more than chance explains: something acts that the virtual measurements do not know.", told=told
        )
    elif ratio < low:
        yield say("{told}, less than chance explains: some of it stays the same in all repeats, or the virtual "
                  "measurements are cautious.", told=told)  # fmt: skip
    else:
        yield say("{told}, which chance explains.", told=told)


def _apart(pair: methods.MethodPair) -> Text:
    return say(
        "{one:capital} and {other} differ by more than their uncertainties allow (Eₙ = {value}): one of them leaves "
        "something out.",
        one=METHODS[pair.one], other=METHODS[pair.other], value=number(abs(pair.normalised), ".2f"),
    )  # fmt: skip


def small(value: float, *, angle: bool) -> Text:
    """A small length in µm, or a small angle in seconds."""
    if angle:
        return say("{value}{unit}", value=significant(value / ARCSECOND), unit=unit("″"))
    return say("{value} {unit}", value=significant(value / MICROMETRE), unit=unit("µm"))
