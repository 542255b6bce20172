"""Robots that a tracker measured, by equations that share no code with the package: do certificates hold what is true?

Run:  python -m benchmarks.artefacts.arm_coverage coverage|tails|diagnosis COUNT [FIRST]

Each robot has rows of its own (industrial, with parallel axes 2 and 3 and a wrist), a tool, a place of the tracker and poses;
errors of its rows are drawn from half of what the package holds for possible, or from a tenth of it. Places are products of
4 × 4 matrices. Counted are true values within 95 % intervals of parameters that are determined, points held out within theirs,
and diagnoses that find something where nothing was left out; *tails* has noise that grows with the distance from the base,
t of four degrees of freedom.
"""

from __future__ import annotations

import sys
import time
from collections import Counter
from collections.abc import Mapping
from functools import partial

import numpy as np
from numpy.typing import NDArray

from cmm_uq.app.commands.diagnose import screened_model
from cmm_uq.app.commands.estimation import parameters, with_noise
from cmm_uq.app.commands.reading import job_of
from cmm_uq.app.commands.report import evaluate_job
from cmm_uq.artefacts.optical.tracked import predicted_poses
from cmm_uq.certificate.result import Result
from cmm_uq.machine.model.noise import noise_of
from cmm_uq.machine.physics.stated import physics_of
from cmm_uq.maths.inference.posterior import sample_with_noise

Floats = NDArray[np.float64]
SECOND = np.pi / 180 / 3600
NAMED = (
    *(f"zero_q{i}" for i in range(2, 6)), *(f"length_q{i}" for i in range(1, 6)), *(f"twist_q{i}" for i in range(1, 6)),
    *(f"offset_q{i}" for i in range(3, 6)), "parallelism_q2", "tool_offset",
)  # fmt: skip
OF_ROW = {"length": 0, "twist": 1, "offset": 2, "zero": 3, "parallelism": 4}
POSSIBLE = {
    "length": 0.5,
    "offset": 0.5,
    "twist": 400 * SECOND,
    "zero": 1000 * SECOND,
    "parallelism": 400 * SECOND,
}  # mm, rad
CROSSING = {"slack_q1": 80.0, "sag_q2": 300.0, "eccentricity_q1": 60.0}  # that may be put in and not named, ″, ″/m


def place(rows: Floats, q: Floats, tool: Floats) -> Floats:
    """Of the tool: standard rows (j, 5) a, α, d, θ, β in mm and rad, readings (j,) rad."""
    frame = np.eye(4)
    for (a, alpha, d, theta, beta), reading in zip(rows, q, strict=True):
        t, frame = theta + reading, frame.copy()
        turn = np.array([[np.cos(t), -np.sin(t), 0, 0], [np.sin(t), np.cos(t), 0, 0], [0, 0, 1, d], [0, 0, 0, 1]])
        twist = np.array([[1, 0, 0, a], [0, np.cos(alpha), -np.sin(alpha), 0], [0, np.sin(alpha), np.cos(alpha), 0],
                          [0, 0, 0, 1]])  # fmt: skip
        lean = np.array([[np.cos(beta), 0, np.sin(beta), 0], [0, 1, 0, 0], [-np.sin(beta), 0, np.cos(beta), 0],
                         [0, 0, 0, 1]])  # fmt: skip
        frame = frame @ turn @ twist @ lean
    return np.asarray((frame @ np.append(tool, 1.0))[:3])


def robot(seed: int, left_out: str, *, tails: bool = False) -> tuple[dict[str, bytes], dict[tuple[str, str], float]]:
    """A job of one robot, the truth by effect and parameter in their units, with what the model leaves out, if anything."""
    random = np.random.default_rng([20261130, seed])
    size = random.uniform(0.5, 1.8)
    nominal = np.array([
        [round(size * random.uniform(0, 200), 1), -90, round(size * 400, 1), 0, 0], [round(size * 560, 1), 0, 0, -90, 0],
        [round(size * random.uniform(20, 150), 1), -90, 0, 0, 0], [0, 90, round(size * 620, 1), 0, 0],
        [0, -90, 0, 0, 0], [0, 0, round(size * 80, 1), 180, 0],
    ])  # fmt: skip
    travel = np.array([[-120, 120], [-50, 60], [-60, 50], [-150, 150], [-100, 100], [-170, 170]])
    tool, count = np.round(random.uniform([20, -60, 60], [120, 60, 250]), 1), int(random.integers(50, 110))
    q = np.round(random.uniform(*travel.T, (count, 6)), 3)
    rows = nominal * [1, np.pi / 180, 1, np.pi / 180, np.pi / 180]
    truth, true_rows, share = dict[tuple[str, str], float](), rows.copy(), 0.5 if seed % 2 else 0.1
    for name in NAMED[:-1]:
        kind, joint = name.split("_q")
        amount = share * POSSIBLE[kind] * random.standard_normal()
        true_rows[int(joint) - 1, OF_ROW[kind]] += amount
        is_length = kind in ("length", "offset")
        truth[name, "um" if is_length else "arcsec"] = amount * 1000 if is_length else amount / SECOND
    true_tool = tool + random.normal(0, 2.0, 3)
    truth |= {("tool_offset", f"{axis}_um"): 1000 * by for axis, by in zip("xyz", true_tool - tool, strict=True)}
    side = random.choice([-1.0, 1.0], count)
    angles, places = np.radians(q), []
    for one, way in zip(angles, side, strict=True):
        moved = one.copy()
        if left_out == "slack_q1":
            moved[0] += 0.5 * CROSSING[left_out] * SECOND * way
        elif left_out == "eccentricity_q1":
            moved[0] += CROSSING[left_out] * SECOND * np.sin(one[0] + 0.5)
        elif left_out == "sag_q2":
            turned = np.array([np.cos(one[0]), np.sin(one[0]), 0.0])
            out = place(rows, one, tool) @ turned - rows[0, 0]
            moved[1] += CROSSING[left_out] * SECOND * out / 1000  # α = −90°: θ₂ grows as the arm goes down
        places.append(place(true_rows, moved, true_tool))
    turn, _ = np.linalg.qr(random.standard_normal((3, 3)))
    turn *= np.sign(np.linalg.det(turn))
    noise = random.uniform(0.01, 0.08)
    scale = np.full((count, 1), noise)
    if tails:
        away = np.sum(np.array(places) ** 2, axis=1, keepdims=True)
        scale = noise * np.sqrt(0.3 + 0.7 * away / away.mean()) * np.sqrt(4 / random.chisquare(4, (count, 1)))
    seen = np.array(places) @ turn.T + random.uniform(-3000, 3000, 3) + scale * random.normal(0, 1, (count, 3))
    places_of = {"": "xyz", "reference_": "xyz"}
    shown_xyz, seen_xyz = ([f"{what}{axis}_mm" for axis in axes] for what, axes in places_of.items())
    head = ",".join(["measurement", "point", *shown_xyz, *(f"q{i}_deg" for i in range(1, 7)), "approach_q1", *seen_xyz])
    lines = [head]
    for i in range(count):
        shown_at = place(rows, angles[i], tool)
        cells = ["1", f"{i + 1}", *(f"{value:.4f}" for value in shown_at), *(f"{value:.3f}" for value in q[i])]
        cells += [f"{side[i]:.0f}", *(f"{value:.4f}" for value in seen[i])]
        lines.append(",".join(cells))
    joints = "\n".join(
        f"[[machine.joint]]\na_mm = {a}\nalpha_deg = {alpha}\nd_mm = {d}\ntheta_deg = {theta}\n"
        for a, alpha, d, theta, _ in nominal.tolist()
    )
    text = f"""[job]
id = "robot-{seed}"
date = 2026-11-30
[machine]
name = "Robot {seed}"
arm = {{ tool_mm = {tool.tolist()} }}
{joints}
[artefact]
kind = "tracked_points"
u_um = 5.0
[recording]
file = "recording.csv"
[model]
effects = {list(NAMED)}
""".replace("'", '"')
    return {"job.toml": text.encode(), "recording.csv": ("\n".join(lines) + "\n").encode()}, truth


def covered(seed: int, *, tails: bool = False) -> Counter[str]:
    """Of the named model alone, as a certificate states it where its diagnosis finds nothing."""
    files, truth = robot(seed, left_out="", tails=tails)
    job, found = job_of(files), Counter[str]()
    with physics_of(job):
        model, estimate, _ = with_noise(screened_model(job)[0])
        posterior = sample_with_noise(estimate.linear, noise_of(model, in_turn=True), estimate.least_squares, 0)
        stated, predicted = parameters(model, posterior.draws), predicted_poses(model)
    found["alone"] += 1
    unknown = {one.key for one, is_ in zip(model.unknowns, estimate.least_squares.determined, strict=True) if not is_}
    for effect, quantities in stated.items():
        family = "tool" if effect == "tool_offset" else effect.split("_q")[0]
        for name, quantity in quantities.items():
            if (effect, name) in unknown:
                found["not determined"] += 1
                continue
            low, high = quantity.interval95
            found[f"{family} stated"] += 1
            found[f"{family} held"] += low <= truth[effect, name] <= high
    if predicted is not None:
        found["coordinates"] += predicted.within.size
        found["coordinates held"] += int(predicted.within.sum())
        found["points"] += len(predicted.inside)
        found["points held"] += int(predicted.inside.sum())
    return found


def diagnosed(seed: int) -> Counter[str]:
    """Whether a whole evaluation finds what was left out, if anything was."""
    left_out = ("", *CROSSING)[seed % 4]
    files, _ = robot(seed, left_out)
    result, found = evaluate_job(job_of(files)), Counter[str]()
    assert isinstance(result, Result)
    names = [one.effect for one in result.diagnosed.diagnosis.effects]
    found[f"{left_out or 'nothing'}: robots"] += 1
    found[f"{left_out or 'nothing'}: something found"] += not result.diagnosed.diagnosis.agrees
    if left_out:
        found[f"{left_out}: named"] += left_out in names
        found[f"{left_out}: named alone"] += names == [left_out]
    return found


def shown(total: Mapping[str, int]) -> str:
    lines = []
    for name in sorted(total):
        of = total.get(name.replace(" held", " stated"), total.get(name.removesuffix(" held"), 0))
        share = f" of {of}, {100 * total[name] / of:.1f} %" if name.endswith(" held") else ""
        lines += [f"{name}: {total[name]}{share}"] if not name.endswith(" stated") else []
    return "\n".join(lines)


if __name__ == "__main__":
    study = {"coverage": covered, "tails": partial(covered, tails=True), "diagnosis": diagnosed}[sys.argv[1]]
    total, start = Counter[str](), time.monotonic()
    first = int(sys.argv[3]) if len(sys.argv) > 3 else 0
    for number in range(first, first + int(sys.argv[2])):
        total += study(number)
        if number % 50 == 49:
            print(f"{number + 1} robots, {time.monotonic() - start:.0f} s\n{shown(total)}\n", flush=True)
    print(shown(total))
