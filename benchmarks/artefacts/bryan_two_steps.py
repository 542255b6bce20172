"""What a Bryan gauge loses when centre and errors are found one after the other: the table in docs/artefacts/bryan.md.

Run:  python benchmarks/artefacts/bryan_two_steps.py

200 simulated recordings a row, seeds 0 to 199: a bar of 400 mm swept over 60 positions, noise of a coordinate 1 µm, true
errors 100, −60, 20 ppm and 30″, −12″, 80″.
"""

from __future__ import annotations

import numpy as np

from cmm_uq.artefacts import artefact_facts
from cmm_uq.artefacts.bryan import Bryan
from cmm_uq.base.points import Floats, Machine, Points
from cmm_uq.jobs.tables.artefact import ArtefactFacts
from cmm_uq.machine.model import Noise, RecordingModel
from cmm_uq.machine.physics.catalogue import effects

NAMES = ("scale_x", "scale_y", "scale_z", "squareness_xy", "squareness_yz", "squareness_zx")
TRUTH = np.array([100.0, -60.0, 20.0, 30.0, -12.0, 80.0])
SIGMA, RECORDINGS, COUNT, LENGTH = 1e-3, 200, 60, 400.0
MACHINE = Machine("bridge", "XYZ", np.array([[0.0, 900.0], [0.0, 900.0], [-900.0, 0.0]]))


def swept(everywhere: bool) -> Points:
    """Positions spread evenly over a sphere, or over its upper half."""
    z = (np.arange(COUNT) + 0.5) / COUNT
    z = 2 * z - 1 if everywhere else z
    turn = np.pi * (3 - np.sqrt(5)) * np.arange(COUNT)
    flat = np.sqrt(1 - z**2)
    direction = np.column_stack([flat * np.cos(turn), flat * np.sin(turn), z])
    fixed = np.array([450.0, 450.0, -450.0 if everywhere else -850.0])
    return Points(
        fixed + LENGTH * direction, np.arange(1, COUNT + 1), np.ones(COUNT, int), np.ones(COUNT, int), MACHINE
    )


def estimates(facts: ArtefactFacts, points: Points) -> tuple[Floats, Floats, Floats, Floats]:
    """Estimates and standard uncertainties, jointly and in two steps; without a certified length, scales about their mean."""
    bar = Bryan(facts, points)
    joint = RecordingModel(bar, effects(NAMES), SIGMA).estimate().least_squares
    two_steps, _ = bar.in_two_steps()
    about = np.eye(6)
    if facts.length_mm is None:
        about[:3, :3] -= 1 / 3
    covariance = np.where(np.isfinite(joint.covariance), joint.covariance, 0.0)[:6, :6]
    second = np.append(two_steps.scales_ppm, two_steps.squareness_arcsec)
    return about @ joint.value[:6], np.sqrt(np.diag(covariance)), about @ second, two_steps.u


def row(name: str, everywhere: bool, length: float | None) -> str:
    facts = artefact_facts(kind="bryan", length_mm=length)
    points = swept(everywhere)
    truth_model = RecordingModel(Bryan(artefact_facts(kind="bryan", length_mm=LENGTH), points), effects(NAMES))
    about = np.eye(6)
    if length is None:
        about[:3, :3] -= 1 / 3
    found = []
    for seed in range(RECORDINGS):
        random = np.random.default_rng(seed)
        xyz = truth_model.simulate(TRUTH, np.array([LENGTH]), Noise(coordinate=SIGMA), random)
        joint, _, two_steps, u = estimates(facts, points.at(xyz))
        found.append((joint, two_steps, u))
    joint, two_steps, u = (np.array(part) for part in zip(*found, strict=True))
    truth = about @ TRUTH
    cells = [
        f"{joint[:, i].mean() - truth[i]:+.1f} ± {joint[:, i].std():.1f} | {two_steps[:, i].mean() - truth[i]:+.1f} ± "
        f"{two_steps[:, i].std():.1f}"
        for i in (2, 5)
    ]
    inside = np.mean(np.abs(two_steps - truth) < 1.96 * u, axis=0)
    return f"| {name} | {' | '.join(cells)} | {100 * inside[3:].mean():.0f} % |"


if __name__ == "__main__":
    print("| sweep, length | scale Z joint | two steps | squareness ZX joint | two steps | two steps: truth in 95 % |")
    print("| --- | --- | --- | --- | --- | --- |")
    for title, everywhere in (("half a sphere", False), ("whole sphere", True)):
        print(row(f"{title}, known", everywhere, LENGTH))
        print(row(f"{title}, not known", everywhere, None))
