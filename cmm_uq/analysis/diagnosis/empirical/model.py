"""What was located and no effect names, modelled: functions of what is recorded, averaged by their evidence, and their form.

y = B·b + F·a + ε, with b free (the job's model, what was asserted, where the artefact stands), F the columns of one function
and ε the noise that the comparison found most probable. Functions are smooth (Gaussian processes) or of closed form; sizes
are spread evenly in their logarithm up to what physics allows, and σ is integrated over. Held-out set-ups are predicted by all
functions as the other set-ups alone weigh them: the choice is made anew wherever it is judged. A further one is looked for
beside the most probable function where it has odds of 20 : 1.
"""

from __future__ import annotations

import re
from collections.abc import Sequence

import numpy as np
import scipy

from cmm_uq.analysis.diagnosis.comparison.explanations import EFFECT, UNKNOWN, UNKNOWN_SD, Explanation, effect_of
from cmm_uq.analysis.diagnosis.comparison.lack_of_fit import SHARES, log_prior
from cmm_uq.analysis.diagnosis.comparison.search import SearchResult
from cmm_uq.analysis.diagnosis.empirical import evidence
from cmm_uq.analysis.diagnosis.empirical.evidence import FunctionFit
from cmm_uq.analysis.diagnosis.empirical.functions import ROUGH, SINE, SMOOTH, FunctionFamily, FunctionTerm, waves
from cmm_uq.analysis.diagnosis.held_out import Improvement
from cmm_uq.analysis.diagnosis.location import without_unseen
from cmm_uq.base.messages import Text
from cmm_uq.base.points import Floats
from cmm_uq.base.units import MICROMETRE, unit
from cmm_uq.base.values import dataclass, replace
from cmm_uq.maths.uncertainty.quantity import Quantity

ODDS = 20.0  # of a further function over none, and of a form over all else, from which it is told
_CLEAR = ODDS / (1 + ODDS)
MOST = 3  # functions together
_SEEN = 1e-6  # rms over the noise, below which an effect shows nothing
_TOLD, _ALSO = 0.01, 0.05  # probability from which a form, and another term, is told
ALIKE = 1e-3  # part of an effect's squared length that others leave of it, up to which no number of repeats parts them
_KNOTS, _STRAIGHT = 24, 0.01  # of a broken line for a smooth curve; part of its size that the line may be off
_PRIOR = 3.0  # what its size may be in another recording, over what was found


@dataclass(frozen=True)
class NamedForm:
    """A form that has odds of 20 : 1 over every other function."""

    name: str
    probability: float
    parameters: dict[str, Quantity]  # its size, and what shapes it


@dataclass(frozen=True, eq=False)
class EmpiricalFunction:
    term: FunctionTerm
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


@dataclass(frozen=True)
class BestKnown:
    """The known effect that by itself explains most."""

    effect: str
    title: Text
    probability: float  # among all combinations
    odds_of_function: float  # of the best nonparametric term over it, each alone, without what is known beforehand
    improvement: Improvement
    points_to: Text


def empirical_model(result: SearchResult) -> EmpiricalModel | None:
    """What functions of what is recorded make of the misfit; nothing where none has odds of 20 : 1."""
    data = FunctionFit.of(result, result.first.families)
    if not data.families or not data.degrees:
        return None
    beside, described = data.refined(), list[EmpiricalFunction]()
    while len(described) < MOST and beside.total - beside.nothing > np.log(ODDS):
        found = _described(beside, result)
        if any(one.term == found.term for one in described):  # names of a job's effects differ
            found = replace(found, stated=found.stated.replace('"\nformula', f'_{len(described) + 1}"\nformula', 1))
        of, along = {*found.term.of.split(",")}, found.term.along
        alike = [one.term.along == along and bool(of & {*one.term.of.split(",")}) for one in described]
        if any(alike):  # what is left of a form says that it is another
            described = [replace(one, form=None) if same else one for one, same in zip(described, alike, strict=True)]
            found = replace(found, form=None)
        described.append(found)
        beside = beside.with_function(beside.versions(1)[0]).refined()
    if not described:
        return None
    data = replace(data, families=beside.families)
    gains = evidence.improvements(result, data, len(described))
    chosen = 0
    for i, gain in enumerate(gains[1:], 1):  # a further function is kept where it predicts better than those before it
        if gain.elpd_gain - gains[chosen].elpd_gain > gain.elpd_gain_se and (
            gain.heldout_rms_after_um < gains[chosen].heldout_rms_after_um
        ):
            chosen = i
    gain = gains[chosen]
    better = gain.elpd_gain > gain.elpd_gain_se and gain.heldout_rms_after_um < gain.heldout_rms_before_um
    return EmpiricalModel(tuple(described[: chosen + 1]), gain, better)


def _described(data: FunctionFit, result: SearchResult) -> EmpiricalFunction:
    by: dict[FunctionTerm, dict[str, float]] = {}
    for family, (log, _) in zip(data.families, data.evidence, strict=True):
        of_term = by.setdefault(family.term, {})
        share = float(np.exp(scipy.special.logsumexp(log) - data.total))
        of_term[family.form] = of_term.get(family.form, 0.0) + share
    order = sorted(by, key=lambda one: -sum(by[one].values()))
    term, probability = order[0], sum(by[order[0]].values())
    forms = sorted(by[term].items(), key=lambda item: -item[1])
    name, most = forms[0]
    chosen = [i for i, family in enumerate(data.families) if family.term == term]
    most_of = {i: float(data.evidence[i][0].max()) for i in chosen if data.families[i].form == name}
    best = data.families[max(most_of, key=lambda i: most_of[i])]
    own = [i for i in most_of if data.families[i].formula == best.formula]
    x, y, u = _function(data, chosen)
    form, stated = None, ""
    if name not in (SMOOTH, ROUGH) and (most >= _CLEAR or not len(x)):
        most = most * _of_functions(data, result) if most >= _CLEAR else most
        most = most * _of_sines(data, chosen) if name == SINE and most >= _CLEAR else most
        form, stated = _named(data, own, name, most)
        form = form if most >= _CLEAR else None
    elif len(x) and term.along is not None:
        stated = _stated(term, [_broken_line(x, y)], [float(np.abs(y).max())])
    also = tuple(other.title for other in order[1:4] if sum(by[other].values()) > _ALSO)
    amplitude = float(np.abs(y).max()) if len(y) else _amplitude(data)
    told = tuple((one, p) for one, p in forms if p > _TOLD)
    return EmpiricalFunction(
        term, probability, told, form, also, amplitude, (x, y, u), _seen(data, result, chosen[0]), stated
    )


def _of_functions(data: FunctionFit, result: SearchResult) -> float:
    """Probability that it is a function and no known effect."""
    every = enumerate(result.first.explanations)
    effects = [of_effect(result, i, data) for i, e in every if e.kind == EFFECT and i not in result.chosen]
    return float(scipy.special.expit(data.total - np.logaddexp.reduce(np.ravel(effects), initial=-np.inf)))


def _of_sines(data: FunctionFit, of: Sequence[int]) -> float:
    """Probability that what a term repeats is a sine, of one harmonic or two, and no other wave."""
    sines = [i for i in of if data.families[i].form == SINE]
    own = float(np.logaddexp.reduce([np.logaddexp.reduce(data.evidence[i][0], axis=None) for i in sines]))
    like, other = next(data.families[i] for i in of if data.families[i].seen), -np.inf
    for shaped, log in ((f.shaped, f.log_prior) for f in (data.families[i] for i in sines)):
        every = waves(replace(like, log_prior=log), shaped.shapes[:, 0]) if shaped is not None else ()
        other = np.logaddexp.reduce([other, *(np.logaddexp.reduce(data.of_family(f)[0], axis=None) for f in every)])
    return float(scipy.special.expit(own - other))


def of_effect(result: SearchResult, i: int, data: FunctionFit, of: Explanation | None = None) -> tuple[float, float]:
    """Log evidence and prior of an effect in its own form, and in its other forms, as if it were a function of the fit."""
    known, scale = result.first.explanations, result.first.comparison.noise_scale[:, None, None]
    members, prior = (of or known[i]).members, float(log_prior(known)[i] - np.log(SHARES[UNKNOWN]))
    whole, found = sum(one.weight for one in members), [-np.inf, -np.inf]
    for rough, width in {(one.rough, one.columns.shape[1]) for one in members}:
        some = [one for one in members if (one.rough, one.columns.shape[1]) == (rough, width)]
        columns = np.stack([one.columns for one in some], axis=1) / scale
        # one that is found shows, at its largest, by as much as the noise
        rms = np.sqrt(np.sum(data.rest(columns) ** 2, axis=(0, 2)) / data.degrees) / data.least
        columns = columns / np.where((rms > _SEEN) & (rms < 1), rms, 1.0)[:, None]
        own = FunctionFamily(data.families[0].term, "", columns, prior, np.zeros(0), np.zeros((0, *columns.shape[1:])))
        log = data.of_family(own)[0] + np.log([one.weight / whole for one in some])[:, None]
        found[rough] = float(np.logaddexp(found[rough], scipy.special.logsumexp(log)))
    return found[0], found[1]


def _seen(data: FunctionFit, result: SearchResult, family: int) -> tuple[Floats, Floats, Floats]:
    covariate, model = data.families[family].covariate, result.first.model
    rows = model.artefact.rows[model.used]
    c = covariate[:, None] if len(covariate) == len(rows) else covariate[rows] if len(covariate) else np.zeros((0, 1))
    left = next(evidence.residuals(data, 0)) * result.first.comparison.noise_scale / MICROMETRE
    return c.min(axis=1, initial=np.inf), c.max(axis=1, initial=-np.inf), left[: len(c)]


def _among(data: FunctionFit, chosen: Sequence[int]) -> list[tuple[evidence.FunctionVersion, float]]:
    """Versions of some families that are probable, with their probability among these."""
    logs = {i: data.evidence[i][0] for i in chosen}
    total = scipy.special.logsumexp([scipy.special.logsumexp(log) for log in logs.values()])
    found = [
        (evidence.FunctionVersion(i, int(k), float(data.evidence[i][1][k, a])), float(np.exp(log[k, a] - total)))
        for i, log in logs.items()
        for k, a in np.argwhere(log - total > np.log(evidence.IMPROBABLE))
    ]
    every = sum(p for _, p in found)
    return [(version, p / every) for version, p in found]


def _function(data: FunctionFit, chosen: Sequence[int]) -> tuple[Floats, Floats, Floats]:
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


def _amplitude(data: FunctionFit) -> float:
    """Largest part of an observation, µm, that the most probable function takes."""
    version = data.versions(1)[0]
    columns = data.families[version.family].columns[:, version.index]
    return float(np.abs(columns @ data.fitted(version)[0]).max()) / MICROMETRE


def _named(data: FunctionFit, own: Sequence[int], name: str, probability: float) -> tuple[NamedForm, str]:
    versions = _among(data, own)
    weight = np.array([p for _, p in versions])
    each = [data.fitted(version)[:2] for version, _ in versions]
    sizes = np.array([mean for mean, _ in each]) * UNKNOWN_SD / MICROMETRE  # (v, r)
    spread = np.array([np.diag(covariance) for _, covariance in each]) * (UNKNOWN_SD / MICROMETRE) ** 2
    # of several coefficients the length: they turn as the period does, and their mean says nothing
    length = np.linalg.norm(sizes, axis=1)
    along = sizes / np.where(length > 0, length, 1.0)[:, None]
    each_size = sizes[:, 0] if sizes.shape[1] == 1 else length
    size = float(weight @ each_size)
    variance = float(weight @ (np.sum(along**2 * spread, axis=1) + (each_size - size) ** 2))
    parameters = {"size_um": _quantity(size, variance, "µm")}
    family = data.families[own[0]]
    nodes = [(data.families[version.family].shaped, version.index) for version, _ in versions]
    shapes, apart = (np.array([getattr(f, of)[k] if f else [] for f, k in nodes]) for of in ("shapes", "apart"))
    of = "mm" if family.term.of.endswith("_mm") else "s" if family.term.of == "time_s" else "1"
    text = family.formula
    values = weight @ shapes
    for k, parameter in enumerate(family.parameters):
        variance_of = weight @ ((shapes[:, k] - values[k]) ** 2 + apart[:, k] ** 2 / 12)
        parameters[parameter] = _quantity(float(values[k]), float(variance_of), of)
        text = re.sub(rf"\b{parameter}\b", f"{values[k]:.7g}", text)
    stated = (
        "" if family.term.along is None else _stated(family.term, text.split(";"), np.sqrt(weight @ sizes**2).tolist())
    )
    return NamedForm(name, probability, parameters), stated


def _quantity(value: float, variance: float, of: str) -> Quantity:
    u = float(np.sqrt(max(variance, 0.0)))
    return Quantity(value, u, (value - 1.96 * u, value + 1.96 * u), unit(of))


def _broken_line(x: Floats, y: Floats) -> str:
    """A curve of largest value one as a sum of hinges, between knots where it is farthest from the line so far."""
    y, knots = y / max(float(np.abs(y).max()), 1e-300), [0, len(x) - 1]
    while len(knots) < _KNOTS:
        away = np.abs(y - np.interp(x, x[knots], y[knots]))
        if away.max() < _STRAIGHT:
            break
        knots = sorted({*knots, int(away.argmax())})
    slopes = np.diff(y[knots]) / np.diff(x[knots])
    hinges = [f"{bend:+.5g}*max(c - {knot:.7g}, 0)" for knot, bend in zip(x[knots[1:-1]], np.diff(slopes), strict=True)]
    return f"{y[0]:.5g}{slopes[0]:+.5g}*(c - {x[0]:.7g})" + "".join(hinges)


def _stated(term: FunctionTerm, parts: Sequence[str], sizes: Sequence[float]) -> str:
    """A function as a job states an effect of its own: a formula of its form, held, whose size is to be estimated."""
    names = "kqrs"[: len(parts)]
    each = [re.sub(r"\bc\b", term.variable, part) for part in parts]
    formula = " + ".join(f"{name}*({part}){term.factor}" for name, part in zip(names, each, strict=True))
    priors = [f'{{ unit = "µm", prior = {_PRIOR * max(size, 0.01):.2g} }}' for size in sizes]
    parameters = ", ".join(f"{name} = {prior}" for name, prior in zip(names, priors, strict=True))
    of = term.of.replace("_mm", "").replace(",", "_")
    name = "_".join(("empirical", of, str(term.along), *filter(None, [term.lever])))
    return f'[[effect]]\nname = "{name}"\nformula = "e_{term.along} = {formula}"\nparameters = {{ {parameters} }}\n'


def best_known(result: SearchResult) -> BestKnown | None:
    """The effect of the catalogue that by itself makes the recording most probable, asserted or not."""
    first, prior = result.first, log_prior(result.first.explanations)
    known = [i for i, e in enumerate(first.explanations) if e.kind == EFFECT and np.isfinite(first.log_odds[i])]
    if not known:
        return None
    best = max(known, key=lambda i: float(first.log_odds[i] + prior[i]))
    functions = [i for i, e in enumerate(first.explanations) if e.kind == UNKNOWN]
    odds = float(np.exp(min(max(first.log_odds[functions], default=-np.inf) - first.log_odds[best], 700.0)))
    member = first.comparison.beside((), (best,))[best][1].member
    columns = first.explanations[best].members[member].columns / first.comparison.noise_scale[:, None]
    alone = replace(FunctionFit.of(result, ()), free=first.comparison.baseline)  # with nothing asserted
    effect, combinations = effect_of(first.explanations[best]), result.combinations
    probability = 0.0 if combinations is None else combinations.of(best)
    gain = evidence.improvement_by(result, alone, columns)
    return BestKnown(effect.name, effect.title, probability, odds, gain, effect.points_to)


def likeliest(data: FunctionFit) -> FunctionTerm:
    return data.families[data.versions(1)[0].family].term
