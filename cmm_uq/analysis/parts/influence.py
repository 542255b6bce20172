"""How far a part's uncertainty rests on what was taken to be known of the machine's errors before its recording.

Sizes of families of errors are half-normal beforehand. With that prior half as wide, or twice, every draw of a machine has
another weight, p′(s)/p(s), so that means and variances of what the machine does to a characteristic follow without drawing
anew (importance sampling; where the draws are then worth too few, nothing is said). Errors that no recording shows at all
scale with their prior itself.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
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
_DRAWS, _WORTH = 4000, 50.0


@dataclass(frozen=True, eq=False)
class PriorInfluence:
    """What another prior of one family of errors, or of all, would change."""

    family: str
    times: float  # its width, over the one that was taken
    u: Floats  # (c,) over u as stated; not a number where draws do not say it
    shift: Floats  # (c,) change of the value over u


def prior_influence(virtual: Virtual, state: MachineState, u: Floats, seed: int) -> tuple[PriorInfluence, ...]:
    """Of each family that acts on the part, and of all together.

    ``u``: (c,) standard uncertainties as stated, mm and rad.
    """
    place, random = virtual.places[0], np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(31,)))
    nothing: list[Drawn | None] = [None] * len(place.measured.causes)
    still = place.measured(nothing)
    errors, alone = np.zeros((0, len(u))), dict[str, Floats]()
    rows = np.linspace(0, len(state.draws) - 1, min(_DRAWS, len(state.draws))).astype(np.int64)
    unseen = {one.effect.name: family_of(one.effect) or one.effect.name for one in state.unmodelled}
    for i, cause in enumerate(place.causes):
        if cause.name != MACHINE:
            continue
        if i == 0:
            drawn = state.draws[rows] - state.mean
            errors = place.measured([drawn, *nothing[1:]]) - still
        else:
            drawn = np.asarray(cause.draw(random, _DRAWS))
            moved = place.measured([*nothing[:i], drawn, *nothing[i + 1 :]]) - still
            name = unseen[cause.factors[0]]
            alone[name] = alone.get(name, np.zeros(len(u))) + moved.var(axis=0)
    scales = {name: values[rows] for name, values in state.scales.items()}
    found = [one for name in (*scales, *alone) for one in _influence(name, (name,), errors, scales, alone, u)]
    every = tuple(_influence(ALL, (*scales, *alone), errors, scales, alone, u)) if len(found) > len(TIMES) else ()
    return (*found, *every)


def _influence(
    family: str,
    names: Iterable[str],
    errors: Floats,
    scales: Mapping[str, Floats],
    alone: Mapping[str, Floats],
    u: Floats,
) -> Iterable[PriorInfluence]:
    names = tuple(names)
    for times in TIMES:
        logs = sum(
            (0.5 * scales[name] ** 2 * (1 - times**-2) for name in names if name in scales), np.zeros(len(errors))
        )
        weight = np.exp(logs - logs.max(initial=-np.inf)) if len(logs) else np.ones(0)
        weight = weight / weight.sum()
        more = sum(((times**2 - 1) * alone[name] for name in names if name in alone), np.zeros(len(u)))
        shift = np.zeros(len(u))
        if len(errors) and any(name in scales for name in names):
            if 1 / np.sum(weight**2) < _WORTH:
                yield PriorInfluence(family, times, np.full(len(u), np.nan), np.full(len(u), np.nan))
                continue
            mean, before = weight @ errors, errors.mean(axis=0)
            shift = before - mean
            own = errors.var(axis=0)
            # of the same draws, and of no more than the whole variance, which has been found by others
            times_own = np.divide(weight @ (errors - mean) ** 2, own, out=np.ones_like(own), where=own > 0)
            more = more + np.minimum(own, u**2) * (times_own - 1)
        with np.errstate(divide="ignore", invalid="ignore"):
            yield PriorInfluence(family, times, np.sqrt(np.maximum(u**2 + more, 0.0)) / u, shift / u)
