"""How a machine's errors will be known once a further recording is there, before anybody makes it.

    y₂ = X₂·(β + d) + A₂·a₂ + Σ_f s_f·C₂_f·c_f + P₂·(anything) + ε₂

Given the sizes s and θ what y₂ leaves of the errors does not depend on what will be read (preposterior analysis: Chaloner,
Verdinelli 1995, Statist. Sci. 10, 273). The sizes themselves y₂ will show better, and how large they are decides what it
leaves. So some machines are drawn as the recordings have them, sizes and errors together; each reads a y₂; by its density the
sizes are weighed anew, and errors drawn given both recordings.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from cmm_uq.analysis.machine.conditional import RecordedField, with_errors
from cmm_uq.analysis.machine.recordings import FurtherRecording, FurtherRecordings, sd_of, shown_by
from cmm_uq.analysis.machine.state import MachineState, StatedNoise
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.points import Floats
from cmm_uq.machine.model.field import family_of, linear
from cmm_uq.machine.model.measurement import RecordingModel
from cmm_uq.maths.inference.family_sizes import HELD
from cmm_uq.maths.inference.proposals import evenly_by, weights

# machines drawn, draws of the errors that each leaves, and sizes of errors among them
MACHINES, EACH, _SIZES = 25, 80, 50


def foreseen(
    state: MachineState, model: RecordingModel, beside: FurtherRecordings, seed: int = 0, machines: int = MACHINES
) -> MachineState:
    """The state with draws of its errors about their mean as they will be known, ``EACH`` of each of ``machines``, in turn.

    ``state``: given ``model`` and all of ``beside`` but the last, which is to be made; what is observed there does not matter.
    Raises ``CmmUqError`` where the recordings are not at hand, or tests are among them of which limits alone are known.
    """
    if state.given is None or any(len(one.limit) for one in beside.recordings):
        raise CmmUqError("what a further recording would show follows from recordings alone", where="the machine")
    before, sizes, random = state.given.before, state.given.sizes, np.random.default_rng([seed, 53])
    whole = RecordedField.of(model, before.unmodelled, beside=beside.recordings, in_doubt=beside.doubted(model))
    further, held = beside.recordings[-1], np.linspace(0, HELD - 1, _SIZES).astype(np.int64)
    noise, known = sizes.noise.at(held), dict(zip(state.scales, sizes.families[held].T, strict=True))
    each = [known[name] if name in known else np.abs(random.standard_normal(_SIZES)) for name in whole.field.families]
    scales = np.reshape(each, (-1, _SIZES)).T
    which = np.arange(machines) % _SIZES  # of the sizes, by machine; its errors are of other draws with these
    rows = held[which] + HELD * (np.arange(machines) % (len(state.draws) // HELD))
    named = dict(zip(whole.field.families, scales[which].T, strict=True))
    read = _read(replace(state, draws=state.draws[rows], noise=StatedNoise()), further, named, random)
    shift = np.zeros((len(whole.field.linear.observed), machines))
    shift[len(shift) - len(read.T) :] = (read - further.linear.observed).T
    observed = whole.field.combined[:, None] + whole.field.shown(shift)
    logs = whole.field.log_densities(noise, scales, observed, len(read.T))
    chosen = np.concatenate([evenly_by(weights(one), EACH) for one in logs.T])
    of = np.repeat(np.arange(machines), EACH)
    drawn = whole.coefficients(noise.at(chosen), scales[chosen], random, observed=observed.T[of])
    found = with_errors(before, model, whole, drawn, replace(state.noise, coordinate_mm=state.noise.usual_mm))
    draws = found.draws.reshape(machines, EACH, -1)
    about = draws.mean(axis=(0, 1)) - draws.mean(axis=1, keepdims=True)
    return replace(found, draws=(draws + about).reshape(len(drawn), -1))


def _read(
    state: MachineState, further: FurtherRecording, sizes: dict[str, Floats], random: np.random.Generator
) -> Floats:
    """(N, m) that machines of a state's draws (N, k) may read, wherever the artefact stands; ``sizes``: (N,) by family."""
    linear_model, count = further.linear, len(state.draws)
    found, start = np.zeros((count, len(linear_model.observed))), 0
    for effect in state.effects:
        own = state.draws[:, start : start + len(effect.coefficients)]
        start += len(effect.coefficients)
        found += own @ shown_by(further.model, effect).T
    for one in state.unmodelled:
        effect = linear(one.effect)
        size = sizes.get(family_of(one.effect) or "", np.ones(count))
        drawn = size[:, None] * sd_of(effect) * random.standard_normal((count, len(effect.coefficients)))
        found += drawn @ shown_by(further.model, effect).T
    acting = {(one.name, each.name) for one in state.effects for each in one.coefficients}
    for unknown, column in zip(linear_model.unknowns, linear_model.design.T, strict=True):
        if unknown.key not in acting and np.isfinite(unknown.prior_sd):
            found += np.outer(unknown.prior_mean + unknown.prior_sd * random.standard_normal(count), column)
    for columns in (further.noise, further.changed):
        found += random.standard_normal((count, columns.shape[1])) @ columns.T
    return found
