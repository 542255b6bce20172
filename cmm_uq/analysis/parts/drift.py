"""A machine's errors on the day of a part's measurement: what they may have changed by since the calibration.

Where records of the machine say how its errors drift, that is drawn with them; where nothing is known of it, the errors are
named and taken as they were, with the age of the certificate.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from datetime import date

import numpy as np

from cmm_uq.analysis.parts.machine import MachineState
from cmm_uq.base.points import Floats
from cmm_uq.machine.physics.effect import Effect

Change = Callable[[str, float], float | None]
"""Root mean square change of a reported parameter (``scale_x.ppm``), in its unit, by so many days after the calibration;
``None`` where nothing is known of it."""


def aged(state: MachineState, on: date, change: Change | None = None) -> MachineState:
    """The state of a machine on a day.

    Parameters
    ----------
    state : as its certificate states it. Errors that it did not model are drawn as large as they may be on any day.
    on : day of the part's measurement.
    change : by the records; ``None`` where there are none.
    """
    days = 0 if state.calibrated is None else abs((on - state.calibrated).days)
    sizes, unknown = list[Floats](), list[str]()
    for effect in state.effects:
        found = _changes(effect, days, change)
        sizes.append(np.array([0.0 if one is None else one for one in found]))
        if None in found and (days or state.calibrated is None):
            unknown.append(effect.name)
    drift = np.concatenate([np.zeros(0), *sizes])
    return replace(state, drift=drift, drift_unknown=tuple(unknown), measured=on)


def _changes(effect: Effect, days: float, change: Change | None) -> list[float | None]:
    """Of each coefficient; of an amplitude and a phase, that of the amplitude for both."""
    if change is None:
        return [None] * len(effect.coefficients)
    reported = [one.name for one in effect.reported]
    own = [one.name if one.name in reported else reported[0] for one in effect.coefficients]
    return [change(f"{effect.name}.{name}", float(days)) for name in own]
