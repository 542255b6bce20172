"""What a simulation may have got wrong: by how much the observations would be predicted otherwise with each mistake put right.

Errors are taken as they are predicted at the recorded points; where they are looked up elsewhere, a map says them, or a
polynomial through a file's predicted errors as far as one follows these. What is exchanged by number is exchanged in the
observations, as a table of deviations is that was joined wrongly.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from functools import cached_property, partial
from itertools import combinations, permutations, product

import numpy as np

from cmm_uq.analysis.diagnosis.comparison.evidence import CandidateComparison
from cmm_uq.base.messages import Text, Verbatim, commas, number, say
from cmm_uq.base.points import AXES, Floats, Ints, Points
from cmm_uq.base.units import Unit, unit
from cmm_uq.base.values import dataclass, replace
from cmm_uq.machine.model import RecordingModel
from cmm_uq.machine.model.predicted_errors import PredictedErrors

_MOST_ROWS = 1500  # exchanges that are tried of each kind of points and set-ups
VALUES = 41  # of a free parameter that are tried at a time
_FACTORS = (-2.0, 3.0)  # range of a free factor
_EXACT = 0.01  # largest part of the predicted errors' variance that is uncertain, for a factor to be estimated
_LONGER = (-100.0, 100.0)  # ppm, of a free length
_AWAY = 0.25  # largest shift, over the extent of the recording
# Of a polynomial: part of the predicted errors that it may leave, well and at most; its largest degree; its coefficients over
# the observations at most; singular values that count as none
_FOLLOWED, _ROUGHLY, _DEGREES, _SHARE, _SINGULAR = 0.01, 0.1, 3, 0.75, 1e-6

ONE = unit("1")


@dataclass(frozen=True, eq=False)
class Hypothesis:
    """One mistake: by how much the observations (m, v) would be predicted larger without it, mm, at values (v,) of it."""

    name: str  # in results.json
    family: str
    title: Callable[[Text, Text], Text]  # of its value and the uncertainty of that
    remedy: Text
    change: Floats
    values: Floats
    again: Callable[[Floats], Floats] | None = None  # (m, v) of other values within those given
    unit: Unit = ONE

    @classmethod
    def fixed(cls, name: str, family: str, title: Text, remedy: Text, change: Floats) -> Hypothesis:
        return cls(name, family, lambda value, u: title, remedy, change[:, None], np.zeros(1))


def _free(
    name: str, family: str, title: Callable[[Text, Text], Text], remedy: Text, ends: tuple[float, float],
    change: Callable[[Floats], Floats], of: Unit,
) -> Hypothesis:  # fmt: skip
    """Any value between two ends."""
    values = np.linspace(*ends, VALUES)
    return Hypothesis(name, family, title, remedy, change(values), values, change, of)


@dataclass(frozen=True, eq=False)
class PredictedObservations:
    """What a simulation predicts, as a model of the recording sees it."""

    model: RecordingModel
    values: Floats
    found: PredictedErrors
    of: Points  # the points that ``found`` is of

    @cached_property
    def rows(self) -> Ints:
        def keys(points: Points) -> Iterator[tuple[int, int, int]]:
            return zip(points.measurement.tolist(), points.point.tolist(), points.repeat.tolist(), strict=True)

        known = {key: i for i, key in enumerate(keys(self.of))}
        return np.array([known[key] for key in keys(self.model.artefact.points)], dtype=np.int64)

    def seen(self, errors: Floats) -> Floats:
        """What used observations show (m, …), mm, of errors (n, 3, …) of all points."""
        columns = errors.reshape(*errors.shape[:2], -1)
        return -self.model.seen(columns[self.rows], self.values).reshape(-1, *errors.shape[2:])

    @cached_property
    def usual(self) -> Floats:
        return self.seen(self.found.errors)

    @cached_property
    def ends(self) -> tuple[Floats, Floats]:
        """(3,) mm of the scales, between which the machine travels; where nobody says it, of the recording."""
        travel, readings = self.of.machine.travel_mm, self.of.machine_xyz
        known = np.isfinite(travel).all(axis=1)
        return np.where(known, travel[:, 0], readings.min(axis=0)), np.where(known, travel[:, 1], readings.max(axis=0))


def hypotheses(p: PredictedObservations, comparison: CandidateComparison) -> Iterator[Hypothesis]:
    yield from _factors(p)
    yield from _lengths(p)
    yield from exchanged_rows(p)
    mend = say("Mend the tables of the simulation's map.")
    for name, (title, errors) in p.found.tables.items():
        yield Hypothesis.fixed(name, "tables", title, mend, p.seen(errors) - p.usual)
    field = p.found.at or (None if p.found.of_lengths else _Polynomial.of(p, comparison))
    if field is not None:
        yield from _elsewhere(p, field)
        yield from _shifts(p, field)


def _factors(p: PredictedObservations) -> Iterator[Hypothesis]:
    """All errors the other way, not there, twice, in another unit, or any number of times."""
    turn = say("Turn the sign of these errors round in the simulation.")
    sign = say("all predicted errors have the other sign")
    yield Hypothesis.fixed("sign", "factor", sign, turn, -2 * p.usual)
    remedy = say(
        "Look in the simulation, and in the machine's compensation, for what would apply these errors so many times."
    )
    factors = {"not_applied": 0.0, "half": 0.5, "twice": 2.0, "inches": 1 / 25.4, "millimetres": 25.4}
    for name, factor in factors.items():
        title = say("the machine has the predicted errors {factor} times", factor=number(factor, ".3g"))
        yield Hypothesis.fixed(name, "factor", title, remedy, (factor - 1) * p.usual)

    def named(value: Text, u: Text) -> Text:
        return say("the machine has the predicted errors {factor} ± {u} times", factor=value, u=u)

    # of errors that are not exact themselves the factor would come out too near to none
    if np.mean(p.found.u**2) <= _EXACT * np.mean(p.usual**2):
        yield _free("factor", "factor", named, remedy, _FACTORS, lambda v: p.usual[:, None] * (v - 1), unit("1"))


def _lengths(p: PredictedObservations) -> Iterator[Hypothesis]:
    """The artefact simulated at another temperature, or of another length."""
    artefact, used = p.model.artefact, p.model.used
    which = [i for i, size in enumerate(artefact.sizes) if size.role == "dimension"]
    length = artefact.size_change()[used][:, which] @ np.array([artefact.sizes[i].nominal for i in which])
    remedy = say(
        "Say in [simulation] of which length or temperature the artefact was simulated: length_mm, temperature_c."
    )
    if p.found.expansion is not None:
        longer = (p.found.expansion[p.rows] - 1)[artefact.rows[used]].mean(axis=1) * length
        cold = say("the artefact was simulated at 20 °C, and recorded warmer or colder")
        yield Hypothesis.fixed("expansion_not_applied", "length", cold, remedy, longer)
        twice = say("the expansion of the artefact is predicted twice")
        yield Hypothesis.fixed("expansion_twice", "length", twice, remedy, -longer)

    def named(value: Text, u: Text) -> Text:
        return say("the artefact was simulated {ppm} ± {u} ppm too long", ppm=value, u=u)

    yield _free("length", "length", named, remedy, _LONGER, lambda v: -1e-6 * length[:, None] * v, unit("ppm"))


def _upper(axes: list[str] | str) -> Text:
    return commas([Verbatim(axis.upper()) for axis in axes])


Field = Callable[[Floats], Floats]  # errors (n, 3) mm of the points, had the scales read (n, 3) mm


def _elsewhere(p: PredictedObservations, field: Field) -> Iterator[Hypothesis]:
    """Axes with the other sign, exchanged, or counted from their other end."""

    def put_right(name: str, family: str, title: Text, remedy: Text, turn: Floats, place: Floats, ends: Floats) -> None:
        """Where a simulation takes errors e(r) for turn · e(place · r + ends)."""
        if isinstance(field, _Polynomial):
            change = field.put_right(turn, place, ends)
        else:
            still = np.array_equal(place, np.eye(3))
            errors = p.found.errors if still else field((p.of.machine_xyz - ends) @ np.linalg.inv(place).T)
            change = p.seen(errors @ np.linalg.inv(turn).T) - p.usual
        if change is not None:
            found.append(Hypothesis.fixed(name, family, title, remedy, change))

    found: list[Hypothesis] = []
    none, same = np.zeros(3), np.eye(3)
    for flips in list(product((1.0, -1.0), repeat=3))[1:-1]:
        turned = [axis for axis, flip in zip(AXES, flips, strict=True) if flip < 0]
        title = say("predicted errors along {axes} have the other sign", axes=_upper(turned))
        remedy = say("Turn the sign of these errors round in the simulation.")
        put_right(f"sign_{''.join(turned)}", "axes' signs", title, remedy, np.diag(flips), same, none)
    for order in list(permutations(range(3)))[1:]:
        axes, turn = "".join(AXES[i] for i in order), same[list(order)]
        others = _upper([a for a, b in zip(AXES, axes, strict=True) if a != b])
        remedy = say("Exchange {axes} in the simulation's errors or their map.", axes=others)
        title = say("errors predicted along X, Y, Z are those along {axes}", axes=_upper(axes))
        put_right(f"components_{axes}", "axes", title, remedy, turn, same, none)
        title = say("errors are looked up at coordinates in the order {axes}", axes=_upper(axes))
        put_right(f"transposed_{axes}", "axes", title, remedy, same, turn, none)
        title = say("X, Y, Z are {axes} throughout the simulation's errors", axes=_upper(axes))
        put_right(f"axes_{axes}", "axes", title, remedy, turn, turn, none)
    for own, axis in zip(same, AXES, strict=True):
        back, ends, named = same - 2 * np.diag(own), own * sum(p.ends), Verbatim(axis.upper())
        remedy = say("Count positions along {axis} from the other end in the simulation's map.", axis=named)
        title = say("positions along {axis} are counted from the wrong end", axis=named)
        put_right(f"from_the_end_{axis}", "place", title, remedy, same, back, ends)
        title = say(
            "positions along {axis} are counted from the wrong end, and errors along it the wrong way", axis=named
        )
        put_right(f"reversed_{axis}", "place", title, remedy, back, back, ends)
    yield from found


def _shifts(p: PredictedObservations, field: Field) -> Iterator[Hypothesis]:
    """The errors looked up off along an axis."""
    readings = p.of.machine_xyz
    usual = p.seen(field(readings))

    def change(own: Floats, values: Floats) -> Floats:
        return np.column_stack([p.seen(field(readings - value * own)) - usual for value in values])

    def named(axis: Text, value: Text, u: Text) -> Text:
        return say("errors are looked up {shift} ± {u} mm too far along {axis}", shift=value, u=u, axis=axis)

    for own, axis in zip(np.eye(3), AXES, strict=True):
        letter, most = Verbatim(axis.upper()), _AWAY * float(np.ptp(readings @ own))
        remedy = say("Shift the simulation's map along {axis}, or mend its origin.", axis=letter)
        if most > 0:
            shifts = (-most, most), partial(change, own), unit("mm")
            yield _free(f"shift_{axis}", "place", partial(named, letter), remedy, *shifts)


@dataclass(frozen=True, eq=False)
class _Polynomial:
    """A field of errors that shows as a file's predicted ones do.

    Lengths and placed artefacts do not show how a field turns. As in the project's effects an axis that leans moves what is
    along the former axes: the simulation put right has no e_y ∝ x, e_z ∝ x, e_z ∝ y. Rotations have their levers from the
    zeros of the scales, and curves no slope in the middle of the travel.
    """

    p: PredictedObservations
    comparison: CandidateComparison
    powers: Ints  # (t, 3) of the readings, of one axis about the middle of its travel
    coefficients: Floats  # (t, 3)

    @classmethod
    def of(cls, p: PredictedObservations, comparison: CandidateComparison) -> _Polynomial | None:
        """Of the least degree that follows the predicted errors; ``None`` where none does."""
        left, best = _ROUGHLY, None
        for degree in range(1, _DEGREES + 1):
            powers = np.array([each for each in product(range(degree + 1), repeat=3) if 0 < sum(each) <= degree])
            if 3 * len(powers) > _SHARE * comparison.degrees_of_freedom or left < _FOLLOWED:
                break
            field = cls(p, comparison, powers, np.zeros((len(powers), 3)))
            each, rest = field.fitted(field.seen(p.of.machine_xyz, np.eye(3)))
            if rest < left:
                left, best = rest, replace(field, coefficients=each.reshape(-1, 3))
        return best

    def __call__(self, readings: Floats) -> Floats:
        return np.asarray(self.terms(readings) @ self.coefficients)

    def terms(self, readings: Floats) -> Floats:
        low, high = self.p.ends
        middle = np.where((self.powers > 0).sum(axis=1, keepdims=True) > 1, 0.0, 0.5 * (low + high))
        return np.asarray(np.prod((2 * (readings[:, None, :] - middle) / (high - low).max()) ** self.powers, axis=2))

    def seen(self, readings: Floats, turn: Floats) -> Floats:
        """What observations show (m, 3t), mm, of each term at some readings, turned."""
        whole = np.einsum("nt,ij->nitj", self.terms(readings), turn)
        return self.p.seen(whole.reshape(len(readings), 3, -1))

    def fitted(self, columns: Floats) -> tuple[Floats, float]:
        """Coefficients of columns by which they follow the predicted errors, and the part that they leave."""
        target, rest = (self.comparison.rest_of(each) for each in (self.p.usual[:, None], columns))
        each = np.asarray(np.linalg.lstsq(rest, target[:, 0], rcond=_SINGULAR)[0], dtype=np.float64)
        return each, float(np.linalg.norm(target[:, 0] - rest @ each)) / max(float(np.linalg.norm(target)), 1e-300)

    def put_right(self, turn: Floats, place: Floats, ends: Floats) -> Floats | None:
        readings = self.p.of.machine_xyz
        leaning = (self.powers.sum(axis=1) == 1)[:, None] & (self.powers @ np.tri(3, k=-1).T > 0)
        kept = np.flatnonzero(~leaning.ravel())
        mistaken = self.seen(readings @ place.T + ends, turn)[:, kept]
        each, left = self.fitted(mistaken)
        return None if left > _ROUGHLY else (self.seen(readings, np.eye(3))[:, kept] - mistaken) @ each


Key = tuple[int, int]  # measurement and point


def exchanged_rows(p: PredictedObservations) -> Iterator[Hypothesis]:
    """Points or set-ups numbered otherwise in the prediction."""
    artefact, used = p.model.artefact, p.model.used
    points, remedy = artefact.points.point[artefact.rows[used, 0]], say("Number the prediction as the recording.")
    each = list(zip(*(x.tolist() for x in (artefact.measurement[used], points, artefact.repeat[used])), strict=True))
    count, index = dict[tuple[int, ...], int](), dict[tuple[int, ...], int]()
    for i, key in enumerate(each):  # a point may have several observations
        count[key] = count.get(key, -1) + 1
        index[*key, count[key]] = i
    numbers = sorted({key[0] for key in each})
    numbering = _Numbering(numbers, {n: sorted({key[1] for key in each if key[0] == n}) for n in numbers})
    for name, title, other in numbering.exchanges():
        order = [index.get((*other((key[0], key[1])), *key[2:]), i) for key, i in index.items()]
        if np.any(change := p.usual[order] - p.usual):
            yield Hypothesis.fixed(name, name.rstrip("0123456789_"), title, remedy, change)


@dataclass(frozen=True, eq=False)
class _Numbering:
    numbers: list[int]  # set-ups, and the points of each
    points: dict[int, list[int]]

    def exchanges(self) -> Iterator[tuple[str, Text, Callable[[Key], Key]]]:
        """Name, title, and whose row stands in the place of a set-up's point."""
        numbers, last = self.numbers, self.numbers[::-1]
        yield "points_reversed", say("points are numbered from the other end in every set-up"), self.back

        def renumbered(others: Sequence[int], key: Key) -> Key:
            return others[numbers.index(key[0])], key[1]

        yield "set_ups_reversed", say("set-ups are numbered from the other end"), partial(renumbered, last)
        for name, by in (("next", 1), ("previous", -1)):
            on = partial(renumbered, [*numbers[by:], *numbers[:by]])
            yield f"set_ups_on_{name}", say("set-ups are numbered one on, or one back"), on
        for n in numbers if len(numbers) > 1 else ():
            title = say("points are numbered from the other end in set-up {number}", number=n)
            yield f"points_reversed_in_{n}", title, partial(self.back, only=n)
        both, every = (list(combinations(each, 2)) for each in (numbers, sorted(set().union(*self.points.values()))))
        for pair in both if len(both) <= _MOST_ROWS else ():
            title = say("set-ups {one} and {other} are exchanged", one=pair[0], other=pair[1])
            yield f"set_ups_{pair[0]}_{pair[1]}", title, partial(_swapped, pair, 0)
        for pair in every if len(every) <= _MOST_ROWS else ():
            title = say("points {one} and {other} are exchanged in every set-up", one=pair[0], other=pair[1])
            yield f"points_{pair[0]}_{pair[1]}", title, partial(_swapped, pair, 1)

    def back(self, key: Key, only: int | None = None) -> Key:
        own = self.points[key[0]]
        return key if only not in (None, key[0]) else (key[0], own[len(own) - 1 - own.index(key[1])])


def _swapped(pair: Key, part: int, key: Key) -> Key:
    other = sum(pair) - key[part] if key[part] in pair else key[part]
    return (other, key[1]) if part == 0 else (key[0], other)
