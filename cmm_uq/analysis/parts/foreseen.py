"""What U of a part's characteristics will be once a further recording of the machine is there (:mod:`..machine.foreseen`)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from cmm_uq.analysis.machine.foreseen import EACH, foreseen
from cmm_uq.analysis.machine.recordings import FurtherRecordings
from cmm_uq.analysis.machine.state import at_points
from cmm_uq.analysis.parts.causes.cause import Drawn, Rows
from cmm_uq.analysis.parts.characteristics import never_negative
from cmm_uq.analysis.parts.plan import Plan
from cmm_uq.analysis.parts.virtual import AtPose, MeasurementConditions, Virtual, thinned
from cmm_uq.base.messages import Text
from cmm_uq.base.points import Floats, Ints
from cmm_uq.base.values import dataclass, replace
from cmm_uq.machine.model.measurement import RecordingModel

LEVELS = (0.1, 0.5, 0.9)  # of ten machines as this may be, that of one, five and nine is no larger


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
        drawn: list[Drawn] = [
            cause.draw(np.random.default_rng([seed, i]), len(of)) for i, cause in enumerate(place.causes)
        ]
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
