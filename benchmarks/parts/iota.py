"""A real machine: what is stated of distances in its volume, against an error map from a laser interferometer.

*Elsewhere*: examples/part-iota states distances between balls of different bars, given the recording of the twenty bars. The
same centres, compensated by the error map that was measured with a laser interferometer (examples/iota-1102-20C-compensated),
say how long they are.

*Left out*: each bar of the calibration is left out in turn; the error of its length is predicted from the others at the places
where the compensated recording says that its balls were, and compared with the length recorded less the compensated one.

Run: ``python -m benchmarks.parts.iota``
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

import cmm_uq
from benchmarks.examples.part_iota import COPY, FOLDER, MACHINE, ROOT, chosen, ends
from benchmarks.parts.known_noise import joint_posterior
from cmm_uq.analysis.machine.conditional import given_recording
from cmm_uq.analysis.machine.state import MachineState, StatedNoise, unmodelled_errors, with_curves
from cmm_uq.analysis.parts.plan import PartCharacteristic, Plan
from cmm_uq.analysis.parts.virtual import MeasurementConditions, Virtual
from cmm_uq.artefacts.ballbar import Ballbar
from cmm_uq.machine.model import RecordingModel
from cmm_uq.machine.physics.catalogue import effects
from cmm_uq.maths.uncertainty.propagation import simulate
from tests.parts_drawn import spot

COMPENSATED = ROOT / "examples" / "iota-1102-20C-compensated"
SIGMA = 10.3e-3
"""mm, noise of one coordinate as the certificate of all bars finds it; only what is modelled alone is drawn with it."""


@dataclass(frozen=True)
class Distance:
    """One distance, mm.

    Parameters
    ----------
    name : of it.
    indicated, compensated : of the centres as recorded, and as the error map corrects them.
    value, u, low, high : as stated.
    """

    name: str
    indicated: float
    compensated: float
    value: float
    u: float
    low: float
    high: float

    @property
    def holds(self) -> bool:
        """Whether the interval holds the compensated distance."""
        return self.low <= self.compensated <= self.high


def elsewhere(trials: int = 200_000) -> list[Distance]:
    """Distances of examples/part-iota."""
    raw, corrected = (ends(cmm_uq.read(folder).points) for folder in (MACHINE, COMPENSATED))
    pairs, found = chosen(raw), []
    for one in cmm_uq.part(FOLDER, trials=trials).results["characteristics"]:
        a, b = pairs[one["name"]]
        lengths = (float(np.linalg.norm(balls[b] - balls[a])) for balls in (raw, corrected))
        found.append(Distance(one["name"], *lengths, one["value"], one["u"], *one["interval95"]))
    return found


def left_out() -> dict[str, np.ndarray]:
    """Predicted less seen error of each bar's length, and its u, (19, 2) mm, by what is reckoned with."""
    job, compensated = cmm_uq.read(MACHINE), cmm_uq.read(COMPENSATED)
    points, named = job.points, effects(job.facts.model.effects)
    random = np.random.default_rng(0)
    found: dict[str, list[tuple[float, float]]] = {"modelled alone": [], "given the recording": []}
    for left in sorted(set(points.measurement.tolist()) - {COPY}):
        kept = points.select((points.measurement != left) & (points.measurement != COPY))
        model = RecordingModel(Ballbar(job.facts.artefact, kept), named)
        _, mean, covariance = joint_posterior(model, (), SIGMA)
        draws, noise = random.multivariate_normal(mean, covariance, 4000), StatedNoise(np.full(3, SIGMA))
        unmodelled = unmodelled_errors([effect.name for effect in named], {})
        alone = MachineState(points.machine, named, draws, noise, corrected=False)
        certificate = MachineState(points.machine, named, draws, noise, corrected=False, unmodelled=unmodelled)
        rows = np.flatnonzero(points.measurement == left)
        one, other = compensated.points.xyz[rows]
        plan = Plan(
            (spot("one", one), spot("other", other)), (PartCharacteristic("length", "distance", ("one", "other")),)
        )
        seen = float(np.linalg.norm(points.xyz[rows[1]] - points.xyz[rows[0]]) - np.linalg.norm(other - one))
        for name, state in zip(found, (alone, given_recording(with_curves(certificate), model)), strict=True):
            simulated = simulate(Virtual(plan, MeasurementConditions(state)).source, 10_000)
            found[name].append((seen - float(simulated.value[0]), float(simulated.u[0])))
    return {name: np.array(pairs) for name, pairs in found.items()}


def main() -> None:
    """Print both."""
    distances = elsewhere()
    for one in distances:
        print(f"{one.name:28s} indicated {one.indicated:.4f}, stated {one.value:.4f} (u {1e3 * one.u:.0f} µm), compensated "
              f"{one.compensated:.4f} mm: off by {1e3 * (one.value - one.compensated):.0f} µm")  # fmt: skip
    off = 1e3 * np.array([one.value - one.compensated for one in distances])
    before = 1e3 * np.array([one.indicated - one.compensated for one in distances])
    print(f"rms {np.sqrt(np.mean(off**2)):.1f} µm of {np.sqrt(np.mean(before**2)):.0f} µm as indicated; "
          f"{sum(one.holds for one in distances)} of {len(distances)} within their 95 % intervals")  # fmt: skip
    for name, pairs in left_out().items():
        off, u = 1e3 * pairs.T
        apart, ratio, inside = np.sqrt(np.mean(off**2)), np.sqrt(np.mean((off / u) ** 2)), np.abs(off) < 1.96 * u
        print(f"left out, {name}: predicted and seen differ by {apart:.1f} µm rms, u {u.min():.0f} to {u.max():.0f} µm, "
              f"{inside.sum()} of {len(u)} within 95 % intervals, rms of difference/u {ratio:.2f}")  # fmt: skip


if __name__ == "__main__":
    main()
