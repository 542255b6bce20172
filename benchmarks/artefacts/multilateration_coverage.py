"""How often intervals hold of multilateration: the machine's errors, where stations stand, and targets by distances alone.

    python -m benchmarks.artefacts.multilateration_coverage white|drift|slow|tails COUNT

The machine is simulated by its kinematics written out for the chain XYZ, and shares no code with the package.
"""

from __future__ import annotations

import sys
from collections import defaultdict

import numpy as np
from scipy import stats

from benchmarks.artefacts.axis_runs_coverage import SECOND, TRAVEL, Machine as Curves
from benchmarks.artefacts.digitizer_coverage import posterior
from cmm_uq.artefacts import artefact_facts
from cmm_uq.artefacts.multilateration.artefact import Multilateration
from cmm_uq.artefacts.multilateration.page import FreePoints, free_points, standpoints
from cmm_uq.base.points import Machine, Points
from cmm_uq.machine.model import RecordingModel
from cmm_uq.machine.physics.catalogue import effects

LOW, BESIDE, BEHIND, RAISED = ((-150, -150, -700), (1050, -150, -700), (-150, 1350, -700), (1050, 1350, -250))
ARMS = ((0, 0, -120), (150, 0, -300), (0, 150, -300))
SET_UPS = ((LOW, ARMS[0]), (BESIDE, ARMS[0]), (BEHIND, ARMS[0]), (RAISED, ARMS[0]), (LOW, ARMS[1]), (RAISED, ARMS[2]))
NAMES = [
    *(f"scale_{a}" for a in "xyz"), *(f"squareness_{p}" for p in ("xy", "yz", "zx")),
    *(f"straightness_{a}_{b}" for a in "xyz" for b in "xyz" if a != b), *(f"rotation_{a}_{b}" for a in "xyz" for b in "xyz"),
]  # fmt: skip
U_SCALE, SIGMA = 0.2, 0.3  # µm/m of the interferometer, and µm of a reading
SECONDS, FORGETS, SLOW, DRIFT = 8.0, 900.0, 0.4, 3.0  # s between readings; s and µm of a dead path's slow noise; µm/h
MACHINE = Machine("of this study", "XYZ", TRAVEL)


class Square(Curves):
    """With axes that lean, ″: Y by XY and Z by ZX towards −X, Z by YZ towards −Y."""

    def __init__(self, random: np.random.Generator, *, size: float = 1.0) -> None:
        super().__init__(random, smooth=False)
        self.angles = random.normal(0, 8, 3)
        for each in (self.scale, self.bow, self.turn, self.angles):
            each *= size

    @property
    def true(self) -> np.ndarray:
        bows = [self.bow[i, j] for i in range(3) for j in range(3) if i != j]
        return np.array([*self.scale, *self.angles, *bows, *self.turn.ravel()])

    def off(self, xyz: np.ndarray, tip: np.ndarray) -> np.ndarray:
        """True less indicated (n, 3), mm."""
        xy, yz, zx = 1000 * SECOND * self.angles
        _, y, z = xyz.T
        return (self.error(xyz, tip)[0] + np.column_stack([-xy * y - zx * z, -yz * z, 0 * z])) / 1000


def targets(count: tuple[int, int, int] = (4, 4, 3)) -> np.ndarray:
    steps = [np.linspace(low + 45, high - 45, n) for (low, high), n in zip(TRAVEL, count, strict=True)]
    return np.stack(np.meshgrid(*steps, indexing="ij"), axis=-1).reshape(-1, 3)


def read(machine: Square, place: np.ndarray, tip: np.ndarray, xyz: np.ndarray) -> np.ndarray:
    """Distances (n,) from a station to the reflector, mm."""
    return np.linalg.norm(xyz + tip + machine.off(xyz, tip) - place, axis=1)


def recorded(machine: Square, dead: np.ndarray, off: np.ndarray) -> Points:
    """Readings of every set-up at every target: true distances less dead paths (s,), with errors (s·t,), mm."""
    xyz, count = targets(), len(targets())
    true = np.concatenate([read(machine, np.array(place), np.array(tip), xyz) for place, tip in SET_UPS])
    tips = np.repeat(np.array([tip for _, tip in SET_UPS], dtype=float), count, axis=0)
    columns = {f"tip_{a}_mm": tips[:, i] for i, a in enumerate("xyz")} | {"time_s": SECONDS * np.arange(len(true))}
    columns["reading_mm"] = true - np.repeat(dead, count) + off
    each = np.tile(np.arange(1, count + 1), len(SET_UPS))
    station = np.repeat(np.arange(1, len(SET_UPS) + 1), count)
    return Points(np.tile(xyz, (len(SET_UPS), 1)), station, each, np.ones_like(each), MACHINE, columns)


def drawn(kind: str, seed: int) -> tuple[Square, np.ndarray, Points]:
    """A machine, its dead paths and a recording; the interferometer's scale is wrong too."""
    random = np.random.default_rng([["white", "drift", "slow", "tails"].index(kind), seed])
    machine, dead, q, t = Square(random), random.uniform(-300, 300, len(SET_UPS)), len(SET_UPS), len(targets())
    off = SIGMA * (random.standard_t(4, (q, t)) / np.sqrt(2) if kind == "tails" else random.normal(size=(q, t)))
    if kind == "drift":
        off += random.normal(0, DRIFT, (q, 1)) * SECONDS / 3600 * (np.arange(t) - (t - 1) / 2)
    if kind == "slow":
        kept, slow = np.exp(-SECONDS / FORGETS), random.normal(size=q * t)
        for i in range(1, q * t):
            slow[i] = kept * slow[i - 1] + np.sqrt(1 - kept**2) * slow[i]
        off += SLOW * slow.reshape(q, t)
    exact = recorded(machine, dead, np.zeros(q * t))
    wrong = random.normal(0, U_SCALE) / 1e6 * exact.columns["reading_mm"]
    return machine, dead, recorded(machine, dead, off.ravel() / 1000 - wrong)


def study(kind: str, count: int) -> None:
    """95 % intervals: errors and stations by least squares, errors in slow noise by posterior; targets by distances."""
    held: dict[str, list[float]] = defaultdict(list)
    facts = artefact_facts(kind="multilateration", u_scale_um_per_m=U_SCALE, dead_path_drifts=kind == "drift")
    for seed in range(count):
        machine, dead, points = drawn(kind, seed)
        seen = Multilateration(facts, points)
        model = RecordingModel(seen, effects(NAMES))
        if kind == "slow":
            draws = posterior(model, np.random.default_rng(seed), 0.3, len(NAMES))
            low, high = np.quantile(draws, [0.025, 0.975], axis=0)
        else:
            found = model.estimate().least_squares
            factor = float(stats.t.ppf(0.975, found.degrees_of_freedom))
            half = factor * np.sqrt(np.diag(found.covariance))
            low, high = ((found.value + sign * half)[: len(NAMES)] for sign in (-1, 1))
            stations = standpoints(model, found.value, found.covariance, found.sigma)
            for (place, _), path, one in zip(SET_UPS, dead, stations, strict=True):
                held["stations"] += (np.abs(one.position - place) <= factor * one.u[:3]).tolist()
                held["dead paths"].append(abs(one.dead_path - path) <= factor * one.u[3])
        for name, within in zip(NAMES, (low <= machine.true) & (machine.true <= high), strict=True):
            held[name.partition("_")[0]].append(float(within))
        alone = free_points(seen, U_SCALE)
        if isinstance(alone, FreePoints):
            true = alone.without_motion(machine.off(targets(), np.array(ARMS[0], dtype=float)))
            held["targets"] += (np.abs(alone.errors - true) <= alone.expanded).mean(axis=1).tolist()
    for what, each in held.items():
        print(f"| {kind} | {what} | {100 * np.mean(each):.1f} % of {len(each)} |")


if __name__ == "__main__":
    study(sys.argv[1], int(sys.argv[2]))
