"""How probable each function is, in closed form, and what all of them together predict where they were not fitted."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from functools import cached_property
from itertools import pairwise

import numpy as np
import scipy
from numpy.typing import NDArray

from cmm_uq.analysis.diagnosis.comparison.algebra import SigmaIntegral, eigen
from cmm_uq.analysis.diagnosis.comparison.conditional import AMPLITUDES
from cmm_uq.analysis.diagnosis.comparison.lack_of_form import alike, joined, likeliest_noise
from cmm_uq.analysis.diagnosis.comparison.search import SearchResult
from cmm_uq.analysis.diagnosis.empirical.functions import FunctionFamily
from cmm_uq.analysis.diagnosis.held_out import FOLDS, Improvement, held_out_groups
from cmm_uq.base.messages import Text
from cmm_uq.base.points import Floats, Ints
from cmm_uq.base.units import MICROMETRE
from cmm_uq.base.values import dataclass, replace

# Rms of a function that is considered: the smallest over the noise, and the largest over that of all that is to be explained
_SMALLEST, _LARGER = 0.4, 3.0
_FOLLOWED, IMPROBABLE = 40, 1e-3  # versions that a prediction averages, and what a version adds to it at least
# Part of the largest log evidence over nothing from which on a form may come first between its nodes, and how many of these
_WORTH_DIVIDING, _NODES = 0.5, 6
_SINGULAR = 1e-9  # part of the largest singular value below which another counts as zero
_OPEN = 1e-10  # part of what an observation tells by itself, up to which others leave it open


@dataclass(frozen=True)
class FunctionVersion:
    family: int
    index: int
    amplitude: float  # standard deviation of its coefficients, in units of the noise
    probability: float = 1.0


@dataclass(frozen=True, eq=False)
class FunctionFit:
    """Observations (m,) whose noise has the covariance C·σ², and columns (m, p) that may take any coefficient."""

    y: Floats
    free: Floats
    covariance: Floats
    families: Sequence[FunctionFamily]
    sigma: Floats  # sigma, log_sigma: grid of the noise, and its log probability
    log_sigma: Floats
    least: float  # mm, the least that the noise may be

    @classmethod
    def of(cls, result: SearchResult, families: Sequence[FunctionFamily]) -> FunctionFit:
        """Under the noise that is most probable beside what was found; of nothing known, beside any of the functions."""
        comparison = result.first.comparison
        likeliest = int(comparison.noise_probability(result.versions).argmax())
        if not result.chosen and families and comparison.degrees_of_freedom:
            likeliest = likeliest_noise(comparison, families)
        kind = comparison.kinds[likeliest]
        root = kind.coloured(np.eye(len(comparison.observed)))
        covariance = root @ root.T
        for columns in (kind.slow, comparison.certified):
            if columns.size:
                covariance = covariance + columns @ columns.T
        grid = comparison.sigma, comparison.log_sigma, comparison.least_noise
        return cls(comparison.observed, result.last.baseline, covariance, families, *grid)

    def with_function(self, version: FunctionVersion) -> FunctionFit:
        """The same with one function more, as noise of its size."""
        return self.with_noise(version.amplitude * self.families[version.family].columns[:, version.index])

    def with_noise(self, columns: Floats) -> FunctionFit:
        """The same with columns (m, r) more, as noise of their size (Woodbury's identity)."""
        weighed = self.precision @ columns
        factor = np.linalg.cholesky(np.eye(columns.shape[1]) + columns.T @ weighed)
        covariance = self.covariance + columns @ columns.T
        return self._less(np.linalg.solve(factor, weighed.T), self.degrees, covariance)

    def without(self, out: NDArray[np.bool_]) -> FunctionFit:
        """The same of the observations but some (m,): as if columns E, one at each of these, were free besides.

        The precision P is then P − P·E·(Eᵀ·P·E)⁺·Eᵀ·P, without the directions of E that the others leave open.
        """
        values, vectors = np.linalg.eigh(self.precision[np.ix_(out, out)])
        told = values > _OPEN / np.diag(self.covariance)[out].min()
        rows = (vectors[:, told] / np.sqrt(values[told])).T @ self.precision[out]
        return self._less(rows, self.degrees - int(told.sum()), self.covariance)

    def _less(self, rows: Floats, degrees: int, covariance: Floats) -> FunctionFit:
        """The same where of the precision rowsᵀ·rows is taken, of rows (q, m), and so many degrees of freedom are left."""
        seen, y = [np.tensordot(rows, columns, 1) for _, columns, _ in self._alike], rows @ self.y
        gone = self._of_each((_squares(z, z), np.tensordot(y, z, 1)) for z in seen)
        products = [(own - z, of_y - zy) for (own, of_y), (z, zy) in zip(self.products, gone, strict=True)]
        found, precise = replace(self, covariance=covariance), (self.precision - rows.T @ rows, degrees)
        found.__dict__.update(_alike=self._alike, products=products, _precise=precise)
        return found

    @cached_property
    def root(self) -> Floats:
        return np.asarray(np.linalg.cholesky(self.covariance))

    @cached_property
    def _precise(self) -> tuple[Floats, int]:
        """Inverse (m, m) of the covariance, but zero along the free columns, and its rank."""
        every = np.eye(len(self.y)), self.free
        white, free = (scipy.linalg.solve_triangular(self.root, each, lower=True) for each in every)
        length = np.linalg.norm(free, axis=0)
        U, s, _ = np.linalg.svd(free / np.where(length > 0, length, 1.0), full_matrices=False)
        basis = U[:, s > _SINGULAR * s.max(initial=0.0)]
        white = white - basis @ (basis.T @ white)
        return np.asarray(white.T @ white), len(white) - basis.shape[1]

    @property
    def precision(self) -> Floats:
        return self._precise[0]

    @property
    def degrees(self) -> int:
        return self._precise[1]

    def rest(self, columns: Floats) -> Floats:
        """What the free columns leave of others (m, …), whitened."""
        return np.asarray(np.tensordot(self.root.T, np.tensordot(self.precision, columns, 1), 1))

    @cached_property
    def square(self) -> float:
        """Sum of squares of what is left of the observations, whitened."""
        return float(self.y @ self.precision @ self.y)

    @cached_property
    def integral(self) -> SigmaIntegral:
        return SigmaIntegral(self.sigma, self.log_sigma, self.degrees, self.square)

    @cached_property
    def nothing(self) -> float:
        """Log evidence of no function."""
        return float(self.integral(np.array([self.square]))[0])

    @cached_property
    def products(self) -> list[tuple[Floats, Floats]]:
        """Of each family the products (K, r, r) of a function's columns with each other, and (K, r) with the observations."""
        return [self.products_of(family) for family in self.families]

    def products_of(self, family: FunctionFamily) -> tuple[Floats, Floats]:
        weighed = np.tensordot(self.precision, family.columns, 1)
        return _squares(family.columns, weighed), np.tensordot(self.y, weighed, 1)

    @cached_property
    def _alike(self) -> list[tuple[list[FunctionFamily], Floats, Floats]]:
        """Families of as many coefficients, all their functions (m, K, r) and log priors (K,)."""
        return [(some, *joined(some)) for some in alike(self.families)]

    def _of_each(self, found: Iterable[tuple[Floats, Floats]]) -> list[tuple[Floats, Floats]]:
        """Of each family what was found of all that are alike."""
        of = dict[FunctionFamily, tuple[Floats, Floats]]()
        for (some, *_), (one, other) in zip(self._alike, found, strict=True):
            ends = np.cumsum([0, *(family.columns.shape[1] for family in some)]).tolist()
            of.update((family, (one[i:j], other[i:j])) for family, (i, j) in zip(some, pairwise(ends), strict=True))
        return [of[family] for family in self.families]

    @cached_property
    def evidence(self) -> list[tuple[Floats, Floats]]:
        """Of each family the log of evidence and prior of its functions at every size, and these sizes, each (K, a)."""
        of = dict(zip(self.families, self.products, strict=True))
        known = ([np.concatenate([of[one][k] for one in some]) for k in (0, 1)] for some, *_ in self._alike)
        return self._of_each(self._of_products(log_prior, *next(known)) for *_, log_prior in self._alike)

    def of_family(self, family: FunctionFamily) -> tuple[Floats, Floats]:
        return self._of_products(family.log_prior, *self.products_of(family))

    def _of_products(self, log_prior: Floats | float, products: Floats, seen: Floats) -> tuple[Floats, Floats]:
        strengths, turn = eigen(products)
        strengths = np.maximum(strengths, 0.0)
        along = np.einsum("krs,kr->ks", turn, seen) ** 2
        rms, largest = np.sqrt(strengths.sum(axis=1) / max(self.degrees, 1)), 1 / self.least
        smallest = np.minimum(_SMALLEST / np.maximum(rms, _SMALLEST / largest), largest)
        sizes = largest * (smallest / largest)[:, None] ** np.linspace(0, 1, AMPLITUDES)
        ratio = sizes[:, :, None] ** 2 * strengths[:, None]
        explained = np.sum(sizes[:, :, None] ** 2 / (1 + ratio) * along[:, None], axis=2)
        log = self.integral(self.square - explained) - 0.5 * np.log1p(ratio).sum(axis=2)
        log[rms * largest < _SMALLEST] = -np.inf  # even the largest would not show
        # what shows would be larger than all that is there: two waves that all but cancel at the places read
        sigma = np.maximum(
            np.sqrt(np.maximum(self.square - explained, 0.0)), self.least * np.sqrt(max(self.degrees, 1))
        )
        log[(sizes > sizes[:, -1:]) & (sizes * sigma * rms[:, None] > _LARGER * np.sqrt(self.square))] = -np.inf
        return log + np.reshape(log_prior, (-1, 1)) - np.log(AMPLITUDES), sizes

    def refined(self) -> FunctionFit:
        """The same with finer nodes about those that carry a form that may be the most probable.

        Between two nodes of its grid a form of large size loses more of its evidence than others are behind it.
        """
        best = max(float(log.max(initial=-np.inf)) for log, _ in self.evidence)
        every = list[tuple[FunctionFamily, tuple[Floats, Floats]]]()
        for family, (log, _), known in zip(self.families, self.evidence, self.products, strict=True):
            of_node, most = log.max(axis=1), float(log.max(initial=-np.inf))
            likely = np.argsort(-of_node, kind="stable")[:_NODES]
            likely = likely[of_node[likely] > most + np.log(IMPROBABLE)]
            finer = family.finer(likely) if most - self.nothing > _WORTH_DIVIDING * (best - self.nothing) else None
            if finer is not None:
                every.append((finer, self.products_of(finer)))
                family = family.without(likely)
                known = (np.delete(known[0], likely, axis=0), np.delete(known[1], likely, axis=0))
            if len(known[0]):
                every.append((family, known))
        found = replace(self, families=[family for family, _ in every])
        found.__dict__["products"] = [known for _, known in every]
        return found

    @cached_property
    def total(self) -> float:
        return float(scipy.special.logsumexp(np.concatenate([log.ravel() for log, _ in self.evidence])))

    def versions(self, most: int = _FOLLOWED) -> list[FunctionVersion]:
        """The most probable, with their probability among all functions; of a finer grid the best in each node's place."""
        cells = [_by_cell(log, family.cell) for family, (log, _) in zip(self.families, self.evidence, strict=True)]
        logs = np.concatenate([log.ravel() for log, _ in cells])
        starts = np.cumsum([0, *(log.size for log, _ in cells)])
        first = np.argpartition(-logs, min(most, len(logs) - 1))[:most]
        found = []
        for i in first[np.argsort(-logs[first], kind="stable")].tolist():
            owner = int(np.searchsorted(starts, i, side="right")) - 1
            place, size = divmod(i - int(starts[owner]), AMPLITUDES)
            index, probability = int(cells[owner][1][place, size]), float(np.exp(logs[i] - self.total))
            found.append(FunctionVersion(owner, index, float(self.evidence[owner][1][index, size]), probability))
        return found

    def fitted(self, version: FunctionVersion) -> tuple[Floats, Floats, float]:
        """Coefficients (r,) of a function, their covariance (r, r), mm, and σ: conditional on its size, σ at its mean."""
        products, along = (each[version.index] for each in self.products[version.family])
        inverse = np.linalg.inv(products + np.eye(len(products)) / version.amplitude**2)
        mean = inverse @ along
        square = self.square - float(mean @ along)
        sigma = max(float(np.sqrt(max(square, 0.0) / max(self.degrees, 1))), self.least)
        return mean, np.asarray(inverse * sigma**2), sigma


def _squares(columns: Floats, weighed: Floats) -> Floats:
    """Products (K, r, r) of columns (m, K, r) with others."""
    if columns.shape[2] < 3:
        return np.asarray(np.einsum("mkr,mks->krs", columns, weighed))
    return np.asarray(columns.transpose(1, 2, 0) @ weighed.transpose(1, 0, 2))


def _by_cell(log: Floats, cell: Ints | None) -> tuple[Floats, Ints]:
    """Of functions with logs (K, a) their sums by cells (C, a), and which of each is the most probable, (C, a)."""
    if cell is None:
        return log, np.broadcast_to(np.arange(len(log))[:, None], log.shape)
    starts = np.flatnonzero(np.diff(cell, prepend=-1))
    best = [part.argmax(axis=0) + start for part, start in zip(np.split(log, starts[1:]), starts, strict=True)]
    return np.logaddexp.reduceat(log, starts, axis=0), np.array(best)


@dataclass(frozen=True, eq=False)
class HeldOutErrors:
    """Errors (h,) of what was held out, over the noise scale, and their log density."""

    errors: Floats
    log_density: float


def predictions(whole: FunctionFit, out: NDArray[np.bool_], functions: int) -> tuple[list[HeldOutErrors], int]:
    """Predict the observations ``out`` (m,) from the others without a function, with one, two …; dimensions that are open."""
    order, seen = np.concatenate([np.flatnonzero(~out), np.flatnonzero(out)]), int(np.sum(~out))
    # of noise that the others do not tell
    root = np.linalg.cholesky(whole.covariance[np.ix_(order, order)])[seen:, seen:]
    fold, given, found, lost = whole.without(out), replace(whole, families=()), list[HeldOutErrors](), 0
    for number in range(functions + 1):
        versions = [v for v in fold.versions() if v.probability > IMPROBABLE] if number else []
        none, some = (fold.nothing, fold.total) if number else (0.0, -np.inf)
        share = 1 / (1 + np.exp(np.clip(none - some, -700.0, 700.0)))
        sigma = max(float(np.sqrt(max(fold.square, 0.0) / max(fold.degrees, 1))), fold.least)
        errors, log, lost = _predicted(given, out, root, sigma)
        logs, weights, errors = [log], [max(1 - share, 1e-300)], (1 - share) * errors
        known = sum(v.probability for v in versions)
        for version in versions:
            columns = version.amplitude * whole.families[version.family].columns[:, version.index]
            own, log, _ = _predicted(given.with_noise(columns), out, root, fold.fitted(version)[2])
            weights.append(share * version.probability / known)
            errors = errors + weights[-1] * own
            logs.append(log)
        found.append(HeldOutErrors(root @ errors, float(scipy.special.logsumexp(logs, b=weights))))
        if versions and number < functions:
            columns = versions[0].amplitude * whole.families[versions[0].family].columns[:, versions[0].index]
            fold, given = fold.with_function(versions[0]), given.with_noise(columns)
    return found, lost


def _predicted(given: FunctionFit, out: NDArray[np.bool_], root: Floats, sigma: float) -> tuple[Floats, float, int]:
    """Errors (h,) of what is held out, over its root (h, h), their log density, and dimensions that the others leave open.

    With the precision P of all the errors are P⁺·(P·y) in what is held out, and have the covariance σ²·P⁺.
    """
    values, vectors = np.linalg.eigh(root.T @ given.precision[np.ix_(out, out)] @ root)
    told = values > _OPEN
    values, vectors = values[told], vectors[:, told]
    along = vectors.T @ (root.T @ (given.precision[out] @ given.y)) / values
    log = 0.5 * float(np.sum(np.log(values)) - values @ along**2 / sigma**2)
    return vectors @ along, log - len(values) * float(np.log(sigma * np.sqrt(2 * np.pi))), int(np.sum(~told))


def improvements(result: SearchResult, data: FunctionFit, functions: int) -> list[Improvement]:
    """Before and after by one function, two …, on held-out set-ups, or points of few set-ups."""
    held = _held_out(result, data, functions)
    scale = result.first.comparison.noise_scale
    rms = [float(np.sqrt(np.mean((left * scale) ** 2))) / MICROMETRE for left in residuals(data, functions)]
    return [_compared(held, held, number, rms[0], rms[number]) for number in range(1, functions + 1)]


def improvement_by(result: SearchResult, data: FunctionFit, columns: Floats) -> Improvement:
    """The same of columns (m, k), over the noise scale, that may take any coefficient."""
    more = replace(data, free=np.hstack([data.free, columns]))
    scale = result.first.comparison.noise_scale
    rms = [float(np.sqrt(np.mean((next(residuals(one, 0)) * scale) ** 2))) / MICROMETRE for one in (data, more)]
    return _compared(_held_out(result, data, 0), _held_out(result, more, 0), 0, *rms)


_HeldOut = tuple[Floats, Floats, Text]


def _held_out(result: SearchResult, data: FunctionFit, functions: int) -> _HeldOut:
    """Rms (f,) of held-out errors, µm, log densities (folds, f), without a function, with one, and so on, and of what."""
    groups, unseen = held_out_groups(result.first.model)
    scale, folds = result.first.comparison.noise_scale, min(len(np.unique(groups)), FOLDS)
    squares, count, logs = np.zeros(functions + 1), 0, list[list[float]]()
    for k in range(folds):
        out = np.isin(groups, np.unique(groups)[k::folds])
        each, lost = predictions(data, out, functions)
        squares += [float(np.sum((one.errors * scale[out]) ** 2)) for one in each]
        count += int(out.sum()) - lost
        logs.append([one.log_density for one in each])
    return np.sqrt(squares / max(count, 1)) / MICROMETRE, np.array(logs), unseen


def _compared(before: _HeldOut, after: _HeldOut, number: int, rms: float, rms_after: float) -> Improvement:
    gain = after[1][:, number] - before[1][:, 0]
    se = float(np.sqrt(len(gain)) * gain.std(ddof=1)) if len(gain) > 1 else np.inf
    return Improvement(rms, rms_after, float(before[0][0]), float(after[0][number]), float(gain.sum()), se, before[2])


def residuals(data: FunctionFit, functions: int) -> Iterator[Floats]:
    """What no function leaves of the observations (m,), one, two …, each at its most probable."""
    beside = data
    yield data.covariance @ (data.precision @ data.y)
    for _ in range(functions):
        beside = beside.with_function(beside.versions(1)[0])
        yield data.covariance @ (beside.precision @ data.y)
