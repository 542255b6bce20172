"""What to measure next: the fewest set-ups that part all effects which a recording cannot tell apart.

Odds are those of the diagnosis; what they become follows from the size at which each explains the recording, all
else fitted anew. Which of the two is true is not known: what counts is the worse case.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from itertools import combinations

import numpy as np

from cmm_uq.analysis.diagnosis.comparison.explanations import shapes
from cmm_uq.analysis.diagnosis.diagnosis import Diagnosis
from cmm_uq.analysis.planning.candidates import Information, by_measurement, certified, gram, left_of, scales, shared
from cmm_uq.analysis.planning.exchange import Selection, choose
from cmm_uq.analysis.planning.set_up import ODDS, DetectionChange, DetectionGoal, NextPlan, Separation, SetUp, append
from cmm_uq.analysis.planning.setting import Planning, Volume, turned_set_ups
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.points import Floats
from cmm_uq.base.values import dataclass, field, replace
from cmm_uq.jobs.tables.artefact import ArtefactFacts
from cmm_uq.jobs.tables.plan import PlanFacts
from cmm_uq.machine.model import RecordingModel
from cmm_uq.machine.model.kind import Observe, Observed
from cmm_uq.machine.model.measurement import ARTEFACT
from cmm_uq.machine.physics.catalogue import every

SET_UPS, REPEATS = 8, 10  # most set-ups of a plan, and most repeats of each
_NEVER = 1e6  # amplitude, over the prior standard deviation, of what does not show at all
_UNSEEN = 1e-13  # part of what an effect by itself would tell, that rounding may leave of one that is not seen
_ROUNDING = 1e-9  # the same, below which rounding hides an effect
_HOPELESS = 3  # repeats of a plan that cannot reach everything
_WORTH = 0.1  # least gain in the logarithm of odds for which a plan that does not reach everything is told
_SAME_ODDS = 1e-9  # of their logarithm, by rounding
_CANDIDATES, _TURNED = 120, 12  # of the candidates, how many are tried turned besides
_OF_A_GROUP = 5  # effects of a group of which all pairs are parted


@dataclass(frozen=True, eq=False)
class _Group:
    """Effects in each other's place, and the logarithm of the odds of each, up to a constant."""

    names: tuple[str, ...]
    log_odds: Floats

    @property
    def pairs(self) -> list[tuple[int, int]]:
        """Those that the recording does not part already by the odds that a plan aims at."""
        odds, pairs = self.log_odds.tolist(), combinations(range(len(self.names)), 2)
        return [(a, b) for a, b in pairs if abs(odds[a] - odds[b]) < np.log(ODDS) + _SAME_ODDS]


@dataclass(frozen=True, eq=False)
class _Information:
    """Information of the recording (k, k), of each candidate (c, k, k) and of certificates (k, k)."""

    told: Information
    names: tuple[str, ...]  # (k,) says whose rows they are, fitted which of them the diagnosis fits
    fitted: frozenset[str]
    recorded: Floats

    def rows(self, name: str) -> list[int]:
        return [i for i, owner in enumerate(self.names) if owner == name]

    def left(self, information: Floats, rows: Sequence[int], apart: Sequence[str]) -> Floats:
        """What (..., r, r) is left on rows once what is fitted is, but for some effects."""
        rest = [i for i, owner in enumerate(self.names) if owner in self.fitted and owner not in apart]
        return left_of(information + self.told.prior, rows, rest)


def next_plan(
    diagnosis: Diagnosis, facts: ArtefactFacts, observe: Observe, planning: Planning | None, plan: PlanFacts | None = None,
    goals: Sequence[DetectionGoal] = (),
) -> NextPlan | None:  # fmt: skip
    """The fewest set-ups that part all that cannot be told apart; ``None`` where nothing is to be parted or none helps."""
    groups, after = _groups(diagnosis), diagnosis.after
    if not (groups or goals) or planning is None or planning.elsewhere is None:
        return None
    names = sorted({name for group in groups for name in group.names} | {one.effect for one in goals})
    model, points = _with_all(after, names), after.artefact.points
    if facts.with_references:  # one set-up alone does not show how long the artefact is
        facts = facts.model_copy(update={"length_mm": after.artefact.sizes[0].nominal})
    try:
        volume = Volume.of(points.machine, plan or PlanFacts(margin_mm=0.0), points.carriages)
        places = planning.elsewhere(after.artefact, volume, _CANDIDATES)
        if not planning.shared:
            some = places[:: max(1, len(places) // _TURNED)]
            places = (*places, *turned_set_ups(some, volume))
        known = _information(after, model, partial(observe, facts), places, shared_freedoms=planning.shared)
    except CmmUqError:  # nowhere else to put it
        return None
    sizes = {(group.names[0], name): _size(after, name, group.names) for group in groups for name in group.names}
    # variance of a reading, which repeats average, and of a set-up, over that of a coordinate; each half without repeats
    variances = 0.5, 0.5
    if int(points.group.max()) + 1 != len(np.unique(points.measurement)):
        coordinate, placing = diagnosis.noise.coordinate.value, diagnosis.noise.placing.value
        variances = 1.0, (placing / coordinate if coordinate > 0 else 0.0) ** 2
    aims = _Aims(known, groups, (), sizes, variances)
    most = aims.amplitudes((known.recorded + known.told.each.sum(axis=0))[None], goals)[0]
    aims = replace(aims, wanted=tuple(one for one, size in zip(goals, most, strict=True) if size < _NEVER))
    if (found := _within_reach(aims)) is None:
        return None
    chosen, repeats = found
    after_all = aims.after(chosen, repeats)
    return NextPlan(
        tuple(places[i] for i in chosen.indices), repeats, int(points.measurement.max()) + 1, aims.partings(after_all),
        aims.shown(after_all), float(aims.short(after_all[None])[0]) <= 0, volume.box,
    )  # fmt: skip


def _groups(diagnosis: Diagnosis) -> list[_Group]:
    found, compared = [], diagnosis.search.combinations
    index = {str.__str__(e.name): i for i, e in enumerate(diagnosis.search.first.explanations)}
    for names in diagnosis.indistinguishable:
        taken, instead = names[:_OF_A_GROUP], {}
        if compared is not None and names[0] in index:
            instead = compared.instead(diagnosis.search.chosen, index[names[0]])
        odds = [1.0, *(instead.get(index.get(name, -1), 1.0) for name in taken[1:])]
        found.append(_Group(taken, np.log(odds)))
    return [group for group in found if group.pairs]


def _with_all(after: RecordingModel, names: Sequence[str]) -> RecordingModel:
    shape = dict(after.shapes)
    for name in (name for name in names if name not in shape):
        effect = after.artefact.acting(every()[name])
        if effect.shape:
            shape[name] = next(iter(shapes(effect, after.artefact.points)))
    others = tuple(effect for effect in after.effects if effect.name not in names)
    return replace(after, effects=(*others, *(every()[name] for name in names)), shapes=shape)


def _information(
    after: RecordingModel, model: RecordingModel, observe: Observed, places: Sequence[SetUp], *, shared_freedoms: bool
) -> _Information:
    joint = observe(append(model.artefact.points, places))
    together = RecordingModel(joint, model.effects, model.sigma, shapes=model.shapes)
    names = tuple(unknown.key[0] for unknown in together.unknowns)
    values = np.array([unknown.prior_mean for unknown in together.unknowns])
    if shared_freedoms:
        whole = shared(together)
    else:
        each = by_measurement(together, values)
        whole = Information(together.unknowns, each, certified(together.unknowns))
    count = len(whole.each) - len(places)
    recorded = whole.each[:count].sum(axis=0)
    if not shared_freedoms and len(names) == len(model.unknowns):  # without observations that were set aside
        recorded = gram(model, values)
    names = (*names, *[ARTEFACT] * (len(whole.prior) - len(names)))
    fitted = frozenset({ARTEFACT, *(effect.name for effect in after.effects)})
    return _Information(replace(whole, each=whole.each[count:]), names, fitted, recorded)


def _size(after: RecordingModel, name: str, group: Sequence[str]) -> Floats:
    others = tuple(effect for effect in after.effects if effect.name not in group)
    model = _with_all(replace(after, effects=others), [name])
    try:
        value = model.estimate().least_squares.value / scales(model.unknowns)
    except (CmmUqError, np.linalg.LinAlgError):  # alone it would be larger than any machine's: the largest, then
        value = np.ones(len(model.unknowns))
    return np.asarray([v for v, u in zip(value, model.unknowns, strict=True) if u.key[0] == name], dtype=np.float64)


@dataclass(frozen=True, eq=False)
class _Aims:
    """What a plan shall reach."""

    known: _Information  # information of the recording and of candidates
    groups: Sequence[_Group]
    wanted: tuple[DetectionGoal, ...]
    sizes: Mapping[tuple[str, str], Floats]
    variances: tuple[float, float]  # of a reading and of a set-up, over that of a coordinate
    _start: dict[tuple[int, int, int], float] = field(default_factory=dict)

    def added(self, repeats: int) -> Floats:
        """Information of each candidate (c, k, k) that is measured so often."""
        reading, set_up = self.variances
        return np.asarray(self.known.told.each / (reading / repeats + set_up))

    def after(self, chosen: Selection, repeats: int) -> Floats:
        """Information (k, k) of the recording and what is added to it."""
        return np.asarray(self.known.recorded + self.added(repeats)[list(chosen.indices)].sum(axis=0))

    def short(self, information: Floats) -> Floats:
        """By how much (c,) a plan falls short of all aims together, in logarithms; 0 where it reaches them."""
        total = np.zeros(len(information))
        for g, group in enumerate(self.groups):
            left = self._of_group(information, g)
            for a, b in group.pairs:
                total += np.maximum(np.log(ODDS) - self._log_odds(left, g, a, b), 0.0)
        if self.wanted:
            goal = np.array([one.amplitude for one in self.wanted])
            total += np.maximum(2 * np.log(self.amplitudes(information, self.wanted) / goal), 0.0).sum(axis=1)
        return total

    def partings(self, information: Floats) -> tuple[Separation, ...]:
        """Every pair with its odds before, and with this information (k, k)."""
        return tuple(
            Separation(
                (group.names[a], group.names[b]), float(np.exp(group.log_odds[a] - group.log_odds[b])),
                float(np.exp(min(self._log_odds(left, g, a, b)[0], 50.0))),
            )
            for g, group in enumerate(self.groups)
            for left in [self._of_group(information[None], g)]
            for a, b in group.pairs
        )  # fmt: skip

    def shown(self, information: Floats) -> tuple[DetectionChange, ...]:
        """Every effect that is wanted, as it shows without and with this information (k, k)."""
        found = self.amplitudes(np.stack([self.known.recorded, information]), self.wanted).T.tolist()
        return tuple(DetectionChange(one.effect, *sizes) for one, sizes in zip(self.wanted, found, strict=True))

    def amplitudes(self, information: Floats, goals: Sequence[DetectionGoal]) -> Floats:
        """Smallest amplitude (c, w) of each effect by itself that is detected, over its prior standard deviation."""
        names = [one.effect for one in goals]
        rows = [self.known.rows(name)[0] for name in names]
        left = np.einsum("...ii->...i", self.known.left(information, rows, names))
        alone = np.einsum("...ii->...i", information)[..., rows]
        there = left > _ROUNDING * np.maximum(alone, 1e-300)
        length = np.array([one.length for one in goals])
        return np.asarray(np.where(there, length / np.sqrt(np.where(there, left, 1.0)), _NEVER))

    def _of_group(self, information: Floats, g: int) -> Floats:
        """What (c, r, r) is left on all rows of a group, effect by effect, once what else is fitted is."""
        names = self.groups[g].names
        rows = [row for name in names for row in self.known.rows(name)]
        left, at = self.known.left(information, rows, names), np.arange(len(rows))
        left[:, at, at] += _UNSEEN * np.einsum("...ii->...i", information)[..., rows]  # what rounding leaves of nothing
        return left

    def _log_odds(self, left: Floats, g: int, a: int, b: int) -> Floats:
        """Expected log odds (c,) of the true one of two over the other, the less of the two cases; see :meth:`_of_group`."""
        before = float(self.groups[g].log_odds[a] - self.groups[g].log_odds[b])
        return np.minimum(before + self._gain(left, g, a, b), -before + self._gain(left, g, b, a))

    def _gain(self, left: Floats, g: int, true: int, other: int) -> Floats:
        """Expected log odds (c,) for the true one that a recording's own do not contain yet."""
        key = g, true, other
        if key not in self._start:
            self._start[key] = float(self._expected(self._of_group(self.known.recorded[None], g), *key)[0])
        return self._expected(left, *key) - self._start[key]

    def _expected(self, left: Floats, g: int, true: int, other: int) -> Floats:
        names = self.groups[g].names
        ends = np.cumsum([0, *(len(self.known.rows(name)) for name in names)]).tolist()
        rows, others = (range(ends[i], ends[i + 1]) for i in (true, other))
        size = np.zeros(len(rows))  # further set-ups may have coefficients of their own, after those of the recording
        size[: len(self.sizes[names[0], names[true]])] = self.sizes[names[0], names[true]]
        return np.asarray(0.5 * np.einsum("i,cij,j->c", size, left_of(left, rows, others), size))


def _within_reach(aims: _Aims) -> tuple[Selection, int] | None:
    found = _fewest(aims)
    while found is not None and found[0].after > 0 and aims.wanted:
        missing = aims.amplitudes(aims.after(*found)[None], aims.wanted)[0] / [one.amplitude for one in aims.wanted]
        worst = int(np.argmax(missing))
        if missing[worst] <= 1:
            break
        aims = replace(aims, wanted=aims.wanted[:worst] + aims.wanted[worst + 1 :])
        found = _fewest(aims) or found
    return found


def _fewest(aims: _Aims) -> tuple[Selection, int] | None:
    """As few set-ups as reach all aims, each repeated no more often than that needs; what comes closest where none does."""

    def chosen(count: int, repeats: int) -> Selection:
        return choose(replace(aims.known.told, each=aims.added(repeats)), aims.known.recorded, aims.short, count)

    most = min(SET_UPS, len(aims.known.told.each))
    best = chosen(most, REPEATS)
    if best.before <= 0:
        return None
    if best.after > 0:
        best = chosen(most, _HOPELESS)
        return (best, _HOPELESS) if best.after < best.before - _WORTH else None

    def fewest(most: int, reached: Callable[[int], bool]) -> int:
        few = 0
        while most - few > 1:
            middle = (few + most) // 2
            few, most = (few, middle) if reached(middle) else (middle, most)
        return most

    count = fewest(most, lambda count: chosen(count, REPEATS).after <= 0)
    repeats = fewest(REPEATS, lambda repeats: chosen(count, repeats).after <= 0)
    return chosen(count, repeats), repeats
