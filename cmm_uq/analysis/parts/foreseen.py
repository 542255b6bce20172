"""What U of a part's characteristics will be once a further recording of the machine is there, before anybody makes it.

    y₂ = X₂·(β + d) + A₂·a₂ + Σ_f s_f·C₂_f·c_f + P₂·(anything) + ε₂

Given the sizes s and θ what y₂ leaves of the errors does not depend on what will be read (preposterior analysis: Chaloner,
Verdinelli 1995, Statist. Sci. 10, 273). The sizes themselves y₂ will show better, and how large they are decides what it
leaves. So some machines are drawn as the recordings have them, sizes and errors together; each reads a y₂; by its density the
sizes are weighed anew, and errors drawn given both recordings.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from cmm_uq.analysis.machine.conditional import RecordedField, with_errors
from cmm_uq.analysis.machine.recordings import FurtherRecording, FurtherRecordings, sd_of, shown_by
from cmm_uq.analysis.machine.state import MachineState, StatedNoise, at_points
from cmm_uq.analysis.parts.causes.cause import Drawn, Rows
from cmm_uq.analysis.parts.characteristics import never_negative
from cmm_uq.analysis.parts.plan import Plan
from cmm_uq.analysis.parts.virtual import AtPose, MeasurementConditions, Virtual, thinned
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.messages import Text
from cmm_uq.base.points import Floats, Ints
from cmm_uq.base.values import dataclass, replace
from cmm_uq.machine.model.field import family_of, linear
from cmm_uq.machine.model.measurement import RecordingModel
from cmm_uq.maths.inference.family_sizes import HELD
from cmm_uq.maths.inference.proposals import evenly_by, weights

# machines drawn, draws of the errors that each leaves, and sizes of errors among them
MACHINES, EACH, _SIZES = 25, 80, 50
LEVELS = (0.1, 0.5, 0.9)  # of ten machines as this may be, that of one, five and nine is no larger


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


@dataclass(frozen=True, eq=False)
class ForeseenMeasurement:
    """A further measurement of the machine, and what it will do."""

    name: Text
    U: Floats  # (3, c) mm and rad, by :data:`LEVELS`


def foretold(plan: Plan) -> NDArray[np.bool_]:
    """(c,) whose U is foretold: that of widths goes by the value, too."""
    return ~never_negative(plan)


def foreseen_ratios(
    virtual: Virtual, given: MeasurementConditions, model: RecordingModel, beside: FurtherRecordings, seed: int = 0
) -> Floats:
    """(N, c) of N machines as this may be, u once the last of ``beside`` is there over u now."""
    plan, given = thinned(virtual.plan, given)
    state, columns = given.machine, virtual.places[0].points.columns
    after = at_points(foreseen(state, model, beside, seed), columns)
    now = replace(state, noise=replace(state.noise, coordinate_mm=state.noise.usual_mm))
    rows = np.linspace(0, len(state.draws) - 1, len(after.draws)).astype(np.int64)

    def errors(conditions: MeasurementConditions, of: Ints) -> Floats:
        """(N, c) of these draws of the machine, and of the same of all other causes each time."""
        place = AtPose(plan, conditions, conditions.poses[0], virtual.known)
        drawn: list[Drawn] = [c.draw(np.random.default_rng([seed, i]), len(of)) for i, c in enumerate(place.causes)]
        machine = conditions.machine
        drawn[0] = Rows(machine.draws, machine.mean, of)
        if machine.drift.any():
            drawn[0] = np.asarray(drawn[0]) + random.standard_normal((len(of), len(machine.drift))) * machine.drift
        return place.errors(drawn, exact=virtual.exact, inferred=False) - place.shift

    random = np.random.default_rng([seed, 59])
    before = errors(replace(given, machine=now), rows)
    then = errors(replace(given, machine=after), np.arange(len(after.draws))).reshape(-1, EACH, before.shape[1])
    # of what follows from a measured width, errors about the part as it is, their mean included
    widths = never_negative(plan) & (given.measured is not None)
    before, then = (np.where(widths, np.sqrt(np.mean(one**2, axis=-2)), one.std(axis=-2)) for one in (before, then))
    return np.asarray(np.divide(then, before, out=np.ones_like(then), where=np.broadcast_to(before > 0, then.shape)))


def foreseen_measurement(
    name: Text,
    virtual: Virtual,
    given: MeasurementConditions,
    model: RecordingModel,
    beside: FurtherRecordings,
    U: Floats,
    seed: int = 0,
) -> ForeseenMeasurement:
    """``U``: (c,) as stated, which nothing more that is known makes larger."""
    ratios = np.quantile(foreseen_ratios(virtual, given, model, beside, seed), LEVELS, axis=0)
    return ForeseenMeasurement(name, U * np.minimum(ratios, 1.0))
