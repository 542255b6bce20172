"""Shapes of noise for a comparison, and the noise of a comparison as full matrices, to check what is computed without them."""

import numpy as np
from scipy import linalg, sparse

from cmm_uq.analysis.diagnosis.comparison.evidence import CandidateComparison
from cmm_uq.analysis.diagnosis.noise import NoiseKind, shape_of
from cmm_uq.base.points import Floats
from cmm_uq.maths.inference.noise import AXES, PLACING, SLOW, Components, Sizes

SHAPES = {
    "white": Sizes(np.ones((1, 3)), np.zeros(1), np.zeros(1), np.zeros(1), np.ones(1)),
    "axes": Sizes(np.array([[0.5, 1.0, 2.0]]), np.zeros(1), np.zeros(1), np.zeros(1), np.ones(1)),
    "placing": Sizes(np.ones((1, 3)), np.array([1.5]), np.zeros(1), np.zeros(1), np.ones(1)),
    "slow": Sizes(np.ones((1, 3)), np.zeros(1), np.zeros(1), np.array([1.2]), np.array([3.0])),
}
PROBABILITY = {"white": 0.5, "axes": 0.1, "placing": 0.25, "slow": 0.15}


def paired(noise_scale: Floats) -> Components:
    """Observations (m,) that are read twice each in turn, along X, Y, Z, X, …, at even times."""
    m = len(noise_scale)
    half = np.sqrt(0.5)
    turn = sparse.csr_array(np.kron(np.eye(m // 2), np.array([[half, half], [half, -half]])))
    axes = np.repeat(np.eye(3)[np.arange(m // 2) % 3], 2, axis=0) * noise_scale[:, None] ** 2
    reading = axes.sum(axis=1)
    shares = np.column_stack([axes, reading * np.tile([2.0, 0.0], m // 2), np.zeros(m), reading])
    frequency = np.arange(4.0)
    waves = np.where(frequency > 0, np.sqrt(2), 1.0) * np.cos(np.pi * frequency * np.linspace(0, 1, m)[:, None])
    return Components(turn, shares, noise_scale[:, None] * waves, frequency, (AXES, PLACING, SLOW))


def some_kinds(noise_scale: Floats) -> list[NoiseKind]:
    """One shape of each component, for observations in equal pairs."""
    components = paired(noise_scale)
    return [shape_of(components, SHAPES[name], noise_scale, p) for name, p in PROBABILITY.items()]


def rest(c: CandidateComparison) -> Floats:
    """(m, m') orthonormal basis of what the baseline does not reach."""
    return np.asarray(linalg.null_space(c.baseline.T))


def covariance(kind: NoiseKind) -> Floats:
    """(m, m) over the variance of a reading."""
    whitening = kind.white(np.eye(kind.whitening.shape[0]))
    whole = linalg.inv(whitening.T @ whitening)
    return np.asarray(whole + kind.slow @ kind.slow.T if kind.slow.size else whole)
