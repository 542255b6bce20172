"""How far a part's uncertainty rests on what was taken to be known of the machine's errors before its recording."""

from __future__ import annotations

import numpy as np

from cmm_uq.analysis.machine.influence import PriorInfluence, influence_of
from cmm_uq.analysis.machine.state import MachineState
from cmm_uq.analysis.parts.causes.cause import Drawn
from cmm_uq.analysis.parts.causes.machine import MACHINE
from cmm_uq.analysis.parts.virtual import Virtual
from cmm_uq.base.points import Floats
from cmm_uq.machine.model.field import family_of

_DRAWS = 4000


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

    return influence_of(-errors, u, scales, lambda name: -own(name), apart)
