"""Do intervals of the other methods hold? Machines with a hidden truth measure a plate, a calibrated plate and standards.

Every machine has all common errors, independent and normal, of a third of the size that physics allows, a tip whose effective
diameter is wrong by 1 µm (k = 1), readings with noise of 1 µm and a part whose temperature is wrong by 0.05 K in each set-up.
It measures a plate of 200 × 100 mm with bores

- in four orientations of five measurements, with a bar of 400 mm (u = 0.3 µm) along the plate's length in each and a ring of
  20 mm (u = 0.2 µm): turned so that its length lies along each axis, or about the vertical alone;
- once, after a calibrated plate like it (u_cal = 0.5 µm, or 0.5 µm across the points for zones and angles) was measured twice
  in each of ten set-ups: in the same place, or 250 mm beside it.

Counted is how often |value − truth| ≤ U. Virtual measurements that know how large errors are stand beside.

Run: ``python -m benchmarks.parts.methods [MACHINES]``
"""

from __future__ import annotations

import sys
from collections.abc import Sequence

import numpy as np

from cmm_uq.analysis.machine.state import MachineState, StatedNoise, unmodelled_errors
from cmm_uq.analysis.parts.causes.machine import MACHINE, STYLUS
from cmm_uq.analysis.parts.causes.surroundings import TEMPERATURE, Expansion, Surroundings
from cmm_uq.analysis.parts.methods.method import (
    CalibratedCharacteristic,
    CalibratedStandard,
    CalibratedStandards,
    Slopes,
    by_calibrated_part,
    by_orientations,
)
from cmm_uq.analysis.parts.methods.of_job import sensitivities
from cmm_uq.analysis.parts.plan import PartCharacteristic, PartPose, Plan, Stylus
from cmm_uq.analysis.parts.result import evaluated
from cmm_uq.analysis.parts.virtual import AtPose, MeasurementConditions
from cmm_uq.base.points import Floats, Machine
from tests.parts_drawn import block, circle, spot

SHARE = 1 / 3
BAR, RING = 400.0, 20.0
U_BAR, U_RING, U_CAL = 0.3e-3, 0.2e-3, 0.5e-3
CYCLES, TWICE, ORIENTATIONS, REPEATS = 10, 2, 4, 5
TRAVEL = np.array([[0.0, 900.0], [0.0, 900.0], [-900.0, 0.0]])
X, Y, Z = np.eye(3)
TURNED = {
    "about all axes": [np.column_stack(axes) for axes in ((X, Y, Z), (Y, -X, Z), (Z, Y, -X), (-X, -Y, Z))],
    "about the vertical": [np.column_stack(axes) for axes in ((X, Y, Z), (Y, -X, Z), (-X, -Y, Z), (-Y, X, Z))],
}
TIP = Stylus("stylus", np.array([0.0, 0, -80.0]), 4.0, u_diameter_um=1.0)


def machine() -> MachineState:
    """All common errors, with draws whose standard deviation is a third of what physics allows, about nothing."""
    every = tuple(one.effect for one in unmodelled_errors((), {})
                  if not one.effect.shape and not set(one.effect.columns) & {"time_s", "speed_mm_s"})  # fmt: skip
    usable = tuple(effect for effect in every if not any(name.startswith("temp_") for name in effect.columns))
    sd = SHARE * np.array([c.prior_sd for effect in usable for c in effect.coefficients])
    drawn = np.random.default_rng(0).standard_normal((20_000, len(sd))) * sd
    return MachineState(
        Machine("m", travel_mm=TRAVEL), usable, np.vstack([drawn, -drawn]), StatedNoise(np.full(3, 1e-3))
    )


class Bench:
    """A plan in several poses on the same machines."""

    def __init__(self, plan: Plan, poses: Sequence[PartPose], state: MachineState) -> None:
        warm = Surroundings(Expansion(11.5e-6, u_temperature_k=0.05))
        self.plan = plan
        self.places = [AtPose(plan, MeasurementConditions(state, tuple(poses), warm), pose) for pose in poses]

    def errors(self, truth: Floats, tips: Floats, random: np.random.Generator, place: int, repeats: int) -> Floats:
        """(machines, repeats, c) errors in one place: machine and tip stay, temperature too, readings do not."""
        at, n = self.places[place], len(truth)
        drawn = at.drawn(random, n * repeats)
        for i, cause in enumerate(at.causes):
            if cause.name == MACHINE:
                drawn[i] = np.repeat(truth, repeats, axis=0)
            elif cause.name == STYLUS:
                drawn[i] = np.repeat(tips, repeats, axis=0)
            elif cause.name == TEMPERATURE:
                drawn[i] = np.repeat(cause.draw(random, n), repeats, axis=0)
        return at.errors(drawn, exact=True).reshape(n, repeats, -1)


def main(machines: int) -> None:
    state, random = machine(), np.random.default_rng(1)
    features, characteristics = block()
    plan = Plan(features, characteristics, (TIP,))
    truth, tips = state.draws[random.permutation(len(state.draws))[:machines]], random.standard_normal((machines, 1))
    values = evaluated(plan, plan.points)
    print(f"{machines} machines; standard deviation of a coverage of 95 %: {100 * np.sqrt(0.0475 / machines):.1f} %")
    for name, turns in TURNED.items():
        _print(
            f"four orientations {name}",
            characteristics,
            *_orientations(plan, values, turns, state, truth, tips, random),
        )
    for name, beside in (("the same place", 0.0), ("250 mm beside", 250.0)):
        found = _calibrated(plan, values, beside, state, truth, tips, random)
        _print(f"calibrated plate, {name}", characteristics, *found)
    at = Bench(plan, [_pose(np.eye(3))], state)
    errors = at.errors(truth, tips, random, 0, 1)[:, 0]
    drawn = at.places[0].errors(at.places[0].drawn(random, 20_000))
    low, high = np.quantile(drawn, [0.025, 0.975], axis=0)
    _print(
        "virtual measurements", characteristics, (low <= errors) & (errors <= high), np.tile(drawn.std(axis=0), (2, 1))
    )


def _pose(turn: Floats, beside: float = 0.0) -> PartPose:
    middle = np.array([100.0, 50.0, 0.0])
    return PartPose(turn, np.array([400.0 + beside, 450.0, -450.0]) - turn @ middle)


def _orientations(plan: Plan, values: Floats, turns: Sequence[Floats], state: MachineState, truth: Floats, tips: Floats,
                  random: np.random.Generator) -> tuple[Floats, Floats]:  # fmt: skip
    """(machines, c) whether the value is within U of the truth, and u."""
    poses = [_pose(turn) for turn in turns]
    bar = Plan((spot("a", [-100.0, 50, 0], X), spot("b", [BAR - 100, 50, 0], X)),
               (PartCharacteristic("bar", "distance", ("a", "b")),), (TIP,))  # fmt: skip
    ring = Plan(
        (circle("ring", [100.0, 50, 0], RING / 2, 24),), (PartCharacteristic("ring", "size", ("ring",)),), (TIP,)
    )
    of = np.repeat(np.arange(ORIENTATIONS), REPEATS)

    def read(one: Plan) -> Floats:
        bench = Bench(one, poses, state)
        parts = [bench.errors(truth, tips, random, place, REPEATS) for place in range(ORIENTATIONS)]
        return np.concatenate(parts, axis=1)

    part, bars, rings = read(plan), read(bar)[:, :, 0], read(ring)[:, :, 0]
    slopes = sensitivities(plan)
    held, u = np.zeros((2, len(truth), len(values)))
    for m in range(len(truth)):
        off = random.standard_normal(2) * [U_BAR, U_RING]
        standards = CalibratedStandards(
            CalibratedStandard(BAR, U_BAR, BAR + off[0] + bars[m], of),
            {"stylus": CalibratedStandard(RING, U_RING, RING + off[1] + rings[m], of, inner=True)},
        )
        for i, one in enumerate(plan.characteristics):
            slope = Slopes(float(slopes.scale[i]), {"stylus": float(slopes.tips["stylus"][i])})
            found = by_orientations(one.name, values[i] + part[m, :, i], of, slope, standards)
            held[m, i] = abs(found.value - values[i]) <= found.U
            u[m, i] = found.u
    return held, u


def _calibrated(plan: Plan, values: Floats, beside: float, state: MachineState, truth: Floats, tips: Floats,
                random: np.random.Generator) -> tuple[Floats, Floats]:  # fmt: skip
    bench = Bench(plan, [_pose(np.eye(3)), _pose(np.eye(3), beside)], state)
    repeats = np.concatenate([bench.errors(truth, tips, random, 0, TWICE) for _ in range(CYCLES)], axis=1)
    own = bench.errors(truth, tips, random, 1, 1)[:, 0]
    cycle = np.repeat(np.arange(CYCLES), TWICE)
    held, u = np.zeros((2, len(truth), len(values)))
    for m in range(len(truth)):
        for i, one in enumerate(plan.characteristics):
            u_cal = U_CAL if one.what != "angle" else U_CAL / 100
            known = CalibratedCharacteristic(
                values[i] + u_cal * random.standard_normal(), u_cal, angle=one.what == "angle"
            )
            found = by_calibrated_part(
                one.name, values[i] + repeats[m, :, i], cycle, known, measured=values[i] + own[m, i]
            )
            held[m, i] = abs(found.value - values[i]) <= found.U
            u[m, i] = found.u
    return held, u


def _print(title: str, characteristics: Sequence[PartCharacteristic], held: Floats, u: Floats) -> None:
    print(f"\n{title}\n{'characteristic':14s}   holds   median u")
    for i, one in enumerate(characteristics):
        unit, name = (1e3, "µm") if one.what != "angle" else (1e6, "µrad")
        print(
            f"{one.name:14s} {100 * float(np.mean(held[:, i])):5.1f} % {unit * float(np.median(u[:, i])):9.2f} {name}"
        )


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 400)
