"""How often the intervals for the offset of a digitizer's mount hold the truth: the table in docs/artefacts/digitizer.md.

Run:  PYTHONPATH=. python benchmarks/artefacts/digitizer_coverage.py [RECORDINGS]

Each recording draws what the job states anew: the noise of every point, the turn and the shift of every attitude, the diameter
of the sphere. Given the sizes of the noise's components the posterior is normal; here these sizes are weighed by importance
instead of being sampled with emcee: a second way and a faster one (the last column says how far apart the two are).
"""

from __future__ import annotations

import sys
from dataclasses import dataclass, replace

import numpy as np
from scipy import stats

from cmm_uq.artefacts import artefact_facts
from cmm_uq.artefacts.digitizer import THREE, DigitizerArtefact, scan
from cmm_uq.base.points import Floats, Machine, Points
from cmm_uq.base.units import MICROMETRE
from cmm_uq.jobs.tables.artefact import ArtefactFacts
from cmm_uq.machine.model import Noise, RecordingModel
from cmm_uq.machine.model.noise import noise_of
from cmm_uq.machine.physics.digitizer import euler_313
from cmm_uq.maths.inference.marginal import Marginal
from cmm_uq.maths.inference.posterior import sample_with_noise

OFFSET = np.array([1.001, 264.505, 129.575])
SPHERE = np.array([350.0, 350.0, -330.0])
PROPOSED, DRAWS = 6000, 4000


def recording(times: int, radius: float) -> Points:
    """The source's three attitudes, so many times: scans of a sphere, or its centre where there is no radius."""
    xyz, angles, seen, number, point = [], [], [], [], []
    for pose, each in enumerate(THREE, 1):
        attitude = euler_313(*np.radians(each))
        uv, readings = scan(attitude, OFFSET, radius) if radius else (np.zeros((1, 2)), (attitude @ OFFSET)[None])
        count = times * len(readings)
        xyz.append(np.tile(SPHERE + readings, (times, 1)))
        seen.append(np.tile(uv, (times, 1)))
        angles.append(np.tile(each, (count, 1)))
        number.append(np.full(count, pose))
        point.append(np.arange(1, count + 1))
    columns = dict(zip(("alpha_deg", "beta_deg", "gamma_deg"), np.vstack(angles).T, strict=True))
    if radius:
        columns |= dict(zip(("u_mm", "v_mm"), np.vstack(seen).T, strict=True))
    numbers = np.concatenate(number)
    return Points(np.vstack(xyz), numbers, np.concatenate(point), np.ones_like(numbers), Machine("bridge"), columns)


def posterior(model: RecordingModel, random: np.random.Generator, part: float = 1.0, columns: int = 3) -> Floats:
    """Draws (N, columns) of the first unknowns, here the offset, by importance: sizes of the noise from their prior, ln σ
    about the residuals' scatter.

    ``part`` of the usual number of draws.
    """
    proposed, kept = int(part * PROPOSED), int(part * DRAWS)
    estimate = model.estimate()
    ls, noise = estimate.least_squares, noise_of(model)
    marginal = Marginal(estimate.linear, noise, ls)
    dof = max(ls.degrees_of_freedom, 1)
    latent = random.standard_normal((proposed, noise.dimension))
    about = stats.t(5, np.log(max(ls.sigma_of_residuals, MICROMETRE)), 0.05 + 1.5 / np.sqrt(2 * dof))
    latent[:, 0] = about.rvs(proposed, random_state=random)
    log_weight = marginal.log_density(latent) + 0.5 * np.sum(latent[:, 1:] ** 2, axis=1) - about.logpdf(latent[:, 0])
    weight = np.exp(log_weight - log_weight.max())
    chosen = random.choice(proposed, kept, p=weight / weight.sum())
    return marginal.draw(noise.sizes(latent[chosen]), random)[:, :columns]


@dataclass(frozen=True, eq=False)
class Case:
    """A kind of recording: what the job states, the points, the noise in µm and whether the job states it."""

    name: str
    facts: ArtefactFacts
    points: Points
    noise_um: float
    stated: bool

    def draws(self, seed: int, part: float = 1.0) -> tuple[RecordingModel, Floats]:
        """A recording drawn anew, and the posterior draws (N, 3) of its offset."""
        random, sigma = np.random.default_rng(seed), self.noise_um * MICROMETRE
        model = RecordingModel(DigitizerArtefact(self.facts, self.points), ())
        sizes = np.array([
            size.nominal if np.isinf(size.sd) else random.normal(size.nominal, size.sd) for size in model.artefact.sizes
        ])  # fmt: skip
        sizes[:3] = OFFSET
        drawn = self.points.at(model.simulate(np.zeros(0), sizes, Noise(coordinate=sigma), random))
        made = replace(model, artefact=DigitizerArtefact(self.facts, drawn), sigma=sigma if self.stated else None)
        return made, posterior(made, random, part)

    def coverage(self, recordings: int, part: float = 1.0) -> tuple[Floats, Floats]:
        """How often (4,) the 95 % intervals of U1, V1, W1 and the 95 % ellipsoid hold the truth, and mean u (3,), µm.

        ``part`` of the usual draws of each posterior: of a fourth, a quantile of 2.5 % is found to 0.5 %, which the mean over
        many recordings does not show.
        """
        hits, u = np.zeros(4), np.zeros(3)
        for seed in range(recordings):
            _, draws = self.draws(seed, part)
            low, high = np.quantile(draws, [0.025, 0.975], axis=0)
            about, off = draws - draws.mean(axis=0), OFFSET - draws.mean(axis=0)
            weights = np.linalg.inv(np.cov(draws.T))
            inside = off @ weights @ off <= np.quantile(np.einsum("ni,ij,nj->n", about, weights, about), 0.95)
            hits += [*((low <= OFFSET) & (high >= OFFSET)), inside]
            u += draws.std(axis=0) / MICROMETRE / recordings
        return hits, u

    def row(self, recordings: int) -> str:
        """Of the table."""
        hits, u = self.coverage(recordings)
        made, draws = self.draws(0)
        estimate = made.estimate()
        sampled = sample_with_noise(estimate.linear, noise_of(made), estimate.least_squares, 0).draws[:, :3]
        apart = float(np.abs(sampled.std(axis=0) / draws.std(axis=0) - 1).max())
        cells = [f"{one:.1f}" for one in u] + [f"{100 * one / recordings:.1f} %" for one in hits]
        return f"| {self.name} | {' | '.join(cells)} | {100 * apart:.1f} % |"


def cases() -> tuple[Case, ...]:
    """Scans and centres, with and without doubt about attitudes and centres."""
    ball = {"length_mm": 25.4, "u_um": 0.3}
    known = {"u_attitude_arcsec": 3.0, "u_centre_um": [1.0, 5.0, 2.0]}

    def of(**keys: object) -> ArtefactFacts:
        return artefact_facts(kind="digitizer", **keys)

    return (
        Case("scans, 2 × 37 points, noise 9 µm not stated", of(**ball), recording(2, 12.7), 9.0, False),
        Case("the same, attitudes and centres in doubt", of(**ball, **known), recording(2, 12.7), 9.0, False),
        Case("the same, diameter not certified", of(**known), recording(2, 12.7), 9.0, False),
        Case("centres, once, noise 5 µm stated", of(), recording(1, 0.0), 5.0, True),
        Case("centres, once, noise 5 µm not stated", of(), recording(1, 0.0), 5.0, False),
        Case("centres, five times, in doubt, not stated", of(**known), recording(5, 0.0), 5.0, False),
    )


def main(recordings: int) -> None:
    """The table."""
    low, high = stats.binom.interval(0.999, recordings, 0.95)
    expected = f"{100 * low / recordings:.1f} to {100 * high / recordings:.1f} %"
    print(f"{recordings} recordings a row, seeds from 0; exact 95 % intervals would show {expected} (99.9 %)")
    print(
        "| recording | u(U1) / µm | u(V1) / µm | u(W1) / µm | U1 | V1 | W1 | together | importance against sampling |"
    )
    print("| --- | --- | --- | --- | --- | --- | --- | --- | --- |")
    for case in cases():
        print(case.row(recordings), flush=True)


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 2000)
