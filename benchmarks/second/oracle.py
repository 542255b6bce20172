"""An oracle: a search by likelihood ratios that is given the recording's design and the effects' equations (methods.md).

It is told that noise is white and one kind besides, and estimates which and how large; a second one knows the noise exactly.
Both ask of every effect how much it raises the likelihood, correct for how many forms of it were tried, and raise an alarm
above what noise alone reaches in one of a hundred of their own draws. Nothing here comes from the package.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy import linalg, special, stats

from benchmarks.concealed.physics import kind_of
from benchmarks.second import noises
from benchmarks.second.cases import Case, Seen, baseline, outside, visible
from benchmarks.second.noises import Noise

DRAWS = 199
"""Of noise alone; at most one of them may exceed what is an alarm, so that its rate is one per cent (a rank test)."""
EXCEED = 1
PERIODS = np.geomspace(12, 700, 140)
MOST = 3
STATED_SPREAD, STATED_RIGHT = 0.2, 0.9
"""What a stated noise is worth: good to a fifth, and one time in ten wrong."""


@dataclass(frozen=True, eq=False)
class Forms:
    """Columns of one number of parameters: each form belongs to an effect.

    Parameters
    ----------
    columns : (m, forms, c).
    owner : (forms,) of the effect in the list of names.
    """

    columns: np.ndarray
    owner: np.ndarray


def forms(case: Case) -> tuple[list[str], list[Forms]]:
    """Every effect of the catalogue that the recording could show and the job does not name."""
    placed, among = case.placed, visible(case.placed)
    names = [name for name in among if name not in case.named]
    one: list[tuple[int, np.ndarray]] = []
    two: list[tuple[int, np.ndarray]] = []
    for i, name in enumerate(names):
        if kind_of(name) not in ("periodic_scale", "probe_lobing"):
            one.append((i, -placed.D @ among[name](placed.true, case.context).ravel()))
            continue
        for period in PERIODS if kind_of(name) == "periodic_scale" else [1.0]:
            turned = [
                among[name](placed.true, case.context | {"period": period, "phase": phase}) for phase in (0, np.pi / 2)
            ]
            two.append((i, -placed.D @ np.column_stack([each.ravel() for each in turned])))
    found = [Forms(np.stack([c for _, c in one], axis=1)[:, :, None], np.array([i for i, _ in one]))] if one else []
    if two:
        found.append(Forms(np.stack([c for _, c in two], axis=1), np.array([i for i, _ in two])))
    return names, found


@dataclass(frozen=True, eq=False)
class Shape:
    """A covariance (m, m) of the observations up to its size, and whether it is of Student's t."""

    covariance: np.ndarray
    heavy: bool = False


def shapes(case: Case) -> list[Shape]:
    """White noise with one kind besides, each of a few sizes; only what the recording's columns could show."""
    placed = case.placed
    tried = [Noise("white", 1.0)]
    tried += [Noise("axis", 1.0, axis=a, times=times) for a in range(3) for times in (2.0, 3.0)]
    if placed.repeat.max() > 1:
        tried += [Noise("set-up", 1.0, ratio=ratio) for ratio in (0.5, 1.0, 2.0)]
    tried += [Noise("growing", 1.0, ratio=ratio) for ratio in (1.0, 2.5)]
    if "time_s" in placed.recorded:
        whole = float(np.ptp(placed.recorded["time_s"]))
        tried += [Noise("slow", 1.0, ratio=ratio, forgets=part * whole) for ratio in (1.0, 2.0, 4.0)
                  for part in (0.02, 0.06, 0.2, 0.6)]  # fmt: skip
        tried += [Noise("walk", 1.0, ratio=ratio) for ratio in (1.0, 2.0, 4.0)]
    found = [Shape(noises.of_observations(noises.of_coordinates(noise, placed), placed)) for noise in tried]
    return [*found, replace(found[0], heavy=True)]


@dataclass(frozen=True, eq=False)
class Likelihood:
    """Restricted log likelihood of a residual sum of squares, its noise's size at its best (given what is stated)."""

    count: int
    stated: float | None

    def of(self, squares: np.ndarray) -> np.ndarray:
        """Of sums of squares of any shape, each over a covariance of size one."""
        squares = np.maximum(squares, 1e-300)
        if self.stated is None:
            return np.asarray(-0.5 * self.count * (np.log(squares / self.count) + 1))
        x = np.log(squares)
        grid = np.linspace(float(x.min()) - 0.1, float(x.max()) + 0.1, 400)
        sigma = np.linspace(np.log(self.stated) - 2.5, np.log(self.stated) + 2.5, 300)
        off = (sigma - np.log(self.stated)) / STATED_SPREAD
        prior = np.logaddexp(np.log(STATED_RIGHT) - 0.5 * off**2,
                             np.log((1 - STATED_RIGHT) * STATED_SPREAD) - 0.5 * (off * STATED_SPREAD) ** 2)  # fmt: skip
        best = (-self.count * sigma - 0.5 * np.exp(grid[:, None] - 2 * sigma) + prior).max(axis=1)
        return np.interp(x, grid, best)


def _independent(columns: np.ndarray, before: np.ndarray) -> np.ndarray:
    """Orthonormal columns (m, forms, c); zero where less than 1e-6 of ``before`` is left."""
    found, size = np.zeros_like(columns), np.sqrt(np.sum(before**2, axis=0)).max(axis=-1)
    for j in range(columns.shape[2]):
        rest = columns[:, :, j]
        for i in range(j):
            rest = rest - found[:, :, i] * np.sum(found[:, :, i] * rest, axis=0)
        length = np.linalg.norm(rest, axis=0)
        found[:, :, j] = np.where(length > 1e-6 * size, rest / np.maximum(length, 1e-300), 0.0)
    return found


class Search:
    """How much every form raises the likelihood under every shape.

    Parameters
    ----------
    B : (m, q) baseline.
    covariances : of the shapes.
    stated : standard deviation that the job states; ``None`` where there is none.
    known : the covariances have their true size.
    dof : of Student's t, of the shapes that are heavy.
    """

    def __init__(self, B: np.ndarray, tried: Sequence[Shape], all_forms: Sequence[Forms], stated: float | None,
                 *, known: bool = False, dof: float = 4.0) -> None:  # fmt: skip
        self.B, self.shapes, self.forms, self.known, self.dof = B, tried, all_forms, known, dof
        length = np.linalg.norm(B, axis=0)
        U, s, _ = np.linalg.svd(B / np.where(length > 0, length, 1.0), full_matrices=False)
        self.B = U[:, s > 1e-10 * s[:1].sum()]
        self.count = len(B) - self.B.shape[1]
        self.likelihood = Likelihood(self.count, stated)
        self.roots = [np.linalg.cholesky(shape.covariance) for shape in tried]
        self.times: list[int] = [0] * (1 + max((int(f.owner.max()) for f in all_forms), default=0))
        for each in all_forms:
            for owner in each.owner:
                self.times[owner] += 1

    def of(self, Y: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Log likelihoods of columns Y (m, r): of nothing by shape (shapes, r), and the surprise of each form (forms, r).

        Returns
        -------
        nothing, surprise, sizes : (shapes, r); (forms, r); (shapes, r) standard deviations under nothing.
        """
        nothing, sizes = [], []
        best = [np.full((f.columns.shape[1], Y.shape[1]), -np.inf) for f in self.forms]
        for shape, root in zip(self.shapes, self.roots, strict=True):
            white = _solved(root)
            base, log = self._base(white @ self.B, root)
            R = white @ Y
            R = R - base @ (base.T @ R)
            values, gains, size = (self._heavy if shape.heavy else self._normal)(R, base, white)
            nothing.append(values + log)
            sizes.append(size)
            best = [np.maximum(b, g + log) for b, g in zip(best, gains, strict=True)]
        top = np.max(nothing, axis=0)
        surprise = []
        for f, b in zip(self.forms, best, strict=True):
            rise = np.maximum(2 * (b - top), 0.0)
            many = np.log([self.times[owner] for owner in f.owner])
            surprise.append(-stats.chi2.logsf(rise, f.columns.shape[2]) - many[:, None])
        return np.array(nothing), np.vstack(surprise), np.array(sizes)

    def _base(self, B: np.ndarray, root: np.ndarray) -> tuple[np.ndarray, float]:
        Q, R = np.linalg.qr(B)
        return Q, -float(np.log(np.diag(root)).sum()) - float(np.log(np.abs(np.diag(R))).sum())

    def _projected(self, base: np.ndarray, white: np.ndarray) -> list[np.ndarray]:
        found = []
        for f in self.forms:
            m, many, c = f.columns.shape
            columns = white @ f.columns.reshape(m, -1)
            rest = columns - base @ (base.T @ columns)
            found.append(_independent(rest.reshape(m, many, c), columns.reshape(m, many, c)))
        return found

    def _normal(
        self, R: np.ndarray, base: np.ndarray, white: np.ndarray
    ) -> tuple[np.ndarray, list[np.ndarray], np.ndarray]:
        squares = np.sum(R**2, axis=0)
        of = (lambda s: -0.5 * s) if self.known else self.likelihood.of
        gains = [
            of(squares - sum(np.square(P[:, :, j].T @ R) for j in range(P.shape[2])))
            for P in self._projected(base, white)
        ]
        return of(squares), gains, np.sqrt(squares / self.count)

    def _heavy(
        self, R: np.ndarray, base: np.ndarray, white: np.ndarray
    ) -> tuple[np.ndarray, list[np.ndarray], np.ndarray]:
        """Student's t: the score of each form about the fit without it, over its variance (Rao's test)."""
        dof = self.dof
        unit = np.sqrt((dof - 2) / dof)
        scale = np.full(R.shape[1], unit) if self.known else 1.4826 * np.median(np.abs(R), axis=0) / 1.05
        for _ in range(6):
            score, slope = _score(R, scale, dof)
            R = R - base @ (base.T @ score) / np.mean(slope, axis=0)
            if not self.known:
                weight = (dof + 1) / (dof + (R / scale) ** 2)
                scale = np.sqrt(np.sum(weight * R**2, axis=0) / self.count)
        score, _ = _score(R, scale, dof)
        information = np.mean(score**2, axis=0) * len(R) / self.count
        of_one = (special.gammaln((dof + 1) / 2) - special.gammaln(dof / 2) - 0.5 * np.log(np.pi * dof) - np.log(scale)
                  - 0.5 * (dof + 1) * np.log1p((R / scale) ** 2 / dof))  # fmt: skip
        size = scale / unit
        # as restricted as the normal one: what the baseline takes is taken back, and the constant that is left out there
        values = of_one.sum(axis=0) + 0.5 * len(R) * np.log(2 * np.pi) + (len(R) - self.count) * np.log(size)
        if not self.known and self.likelihood.stated is not None:
            values = values + _belief(size, self.likelihood.stated)
        gains = [
            values + 0.5 * sum(np.square(P[:, :, j].T @ score) for j in range(P.shape[2])) / information
            for P in self._projected(base, white)
        ]
        return values, gains, size


def _belief(size: np.ndarray, stated: float) -> np.ndarray:
    off = np.log(size / stated) / STATED_SPREAD
    return np.logaddexp(np.log(STATED_RIGHT) - 0.5 * off**2,
                        np.log((1 - STATED_RIGHT) * STATED_SPREAD) - 0.5 * (off * STATED_SPREAD) ** 2)  # fmt: skip


def _score(R: np.ndarray, scale: np.ndarray, dof: float) -> tuple[np.ndarray, np.ndarray]:
    """Derivative of −ln t at residuals (m, r), and of that."""
    below = dof * scale**2 + R**2
    return (dof + 1) * R / below, (dof + 1) * (dof * scale**2 - R**2) / below**2


def _solved(root: np.ndarray) -> np.ndarray:
    """The inverse of a lower triangle."""
    return np.asarray(linalg.solve_triangular(root, np.eye(len(root)), lower=True))


@dataclass(frozen=True)
class Found:
    """What an oracle finds: the effects, most surprising first, and where the first stands among draws of noise alone."""

    effects: tuple[str, ...]
    p_value: float


def searched(case: Case, *, knows_noise: bool, seed: int = 0) -> Found:
    """Effects found one after the other until none is more surprising than noise alone makes one in a hundred."""
    return searched_among(case, *forms(case), knows_noise=knows_noise, seed=seed)


def known_forms(case: Case, seed: int = 0) -> tuple[float, bool]:
    """What could be seen at all of functions outside the catalogue: told the form, not the size or the noise.

    Returns
    -------
    p_value : of the likelihood ratio of these functions alone, among draws of noise alone.
    named : whether they are what a search finds that has them in its catalogue.
    """
    hidden = case.truth["hidden"]
    columns = [-case.placed.D @ outside(case.placed)[name](case.placed.true, case.context).ravel() for name in hidden]
    alone = Forms(np.stack(columns, axis=1)[:, :, None], np.arange(len(columns)))
    seen = searched_among(case, list(hidden), [alone], knows_noise=False, seed=seed)
    names, catalogue = forms(case)
    more = Forms(alone.columns, alone.owner + len(names))
    found = searched_among(case, [*names, *hidden], [*catalogue, more], knows_noise=False, seed=seed)
    return seen.p_value, set(hidden) <= set(found.effects)


def searched_among(
    case: Case, names: Sequence[str], all_forms: Sequence[Forms], *, knows_noise: bool, seed: int
) -> Found:
    """See :func:`searched`, among forms of what is named."""
    random = np.random.default_rng([seed, int(knows_noise)])
    covariance = noises.of_observations(noises.of_coordinates(case.noise, case.placed), case.placed)
    seen = Seen(case.placed, case.named, case.certified, covariance, case.context, case.noise.sigma)
    B = baseline(seen)
    heavy = case.noise.kind == "tails"
    tried = [Shape(covariance, heavy)] if knows_noise else shapes(case)

    def search(base: np.ndarray) -> Search:
        stated = None if knows_noise else case.stated
        return Search(
            base, tried, all_forms, stated, known=knows_noise, dof=case.noise.dof if knows_noise and heavy else 4.0
        )

    first = search(B)
    nothing, surprise, sizes = first.of(case.y[:, None])
    draws = _drawn(random, first, nothing[:, 0], sizes[:, 0], knows_noise)
    reached = np.sort(first.of(draws)[1].max(axis=0))[::-1]
    threshold = float(reached[EXCEED])
    p = float((1 + np.sum(reached >= surprise.max())) / (DRAWS + 1))
    found: list[str] = []
    owner = np.concatenate([f.owner for f in all_forms])
    column = [f.columns[:, i] for f in all_forms for i in range(f.columns.shape[1])]
    while surprise.max() > threshold and len(found) < MOST:
        best = int(surprise[:, 0].argmax())
        found.append(names[owner[best]])
        B = np.hstack([B, column[best]])
        surprise = search(B).of(case.y[:, None])[1]
    return Found(tuple(dict.fromkeys(found)), p)


def _drawn(
    random: np.random.Generator, search: Search, nothing: np.ndarray, sizes: np.ndarray, known: bool
) -> np.ndarray:
    """Noise alone (m, draws) as the recording itself says it is: of a shape by its likelihood, of the size found with it."""
    weight = np.exp(nothing - nothing.max())
    chosen = random.choice(len(weight), DRAWS, p=weight / weight.sum())
    found = np.empty((len(search.B), DRAWS))
    for i, k in enumerate(chosen):
        z = random.standard_normal(len(found))
        if search.shapes[k].heavy:
            z = random.standard_t(search.dof, len(found)) / np.sqrt(search.dof / (search.dof - 2))
        found[:, i] = (1.0 if known else sizes[k]) * (search.roots[k] @ z)
    return found
