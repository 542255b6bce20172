"""What could be known of a hidden error outside the catalogue: an oracle that is told covariate, axis and noise exactly.

It asks whether there is anything, told the form and not told it; what the true form predicts of set-ups that its fit had not
seen; and the odds of the form against the others of the dictionary and against a smooth function. Every explanation has the
same prior for what it makes visible. A second one is told the noise alone, as whoever has to search is at best: it asks where
anything is. Nothing here comes from the package.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Sequence
from functools import lru_cache
from itertools import combinations, product
from typing import Any

import numpy as np
from scipy import special, stats

from benchmarks.second.cases import Case, baseline
from benchmarks.second.oracle import Forms, forms, searched_among
from benchmarks.third.cases import Hidden
from benchmarks.third.forms import DICTIONARY, POSITIONS, TWO, Outside
from benchmarks.third.known import further, rivals

VISIBLE = (2.0, 5.0, 12.0, 30.0)
"""Standard deviations of √λ that an explanation may have, each as probable as any other."""
LENGTHS = (0.08, 0.15, 0.3, 0.6)
"""Over which a smooth function changes, as a part of the covariate's range."""
WAVES, WAVES_OF_TWO, PLAIN = 24, 7, 8
"""Cosines of a smooth function, of one and for each of two covariates; of a test of no form."""
DRAWS = 199
LEAST = 1e-6
"""Length of a column, over its length before the model took its part, below which nothing of it is seen."""


def searched_for(found: Hidden, seed: int, *, whole: bool = False) -> dict[str, Any]:
    """What oracles say of a case: of effects of the catalogue that of the second study, which estimates the noise, and looks
    for those of the second study or for the ``whole`` catalogue."""
    if found.outside is not None:
        return told(found, seed)
    search = searched_among(found.one, *catalogue(found.one, whole), knows_noise=False, seed=seed)
    return {"effects": list(search.effects), "p": search.p_value, "rivals": rivals(found)}


def catalogue(one: Case, whole: bool) -> tuple[list[str], list[Forms]]:
    """Effects and what each looks like in a recording: of those that have a place or a time in them every third."""
    names, known = forms(one)
    if not whole:
        return names, known
    more = {name: errors[:: 3 if len(errors) > 20 else 1] for name, errors in further(one.placed.recorded).items()}
    owner = np.repeat(len(names) + np.arange(len(more)), [len(errors) for errors in more.values()])
    e = [error(one.placed.true, one.context).ravel() for errors in more.values() for error in errors]
    return [*names, *more], [*known, Forms((-one.placed.D @ np.column_stack(e))[:, :, None], owner)]


def told(found: Hidden, seed: int) -> dict[str, Any]:
    """Of a hidden error outside the catalogue."""
    y = found.seen.rest @ found.one.y
    outside = found.outside
    assert outside is not None
    column = found.seen.seen(found.errors[outside.name])
    before, after = held_out(found, column_of(found, outside))
    log_odds, true = odds(found, y), outside.form
    others = {name: value for name, value in log_odds.items() if name != true}
    anywhere, best = unformed(found, y, np.random.default_rng([seed, 78]), tuple(places(found)))
    return {
        "p_form": float(stats.chi2.sf((column @ y) ** 2 / (column @ column), 1)),
        "p_covariate": unformed(found, y, np.random.default_rng([seed, 77]), (outside,))[0],
        "p_anywhere": anywhere, "best": list(best.of),
        "heldout_before_um": before, "heldout_after_um": after,
        "log_odds": {name: float(log_odds.get(true, np.nan) - value) for name, value in others.items()},
        "log_evidence": {name: float(value) for name, value in log_odds.items()},
    }  # fmt: skip


def column_of(found: Hidden, outside: Outside) -> np.ndarray:
    """Observations (m,) per unit, not whitened."""
    return found.seen.column(outside.error())


def places(found: Hidden) -> Iterator[Outside]:
    """Whatever could be hidden, but for its form: covariates that vary, along each axis, where they may also lengthen it."""
    true, context = found.one.placed.true, found.one.context
    values = {name: true[:, i] for i, name in enumerate(POSITIONS)}
    others = ("time_s", *(f"{kind}_{axis}{end}" for kind, end in (("temp", "_c"), ("approach", "")) for axis in "xyz"))
    values |= {name: context[name] for name in others if name in context}
    spans = {name: (float(each.min()), float(each.max())) for name, each in values.items()}
    varying = [name for name, (low, high) in spans.items() if high - low >= 1e-6]
    pairs = [each for each in combinations(POSITIONS, 2) if set(each) <= set(varying)]
    for of, along in product([*((name,) for name in varying), *pairs], range(3)):
        for scale in (False,) if of[0] in POSITIONS else (False, True):
            yield Outside("", of, tuple(spans[name] for name in of), along, scale, {})


def families(found: Hidden, outside: Outside) -> Iterator[tuple[str, np.ndarray]]:
    """Every form of the dictionary that some covariates may have: name, columns (m, members, c), whitened."""
    each = [outside] if len(outside.of) == 1 else [outside.only(0), outside.only(1)]
    for form, (_, _, members) in DICTIONARY.items():
        if form in TWO:
            columns = [_columns(found, outside, form, members())] if len(outside.of) == 2 else []
        elif form == "sign":
            columns = [_columns(found, one, form, members()) for one in each if one.of[0].startswith("approach")]
        elif form == "exponential":
            columns = [_columns(found, one, form, members()) for one in each if one.of == ("time_s",)]
        else:
            columns = [_columns(found, one, form, members()) for one in each if not one.of[0].startswith("approach")]
        if columns:
            yield form, np.concatenate(columns, axis=1)


@lru_cache(maxsize=32)
def _values(found: Hidden, of: tuple[str, ...], spans: tuple[tuple[float, float], ...], form: str) -> np.ndarray:
    """(n, members) of a form of some covariates, whatever axis it acts along."""
    each = Outside("", of, spans, 0, False, {}).covariates(found.one.placed.true, found.one.context)
    members = [parameters for member in DICTIONARY[form].members() for parameters in member]
    return np.column_stack([DICTIONARY[form].value(*each, **parameters) for parameters in members])


def _columns(found: Hidden, outside: Outside, form: str, members: list[list[dict[str, float]]]) -> np.ndarray:
    placed = found.one.placed
    D = placed.D.reshape(len(placed.D), -1, 3)[:, :, outside.along]  # all of it acts along one axis
    moved = D @ outside.acting(_values(found, outside.of, outside.spans, form), placed.true)
    whole = -found.seen.rest @ moved
    plain = np.linalg.norm(moved, axis=0) / found.one.noise.sigma
    whole = np.where(np.linalg.norm(whole, axis=0) > LEAST * np.maximum(plain, 1e-300), whole, 0.0)
    return whole.reshape(len(whole), len(members), -1)


def smooth(found: Hidden) -> Iterator[np.ndarray]:
    """Columns (m, q) of a smooth function of the covariates, weighted by how it changes over each length; whitened."""
    outside = found.outside
    assert outside is not None
    u = outside.covariates(found.one.placed.true, found.one.context)
    waves = _waves(u, WAVES if len(u) == 1 else WAVES_OF_TWO)
    columns = _acting(found, outside, [wave for wave, _ in waves])
    squares = np.array([order for _, order in waves])
    for length in LENGTHS:
        yield columns * np.exp(-0.25 * np.pi**2 * squares * length**2)


def _waves(u: list[np.ndarray], most: int) -> list[tuple[np.ndarray, float]]:
    """Cosines (n,) of one or two covariates, and the squares of their orders."""
    if len(u) == 1:
        return [(np.cos(np.pi * k * u[0]), float(k**2)) for k in range(1, most + 1)]
    return [(np.cos(np.pi * k * u[0]) * np.cos(np.pi * j * u[1]), float(k**2 + j**2))
            for k in range(most) for j in range(most) if k + j]  # fmt: skip


def _acting(found: Hidden, outside: Outside, values: list[np.ndarray]) -> np.ndarray:
    placed = found.one.placed
    D = placed.D.reshape(len(placed.D), -1, 3)[:, :, outside.along]
    return np.asarray(-found.seen.rest @ (D @ outside.acting(np.column_stack(values), placed.true)))


def log_evidence(columns: np.ndarray, y: np.ndarray) -> float:
    """Of columns (m, q) with one prior for all of them, over that of nothing; averaged over :data:`VISIBLE`."""
    size = float(np.linalg.norm(columns))
    if size <= 0:
        return -np.inf
    U, s, _ = np.linalg.svd(columns / size, full_matrices=False)
    seen, variances = (U.T @ y) ** 2, np.multiply.outer(np.square(VISIBLE), s**2)
    each = 0.5 * np.sum(seen * variances / (1 + variances) - np.log1p(variances), axis=1)
    return float(special.logsumexp(each) - np.log(len(VISIBLE)))


def of_family(columns: np.ndarray, y: np.ndarray) -> float:
    """Of a form: the mean over its members that the recording could show."""
    sizes = np.linalg.norm(columns, axis=(0, 2))
    shown = np.flatnonzero(sizes > 1e-3 * sizes.max(initial=0.0))
    if not len(shown):
        return -np.inf
    if columns.shape[2] > 1:
        each = np.array([log_evidence(columns[:, i], y) for i in shown])
    else:
        seen = ((columns[:, shown, 0].T @ y) / sizes[shown]) ** 2
        variances = np.square(VISIBLE)[:, None]
        every = 0.5 * (seen * variances / (1 + variances) - np.log1p(variances))
        each = special.logsumexp(every, axis=0) - np.log(len(VISIBLE))
    return float(special.logsumexp(each) - np.log(len(each)))


def odds(found: Hidden, y: np.ndarray) -> dict[str, float]:
    """Log evidence of every form of the dictionary and of a smooth function, over nothing."""
    assert found.outside is not None
    said = {form: of_family(columns, y) for form, columns in families(found, found.outside)}
    each = [log_evidence(columns, y) for columns in smooth(found)]
    return said | {"smooth": float(special.logsumexp(each) - np.log(len(each))), "nothing": 0.0}


def unformed(
    found: Hidden, y: np.ndarray, random: np.random.Generator, among: Sequence[Outside]
) -> tuple[float, Outside]:
    """p-value of nothing, not told the form: the most surprising form, or sum of cosines, among draws; and of which place."""
    L = np.linalg.cholesky(found.seen.covariance)
    noise = found.seen.rest @ (L @ random.standard_normal((len(L), DRAWS)))
    all_y = np.column_stack([y, noise])
    each = np.array([_surprise(found, outside, all_y) for outside in among])
    best = each.max(axis=0)
    return float((1 + np.sum(best[1:] >= best[0])) / (DRAWS + 1)), among[int(each[:, 0].argmax())]


def _surprise(found: Hidden, outside: Outside, all_y: np.ndarray) -> np.ndarray:
    """(draws,) of the most surprising form of some covariates, or sum of cosines: the logarithm of its p-value, negative."""
    u = outside.covariates(found.one.placed.true, found.one.context)
    plain = _acting(found, outside, [wave for wave, _ in _waves(u, PLAIN if len(u) == 1 else 4)])
    several = [_basis(plain[:, :k]) for k in range(2, plain.shape[1] + 1, 2)]
    most: dict[int, np.ndarray] = defaultdict(lambda: np.zeros(all_y.shape[1]))  # by how many columns
    for _, columns in families(found, outside):
        if columns.shape[2] > 1:
            several += [_basis(columns[:, i]) for i in range(columns.shape[1])]
            continue
        ones, size = columns[:, :, 0], np.linalg.norm(columns[:, :, 0], axis=0)
        most[1] = np.maximum(most[1], np.max(np.square((ones / np.where(size > 0, size, 1.0)).T @ all_y), axis=0))
    for basis in several:
        count = basis.shape[1]
        most[count] = np.maximum(most[count], np.sum(np.square(basis.T @ all_y), axis=0))
    return np.max([-stats.chi2.logsf(squares, count) for count, squares in most.items() if count], axis=0, initial=0.0)


def _basis(columns: np.ndarray) -> np.ndarray:
    U, s, _ = np.linalg.svd(columns, full_matrices=False)
    return np.asarray(U[:, s > 1e-7 * s.max(initial=0.0)] if s.max(initial=0.0) > 0 else U[:, :0])


def held_out(found: Hidden, column: np.ndarray) -> tuple[float, float]:
    """Rms, µm, of predictions of set-ups that the fit had not seen (of points, where there are fewer than ten), without and
    with the true form, whose size alone is fitted."""
    placed = found.one.placed
    rows = placed.D.reshape(len(placed.D), len(placed.true), 3).any(axis=2)
    first = rows.argmax(axis=1)
    group = placed.measurement[first]
    if len(np.unique(group)) < 10:
        group = 1000 * group + placed.point[first]
    B = baseline(found.seen)
    return tuple(_predicted(B_, found.one.y, group) for B_ in (B, np.column_stack([B, column])))  # type: ignore[return-value]


def _predicted(B: np.ndarray, y: np.ndarray, group: np.ndarray) -> float:
    squares, count = 0.0, 0
    for k in np.unique(group):
        out = group == k
        known = np.abs(B[~out]).max(axis=0, initial=0.0) > 1e-12 * np.abs(B).max(axis=0, initial=1e-300)
        size = np.maximum(np.linalg.norm(B[~out][:, known], axis=0), 1e-300)
        x = np.linalg.lstsq(B[~out][:, known] / size, y[~out], rcond=1e-9)[0] / size
        left, own = y[out] - B[out][:, known] @ x, _basis(B[out][:, ~known])
        left = left - own @ (own.T @ left)
        squares += float(left @ left)
        count += max(int(out.sum()) - own.shape[1], 0)
    return 1e3 * float(np.sqrt(squares / max(count, 1)))


def alike(found: Hidden, form: str, outside: Outside) -> float:
    """√λ that the best member of a form, of these covariates along this axis, leaves of all that is hidden."""
    signal = found.signal
    columns = next((c for name, c in families(found, outside) if name == form), None)
    if columns is None:
        return float(np.linalg.norm(signal))
    return min(found.seen.left(signal, [columns[:, i]]) for i in range(columns.shape[1]))
