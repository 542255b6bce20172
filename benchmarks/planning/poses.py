"""Planned poses of robots: expected uncertainties against recordings of the plan, and the best poses against even ones.

Run:  python -m benchmarks.planning.poses ROBOTS RECORDINGS

Each robot has rows and travels of its own, a table before it, a floor and a tracker. Of its plan recordings are drawn by
equations that share no code with the package (``benchmarks/artefacts/arm_coverage.py``), errors of a tenth of what is possible
put in, and the named model is fitted. Printed are the standard deviation of estimates about the truth over the expected u, the
root mean square error at further poses over its u, and u of the best poses over u of even ones.
"""

from __future__ import annotations

import sys
from dataclasses import replace
from typing import cast

import numpy as np

from benchmarks.artefacts.arm_coverage import NAMED, OF_ROW, POSSIBLE, SECOND, Floats, place
from cmm_uq.analysis.planning.set_up import join
from cmm_uq.app.commands.planning import MeasurementPlan, Outlook, make_plan
from cmm_uq.app.commands.reading import job_of
from cmm_uq.artefacts.kinds import PlateFacts
from cmm_uq.artefacts.optical.poses import HELD_OUT
from cmm_uq.artefacts.optical.tracked import TrackedPoints
from cmm_uq.artefacts.plate import REFERENCES
from cmm_uq.base.arm import Arm
from cmm_uq.machine.model import RecordingModel
from cmm_uq.machine.physics.catalogue import effects
from cmm_uq.machine.physics.stated import physics_of

NOISE_MM = 0.04
TRAVEL = ((-120, 120), (-50, 60), (-60, 50), (-150, 150), (-100, 100), (-170, 170))


def job_text(seed: int, number: int) -> str:
    random = np.random.default_rng([20261130, seed])
    size = random.uniform(0.5, 1.8)
    rows = np.round([
        [size * random.uniform(0, 200), -90, size * 400, 0], [size * 560, 0, 0, -90],
        [size * random.uniform(20, 150), -90, 0, 0], [0, 90, size * 620, 0], [0, -90, 0, 0], [0, 0, size * 80, 180],
    ], 1)  # fmt: skip
    names = ("a_mm", "alpha_deg", "d_mm", "theta_deg")
    joints = "\n".join(
        "[[machine.joint]]\n" + "".join(f"{name} = {value}\n" for name, value in zip(names, row, strict=True))
        + f"travel = {list(travel)}\n" for row, travel in zip(rows.tolist(), TRAVEL, strict=True)
    )  # fmt: skip
    tool = np.round(random.uniform([20, -60, 60], [120, 60, 250]), 1).tolist()
    low, high = (np.round(size * np.array(corner)).tolist() for corner in ((500, -300, 0), (1000, 300, 300)))
    return f"""[job]
id = "robot-{seed}"
date = 2026-11-30
[machine]
name = "Robot {seed}"
arm = {{ tool_mm = {tool} }}
{joints}
[artefact]
kind = "tracked_points"
u_um = 0.001
[recording]
file = "recording.csv"
u_coordinate_um = {1000 * NOISE_MM}
[model]
effects = {list(NAMED)}
[plan]
criterion = "D"
number = {number}
repeats = 1
placing_um = 0
[plan.poses]
floor_mm = 0
station_mm = {np.round(size * np.array([2500, -1500, 800])).tolist()}
[[plan.poses.obstacle]]
name = "table"
low_mm = {low}
high_mm = {high}
""".replace("'", '"')


def drawn(plan: MeasurementPlan, outlook: Outlook, count: int, seed: int) -> tuple[Floats, float]:
    """Standard deviations (k,) of estimates about the truth, and the root mean square error of places at further poses, mm."""
    further = plan.setting.planning.held_out
    assert further is not None
    poses, n = [*outlook.placings, *further(plan.setting)], len(outlook.placings)
    points = join(poses)
    points = replace(points, measurement=np.ones_like(points.measurement), point=np.arange(1, len(points) + 1))
    arm = points.machine
    assert isinstance(arm, Arm)
    q = np.radians(np.column_stack([points.columns[name] for name in arm.columns_of_joints]))
    artefact = cast("PlateFacts", plan.job.facts.artefact)
    random, named = np.random.default_rng([seed, 1]), effects(NAMED, where="")
    off, missed = [], []
    for _ in range(count):
        rows, truth = arm.rows[:, [0, 1, 2, 3, 4]].copy(), list[float]()
        for name in NAMED[:-1]:
            kind, joint = name.split("_q")
            amount = 0.1 * POSSIBLE[kind] * random.standard_normal()
            rows[int(joint) - 1, OF_ROW[kind]] += amount
            truth.append(amount * 1000 if kind in ("length", "offset") else amount / SECOND)
        by = random.normal(0, 0.5, 3)
        exact = np.array([place(rows, one, arm.tool_mm + by) for one in q])
        turn, _ = np.linalg.qr(random.standard_normal((3, 3)))
        turn *= np.sign(np.linalg.det(turn))
        seen = exact @ turn.T + random.uniform(-3000, 3000, 3)
        noisy = seen + random.normal(0, NOISE_MM, seen.shape)
        whole = replace(points, columns={**points.columns, **dict(zip(REFERENCES, noisy.T, strict=True))})
        model = RecordingModel(TrackedPoints(artefact, whole.select(np.arange(n))), named, NOISE_MM)
        found = model.estimate().least_squares
        off.append(found.value[: len(truth) + 3] - [*truth, *(1000 * by)])
        # where the fitted arm is, carried into the tracker's frame by the poses of the plan, against where it truly is
        change = np.zeros(5 * len(rows) + 3)
        for name, value in zip(NAMED[:-1], found.value.tolist(), strict=False):
            kind, joint = name.split("_q")
            scale = 1e-3 if kind in ("length", "offset") else SECOND
            change[5 * (int(joint) - 1) + OF_ROW[kind]] = value * scale
        change[-3:] = found.value[len(truth) : len(truth) + 3] * 1e-3
        at = np.array([place(arm.rows + change[:-3].reshape(-1, 5), one, arm.tool_mm + change[-3:]) for one in q])
        about, target = at[:n] - at[:n].mean(axis=0), noisy[:n] - noisy[:n].mean(axis=0)
        u, _, vt = np.linalg.svd(target.T @ about)
        rotation = u @ np.diag([1, 1, np.linalg.det(u @ vt)]) @ vt
        carried = (at - at[:n].mean(axis=0)) @ rotation.T + noisy[:n].mean(axis=0)
        missed.append(np.mean((carried[n:] - seen[n:]) ** 2))
    return np.sqrt(np.mean(np.square(off), axis=0)), float(np.sqrt(np.mean(missed)))


def expected(outlook: Outlook) -> Floats:
    assert outlook.identifiability is not None
    return np.array([np.nan if p.u is None else p.u for p in outlook.identifiability.parameters])


def at_further(outlook: Outlook) -> float:
    assert outlook.predicted is not None
    return float(np.sqrt(np.mean(np.square(outlook.predicted))))


def main(robots: int, recordings: int) -> None:
    ratios, places, gains, better = list[float](), list[float](), list[float](), list[float]()
    for seed in range(robots):
        for number in (20, 40, 80):
            job = job_of({"job.toml": job_text(seed, number).encode()}, recorded=False)
            with physics_of(job):
                plan = make_plan(job, power=False)
                even, best = plan.start, plan.better
                assert best is not None
                u, v = expected(best), expected(even)
                gains.append(float(np.exp(np.nanmean(np.log(u / v)))))
                at, beside = at_further(best), at_further(even)
                better.append(at / beside)
                line = f"robot {seed}, {number} poses: u over that of even poses {gains[-1]:.2f}, of places {better[-1]:.2f}"
                if number == 40 and recordings:
                    spread, missed = drawn(plan, best, recordings, seed)
                    ratios += (spread / u).tolist()
                    places.append(missed / at)
                    line += f"; drawn over expected: {np.round(spread / u, 2).tolist()}, places {places[-1]:.3f}"
                print(line, flush=True)
    print(f"best over even, geometric mean of u: {np.exp(np.mean(np.log(gains))):.3f} ({min(gains):.2f} to {max(gains):.2f}), "
          f"of places at {HELD_OUT} further poses {np.mean(better):.3f}")  # fmt: skip
    if ratios:
        print(f"drawn over expected: mean {np.mean(ratios):.3f}, {min(ratios):.3f} to {max(ratios):.3f} of {len(ratios)}, "
              f"chance ±{1 / np.sqrt(2 * recordings):.3f} each; places {np.mean(places):.3f}")  # fmt: skip


if __name__ == "__main__":
    main(int(sys.argv[1]), int(sys.argv[2]))
