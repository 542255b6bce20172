"""Machines with rotary axes, corrected by what a calibration found: held-out set-ups before and after, against u.

    python -m benchmarks.compensation.rotary_axes COUNT [FIRST]

Tables of machines that are products of rotation matrices are calibrated with two spheres or three, at eight positions over two
turns (ISO 10360-3) or at sixteen over one, there and back. Four other spheres at forty other angles are then corrected.
"""

from __future__ import annotations

import sys
import tempfile
from functools import partial
from pathlib import Path

import numpy as np

from benchmarks.artefacts.rotary_table_coverage import ANGLES, NAMED, SENSES, SIZES, SPHERES, drawn, recorded
from cmm_uq.analysis.machine.rotary_correction import errors_given
from cmm_uq.app.commands.reading import read_job
from cmm_uq.artefacts import artefact_of, kind_of
from cmm_uq.machine.model import RecordingModel
from cmm_uq.machine.physics.catalogue import effects
from cmm_uq.machine.physics.map_interpolation import of_distances
from cmm_uq.maths.inference.posterior import Doubt

OUT = np.linspace(0, 360, 17)
ONE_TURN = np.concatenate([OUT, OUT[-2::-1]]), np.repeat([0.0, 1.0, -1.0], [1, 16, 16])
THREE = np.vstack([SPHERES, [-40.0, 170.0, 120.0]])
DESIGNS = {
    "two spheres, two turns of eight": (SPHERES, (ANGLES, SENSES)),
    "three spheres, two turns of eight": (THREE, (ANGLES, SENSES)),
    "three spheres, one turn of sixteen": (THREE, ONE_TURN),
}


def one(seed: int, design: str) -> list[float]:
    """Mean squares, µm², before, after and of u; shares within U of coordinates and of distances."""
    random = np.random.default_rng([3, seed])
    machine = drawn(random, list(SIZES))
    with tempfile.TemporaryDirectory() as folder:
        job = read_job(recorded(machine, NAMED, random, Path(folder) / "calibration", *DESIGNS[design]))
        places = random.uniform(-200, 200, (4, 3)) + np.array([0, 0, 150])
        turns = random.uniform(0, 720, 40), random.choice([-1.0, 1.0], 40)
        other = read_job(recorded(machine, NAMED, random, Path(folder) / "other", places, turns, 0.0)).points
    model = RecordingModel(artefact_of(job.facts.artefact, job.points), effects(NAMED))
    observe = partial(kind_of(job).observing("reported"), job.facts.artefact, where="recording")
    errors, _, _ = errors_given(model, Doubt(()), observe, seed)
    true = np.tile(places, (40, 1))
    before, u = other.xyz - true, errors.standard_uncertainty(other)
    after = before + errors.errors(other)
    first, second = random.choice(len(true), (2, 400))
    apart = np.linalg.norm(true[second] - true[first], axis=1) > 1
    pairs = first[apart], second[apart]
    corrected = true + after
    of = of_distances(errors.root(other), np.zeros((len(true), 3, 3)), corrected, pairs)
    found, right = (np.linalg.norm(xyz[pairs[1]] - xyz[pairs[0]], axis=1) for xyz in (corrected, true))
    squares = [1e6 * float(np.mean(each**2)) for each in (before, after, u)]
    return [*squares, float(np.mean(np.abs(after) < 2 * u)), float(np.mean(np.abs(found - right) < 2 * of))]


if __name__ == "__main__":
    many, *rest = map(int, sys.argv[1:])
    for which in DESIGNS:
        first_seed = rest[0] if rest else 0
        each = np.array([one(seed, which) for seed in range(first_seed, first_seed + many)])
        rms, held = np.sqrt(each[:, :3].mean(axis=0)), 100 * each[:, 3:].mean(axis=0)
        se = 100 * each[:, 3:].std(axis=0, ddof=1) / np.sqrt(len(each))
        print(f"{which}: {rms[0]:.2f} µm rms, corrected {rms[1]:.3f}, u {rms[2]:.3f}", end="; ")
        print(
            f"in U {held[0]:.1f} ± {se[0]:.1f} % of coordinates, {held[1]:.1f} ± {se[1]:.1f} % of distances", flush=True
        )
