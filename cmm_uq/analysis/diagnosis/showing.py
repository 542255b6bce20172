"""What of an effect a recording shows: what is left of its column once all that is fitted is taken away, and its length."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import sqrt

import numpy as np
from numpy.typing import NDArray

from cmm_uq.analysis.diagnosis.comparison.explanations import Explanation
from cmm_uq.analysis.diagnosis.comparison.search import Found
from cmm_uq.base.points import Floats
from cmm_uq.machine.model import MeasurementModel
from cmm_uq.maths.inference.freedoms import reached

PLACES = "placing"
"""Name among what takes an effect up: the free places of the artefact."""

HIDDEN = 0.3
"""Part of an effect's length, what is fitted taken away, below which it is that which hides it."""

_PART = 0.1
"""Share from which on a fitted effect counts as part of what takes another one up."""

_ALIKE = 0.96
"""Mean square cosine from which on two periods look alike."""

_NEIGHBOURS = 2
_RIDGE = 1e-13


@dataclass(frozen=True, eq=False)
class View:
    """A comparison, the noise in it once what was asserted is taken away, and what is fitted.

    ``fitted`` (m, f) are columns of what was asserted, orthonormal; ``noise`` (m,) what they leave; ``weight`` (k,) the
    probability of each kind of noise and ``squares`` (k,) its mean σ², mm²; ``known`` degrees of freedom of σ beforehand.
    """

    found: Found
    fitted: Floats
    noise: Floats
    weight: Floats
    squares: Floats
    known: float
    left: int

    @classmethod
    def of(cls, found: Found) -> View:
        """The view of a search."""
        comparison = found.first.comparison
        scale = comparison.noise_scale[:, None]
        columns = [
            comparison.explanations[v.explanation].members[v.member].columns / scale
            for v in found.versions
            if v.explanation in found.chosen
        ]
        fitted = np.zeros((len(scale), 0))
        if columns:
            fitted = reached(comparison.rest(np.hstack(columns)))
        noise = comparison.left - fitted @ (fitted.T @ comparison.left)
        both = comparison.noise_posterior(noise)
        weight = both.sum(axis=1)
        squares = both @ comparison.sigma**2 / np.maximum(weight, 1e-300)
        log_sigma = np.log(comparison.sigma)
        of_sigma = both.sum(axis=0)
        variance = float(of_sigma @ log_sigma**2 - (of_sigma @ log_sigma) ** 2)
        left = comparison.degrees_of_freedom - fitted.shape[1]
        return cls(found, fitted, noise, weight, squares, max(0.5 / max(variance, 1e-12) - left, 0.0), left)

    @property
    def explanations(self) -> Sequence[Explanation]:
        """All that were compared."""
        return self.found.first.explanations

    def rest(self, columns: Floats) -> Floats:
        """What baseline and asserted effects leave of columns (m, b)."""
        left = self.found.first.comparison.rest(columns)
        return left - self.fitted @ (self.fitted.T @ left)

    def lengths(self, columns: Floats) -> Floats:
        """Visible length (b,) of columns (m, b) of which everything fitted has been taken."""
        each = self.found.first.comparison.lengths(columns)
        variance = (self.weight[:, None] * self.squares[:, None] / np.maximum(each, 1e-300)).sum(axis=0)
        return np.asarray(np.where(each.min(axis=0) > 0, 1 / np.sqrt(variance), 0.0))

    def taking(self, raw: Floats) -> tuple[str, ...]:
        """Names of what takes most of a column (m,) up: what was asserted, or else what the model names."""
        left = self.found.first.comparison.rest(raw[:, None])
        if np.linalg.norm(left) >= HIDDEN * np.linalg.norm(raw):
            return self.found.effects
        return _imitators(self.found.first.model, raw)


def phases(view: View, lefts: Floats) -> tuple[Floats, Floats, Floats]:
    """Visible length of the worst (p,) and of the typical phase (p,), and the coefficients (p, r) of that one."""
    p, m, r = lefts.shape
    pairs = [(a, b) for a in range(r) for b in range(a, r)]
    sums = np.stack([lefts[:, :, a] + (lefts[:, :, b] if a != b else 0.0) for a, b in pairs])  # polarised squares
    squares = view.lengths(sums.reshape(-1, m).T).reshape(len(pairs), p) ** 2
    gram = np.zeros((p, r, r))
    own = {a: squares[k] for k, (a, b) in enumerate(pairs) if a == b}
    for k, (a, b) in enumerate(pairs):
        gram[:, a, b] = gram[:, b, a] = own[a] if a == b else 0.5 * (squares[k] - own[a] - own[b])
    strengths, turn = np.linalg.eigh(gram)
    strengths = np.maximum(strengths, 0.0)
    way = turn.sum(axis=2) / sqrt(r)
    return np.sqrt(strengths[:, 0]), np.sqrt(strengths.mean(axis=1)), way


def aliased(view: View, lefts: Floats, values: Floats) -> NDArray[np.bool_]:
    """(p,) whether another value, not next to it, looks the same in these observations."""
    p, m, r = lefts.shape
    basis, s, _ = np.linalg.svd(lefts, full_matrices=False)
    basis = np.where((s > 1e-6 * s.max(initial=1e-300))[:, None, :], basis, 0.0)
    flat = basis.transpose(1, 0, 2).reshape(m, p * r)
    squares = (flat.T @ flat) ** 2
    alike = squares.reshape(p, r, p, r).sum(axis=(1, 3)) / r > _ALIKE
    place = np.argsort(np.argsort(values))
    near = np.abs(place[:, None] - place) <= _NEIGHBOURS
    return np.asarray((alike & ~near).any(axis=1))


def _imitators(model: MeasurementModel, raw: Floats) -> tuple[str, ...]:
    """Names of what is fitted that together looks like a column (m,): those with a share of it that counts.

    What the free places of the artefact take up is theirs; for the rest, of many solutions the smallest counts.
    """
    linear = model.estimate().linear
    places = linear.freedoms.over(linear.noise_scale)
    left = places.without(raw[:, None])[:, 0]
    length, rest = float(np.linalg.norm(raw)), float(np.linalg.norm(left))
    names = [PLACES] if rest < (1 - _PART) * length else []
    if rest > _PART * length:
        free = [i for i, unknown in enumerate(linear.unknowns) if not unknown.known]
        columns = linear.reduced.design[:, free]
        sizes = np.maximum(np.linalg.norm(columns, axis=0), 1e-300)
        parts = np.linalg.lstsq(columns / sizes, left / rest, rcond=_RIDGE**0.5)[0]
        names = [linear.unknowns[i].key[0] for i, part in zip(free, parts, strict=True) if abs(part) > _PART] + names
    return tuple(dict.fromkeys(names))
