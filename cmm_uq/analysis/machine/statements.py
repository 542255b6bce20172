"""What is stated of a machine's axes: how each is read, in place of what physics allows of its periodic error and play."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from cmm_uq.analysis.machine.state import Unmodelled, stated_as
from cmm_uq.base.points import Machine
from cmm_uq.machine.model.field import as_read
from cmm_uq.machine.model.readings import AxisReading
from cmm_uq.machine.physics.effects.drives import Hysteresis, PeriodicScale


def readings_of(machine: Machine) -> dict[str, AxisReading]:
    """By axis, of those of which it is stated how they are read."""
    q = float(np.sqrt(-2 * np.log(0.05)))
    return {axis: AxisReading(facts, q * _allowed(axis)) for axis, facts in machine.read_by.items()}


def _allowed(axis: str) -> float:
    return PeriodicScale(axis).coefficients[0].prior_sd


def with_readings(others: Iterable[Unmodelled], machine: Machine) -> tuple[Unmodelled, ...]:
    """Errors that were not modelled, those of axes as these are stated to be read; a bound stands before that."""
    known, found = readings_of(machine), list[Unmodelled]()
    for one in others:
        effect, reading = one.effect, known.get(getattr(one.effect, "axis", ""))
        if one.unstated is not None:
            one = replace(one, unstated=with_readings((one.unstated,), machine)[0])
        elif reading is not None:
            if isinstance(effect, PeriodicScale):
                one = stated_as(one, as_read(effect, reading.largest_um, reading.errors))
            elif isinstance(effect, Hysteresis) and reading.play_um is not None:
                one = stated_as(one, as_read(effect, reading.play_um))
        found.append(one)
    return tuple(found)
