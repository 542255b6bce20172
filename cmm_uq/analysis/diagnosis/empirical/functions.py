"""Functions of what is recorded that an error could be, smooth ones and those of a form, as a recording sees each of them."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from itertools import product

import numpy as np

from cmm_uq.analysis.diagnosis.comparison.explanations import UNKNOWN, UNKNOWN_SD, mean_of, smooth_functions
from cmm_uq.analysis.diagnosis.comparison.search import SearchResult
from cmm_uq.analysis.diagnosis.empirical.forms import BOWL, PRODUCT, SMOOTH, ClosedForm, forms_of
from cmm_uq.base.messages import Text, Verbatim, say
from cmm_uq.base.points import AXES, Floats, Ints, reading_name
from cmm_uq.jobs.columns import in_words

_TURNED = 0.3  # how readily a curve of rotation is thought of, beside a displacement
_SEEN = 1e-9  # mm, length of columns for a size that physics allows
_PARTS = np.array([-0.5, -0.375, -0.25, -0.125, 0.0, 0.125, 0.25, 0.375, 0.5])  # of the distance of two nodes


@dataclass(frozen=True)
class FunctionTerm:
    of: str  # covariates, joined by a comma
    title: Text = field(compare=False)
    along: str | None = None  # axis that points move along; None for a term of the observations themselves
    lever: str | None = None  # axis in proportion to whose reading they do
    # what its size is proportional to, and what the covariate is called in a formula
    factor: str = field(default="", compare=False)
    variable: str = field(default="", compare=False)


Seen = Callable[[Floats], Floats]


@dataclass(frozen=True, eq=False)
class FunctionFamily:
    term: FunctionTerm
    form: str
    columns: Floats  # (m, K, r) over the noise scale, for the size that physics allows
    log_prior: float  # of each
    covariate: Floats  # (p,), and values: (p, K, r) the functions there, mm
    values: Floats
    shaped: ClosedForm | None = None
    seen: Seen | None = None
    formula: str = ""

    @property
    def parameters(self) -> tuple[str, ...]:
        return self.shaped.parameters if self.shaped else ()

    def divided(self, likely: Ints) -> FunctionFamily:
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


def families_of(result: SearchResult) -> list[FunctionFamily]:
    """All functions of a recording, each term as probable as another."""
    found = [*_of_points(result), *_of_approach(result), *_of_observations(result)]
    terms = len({family.term for family in found})
    seen = (family for family in found if np.linalg.norm(family.columns, axis=(0, 2)).max() > _SEEN)
    return [replace(family, log_prior=family.log_prior - float(np.log(terms))) for family in seen]


def _of_form(term: FunctionTerm, form: ClosedForm, seen: Seen, covariate: Floats, log_prior: float) -> FunctionFamily:
    values = UNKNOWN_SD * form.values(covariate, form.shapes)
    columns = seen(values.reshape(len(values), -1)).reshape(-1, *values.shape[1:])
    return FunctionFamily(term, form.name, columns, log_prior, covariate, values, form, seen, form.formula)


def _families(
    term: FunctionTerm, seen: Seen, covariate: Floats, *, forms: bool = True, weight: float = 1.0
) -> Iterator[FunctionFamily]:
    """Of one covariate (p,); ``seen`` gives the columns (m, q) of functions (p, q)."""
    log = float(np.log(weight)) - (float(np.log(2)) if forms else 0.0)
    smooth = list(smooth_functions(covariate))
    for f in smooth:
        yield FunctionFamily(term, SMOOTH, seen(f)[:, None], log - float(np.log(len(smooth))), covariate, f[:, None])
    every = list(forms_of(covariate, time=term.of == "time_s")) if forms else []
    for form in every:
        yield _of_form(term, form, seen, covariate, log - float(np.log(len(every) * len(form.shapes))))


def _of_points(result: SearchResult) -> Iterator[FunctionFamily]:
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
                of = FunctionTerm(f"{axis}_mm,{other}_mm", _of_both(along, _letter(axis), other), along)
                columns, (p, q) = moving(along)(UNKNOWN_SD * f)[:, None], (_arm(a, readings[a]) for a in (axis, other))
                formula = f"{p}*{q}" if name == PRODUCT else f"{p}**2;{q}**2"
                nowhere = np.zeros((0, 1, f.shape[1]))
                yield FunctionFamily(of, name, columns, -float(np.log(2)), np.zeros(0), nowhere, formula=formula)
        if timed and along in readings:
            half = 0.5 * float(np.ptp(readings[along]))
            title = say("scale of {axis} as a function of time", axis=_letter(along))
            since = f"(time_s + {points.start!r})" if points.start else "time_s"
            term = FunctionTerm("time_s", title, along, along, f"*{along}/{half!r}", since)
            yield from _families(term, moving(along, readings[along] / half), np.asarray(time))


def _of_approach(result: SearchResult) -> Iterator[FunctionFamily]:
    """Of a direction of travel, by as much everywhere and in proportion to a reading."""
    model, values, scale = result.first.model, result.first.values, result.first.comparison.noise_scale
    points = model.artefact.points.at(model.where(values))
    for along, key in product(range(3), (f"approach_{a}" for a in AXES if f"approach_{a}" in points.columns)):
        for axis, read in ((axis, read) for axis, read in points.readings.items() if np.ptp(read) > 1.0):
            arm = (read - 0.5 * (read.min() + read.max())) / (0.5 * np.ptp(read))
            e = np.zeros((len(read), 3, 2))
            e[:, along] = UNKNOWN_SD * points.columns[key][:, None] * np.column_stack([np.ones(len(arm)), arm])
            of = FunctionTerm(f"{key},{axis}_mm", _of_both(AXES[along], in_words(key), axis), AXES[along])
            columns = (model.seen(e, values) / scale[:, None])[:, None]
            formula = f"{key};{key}*{_arm(axis, read)}"
            yield FunctionFamily(of, PRODUCT, columns, 0.0, np.zeros(0), np.zeros((0, 1, 2)), formula=formula)


def _of_observations(result: SearchResult) -> Iterator[FunctionFamily]:
    model, scale = result.first.model, result.first.comparison.noise_scale
    for key, column in model.artefact.points.own_columns.items():
        mean = mean_of(model, column)
        if len(np.unique(mean)) > 2:
            title = say("error as a function of {name}", name=in_words(key))
            yield from _families(FunctionTerm(key, title), lambda f: f / scale[:, None], mean)
    for one in (e for e in result.first.explanations if e.kind == UNKNOWN and e.covariate is None):
        for member in one.members:
            columns = (member.columns / scale[:, None])[:, None]
            log = -float(np.log(len(one.members)))
            values = np.zeros((0, *columns.shape[1:]))
            yield FunctionFamily(FunctionTerm(str(one.name), one.name), SMOOTH, columns, log, np.zeros(0), values)


def _letter(axis: str) -> Text:
    return Verbatim(axis.upper())


def _of_both(along: str, one: Text, other: str) -> Text:
    return say(
        "error along {direction} as a function of {axis} and {other}",
        direction=_letter(along),
        axis=one,
        other=_letter(other),
    )


def _curve(along: str, axis: str) -> FunctionTerm:
    words = say("error along {direction} as a function of {axis}", direction=_letter(along), axis=_letter(axis))
    return FunctionTerm(reading_name(axis), words, along, variable=_variable(axis))


def _turning(along: str, axis: str, lever: str, middle: float, half: float) -> FunctionTerm:
    title = say(
        "error along {direction} as a function of {axis}, in proportion to {lever}",
        direction=_letter(along),
        axis=_letter(axis),
        lever=_letter(lever),
    )
    arm = f"*({_variable(lever)} - {middle!r})/{half!r}"
    return FunctionTerm(reading_name(axis), title, along, lever, arm, _variable(axis))


def _variable(axis: str) -> str:
    """What it reads, in a formula."""
    return axis if axis in AXES else reading_name(axis)


def _arm(axis: str, readings: Floats) -> str:
    low, span = float(readings.min()), float(np.ptp(readings))
    return f"(({axis} - {low + 0.5 * span!r})/{0.5 * span!r})"
