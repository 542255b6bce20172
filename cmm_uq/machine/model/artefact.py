"""What an artefact is: how points become observations, and what it leaves undetermined, set-up by set-up.

An artefact of known sizes, placed somewhere on the table, says where its points truly are up to that placing: where would they
lie, placed as well as the recording allows (:meth:`~Artefact.fit`)? Along which directions does a recording speak about errors
(:meth:`~Artefact.project`)? What remains free (:meth:`~Artefact.placing`, and sizes without a certificate)?
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterable, Mapping
from functools import cached_property
from typing import ClassVar, Literal

import numpy as np
import scipy
from numpy.typing import NDArray

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.messages import NOTHING, Text, foreign, say
from cmm_uq.base.points import AXES, Floats, Ints, Points
from cmm_uq.base.units import Unit, unit
from cmm_uq.base.values import dataclass, replace
from cmm_uq.machine.physics.effect import Effect
from cmm_uq.maths.geometry.positioning import PositioningRuns
from cmm_uq.maths.inference.linear_model import Freedoms
from cmm_uq.maths.inference.posterior import Cause


@dataclass(frozen=True, eq=False)
class Indications:
    """Measured lengths against calibrated ones."""

    errors: Floats  # (m,) measured minus calibrated, mm
    lengths: Floats  # (m,) calibrated lengths, mm
    u: Floats  # (m,) standard uncertainty of the calibrated lengths, mm
    rows: Ints  # (m, 2) the points between which each length was measured, as rows of the recording
    # (m,) what of ``u`` comes from a further gauge that is shared by all that have it, mm; ``None``: nothing
    u_beside: Floats | None = None


@dataclass(frozen=True, eq=False)
class Forms:
    """Form errors of what was probed all around, one for each (measurement, repeat)."""

    measurement: Ints  # (q,)
    repeat: Ints  # (q,)
    count: Ints  # (q,) points of each
    form: Floats  # (q,) range of the distances from the least-squares feature, mm
    certified: float  # form deviation of the artefact by its certificate, mm; 0 when it is not given
    directions: Floats  # (n, 3) outward direction of each point from the middle of its feature
    size: Floats | None = None  # (q,) measured minus certified size at 20 °C, mm; ``None`` without a certificate
    centres: Floats | None = None  # (q, 3) middles of the features, mm; ``None`` where they say nothing


@dataclass(frozen=True, eq=False)
class ArtefactFigure:
    """A figure that a laboratory may accept a machine by, of the whole recording or at m places of it."""

    values: Floats  # (m,) mm
    rows: Ints  # (m, j) the points that each rests on, as rows of the recording
    lengths: Floats  # (m,) length that each belongs to, mm
    # (m,) standard uncertainty by the certificate, mm; ``None``: it cancels, and what of the artefact changes remains
    u: Floats | None = None
    names: tuple[Text, ...] = ()  # m, what each is of, where it is of no measurement


def figures_of_errors(found: Indications) -> dict[str, ArtefactFigure]:
    """Each error, their mean, and their standard deviation, n − 1, of which no correlation makes u larger than its rms."""
    errors, u, count, all_rows = found.errors, found.u, len(found.errors), found.rows.reshape(1, -1)
    each = {"error": ArtefactFigure(errors, found.rows, found.lengths, u)}
    if count > 1:
        length = np.array([found.lengths.mean()])
        bound = np.sqrt(np.array([np.sum(u**2)]) / (count - 1))
        each["mean error"] = ArtefactFigure(np.array([errors.mean()]), all_rows, length, np.array([u.mean()]))
        spread = np.array([errors.std(ddof=1)])
        each["standard deviation of errors"] = ArtefactFigure(spread, all_rows, length, bound)
    return each


def ranges_of_repeats(values: Floats, rows: Ints, lengths: Floats, of: Ints) -> ArtefactFigure | None:
    """Range of the values (m,), each of points (m, j), that are repeats of one thing, numbered in ``of`` (m,)."""
    together = [own for number in np.unique(of) if len(own := np.flatnonzero(of == number)) > 1]
    if not together:
        return None
    longest = max(len(own) for own in together)
    padded = np.array([np.resize(own, longest) for own in together])
    ranges = np.ptp(values[padded], axis=1)
    return ArtefactFigure(ranges, rows[padded].reshape(len(ranges), -1), lengths[padded[:, 0]])


def without_uncertainty(title: Text) -> Text:
    return say("{title} is given without an uncertainty", title=title)


Role = Literal["dimension", "sought", "set-up"]


@dataclass(frozen=True)
class Size:
    """A dimension of the artefact at 20 °C, itself to be estimated."""

    name: str  # in results.json
    title: Text  # in words
    unit: Unit  # as printed
    nominal: float  # where to start, in mm
    sd: float  # standard uncertainty of the certificate, mm; infinite without a certificate
    what: Text = NOTHING  # it is, without whose: "length"; its title where left out, or an instrument reads it
    # a dimension of the artefact; a size that the measurement is made for; or what is known of how it was set up (``nominal``
    # and ``sd`` are then in ``unit``)
    role: Role = "dimension"

    def __post_init__(self) -> None:
        object.__setattr__(self, "title", foreign(self.title))
        object.__setattr__(self, "unit", unit(self.unit))

    @property
    def certified(self) -> bool:
        return bool(np.isfinite(self.sd))


class Artefact(ABC):
    """One artefact as recorded: m observations of n points."""

    kind: str  # as in ``[artefact] kind``
    title: Text  # in words
    points: Points  # the recording
    rows: Ints  # (m, j) the points that each observation speaks of, as rows of the recording
    sizes: tuple[Size, ...] = ()  # dimensions that enter the model
    # whether each set-up reads a curve of its own, of which a model names the simplest form: outliers show among repeats,
    # and what is found predicts other points, not other set-ups
    curves: ClassVar[bool] = False
    angular: bool = False  # whether what it positions are angles of rotary axes
    moving: bool = False  # whether its readings were taken in motion, repeats of one at other places
    form: float = 0.0  # deviation of its own form by its certificate, mm; 0 where it is not stated
    # Sxy, Syz, Szx, rad, of axes on which its observations were found: where estimates begin
    leans: Floats = np.zeros(3)
    # of what readings go by beside its sizes nobody states an uncertainty, in a clause; with which observations (m,) do
    exact: tuple[tuple[Text, NDArray[np.bool_]], ...] = ()
    observed: ClassVar[tuple[str, ...]] = ()  # columns that observations are made of, with their noise
    key_of_u: ClassVar[str] = "u_um"  # of ``[artefact]``, that says how uncertain its lengths are

    @cached_property
    def measurement(self) -> Ints:
        """(m,) what each observation belongs to."""
        return np.asarray(self.points.measurement[self.rows[:, 0]])

    @cached_property
    def repeat(self) -> Ints:
        return np.asarray(self.points.repeat[self.rows[:, 0]])

    @cached_property
    def noise_scale(self) -> Floats:
        """(m,) standard uncertainty of each observation, per unit of that of one coordinate."""
        return np.ones(len(self.rows))

    @property
    def set_up(self) -> Text:
        """What a measurement is one of, in words, as under a picture."""
        return say("Set-up of the {artefact:small}", artefact=self.title)

    @abstractmethod
    def fit(self, true_xyz: Floats, sizes: Floats) -> Floats:
        """Points (n, 3) of an artefact with these sizes (s,), placed as near to ``true_xyz`` (n, 3) as it goes, mm."""

    def without_noise(self, placed: Floats) -> Floats:
        """Where points that are ``placed`` (n, 3), mm, lie: without what each was observed with, if that places it."""
        return placed

    @abstractmethod
    def project(self, xyz: Floats, displacement: Floats) -> Floats:
        """Change of the observations, (m, k) in mm, when the points at ``xyz`` (n, 3) move by ``displacement`` (n, 3, k)."""

    def project_along(self, xyz: Floats, direction: Floats, moved: Floats) -> Floats:
        """The same when they all move along one direction (3,), by ``moved`` (n, k)."""
        return self.project(xyz, direction[:, None] * moved[:, None])

    def size_change(self) -> Floats:
        """Change of the observations, (m, s), for one mm of each size."""
        return np.zeros((len(self.rows), 0))

    def own_faults(self) -> Iterable[Effect]:
        """What may be wrong with the artefact itself: effects of the catalogue, made for this one."""
        return ()

    @cached_property
    def faults(self) -> Mapping[str, Effect]:
        """The same by name."""
        return {effect.name: effect for effect in self.own_faults()}

    def acting(self, effect: Effect) -> Effect:
        """An effect as it acts here: a fault of the artefact is that of this one, and refused where it has none such."""
        if not effect.of_artefact or effect.belongs_to(self.points):
            return effect
        if effect.name not in self.faults:
            fix = "Leave it out" + (f"; it has {', '.join(self.faults)}" if self.faults else "")
            problem = f"a recording of kind {self.kind!r} has no {effect.name}"
            raise CmmUqError(problem, where="job.toml [model] effects", fix=fix)
        return self.faults[effect.name]

    def words_of(self, observation: int) -> Text:
        """What an observation is of: a whole (measurement, repeat), or a point of one."""
        points, rows = self.points, self.rows[observation]
        run = say(
            "measurement {measurement}, repeat {repeat}",
            measurement=int(self.measurement[observation]),
            repeat=int(self.repeat[observation]),
        )
        whole = np.all(np.isin(np.flatnonzero(points.group == points.group[rows[0]]), rows))
        return run if whole else say("point {point} of {run}", point=int(points.point[rows[0]]), run=run)

    def recorded(self, points: Points, xyz: Floats) -> Points:
        """A recording ``points`` of it as it would be with the artefact's points indicated at ``xyz``, mm."""
        return replace(points, xyz=xyz, columns=points.machine.columns_at(xyz, points.columns))

    def tips(self) -> Mapping[str, Floats]:
        """Offset of what measures from the mount, mm, at each point of the recording, where it is known: columns by name."""
        names = (f"tip_{axis}_mm" for axis in AXES)
        return {name: self.points.columns[name] for name in names if name in self.points.columns}

    def unread(self) -> NDArray[np.bool_]:
        """Observations (m,) along a coordinate that stood still to the last digit: nobody read it, and it has no noise."""
        return np.zeros(len(self.noise_scale), dtype=bool)

    def lengths(self) -> Floats | None:
        """Lengths (m,), mm at 20 °C, whose scatter is a figure of performance; ``None`` when it has no meaning here."""
        return None

    def indications(self) -> Indications | None:
        """Errors of indication of calibrated lengths; ``None`` without a calibration."""
        return None

    def figures(self, counts: NDArray[np.bool_]) -> Mapping[str, ArtefactFigure]:
        """Figures by which a laboratory may accept a machine, by name, of the points (n,) that count."""
        found = self.indications()
        if found is None:
            return {}
        own = counts[found.rows].all(axis=1)
        return figures_of_errors(
            replace(found, errors=found.errors[own], lengths=found.lengths[own], u=found.u[own], rows=found.rows[own])
        )

    def positionings(self) -> Mapping[int, PositioningRuns]:
        """Runs that position an axis, µm, by measurement; none of what is no such run."""
        return {}

    def calibration(self) -> Cause | None:
        """What its certificate leaves open of several lengths beyond its sizes; ``None`` of an artefact of one length."""
        return None

    def form_patterns(self) -> Floats:
        """Patterns (m, r) that a deviation of its form may have; none of what has no form of its own."""
        return np.zeros((len(self.rows), 0))

    def form_changes(self, form: float) -> Floats:
        """Changes (m, r) of the observations, mm, for one standard uncertainty of what a deviation of its form may be.

        ``form``: deviation, mm; a pattern of mean square one over the points has a quarter of it.
        """
        patterns = self.form_patterns()
        whole = patterns if not form else 0.25 * form * np.sqrt(len(patterns)) * scipy.linalg.orth(patterns)
        return np.asarray(whole, dtype=np.float64)[:, : None if form else 0]

    def lines_of(self, rows: Ints) -> tuple[Floats, Floats]:
        """A point on the line of each length between two points, and the line's direction, (m, 3) each."""
        first, last = self.points.xyz[rows[:, 0]], self.points.xyz[rows[:, 1]]
        return 0.5 * (first + last), last - first

    def bidirectional(self, rows: Ints) -> NDArray[np.bool_] | None:
        """Whether the ends of each length between two points were reached from opposite sides, (m,); ``None``: not known."""
        return None

    def forms(self) -> Forms | None:
        """Form errors of a test sphere; ``None`` when they have no meaning here."""
        return None

    def passes(self) -> Ints | None:
        """(m,) which observations are read one after the other, by the order of their points; ``None`` of no known order."""
        return None

    def placing(self, xyz: Floats) -> Floats | Freedoms:
        """Change of the observations, (m, q), for each freedom of the artefact's placing that they do not cancel.

        As :class:`Freedoms` where every placing has its own, which keeps many placings small.
        """
        return np.zeros((len(self.noise_scale), 0))


LAST_DIGIT = 1e-9  # mm, of means over repeats, which rounding keeps from being the same
_ALONG = 0.99  # cosine from which on an axis of an artefact is one of the machine's


@dataclass(frozen=True, eq=False)
class Placings:
    index: Ints  # (n,) placing of each point, 0 … q − 1
    numbers: Ints  # (q,) the ``measurement`` that each placing is

    @classmethod
    def of(cls, numbers: Ints) -> Placings:
        """One placing for each different number of ``numbers`` (n,), in ascending order."""
        known, index = np.unique(numbers, return_inverse=True)
        return cls(index.ravel().astype(np.int64), known.astype(np.int64))

    @cached_property
    def _order(self) -> tuple[Ints, Ints]:
        return np.argsort(self.index, kind="stable"), np.cumsum(self.sizes) - self.sizes

    @cached_property
    def sizes(self) -> Ints:
        """(q,) points in each placing."""
        return np.bincount(self.index, minlength=len(self.numbers)).astype(np.int64)

    @cached_property
    def rows(self) -> tuple[Ints, ...]:
        """Points of each placing (k,), ascending."""
        order, starts = self._order
        return tuple(np.split(order, starts[1:])) if len(order) else ()

    def sums(self, values: Floats) -> Floats:
        """Sums of ``values`` (n, …) over the points of each placing, (q, …)."""
        order, starts = self._order
        return np.asarray(np.add.reduceat(values[order], starts, axis=0), dtype=np.float64)

    def means(self, values: Floats) -> Floats:
        """Means of ``values`` (n, …) over the points of each placing, given back to every point."""
        counts = self.sizes.reshape((-1,) + (1,) * (values.ndim - 1))
        return np.asarray((self.sums(values) / counts)[self.index], dtype=np.float64)

    def still(self, xyz: Floats) -> NDArray[np.bool_]:
        """(n, 3) which coordinates of ``xyz`` (n, 3) are the same to the last digit in all of a point's placing."""
        order, starts = self._order
        moved = np.abs(xyz - xyz[order[starts]][self.index]) > LAST_DIGIT
        return np.asarray((self.sums(moved.astype(np.float64)) == 0)[self.index])

    def unread(self, xyz: Floats, axes: Floats) -> NDArray[np.bool_]:
        """(n, j) which of an artefact's axes, the columns of ``axes`` (n, 3, j), lie along a coordinate that stood still.

        A coordinate that nobody read has no noise: it is no observation, and one too many makes the noise look smaller.
        """
        return np.asarray(np.any(self.still(xyz)[:, :, None] & (np.abs(axes) > _ALONG), axis=1))

    def columns(self, freedoms: Floats) -> Freedoms:
        """Freedoms that each placing has for itself, by what they do to its points' observations, (n, j) or (n, …, j)."""
        each = int(np.prod(freedoms.shape[1:-1]))
        return Freedoms(freedoms.reshape(-1, freedoms.shape[-1]), np.repeat(self.index, each), len(self.numbers))
