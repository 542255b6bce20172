"""A set-up: the artefact in one place, and all points that are then measured; its pattern, and directions in words."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.messages import Message, Text, Verbatim, in_a_row, say, signed
from cmm_uq.base.points import AXES, Floats, Ints, Machine, Points
from cmm_uq.jobs.tables.artefact import ArtefactFacts
from cmm_uq.jobs.tables.plan import PlanFacts

VECTORS: Mapping[str, str] = {
    "approach": "approach_{}",
    "normal": "n{}",
}  # columns of vectors that turn with the artefact
_LEVEL, _NEGLIGIBLE = 1e-6, 0.02
_MINUTE = 60.0


@dataclass(frozen=True, eq=False)
class SetUp:
    """One setting-up of the artefact.

    ``title`` in words, for the operator; ``points`` everything measured there, as one measurement.
    """

    title: Text
    points: Points

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
    """What is measured of an artefact in one set-up.

    ``body`` (n, 3) along the artefact's axes about its middle, mm; a bar or gauge lies along the first; ``point``,
    ``repeat`` (n,) as in a recording; ``columns`` further columns, each (n,); ``vectors`` vectors (n, 3) along the
    artefact's axes, by the keys of :data:`VECTORS`.
    """

    body: Floats
    point: Ints
    repeat: Ints
    columns: Mapping[str, Floats] = field(default_factory=dict)
    vectors: Mapping[str, Floats] = field(default_factory=dict)

    @classmethod
    def of_recording(cls, points: Points) -> tuple[Pattern, Floats, Floats]:
        """The pattern of one recorded set-up, with its attitude (3, 3) and its middle (3,) in scale readings."""
        xyz = points.machine_xyz
        middle = np.asarray(xyz.mean(axis=0))
        about = xyz - middle
        attitude = _attitude(about)
        turned = {
            key: np.column_stack([points.columns[name.format(a)] for a in AXES]) @ attitude
            for key, name in VECTORS.items()
            if all(name.format(a) in points.columns for a in AXES)
        }
        taken = {name.format(a) for key, name in VECTORS.items() if key in turned for a in AXES}
        columns = {name: values for name, values in points.columns.items() if name not in taken}
        return cls(about @ attitude, points.point, points.repeat, columns, turned), attitude, middle

    def once(self) -> Pattern:
        first = self.repeat == self.repeat.min()
        return Pattern(
            self.body[first], self.point[first], np.ones(int(first.sum()), dtype=np.int64),
            {name: values[first] for name, values in self.columns.items()},
            {name: values[first] for name, values in self.vectors.items()},
        )  # fmt: skip

    def repeated(self, times: int) -> Pattern:
        n = len(self.body)
        return Pattern(
            np.tile(self.body, (times, 1)), np.tile(self.point, times),
            np.repeat(np.arange(1, times + 1), n),
            {name: np.tile(values, times) for name, values in self.columns.items()},
            {name: np.tile(values, (times, 1)) for name, values in self.vectors.items()},
        )  # fmt: skip

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
    v = across / np.linalg.norm(across)
    return np.column_stack([u, v, np.cross(u, v)])


def join(
    placings: Sequence[SetUp], *, seconds_per_point: float = 10.0, minutes_per_placing: float = 5.0,
    columns: Mapping[str, float] | None = None, first: int = 1,
) -> Points:  # fmt: skip
    """All set-ups as one recording, numbered from ``first``, in the order and at the times at which they are measured."""
    if not placings:
        raise CmmUqError("a plan without placings", fix="Ask for at least one")
    parts, clock = [], 0.0
    for number, placing in enumerate(placings, first):
        points, n = placing.points, len(placing.points)
        clock += _MINUTE * minutes_per_placing
        time = clock + seconds_per_point * np.arange(n)
        clock += seconds_per_point * n
        more = {"time_s": time} | {name: np.full(n, value) for name, value in (columns or {}).items()}
        parts.append(replace(points, measurement=np.full(n, number), columns={**points.columns, **more}))
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
    numbers = np.unique(points.measurement).tolist()
    titles = [say("measurement {number}", number=number) if title is None else title(number) for number in numbers]
    return tuple(
        SetUp(words, points.select(points.measurement == number)) for number, words in zip(numbers, titles, strict=True)
    )


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
    if size < 1e-3 * length:
        return attitude_along(u)
    v = v / size
    return np.column_stack([u, v, np.cross(u, v)])


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
    u, v = np.array(first), np.array(second)
    u, v = u / np.linalg.norm(u), v / np.linalg.norm(v)
    return np.column_stack([u, v, np.cross(u, v)])


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
