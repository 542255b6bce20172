"""Other methods on a part's job: from what was read to their figures, and what their tests lack."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from cmm_uq.analysis.parts.budget import PLACE
from cmm_uq.analysis.parts.causes.form import FORM
from cmm_uq.analysis.parts.causes.machine import MACHINE, NOISE
from cmm_uq.analysis.parts.causes.stylus import STYLUS
from cmm_uq.analysis.parts.causes.surroundings import FIXTURE, TEMPERATURE
from cmm_uq.analysis.parts.methods.method import (
    FEWEST_CYCLES,
    CalibratedCharacteristic,
    CalibratedStandard,
    CalibratedStandards,
    MethodResult,
    PartWarmth,
    Seen,
    Slopes,
    TestCondition,
    Warmth,
    by_calibrated_part,
    by_orientations,
)
from cmm_uq.analysis.parts.plan import FORMS, ORIENTATIONS, RUNOUTS, Plan
from cmm_uq.analysis.parts.result import evaluated
from cmm_uq.analysis.parts.setup import plan_of
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.messages import Text, listed, names, say
from cmm_uq.base.points import Floats
from cmm_uq.base.units import ARCSECOND, MICROMETRE
from cmm_uq.jobs.part.job import PartJob
from cmm_uq.jobs.part.readings import Repeats, StandardReadings
from cmm_uq.jobs.part.tables import CalibratedFacts, CalibratedPartFacts, OrientationsFacts
from cmm_uq.maths.uncertainty.budgets.machine import FEWEST_READINGS

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
ZONES = (*FORMS, *ORIENTATIONS, *RUNOUTS, "position", "coaxiality")  # characteristics that are widths of zones
_NO_LENGTH = (*ZONES, "angle")  # characteristics that are none or deviations: their expansion does not count
# change of a characteristic, mm or rad, for one millimetre of a tip or the whole of its own scale, that is none
_FELT = 1e-6


def methods_of(job: PartJob, plan: Plan, measured: Floats | None) -> tuple[MethodResult, ...]:
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
) -> MethodResult:  # fmt: skip
    values, figures = _values(repeats, plan), []
    warm = Warmth(facts.temperature_c, facts.u_cte_per_k, job.facts.part.u_cte_per_k)
    place = {one.name: i for i, one in enumerate(plan.characteristics)}
    for one in facts.characteristic:
        i = place[one.name]
        length = 0.0 if plan.characteristics[i].what in _NO_LENGTH else float(slopes.scale[i])
        try:
            figure = by_calibrated_part(
                one.name, values[one.name], repeats.group, _certified(one, length), warm,
                measured=None if measured is None else float(measured[i]), corrected=facts.corrected,
            )  # fmt: skip
        except CmmUqError as error:
            where = f"{job.folder / 'job.toml'}: [by_calibrated_part]"
            raise CmmUqError(error.problem, where=where, fix=error.fix) from error
        figures.append(replace(figure, zone=plan.characteristics[i].what in ZONES))
    seen: dict[str, Seen] = {
        MACHINE: "systematic", NOISE: "varied", STYLUS: "varied" if facts.qualified_anew else "systematic",
        TEMPERATURE: "stated", FORM: "stated" if any(one.u_part_um or one.u_part_arcsec for one in facts.characteristic)
        else "unseen", FIXTURE: "varied", "operator": "varied" if facts.conditions_varied else "unseen",
        PLACE: "varied" if facts.place_varied else "unseen",
    }  # fmt: skip
    return MethodResult("calibrated_part", tuple(figures), _conditions_calibrated(facts, repeats), seen)


def _certified(one: CalibratedFacts, length: float) -> CalibratedCharacteristic:
    if one.value_deg is not None:
        return CalibratedCharacteristic(
            float(np.radians(one.value_deg)), ARCSECOND * (one.u_arcsec or 0.0), ARCSECOND * one.u_part_arcsec, angle=True
        )  # fmt: skip
    return CalibratedCharacteristic(
        one.value_mm or 0.0, MICROMETRE * (one.u_um or 0.0), MICROMETRE * one.u_part_um, expanding_mm=length
    )


def _conditions_calibrated(facts: CalibratedPartFacts, repeats: Repeats) -> tuple[TestCondition, ...]:
    cycles = len(np.unique(repeats.group))
    return (
        TestCondition(
            say(
                "{count} measurements or more of the calibrated part, in {cycles} set-ups or more",
                count=FEWEST_READINGS,
                cycles=FEWEST_CYCLES,
            ),
            len(repeats.group) >= FEWEST_READINGS and cycles >= FEWEST_CYCLES,
        ),
        TestCondition(
            say("The calibrated part is measured as the part is: points, styli, clamping"), facts.same_procedure
        ),
        TestCondition(
            say(
                "The calibrated part is like the part: size within 10 % (25 mm below 250 mm), angles within 5°, form, "
                "roughness and material alike"
            ),
            facts.similar,
        ),
        TestCondition(
            say("The part is measured in place of the calibrated part, or both lie in many places"),
            True if facts.place_varied else facts.substitution,
        ),
        TestCondition(
            say("The repeats show what varies in use: times of day, temperatures, operators"), facts.conditions_varied
        ),
        TestCondition(say("The calibrated part has a certificate that the job names"), bool(facts.certificate)),
    )


def _orientations(
    job: PartJob, facts: OrientationsFacts, repeats: Repeats, plan: Plan, slopes: Sensitivities
) -> MethodResult:
    values, standards = _values(repeats, plan), _standards(job, facts)
    room, part = job.facts.environment, job.facts.part
    warm = PartWarmth(room.part_c, room.u_part_k, part.cte_per_k, part.u_cte_per_k)
    figures = []
    for i, one in enumerate(plan.characteristics):
        if one.name in values:
            own = Slopes(_felt(slopes.scale[i]), {name: _felt(slope[i]) for name, slope in slopes.tips.items()})
            figure = by_orientations(
                one.name, values[one.name], repeats.group, own, standards, warm, angle=one.what == "angle"
            )
            figures.append(replace(figure, zone=one.what in ZONES))
    seen: dict[str, Seen] = {
        MACHINE: "varied",
        NOISE: "varied",
        STYLUS: "corrected" if facts.probe_standard else "varied" if facts.qualified_anew else "unseen",
        TEMPERATURE: "stated",
        FORM: "varied" if facts.points_varied else "unseen",
        FIXTURE: "varied",
        "operator": "unseen",
        PLACE: "varied" if facts.place_varied else "unseen",
    }
    conditions = _conditions_orientations(facts, repeats, plan, slopes, [figure.name for figure in figures])
    return MethodResult("orientations", tuple(figures), conditions, seen)


def _felt(slope: float) -> float:
    return 0.0 if abs(slope) < _FELT else float(slope)


def _standards(job: PartJob, facts: OrientationsFacts) -> CalibratedStandards:
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
    return CalibratedStandards(length, tips)


def _standard(size_mm: float, u_um: float, read: StandardReadings, **more: float) -> CalibratedStandard:
    inner = bool(more.pop("inner", False))
    return CalibratedStandard(size_mm, MICROMETRE * u_um, read.values, read.group, inner, **more)


def _conditions_orientations(
    facts: OrientationsFacts, repeats: Repeats, plan: Plan, slopes: Sensitivities, tested: Sequence[str]
) -> tuple[TestCondition, ...]:
    counts = np.unique(repeats.group, return_counts=True)[1]
    rows = [i for i, one in enumerate(plan.characteristics) if one.name in tested]
    styli = [name for name, slope in slopes.tips.items() if np.any(np.abs(slope[rows]) >= _FELT)]
    without = [name for name in styli if name not in {one.stylus or plan.styli[0].name for one in facts.probe_standard}]
    found = [
        TestCondition(
            say(
                "{count} orientations or more, with {repeats} measurements or more in each",
                count=ORIENTATIONS_ASKED,
                repeats=REPEATS_ASKED,
            ),
            len(counts) >= ORIENTATIONS_ASKED and int(counts.min()) >= REPEATS_ASKED,
        ),
    ]
    if np.any(np.abs(slopes.scale[rows]) >= _FELT):
        found.append(TestCondition(say("A calibrated length standard, for the scale that all orientations have in common"),
                               facts.length_standard is not None))  # fmt: skip
    if styli:
        which = listed(names(without)) if without else listed(names(styli))
        found.append(
            TestCondition(say("A calibrated ring, sphere or plug for the tips of {styli}", styli=which), not without)
        )
    certificates = [one.certificate for one in facts.probe_standard]
    if facts.length_standard is not None:
        certificates.append(facts.length_standard.certificate)
    if certificates:
        found.append(TestCondition(say("Each standard has a certificate that the job names"), all(certificates)))
    found.append(
        TestCondition(say("Other points in each orientation, so that the part's form is seen"), facts.points_varied)
    )
    return tuple(found)
