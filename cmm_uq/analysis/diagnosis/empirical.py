"""What was located and no effect names, modelled: functions of what is recorded, averaged by their evidence, and their form.

y = B·b + F·a + ε, with b free (the job's model, what was asserted, where the artefact stands), F the columns of one function
and ε the noise that the comparison found most probable. Functions are smooth (Gaussian processes) or have a form of
:mod:`~cmm_uq.analysis.diagnosis.forms`; sizes are spread evenly in their logarithm up to what physics allows, and σ is
integrated over. Held-out set-ups are predicted by all functions as the other set-ups alone weigh them: the choice is made anew
wherever it is judged. A further function is looked for beside the most probable one where it has odds of 20 : 1.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
import scipy
from numpy.typing import NDArray

from cmm_uq.analysis.diagnosis.comparison.algebra import SigmaIntegral, eigen
from cmm_uq.analysis.diagnosis.comparison.conditional import AMPLITUDES
from cmm_uq.analysis.diagnosis.comparison.explanations import UNKNOWN, UNKNOWN_SD, mean_of, smooth_functions
from cmm_uq.analysis.diagnosis.comparison.search import SearchResult
from cmm_uq.analysis.diagnosis.forms import BOWL, PRODUCT, SMOOTH, Form, forms_of
from cmm_uq.analysis.diagnosis.held_out import FOLDS, Improvement, held_out_groups
from cmm_uq.analysis.diagnosis.location import without_unseen
from cmm_uq.base.messages import Text, Verbatim, say
from cmm_uq.base.points import AXES, Floats, Ints
from cmm_uq.base.units import MICROMETRE, unit
from cmm_uq.jobs.columns import in_words
from cmm_uq.maths.uncertainty.quantity import Quantity

_SMALLEST = 0.4  # smallest rms of a function that is considered, over the noise
ODDS = 20.0  # of a further function over none, and of a form over all else, from which it is told
_MOST = 3  # functions together
_FOLLOWED, _IMPROBABLE = 40, 1e-3  # versions that a prediction averages, and what a version adds to it at least
_TURNED = 0.3  # how readily a curve of rotation is thought of, beside a displacement
_TOLD, _ALSO = 0.01, 0.05  # probability from which a form, and another term, is told
_SINGULAR = 1e-9  # part of the largest singular value below which another counts as zero
_SEEN = 1e-9  # mm, length of columns for a size that physics allows
_PARTS = np.array([-0.5, -0.375, -0.25, -0.125, 0.0, 0.125, 0.25, 0.375, 0.5])  # of the distance of two nodes
_KNOTS, _STRAIGHT = (
    13,
    1e-3,
)  # of the broken line that stands for a smooth curve; part of its size that a bend is, at least
_PRIOR = 3.0  # what its size may be in another recording, over what was found


@dataclass(frozen=True)
class Term:
    """What a function is of, and what it changes."""

    of: str  # covariates, joined by a comma
    title: Text = field(compare=False)
    along: str | None = None  # axis that points move along; None for a term of the observations themselves
    lever: str | None = None  # axis in proportion to whose reading they do
    # what its size is proportional to, and what the covariate is called in a formula
    factor: str = field(default="", compare=False)
    variable: str = field(default="", compare=False)


Seen = Callable[[Floats], Floats]


@dataclass(frozen=True, eq=False)
class Family:
    """Functions of one term and form, K of them."""

    term: Term
    form: str
    columns: Floats  # (m, K, r) over the noise scale, for the size that physics allows
    log_prior: float  # of each
    covariate: Floats  # (p,), and values: (p, K, r) the functions there, mm
    values: Floats
    shaped: Form | None = None
    seen: Seen | None = None
    formula: str = ""

    @property
    def parameters(self) -> tuple[str, ...]:
        return self.shaped.parameters if self.shaped else ()

    def divided(self, likely: Ints) -> Family:
        """The same form with finer nodes about some that are likely (l,)."""
        form, seen = self.shaped, self.seen
        if form is None or seen is None or not form.parameters:
            return self
        part = np.stack(np.meshgrid(*[_PARTS] * len(form.parameters), indexing="ij"), axis=-1).reshape(
            -1, len(form.parameters)
        )
        shapes = (form.shapes[likely][:, None] + part * form.apart[likely][:, None]).reshape(-1, part.shape[1])
        lengths = [k for k, name in enumerate(form.parameters) if name in ("width", "reach", "period")]
        kept = np.all(shapes[:, lengths] > 0, axis=1)
        apart = np.repeat(form.apart[likely], len(part), axis=0) / len(_PARTS)
        finer = replace(form, shapes=shapes[kept], apart=apart[kept])
        return _of_form(self.term, finer, seen, self.covariate, self.log_prior)


@dataclass(frozen=True)
class Version:
    """One function at one size; ``probability`` among all."""

    family: int
    index: int
    amplitude: float  # standard deviation of its coefficients, in units of the noise
    probability: float = 1.0


@dataclass(frozen=True)
class NamedForm:
    """A form that has odds of 20 : 1 over every other function."""

    name: str
    probability: float
    parameters: dict[str, Quantity]  # its size, and what shapes it


@dataclass(frozen=True, eq=False)
class EmpiricalFunction:
    """A function that was fitted."""

    term: Term
    probability: float  # that it is this term
    forms: tuple[tuple[str, float], ...]  # that are probable for it, most probable first
    form: NamedForm | None
    also: tuple[Text, ...]  # other terms that are probable
    amplitude_um: float  # largest value
    # covariate, function and its standard uncertainty in µm, each (p,); empty of two covariates, and of directions
    curve: tuple[Floats, Floats, Floats]
    # lowest and highest of the covariate among the points of each observation, and what the model leaves of it, µm, each (m,)
    data: tuple[Floats, Floats, Floats]
    stated: str  # as ``[[effect]]`` of a job; empty where it moves no points


@dataclass(frozen=True, eq=False)
class EmpiricalModel:
    """Functions that held-out set-ups bear out."""

    functions: tuple[EmpiricalFunction, ...]
    improvement: Improvement
    predicts: bool  # whether the gain is larger than its standard error, and the held-out rms not


def families_of(result: SearchResult) -> list[Family]:
    """All functions of a recording, each term as probable as another."""
    found = list(_of_points(result)) + list(_of_observations(result))
    terms = len({family.term for family in found})
    seen = (family for family in found if np.linalg.norm(family.columns, axis=(0, 2)).max() > _SEEN)
    return [replace(family, log_prior=family.log_prior - float(np.log(terms))) for family in seen]


def _of_form(term: Term, form: Form, seen: Seen, covariate: Floats, log_prior: float) -> Family:
    values = UNKNOWN_SD * form.values(covariate, form.shapes)
    columns = seen(values.reshape(len(values), -1)).reshape(-1, *values.shape[1:])
    return Family(term, form.name, columns, log_prior, covariate, values, form, seen, form.formula)


def _families(
    term: Term, seen: Seen, covariate: Floats, *, forms: bool = True, weight: float = 1.0
) -> Iterator[Family]:
    """Of one covariate (p,); ``seen`` gives the columns (m, q) of functions (p, q)."""
    log = float(np.log(weight)) - (float(np.log(2)) if forms else 0.0)
    smooth = list(smooth_functions(covariate))
    for f in smooth:
        yield Family(term, SMOOTH, seen(f)[:, None], log - float(np.log(len(smooth))), covariate, f[:, None])
    every = list(forms_of(covariate, time=term.of == "time_s")) if forms else []
    for form in every:
        yield _of_form(term, form, seen, covariate, log - float(np.log(len(every) * len(form.shapes))))


def _of_points(result: SearchResult) -> Iterator[Family]:
    model, values, scale = result.first.model, result.first.values, result.first.comparison.noise_scale
    points = model.artefact.points.at(model.where(values))
    readings = {axis: read for axis, read in points.readings.items() if np.ptp(read) > 1.0}
    middle = {axis: 0.5 * (read.min() + read.max()) for axis, read in readings.items()}
    arms = {axis: (read - middle[axis]) / (0.5 * np.ptp(read)) for axis, read in readings.items()}

    def moving(along: str, lever: Floats | float = 1.0) -> Seen:
        def seen(f: Floats) -> Floats:
            e = np.zeros((len(f), 3, f.shape[1]))
            e[:, AXES.index(along)] = (np.asarray(lever) * f.T).T
            return np.asarray(model.seen(e, values) / scale[:, None])

        return seen

    time = points.columns.get("time_s")
    timed = time is not None and len(np.unique(time)) > 2
    for along in AXES:
        for axis, read in readings.items():
            yield from _families(_curve(along, axis), moving(along), read)
            for lever in (other for other in readings if other not in (axis, along)):
                term = _turning(along, axis, lever, middle[lever], 0.5 * float(np.ptp(readings[lever])))
                yield from _families(term, moving(along, arms[lever]), read, forms=False, weight=_TURNED)
        for axis, other in (pair for pair in ("xy", "yz", "zx") if readings.keys() >= set(pair)):
            u, v = arms[axis], arms[other]
            for name, f in ((PRODUCT, (u * v)[:, None]), (BOWL, np.column_stack([u**2, v**2]))):
                of = Term(f"{axis}_mm,{other}_mm", say(
                    "error along {direction} as a function of {axis} and {other}", direction=_letter(along),
                    axis=_letter(axis), other=_letter(other),
                ), along)  # fmt: skip
                columns, (p, q) = moving(along)(UNKNOWN_SD * f)[:, None], (_arm(a, readings[a]) for a in (axis, other))
                formula = f"{p}*{q}" if name == PRODUCT else f"{p}**2;{q}**2"
                nowhere = np.zeros((0, 1, f.shape[1]))
                yield Family(of, name, columns, -float(np.log(2)), np.zeros(0), nowhere, formula=formula)
        if timed and along in readings:
            half = 0.5 * float(np.ptp(readings[along]))
            title = say("scale of {axis} as a function of time", axis=_letter(along))
            since = f"(time_s + {points.start!r})" if points.start else "time_s"
            term = Term("time_s", title, along, along, f"*{along}/{half!r}", since)
            yield from _families(term, moving(along, readings[along] / half), np.asarray(time))


def _of_observations(result: SearchResult) -> Iterator[Family]:
    model, scale = result.first.model, result.first.comparison.noise_scale
    for key, column in model.artefact.points.columns.items():
        mean = mean_of(model, column)
        if len(np.unique(mean)) > 2:
            title = say("error as a function of {name}", name=in_words(key))
            yield from _families(Term(key, title), lambda f: f / scale[:, None], mean)
    for one in (e for e in result.first.explanations if e.kind == UNKNOWN and e.covariate is None):
        for member in one.members:
            columns = (member.columns / scale[:, None])[:, None]
            log = -float(np.log(len(one.members)))
            values = np.zeros((0, *columns.shape[1:]))
            yield Family(Term(str(one.name), one.name), SMOOTH, columns, log, np.zeros(0), values)


def _letter(axis: str) -> Text:
    return Verbatim(axis.upper())


def _curve(along: str, axis: str) -> Term:
    words = say("error along {direction} as a function of {axis}", direction=_letter(along), axis=_letter(axis))
    return Term(f"{axis}_mm", words, along, variable=axis)


def _turning(along: str, axis: str, lever: str, middle: float, half: float) -> Term:
    title = say(
        "error along {direction} as a function of {axis}, in proportion to {lever}",
        direction=_letter(along), axis=_letter(axis), lever=_letter(lever),
    )  # fmt: skip
    return Term(f"{axis}_mm", title, along, lever, f"*({lever} - {middle!r})/{half!r}", axis)


def _arm(axis: str, readings: Floats) -> str:
    low, span = float(readings.min()), float(np.ptp(readings))
    return f"(({axis} - {low + 0.5 * span!r})/{0.5 * span!r})"


@dataclass(frozen=True, eq=False)
class Data:
    """Observations (m,) whose noise has the covariance C·σ², and columns (m, p) that may take any coefficient."""

    y: Floats
    free: Floats
    covariance: Floats
    families: Sequence[Family]
    sigma: Floats  # sigma, log_sigma: grid of the noise, and its log probability
    log_sigma: Floats
    least: float  # mm, the least that the noise may be

    @classmethod
    def of(cls, result: SearchResult, families: Sequence[Family]) -> Data:
        """Under the noise that is most probable beside what was found."""
        comparison = result.first.comparison
        kind = comparison.kinds[int(comparison.noise_probability(result.versions).argmax())]
        root = kind.coloured(np.eye(len(comparison.observed)))
        covariance = root @ root.T
        for columns in (kind.slow, comparison.certified):
            if columns.size:
                covariance = covariance + columns @ columns.T
        grid = comparison.sigma, comparison.log_sigma, comparison.least_noise
        return cls(comparison.observed, result.last.baseline, covariance, families, *grid)

    def with_function(self, version: Version) -> Data:
        """The same with one function more, as noise of its size."""
        return self.with_columns(version.amplitude * self.families[version.family].columns[:, version.index])

    def with_columns(self, columns: Floats) -> Data:
        return replace(self, covariance=self.covariance + columns @ columns.T)

    def at(self, rows: NDArray[np.bool_] | Ints) -> Data:
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
        return [self._of(family) for family in self.families]

    def _of(self, family: Family) -> tuple[Floats, Floats]:
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

    @cached_property
    def total(self) -> float:
        """Log evidence of any function."""
        return float(scipy.special.logsumexp([scipy.special.logsumexp(log) for log, _ in self.evidence]))

    def versions(self, most: int = _FOLLOWED) -> list[Version]:
        """The most probable, with their probability among all functions."""
        logs = np.concatenate([log.ravel() for log, _ in self.evidence])
        starts = np.cumsum([0, *(log.size for log, _ in self.evidence)])
        first = np.argpartition(-logs, min(most, len(logs) - 1))[:most]
        found = []
        for i in first[np.argsort(-logs[first], kind="stable")].tolist():
            owner = int(np.searchsorted(starts, i, side="right")) - 1
            index, size = divmod(i - int(starts[owner]), AMPLITUDES)
            probability = float(np.exp(logs[i] - self.total))
            found.append(Version(owner, index, float(self.evidence[owner][1][index, size]), probability))
        return found

    def fitted(self, version: Version) -> tuple[Floats, Floats, float]:
        """Coefficients (r,) of a function, their covariance (r, r), mm, and σ: conditional on its size, σ at its mean."""
        z = self.rest(self.families[version.family].columns[:, version.index])
        inverse = np.linalg.inv(z.T @ z + np.eye(z.shape[1]) / version.amplitude**2)
        mean = inverse @ (z.T @ self.left)
        square = float(self.left @ self.left - mean @ (z.T @ self.left))
        sigma = max(float(np.sqrt(max(square, 0.0) / max(self.degrees, 1))), self.least)
        return mean, np.asarray(inverse * sigma**2), sigma


@dataclass(frozen=True, eq=False)
class Prediction:
    """Errors (h,) of what was held out, over the noise scale, and their log density."""

    errors: Floats
    log_density: float


def predictions(whole: Data, out: NDArray[np.bool_], functions: int) -> tuple[list[Prediction], int]:
    """Predict the observations ``out`` (m,) from the others without a function, with one, two …; dimensions that are open."""
    order, seen = np.concatenate([np.flatnonzero(~out), np.flatnonzero(out)]), int(np.sum(~out))
    fold, ordered, found = whole.at(~out), replace(whole, families=()).at(order), list[Prediction]()
    root_of_noise = ordered.root[seen:, seen:]
    lost = 0
    for number in range(functions + 1):
        basis, among, loose = fold.told
        versions = [v for v in fold.versions() if v.probability > _IMPROBABLE] if number else []
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
        found.append(Prediction(root_of_noise @ errors, float(scipy.special.logsumexp(logs, b=weights))))
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


def improvements(result: SearchResult, data: Data, functions: int) -> list[Improvement]:
    """Before and after by one function, two …, on held-out set-ups, or points of few set-ups."""
    groups, unseen = held_out_groups(result.first.model)
    scale, folds = result.first.comparison.noise_scale, min(len(np.unique(groups)), FOLDS)
    squares, count, logs = np.zeros(functions + 1), 0, list[list[float]]()
    for k in range(folds):
        out = np.isin(groups, np.unique(groups)[k::folds])
        each, lost = predictions(data, out, functions)
        squares += [float(np.sum((one.errors * scale[out]) ** 2)) for one in each]
        count += int(out.sum()) - lost
        logs.append([one.log_density for one in each])
    density, held = np.array(logs), np.sqrt(squares / max(count, 1)) / MICROMETRE
    rms = [float(np.sqrt(np.mean((left * scale) ** 2))) / MICROMETRE for left in residuals(data, functions)]
    found = []
    for gain, after, left in zip((density[:, 1:] - density[:, :1]).T, held[1:], rms[1:], strict=True):
        se = float(np.sqrt(len(gain)) * gain.std(ddof=1)) if len(gain) > 1 else np.inf
        found.append(Improvement(rms[0], left, float(held[0]), float(after), float(gain.sum()), se, unseen))
    return found


def residuals(data: Data, functions: int) -> Iterator[Floats]:
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


def empirical_model(result: SearchResult) -> EmpiricalModel | None:
    """What functions of what is recorded make of the misfit; nothing where none has odds of 20 : 1."""
    data = Data.of(result, families_of(result))
    if not data.families or not data.degrees:
        return None
    beside, described = data, list[EmpiricalFunction]()
    while len(described) < _MOST and beside.total - beside.nothing > np.log(ODDS):
        described.append(_described(beside, result))
        beside = beside.with_function(beside.versions(1)[0])
    if not described:
        return None
    gains = improvements(result, data, len(described))
    chosen = 0
    for i, gain in enumerate(gains[1:], 1):  # a further function is kept where it predicts better than those before it
        if gain.elpd_gain - gains[chosen].elpd_gain > gain.elpd_gain_se and (
            gain.heldout_rms_after_um < gains[chosen].heldout_rms_after_um
        ):
            chosen = i
    gain = gains[chosen]
    better = gain.elpd_gain > gain.elpd_gain_se and gain.heldout_rms_after_um < gain.heldout_rms_before_um
    return EmpiricalModel(tuple(described[: chosen + 1]), gain, better)


def _described(data: Data, result: SearchResult) -> EmpiricalFunction:
    by: dict[Term, dict[str, float]] = {}
    for family, (log, _) in zip(data.families, data.evidence, strict=True):
        of_term = by.setdefault(family.term, {})
        share = float(np.exp(scipy.special.logsumexp(log) - data.total))
        of_term[family.form] = of_term.get(family.form, 0.0) + share
    order = sorted(by, key=lambda one: -sum(by[one].values()))
    term, probability = order[0], sum(by[order[0]].values())
    forms = sorted(by[term].items(), key=lambda item: -item[1])
    name, most = forms[0]
    chosen = [i for i, family in enumerate(data.families) if family.term == term]
    own = [i for i in chosen if data.families[i].form == name]
    x, y, u = _function(data, chosen)
    form, stated = None, ""
    if name != SMOOTH and (most >= ODDS / (1 + ODDS) or not len(x)):
        form, stated = _named(data, own, name, most)
        form = form if most >= ODDS / (1 + ODDS) else None
    elif len(x) and term.along is not None:
        stated = _stated(term, [_broken_line(x, y)], [float(np.abs(y).max())])
    also = tuple(other.title for other in order[1:4] if sum(by[other].values()) > _ALSO)
    amplitude = float(np.abs(y).max()) if len(y) else _amplitude(data)
    told = tuple((one, p) for one, p in forms if p > _TOLD)
    return EmpiricalFunction(
        term, probability, told, form, also, amplitude, (x, y, u), _seen(data, result, chosen[0]), stated
    )


def _seen(data: Data, result: SearchResult, family: int) -> tuple[Floats, Floats, Floats]:
    covariate, model = data.families[family].covariate, result.first.model
    rows = model.artefact.rows[model.used]
    each = (
        covariate[:, None] if len(covariate) == len(rows) else covariate[rows] if len(covariate) else np.zeros((0, 1))
    )
    left = next(residuals(data, 0)) * result.first.comparison.noise_scale / MICROMETRE
    return each.min(axis=1, initial=np.inf), each.max(axis=1, initial=-np.inf), left[: len(each)]


def _among(data: Data, chosen: Sequence[int]) -> list[tuple[Version, float]]:
    """Versions of some families that are probable, with their probability among these."""
    logs = {i: data.evidence[i][0] for i in chosen}
    total = scipy.special.logsumexp([scipy.special.logsumexp(log) for log in logs.values()])
    found = [
        (Version(i, int(k), float(data.evidence[i][1][k, a])), float(np.exp(log[k, a] - total)))
        for i, log in logs.items()
        for k, a in np.argwhere(log - total > np.log(_IMPROBABLE))
    ]
    every = sum(p for _, p in found)
    return [(version, p / every) for version, p in found]


def _function(data: Data, chosen: Sequence[int]) -> tuple[Floats, Floats, Floats]:
    """The function of a term where its covariate is given, averaged over forms and sizes, and its standard uncertainty, µm."""
    covariate = data.families[chosen[0]].covariate
    x, order = np.unique(covariate, return_index=True)
    if len(x) < 2:
        return x[:0], x[:0], x[:0]
    mean, square = np.zeros(len(x)), np.zeros(len(x))
    for version, p in _among(data, chosen):
        family = data.families[version.family]
        left = data.rest(family.columns[:, version.index])
        values = without_unseen(x, family.values[order, version.index], left)
        a, covariance, _ = data.fitted(version)
        own = values @ a
        mean += p * own
        square += p * (own**2 + np.einsum("pi,ij,pj->p", values, covariance, values))
    return x, mean / MICROMETRE, np.sqrt(np.maximum(square - mean**2, 0.0)) / MICROMETRE


def _amplitude(data: Data) -> float:
    """Largest part of an observation, µm, that the most probable function takes."""
    version = data.versions(1)[0]
    columns = data.families[version.family].columns[:, version.index]
    return float(np.abs(columns @ data.fitted(version)[0]).max()) / MICROMETRE


def _named(data: Data, own: Sequence[int], name: str, probability: float) -> tuple[NamedForm, str]:
    finer = [data.families[i].divided(_likely(data.evidence[i][0])) for i in own]
    data = replace(data, families=finer)
    versions = _among(data, range(len(finer)))
    weight = np.array([p for _, p in versions])
    each = [data.fitted(version)[:2] for version, _ in versions]
    sizes = np.array([mean for mean, _ in each]) * UNKNOWN_SD / MICROMETRE  # (v, r)
    spread = np.array([np.diag(covariance) for _, covariance in each]) * (UNKNOWN_SD / MICROMETRE) ** 2
    mean = weight @ sizes
    variance = weight @ (spread + (sizes - mean) ** 2)
    size, along = float(np.linalg.norm(mean)), mean / max(float(np.linalg.norm(mean)), 1e-300)
    parameters = {"size_um": _quantity(float(mean[0]) if len(mean) == 1 else size, float(along**2 @ variance), "µm")}
    family = data.families[0]
    nodes = [(data.families[version.family].shaped, version.index) for version, _ in versions]
    shapes, apart = (
        np.array([getattr(form, of)[index] if form else [] for form, index in nodes]) for of in ("shapes", "apart")
    )
    of = "mm" if family.term.of.endswith("_mm") else "s" if family.term.of == "time_s" else "1"
    text = family.formula
    values = weight @ shapes
    for k, parameter in enumerate(family.parameters):
        variance_of = weight @ ((shapes[:, k] - values[k]) ** 2 + apart[:, k] ** 2 / 12)
        parameters[parameter] = _quantity(float(values[k]), float(variance_of), of)
        text = re.sub(rf"\b{parameter}\b", f"{values[k]:.7g}", text)
    stated = "" if family.term.along is None else _stated(family.term, text.split(";"), np.abs(mean).tolist())
    return NamedForm(name, probability, parameters), stated


def _likely(log: Floats) -> Ints:
    """Functions (l,) of a family that are probable beside its best."""
    each = log.max(axis=1)
    return np.flatnonzero(each > each.max() + np.log(_IMPROBABLE))


def _quantity(value: float, variance: float, of: str) -> Quantity:
    u = float(np.sqrt(max(variance, 0.0)))
    return Quantity(value, u, (value - 1.96 * u, value + 1.96 * u), unit(of))


def _broken_line(x: Floats, y: Floats) -> str:
    """A curve of largest value one as a sum of hinges, between knots that lie evenly."""
    knots = np.linspace(x[0], x[-1], min(_KNOTS, len(x)))
    at = np.interp(knots, x, y) / max(float(np.abs(y).max()), 1e-300)
    slopes = np.diff(at) / np.diff(knots)
    bends = zip(knots[1:-1], np.diff(slopes), strict=True)
    hinges = [f"{bend:+.4g}*max(c - {knot:.5g}, 0)" for knot, bend in bends if abs(bend) * np.ptp(x) > _STRAIGHT]
    return f"{at[0]:.4g}{slopes[0]:+.4g}*(c - {knots[0]:.5g})" + "".join(hinges)


def _stated(term: Term, parts: Sequence[str], sizes: Sequence[float]) -> str:
    """A function as a job states an effect of its own: a formula of its form, held, whose size is to be estimated."""
    names = "kqrs"[: len(parts)]
    each = [re.sub(r"\bc\b", term.variable, part) for part in parts]
    formula = " + ".join(f"{name}*({part}){term.factor}" for name, part in zip(names, each, strict=True))
    priors = [f'{{ unit = "µm", prior = {_PRIOR * max(size, 0.01):.2g} }}' for size in sizes]
    parameters = ", ".join(f"{name} = {prior}" for name, prior in zip(names, priors, strict=True))
    name = "_".join(
        ("empirical", term.of.replace("_mm", "").replace(",", "_"), str(term.along), *filter(None, [term.lever]))
    )
    return f'[[effect]]\nname = "{name}"\nformula = "e_{term.along} = {formula}"\nparameters = {{ {parameters} }}\n'
