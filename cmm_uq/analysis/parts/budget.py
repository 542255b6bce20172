"""Where the uncertainty of a part's characteristics comes from: shares of the variance by cause, and within the machine.

Shares by cause are Sobol's, by drawing one cause anew and keeping the others: *first* is what knowing the cause alone would
take away (Saltelli et al. 2010, Comput. Phys. Commun. 181, table 2 b), *total* what would remain if all else were known
(Jansen 1999, table 2 f). They are equal where causes only add up; of a position or a form, which do not, they differ.

Errors of a machine hang together, so that no variance of one of them alone is a part of the whole. The share of each is what
knowing it alone would take away, with what it tells of the others: the first-order index of dependent inputs (Kucherenko,
Tarantola, Annoni 2012, Comput. Phys. Commun. 183) of the linear part, the square of a multiple correlation. It lies between 0
and 1; errors that are tied to each other have shares that add up to more, errors that make up for each other to less.

How far each point of a plan is off: its mean error and the covariance of it, over all causes and places.

A shift and a turn that all points have in common show in no characteristic and are taken out of every draw, by least squares.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from cmm_uq.analysis.parts.causes.cause import Drawn, PartCause
from cmm_uq.analysis.parts.virtual import AtPose, Virtual, in_parts
from cmm_uq.base.messages import Text
from cmm_uq.base.points import Floats

DRAWS = 2**13  # of each of the two samples; shares are then known to about one in a hundred
PLACE = "place on the table"


@dataclass(frozen=True, eq=False)
class VarianceShares:
    """Shares of the variance of c characteristics."""

    characteristics: tuple[str, ...]  # c names
    causes: tuple[str, ...]  # g names; independent of each other
    # first, total: (g, c) shares of the variance
    first: Floats
    total: Floats
    factors: tuple[str, ...]  # f names of the machine's errors that its certificate states together
    within: Floats  # (f, c) shares of each, by itself
    u: Floats  # (c,) standard uncertainties in this sample, mm and rad

    def told(
        self, characteristic: str, named: Mapping[str, Text], least: float = 0.05
    ) -> tuple[tuple[str, float, Text], ...]:
        """What should be told beside a result, largest first: line or factor, its share, and why.

        ``named``: by factor, why (:attr:`Virtual.named`).
        """
        column = self.characteristics.index(characteristic)
        shares = {line: self.share(line, column) for line in (*self.causes, *self.factors)}
        found = [(line, share, named[line.partition(": ")[2]]) for line, share in shares.items()
                 if share >= least and line.partition(": ")[2] in named]  # fmt: skip
        return tuple(sorted(found, key=lambda each: -each[1]))

    def share(self, line: str, column: int) -> float:
        """Of a cause, in total, or of a factor, in the variance of a characteristic: 0 to 1, as far as draws know it."""
        of, shares = (self.causes, self.total) if line in self.causes else (self.factors, self.within)
        return float(np.clip(shares[of.index(line), column], 0.0, 1.0))

    def worst(self, characteristic: str) -> str:
        """The cause, or the factor where it is the machine's, of the largest part of a variance."""
        column = self.characteristics.index(characteristic)
        shares = dict(zip(self.causes, self.total[:, column], strict=True))
        cause = max(shares, key=lambda name: shares[name])
        own = [i for i, name in enumerate(self.factors) if name.startswith(f"{cause}: ")]
        return self.factors[max(own, key=lambda i: self.within[i, column])] if own else cause


def line_of(cause: PartCause) -> str:
    """The line of the budget by cause that a cause belongs to."""
    names = set(cause.factors)
    return f"{cause.name}: {names.pop()}" if len(names) == 1 else cause.name


def variance_shares(virtual: Virtual, draws: int = DRAWS, seed: int = 0) -> VarianceShares:
    """Shares of the variance of each characteristic."""
    random, places = np.random.default_rng(seed), virtual.places
    each = max(2, draws // len(places))
    causes = places[0].causes
    lines = list(dict.fromkeys(line_of(cause) for cause in causes if cause.factors))
    # the second sample stands in other places, so that nothing of it is that of the first
    elsewhere = [places[i] for i in random.permutation(len(places))]
    several = [cause for cause in causes if len(set(cause.factors)) > 1]
    drawn, found = list[list[Floats]](), list[list[Floats]]()
    for part in in_parts(virtual.plan, each):
        A = [place.drawn(random, part) for place in places]
        B = [place.drawn(random, part) for place in places]
        exchanged = ([_exchanged(a, b, causes, line) for a, b in zip(A, B, strict=True)] for line in lines)
        of_place = [_errors(elsewhere, A, virtual.exact)] if len(places) > 1 else []
        found.append([
            _errors(places, A, virtual.exact), _errors(elsewhere, B, virtual.exact),
            *(_errors(places, mixed, virtual.exact) for mixed in exchanged), *of_place,
        ])  # fmt: skip
        by_cause = zip(causes, zip(*A, strict=True), strict=True)
        drawn.append([np.concatenate(own) for cause, own in by_cause if cause in several])
    yA, yB, *mixed = (np.concatenate(each) for each in zip(*found, strict=True))
    both = np.vstack([yA, yB])
    variance = np.maximum(both.var(axis=0), np.finfo(np.float64).tiny)
    centred = yB - both.mean(axis=0)
    first = [np.mean(centred * (y - yA), axis=0) / variance for y in mixed]
    total = [0.5 * np.mean((y - yA) ** 2, axis=0) / variance for y in mixed]
    factors, within = _within(several, [np.concatenate(own) for own in zip(*drawn, strict=True)], yA)
    names = (*lines, PLACE) if len(places) > 1 else tuple(lines)
    return VarianceShares(
        tuple(virtual.names), names, np.array(first), np.array(total), factors, within, np.sqrt(variance)
    )


def _errors(places: Sequence[AtPose], coefficients: Sequence[Sequence[Drawn]], exact: bool) -> Floats:
    return np.concatenate([place.errors(given, exact=exact) for place, given in zip(places, coefficients, strict=True)])


def _exchanged(A: Sequence[Drawn], B: Sequence[Drawn], causes: Sequence[PartCause], line: str) -> list[Drawn]:
    """The first coefficients with those of one line from the second."""
    return [b if line_of(cause) == line else a for a, b, cause in zip(A, B, causes, strict=True)]


def _within(causes: Sequence[PartCause], drawn: Sequence[Floats], y: Floats) -> tuple[tuple[str, ...], Floats]:
    """Names of factors of causes, and their shares (f, c)."""
    names, shares = list[str](), list[Floats]()
    centred = y - y.mean(axis=0)
    variance = np.maximum(y.var(axis=0), np.finfo(np.float64).tiny)
    for cause, coefficients in zip(causes, drawn, strict=True):
        factors = list(dict.fromkeys(cause.factors))
        X = coefficients - coefficients.mean(axis=0)
        for factor in factors:
            own = X[:, [i for i, name in enumerate(cause.factors) if name == factor]]
            explained = own @ np.linalg.lstsq(own, centred, rcond=None)[0]
            chance = own.shape[1] / len(own)  # what as many columns explain of anything
            share = np.mean(explained**2, axis=0) / variance
            names.append(f"{cause.name}: {factor}")
            shares.append(np.clip((share - chance) / (1 - chance), 0.0, 1.0))
    return tuple(names), np.array(shares).reshape(len(names), y.shape[1])


POINT_DRAWS = 2_000  # A standard deviation is then known to two percent
_BLOCK = 300_000  # coordinates drawn at once
_NEGLIGIBLE = 1e-9  # of the largest, a singular value of rigid motions that points do not tell from others


@dataclass(frozen=True, eq=False)
class PointErrors:
    """Errors of points: indicated less true, in the frame of the part."""

    mean: Floats  # (n, 3) mm
    covariance: Floats  # (n, 3, 3) of each point, mm²


def point_errors(virtual: Virtual, draws: int = POINT_DRAWS, seed: int = 0) -> PointErrors:
    """Mean and covariance of the error of each point, each place as often as the others."""
    points, random = virtual.plan.points, np.random.default_rng(seed)
    n = len(points)
    rigid = _rigid(points)
    block = max(1, min(draws, _BLOCK // (3 * n)))
    each = max(1, -(-draws // len(virtual.whole)))
    total, first, second = 0, np.zeros((n, 3)), np.zeros((n, 3, 3))
    for place in virtual.whole:
        for start in range(0, each, block):
            count = min(block, each - start)
            whole = (place.base + place.moved(place.drawn(random, count))).reshape(count, 3 * n)
            off = (whole - (whole @ rigid) @ rigid.T).reshape(count, n, 3)
            first += off.sum(axis=0)
            second += np.einsum("kni,knj->nij", off, off)
            total += count
    mean = first / total
    return PointErrors(mean, second / total - mean[:, :, None] * mean[:, None, :])


def _rigid(points: Floats) -> Floats:
    """(3n, r) orthonormal displacements of small shifts and turns of points (n, 3)."""
    about = points - points.mean(axis=0)
    span = max(float(np.abs(about).max()), 1.0)
    shifts = [np.tile(axis, (len(points), 1)) for axis in np.eye(3)]
    turns = [np.cross(axis, about) / span for axis in np.eye(3)]
    motions = np.array([*shifts, *turns]).reshape(6, -1)
    _, size, rows = np.linalg.svd(motions, full_matrices=False)
    return np.asarray(rows[size > _NEGLIGIBLE * size[0]].T)
