"""Do 95 % intervals of parts hold? Virtual machines with a hidden truth, calibrated by a ballbar, then measuring parts.

Every machine has all common errors, as large as physics allows (each prior's standard deviation). A calibration of twenty bars
models six of them; the machine corrects its estimates. Errors of a plate's characteristics on the truth, readings' noise
included, are compared with intervals from (a) what the calibration modelled alone, (b) that and what it did not model, each on
its own, (c) everything together given the calibration's recording.

With ``free`` the bar is not certified, so that one scale common to all axes is left free.

Run: ``python -m benchmarks.parts.coverage [MACHINES] [free]``
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

import cmm_uq
from benchmarks.parts.known_noise import joint_posterior
from cmm_uq.analysis.machine.conditional import given_recording
from cmm_uq.analysis.machine.state import MachineState, StatedNoise, unmodelled_errors
from cmm_uq.analysis.parts.plan import PartPose, Plan, Stylus
from cmm_uq.analysis.parts.virtual import AtPose, MeasurementConditions
from cmm_uq.artefacts.ballbar import Ballbar
from cmm_uq.machine.model import RecordingModel
from cmm_uq.machine.model.recorded import Noise
from cmm_uq.machine.physics.catalogue import effects
from tests.conftest import ROOT
from tests.parts_drawn import block

MODELLED = ["scale_x", "scale_y", "scale_z", "squareness_xy", "squareness_yz", "squareness_zx"]
SIGMA, DRAWS = 2e-3, 1000
PLACES = np.array([[150.0, 100, -400], [400, 300, -200], [650, 150, -300]])


@dataclass(frozen=True, eq=False)
class Calibrated:
    """A virtual machine with a hidden truth, and what its calibration says of it where a part is measured."""

    plan: Plan
    pose: PartPose
    real: MachineState  # with its true errors
    states: dict[str, MachineState]  # as (a), (b), (c) state it


def calibrated(
    machines: int, random: np.random.Generator, *, free: bool = False, ways: str = "abc"
) -> Iterator[Calibrated]:
    job = cmm_uq.read(ROOT / "examples" / "iota-1102-20C")
    bars = job.points.select(job.points.measurement != 18)
    named = effects(MODELLED)
    unmodelled = tuple(
        u for u in unmodelled_errors(MODELLED, {}) if not u.effect.shape and "time_s" not in u.effect.columns
    )
    every = (*named, *(u.effect for u in unmodelled))
    sd = np.array([c.prior_sd for effect in every for c in effect.coefficients])
    facts = job.facts.artefact
    if free:
        facts = facts.model_copy(update={"length_mm": None, "u_um": None})
    designed = RecordingModel(Ballbar(facts, bars), tuple(e for e in every if not e.columns))
    used = np.array([not effect.columns for effect in every for _ in effect.coefficients])
    features, characteristics = block()
    tip = Stylus("stylus", np.array([0.0, 0, -80.0]), 4.0, qualified_at_mm=np.array([100.0, 100, -400]))
    plan = Plan(features, characteristics, (tip,))
    for _ in range(machines):
        truth = sd * random.standard_normal(len(sd))
        length = designed.artefact.sizes[0]
        size = length.nominal + (0.0 if free else length.sd * random.standard_normal())
        xyz = designed.simulate(truth[used], np.array([size]), Noise(coordinate=SIGMA), random)
        model = RecordingModel(Ballbar(facts, bars.at(xyz)), named)
        _, mean, covariance = joint_posterior(model, (), SIGMA)
        noise = StatedNoise(np.full(3, SIGMA))
        stated = MachineState(
            bars.machine, named, random.multivariate_normal(mean, covariance, 4000), noise, corrections=mean
        )
        pose = PartPose(np.eye(3), PLACES[random.integers(len(PLACES))] - bars.machine.origin_mm)
        real = MachineState(bars.machine, every, truth[None], noise, corrections=np.append(mean, np.zeros(len(sd) - 6)))
        apart = replace(stated, unmodelled=unmodelled)
        states = {"a": stated, "b": apart, "c": given_recording(apart, model, SIGMA, 4000)}
        yield Calibrated(plan, pose, real, states)


def main(machines: int, *, free: bool = False) -> None:
    random, inside, u = np.random.default_rng(0), {name: [] for name in "abc"}, {name: [] for name in "abc"}
    for one in calibrated(machines, random, free=free):
        characteristics = one.plan.characteristics
        seen = AtPose(one.plan, MeasurementConditions(one.real), one.pose)
        error = seen.errors(seen.drawn(random, 1), exact=True)[0]
        for name, state in one.states.items():
            at = AtPose(one.plan, MeasurementConditions(state), one.pose)
            drawn = at.errors(at.drawn(random, DRAWS))
            low, high = np.quantile(drawn, [0.025, 0.975], axis=0)
            inside[name].append((low <= error) & (error <= high))
            u[name].append(drawn.std(axis=0))
    print(
        f"{machines} machines; standard deviation of a coverage of 95 %: {np.sqrt(0.95 * 0.05 / machines) * 100:.1f} %"
    )
    print("characteristic       " + "   ".join(f"({name}) holds, median u" for name in "abc"))
    for i, one in enumerate(characteristics):
        unit = 1e3 if one.what != "angle" else 1e6
        holds = [100 * float(np.mean([row[i] for row in inside[name]])) for name in "abc"]
        usual = [unit * float(np.median([row[i] for row in u[name]])) for name in "abc"]
        cells = [f"{a:6.1f} % {b:9.2f}" for a, b in zip(holds, usual, strict=True)]
        print(f"{one.name:14s}", "      ".join(cells), "µm" if one.what != "angle" else "µrad")


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 400, free="free" in sys.argv[2:])
