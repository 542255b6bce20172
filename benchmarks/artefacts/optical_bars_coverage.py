"""How often the intervals of an optical ballbar hold the truth: the table in docs/artefacts/optical-ballbar.md.

Run:  PYTHONPATH=. python benchmarks/artefacts/optical_bars_coverage.py [RECORDINGS]

Scans of 20 bars by the simulator of the example, which shares nothing with the package: places, directions, noise of every
reading and shift of every ball are drawn anew, and the true scales, squarenesses and offset too. The sizes of the noise are
weighed by importance, as in digitizer_coverage.py.
"""

from __future__ import annotations

import sys

import numpy as np

from benchmarks.artefacts.digitizer_coverage import posterior
from benchmarks.examples.optical_ballbar_job import LENGTH, OFFSET, Floats, scanned_bars, true_over_read
from cmm_uq.artefacts import artefact_facts
from cmm_uq.artefacts.optical.ballbar import ScannedBallbar
from cmm_uq.base.points import Machine, Points
from cmm_uq.machine.model import RecordingModel
from cmm_uq.machine.physics.catalogue import effects

SIX = ("scale_x", "scale_y", "scale_z", "squareness_xy", "squareness_yz", "squareness_zx")
NAMES = (*SIX, "length_mm", "U1_mm", "V1_mm", "W1_mm")
DRAWN = [*[50.0] * 3, *[100.0] * 3, 0.5e-3, *[0.02] * 3]  # standard deviations of the truths, in the unit of each
COLUMNS = ("ball", "alpha_deg", "beta_deg", "gamma_deg", "u_mm", "v_mm")


def recorded(random: np.random.Generator, bars: int) -> tuple[Points, Floats]:
    """A recording, and the true values of what it shows."""
    true = np.array([*[0.0] * 6, LENGTH, *OFFSET]) + DRAWN * random.standard_normal(len(DRAWN))
    machine = true_over_read(true[:3].tolist(), true[3:6].tolist())
    rows = scanned_bars(random, machine, bars=bars, offset=true[7:], length=float(true[6]))
    number = rows[:, 0].astype(np.int64)
    columns = dict(zip(COLUMNS, rows[:, [2, *range(6, 11)]].T, strict=True))
    return Points(rows[:, 3:6], number, rows[:, 1].astype(np.int64), np.ones_like(number), Machine(), columns), true


def held(seed: int, bars: int, part: float = 0.25) -> tuple[Floats, Floats]:
    """(11,) whether the 95 % interval of each and the ellipsoid of all hold the truth; (10,) standard uncertainties."""
    random = np.random.default_rng(seed)
    points, true = recorded(random, bars)
    facts = artefact_facts(kind="ballbar", length_mm=LENGTH, u_um=0.5, offset_mm=OFFSET.tolist())
    draws = posterior(RecordingModel(ScannedBallbar(facts, points), effects(SIX)), random, part, len(NAMES))
    low, high = np.quantile(draws, [0.025, 0.975], axis=0)
    about, off = draws - draws.mean(axis=0), true - draws.mean(axis=0)
    weights = np.linalg.inv(np.cov(draws.T))
    inside = off @ weights @ off <= np.quantile(np.einsum("ni,ij,nj->n", about, weights, about), 0.95)
    return np.array([*((low <= true) & (true <= high)), inside], dtype=np.float64), draws.std(axis=0)


def main(recordings: int, bars: int = 20) -> None:
    found = [held(seed, bars) for seed in range(recordings)]
    hits, u = (np.mean([one[i] for one in found], axis=0) for i in (0, 1))
    units = 3 * ("ppm",) + 3 * ("″",) + 4 * ("µm",)
    print(f"{recordings} recordings of {bars} bars")
    for name, rate, size, unit in zip(NAMES, hits, u, units, strict=False):
        print(f"| {name} | {size * (1e3 if unit == 'µm' else 1):.3g} {unit} | {100 * rate:.1f} % |")
    print(f"| all together | | {100 * hits[-1]:.1f} % |")


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 1000)
