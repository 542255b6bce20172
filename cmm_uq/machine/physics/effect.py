"""What an effect is: a named piece of physics that moves points; families of effects, and effects of one common size.

The sign rule is *true = indicated + e*. An effect gives e, in mm, for points read on a machine. Almost every parameter
enters e linearly; such an effect only gives its :meth:`~Effect.basis`, and Jacobian, evidence and marginal posterior are
exact linear algebra. What is truly nonlinear (a period) is a *shape* of the basis, to be searched or sampled.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping, Sequence
from itertools import product

import numpy as np

from cmm_uq.base.errors import CmmUqError, suggestion
from cmm_uq.base.messages import NOTHING, Argument, Message, Text, Verbatim, fields_of
from cmm_uq.base.points import AXES, Floats, Points
from cmm_uq.base.units import Unit, unit
from cmm_uq.base.values import dataclass, replace

# blanks in words: the axes, and of the reported amount its size, side and sense, and the size of a second parameter
_BLANKS = ("axis", "other", "size", "side", "sense", "second")
AXIS, OTHER, SIZE, SIDE, SENSE, SECOND = (Verbatim(f"‹{blank}›") for blank in _BLANKS)
# what stands for them in a pattern
BLANKS: Mapping[str, Text] = {
    "axis": AXIS, "other": OTHER, "direction": OTHER, "about": OTHER, "size": SIZE, "amplitude": SIZE, "side": SIDE,
    "sense": SENSE, "more": SENSE, "wrong": SENSE, "where": SECOND, "period": SECOND, "settling": SECOND,
}  # fmt: skip


def say(pattern: str, /, **arguments: Argument) -> Message:
    """Words of an effect: what its pattern names without an argument is a blank."""
    known = {**BLANKS, **arguments}
    return Message(pattern, {name: known[name] for name in sorted(fields_of(pattern))})


def filled(text: Text, blanks: Mapping[Text, Text]) -> Text:
    """A message with its blanks filled in."""
    if not isinstance(text, Message):
        return text
    given = text.arguments.items()
    return Message(text.pattern, {k: blanks.get(v, v) if isinstance(v, Text) else v for k, v in given})


@dataclass(frozen=True)
class Amount:
    """How much of a parameter, for a sentence: without its sign, with unit and uncertainty, as printed; and the sign."""

    size: Text
    negative: bool = False

    @property
    def side(self) -> Text:
        return say("minus") if self.negative else say("plus")

    def more(self, more: Text, less: Text) -> Text:
        """The one word for a positive amount, the other for a negative one."""
        return less if self.negative else more


# the mechanism whose displacements are along the axes of the coordinates, which turn with a table
ARTEFACT = "artefact"
# tiers: effects that every job file may count on, rarer ones, and faults of the artefact itself
CONTRACT, FURTHER, OWN = "contract", "further", "own"
# how readily an effect of a tier is thought of: a judgement of how many machines show it
PRIOR_WEIGHT = {CONTRACT: 1.0, FURTHER: 0.1, OWN: 0.1}
TRIALS, EVEN = 7, 19  # values of a nonlinear parameter, and of one that is uniform itself


@dataclass(frozen=True)
class Parameter:
    """A number that describes how large an effect is."""

    name: str  # with its unit, as in results.json: ``angle_arcsec``
    unit: Unit  # as printed: ``″``
    prior_sd: float  # standard deviation that physics allows, about zero, in the same unit
    what: Text = NOTHING  # it is, in words, where an effect has several: ``amplitude``

    def __post_init__(self) -> None:
        object.__setattr__(self, "unit", unit(self.unit))


@dataclass(frozen=True)
class Shape:
    """A nonlinear parameter: it shapes the basis, between two bounds, uniform in its logarithm or ``even``."""

    name: str
    unit: Unit
    low: float
    high: float
    period_along: str | None = None  # the axis (x, y, z) of whose reading it is a period, if it is one
    what: Text = NOTHING
    even: bool = False  # whether it is uniform itself

    def __post_init__(self) -> None:
        object.__setattr__(self, "unit", unit(self.unit))


@dataclass(frozen=True)
class Nonparametric:
    """A function of no particular form, as a diagnosis fits one: what it is a function of, and what it changes."""

    of: str  # the covariate: a reading (``x_mm``) or a column (``time_s``)
    along: str | None = None  # axis along which it displaces points; ``None`` for a term of the observations themselves
    scale: bool = False  # whether the displacement grows in proportion to the reading of that axis


class Effect(ABC):
    """One physical cause of a difference between true and indicated coordinates."""

    name: str  # as in ``[model] effects``
    title: Text  # in words, for certificates
    formula: str  # e with its sign, for documents; a and b are the axes in the name
    # where the cause lies: scale, drive, guideway, frame, temperature, probe, controller, artefact, …
    mechanism: str = ""
    points_to: Text  # what a service technician should look at, to follow "What it points to:"; without a full stop
    coefficients: tuple[Parameter, ...]  # what enters e linearly, k of them
    shape: tuple[Shape, ...] = ()  # what shapes the basis, if anything
    columns: tuple[str, ...] = ()  # that the recording must have
    tier: str = CONTRACT  # or ``further``: how readily it is to be thought of
    # whether every machine, or artefact, has it to some degree, so that a diagnosis takes all such
    everywhere: bool = False
    idealised_over: str | None = None  # axis, or column, over which its form is the simplest of many of its mechanism
    imitated_by: tuple[Nonparametric, ...] = ()  # nonparametric terms that could pass for it
    stands_for: tuple[Nonparametric, ...] = ()  # nonparametric terms that are nothing else than it
    along_motion: str | None = None  # carriage along whose motion e goes, however that leans; ``None``: the coordinates
    # pair of axes whose squareness it is (``xy``, ``yz``, ``zx``); it then gives its :meth:`lean`
    plane: str | None = None
    of_artefact: bool = False  # whether it is a fault of the artefact itself, which only that artefact can say in full
    stated: bool = False  # whether its prior sd is of a bound that somebody states, and not what physics allows
    of_family: str | None = None  # family of errors whose size it shares, where that is not the one of its class
    mostly: float = 1.0  # part of its prior sd that it mostly keeps to, where a certificate says so and may be wrong
    means: Text = NOTHING  # what a reported amount means at the machine, in words with blanks; see :meth:`meaning`
    sense: tuple[Text, Text] = (NOTHING, NOTHING)  # a word for a positive and for a negative amount, where these differ

    @property
    def prior_weight(self) -> float:
        """How readily it is thought of in a diagnosis, beside others."""
        return PRIOR_WEIGHT[self.tier]

    @abstractmethod
    def basis(self, points: Points, shape: Sequence[float] = ()) -> Floats:
        """Displacement e of every point for one unit of each coefficient, (n, 3, k) in mm along the machine's axes.

        A ``CmmUqError`` where a column or a machine's figure is missing.
        """

    def travelled(self, points: Points) -> Floats:
        """(n, k) of it along the axis of ``along_motion``, mm, which is all that an effect does that has one."""
        return self.basis(points)[:, AXES.index(str(self.along_motion))]

    def unfit(self, points: Points) -> CmmUqError | None:
        """Why a job of these points cannot name it, if so."""
        return None

    def lean(self, points: Points) -> Floats:
        """Angle between the axes of ``plane`` less 90°, rad, for one unit of the coefficient: () or (n,)."""
        raise CmmUqError(f"{self.name} is no squareness")

    def meaning(self, amounts: Mapping[str, Amount]) -> Text:
        """What reported parameters, by name, mean at the machine, with their signs; nothing where the figures say it."""
        if not self.means:
            return NOTHING
        nothing = Amount(NOTHING)
        first, second, *_ = (*(amounts.get(parameter.name, nothing) for parameter in self.reported), nothing)
        sense = first.more(*self.sense)
        return filled(self.means, {SIZE: first.size, SIDE: first.side, SENSE: sense, SECOND: second.size})

    def belongs_to(self, points: Points) -> bool:
        """Whether a fault of an artefact is that of the artefact in these points."""
        return False

    def shown_in(self, points: Points) -> bool:
        """Whether a recording has the set-ups that it takes to know it from an offset of each set-up."""
        return True

    def course(self, points: Points) -> Floats | None:
        """Where each point is on the axis, or in the column, of ``idealised_over``, (n,); ``None`` without one."""
        if (over := self.idealised_over) is None:
            return None
        return points.readings[over] if over in points.readings else points.column(over)

    def trials(self) -> Iterator[tuple[float, ...]]:
        """Values of the shape worth trying, evenly spread in their logarithm, or themselves; an empty tuple without one."""
        each = (np.linspace(s.low, s.high, EVEN) if s.even else np.geomspace(s.low, s.high, TRIALS) for s in self.shape)
        yield from product(*(values.tolist() for values in each))

    @property
    def reported(self) -> tuple[Parameter | Shape, ...]:
        """The parameters as reported, in order; the linear ones first unless an effect says otherwise."""
        return (*self.coefficients, *self.shape)

    def to_reported(self, coefficients: Floats, shape: Floats) -> dict[str, Floats]:
        """Reported parameters of coefficients (..., k) and shapes (..., s), each (...)."""
        values = np.concatenate([coefficients, shape], axis=-1)
        return {parameter.name: values[..., i] for i, parameter in enumerate(self.reported)}

    def from_reported(self, parameters: Mapping[str, float]) -> tuple[Floats, tuple[float, ...]]:
        """Coefficients (k,) and shape of reported parameters; a ``CmmUqError`` where one is missing or unknown."""
        names = [parameter.name for parameter in self.reported]
        for name in parameters:
            if name not in names:
                raise CmmUqError(f"{self.name} has no parameter {name!r}", fix=suggestion(name, names))
        for name in names:
            if name not in parameters:
                raise CmmUqError(f"{self.name} needs the parameter {name!r}")
        return self._coefficients(parameters), tuple(float(parameters[s.name]) for s in self.shape)

    def _coefficients(self, parameters: Mapping[str, float]) -> Floats:
        return np.array([parameters[c.name] for c in self.coefficients], dtype=np.float64)

    def displacement(self, points: Points, parameters: Mapping[str, float]) -> Floats:
        """Displacement e of every point for reported parameters, (n, 3) in mm."""
        coefficients, shape = self.from_reported(parameters)
        return np.asarray(self.basis(points, shape) @ coefficients, dtype=np.float64)


class Family(Effect):
    """One of several effects that differ by axes.

    Their letters fill the blanks of its words, and ``{a}`` and ``{b}`` in names of columns and in what imitates it.
    """

    family: str  # first part of the name

    def __init__(self, axis: str = "", *others: str) -> None:
        self.axis, self.other = axis, others[0] if others else axis
        self.name = "_".join(filter(None, (self.family, axis, *others)))

        def lettered(text: str) -> str:
            return text.format(a=axis, b=self.other)

        self.columns = tuple(map(lettered, self.columns))
        self.idealised_over = self.idealised_over and lettered(self.idealised_over)
        self.imitated_by = tuple(
            replace(one, of=lettered(one.of), along=one.along and lettered(one.along)) for one in self.imitated_by
        )
        self.shape = tuple(replace(one, period_along=axis) if one.period_along else one for one in self.shape)
        self.fill({AXIS: axis, OTHER: self.other})

    def fill(self, letters: Mapping[Text, str]) -> None:
        blanks: dict[Text, Text] = {blank: Verbatim(letter.upper()) for blank, letter in letters.items()}
        words = self.title, self.points_to, self.means
        self.title, self.points_to, self.means = (filled(text, blanks) for text in words)


class OfAxis(Family):
    """An effect along the motion of one carriage."""

    def __init__(self, axis: str) -> None:
        super().__init__(axis)
        self.along_motion = axis

    @abstractmethod
    def component(self, points: Points, shape: Sequence[float]) -> Floats:
        """Displacement of every point along the axis for one unit of the coefficient, (n,) mm."""

    def basis(self, points: Points, shape: Sequence[float] = ()) -> Floats:
        return along(self.axis, self.component(points, shape))


class Harmonic(Effect):
    """An effect A·sin(… + φ) or A·cos(… + φ): linear in A·cos φ and A·sin φ, reported as amplitude and phase."""

    amplitude: Parameter

    @property
    def reported(self) -> tuple[Parameter | Shape, ...]:
        return (self.amplitude, *self.shape, Parameter("phase_rad", unit("rad"), np.pi, say("phase")))

    def to_reported(self, coefficients: Floats, shape: Floats) -> dict[str, Floats]:
        """Amplitude ≥ 0, shape, and phase in (−π, π]."""
        cosine, sine = coefficients[..., 0], coefficients[..., 1]
        return {
            self.amplitude.name: np.hypot(cosine, sine),
            **{s.name: shape[..., i] for i, s in enumerate(self.shape)},
            "phase_rad": np.arctan2(sine, cosine),
        }

    def _coefficients(self, parameters: Mapping[str, float]) -> Floats:
        amplitude, phase = parameters[self.amplitude.name], parameters["phase_rad"]
        return np.array([amplitude * np.cos(phase), amplitude * np.sin(phase)])


def along(axis: str, component: Floats) -> Floats:
    """A basis (n, 3, k) that moves points along one axis by ``component`` (n,) or (n, k), mm."""
    columns = component.reshape(len(component), -1)
    basis = np.zeros((len(columns), 3, columns.shape[1]))
    basis[:, "xyz".index(axis)] = columns
    return basis


SEED = "seed"  # beside the size, in a truth: which of all errors of this size
_GRID, _HELD = 2000, 1e-9  # of sizes; part of the largest variance below which a combination is held
# multiples of it spread evenly over the unit interval, and neighbours lie apart: draws of a chain share nothing with them
_GOLDEN = 0.5 * (np.sqrt(5.0) - 1.0)


class CommonSize(Effect):
    """Errors of many coefficients of which only the common size is known beforehand, in the unit of the coefficients.

    Reported is the root mean square of what they do. Its draws are those of a posterior in which that size is known as well
    as the coefficients tell it: without that, noise would add to it.
    """

    size: Parameter

    @property
    def reported(self) -> tuple[Parameter | Shape, ...]:
        return (self.size,)

    def errors(self, coefficients: Floats) -> Floats:
        """(…, j) what coefficients (…, k) are of, in their unit: the coefficients themselves, where nothing else is said."""
        return coefficients

    def to_reported(self, coefficients: Floats, shape: Floats) -> dict[str, Floats]:
        """Root mean square of the errors, for one vector of coefficients, or for each of many draws (N, k)."""
        errors = self.errors(coefficients)
        if errors.ndim == 2 and len(errors) > 1:
            mean = errors.mean(axis=0)
            v, axes = np.linalg.eigh(np.atleast_2d(np.cov(errors, rowvar=False)))
            v = np.maximum(v, 0.0)
            about, c = (errors - mean) @ axes, mean @ axes
            free = v > _HELD * v.max(initial=0.0)  # what no coefficient does is no error
            k = np.ones(errors.shape)
            if free.any():
                squares = _sizes(c[free], v[free], len(errors))[:, None] ** 2
                k[:, free] = squares / (squares + v[free])
            errors = np.asarray((k * c + np.sqrt(k) * about) @ axes.T, dtype=np.float64)
        return {self.size.name: np.sqrt(np.mean(errors**2, axis=-1))}

    def from_reported(self, parameters: Mapping[str, float]) -> tuple[Floats, tuple[float, ...]]:
        """Coefficients (k,) of exactly this size, drawn by the ``seed`` that may stand beside it."""
        for name in parameters:
            if name not in (self.size.name, SEED):
                raise CmmUqError(f"{self.name} has no parameter {name!r}", fix=suggestion(name, [self.size.name, SEED]))
        if self.size.name not in parameters:
            raise CmmUqError(f"{self.name} needs the parameter {self.size.name!r}")
        seed = parameters.get(SEED, 0.0)
        if seed < 0 or seed != int(seed):
            raise CmmUqError(f"{self.name}: seed = {seed:g} is no whole number", fix="Give 0, 1, 2, …")
        drawn = np.random.default_rng(int(seed)).standard_normal(len(self.coefficients))
        rms = float(np.sqrt(np.mean(self.errors(drawn) ** 2)))
        return drawn * (parameters[self.size.name] / rms if rms > 0 else 0.0), ()


def _sizes(c: Floats, v: Floats, count: int) -> Floats:
    """(count,) sizes of their posterior, given errors c (j,) of variances v (j,): even probabilities in mixed order."""
    part = (np.arange(_GRID) + 0.5) / _GRID
    turn = 0.5 * np.pi * part
    s = np.sqrt(np.mean(c**2) + np.mean(v)) * np.tan(turn)  # the whole half line
    variance = s[:, None] ** 2 + v
    logs = -0.5 * np.sum(c**2 / variance + np.log(variance), axis=1) - 2.0 * np.log(np.cos(turn))
    weights = np.exp(logs - logs.max())
    probability = (np.cumsum(weights) - 0.5 * weights) / weights.sum()
    return np.asarray(np.interp((np.arange(1, count + 1) * _GOLDEN) % 1.0, probability, s), dtype=np.float64)
