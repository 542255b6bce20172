"""How probable each function is, in closed form, and what all of them together predict where they were not fitted."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import cached_property

import numpy as np
import scipy
from numpy.typing import NDArray

from cmm_uq.analysis.diagnosis.comparison.algebra import SigmaIntegral, eigen
from cmm_uq.analysis.diagnosis.comparison.conditional import AMPLITUDES
from cmm_uq.analysis.diagnosis.comparison.lack_of_form import likeliest_noise
from cmm_uq.analysis.diagnosis.comparison.search import SearchResult
from cmm_uq.analysis.diagnosis.empirical.functions import FunctionFamily
from cmm_uq.analysis.diagnosis.held_out import FOLDS, Improvement, held_out_groups
from cmm_uq.base.messages import Text
from cmm_uq.base.points import Floats, Ints
from cmm_uq.base.units import MICROMETRE
from cmm_uq.base.values import dataclass, replace

_SMALLEST = 0.4  # smallest rms of a function that is considered, over the noise
_FOLLOWED, IMPROBABLE = 40, 1e-3  # versions that a prediction averages, and what a version adds to it at least
# Part of the largest log evidence over nothing from which on a form may come first between its nodes, and how many of these
_WORTH_DIVIDING, _NODES = 0.5, 6
_SINGULAR = 1e-9  # part of the largest singular value below which another counts as zero


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
        return self.with_columns(version.amplitude * self.families[version.family].columns[:, version.index])

    def with_columns(self, columns: Floats) -> FunctionFit:
        return replace(self, covariance=self.covariance + columns @ columns.T)

    def at(self, rows: NDArray[np.bool_] | Ints) -> FunctionFit:
        every = [replace(family, columns=family.columns[rows]) for family in self.families]
        covariance = self.covariance[np.ix_(rows, rows)]
        return replace(self, y=self.y[rows], free=self.free[rows], covariance=covariance, families=every)

    @cached_property
    def root(self) -> Floats:
        return np.asarray(np.linalg.cholesky(self.covariance))

    def white(self, columns: Floats) -> Floats:
        """Columns (m, …) whose noise is white."""
        flat = columns.reshape(len(columns), -1)
        white = scipy.linalg.solve_triangular(self.root, flat, lower=True, check_finite=False)
        return np.asarray(white).reshape(columns.shape)

    @cached_property
    def told(self) -> tuple[Floats, Floats, Floats]:
        """Basis (m, q) that the free columns reach, coefficients (p, q) of it, and (p, p − q) of what stays open."""
        white = self.white(self.free)
        length = np.linalg.norm(white, axis=0)
        length[length == 0] = 1.0
        U, s, Vt = np.linalg.svd(white / length, full_matrices=len(white) < white.shape[1])
        rank = int(np.sum(s > _SINGULAR * s.max(initial=0.0)))
        return U[:, :rank], (Vt[:rank].T / s[:rank]) / length[:, None], Vt[rank:].T / length[:, None]

    def rest(self, columns: Floats) -> Floats:
        """What the free columns leave of others (m, …), whitened."""
        white, basis = self.white(columns), self.told[0]
        flat = white.reshape(len(white), -1)
        return np.asarray(flat - basis @ (basis.T @ flat)).reshape(white.shape)

    @cached_property
    def degrees(self) -> int:
        return int(len(self.y) - self.told[0].shape[1])

    @cached_property
    def left(self) -> Floats:
        return self.rest(self.y)

    @cached_property
    def integral(self) -> SigmaIntegral:
        return SigmaIntegral(self.sigma, self.log_sigma, self.degrees, float(self.left @ self.left))

    @cached_property
    def nothing(self) -> float:
        """Log evidence of no function."""
        return float(self.integral(np.array([self.left @ self.left]))[0])

    @cached_property
    def evidence(self) -> list[tuple[Floats, Floats]]:
        """Of each family the log of evidence and prior of its functions at every size, and these sizes, each (K, a)."""
        return [self.of_family(family) for family in self.families]

    def of_family(self, family: FunctionFamily) -> tuple[Floats, Floats]:
        z = self.rest(family.columns)
        products = np.einsum("mkr,mks->krs", z, z) if z.shape[2] < 3 else z.transpose(1, 2, 0) @ z.transpose(1, 0, 2)
        strengths, turn = eigen(products) if z.shape[2] > 1 else (products[:, 0], np.ones_like(products))
        strengths = np.maximum(strengths, 0.0)
        along = np.einsum("krs,kr->ks", turn, np.tensordot(self.left, z, 1)) ** 2
        rms, largest = np.sqrt(strengths.sum(axis=1) / max(self.degrees, 1)), 1 / self.least
        smallest = np.minimum(_SMALLEST / np.maximum(rms, _SMALLEST / largest), largest)
        sizes = largest * (smallest / largest)[:, None] ** np.linspace(0, 1, AMPLITUDES)
        ratio = sizes[:, :, None] ** 2 * strengths[:, None]
        explained = np.sum(sizes[:, :, None] ** 2 / (1 + ratio) * along[:, None], axis=2)
        log = self.integral(float(self.left @ self.left) - explained) - 0.5 * np.log1p(ratio).sum(axis=2)
        log[rms * largest < _SMALLEST] = -np.inf  # even the largest would not show
        return log + family.log_prior - np.log(AMPLITUDES), sizes

    def refined(self) -> FunctionFit:
        """The same with finer nodes about those that carry a form that may be the most probable.

        Between two nodes of its grid a form of large size loses more of its evidence than others are behind it.
        """
        best = max(float(log.max(initial=-np.inf)) for log, _ in self.evidence)
        families, known = list[FunctionFamily](), list[tuple[Floats, Floats]]()
        for family, (log, sizes) in zip(self.families, self.evidence, strict=True):
            of_node, most = log.max(axis=1), float(log.max(initial=-np.inf))
            likely = np.argsort(-of_node, kind="stable")[:_NODES]
            likely = likely[of_node[likely] > most + np.log(IMPROBABLE)]
            finer = family.finer(likely) if most - self.nothing > _WORTH_DIVIDING * (best - self.nothing) else None
            if finer is not None:
                families.append(finer)
                known.append(self.of_family(finer))
                family = family.without(likely)
                log, sizes = (np.delete(each, likely, axis=0) for each in (log, sizes))
            if len(log):
                families.append(family)
                known.append((log, sizes))
        found = replace(self, families=families)
        found.__dict__["evidence"] = known
        return found

    @cached_property
    def total(self) -> float:
        return float(scipy.special.logsumexp([scipy.special.logsumexp(log) for log, _ in self.evidence]))

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
        z = self.rest(self.families[version.family].columns[:, version.index])
        inverse = np.linalg.inv(z.T @ z + np.eye(z.shape[1]) / version.amplitude**2)
        mean = inverse @ (z.T @ self.left)
        square = float(self.left @ self.left - mean @ (z.T @ self.left))
        sigma = max(float(np.sqrt(max(square, 0.0) / max(self.degrees, 1))), self.least)
        return mean, np.asarray(inverse * sigma**2), sigma


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
    fold, ordered, found = whole.at(~out), replace(whole, families=()).at(order), list[HeldOutErrors]()
    root_of_noise = ordered.root[seen:, seen:]
    lost = 0
    for number in range(functions + 1):
        basis, among, loose = fold.told
        versions = [v for v in fold.versions() if v.probability > IMPROBABLE] if number else []
        columns = [whole.families[v.family].columns[order, v.index] for v in versions]
        white = ordered.white(np.hstack([ordered.y[:, None], ordered.free, *columns]))
        p = 1 + ordered.free.shape[1]
        reach = white[seen:, 1:p] @ among
        ends = np.cumsum([0, *(each.shape[1] for each in columns)])
        beyond = np.delete(white, slice(1, p), axis=1)
        beyond = beyond[seen:] - reach @ (basis.T @ beyond[:seen])
        U, s, _ = np.linalg.svd(white[seen:, 1:p] @ loose, full_matrices=False)
        U = U[:, s > _SINGULAR * max(float(s.max(initial=0.0)), 1e-300)] if s.size else U[:, :0]
        beyond, reach, lost = (beyond - U @ (U.T @ beyond), reach - U @ (U.T @ reach), U.shape[1])
        none = fold.nothing if number else 0.0
        some = fold.total if number else -np.inf
        share = 1 / (1 + np.exp(np.clip(none - some, -700.0, 700.0)))
        sigma = max(float(np.linalg.norm(fold.left)) / np.sqrt(max(fold.degrees, 1)), fold.least)
        errors = (1 - share) * beyond[:, 0]
        logs, weights = [_log_density(beyond[:, 0], reach, sigma, lost)], [max(1 - share, 1e-300)]
        known = sum(v.probability for v in versions)
        for k, version in enumerate(versions):
            own, weight = beyond[:, 1 + ends[k] : 1 + ends[k + 1]], share * version.probability / known
            mean, covariance, sigma = fold.fitted(version)
            root = np.linalg.cholesky(covariance / sigma**2)
            errors = errors + weight * (beyond[:, 0] - own @ mean)
            logs.append(_log_density(beyond[:, 0] - own @ mean, np.hstack([reach, own @ root]), sigma, lost))
            weights.append(weight)
        found.append(HeldOutErrors(root_of_noise @ errors, float(scipy.special.logsumexp(logs, b=weights))))
        if number and versions:
            fold, ordered = fold.with_function(versions[0]), ordered.with_columns(versions[0].amplitude * columns[0])
    return found, lost


def _log_density(error: Floats, factor: Floats, sigma: float, lost: int) -> float:
    """Of errors (h,), mm, with the covariance σ²·(1 + factor·factorᵀ), in h less the dimensions that are lost."""
    U, s, _ = np.linalg.svd(factor, full_matrices=False)
    seen = U.T @ error / sigma
    rest = error / sigma - U @ seen
    log = -0.5 * float(rest @ rest + np.sum(seen**2 / (1 + s**2)) + np.sum(np.log1p(s**2)))
    return log - (len(error) - lost) * float(np.log(sigma * np.sqrt(2 * np.pi)))


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


@dataclass(frozen=True, eq=False)
class _HeldOut:
    """Rms (f,) of held-out errors, µm, and log densities (folds, f), without a function, with one, and so on."""

    rms: Floats
    density: Floats
    unseen: Text


def _held_out(result: SearchResult, data: FunctionFit, functions: int) -> _HeldOut:
    groups, unseen = held_out_groups(result.first.model)
    scale, folds = result.first.comparison.noise_scale, min(len(np.unique(groups)), FOLDS)
    squares, count, logs = np.zeros(functions + 1), 0, list[list[float]]()
    for k in range(folds):
        out = np.isin(groups, np.unique(groups)[k::folds])
        each, lost = predictions(data, out, functions)
        squares += [float(np.sum((one.errors * scale[out]) ** 2)) for one in each]
        count += int(out.sum()) - lost
        logs.append([one.log_density for one in each])
    return _HeldOut(np.sqrt(squares / max(count, 1)) / MICROMETRE, np.array(logs), unseen)


def _compared(before: _HeldOut, after: _HeldOut, number: int, rms: float, rms_after: float) -> Improvement:
    gain = after.density[:, number] - before.density[:, 0]
    se = float(np.sqrt(len(gain)) * gain.std(ddof=1)) if len(gain) > 1 else np.inf
    held = float(before.rms[0]), float(after.rms[number])
    return Improvement(rms, rms_after, *held, float(gain.sum()), se, before.unseen)


def residuals(data: FunctionFit, functions: int) -> Iterator[Floats]:
    """What no function leaves of the observations (m,), one, two …, each at its most probable."""
    given = np.zeros((len(data.y), 0))
    beside = data
    for number in range(functions + 1):
        z = data.rest(given)
        mean = np.linalg.solve(z.T @ z + np.eye(z.shape[1]), z.T @ data.left)
        basis, among, _ = data.told
        rest = data.y - given @ mean
        yield rest - data.free @ (among @ (basis.T @ data.white(rest)))
        if number < functions:
            version = beside.versions(1)[0]
            beside = beside.with_function(version)
            columns = version.amplitude * data.families[version.family].columns[:, version.index]
            given = np.hstack([given, columns])
