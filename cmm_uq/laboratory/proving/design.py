"""The cases that are drawn on a job's set-ups, each a function of seed and number alone, and how far these set-ups reach."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from functools import cached_property
from math import inf

import numpy as np

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.messages import Text
from cmm_uq.base.points import Floats, Points
from cmm_uq.base.units import Unit
from cmm_uq.base.values import dataclass, field, replace
from cmm_uq.laboratory.proving import cases
from cmm_uq.laboratory.proving.cases import ALLOWED, Case, HiddenEffect, Sensitivity, UnknownCause, remaining_length
from cmm_uq.machine.model import Noise, RecordingModel
from cmm_uq.machine.model.artefact import LAST_DIGIT
from cmm_uq.machine.model.noise import noise_of
from cmm_uq.machine.physics.catalogue import every
from cmm_uq.machine.physics.effect import Effect
from cmm_uq.maths.inference.noise import AXES as AXIS_NOISE, GROWTH, PLACING, SLOW

_LARGEST_FOREIGN_UM = 200.0
_SHORTEST_PERIOD_MM = 6.0  # as the diagnosis tries them; beyond the range of the readings a wave is no wave
_ATTEMPTS = 40
# how kinds of noise differ from the job's own, in units of its reading noise; forgetting over a part of the duration
_AXIS_TIMES, _GROWN_TIMES, _DOF, _STEP_TIMES, _SLOW_PART, _WALKED_TIMES = 3.0, 2.0, 4.0, 3.0, 0.125, 2.0


_COMPONENTS = {cases.SET_UP: PLACING, cases.AXIS: AXIS_NOISE, cases.GROWING: GROWTH}
_COMPONENTS |= dict.fromkeys((cases.SLOWLY, cases.WALKING), SLOW)


@dataclass(frozen=True, eq=False)
class Design:
    """The set-ups that cases are drawn on."""

    model: RecordingModel  # what the job names, with its artefact in its set-ups
    values: Floats  # (k,) true parameters of what it names, and sizes of the artefact
    noise: Noise
    cte_per_k: float = 0.0  # expansion of the artefact; 0 where it is not stated
    # recordings of which the observations are differences, each with the noise: two where the artefact was recorded
    # earlier, which is not drawn again
    dates: int = 1
    sights: dict[str, Sensitivity] = field(default_factory=dict)

    @property
    def coefficients(self) -> Floats:
        return self.values[: len(self.values) - len(self.model.artefact.sizes)]

    def sight(self, noise: Noise) -> Sensitivity:
        key = repr(noise)
        if key not in self.sights:
            self.sights[key] = Sensitivity.of(self.model, self.values, noise)
        return self.sights[key]

    @cached_property
    def noises(self) -> tuple[str, ...]:
        """Kinds of noise that these set-ups could show, in the order of cases: every other one the job's own."""
        possible = noise_of(self.model, values=self.values).possible
        shown = [cases.WHITE, *(kind for kind, component in _COMPONENTS.items() if component in possible)]
        return tuple(each for kind in (*shown, cases.TAILS, cases.RESOLUTION) for each in (cases.OWN, kind))

    @cached_property
    def effects(self) -> tuple[Effect, ...]:
        """That could act, and whose largest sizes would show under the job's own noise."""
        reach = {name: max(map(_length, versions)) for name, versions in self.sight(self.noise).candidates.items()}
        return tuple(
            effect for effect in cases.possible_effects(self.model)
            if ALLOWED * reach[effect.name] >= cases.WEAKEST and self._between(effect) is not None
        )  # fmt: skip

    def _between(self, effect: Effect) -> list[tuple[float, float]] | None:
        """Lowest and highest nonlinear parameters to draw; ``None`` where the readings could show none of them."""
        found = []
        for shape in effect.shape:
            low, high = shape.low, shape.high
            if shape.period_along is not None:
                span = float(np.ptp(self.model.artefact.points.readings[shape.period_along]))
                low, high = max(low, _SHORTEST_PERIOD_MM), min(high, span)
            if low >= high:
                return None
            found.append((low, high))
        return found

    def noise_of_kind(self, kind: str, random: np.random.Generator) -> Noise:
        """The noise of a kind, as large as the job's own readings."""
        own, white = self.noise, cases.white_of(self.noise)
        sigma = float(np.asarray(white.coordinate)[0])
        if kind == cases.AXIS:
            worse = int(random.integers(3))
            x, y, z = (sigma * (_AXIS_TIMES if axis == worse else 1.0) for axis in range(3))
            return replace(white, coordinate=(x, y, z))
        time = self.model.artefact.points.columns.get("time_s", np.zeros(1))
        return {
            cases.OWN: own, cases.WHITE: white, cases.SET_UP: replace(white, placing=sigma),
            cases.GROWING: replace(white, growth=_GROWN_TIMES * sigma),
            cases.SLOWLY: replace(white, slow=sigma, slow_time_s=max(_SLOW_PART * float(np.ptp(time)), 1e-6)),
            cases.WALKING: replace(white, slow=_WALKED_TIMES * sigma, slow_time_s=inf),
            cases.TAILS: replace(white, tails=_DOF), cases.RESOLUTION: replace(white, resolution=_STEP_TIMES * sigma),
        }[kind]  # fmt: skip

    def case(self, seed: int, number: int) -> Case:
        random = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(number, 0)))
        cycle, place = divmod(number, len(cases.CYCLE))
        kind = cases.CYCLE[place]
        rank = cycle * cases.CYCLE.count(kind) + cases.CYCLE[:place].count(kind)
        noise_kind = self.noises[rank % len(self.noises)]
        noise = self.noise_of_kind(noise_kind, random)
        own, draws = self.values[len(self.coefficients) :], random.standard_normal(len(self.model.artefact.sizes))
        each = zip(self.model.artefact.sizes, own, draws, strict=True)
        sizes = (float(size.nominal + size.sd * z if size.certified else value) for size, value, z in each)
        case = Case(number, kind, noise_kind, noise, tuple(sizes))
        sight = self.sight(noise)
        if kind in (cases.OUTSIDE, cases.ARTEFACT):
            if (stranger := self._stranger(sight, kind, random)) is not None:
                return replace(case, stranger=stranger)
            kind = cases.ONE
        hidden = self._hidden(sight, 2 if kind == cases.TWO else 1, seed, rank, random) if kind != cases.NOTHING else ()
        return replace(case, kind=(cases.NOTHING, cases.ONE, cases.TWO)[len(hidden)], hidden=hidden)

    def _hidden(
        self, sight: Sensitivity, count: int, seed: int, rank: int, random: np.random.Generator
    ) -> tuple[HiddenEffect, ...]:
        if not self.effects:
            return ()
        order = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(3,))).permutation(len(self.effects))
        for attempt in range(_ATTEMPTS):
            first = int(order[(rank + attempt) % len(order)])
            others = [i for i in range(len(self.effects)) if i != first]
            second = [int(random.choice(others))] if count == 2 and others else []
            if found := self._of_effects(sight, [self.effects[i] for i in (first, *second)], random):
                return found
        return self._hidden(sight, 1, seed, rank, random) if count == 2 else ()

    def _of_effects(
        self, sight: Sensitivity, chosen: list[Effect], random: np.random.Generator
    ) -> tuple[HiddenEffect, ...]:
        """These effects with strengths at random; none where one would have to be larger than physics allows."""
        shapes = [
            tuple(float(np.exp(random.uniform(np.log(low), np.log(high)))) for low, high in self._between(effect) or [])
            for effect in chosen
        ]
        ways = [random.standard_normal(len(effect.coefficients)) for effect in chosen]
        ways = [np.asarray(way / np.linalg.norm(way)) for way in ways]
        seen = [sight.effect(e, shape) @ way for e, shape, way in zip(chosen, shapes, ways, strict=True)]
        found = []
        for i, effect in enumerate(chosen):
            others = [column for j, column in enumerate(seen) if j != i]
            length = remaining_length(seen[i], np.column_stack(others)) if others else _length(seen[i])
            most = min(cases.STRONGEST, ALLOWED * length)
            if most < cases.WEAKEST:
                return ()
            strength = float(random.uniform(cases.WEAKEST, most))
            prior = np.array([c.prior_sd for c in effect.coefficients])
            coefficients = strength / length * prior * ways[i] * random.choice([-1.0, 1.0])
            reported = effect.to_reported(coefficients, np.array(shapes[i], dtype=np.float64))
            found.append(HiddenEffect(effect.name, {name: float(value) for name, value in reported.items()}, strength))
        return tuple(found)

    def _stranger(self, sight: Sensitivity, kind: str, random: np.random.Generator) -> UnknownCause | None:
        what = cases.FUNCTIONS if kind == cases.OUTSIDE else tuple(cases.possible_faults(self.model))
        for _ in range(_ATTEMPTS):
            found = self.stranger(sight, str(random.choice(what)), random)
            if found is not None and found.left >= cases.WEAKEST:
                return found
        return None

    def stranger(self, sight: Sensitivity, what: str, random: np.random.Generator) -> UnknownCause | None:
        """A function or a fault with a strength at random; ``None`` where it shows at no size that is possible."""
        form, errors, points = None, tuple[tuple[float, ...], ...](), self.model.artefact.points
        if what in cases.FUNCTIONS:
            if (form := cases.drawn_form(points, what, random)) is None:
                return None
        elif what == "nodes":
            number, frames = cases.nodes(self.model.placed(self.values), points)
            drawn = random.standard_normal((int(number.max()) + 1, frames.shape[2]))
            errors = tuple(map(tuple, drawn.tolist()))
        strength = float(random.uniform(cases.WEAKEST, cases.STRONGEST))
        unit = UnknownCause(what, 1.0, strength, 0.0, "", form, errors)
        column = sight.seen(self.effect_of(unit).basis(points))[:, 0]
        length = _length(column)
        if strength > _LARGEST_FOREIGN_UM * length:
            return None
        size = strength / length * float(random.choice([-1.0, 1.0]))
        like, left = sight.nearest(column * size)
        return replace(unit, size_um=size, left=left, like=like)

    def effect_of(self, stranger: UnknownCause) -> cases.ForeignEffect:
        """Its error, of a micrometre."""
        if (form := stranger.form) is not None:
            return cases.ForeignEffect(f"outside: {form.what}", form.displacement)
        return cases.artefact_fault(self.model, self.values, stranger.what, self.cte_per_k, stranger.errors)

    def recording(self, case: Case, seed: int, effects: Mapping[str, Effect]) -> Points:
        random = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(case.number, 1)))
        given = [(effects[h.effect], *effects[h.effect].from_reported(h.parameters)) for h in case.hidden]
        acting = [*self.model.effects, *(effect for effect, _, _ in given)]
        coefficients = [self.coefficients, *(each for _, each, _ in given)]
        if case.stranger is not None:
            acting.append(self.effect_of(case.stranger))
            coefficients.append(np.array([case.stranger.size_um]))
        shapes = {**self.model.shapes, **{effect.name: shape for effect, _, shape in given}}
        model = RecordingModel(self.model.artefact, tuple(acting), shapes=shapes)
        noise, times = case.noise, float(np.sqrt(self.dates))
        x, y, z = (times * float(each) for each in np.broadcast_to(np.asarray(noise.coordinate), 3))
        noise = replace(noise, coordinate=(x, y, z), placing=times * noise.placing, growth=times * noise.growth,
                        slow=times * noise.slow)  # fmt: skip
        xyz = model.simulate(np.concatenate(coefficients), np.array(case.sizes), noise, random)
        if not np.all(np.isfinite(xyz)):
            raise CmmUqError(f"case {case.number} has no finite coordinates", where="the recording drawn")
        artefact, points, xyz = self.model.artefact, self.model.artefact.points, xyz.copy()
        rows = np.unique(artefact.rows[artefact.unread()])
        for number in np.unique(points.measurement[rows]):
            own = np.flatnonzero(points.measurement == number)
            still = np.ptp(points.xyz[own], axis=0) <= LAST_DIGIT
            xyz[np.ix_(own, np.flatnonzero(still))] = points.xyz[np.ix_(own, np.flatnonzero(still))]
        return points.at(xyz)


def _length(columns: Floats) -> float:
    """Largest length of a combination of columns (m,) or (m, j) with coefficients of length one."""
    return float(np.linalg.norm(columns, 2))


DRAWN, UNRECORDED, TAKEN, TOO_SMALL, NO_TRAVEL = "drawn", "unrecorded", "taken", "too small", "no travel"
_NOTHING_SHOWS = 0.05  # √λ of the largest size that physics allows below which an effect shows nothing at all
_ALIKE = 0.1  # part of an effect that another leaves of it below which the two look alike
_TRIALS = 5  # draws of a fault by which it is judged


@dataclass(frozen=True)
class Reach:
    """What the set-ups show of an effect under the job's own noise."""

    effect: str  # effect, title: its name, and in words
    title: Text
    standing: str  # drawn; or why no case hides it
    parameter: str  # parameter, unit: its first reported parameter
    unit: Unit
    per_unit: float = 0.0  # √λ of one unit of it; 0 where nothing shows
    allowed: float = 0.0  # largest size that physics allows, in the unit
    columns: tuple[str, ...] = ()  # that it goes by and that the recording has not
    alike: str = ""  # another effect that these set-ups hardly tell from it; empty where there is none

    def amplitude(self, strength: float) -> float | None:
        """Size of this strength; ``None`` beyond what physics allows."""
        size = strength / self.per_unit if self.per_unit else np.inf
        return float(size) if size <= self.allowed else None


def reaches(design: Design) -> tuple[Reach, ...]:
    sight, named = design.sight(design.noise), {effect.name for effect in design.model.effects}
    possible = {effect.name for effect in cases.possible_effects(design.model)}
    drawn, found = {effect.name for effect in design.effects}, []
    for effect in every().values():
        if effect.name in named:
            continue
        first, prior = effect.reported[0], effect.coefficients[0].prior_sd
        columns = cases.unrecorded(design.model, effect)
        if effect.name not in possible:
            standing = UNRECORDED if columns else NO_TRAVEL
            found.append(Reach(effect.name, effect.title, standing, first.name, first.unit, columns=columns))
            continue
        typical = float(np.median([np.sqrt(np.sum(v**2) / v.shape[1]) for v in sight.candidates[effect.name]]))
        standing = DRAWN if effect.name in drawn else TAKEN if typical * ALLOWED < _NOTHING_SHOWS else TOO_SMALL
        alike = _alike(sight, effect.name) if standing == DRAWN and not effect.shape else ""
        size = typical / prior, ALLOWED * prior
        found.append(Reach(effect.name, effect.title, standing, first.name, first.unit, *size, alike=alike))
    return tuple(found)


def _alike(sight: Sensitivity, name: str) -> str:
    column = sight.candidates[name][0][:, 0]
    left, nearest = min((
        (min(remaining_length(column, version) for version in versions), other)
        for other, versions in sight.candidates.items() if other != name
    ), default=(np.inf, ""))  # fmt: skip
    return nearest if left < _ALIKE * float(np.linalg.norm(column)) else ""


@dataclass(frozen=True)
class FaultReach:
    """What the set-ups show of a fault of the artefact."""

    what: str
    shows: bool  # whether it shows at a size that is reckoned with
    left: float = 0.0  # part of it that the nearest effect of the machine leaves, typically; 0 where nothing shows
    like: str = ""

    @property
    def hidden(self) -> bool:
        """Whether one set of set-ups cannot tell it from the machine, however large it is drawn."""
        return not self.shows or self.left < _ALIKE


def fault_reaches(design: Design) -> Iterator[FaultReach]:
    sight = design.sight(design.noise)
    for what in cases.possible_faults(design.model):
        random = [np.random.default_rng(np.random.SeedSequence(0, spawn_key=(7, i))) for i in range(_TRIALS)]
        tried = [design.stranger(sight, what, own) for own in random]
        seen = sorted((one.left / one.strength, one.like) for one in tried if one is not None)
        yield FaultReach(what, True, *seen[len(seen) // 2]) if seen else FaultReach(what, False)
