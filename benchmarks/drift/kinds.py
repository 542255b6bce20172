"""Machines of five kinds with a known future: plain, settling, season, wear that speeds up, a step.

Written for the study of the drift model without a fleet and sharing no code with the package; certificates, adjustments and
units are those of the generator beside it (limit ten, days from today, rates per year). Every kind has a rate, a random walk
and a rare step; what is particular to it is none of the model's forms where another is as likely: a season has a second
harmonic and is not alike every year, wear is a power of time since an installation that nobody recorded, and settling goes on
after an adjustment.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from benchmarks.drift.generator import (
    LONGEST_PAST,
    U_MEDIAN,
    U_SPREAD,
    YEAR,
    YEARS_AHEAD,
    Certificates,
    Machine,
    Surroundings,
    calibrate,
    surroundings,
)

KINDS = ("plain", "settling", "season", "wear", "step")
RATE = {
    "plain": 1.1,
    "settling": 0.5,
    "season": 0.8,
    "wear": 0.3,
    "step": 0.8,
}  # scale of Student's t, 4 degrees of freedom
WALK_MEDIAN, WALK_SPREAD = 0.8, 0.5
STEPS_PER_YEAR, STEP_SCALE = 0.03, 3.0
FIRST_SD = 2.5
SETTLED, DECAY_YEARS = (2.0, 8.0), (0.15, 2.0)
AMPLITUDE, SECOND_HARMONIC, YEARS_DIFFER = (1.0, 4.0), 0.15, 0.15
POWER, AGE, WORN_OUT = (1.3, 2.5), (0.0, 4.0), (4.0, 15.0)
STEP = (2.0, 8.0)
CERTIFICATES = (2, 10)
TWICE_A_YEAR, SAME_MONTH = 0.25, 0.3


def machines(kind: str, seed: int, count: int) -> Iterator[Machine]:
    """Of one kind, one after the other, each from random numbers of its own."""
    of_all, *each = np.random.SeedSequence([seed, KINDS.index(kind)]).spawn(count + 1)
    around = surroundings(np.random.default_rng(of_all))
    for child in each:
        yield _made(kind, np.random.default_rng(child), around)


def _made(kind: str, random: np.random.Generator, around: Surroundings) -> Machine:
    count = int(random.integers(CERTIFICATES[0], CERTIFICATES[1] + 1))
    twice, same = random.random() < TWICE_A_YEAR, random.random() < SAME_MONTH
    usual, scatter = 365.25 / (1 + twice), 5.0 if same else 40.0
    gaps = np.maximum(60, random.normal(usual, scatter, count)).astype(int)
    first = max(-int(gaps[:-1].sum()) - int(random.integers(0, 30)), -LONGEST_PAST)
    days = first + np.concatenate([[0], np.cumsum(gaps[:-1])])
    length = int(YEARS_AHEAD * YEAR) - first + 3
    years = np.arange(length) / YEAR
    rate = RATE[kind] * random.standard_t(4)
    walk = WALK_MEDIAN * np.exp(WALK_SPREAD * random.standard_normal())
    raw = rate * years + np.cumsum(walk / np.sqrt(YEAR) * random.standard_normal(length))
    steps = [(int(at), float(random.laplace(0, STEP_SCALE)))
             for at in random.integers(1, length, random.poisson(STEPS_PER_YEAR * length / YEAR))]  # fmt: skip
    if kind == "step":
        steps.append((int(random.integers(1, days[-1] - first)), _either(random, *STEP)))
    for at, size in steps:
        raw[at:] += size
    if kind == "settling":
        raw += _either(random, *SETTLED) * -np.expm1(-years / np.exp(random.uniform(*np.log(DECAY_YEARS))))
    elif kind == "season":
        raw += _season(random, years)
    elif kind == "wear":
        power, age, lasts = random.uniform(*POWER), random.uniform(*AGE), random.uniform(*WORN_OUT)
        worn = (years + age) ** power - age**power
        raw += _either(random, 10.0, 10.0) * worn / ((lasts + age) ** power - age**power)
    raw -= raw[0]
    machine = Machine(
        kind, 0, Certificates([], [], [], [], [], []), U_MEDIAN * np.exp(U_SPREAD * random.standard_normal()),
        float(random.uniform(0.3, 0.7)), raw, first, float(random.normal(0, FIRST_SD)), float(rate),
    )  # fmt: skip
    machine.steps = sorted((first + at, size) for at, size in steps)  # type: ignore[attr-defined]
    for day in days:
        calibrate(machine, int(day), around, random, as_left=bool(day == days[-1]))
    return machine


def _either(random: np.random.Generator, low: float, high: float) -> float:
    return float(random.uniform(low, high) * random.choice([-1.0, 1.0]))


def _season(random: np.random.Generator, years: np.ndarray) -> np.ndarray:
    """A fundamental and a second harmonic, a little more or less of both in each year."""
    one, two = random.uniform(0, 2 * np.pi, 2)
    of_year = np.exp(YEARS_DIFFER * random.standard_normal(int(years[-1]) + 3))
    size = random.uniform(*AMPLITUDE) * np.interp(years, np.arange(len(of_year)), of_year)
    return size * (np.cos(2 * np.pi * years + one) + SECOND_HARMONIC * np.cos(4 * np.pi * years + two))
