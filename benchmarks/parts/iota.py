"""A real machine: errors of lengths predicted from the other bars of its calibration, against what was seen there.

Each bar of examples/iota-1102-20C is left out in turn. The machine's errors follow from the others; the error of the length
that was left out is predicted at the places where examples/iota-1102-20C-compensated says its balls were (compensated by a map
of the same machine from a laser interferometer), and compared with the length recorded less the compensated one.

Run: ``python -m benchmarks.parts.iota``
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

import cmm_uq
from cmm_uq.kinds.ballbar.observe import Ballbar
from cmm_uq.model import MeasurementModel
from cmm_uq.parts.conditional import given_recording, joint_posterior
from cmm_uq.parts.machine import MachineState, StatedNoise, unmodelled_errors
from cmm_uq.parts.plan import Characteristic, Plan
from cmm_uq.parts.virtual import Circumstances, Virtual
from cmm_uq.physics.catalogue import effects
from tests.conftest import ROOT
from tests.parts_drawn import spot

SIGMA = 10.3e-3
"""mm, noise of one coordinate as the certificate of all bars finds it."""

COPY = 18
"""Of measurement 14 to the last digit."""


def main() -> None:
    job, compensated = (cmm_uq.read(ROOT / "examples" / f"iota-1102-20C{end}") for end in ("", "-compensated"))
    points, named = job.points, effects(job.facts.model.effects)
    names, random = [effect.name for effect in named], np.random.default_rng(0)
    found: dict[str, list[tuple[float, float]]] = {"modelled": [], "on their own": [], "given the recording": []}
    for left in sorted(set(points.measurement.tolist()) - {COPY}):
        kept = points.select((points.measurement != left) & (points.measurement != COPY))
        model = MeasurementModel(Ballbar(job.facts.artefact, kept), named)
        _, mean, covariance = joint_posterior(model, (), SIGMA)
        draws, noise = random.multivariate_normal(mean, covariance, 4000), StatedNoise(np.full(3, SIGMA))
        stated = MachineState(points.machine, named, draws, noise, corrected=False)
        apart = replace(stated, unmodelled=unmodelled_errors(names, {}))
        together = replace(given_recording(apart, model, SIGMA, 4000), unmodelled=())
        rows = np.flatnonzero(points.measurement == left)
        one, other = compensated.points.xyz[rows]
        plan = Plan((spot("one", one), spot("other", other)), (Characteristic("length", "distance", ("one", "other")),))
        seen = float(np.linalg.norm(points.xyz[rows[1]] - points.xyz[rows[0]]) - np.linalg.norm(other - one))
        for name, state in zip(found, (stated, apart, together), strict=True):
            simulated = Virtual(plan, Circumstances(state)).simulated(10_000)
            found[name].append((seen - float(simulated.value[0]), float(simulated.u[0])))
    for name, pairs in found.items():
        off, u = 1e3 * np.array(pairs).T
        apart_rms, ratio, inside = np.sqrt(np.mean(off**2)), np.sqrt(np.mean((off / u) ** 2)), np.abs(off) < 1.96 * u
        print(f"{name:20s} predicted and seen differ by {apart_rms:.1f} µm rms, u {u.min():.0f} to {u.max():.0f} µm, "
              f"{100 * inside.mean():.0f} % within 95 % intervals, rms of difference/u {ratio:.2f}")  # fmt: skip


if __name__ == "__main__":
    main()
