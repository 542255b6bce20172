"""Candidate explanations of what a model leaves, and those of them that are effects of the catalogue.

Each is a set of columns that the observations would show, scaled so that coefficients of one are as large as physics (or,
for a nonparametric term, plausibility) allows; how much smaller they may be is left to the comparison.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.messages import Text, Verbatim, say
from cmm_uq.base.plugins import BrokenPluginError
from cmm_uq.base.points import AXES, Floats, Points
from cmm_uq.machine.model import RecordingModel
from cmm_uq.machine.model.artefact import Artefact
from cmm_uq.machine.physics.catalogue import every
from cmm_uq.machine.physics.effect import Effect, Nonparametric

EFFECT, SEVERAL, UNKNOWN = "effect", "several", "unknown"
UNKNOWN_SD = 0.05  # mm, largest standard deviation of a nonparametric displacement
_SHORTEST_PERIOD, _FINEST_PERIOD = 6.0, 2.0  # mm, searched, and told of besides where a longer one is found
STEP = 0.35  # between frequencies that are tried, over one in the range of the readings
_TILTED, _BENT = (-0.9, -0.45, 0.0, 0.45, 0.9), (-0.5, 0.0, 0.5)
_ROUGH = 0.25  # probability that an idealised effect (:attr:`Effect.idealised_over`) has another form than the simplest
# Of the largest extent of a recording, over which such a form differs; a plate that lies level has next to none along Z
_SHORTEST_OVER = 0.1
# mm that an artefact must reach to show that a machine is out of adjustment: 20 ppm are 2 µm then, and 0.5 µm over a ball
_ADJUSTED = 100.0
_BEYOND = 0.5  # how readily an effect is thought of beyond the size that it mostly keeps to (:attr:`Effect.mostly`)
_MOST_PERIODS, _MOST_SHORTER = 240, 800
_DIVIDED = (-0.4, -0.2, 0.0, 0.2, 0.4)


@dataclass(frozen=True, eq=False)
class Member:
    """One version of an explanation."""

    columns: Floats  # (m, r) mm
    shape: tuple[float, ...] = ()  # nonlinear parameter that they belong to
    weight: float = 1.0  # how probable, among the versions
    # (p, r) mm, a nonparametric function where its covariate is given, for one unit of each coefficient
    values: Floats = field(default_factory=lambda: np.zeros((0, 0)))
    rough: bool = False  # whether an effect has another form here than its own, though the same mechanism


@dataclass(frozen=True, eq=False)
class Explanation:
    """A candidate."""

    name: Text  # the effect's name; for a nonparametric term what it depends on
    kind: str  # effect, several (known effects at once) or unknown (a nonparametric term)
    members: tuple[Member, ...]  # versions, as probable as their weights say
    covariate: Floats | None = None  # (p,) what a nonparametric term depends on, of the points or of the observations
    covariate_name: str | None = None
    term: Nonparametric | None = None  # of a nonparametric one that effects may be imitated by
    imitated_by: tuple[Nonparametric, ...] = ()
    weight: float = 1.0  # how readily it is thought of, beside others of its kind
    effect: Effect | None = None
    # whether it is one of what a machine out of adjustment has, and long enough an artefact shows it
    together: bool = False

    @property
    def shaped(self) -> bool:
        return bool(self.members[0].shape)

    def could_be(self, effect: Explanation) -> bool:
        """Whether this nonparametric term could have the form of an effect."""
        return self.term is not None and self.term in effect.imitated_by


def effect_of(explanation: Explanation) -> Effect:
    """The effect that an explanation is; a fault of the artefact as made for this one."""
    return every()[explanation.name] if explanation.effect is None else explanation.effect


def known_effects(model: RecordingModel, values: Floats, named: tuple[str, ...]) -> list[Explanation]:
    """Every effect of the catalogue that could act here and is not in the model, linear about ``values`` (k,)."""
    points, found = model.artefact.points.at(model.where(values)), []
    # mm, the longest extent along an axis in any of its set-ups: with the artefact placed freely it shows no more
    own = (points.xyz[points.measurement == m] for m in np.unique(points.measurement))
    reach = max(float(np.ptp(xyz, axis=0).max()) for xyz in own)
    for effect in possible_effects(model.artefact):
        if effect.name in named or not effect.shown_in(points):
            continue
        if any(column not in points.columns for column in effect.columns):
            continue
        try:
            tried = ((shape, _seen(model, effect, points, shape, values)) for shape in shapes(effect, points))
            members = tuple(Member(columns, shape) for shape, columns in tried)
        except BrokenPluginError:
            raise
        except CmmUqError:  # the job does not give the travel that this effect needs
            continue
        if any(np.any(member.columns) for member in members):
            if effect.mostly < 1:
                members = (*(replace(m, columns=effect.mostly * m.columns) for m in members),
                           *(replace(m, weight=_BEYOND) for m in members))  # fmt: skip
            members = (*members, *_roughly(model, effect, points, values))
            together = effect.everywhere and reach >= _ADJUSTED
            found.append(Explanation(
                Verbatim(effect.name), EFFECT, members, imitated_by=effect.imitated_by, weight=effect.prior_weight,
                effect=effect, together=together,
            ))  # fmt: skip
    return found


def possible_effects(artefact: Artefact) -> Iterator[Effect]:
    """Every effect of the catalogue, and those faults of artefacts that this one can have."""
    for effect in every().values():
        if not effect.of_artefact:
            yield effect
        elif effect.name in artefact.faults:
            yield artefact.faults[effect.name]


def _roughly(model: RecordingModel, effect: Effect, points: Points, values: Floats) -> Iterator[Member]:
    """An idealised effect, larger or smaller towards the ends or one end of its axis, or of the time."""
    along = effect.course(points)
    if along is None or (span := float(np.ptp(along))) == 0:
        return
    over = span
    if effect.idealised_over in tuple(AXES):  # a guideway has no other form within a fraction of what was measured
        over = max(span, _SHORTEST_OVER * float(np.ptp(points.machine_xyz, axis=0).max()))
    u = (2 * (along - along.min()) / over - span / over)[:, None, None]
    forms = [(s, t) for s in _TILTED for t in _BENT if s or t]
    basis = effect.mostly * model.columns(effect, (), values) * np.array([c.prior_sd for c in effect.coefficients])
    every = np.concatenate([basis * (1 + s * u + t * (1.5 * u**2 - 0.5)) for s, t in forms], axis=2)
    for columns in np.split(model.seen(every, values), len(forms), axis=1):
        yield Member(columns, weight=_ROUGH / (1 - _ROUGH) / len(forms), rough=True)


def refine(model: RecordingModel, values: Floats, explanation: Explanation, members: Iterable[int]) -> Explanation:
    """An explanation with some of its shapes divided: each gives way to five about it that share its weight."""
    effect = explanation.effect
    if effect is None:
        return explanation
    points = model.artefact.points.at(model.where(values))
    shaped = [i for i, member in enumerate(explanation.members) if member.shape]
    scaled = even_scale(effect, np.array([explanation.members[i].shape[0] for i in shaped]))
    even, step = dict(zip(shaped, scaled, strict=True)), float(np.median(np.diff(np.sort(scaled))))
    kept = list(explanation.members)
    for i in members:
        kept[i] = replace(kept[i], weight=kept[i].weight / len(_DIVIDED))
        for part in (part for part in _DIVIDED if part):
            shape = (float(from_even_scale(effect, np.array(even[i] + part * step))),)
            kept.append(Member(_seen(model, effect, points, shape, values), shape, kept[i].weight))
    return replace(explanation, members=tuple(kept))


def with_shorter_periods(model: RecordingModel, values: Floats, explanation: Explanation) -> Explanation:
    """A periodic effect with periods below those searched, which equal distances fit as well; octaves equally probable."""
    effect = effect_of(explanation)
    axis = effect.shape[0].period_along
    if axis is None:
        return explanation
    points = model.artefact.points.at(model.where(values))
    step = STEP / float(np.ptp(points.readings[axis]))
    first = max(1 / member.shape[0] for member in explanation.members if member.shape) + step
    frequencies = np.arange(first, 1 / _FINEST_PERIOD, step)[:_MOST_SHORTER]
    more = tuple(
        Member(_seen(model, effect, points, (float(1 / f),), values), (float(1 / f),), float(first / f))
        for f in frequencies
    )
    return replace(explanation, members=(*explanation.members, *more))


def even_scale(effect: Effect, shape: Floats) -> Floats:
    """An effect's nonlinear parameter on the scale on which it is tried evenly: frequency for a period, else its logarithm."""
    return 1 / shape if effect.shape[0].period_along else np.log(shape)


def from_even_scale(effect: Effect, value: Floats) -> Floats:
    return 1 / value if effect.shape[0].period_along else np.exp(value)


def effects_together(singles: Sequence[Explanation]) -> list[Explanation]:
    """All known effects of the machine at once, each as large as the others in the observations."""
    columns = [e.members[0].columns for e in singles if not e.shaped and (e.effect is None or not e.effect.of_artefact)]
    if len(columns) < 2:
        return []
    together = np.hstack(columns)
    rms = np.sqrt(np.mean(together**2, axis=0))
    member = Member(UNKNOWN_SD * together / np.where(rms > 0, rms, 1.0))
    return [Explanation(say("several effects together"), SEVERAL, (member,))]


def shapes(effect: Effect, points: Points) -> Iterator[tuple[float, ...]]:
    """Values of an effect's nonlinear parameter to try: of a period, those that the readings can tell apart."""
    axis = effect.shape[0].period_along if effect.shape else None
    if axis is None:
        yield from effect.trials()
    elif (span := float(np.ptp(points.readings[axis]))) > 2 * _SHORTEST_PERIOD:
        step = STEP / span
        for frequency in np.arange(0.7 / span, min(1 / _SHORTEST_PERIOD, _MOST_PERIODS * step), step):
            yield (float(1 / frequency),)


def _seen(model: RecordingModel, effect: Effect, points: Points, shape: tuple[float, ...], values: Floats) -> Floats:
    scale = np.array([c.prior_sd for c in effect.coefficients])
    return model.seen(model.columns(effect, shape, values) * scale, values)
