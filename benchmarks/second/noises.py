"""Every kind of noise that the noise model of a certificate has, as coordinates are read, and the covariance that it has.

A recording has white noise and one kind besides. Nothing here comes from the package.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from benchmarks.second.artefacts import Placed

KINDS = ("white", "axis", "set-up", "growing", "slow", "walk", "tails", "display", "real")
"""White; one axis reads worse; an offset of each point of each set-up; noise that grows with the distance from the first
point of a set-up; in time, an Ornstein–Uhlenbeck process or a random walk; Student's t; steps of a display; residuals of real
bars."""
IN_TIME = ("slow", "walk")
"""Kinds whose recordings have the time in them."""
TAILS = (3.0, 4.0)


@dataclass(frozen=True)
class Noise:
    """What the noise of one recording is.

    Parameters
    ----------
    kind : of :data:`KINDS`.
    sigma : standard deviation of a reading of one coordinate, mm.
    axis, times : the axis that reads worse, and by how much.
    ratio : of the other component's standard deviation to ``sigma``; of a walk, of what it has at the end.
    forgets : time, s, over which slow noise forgets.
    dof : degrees of freedom of Student's t.
    step : of the display, mm.
    """

    kind: str
    sigma: float
    axis: int = 0
    times: float = 1.0
    ratio: float = 0.0
    forgets: float = 1.0
    dof: float = 0.0
    step: float = 0.0


def drawn(random: np.random.Generator, kind: str, placed: Placed) -> Noise:
    """Sizes of a kind of noise."""
    sigma = float(np.exp(random.uniform(np.log(0.7), np.log(2.0)))) * 1e-3
    if kind == "axis":
        return Noise(kind, sigma, axis=int(random.integers(3)), times=float(random.uniform(1.5, 3.5)))
    if kind == "set-up":
        return Noise(kind, sigma, ratio=float(random.uniform(0.5, 2.0)))
    if kind == "growing":
        return Noise(kind, sigma, ratio=float(random.uniform(1.0, 3.0)))
    if kind == "slow":
        whole = float(np.ptp(placed.recorded["time_s"]))
        forgets = whole * float(np.exp(random.uniform(np.log(0.02), np.log(0.5))))
        return Noise(kind, sigma, ratio=float(random.uniform(1.0, 4.0)), forgets=forgets)
    if kind == "walk":
        return Noise(kind, sigma, ratio=float(random.uniform(1.0, 4.0)))
    if kind == "tails":
        return Noise(kind, sigma, dof=float(random.choice(TAILS)))
    if kind == "display":
        step = float(random.choice([1e-3, 2e-3, 5e-3]))
        return Noise(kind, step * float(random.uniform(0.4, 1.2)), step=step)
    if kind == "real":
        return Noise(kind, float(np.std(placed.residuals) / np.sqrt(2)))
    return Noise(kind, sigma)


def away(placed: Placed) -> np.ndarray:
    """Distance (n,) of each point from the first of its set-up, over the longest."""
    found = np.zeros(len(placed.true))
    for k in np.unique(placed.measurement):
        own = placed.measurement == k
        first = placed.true[own & (placed.point == 1)][0]
        found[own] = np.linalg.norm(placed.true[own] - first, axis=1)
    return found / found.max()


def same_point(placed: Placed) -> np.ndarray:
    """(n, n) whether two readings are of one point in one set-up."""
    key = placed.measurement * 1000 + placed.point
    return np.asarray(key[:, None] == key)


def of_coordinates(noise: Noise, placed: Placed) -> np.ndarray:
    """Covariance (3, n, n) of readings along each axis, mm²; of Student's t and of a display that of a normal one like it."""
    n = len(placed.true)
    found = np.tile(np.eye(n), (3, 1, 1))
    if noise.kind == "axis":
        found[noise.axis] *= noise.times**2
    elif noise.kind == "set-up":
        found += noise.ratio**2 * same_point(placed)
    elif noise.kind == "growing":
        found += np.diag((noise.ratio * away(placed)) ** 2)
    elif noise.kind == "slow":
        time = placed.recorded["time_s"]
        found += noise.ratio**2 * np.exp(-np.abs(time[:, None] - time) / noise.forgets)
    elif noise.kind == "walk":
        time = placed.recorded["time_s"]
        passed = (time - time.min()) / np.ptp(time)
        found += noise.ratio**2 * np.minimum(passed[:, None], passed)
    return noise.sigma**2 * found + noise.step**2 / 12 * np.eye(n)


def of_observations(coordinates: np.ndarray, placed: Placed) -> np.ndarray:
    """Covariance (m, m) of observations whose coordinates have covariances (3, n, n)."""
    m, n = len(placed.D), len(placed.true)
    D = placed.D.reshape(m, n, 3)
    if m == 3 * n:  # every coordinate is an observation
        found = np.zeros((n, 3, n, 3))
        for a in range(3):
            found[:, a, :, a] = coordinates[a]
        return found.reshape(m, m)
    return np.asarray(sum(D[:, :, a] @ coordinates[a] @ D[:, :, a].T for a in range(3)))


def readings(random: np.random.Generator, noise: Noise, placed: Placed) -> np.ndarray:
    """Noise (n, 3) of the readings, mm; the display's steps are left to :func:`displayed`."""
    n = len(placed.true)
    if noise.kind == "real":
        return 0.5 * np.repeat(placed.residuals, 2)[:, None] * placed.extra["outward"]
    if noise.kind == "tails":
        return np.asarray(noise.sigma * random.standard_t(noise.dof, (n, 3)) / np.sqrt(noise.dof / (noise.dof - 2)))
    smooth = Noise(noise.kind, noise.sigma, noise.axis, noise.times, noise.ratio, noise.forgets)
    roots = np.linalg.cholesky(of_coordinates(smooth, placed))
    return np.einsum("aij,ja->ia", roots, random.standard_normal((n, 3)))


def displayed(noise: Noise, xyz: np.ndarray) -> np.ndarray:
    """Coordinates as they are shown."""
    return np.round(xyz / noise.step) * noise.step if noise.step else xyz
