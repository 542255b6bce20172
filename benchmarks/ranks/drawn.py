"""Recordings drawn from what is known beforehand: parameters, sizes of the noise, and the noise, all by the model's own laws.

What stands where, and hence the design and the components of noise that could show, are those of a recording of the coverage
study, and of the digitizer's example: its observations are forgotten. The noise of a coordinate is stated, since a uniform
logarithm from a nanometre to a centimetre is nothing to draw from. Where nothing is known beforehand (placings, sizes
without a certificate) the truth stays at zero or at the nominal value: with a uniform prior the ranks of everything are the
same wherever it lies.
"""

from __future__ import annotations

import tempfile
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from benchmarks.coverage.artefacts import ARTEFACTS
from benchmarks.coverage.cells import Cell
from benchmarks.coverage.recordings import recording
from cmm_uq.app.commands.diagnose import screened_model
from cmm_uq.app.commands.reading import read_job
from cmm_uq.machine.model.noise import noise_of
from cmm_uq.maths.inference.linear_model import LinearModel
from cmm_uq.maths.inference.noise import Components, Sizes

DIGITIZER = "digitizer"
CASES = (*ARTEFACTS, DIGITIZER)
STATED = 1e-3
"""Standard uncertainty of a coordinate, mm, that every job states."""
NEAR, SD_NEAR, SD_WRONG = 0.9, 0.2, 1.0
"""Of ln σ about what is stated: how often it is good, its standard deviation then and else (docs/noise.md)."""


@dataclass(frozen=True, eq=False)
class Design:
    """A linear model, whose observations do not matter, and the components of its noise."""

    linear: LinearModel
    noise: Components


@dataclass(frozen=True, eq=False)
class Drawn:
    """A recording and its truth.

    Parameters
    ----------
    linear : with the observations drawn.
    values : (k,) true parameters.
    sizes : true sizes of the noise, as a single draw.
    """

    linear: LinearModel
    values: np.ndarray
    sizes: Sizes


def design(name: str, seed: int, number: int) -> Design:
    """The design of an artefact as recording ``number`` of the coverage study has it; every second one has the time in it."""
    if name == DIGITIZER:
        return _design(Path(__file__).parents[2] / "examples" / "digitizer-simulated")
    with tempfile.TemporaryDirectory() as folder:
        return _design(recording(Cell(name, "white"), seed, number).write(Path(folder) / "ranks"))


def _design(folder: Path) -> Design:
    model, _ = screened_model(read_job(folder))
    linear = replace(model.estimate().linear, sigma=STATED)
    return Design(linear, replace(noise_of(model), stated=STATED))


def drawn(of: Design, random: np.random.Generator) -> Drawn:
    """Parameters, sizes of the noise and a recording."""
    linear = of.linear
    known = np.isfinite(linear.prior_sd)
    values = linear.prior_mean + np.where(known, linear.prior_sd, 0.0) * random.standard_normal(len(known))
    sizes = of.noise.sizes(latent(of.noise, random))
    noise = of.noise.repeated(sizes, 1, random)[0, 0]
    return Drawn(replace(linear, observed=linear.design @ values + noise), values, sizes)


def latent(noise: Components, random: np.random.Generator) -> np.ndarray:
    """The numbers (1, d) that say the sizes of the noise: standard normal, but the first, from which ln σ follows."""
    found = random.standard_normal((1, noise.dimension))
    sd = SD_NEAR if random.random() < NEAR else SD_WRONG
    found[:, 0] = np.log(noise.stated) + sd * random.standard_normal() + noise.log_scatter(found)
    return found
