"""Set-ups: the artefact in one place with all points measured there, its pattern; what to measure next, in words.

How such a plan is found is in :mod:`cmm_uq.analysis.planning.suggestion`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import cached_property

import numpy as np

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.messages import Message, Text, Verbatim, in_a_row, number, plural, say, semicolons, signed
from cmm_uq.base.points import AXES, Floats, Ints, Machine, Points
from cmm_uq.base.values import dataclass, field, replace
from cmm_uq.jobs.tables.artefact import ArtefactFacts
from cmm_uq.jobs.tables.plan import PlanFacts
from cmm_uq.machine.physics.catalogue import every

# columns of vectors that turn with the artefact
VECTORS: Mapping[str, str] = {"approach": "approach_{}", "normal": "n{}", "read": "read_{}", "turn": "turn_{}"}
_LEVEL, _NEGLIGIBLE = 1e-6, 0.02
_MINUTE = 60.0


@dataclass(frozen=True, eq=False)
class SetUp:
    """One setting-up of the artefact."""

    title: Text  # in words, for the operator
    points: Points  # everything measured there, as one measurement

    @cached_property
    def middle(self) -> Floats:
        """(3,) of the points, in scale readings, mm."""
        readings = self.points.machine_xyz
        return np.asarray(0.5 * (readings.min(axis=0) + readings.max(axis=0)))

    @property
    def ends(self) -> Text:
        """Scale readings of the first point and of the farthest from it, mm: ``(250, 0, −40) → (650, 0, −40)``."""
        readings = self.points.machine_xyz
        far = int(np.argmax(np.linalg.norm(readings - readings[0], axis=1)))
        first, last = (in_a_row(signed(value, ".0f") for value in readings[row]) for row in (0, far))
        return say("({first}) → ({last})", first=first, last=last) if far else say("({first})", first=first)


@dataclass(frozen=True, eq=False)
class Pattern:
    """What is measured of an artefact in one set-up."""

    body: Floats  # (n, 3) along the artefact's axes about its middle, mm; a bar or gauge lies along the first
    point: Ints  # point, repeat: (n,) as in a recording
    repeat: Ints
    columns: Mapping[str, Floats] = field(default_factory=dict)  # further columns, each (n,)
    # vectors (n, 3) along the artefact's axes, by the keys of VECTORS
    vectors: Mapping[str, Floats] = field(default_factory=dict)

    @classmethod
    def of_recording(cls, points: Points) -> tuple[Pattern, Floats, Floats]:
        """The pattern of one recorded set-up, with its attitude (3, 3) and its middle (3,) in scale readings."""
        placed = points.xyz + points.machine.origin_mm  # with a rotary table at 0°
        middle = np.asarray(placed.mean(axis=0))
        about = placed - middle
        attitude, columns, turned = _attitude(about), dict(points.columns), {}
        for key, name in VECTORS.items():
            names = [name.format(a) for a in AXES]
            if all(each in columns for each in names):
                turned[key] = np.column_stack([columns.pop(each) for each in names]) @ attitude
        return cls(about @ attitude, points.point, points.repeat, columns, turned), attitude, middle

    def once(self) -> Pattern:
        first = self.repeat == self.repeat.min()
        columns, vectors = ({name: v[first] for name, v in each.items()} for each in (self.columns, self.vectors))
        one = np.ones(int(first.sum()), dtype=np.int64)
        return Pattern(self.body[first], self.point[first], one, columns, vectors)

    def repeated(self, times: int) -> Pattern:
        columns = {name: np.tile(values, times) for name, values in self.columns.items()}
        vectors = {name: np.tile(values, (times, 1)) for name, values in self.vectors.items()}
        repeat = np.repeat(np.arange(1, times + 1), len(self.body))
        return Pattern(np.tile(self.body, (times, 1)), np.tile(self.point, times), repeat, columns, vectors)

    def turned(self, attitude: Floats) -> Floats:
        """Body (n, 3) along the machine's axes for an attitude (3, 3), whose columns are the artefact's axes."""
        return np.asarray(self.body @ attitude.T)

    def placed(self, machine: Machine, attitude: Floats, middle: Floats, title: Text) -> SetUp:
        """Set up with its middle at scale readings ``middle`` (3,)."""
        columns = dict(self.columns)
        for key, vectors in self.vectors.items():
            values = vectors @ attitude.T
            if key == "approach":
                values = np.where(np.abs(values) > _LEVEL, np.sign(values), 0.0)
            columns |= {VECTORS[key].format(a): values[:, i] for i, a in enumerate(AXES)}
        xyz, one = machine.coordinates(middle + self.turned(attitude)), np.ones(len(self.body), dtype=np.int64)
        return SetUp(title, Points(xyz, one, self.point, self.repeat, machine, columns))


def attitude_along(direction: Floats) -> Floats:
    """Attitude (3, 3) of an artefact that lies along a direction, level across it where that is possible."""
    u = np.asarray(direction, dtype=np.float64) / np.linalg.norm(direction)
    across = np.cross([0.0, 0.0, 1.0], u)
    if np.linalg.norm(across) < _LEVEL:
        across = np.cross(u, [1.0, 0.0, 0.0])
    return _right_handed(u, across / np.linalg.norm(across))


def _right_handed(u: Floats, v: Floats) -> Floats:
    return np.column_stack([u, v, np.cross(u, v)])


def join(
    placings: Sequence[SetUp], *, seconds_per_point: float = 10.0, minutes_per_placing: float = 5.0,
    columns: Mapping[str, float] | None = None, first: int = 1,
) -> Points:  # fmt: skip
    """All set-ups as one recording, numbered from ``first``, in the order and at the times at which they are measured."""
    if not placings:
        raise CmmUqError("a plan without placings", fix="Ask for at least one")
    parts, clock = [], 0.0
    for measurement, placing in enumerate(placings, first):
        points, n = placing.points, len(placing.points)
        clock += _MINUTE * minutes_per_placing
        time = clock + seconds_per_point * np.arange(n)
        clock += seconds_per_point * n
        more = {"time_s": time} | {name: np.full(n, value) for name, value in (columns or {}).items()}
        parts.append(replace(points, measurement=np.full(n, measurement), columns={**points.columns, **more}))
    return _concatenated(parts)


def append(recorded: Points, placings: Sequence[SetUp]) -> Points:
    """A recording and further set-ups after it, columns as recorded; the set-ups must have them."""
    first = int(recorded.measurement.max()) + 1
    later = [replace(p.points, measurement=np.full(len(p.points), i)) for i, p in enumerate(placings, first)]
    return _concatenated([recorded, *later])


def _concatenated(parts: Sequence[Points]) -> Points:
    names = [name for name in parts[0].columns if all(name in part.columns for part in parts)]
    return Points(
        np.vstack([p.xyz for p in parts]), np.concatenate([p.measurement for p in parts]),
        np.concatenate([p.point for p in parts]), np.concatenate([p.repeat for p in parts]), parts[0].machine,
        {name: np.concatenate([p.columns[name] for p in parts]) for name in names}, start_s=parts[0].start,
    )  # fmt: skip


def split(points: Points, title: Callable[[int], Message] | None = None) -> tuple[SetUp, ...]:
    """The set-ups of a recording, in ascending order of their numbers."""
    words = title or (lambda number: say("measurement {number}", number=number))
    numbers = np.unique(points.measurement).tolist()
    return tuple(SetUp(words(n), points.select(points.measurement == n)) for n in numbers)


def _attitude(about: Floats) -> Floats:
    """Axes of points (n, 3) about their mean: from the first to the farthest, then towards the one farthest off that line."""
    far = about - about[0]
    u = far[int(np.argmax(np.linalg.norm(far, axis=1)))]
    length = float(np.linalg.norm(u))
    if length == 0:
        return np.eye(3)
    u = u / length
    off = far - np.outer(far @ u, u)
    v = off[int(np.argmax(np.linalg.norm(off, axis=1)))]
    size = float(np.linalg.norm(v))
    return attitude_along(u) if size < 1e-3 * length else _right_handed(u, v / size)


def direction_words(direction: Floats) -> Text:
    """A direction as an operator says it, either way along it: ``along X``, ``along +X −Z, inclined 45°``."""
    u = direction / np.linalg.norm(direction)
    taken = [i for i in range(3) if abs(u[i]) > _NEGLIGIBLE]
    if len(taken) == 1:
        return say("along {axes}", axes=Verbatim(AXES[taken[0]].upper()))
    turned = u * np.sign(u[taken[0]])
    axes = Verbatim(" ".join(f"{'+' if turned[i] > 0 else '−'}{AXES[i].upper()}" for i in taken))
    if 2 not in taken:
        return say("along {axes}", axes=axes)
    return say("along {axes}, inclined {angle:.0f}°", axes=axes, angle=np.degrees(np.arcsin(abs(u[2]))))


def cube() -> list[Floats]:
    """Thirteen directions: edges, face diagonals and space diagonals of a cube."""
    signs = [(x, y, z) for x in (0, 1) for y in (-1, 0, 1) for z in (-1, 0, 1) if (x, y, z) > (0, 0, 0)]
    return [np.array(s) / np.linalg.norm(s) for s in signs]


def lines(size: Floats) -> list[Floats]:
    """Directions for a bar or gauge: those of a cube, and the diagonals of a volume of this size (3,)."""
    found = cube()
    for direction in cube():
        unit = direction * size / np.linalg.norm(direction * size)
        if all(abs(unit @ other) < np.cos(np.radians(5.0)) for other in found):
            found.append(unit)
    return found


def _plane(first: tuple[float, float, float], second: tuple[float, float, float]) -> Floats:
    u, v = (np.array(each) / np.linalg.norm(each) for each in (first, second))
    return _right_handed(u, v)


PRINCIPAL_PLANES: tuple[tuple[Text, Floats], ...] = (  # attitudes of a plate
    (say("flat"), _plane((1, 0, 0), (0, 1, 0))),
    (say("upright along X"), _plane((1, 0, 0), (0, 0, 1))),
    (say("upright along Y"), _plane((0, 1, 0), (0, 0, 1))),
)
PLANES: tuple[tuple[Text, Floats], ...] = (
    *PRINCIPAL_PLANES,
    (say("flat, turned by 45°"), _plane((1, 1, 0), (-1, 1, 0))),
    (say("upright along X, turned by 45°"), _plane((1, 0, 1), (-1, 0, 1))),
    (say("upright along Y, turned by 45°"), _plane((0, 1, 1), (0, -1, 1))),
    (say("upright along +X +Y"), _plane((1, 1, 0), (0, 0, 1))),
    (say("upright along +X −Y"), _plane((1, -1, 0), (0, 0, 1))),
    (say("tilted about X"), _plane((1, 0, 0), (0, 1, 1))),
    (say("tilted about Y"), _plane((0, 1, 0), (1, 0, 1))),
)


def attitudes_of_lines(size: Floats) -> list[tuple[Text, Floats]]:
    return [(direction_words(direction), attitude_along(direction)) for direction in lines(size)]


def planned_length(facts: ArtefactFacts, plan: PlanFacts) -> float:
    """Length, mm, by which a bar is planned."""
    length = facts.length_mm or plan.length_mm
    if length is None:
        raise CmmUqError("the length of the artefact is needed", where="job.toml [plan] length_mm",
                         fix="Give it roughly, in mm; it is not taken as certified")  # fmt: skip
    return length


def repeat_points(points: Points, times: int) -> Points:
    """What was read first, that many times over."""
    once = points.select(points.repeat == points.repeat.min())
    measurement, point = np.tile(once.measurement, times), np.tile(once.point, times)
    repeat, columns = np.repeat(np.arange(1, times + 1), len(once)), once.columns.items()
    return replace(
        once, xyz=np.tile(once.xyz, (times, 1)), measurement=measurement, point=point, repeat=repeat,
        lines=np.zeros(0, dtype=np.int64), columns={name: np.tile(values, times) for name, values in columns},
    )  # fmt: skip


ODDS = 20.0  # odds that a plan is expected to reach for every pair, whichever of the two is true
_OF_FITS = ("radius_mm", "fit_rms_um", "n_points")  # columns of a recording that tell of the fit that gave a point


@dataclass(frozen=True)
class Separation:
    """Two effects that the recording cannot tell apart."""

    effects: tuple[str, str]
    before: float  # odds of the first over the second, by the recording
    after: float  # odds of the true one over the other that are to be expected, the worse of the two cases


@dataclass(frozen=True)
class DetectionGoal:
    """An effect that is to be shown."""

    effect: str
    amplitude: float  # that is to be detected, over its prior standard deviation
    length: float  # visible length from which on it is detected


@dataclass(frozen=True)
class DetectionChange:
    """How well an effect that was not seen will show."""

    effect: str
    # before, after: smallest amplitude that is detected, over its prior standard deviation; infinite where none is
    before: float
    after: float


@dataclass(frozen=True, eq=False)
class NextPlan:
    """What to measure next."""

    placings: tuple[SetUp, ...]
    repeats: int
    first: int  # number of the first as a measurement
    partings: tuple[Separation, ...]  # pairs, with the odds before and after
    shown: tuple[DetectionChange, ...]
    reached: bool  # whether every pair reaches ODDS and every effect shows as asked for
    box: Floats  # (3, 2) the room for the artefact, scale readings, mm

    @property
    def points(self) -> Points:
        """All of it as a recording at nominal coordinates, numbered on from what is recorded; without what fits told."""
        each = [replace(one, points=repeat_points(one.points, self.repeats)) for one in self.placings]
        points = join(each, first=self.first)
        return replace(points, columns={k: v for k, v in points.own_columns.items() if k not in _OF_FITS})


@dataclass(frozen=True)
class Suggestion:
    """What parts two effects."""

    separates: tuple[str, str]
    what: Text
    repetitions: int  # how often to measure each set-up
    odds: float  # of the true one of the two over the other that are then to be expected


def suggestions(plan: NextPlan | None, title: Text) -> tuple[Suggestion, ...]:
    if plan is None:
        return ()
    times = plural(plan.repeats, one=say("once"), many=say("{times} times", times=plan.repeats))
    ends = semicolons(say("{ends} mm", ends=placing.ends) for placing in plan.placings)
    return tuple(
        Suggestion(
            parting.effects,
            say(
                "Place the {title:small} at {ends} in scale readings and measure it {times}: odds of {odds} : 1 for the true "
                "one are to be expected; by this recording they are {before} for {first} over {second}.",
                title=title, ends=ends, times=times, odds=rounded(parting.after), before=odds_words(parting.before),
                first=_title(parting.effects[0]), second=_title(parting.effects[1]),
            ),
            plan.repeats, parting.after,
        )
        for parting in plan.partings
    )  # fmt: skip


def _title(name: str) -> Text:
    effect = every().get(name)
    return Verbatim(name) if effect is None else say("{title:small}", title=effect.title)


def odds_words(odds: float) -> Text:
    """Odds as ``3 : 1`` or ``1 : 3``."""
    return say("{odds} : 1", odds=rounded(odds)) if odds >= 1 else say("1 : {odds}", odds=rounded(1 / odds))


def rounded(odds: float) -> Text:
    """Odds of one or more, as many digits as they are worth."""
    return say("more than 1000") if odds >= 1000 else number(odds, ".0f" if odds >= 10 else ".2g")
