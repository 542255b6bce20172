"""Fleets of machines with a known future: histories of certificates, and every day's true error for forty years more.

Written for the study of the drift model and sharing no code with the package. Days count from today, the past is negative;
the error is in units of which the limit is ten, rates are per year. A machine's error is a line, a random walk and steps of
a heavy-tailed distribution, set back by adjustments; rates come from a heavy-tailed distribution about what is usual for its
model and its place, and no two machines walk or jump alike. Certificates carry an error common to all that were made with one
artefact, and a few are simply wrong.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

LIMIT = 10.0
YEAR = 365.25
YEARS_AHEAD = 40
LONGEST_PAST = 12 * 366

MODELS = {"A": 1.0, "B": 2.0, "C": -1.5, "D": 3.0}
PLACES = 5
PLACE_SD, RATE_SCALE, RATE_DOF = 0.5, 1.1, 4
WALK_MEDIAN, WALK_SPREAD = 1.1, 0.6
STEPS_PER_YEAR, STEP_SCALE = 0.08, 3.0
INSTALLED_SD, AS_LEFT_SD = 3.0, 1.5
U_MEDIAN, U_SPREAD, SHARED_PART = 1.1, 0.3, (0.3, 0.7)
WRONG, WRONG_TIMES = 0.015, 5.0
ADJUSTED_BEYOND, ADJUSTED_ANYWAY = 0.8, 0.04
CERTIFICATES, CHANCES = np.arange(1, 11), np.array([20, 20, 18, 10, 8, 6, 5, 5, 4, 4]) / 100


@dataclass
class Surroundings:
    """What all machines of a fleet share: rates of places; artefacts of each place, old and new, with their errors."""

    place_rate: np.ndarray
    artefact_error: np.ndarray  # (places, 2), in standard uncertainties of the artefact
    changed: np.ndarray  # day from which a place used its second artefact


@dataclass
class Certificates:
    """Of one machine, in order of time."""

    day: list[int]
    value: list[float]
    u: list[float]
    u_artefact: list[float]
    artefact: list[str]
    adjusted_since: list[float]  # day of the last adjustment before the certificate; nan for none


@dataclass
class Machine:
    """A machine: what is recorded of it, and the truth."""

    model: str
    place: int
    certificates: Certificates
    u: float
    part: float
    raw: np.ndarray  # daily, from the day of its first certificate: line, walk and steps without adjustments
    first: int
    offset: float  # true error = offset + raw since the last adjustment
    rate: float
    adjusted: float = np.nan

    def truth(self, day: int) -> float:
        return float(self.offset + self.raw[day - self.first])


def surroundings(random: np.random.Generator) -> Surroundings:
    return Surroundings(
        random.normal(0, PLACE_SD, PLACES),
        random.standard_normal((PLACES, 2)),
        random.integers(-1500, -300, PLACES),
    )


def certify(machine: Machine, day: int, around: Surroundings, random: np.random.Generator) -> float:
    """A certificate of the day; its value."""
    new = int(day >= around.changed[machine.place])
    shared = machine.part * machine.u
    own = np.sqrt(machine.u**2 - shared**2) * random.standard_normal()
    if random.random() < WRONG:
        own *= WRONG_TIMES
    value = machine.truth(day) + shared * around.artefact_error[machine.place, new] + own
    kept = machine.certificates
    kept.day.append(day)
    kept.value.append(value)
    kept.u.append(machine.u)
    kept.u_artefact.append(shared)
    kept.artefact.append(f"P{machine.place}-{new}")
    kept.adjusted_since.append(machine.adjusted)
    return value


def adjust(machine: Machine, day: int, random: np.random.Generator) -> None:
    """To nearly nothing, on a day; the certificates to come say so."""
    machine.offset = random.normal(0, AS_LEFT_SD) - machine.raw[day - machine.first]
    machine.adjusted = float(day)


def calibrate(machine: Machine, day: int, around: Surroundings, random: np.random.Generator, *, as_left: bool) -> float:
    """As found; adjusted where that is called for, and certified as left the day after, always or by chance."""
    found = certify(machine, day, around, random)
    if abs(found) > ADJUSTED_BEYOND * LIMIT or random.random() < ADJUSTED_ANYWAY:
        adjust(machine, day, random)
        if as_left or random.random() < 0.5:
            certify(machine, day + 1, around, random)
    return found


def _made(random: np.random.Generator, around: Surroundings, ahead: int) -> Machine:
    model = str(random.choice(list(MODELS)))
    place = int(random.integers(PLACES))
    count = int(random.choice(CERTIFICATES, p=CHANCES))
    gaps = np.maximum(60, random.normal(365, 40, count)).astype(int) // np.where(random.random(count) < 0.15, 2, 1)
    first = max(-int(gaps.sum()) + int(gaps[-1]) - int(random.integers(0, 30)), -LONGEST_PAST)
    days = first + np.concatenate([[0], np.cumsum(gaps[:-1])])
    rate = MODELS[model] + around.place_rate[place] + RATE_SCALE * random.standard_t(RATE_DOF)
    walk = WALK_MEDIAN * np.exp(WALK_SPREAD * random.standard_normal())
    length = ahead - first + 3
    raw = np.cumsum(rate / YEAR + walk / np.sqrt(YEAR) * random.standard_normal(length))
    for at in random.integers(0, length, random.poisson(STEPS_PER_YEAR * random.gamma(2, 0.5) * length / YEAR)):
        raw[at:] += random.laplace(0, STEP_SCALE)
    raw -= raw[0]
    machine = Machine(
        model, place, Certificates([], [], [], [], [], []), U_MEDIAN * np.exp(U_SPREAD * random.standard_normal()),
        float(random.uniform(*SHARED_PART)), raw, first, float(random.normal(0, INSTALLED_SD)), float(rate),
    )  # fmt: skip
    for day in days:
        calibrate(machine, int(day), around, random, as_left=bool(day == days[-1]))
    return machine


def fleet(seed: int, machines: int, ahead: int = int(YEARS_AHEAD * YEAR)):
    """The machines of a fleet one after the other, each from random numbers of its own, with what they share."""
    of_all, *each = np.random.SeedSequence(seed).spawn(machines + 1)
    around = surroundings(np.random.default_rng(of_all))
    for child in each:
        random = np.random.default_rng(child)
        yield _made(random, around, ahead), around, random


def crossed(machine: Machine) -> float:
    """Days from the last certificate until the true error is first beyond the limit; infinite: not in forty years."""
    last = machine.certificates.day[-1]
    beyond = np.flatnonzero(np.abs(machine.offset + machine.raw[last - machine.first :]) > LIMIT)
    return float(beyond[0]) if len(beyond) else np.inf
