"""Functions of what is recorded that an error could be, smooth or of closed form, as a recording sees each of them.

A form is linear in its size. What shapes it besides lies on a grid, where most of what lies between two nodes shows at either;
about the most probable nodes it is divided.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from functools import cache, partial
from itertools import product

import numpy as np

from cmm_uq.analysis.diagnosis.comparison import explanations as candidate
from cmm_uq.analysis.diagnosis.comparison.evidence import CandidateComparison
from cmm_uq.analysis.diagnosis.comparison.explanations import UNKNOWN, UNKNOWN_SD
from cmm_uq.base.messages import Text, Verbatim, say
from cmm_uq.base.points import AXES, Floats, Ints, Points, reading_name
from cmm_uq.base.values import dataclass, field, replace
from cmm_uq.jobs.columns import in_words
from cmm_uq.machine.model import RecordingModel
from cmm_uq.machine.physics.effect import along as displaced

SMOOTH, ROUGH = "smooth", "rough"  # of no form in particular, with a slope everywhere and without
PRODUCT, BOWL, SINE = "product", "bowl", "sine"  # forms, the first two of two readings
_STEPS, _HINGES, _PLACES, _SATURATES, _PHASES = 40, 19, 24, 15, 12
_WIDTHS, _SOFT, _REACHES, _DEAD = (0.03, 0.06, 0.12), (0.04, 0.08, 0.16), (0.05, 0.1, 0.2, 0.4), 6
_CENTRES = (-0.4, -0.2, 0.0, 0.2, 0.4)  # of a dead zone, in halves of the range
_SAME = 1e-3  # part of the range within which readings are of one place
# Frequencies, in periods over the range: less than one is a curve, and a sawtooth of less than two a step
_WHOLE, _SEVERAL, _BETWEEN, _SINES, _TEETH = 1.0, 2.0, 0.35, 25.0, 12.0
Function = Callable[[Floats, Floats], Floats]


@dataclass(frozen=True, eq=False)
class ClosedForm:
    name: str
    parameters: tuple[str, ...]  # what shapes them, in the covariate's unit
    shapes: Floats  # (K, s)
    apart: Floats  # (K, s) how far the nodes of the grid are from each other
    function: Function  # of a covariate (n, 1) and shapes (K, s), (n, K) or (n, K, r)
    formula: str  # of each for one unit of its columns: c the covariate, parameters by name; columns parted by ``;``

    def values(self, covariate: Floats, shapes: Floats) -> Floats:
        """Functions (n, K, r) of a covariate (n,)."""
        found = self.function(covariate[:, None], shapes)
        return found[:, :, None] if found.ndim == 2 else found


def forms_of(covariate: Floats, *, time: bool = False) -> Iterator[ClosedForm]:
    """Every form of a covariate (n,): of a time one that settles or grows is called exponential, of a reading saturating."""
    low, span, distinct = float(covariate.min()), float(np.ptp(covariate)), np.unique(covariate)
    high, middle, half, gaps = low + span, low + 0.5 * span, 0.5 * span, np.diff(distinct)
    between, places = distinct[:-1] + 0.5 * gaps, 1 + int(np.sum(gaps > _SAME * span))
    if len(between) > _STEPS:
        parts = np.array_split(np.arange(len(gaps)), _STEPS)
        widest = np.array([part[np.argmax(gaps[part])] for part in parts])
        between, gaps = between[widest], np.maximum(gaps[widest], np.gradient(between[widest]))
    at, apart = between[:, None], gaps[:, None]
    yield ClosedForm("step", ("at",), at, apart, lambda c, s: 0.5 * (1 + np.sign(c - s[:, 0])), "(1 + sign(c - at))/2")
    at = low + span * np.arange(1, _HINGES + 1) / (_HINGES + 1)
    yield _even("ramp", ("start",), at, lambda c, s: np.maximum(c - s[:, 0], 0) / span, f"max(c - start, 0)/{span!r}")
    nodes, formula = (_middles(low, span, _PLACES), span * np.array(_WIDTHS)), "exp(-((c - at)/width)**2/2)"
    yield _even("dent", ("at", "width"), nodes, lambda c, s: np.exp(-0.5 * ((c - s[:, 0]) / s[:, 1]) ** 2), formula)
    yield _even("bow", (), (), lambda c, s: ((c - middle) / half) ** 2, f"((c - {middle!r})/{half!r})**2")
    yield _even("cubic", (), (), lambda c, s: ((c - middle) / half) ** 3, f"((c - {middle!r})/{half!r})**3")
    nodes, formula = (_middles(low, span, _SATURATES), span * np.array(_SOFT)), "tanh((c - at)/width)"
    yield _even("saturating", ("at", "width"), nodes, lambda c, s: np.tanh((c - s[:, 0]) / s[:, 1]), formula)
    settles, reach = "exponential" if time else "saturating", span * np.array(_REACHES)
    formula = f"1 - exp(-(c - {low!r})/reach)"
    yield _even(settles, ("reach",), reach, lambda c, s: 1 - np.exp(-(c - low) / s[:, 0]), formula)
    yield _even(settles, ("reach",), reach, lambda c, s: np.exp((c - high) / s[:, 0]), f"exp((c - {high!r})/reach)")
    period = span / np.arange(_WHOLE, min(_SINES, 0.5 * places), _BETWEEN)
    for orders in ((1,), (1, 2)) if len(period) > 1 else ():
        waves = [f"{wave}({2 * order}*pi*c/period)" for order in orders for wave in ("cos", "sin")]
        yield _even(SINE, ("period",), period, partial(_waves, orders), ";".join(waves))
    period = span / np.arange(_SEVERAL, min(_TEETH, 0.25 * places), _BETWEEN)
    if len(period) > 1:
        grid, apart = _grid(period, np.arange(_PHASES) / _PHASES)
        grid[:, 1], apart[:, 1] = grid[:, 1] * grid[:, 0], apart[:, 1] * grid[:, 0]
        yield ClosedForm("sawtooth", ("period", "at"), grid, apart, _teeth, "2/pi*atan(tan(pi*(c - at)/period))")
    width, formula = half * np.arange(1, _DEAD + 1) / (_DEAD + 1), f"sign(c - at)*max(abs(c - at) - width, 0)/{span!r}"
    nodes = np.unique(np.append(middle + half * np.array(_CENTRES), np.clip(0.0, low, high))), width
    yield _even("dead_zone", ("at", "width"), nodes, lambda c, s: _beyond(c - s[:, 0], s[:, 1]) / span, formula)


def _middles(low: float, span: float, parts: int) -> Floats:
    return low + span * (np.arange(parts) + 0.5) / parts


def _beyond(away: Floats, width: Floats) -> Floats:
    return np.asarray(np.sign(away) * np.maximum(np.abs(away) - width, 0))


def _waves(orders: Sequence[int], c: Floats, s: Floats) -> Floats:
    turns = [2 * order * np.pi * c / s[:, 0] for order in orders]
    return np.stack([wave(turn) for turn in turns for wave in (np.cos, np.sin)], axis=2)


def _teeth(c: Floats, s: Floats) -> Floats:
    turn = (c - s[:, 1]) / s[:, 0]
    return np.asarray(2 * (turn - np.round(turn)))


def _even(
    name: str, parameters: tuple[str, ...], nodes: Floats | tuple[Floats, ...], function: Function, formula: str
) -> ClosedForm:
    grid, apart = _grid(*(nodes if isinstance(nodes, tuple) else (nodes,)))
    return ClosedForm(name, parameters, grid, apart, function, formula)


def _grid(*nodes: Floats) -> tuple[Floats, Floats]:
    """All combinations (K, s) of nodes, and how far each node is from the next."""
    if not nodes:
        return np.zeros((1, 0)), np.zeros((1, 0))
    apart = [np.abs(np.gradient(each)) for each in nodes]
    return tuple(
        np.stack(np.meshgrid(*each, indexing="ij"), axis=-1).reshape(-1, len(nodes)) for each in (nodes, apart)
    )  # type: ignore[return-value]


# Lengths, in parts of the range; nodes; part of what shows that is kept
_ROUGH, _GRID, _KEPT = (0.4, 0.15, 0.05), 100, 3e-3
_TURNED = 0.3  # how readily a curve of rotation is thought of, beside a displacement
_SEEN = 1e-9  # mm, length of columns for a size that physics allows
_PARTS = (np.arange(9) - 4) / 9  # of the distance of two nodes
_HARMONICS, _FALLS = 6, 0.7  # of what repeats itself in any shape, and how large each is, over the one before


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
Families = Iterator["FunctionFamily"]


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
    cell: Ints | None = None  # (K,) in the place of which node each stands, in their order, where a grid was made finer

    @property
    def parameters(self) -> tuple[str, ...]:
        return self.shaped.parameters if self.shaped else ()

    def without(self, nodes: Ints) -> FunctionFamily:
        """All functions but some (l,)."""
        form = self.shaped
        if form is not None:
            form = replace(form, shapes=np.delete(form.shapes, nodes, 0), apart=np.delete(form.apart, nodes, 0))
        columns, values = (np.delete(each, nodes, axis=1) for each in (self.columns, self.values))
        return replace(self, columns=columns, values=values, shaped=form)

    def finer(self, nodes: Ints) -> FunctionFamily | None:
        """Finer nodes in the place of some (l,) of a form's grid, together as probable; ``None`` where there is no grid."""
        form, seen = self.shaped, self.seen
        if form is None or seen is None or not form.parameters:
            return None
        many = len(form.parameters)
        part = np.stack(np.meshgrid(*[_PARTS] * many, indexing="ij"), axis=-1).reshape(-1, many)
        shapes = (form.shapes[nodes][:, None] + part * form.apart[nodes][:, None]).reshape(-1, part.shape[1])
        lengths = [k for k, name in enumerate(form.parameters) if name in ("width", "reach", "period")]
        kept = np.all(shapes[:, lengths] > 0, axis=1)
        apart = np.repeat(form.apart[nodes], len(part), axis=0) / len(_PARTS)
        divided = replace(form, shapes=shapes[kept], apart=apart[kept])
        log_prior = self.log_prior - float(np.log(len(part)))
        cell = np.repeat(np.arange(len(nodes)), len(part))[kept]
        return replace(_of_form(self.term, divided, seen, self.covariate, log_prior), seen=None, cell=cell)


def families_of(model: RecordingModel, values: Floats, comparison: CandidateComparison) -> list[FunctionFamily]:
    """All functions of a recording, each term as probable as another; about values (k,) of the model's unknowns."""
    found = list(each_family(model, values, comparison))
    terms = len({family.term for family in found})
    seen = (family for family in found if np.linalg.norm(family.columns, axis=(0, 2)).max() > _SEEN)
    return [replace(family, log_prior=family.log_prior - float(np.log(terms))) for family in seen]


def each_family(model: RecordingModel, values: Floats, comparison: CandidateComparison) -> Families:
    """One after the other, with the log prior of each within its term: all of many observations fill a memory."""
    for of in (_of_points, _of_products, _of_observations):
        yield from of(model, values, comparison)


def _of_form(term: FunctionTerm, form: ClosedForm, seen: Seen, covariate: Floats, log_prior: float) -> FunctionFamily:
    values = UNKNOWN_SD * form.values(covariate, form.shapes)
    columns = seen(values.reshape(len(values), -1)).reshape(-1, *values.shape[1:])
    return FunctionFamily(term, form.name, columns, log_prior, covariate, values, form, seen, form.formula)


def waves(like: FunctionFamily, periods: Floats) -> Families:
    """What repeats itself and is no sine of such periods (K,): uneven, of a size and phase that wander, or of any shape.

    Together they are as probable as ``like`` says of one.
    """
    c, seen = like.covariate, like.seen or (lambda f: f)
    turn, half = 2 * np.pi * c[:, None] / periods, like.log_prior - float(np.log(2))
    orders = [np.stack([np.cos(k * turn), np.sin(k * turn)], axis=2) for k in range(1, _HARMONICS + 1)]
    smooth = list(candidate.smooth_functions(c))
    wander = [(orders[0][..., None] * f[:, None, None]).reshape(*turn.shape, -1) for f in smooth]
    repeated = UNKNOWN_SD * np.concatenate([_FALLS**k * one for k, one in enumerate(orders)], axis=2)
    for f, many in (*((one, len(smooth)) for one in wander), (repeated, 1)):
        columns = seen(f.reshape(len(c), -1)).reshape(-1, *f.shape[1:])
        yield replace(like, columns=columns, values=f, log_prior=half - float(np.log(many)), shaped=None)


def _without_curve(term: FunctionTerm, form: str, columns: Floats, log_prior: float, formula: str) -> FunctionFamily:
    nowhere = np.zeros((0, 1, columns.shape[1]))
    return FunctionFamily(term, form, columns[:, None], log_prior, np.zeros(0), nowhere, formula=formula)


def _families(term: FunctionTerm, seen: Seen, c: Floats, *, forms: bool = True, weight: float = 1.0) -> Families:
    """Of one covariate c (p,); ``seen`` gives the columns (m, q) of functions (p, q)."""
    curves = [(SMOOTH, f) for f in candidate.smooth_functions(c)]
    curves += [(ROUGH, f) for f in _rough_functions(c)] if forms else []
    every = list(forms_of(c, time=term.of == "time_s")) if forms else []
    alike = Counter([*(form for form, _ in curves), *(closed.name for closed in every)])  # each form equally probable
    log = {form: float(np.log(weight / len(alike) / many)) for form, many in alike.items()}
    for form, f in curves:
        yield FunctionFamily(term, form, seen(f)[:, None], log[form], c, f[:, None])
    for closed in every:
        yield _of_form(term, closed, seen, c, log[closed.name] - float(np.log(len(closed.shapes))))


def _rough_functions(covariate: Floats) -> Iterator[Floats]:
    """Factors (p, r), mm, of exponential covariances (Karhunen–Loève on a grid, Nyström beyond): wear, slip, uneven waves."""
    place = (covariate - covariate.min()) / float(np.ptp(covariate))
    for length, (grid, vectors, root) in zip(_ROUGH, map(_on_grid, _ROUGH), strict=True):
        yield UNKNOWN_SD * np.exp(-np.abs(place[:, None] - grid) / length) @ vectors / root


@cache
def _on_grid(length: float) -> tuple[Floats, Floats, Floats]:
    grid = np.linspace(0, 1, _GRID)
    eigenvalues, vectors = np.linalg.eigh(np.exp(-np.abs(grid[:, None] - grid) / length))
    keep = eigenvalues > _KEPT * eigenvalues[-1]
    return grid, vectors[:, keep], np.sqrt(eigenvalues[keep])


def _of_points(model: RecordingModel, values: Floats, comparison: CandidateComparison) -> Families:
    scale, points = comparison.noise_scale, model.artefact.points.at(model.where(values))
    readings = {axis: read for axis, read in points.readings.items() if np.ptp(read) > 1.0}
    arms = {axis: _centred(read) for axis, read in readings.items()}

    def moving(along: str, lever: Floats | float = 1.0) -> Seen:
        def seen(f: Floats) -> Floats:
            return np.asarray(model.seen(displaced(along, (np.asarray(lever) * f.T).T), values) / scale[:, None])

        return seen

    varied = _varied(points)
    for along in AXES:
        for axis, read in readings.items():
            yield from _families(_curve(along, _letter(axis), reading_name(axis), _variable(axis)), moving(along), read)
            for lever in (other for other in readings if other not in (axis, along)):
                term = _turning(along, axis, lever, readings[lever])
                yield from _families(term, moving(along, arms[lever]), read, forms=False, weight=_TURNED)
        for axis, other in (pair for pair in ("xy", "yz", "zx") if readings.keys() >= set(pair)):
            of = FunctionTerm(f"{axis}_mm,{other}_mm", _of_both(along, _letter(axis), other), along)
            p, q = (_arm(a, readings[a]) for a in (axis, other))
            for name, f, part, formula in _of_pair(arms[axis], arms[other], p, q):
                yield _without_curve(of, name, moving(along)(f), float(np.log(part)), formula)
        if "time_s" in varied:  # all that stands on the axis shifts
            since, time = varied["time_s"]
            yield from _families(_curve(along, in_words("time_s"), "time_s", since), moving(along), time)
        for key, (name, column) in varied.items() if along in readings else ():
            half = 0.5 * float(np.ptp(readings[along]))
            yield from _families(_scale(along, key, half, name), moving(along, readings[along] / half), column)


def _of_pair(u: Floats, v: Floats, p: str, q: str) -> Iterator[tuple[str, Floats, float, str]]:
    """Forms of two readings, from −1 to 1 and as in a formula: functions (n, r), mm, how probable, and their formula."""
    yield PRODUCT, UNKNOWN_SD * (u * v)[:, None], 1 / 3, f"{p}*{q}"
    yield BOWL, UNKNOWN_SD * np.column_stack([u**2, v**2]), 1 / 3, f"{p}**2;{q}**2"
    smooth = list(candidate.smooth_in_space(np.column_stack([u, v])))
    yield from ((SMOOTH, f, 1 / 3 / len(smooth), "") for f in smooth)


def _varied(points: Points) -> dict[str, tuple[str, Floats]]:
    """Time and temperatures that were recorded, each with its name in a formula."""
    found = {key: np.asarray(column) for key, column in points.columns.items() if key.startswith(("time_s", "temp_"))}
    since = f"(time_s + {points.start!r})" if points.start else "time_s"
    return {key: (since if key == "time_s" else key, c) for key, c in found.items() if len(np.unique(c)) > 2}


def _of_products(model: RecordingModel, values: Floats, comparison: CandidateComparison) -> Families:
    """Of a direction of travel, by as much everywhere and in proportion to a reading; and of what turns as it warms."""
    scale, points = comparison.noise_scale, model.artefact.points.at(model.where(values))
    varied, readings = _varied(points), {axis: read for axis, read in points.readings.items() if np.ptp(read) > 1.0}
    keys = [key for key in (*(f"approach_{a}" for a in AXES), *varied) if key in points.columns]
    for along, key, (axis, read) in product(AXES, keys, readings.items()):
        of = FunctionTerm(f"{key},{reading_name(axis)}", _of_both(along, in_words(key), axis), along)
        arm, formula, part = _centred(read)[:, None], _arm(_variable(axis), read), _TURNED
        if key in varied:
            f, formula = _centred(varied[key][1])[:, None] * arm, f"{_arm(*varied[key])}*{formula}"
        else:
            f, formula, part = points.columns[key][:, None] * np.hstack([arm**0, arm]), f"{key};{key}*{formula}", 1.0
        seen = model.seen(displaced(along, UNKNOWN_SD * f), values) / scale[:, None]
        yield _without_curve(of, PRODUCT, seen, float(np.log(part)), formula)


def _of_observations(model: RecordingModel, values: Floats, comparison: CandidateComparison) -> Families:
    scale = comparison.noise_scale
    for key, mean in candidate.means_of_columns(model).items():
        if len(np.unique(mean)) > 2:
            title = say("error as a function of {name}", name=in_words(key))
            yield from _families(FunctionTerm(key, title), lambda f: f / scale[:, None], mean)
    for one in (e for e in comparison.explanations if e.kind == UNKNOWN and e.covariate is None):
        for each in one.members:
            log = -float(np.log(len(one.members)))
            yield _without_curve(FunctionTerm(str(one.name), one.name), SMOOTH, each.columns / scale[:, None], log, "")


def _letter(axis: str) -> Text:
    return Verbatim(axis.upper())


def _of_both(along: str, one: Text, other: str) -> Text:
    way, across = _letter(along), _letter(other)
    return say("error along {direction} as a function of {axis} and {other}", direction=way, axis=one, other=across)


def _curve(along: str, one: Text, of: str, variable: str) -> FunctionTerm:
    words = say("error along {direction} as a function of {axis}", direction=_letter(along), axis=one)
    return FunctionTerm(of, words, along, variable=variable)


def _scale(axis: str, key: str, half: float, variable: str) -> FunctionTerm:
    of_time = say("scale of {axis} as a function of time", axis=_letter(axis))
    other = say("scale of {axis} as a function of {name}", axis=_letter(axis), name=in_words(key))
    return FunctionTerm(key, of_time if key == "time_s" else other, axis, axis, f"*{axis}/{half!r}", variable)


def _turning(along: str, axis: str, lever: str, arm: Floats) -> FunctionTerm:
    title = say("error along {direction} as a function of {axis}, in proportion to {lever}",
                direction=_letter(along), axis=_letter(axis), lever=_letter(lever))  # fmt: skip
    middle, half = float(0.5 * (arm.min() + arm.max())), 0.5 * float(np.ptp(arm))
    factor = f"*({_variable(lever)} - {middle!r})/{half!r}"
    return FunctionTerm(reading_name(axis), title, along, lever, factor, _variable(axis))


def _variable(axis: str) -> str:
    """What it reads, in a formula."""
    return axis if axis in AXES else reading_name(axis)


def _centred(readings: Floats) -> Floats:
    """From −1 to 1 over what was read."""
    return np.asarray((readings - 0.5 * (readings.min() + readings.max())) / (0.5 * np.ptp(readings)))


def _arm(axis: str, readings: Floats) -> str:
    low, span = float(readings.min()), float(np.ptp(readings))
    return f"(({axis} - {low + 0.5 * span!r})/{0.5 * span!r})"
