"""A job carried from its wishes to a plan: what its placings will tell, and which placings would tell more."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from cmm_uq.analysis.conformity import own_rule
from cmm_uq.analysis.conformity.plan_conditions import conditions
from cmm_uq.analysis.conformity.plans import READY, Condition
from cmm_uq.analysis.conformity.standards import standard_named
from cmm_uq.analysis.diagnosis.diagnosis import FALSE_ALARMS
from cmm_uq.analysis.diagnosis.power import DrawnNoise, Power, powers, without_fault
from cmm_uq.analysis.planning import candidates as choice, exchange, identifiability as design
from cmm_uq.analysis.planning.candidates import candidates, ready_plan, thinned
from cmm_uq.analysis.planning.set_up import SetUp, append, join, split
from cmm_uq.analysis.planning.setting import Setting, Start, white_noise
from cmm_uq.app.commands.model import OVERFLOW_FIX, refuse_planned, refuse_unfit
from cmm_uq.artefacts import kind_of
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.messages import Text, say
from cmm_uq.base.overflow import refusing_overflow
from cmm_uq.base.points import Floats, Points
from cmm_uq.base.units import MICROMETRE
from cmm_uq.base.values import dataclass, replace
from cmm_uq.certificate.part.measurement import PartMeasurement
from cmm_uq.jobs.job import Job
from cmm_uq.machine.physics.effect import Effect

_NANOMETRE = 1e-6


def of_standards(job: Job, setting: Setting, name: str, points: Points, recorded: int) -> tuple[Condition, ...]:
    """Conditions of the standard that a ready plan is named after, and of all that the job wishes to be decided."""
    if setting.observe is None:
        return ()
    # with planned repeats a nanometre apart, as no two readings of a place will be the same
    xyz = points.xyz.copy()
    xyz[recorded:] += _NANOMETRE * points.repeat[recorded:, None]
    points = points.at(xyz)
    # where the lengths lie counts, not yet what certifies them
    facts = setting.artefact.model_copy(update={"nominal": False})
    artefact = setting.observe(facts, points, where=None)
    found = list(conditions(READY[name], artefact, recorded=recorded > 0)) if name in READY else []
    tested = kind_of(job).tested
    for wish in job.facts.conformity:
        standard = standard_named(wish.standard)
        if standard is None:
            continue
        asked = standard.characteristic(wish.characteristic)
        if asked.observed in tested:
            found += asked.conditions(artefact, recorded=recorded > 0)
            found += own_rule.whole(wish.complete, artefact) if wish.complete else ()
    return tuple({condition.what: condition for condition in found}.values())


def completing(
    job: Job, setting: Setting, recorded: Points, after: Callable[[Sequence[SetUp]], Points]
) -> tuple[SetUp, ...]:
    """Placings of the usual ready plan of which each supplies something that the standards' tests still lack."""
    if not job.facts.conformity:
        return ()

    def lacking(points: Points) -> int:
        return sum(len(c.missing) for c in of_standards(job, setting, "", points, len(recorded)))

    least = lacking(recorded)
    if not least:
        return ()
    try:
        _, possible = ready_plan(setting)
    except CmmUqError:
        return ()
    added: list[SetUp] = []
    for placing in possible:
        left = lacking(after([*added, placing]))
        if left < least:
            added, least = [*added, placing], left
    return tuple(added)


RECORDED = say("recording")  # name of the placings of a recording that is there already

SPREAD = say("an even spread of candidates")
"""Name of the placings to compare with where the usual plan is not possible."""

Progress = Callable[[str, float], None]


@dataclass(frozen=True, eq=False)
class Outlook:
    """What some placings tell; ``points`` are the same as one recording.

    identifiability : of the effects named; ``None`` for a kind that names none.
    predicted : (t, 3) u of the machine's place at further set-ups, mm; ``None`` for a kind that has none.
    powers : how large each effect that the job does not name must be for the diagnosis to find it; empty when not asked for,
        and for placings that give way to others by a criterion which does not part effects.
    """

    placings: tuple[SetUp, ...]
    points: Points
    identifiability: design.Identifiability | None
    powers: tuple[Power, ...]
    predicted: Floats | None = None

    @property
    def held_out(self) -> dict[str, float] | None:
        """For results.json, of u at further set-ups."""
        if self.predicted is None:
            return None
        u = self.predicted / MICROMETRE
        return {"poses": len(u), "u_rms_um": float(np.sqrt(np.mean(u**2))), "u_largest_um": float(u.max())}


@dataclass(frozen=True, eq=False)
class MeasurementPlan:
    """What to measure, and what it will tell.

    name : of the placings to start from, a ready plan or the recording.
    start : what these tell.
    better : what the placings tell that were searched for, or that complete a standard's test, with those kept; ``None``
        where there are none.
    kept : how many of the start are part of the better plan.
    scores : of the criterion, before and after; smaller is better.
    conditions : of the standards, by all that will have been measured.
    worth : repeats against placings; ``None`` where nothing is to be measured, or a recording is there.
    free : of a kind that names no effects, what no reading shows, in words.
    part : the part that they are for, with what they will do to its uncertainty; ``None`` where none is named.
    """

    job: Job
    setting: Setting
    name: Text
    start: Outlook
    better: Outlook | None
    kept: int
    scores: tuple[float, float] | None
    conditions: tuple[Condition, ...]
    free: tuple[Text, ...] = ()
    worth: design.RepeatsComparison | None = None
    part: PartMeasurement | None = None

    @property
    def outlook(self) -> Outlook:
        return self.better or self.start

    @property
    def measured(self) -> int:
        return len(self.start.placings) if self.name == RECORDED else 0

    @property
    def first(self) -> int:
        return int(self.job.points.measurement.max()) + 1 if self.name == RECORDED else 1

    @property
    def to_measure(self) -> tuple[SetUp, ...]:
        return self.outlook.placings[self.measured :]

    @property
    def minutes(self) -> tuple[float, ...]:
        """Time of each placing that is to be measured, min."""
        return tuple(minutes(self.setting, placing) for placing in self.to_measure)


def minutes(setting: Setting, placing: SetUp) -> float:
    """Time that a placing takes, min."""
    return setting.plan.minutes_per_placing + setting.plan.seconds_per_point * len(placing.points) / 60


@refusing_overflow("job.toml", OVERFLOW_FIX)
def make_plan(job: Job, *, power: bool = True, seed: int = 0, progress: Progress | None = None) -> MeasurementPlan:
    tell = progress or (lambda what, part: None)

    def predicting(low: float, high: float) -> Callable[[int, int], None]:
        what = "Predicting the diagnosis: effect"
        return lambda count, total: tell(f"{what} {count} of {total}", low + (high - low) * count / total)

    tell("Finding what the placings determine", 0.05)
    refuse_planned(job)
    setting = Setting.of(job, kind_of(job))
    refuse_unfit(job)
    if setting.planning.free is not None:
        return _series_plan(job, setting, setting.planning.free)
    name, placings, points = _start(job, setting)
    setting = setting.sized(points)
    setting = _with_noise(setting, name, points)
    rivals = setting.rivals(points)
    compared = setting.plan.criterion in (None, "separation")
    start = _outlook(setting, placings, points, rivals, power and compared, seed, predicting(0.1, 0.5))
    tell("Searching for better placings", 0.55)
    chosen, kept, scores = _searched(setting, start, rivals, name)
    if chosen is None and name == RECORDED:
        lacked = completing(job, setting, start.points, lambda added: _after(setting, start.points, added))
        chosen, kept = ((*start.placings, *lacked), len(start.placings)) if lacked else (None, 0)
    better = None
    if chosen is not None:
        points = _after(setting, points, chosen[kept:]) if name == RECORDED else _joined(setting, chosen)
        better = _outlook(setting, chosen, points, rivals, power, seed, predicting(0.6, 0.95))
    final = start if better is None else better
    recorded = len(start.points) if name == RECORDED else 0
    met = of_standards(job, setting, name, final.points, recorded) + _in_time(setting, name, placings)
    worth = None if name == RECORDED else design.compare_repeats(setting, final.placings)
    return MeasurementPlan(job, setting, name, start, better, kept, scores, met, worth=worth)


def _with_noise(setting: Setting, name: Text, points: Points) -> Setting:
    """The setting with the noise of what is planned: a recording is there with its residuals, unless another one is named."""
    plan = setting.plan
    said = plan.noise_from is not None or plan.placing_um is not None or plan.growth_um is not None
    if name == RECORDED and not said:
        estimate = setting.model(points).estimate().least_squares
        shown = max(estimate.sigma_of_residuals, 1e-3 * MICROMETRE)
        return replace(setting, sigma=setting.stated or shown, noise=None)
    if setting.noise is None:
        return setting
    model = setting.model(points)
    values = np.array([unknown.prior_mean for unknown in model.unknowns])
    return replace(setting, noise=setting.noise.over(model, values))


def _start(job: Job, setting: Setting) -> tuple[Text, tuple[SetUp, ...], Points]:
    if len(job.points):
        points = job.points.select(~np.isin(job.points.measurement, job.facts.recording.measurements_aside))
        return RECORDED, split(points, lambda n: say("recorded as measurement {n}", n=n)), points
    try:
        name, placings = ready_plan(setting)
    except CmmUqError:
        plan = setting.plan
        if plan.ready is not None or plan.criterion is None or plan.number is None:
            raise
        # the usual plan is not possible here, and not asked for
        name, placings = SPREAD, thinned(iter(candidates(setting)), plan.number, setting.volume)
    return name, placings, _joined(setting, placings)


def _joined(setting: Setting, placings: Sequence[SetUp]) -> Points:
    plan = setting.plan
    return join(
        placings, seconds_per_point=plan.seconds_per_point, minutes_per_placing=plan.minutes_per_placing,
        columns=plan.columns,
    )  # fmt: skip


def _after(setting: Setting, recorded: Points, added: Sequence[SetUp]) -> Points:
    """A recording and further placings, what else was recorded being at its mean there."""
    points = _joined(setting, added)
    columns = {name: points.columns.get(name, np.full(len(points), float(values.mean())))
               for name, values in recorded.columns.items()}  # fmt: skip
    return append(recorded, split(replace(points, columns=columns)))


def _outlook(
    setting: Setting, placings: tuple[SetUp, ...], points: Points, rivals: tuple[Effect, ...], power: bool, seed: int,
    tell: Callable[[int, int], None],
) -> Outlook:  # fmt: skip
    model = setting.model(points)
    found = design.identifiability(model, rivals, setting.noise, setting.circumstances)
    predicted: list[Power] = []
    if power and rivals:
        noise = setting.noise or white_noise(model)
        quiet = without_fault(setting.observed, model, noise.drawn, seed)
        drawn = None
        if setting.noise is not None:
            values = np.array([unknown.prior_mean for unknown in model.unknowns])
            components = setting.noise.components(model, values)
            drawn = DrawnNoise(components, setting.noise.typical, model.artefact.noise_scale)
        for each in powers(
            quiet, rivals, stated=setting.stated, sigma=setting.sigma, alpha=FALSE_ALARMS, seed=seed, noise=drawn
        ):
            predicted.append(each)
            tell(len(predicted), len(rivals))
    return Outlook(placings, points, found, tuple(predicted), design.predicted(setting, placings))


def _searched(
    setting: Setting, start: Outlook, rivals: tuple[Effect, ...], name: str
) -> tuple[tuple[SetUp, ...] | None, int, tuple[float, float] | None]:
    """All placings of the better plan, how many of them were there before, and the criterion before and after."""
    plan = setting.plan
    if plan.criterion is None:
        return None, 0, None
    keep = plan.more is not None or name == RECORDED
    kept = start.placings if keep else ()
    # candidates, of a recording those of its first placing
    first = start.placings[0] if name == RECORDED else None
    possible = candidates(setting, Start(setting.model(start.points).artefact, first))
    known = choice.set_up_information(setting, possible, rivals)
    existing = known.prior + choice.recording_information(setting, start.points, rivals)
    size = np.diag(known.each.sum(axis=0) + existing)  # only effects of which something could show anywhere
    wanted = known.where(rivals) if plan.criterion == "separation" else [*known.where(setting.named), *known.sought]
    wanted = [i for i in wanted if size[i] > 1e-12 * size.max()]
    if not wanted:
        raise CmmUqError("no candidate placing shows any of these effects", where="job.toml [model] effects",
                         fix="Name effects that this artefact can show, or use another artefact")  # fmt: skip
    score = exchange.score_of(plan.criterion, known, wanted)
    count = plan.more or plan.number or (1 if keep else len(start.placings))
    count = _affordable(setting, count, possible, () if name == RECORDED else kept)
    chosen = exchange.choose(known, existing if keep else known.prior, score, count)
    added = tuple(possible[i] for i in chosen.indices)
    return (*kept, *added), len(kept), (float(score(existing[None])[0]), chosen.after)


def _affordable(setting: Setting, count: int, possible: Sequence[SetUp], kept: Sequence[SetUp]) -> int:
    """At most as many as there is time for beside those that are kept."""
    budget = setting.plan.budget_min
    if budget is None:
        return count
    each = max(minutes(setting, placing) for placing in possible)
    left = budget - sum(minutes(setting, placing) for placing in kept)
    if left < each:
        beside = f" beside the {len(kept)} that are kept" if kept else ""
        raise CmmUqError(f"{budget:g} min are too short for a single placing{beside}, which takes {each:.1f} min",
                         where="job.toml [plan] budget_min", fix="Give more time, or fewer repeats")  # fmt: skip
    return min(count, int(left / each))


def _in_time(setting: Setting, name: str, placings: Sequence[SetUp]) -> tuple[Condition, ...]:
    budget = setting.plan.budget_min
    if budget is None or name == RECORDED:
        return ()
    total = sum(minutes(setting, placing) for placing in placings)
    over = (say("{total:.0f} min too many", total=total - budget),) if total > budget else ()
    return (Condition(say("at most {budget:g} min: {total:.0f} min", budget=budget, total=total), over),)


def _series_plan(
    job: Job, setting: Setting, left_open: Callable[[Setting, Points, str], tuple[Text, ...]]
) -> MeasurementPlan:
    """Placings of a kind that names no effects, and what their readings cannot tell."""
    if setting.plan.criterion is not None:
        candidates(setting)  # which says why there are none
    name, placings, points = _start(job, setting)
    start = Outlook(placings, points, None, ())
    return MeasurementPlan(job, setting, name, start, None, 0, None, _in_time(setting, name, placings),
                           left_open(setting, points, job.recording_path))  # fmt: skip
