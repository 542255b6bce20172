"""Virtual measurements of a part: errors of its characteristics, drawn with every cause at once.

The error is what is measured less what is true: of the nominal part, or, where a form is known on the whole surface, of the
part with the form that was drawn. A characteristic that was measured as y is then y less the errors.

What is never negative, such as a zone, is widened by errors whatever their sign. Where points were measured, its true value is
inferred from what was measured by turning the measurement round (:mod:`cmm_uq.analysis.parts.result`).
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from copy import copy
from functools import cache, cached_property, partial

import numpy as np

from cmm_uq.analysis.machine.performance import PriorInfluence, influence_of
from cmm_uq.analysis.machine.state import MachineState
from cmm_uq.analysis.parts.causes.cause import LARGE, CommonCause, Drawn, PartCause, condensed, normal, together
from cmm_uq.analysis.parts.causes.machine import MACHINE, Qualified, modelled, noise, not_modelled, styli
from cmm_uq.analysis.parts.causes.surroundings import (
    Reproducibility,
    SurfaceForm,
    Surroundings,
    forms,
    mean_expansion,
    temperatures,
    whole_surfaces,
)
from cmm_uq.analysis.parts.characteristics import never_negative
from cmm_uq.analysis.parts.evaluation import Evaluator, Known, Movement, characteristics_of
from cmm_uq.analysis.parts.plan import FORMS, PartPose, Plan, placed
from cmm_uq.analysis.parts.result import Inverse, alike, inverse, nodes_of, trial_parts
from cmm_uq.base.messages import Text
from cmm_uq.base.points import Floats
from cmm_uq.base.values import dataclass, field, replace
from cmm_uq.machine.model.field import family_of
from cmm_uq.maths.uncertainty.propagation import Simulated, Source, simulate_adaptively

FEWEST = 100_000  # virtual measurements, after which u is known to a quarter of a percent
CHECKED = 200  # draws that are looked at exactly, beside first order
ROUNDING = 1e-9  # mm and rad: a spread below which is none
THREADED = 2_000  # draws of a block that are worth a thread
AGREES = 0.01  # of u, by which first order may be off before all is taken exactly: what u is good for
# draws by which the measurement is turned round; u and ends of intervals of zones are then known to a hundredth of u
PILOT = 10_000
_BLOCK = 400_000  # points of the pilot drawn at once
# points of virtual measurements that are drawn at once: 50 MB for each cause that moves each coordinate on its own
_AT_ONCE = 2_000_000
# the same of a plan of thousands of points, of which a block of few draws is large enough to be quick
_AT_ONCE_OF_MANY = 500_000
# bytes of the whole pilot up to which its blocks are drawn once and kept; else they are drawn again when needed
_KEPT = 80_000_000
_PILOT_SEED = 20_101  # of these, in every place alike, so that places are compared by the same
# movements of a block of the pilot, and what adds to its characteristics, the same each time
_PilotBlock = Callable[[], tuple[Movement, Floats]]
# what was modelled of a machine, its mean errors at the points, what was not modelled, and columns that this lacks
_OfMachine = tuple[CommonCause, Floats, list[PartCause], dict[str, str]]


@dataclass(frozen=True, eq=False)
class MeasurementConditions:
    """How and where a part is measured."""

    machine: MachineState  # as its certificate states it
    poses: tuple[PartPose, ...] = (PartPose(),)  # where the part lies; several where nobody knows, each as likely
    surroundings: Surroundings = field(default_factory=Surroundings)
    forms: tuple[SurfaceForm, ...] = ()  # what is known of the form of its features
    repeats: int = 1  # of each point, of whose readings the mean is taken
    further: tuple[PartCause, ...] = ()  # causes of another kind, of the plan's points
    # (n, 3) points of the part as they were measured, in its frame, mm, about which errors are then drawn: a position that is
    # off errs as a distance does. The nominal points without them, and of a part whose whole surfaces are drawn.
    measured: Floats | None = None


class AtPose:
    """Virtual measurements of a part in one place.

    ``given``: its circumstances. ``pose``: the place. ``known``: features that were looked at in another place
    (:class:`Evaluator`). ``pilot``: draws by which the measurement of what is never negative is turned round; fewer, a
    quarter at least, of a plan of thousands of points. ``like``: the same part in the same place, measured otherwise.
    ``base``: (n, 3) by how much points are displaced without any draw, mm. ``still``: (c,) characteristics of the part: as
    measured, less ``base``, or of the nominal one.
    """

    def __init__(
        self, plan: Plan, given: MeasurementConditions, pose: PartPose, known: Known | None = None, pilot: int = PILOT,
        like: AtPose | None = None,
    ) -> None:  # fmt: skip
        surroundings = given.surroundings.since(given.machine.temperature_c)
        self.points = points = placed(plan, pose, given.machine.machine, surroundings.columns)
        qualified = Qualified.on(plan, points, given.machine.machine)
        own, on_surface = forms(given.forms, plan)
        beside, of = None if given.measured is None else given.measured - plan.points, (given.machine, qualified, pose)
        same = like is not None and np.array_equal(like.points.carriages, points.carriages)
        self.of_machine: _OfMachine = like.of_machine if like and same else (*modelled(*of, beside), *not_modelled(*of))
        machine, base, unmodelled, self.lacking = self.of_machine
        first = int(plan.order[0]) if len(plan.order) else 0
        readings = noise(given.machine, points, pose, given.repeats, first)
        warm = temperatures(surroundings, plan, points, pose)
        self.causes: list[PartCause] = [
            machine, *unmodelled, *readings, *styli(plan, pose), *warm, *given.further, *own,
        ]  # fmt: skip
        self.base = base + mean_expansion(surroundings, plan, points, pose)
        self.pilot = max(pilot // 4, min(pilot, pilot * LARGE // len(plan.points)))
        self._inverses = dict[bool, dict[int, Inverse]]()
        self.summed: AtPose | None = None  # the same errors by fewer causes, where nobody asks which cause they are of
        drawn = any(len(feature.surface) for feature in plan.features)
        self.true: Evaluator | None = None
        if drawn or given.measured is None:
            self.still = characteristics_of(plan, plan.points, known)
            self.measured = Evaluator(plan, self.base, self.causes, known)
            self.inferred, self.shift = list[int](), np.zeros_like(self.still)
        else:
            # what was measured has the mean errors in it: the part itself is without them
            deviations = given.measured - self.base - plan.points
            self.still = characteristics_of(plan, plan.points + deviations, known)
            self.measured = Evaluator(plan, deviations, self.causes, known)
            self.inferred = np.flatnonzero(never_negative(plan)).tolist()
            # deviations of the part, as often again as the coefficient says
            draw = normal(np.zeros(1))
            again = CommonCause(name="part", factors=("deviations",), draw=draw, basis=deviations[None])
            self.measured.causes = [*self.causes, again]
            self.shift = characteristics_of(plan, given.measured, known) - self.still
        self._known = known
        if drawn:
            true = whole_surfaces(plan)
            still: list[PartCause | None] = [None] * (len(self.causes) - len(own))
            self.true = Evaluator(true, np.zeros_like(true.points), [*still, *on_surface], known)

    def condensed(self) -> AtPose:
        """The same, of fewer coefficients: where nothing is taken exactly that is to first order, and features are large."""
        plan, evaluator = self.measured.plan, self.measured
        large = {one.name for one in plan.features if len(one.points) >= LARGE and one.kind != "point"}
        if not large:
            return self
        on_points, derivative = evaluator.on_points(), evaluator.derivative()
        fewer = [condensed(cause, plan, on_points, derivative) for cause in self.causes]
        found = self._by(fewer, large & set(on_points))
        del found.of_machine
        found._inverses = {}
        if self.true is None:
            found.summed = found._by(together(fewer), found.measured.along)
        return found

    def _by(self, causes: list[PartCause], along: Collection[str]) -> AtPose:
        """The same by other causes."""
        found, evaluator = copy(self), self.measured
        found.causes = causes
        beside = evaluator.causes[len(self.causes) :]
        found.measured = Evaluator(evaluator.plan, evaluator.base, [*causes, *beside], self._known, along)
        return found

    def drawn(self, random: np.random.Generator, n: int) -> list[Drawn]:
        """Coefficients (n, K) of each cause."""
        return [cause.draw(random, n) for cause in self.causes]

    def moved(self, coefficients: Sequence[Drawn]) -> Floats:
        """(n, p, 3) displacements of the plan's p points beyond ``base``, mm."""
        return self.measured.moved(self._given(coefficients), slice(None))

    def errors(self, coefficients: Sequence[Drawn], *, exact: bool = False, inferred: bool = True) -> Floats:
        """(n, c) errors of the characteristics.

        Where points were measured as x, mean errors b are taken off: q = x − b. What has a sign or a size errs by
        f(q + d) − f(q) with errors d, beside the mean f(x) − f(q). What is never negative errs by f(x) less its true value,
        which follows from f(q + d) by turning the measurement round (``inverse``). Without measured
        points, and with a form that is drawn on whole surfaces, all errs by what is measured less what is true.

        ``inferred``: whether measurements are turned round; else what is never negative errs as all else does, which takes
        less time and compares places as well.
        """
        found = self.read(coefficients, exact=exact)
        true = self.still if self.true is None else self.true(coefficients, exact=exact)
        errors = found + self.shift - true
        for i, inverted in (self.inverses(exact=exact) if inferred else {}).items():
            errors[:, i] = self.shift[i] + self.still[i] - inverted(found[:, i])
        return errors

    def read(self, coefficients: Sequence[Drawn], *, exact: bool = False) -> Floats:
        """(n, c) characteristics as they would be measured, mm and rad.

        Of the nominal part, with mean errors; of the part as it was measured, once more and without mean errors.
        """
        return self.measured(self._given(coefficients), exact=exact) + self._beside(coefficients)

    def _beside(self, coefficients: Sequence[Drawn]) -> Floats:
        """(n, c) of causes that move no point."""
        found = np.zeros((len(coefficients[0]), len(self.still)))
        for cause, drawn in zip(self.causes, coefficients, strict=True):
            if isinstance(cause, Reproducibility):
                found += np.asarray(drawn) @ cause.adds
        return found

    def _given(self, coefficients: Sequence[Drawn]) -> list[Drawn | None]:
        """Coefficients of the evaluator's causes: of errors, and none of further deviations of the part."""
        return [*coefficients, *[None] * (len(self.measured.causes) - len(self.causes))]

    def inverses(self, *, exact: bool) -> dict[int, Inverse]:
        """By place of what is never negative, the map from what is read to what is true; made once for all draws."""
        if exact not in self._inverses:
            self._inverses[exact] = (self.summed or self)._inverted(exact=exact) if self.inferred else {}
        return self._inverses[exact]

    def _inverted(self, *, exact: bool) -> dict[int, Inverse]:
        """Of trial parts with zones of several widths, which may be what was measured with other errors (:func:`.alike`)."""
        perfect = self.measured.movement([*[None] * len(self.causes), -np.ones((1, 1))], exact=exact)
        blocks = self._pilot_blocks(exact=exact)
        pairs = [[self.measured.of(one, exact=exact) + beside for one in (moved, moved.plus(perfect))]
                 for moved, beside in (make() for make in blocks)]  # fmt: skip
        again, alone = (np.concatenate(each) for each in zip(*pairs, strict=True))
        inferred = [i for i in self.inferred if np.ptp(alone[:, i]) > ROUNDING]
        nodes = {i: nodes_of(float(self.still[i]), alone[:, i]) for i in inferred}
        read: dict[int, list[Floats]] = {i: [] for i in nodes}
        for make in blocks:
            moved, beside = make()
            for i, sizes in nodes.items():
                read[i].append(self._trials(i, sizes, moved, perfect, exact=exact) + beside[:, i])
        return {
            i: inverse(float(self.still[i]), again[:, i], alone[:, i], sizes, np.concatenate(read[i], axis=1))
            for i, sizes in nodes.items()
        }

    def _trials(self, i: int, sizes: Floats, moved: Movement, perfect: Movement, *, exact: bool) -> Floats:
        """(m, n) as parts of ``sizes`` (m,) of a zone would be measured with the errors of ``moved``.

        A trial part is what the part may be with another draw, its deviations so many times as its zone then has the size:
        a part that is t away from the measured one, whose deviations are δ, becomes one that is (1 − λ)(−δ) + λt away.
        """
        only, perfect = (self.measured.needed(each, i) for each in (moved, perfect))
        form = self.measured.evaluations[i].characteristic.what in FORMS
        trial = trial_parts(only, perfect, self.measured.plan, form=form)
        truly = self.measured.of(trial, exact=exact, only=i)[:, 0]
        found = np.empty((len(sizes), len(truly)))
        for k, size in enumerate(sizes):
            like = alike(truly, size)
            often = size / np.maximum(truly[like], ROUNDING)
            part = trial.rows(like).times(often).plus(perfect.times(1 - often))
            found[k] = self.measured.of(only.plus(part), exact=exact, only=i)[:, 0]
        return found

    def _pilot_blocks(self, *, exact: bool) -> list[_PilotBlock]:
        """The pilot's blocks, made once and kept where all of them together are small."""
        at_once = min(self.pilot, max(_BLOCK // len(self.points), 2))
        counts = [min(at_once, self.pilot - first) for first in range(0, self.pilot, at_once)]
        blocks = [partial(self._pilot_block, which, count, exact=exact) for which, count in enumerate(counts)]
        size = (4 if self.measured.along else 24) * self.pilot * len(self.points)
        return [cache(block) for block in blocks] if size <= _KEPT else list(blocks)

    def _pilot_block(self, which: int, count: int, *, exact: bool) -> tuple[Movement, Floats]:
        drawn = self.drawn(np.random.default_rng([_PILOT_SEED, which]), count)
        return self.measured.movement(self._given(drawn), exact=exact), self._beside(drawn)

    def off(self, seed: int = 0, count: int = CHECKED) -> Floats:
        """(c,) root mean square difference of what is read to first order from what is exactly, of its standard deviation."""
        random = np.random.default_rng(seed)
        drawn = (self.drawn(random, part) for part in in_parts(self.measured.plan, count))
        found = [[self.read(each, exact=exactly) for exactly in (False, True)] for each in drawn]
        first, exact = (np.concatenate(each) for each in zip(*found, strict=True))
        apart = first - exact
        return np.asarray(np.sqrt(np.mean(apart**2, axis=0)) / np.maximum(exact.std(axis=0), ROUNDING))


def in_parts(plan: Plan, draws: int) -> list[int]:
    """So many draws in parts, of no more points at once than memory should hold."""
    at_once = max(2, (_AT_ONCE if len(plan.points) <= LARGE else _AT_ONCE_OF_MANY) // len(plan.points))
    return [min(at_once, draws - first) for first in range(0, draws, at_once)]


def thinned(plan: Plan, given: MeasurementConditions, like: Plan | None = None) -> tuple[Plan, MeasurementConditions]:
    """The plan with some points for all of those of large features, by which ways are compared; itself where it has none.

    ``like``: the plan whose large features it thins, where that is another one.
    """
    steps = {name: max(1, (rows.stop - rows.start) // LARGE) for name, rows in (like or plan).rows.items()}
    if max(steps.values()) == 1 or given.further:
        return plan, given
    kept = {name: np.arange(of.start, of.stop, steps[name]) for name, of in plan.rows.items()}
    rows, points, normals = np.concatenate(list(kept.values())), plan.points, plan.normals
    features = tuple(replace(f, points=points[kept[f.name]], normals=normals[kept[f.name]]) for f in plan.features)
    order, times = plan.order[np.isin(plan.order, rows)], plan.times_s
    times = times[rows] if len(times) else times
    few = replace(plan, features=features, order=np.searchsorted(rows, order), times_s=times)
    return few, replace(given, measured=None if given.measured is None else given.measured[rows])


class Virtual:
    """Virtual measurements of a part in all of its places, to be drawn in blocks.

    ``known``, ``pilot``: as of :class:`AtPose`. ``first``: the same part measured otherwise, of which what was found is taken.
    ``places``: one a pose, of large features with as few coefficients as serve; ``whole``: the same with those of every point.
    ``exact``: whether nothing is taken to first order, because that is off by more than a hundredth of an uncertainty;
    ``off``: (c,) by how much it is in the first place, of the standard deviation.
    """

    def __init__(
        self, plan: Plan, given: MeasurementConditions, known: Known | None = None, pilot: int = PILOT,
        first: Virtual | None = None,
    ) -> None:  # fmt: skip
        self.plan, self.poses = plan, given.poses
        self.known: Known = first.known if first is not None else known if known is not None else {}
        like = dict(zip(first.poses, first.whole, strict=True)) if first is not None else {}
        self.places = [AtPose(plan, given, pose, self.known, pilot, like.get(pose)) for pose in given.poses]
        self.off: Floats = self.places[0].off() if first is None else first.off
        self.exact = bool(np.any(self.off > AGREES))
        self.whole: list[AtPose] = self.places
        if not self.exact:
            self.places = [place.condensed() for place in self.places]
            self.whole = self.whole if first is None else []

    @property
    def names(self) -> list[str]:
        return [one.name for one in self.plan.characteristics]

    def errors(self, random: np.random.Generator, n: int) -> Floats:
        """(n, c) errors, each place as often as the others."""
        for place in self.places:
            place.inverses(exact=self.exact)
        if n < 2 * THREADED:
            return self._drawn(random, n)
        one, other = random.spawn(2)  # a stream for each half: the same numbers on any number of cores
        with ThreadPoolExecutor(1) as thread:
            half = thread.submit(self._drawn, other, n - n // 2)
            return np.concatenate([self._drawn(one, n // 2), half.result()])

    def _drawn(self, random: np.random.Generator, n: int) -> Floats:
        counts = np.full(len(self.places), n // len(self.places))
        counts[random.permutation(len(counts))[: n - counts.sum()]] += 1
        found = [
            place.errors(place.drawn(random, part), exact=self.exact)
            for place, count in zip((one.summed or one for one in self.places), counts, strict=True)
            for part in in_parts(self.plan, int(count))
        ]
        return np.concatenate(found)

    @cached_property
    def named(self) -> Mapping[str, Text]:
        """By factor, why it should be told beside the result."""
        return {name: why for cause in self.places[0].causes for name, why in cause.named.items()}

    @property
    def source(self) -> Source:
        """The errors as outputs of a Monte Carlo."""
        return Source(self.names, lambda random, n: np.ascontiguousarray(self.errors(random, n).T))

    def settled(self, coverage: float = 0.95, digits: int = 2, seed: int = 0) -> Simulated:
        """As many as the digits of u that are asked for need (JCGM 101, 7.9), a hundred thousand at least."""
        return simulate_adaptively(self.source, coverage, digits, seed, fewest_trials=FEWEST)


_DRAWS = 4000


def prior_influence(virtual: Virtual, state: MachineState, u: Floats, seed: int) -> tuple[PriorInfluence, ...]:
    """How far u rests on what was known of the machine's errors beforehand: each family that acts on the part, and all.

    ``u``: (c,) standard uncertainties as stated, mm and rad.
    """
    place, random = virtual.places[0], np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(31,)))
    nothing: list[Drawn | None] = [None] * len(place.measured.causes)
    still = place.measured(nothing)

    def moved(i: int, drawn: Floats) -> Floats:
        return np.asarray(place.measured([*nothing[:i], drawn, *nothing[i + 1 :]]) - still)

    unseen = {one.effect.name: family_of(one.effect) or one.effect.name for one in state.unmodelled}
    apart = dict[str, Floats]()  # variances (c,) of what is no part of the recording
    for i, cause in enumerate(place.causes):
        if cause.name == MACHINE and i:
            name = unseen[cause.factors[0]]
            apart[name] = apart.get(name, 0.0) + moved(i, np.asarray(cause.draw(random, _DRAWS))).var(axis=0)
    rows = np.linspace(0, len(state.draws) - 1, min(_DRAWS, len(state.draws))).astype(np.int64)
    scales = {name: values[rows] for name, values in state.scales.items()}
    drawn = state.draws[rows] - state.mean
    errors = moved(0, drawn) if scales else np.zeros((len(rows), len(u)))
    of = [family_of(effect) for effect in state.effects for _ in effect.coefficients]

    def own(name: str) -> Floats:
        return moved(0, np.where([one == name for one in of], state.draws[rows], 0.0))

    return influence_of(-errors, u, scales, lambda name: -own(name), apart)
