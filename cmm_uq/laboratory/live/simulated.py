"""Instruments that are not there, for a first try without any: thermometers that drift, and a machine with known errors.

Nothing of it is ever taken for a measurement: a session with them runs only in a job whose origin is ``simulated``.
"""

from __future__ import annotations

import contextlib
import queue
import threading
from collections.abc import Iterator, Sequence

import numpy as np

from cmm_uq.base.points import AXES
from cmm_uq.jobs.tables.plan import DeclaredSource
from cmm_uq.laboratory.live.instruments.source import Clock, Event, Identity, Reading
from cmm_uq.laboratory.live.lead import PlannedPoint
from cmm_uq.laboratory.live.recorder import COORDINATES

MAKER = "simulated"
RATE_HZ = 10.0
NOISE_MM = 1e-3  # standard deviation of a coordinate

ERRORS = np.array([[30e-6, 20e-6, 0.0], [0.0, -20e-6, 15e-6], [0.0, 0.0, 10e-6]])
"""What the machine indicates too much: 30, −20, 10 ppm along x, y, z, and two axes that are not square by 20 and 15 µrad."""

TAKES_S = 0.7  # time to measure a point
_PLACED_MM = 5.0  # how far off the plan the artefact is set up
_USUAL = {"pressure_hpa": 1013.2, "humidity_pct": 45.0}


class SimulatedThermometer:
    """A stream: each quantity near a usual value, with a slow wave of a tenth and noise of a thousandth."""

    def __init__(
        self, name: str, quantities: Sequence[str], *, clock: Clock, seed: int, rate_hz: float = RATE_HZ
    ) -> None:
        self.name, self._quantities, self._clock, self._rate = name, tuple(quantities), clock, rate_hz
        self._random = np.random.default_rng([seed, *name.encode()])

    def identity(self) -> Identity:
        return Identity(self.name, MAKER, "thermometer", "0", "1", "none: simulated")

    def events(self, stop: threading.Event) -> Iterator[Event]:
        number, begin = 0, self._clock.monotonic_ns()
        while not stop.is_set():
            number += 1
            wait = number / self._rate - (self._clock.monotonic_ns() - begin) * 1e-9
            if wait > 0:
                self._clock.sleep(wait)
            wave = 0.1 * np.sin(2 * np.pi * number / self._rate / 1800)
            off = wave + 1e-3 * self._random.standard_normal(len(self._quantities))
            values = {name: round(_USUAL.get(name, 20.0) + float(e), 3)
                      for name, e in zip(self._quantities, off, strict=True)}  # fmt: skip
            raw = " ".join(f"{value:.3f}" for value in values.values()).encode() + b"\r\n"
            yield Reading(self.name, number, self._clock.utc_ns(), self._clock.monotonic_ns(), raw, values)

    def close(self) -> None: ...


class SimulatedMachine:
    def __init__(self, name: str, *, clock: Clock, seed: int, noise_mm: float = NOISE_MM) -> None:
        self.name, self._clock, self._seed, self._noise_mm = name, clock, seed, noise_mm
        self._asked: queue.Queue[PlannedPoint] = queue.Queue()
        self._number = 0

    def identity(self) -> Identity:
        return Identity(self.name, MAKER, "machine", "0", "1", "none: simulated")

    def measure(self, step: PlannedPoint) -> None:
        self._asked.put(step)

    def events(self, stop: threading.Event) -> Iterator[Event]:
        while not stop.is_set():
            with contextlib.suppress(queue.Empty):
                yield self._probed(self._asked.get(timeout=0.1))

    def close(self) -> None: ...

    def _probed(self, step: PlannedPoint) -> Reading:
        self._clock.sleep(TAKES_S)
        self._number += 1
        placed = _PLACED_MM * np.random.default_rng([self._seed, step.place[0]]).standard_normal(3)
        noise = self._noise_mm * np.random.default_rng([self._seed, *step.place]).standard_normal(3)
        xyz = step.xyz + placed
        indicated = np.round(xyz + ERRORS @ xyz + noise, 5)
        raw = "PtMeas(" + ", ".join(f"{a.upper()}({v:.5f})" for a, v in zip(AXES, indicated, strict=True)) + ")\r\n"
        values = dict(zip(COORDINATES, indicated.tolist(), strict=True))
        return Reading(self.name, self._number, self._clock.utc_ns(), self._clock.monotonic_ns(), raw.encode(), values,
                       point="PtMeas")  # fmt: skip


def simulated(
    declared: Sequence[DeclaredSource], *, clock: Clock, seed: int, noise_mm: float = NOISE_MM
) -> tuple[list[SimulatedThermometer | SimulatedMachine], SimulatedMachine]:
    """In place of what a job declares, and the machine among them; a thermometer and a machine where it declares nothing."""
    streams = {one.name: [name for name in one.values if name not in COORDINATES] for one in declared}
    name = "simulated-machine" if "machine" in streams else "machine"
    machine = SimulatedMachine(name, clock=clock, seed=seed, noise_mm=noise_mm)
    if not any(streams.values()):
        streams = {"thermometer": ["temp_artefact_c", "temp_air_c"]}
    thermometers = [SimulatedThermometer(name, columns, clock=clock, seed=seed)
                    for name, columns in streams.items() if columns]  # fmt: skip
    return [*thermometers, machine], machine
