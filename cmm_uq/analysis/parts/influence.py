"""How far a part's uncertainty rests on what was taken to be known of the machine's errors before its recording.

Sizes of families of errors are half-normal beforehand. With that prior half as wide, or twice, every draw of a machine has
another weight, p′(s)/p(s), so that means and variances of what the machine does to a characteristic follow without drawing
anew. Where such weights have no finite variance, as those of a family that the recording does not show (Pareto tails of k
above 0.5: Vehtari, Simpson, Gelman, Yao, Gabry 2024, J. Mach. Learn. Res. 25(72)), the family's errors are scaled with its
prior, which is then what happens, and elsewhere no less. Errors that are no part of the recording scale with theirs.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator
from dataclasses import dataclass

import numpy as np

from cmm_uq.analysis.parts.causes.cause import Drawn
from cmm_uq.analysis.parts.causes.machine import MACHINE
from cmm_uq.analysis.parts.machine.state import MachineState
from cmm_uq.analysis.parts.virtual import Virtual
from cmm_uq.base.points import Floats
from cmm_uq.machine.model.field import family_of

ALL = "all"
TIMES = (0.5, 2.0)  # by which a prior is narrower or wider
MATTERS = 0.1  # part of U by which it or the value then changes, from which on a figure rests on the prior
_DRAWS, _WORTH, _HEAVY = 4000, 50.0, 0.5


@dataclass(frozen=True, eq=False)
class PriorInfluence:
    """What another prior of one family of errors, or of all, would change."""

    family: str
    times: float  # its width, over the one that was taken
    u: Floats  # (c,) over u as stated
    shift: Floats  # (c,) change of the value over u


def prior_influence(virtual: Virtual, state: MachineState, u: Floats, seed: int) -> tuple[PriorInfluence, ...]:
    """Of each family that acts on the part, and of all together.

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

    def changed(family: str, names: Collection[str]) -> Iterator[PriorInfluence]:
        for times in TIMES:
            logs = {name: 0.5 * scales[name] ** 2 * (1 - times**-2) for name in names if name in scales}
            shown = [name for name, log in logs.items() if _weights(log) is not None]
            weight = _weights(sum((logs[name] for name in shown), np.zeros(len(rows))))
            if weight is None:
                shown, weight = [], np.full(len(rows), 1 / len(rows))
            before, mean = errors.var(axis=0), weight @ errors
            ratio = np.divide(weight @ (errors - mean) ** 2, before, out=np.ones_like(u), where=before > 0)
            # of no more than the whole variance, which other draws have given
            more, shift = np.minimum(before, u**2) * (ratio - 1), errors.mean(axis=0) - mean
            for name in (one for one in logs if one not in shown):
                scaled = own(name)
                more, shift = more + (times**2 - 1) * scaled.var(axis=0), shift + (1 - times) * scaled.mean(axis=0)
            more = more + sum((times**2 - 1) * apart[name] for name in names if name in apart)
            scale = np.where(u > 0, u, 1.0)  # nothing changes what is not uncertain at all
            yield PriorInfluence(
                family, times, np.where(u > 0, np.sqrt(np.maximum(u**2 + more, 0.0)) / scale, 1.0), shift / scale
            )

    found = [one for name in (*scales, *apart) for one in changed(name, (name,))]
    return (*found, *(changed(ALL, (*scales, *apart)) if len(found) > len(TIMES) else ()))


def _weights(logs: Floats) -> Floats | None:
    """Of draws whose density has another one's ratio (N,), as its logarithm; ``None`` where they say nothing of it."""
    weight = np.exp(logs - logs.max())
    weight /= weight.sum()
    largest = np.sort(weight)[-int(3 * np.sqrt(len(weight))) :]
    tail = float(np.mean(np.log(largest / largest[0])))  # Hill's estimate of k
    return weight if tail < _HEAVY and 1 / np.sum(weight**2) > _WORTH else None
