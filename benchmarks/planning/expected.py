"""Expected against found uncertainties: ``python benchmarks/planning/expected.py [--recordings 1000]``.

For the ready plan of each artefact recordings are simulated point by point, the artefact's size drawn anew from its
certificate, and estimated by least squares. The standard deviation of the estimates stands over the uncertainty that was
expected before any was drawn; of a thousand it is itself uncertain by 2.2 %.
"""

from __future__ import annotations

import argparse

import numpy as np
from settings import SETTINGS

from cmm_uq.analysis.planning.candidates import ready_plan
from cmm_uq.analysis.planning.identifiability import identifiability
from cmm_uq.analysis.planning.set_up import join
from cmm_uq.artefacts import artefact_of
from cmm_uq.machine.model import Noise, RecordingModel
from cmm_uq.machine.model.measurement import ARTEFACT


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--recordings", type=int, default=1000)
    chosen = parser.parse_args()
    every = []
    for name, make in SETTINGS.items():
        setting = make()
        points = join(ready_plan(setting)[1])
        found = identifiability(setting.model(points)).parameters
        expected = np.array([p.u for p in found if p.unknown.key[0] != ARTEFACT])
        acting = RecordingModel(artefact_of(setting.artefact, points), setting.named)
        random = np.random.default_rng(20260105)
        k = len(expected)
        estimates = np.empty((chosen.recordings, k))
        for i in range(chosen.recordings):
            sizes = np.array([s.nominal + s.sd * random.standard_normal() for s in acting.artefact.sizes])
            xyz = acting.simulate(np.zeros(k), sizes, Noise(setting.sigma), random)
            estimates[i] = setting.model(points.at(xyz)).estimate().least_squares.value[:k]
        ratio = estimates.std(axis=0) / expected
        every += ratio.tolist()
        said = ", ".join(f"{e.name} {r:.3f}" for e, r in zip(setting.named, ratio, strict=True))
        print(f"{name}: {said}", flush=True)
    print(f"all {len(every)}: {min(every):.3f} to {max(every):.3f}, mean {np.mean(every):.3f}")


if __name__ == "__main__":
    main()
