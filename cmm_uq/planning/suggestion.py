"""Which further placing would part effects that a recording cannot tell apart, how often to measure it, and what follows.

The artefact is set up as it was recorded, elsewhere and in other attitudes. What each such placing would add to the recording
is known before it is measured; the odds that are to be expected follow from the size at which each effect of a pair explains
the recording, with everything else fitted anew.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import combinations

import numpy as np

from cmm_uq.diagnosis.comparison.explanations import shapes
from cmm_uq.diagnosis.diagnosis import Diagnosis
from cmm_uq.errors import CmmUqError
from cmm_uq.jobs.artefact import ArtefactFacts
from cmm_uq.jobs.plan import PlanFacts
from cmm_uq.messages import Text, number, say
from cmm_uq.model import MeasurementModel
from cmm_uq.model.kind import Observe, Observed
from cmm_uq.model.measurement import ARTEFACT
from cmm_uq.physics.catalogue import every
from cmm_uq.planning.information import certified, gram, scales, shared
from cmm_uq.planning.placing import Placing, appended
from cmm_uq.planning.separation import left_of
from cmm_uq.planning.setting import Planning
from cmm_uq.planning.volume import Volume
from cmm_uq.points import Floats

ODDS = 20.0
"""Odds that the suggested repetitions are expected to reach."""

_MOST = 30
_CANDIDATES = 120


@dataclass(frozen=True)
class Suggestion:
    """A placing, how often to repeat it, and what it is expected to decide.

    Parameters
    ----------
    separates : names of the two effects.
    what : in words.
    repetitions : how often to measure it.
    odds : of the true one of the two over the other that are then to be expected.
    """

    separates: tuple[str, str]
    what: Text
    repetitions: int
    odds: float


@dataclass(frozen=True, eq=False)
class _Information:
    """Information of the recording (k, k), of each candidate (c, k, k) and of certificates (k, k).

    ``names`` (k,) says whose rows they are, ``fitted`` which of them the diagnosis fits beside any pair.
    """

    names: tuple[str, ...]
    fitted: frozenset[str]
    recorded: Floats
    each: Floats
    prior: Floats


def suggestions(
    diagnosis: Diagnosis,
    facts: ArtefactFacts,
    observe: Observe,
    planning: Planning | None,
    plan: PlanFacts | None = None,
) -> tuple[Suggestion, ...]:
    """One placing for each pair that cannot be told apart, within the machine's travel or the recorded volume.

    Parameters
    ----------
    diagnosis : with groups of effects that look alike.
    facts : of the artefact.
    observe : makes the artefact of facts and points.
    planning : what its kind offers; without it nothing is suggested.
    plan : what the volume and the fixtures allow.
    """
    pairs = [pair for group in diagnosis.indistinguishable for pair in combinations(group[:3], 2)]
    if not pairs or planning is None or planning.elsewhere is None:
        return ()
    model = _with_all(diagnosis.after, sorted({name for pair in pairs for name in pair}))
    artefact = diagnosis.after.artefact
    if facts.with_references:  # one placing alone does not show how long the artefact is
        facts = facts.model_copy(update={"length_mm": artefact.sizes[0].nominal})
    try:
        points = artefact.points
        volume = Volume.of(points.machine, plan or PlanFacts(margin_mm=0.0), points.carriages)
        places = planning.elsewhere(artefact, volume, _CANDIDATES)
        known = _information(diagnosis.after, model, partial(observe, facts), places, shared_freedoms=planning.shared)
    except CmmUqError:  # nowhere else to put it
        return ()
    found = [
        _best(diagnosis.after, known, places, say("{artefact:small}", artefact=artefact.title), pair) for pair in pairs
    ]
    return tuple(suggestion for suggestion in found if suggestion is not None)


def _with_all(after: MeasurementModel, names: Sequence[str]) -> MeasurementModel:
    """The model with every effect of every pair, periods as found or the longest."""
    shape = dict(after.shapes)
    for name in names:
        if every()[name].shape and name not in shape:
            shape[name] = next(iter(shapes(every()[name], after.artefact.points)))
    others = tuple(effect for effect in after.effects if effect.name not in names)
    return replace(after, effects=(*others, *(every()[name] for name in names)), shapes=shape)


def _information(
    after: MeasurementModel,
    model: MeasurementModel,
    observe: Observed,
    places: Sequence[Placing],
    *,
    shared_freedoms: bool,
) -> _Information:
    values = np.array([unknown.prior_mean for unknown in model.unknowns])
    names = tuple(unknown.key[0] for unknown in model.unknowns)
    fitted = frozenset({ARTEFACT, *(effect.name for effect in after.effects)})
    if shared_freedoms:
        every = appended(model.artefact.points, places)
        whole = shared(MeasurementModel(observe(every), model.effects, model.sigma, shapes=model.shapes))
        count = len(whole.each) - len(places)
        more = len(whole.prior) - len(names)
        return _Information(
            (*names, *[ARTEFACT] * more), fitted, whole.each[:count].sum(axis=0), whole.each[count:], whole.prior
        )
    each = [
        gram(MeasurementModel(observe(place.points), model.effects, model.sigma, shapes=model.shapes), values)
        for place in places
    ]
    return _Information(names, fitted, gram(model, values), np.stack(each), certified(model.unknowns))


def _best(
    after: MeasurementModel, known: _Information, places: Sequence[Placing], title: Text, pair: tuple[str, str]
) -> Suggestion | None:
    sizes = {name: _size(after, name, pair) for name in pair}
    before = float(_expected(known, known.recorded[None], pair, sizes)[0])
    for repetitions in range(1, _MOST + 1):
        log_odds = _expected(known, known.recorded + repetitions * known.each, pair, sizes)
        best = int(np.argmax(log_odds))
        if log_odds[best] >= np.log(ODDS):
            odds = float(np.exp(min(log_odds[best], 50.0)))
            times = say("once") if repetitions == 1 else say("{repetitions} times", repetitions=repetitions)
            what = say(
                "Place the {title} at {ends} mm in scale readings and measure it {times}: odds of {odds} : "
                "1 for the true one are to be expected, {before} : 1 without it.",
                title=title,
                ends=places[best].ends,
                times=times,
                odds=_round(odds),
                before=_round(float(np.exp(min(before, 50.0)))),
            )
            return Suggestion(pair, what, repetitions, odds)
    return None


def _size(after: MeasurementModel, name: str, pair: tuple[str, str]) -> Floats:
    """Size at which one effect of a pair, without the other, explains the recording, over its prior standard deviation."""
    others = tuple(effect for effect in after.effects if effect.name not in pair)
    effect = every()[name]
    shape = dict(after.shapes)
    if effect.shape and name not in shape:
        shape[name] = next(iter(shapes(effect, after.artefact.points)))
    model = replace(after, effects=(*others, effect), shapes=shape)
    value = model.estimate().least_squares.value / scales(model.unknowns)
    return np.asarray([v for v, u in zip(value, model.unknowns, strict=True) if u.key[0] == name], dtype=np.float64)


def _expected(known: _Information, information: Floats, pair: tuple[str, str], sizes: Mapping[str, Floats]) -> Floats:
    """Expected log odds (c,) of the true one of a pair over the other, the less of the two, everything else fitted."""
    both = {name: [i for i, owner in enumerate(known.names) if owner == name] for name in pair}
    rest = [i for i, owner in enumerate(known.names) if owner in known.fitted and owner not in pair]
    found = []
    for true, other in (pair, pair[::-1]):
        left = left_of(information + known.prior, both[true], [*rest, *both[other]])
        found.append(0.5 * np.einsum("i,cij,j->c", sizes[true], left, sizes[true]))
    return np.asarray(np.minimum(found[0], found[1]), dtype=np.float64)


def _round(odds: float) -> Text:
    return number(odds, ".0f") if odds < 1000 else say("more than 1000")
