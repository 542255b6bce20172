"""The ground floor: a measurement is points, read on a machine.

Every room of the package speaks of these two objects. ``jobs`` makes them from files, ``physics`` moves them,
artefacts turn them into observations.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import cached_property
from itertools import combinations
from math import comb
from types import MappingProxyType
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.units import HOUR
from cmm_uq.base.values import dataclass, field, replace

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
AXES = "xyz"  # of coordinates, and of the carriages of a Cartesian machine

_NO_START = 1e6
"""s: a first reading this long after time 0, twelve days, is of a clock that did not start with the job, as a computer's."""


@dataclass(frozen=True, eq=False)
class Machine:
    """What the physics must know of the machine, whose readings are coordinates but for an origin: a Cartesian one.

    A machine with further axes, or with others, is a class of its own, whose :meth:`coordinates` and :meth:`readings` say how
    they belong together; everything else is said by axis.
    """

    name: str = ""  # as on the certificate
    chain: str = "XYZ"  # carriages from the table to the ram, a permutation of ``XYZ``
    # (axes, 2) lowest and highest scale reading of each axis, mm; ``nan`` where the job does not say
    travel_mm: Floats = field(default_factory=lambda: np.full((3, 2), np.nan))
    # (3,) scale reading = recorded coordinate + origin, mm
    origin_mm: Floats = field(default_factory=lambda: np.zeros(3))
    # whether rotations of all carriages act on the stylus tip offset, as they do in truth, or those of the ram alone,
    # as job files have it, where the other levers are so much longer
    tip_on_every_carriage: bool = False
    axes: tuple[str, ...] = tuple(AXES)  # names of the axes that are read
    # by axis, how it is read, as somebody states it: ``AxisFacts`` of a job
    read_by: Mapping[str, Any] = field(default_factory=dict)
    # whether coordinates may be commanded ones, so that what was found there stands in columns named ``reference_…``
    commanded: ClassVar[bool] = False

    def coordinates(self, readings: Floats) -> Floats:
        """Recorded coordinates (n, 3), mm, of scale readings (n, axes)."""
        return np.asarray(readings - self.origin_mm, dtype=np.float64)

    def readings(self, xyz: Floats, columns: Mapping[str, Floats]) -> Floats:
        """Scale readings (n, axes) of recorded coordinates (n, 3), mm.

        ``columns``: what was recorded beside them, each (n,): readings that do not follow from coordinates are among it.
        """
        return np.asarray(xyz + self.origin_mm, dtype=np.float64)

    def place(self, xyz: Floats, columns: Mapping[str, Floats]) -> Floats:
        """(n, 3) where recorded coordinates lie in the frame of the machine's scales, mm."""
        return np.asarray(xyz + self.origin_mm, dtype=np.float64)

    def turned_back(self, vectors: Floats, columns: Mapping[str, Floats]) -> Floats:
        """Vectors (n, 3, k) along the machine's axes, along those of the coordinates; :meth:`turned` the other way."""
        return vectors

    def turned(self, vectors: Floats, columns: Mapping[str, Floats]) -> Floats:
        return vectors

    def from_recorded(self, xyz: Floats, columns: Mapping[str, Floats]) -> Floats:
        """Coordinates (n, 3), mm, of those in the recording; :meth:`as_recorded` the other way."""
        return xyz

    def as_recorded(self, xyz: Floats, columns: Mapping[str, Floats]) -> Floats:
        return xyz

    def columns_at(self, xyz: Floats, columns: Mapping[str, Floats]) -> Mapping[str, Floats]:
        """Columns of a recording with these coordinates (n, 3): what does not follow from them is as it was."""
        return columns

    def columns_as_recorded(self, columns: Mapping[str, Floats]) -> Mapping[str, Floats]:
        """Columns as in the recording, of those along the axes of the coordinates."""
        return columns

    def travel(self, axis: str) -> tuple[float, float]:
        """Lowest and highest scale reading of an axis, mm; a ``CmmUqError`` where the job does not give them."""
        (low, high), key, given = self.limits_of(axis)
        if np.isnan(low) or np.isnan(high):
            raise CmmUqError(f"the travel of axis {axis} is needed", where=f"job.toml {key}", fix=f"Give {given}")
        return float(low), float(high)

    def limits_of(self, axis: str) -> tuple[Floats, str, str]:
        """Lowest and highest reading of an axis (2,), ``nan`` where nobody says; the key that says it, and how."""
        given = f"travel_mm = {{ {axis} = [lowest, highest] }} in mm"
        return self.travel_mm[self.axes.index(axis)], "[machine] travel_mm", given


def reading_name(axis: str) -> str:
    """Of what an axis reads, as of a column: ``x_mm`` of a carriage, ``c_deg`` of a rotary axis."""
    return f"{axis}_{'mm' if axis in AXES else 'deg'}"


def beyond_travel(readings: Floats, travel_mm: Floats) -> list[tuple[int, int]]:
    """(axis, row) of the reading that lies farthest beyond the travel of each axis, where one does.

    ``readings``: (n, axes) of the scales, mm; ``travel_mm``: (axes, 2) lowest and highest; ``nan`` bounds nothing.
    """
    if not len(readings):
        return []
    beyond = np.maximum(travel_mm[:, 0] - readings, readings - travel_mm[:, 1])
    rows = np.argmax(np.where(np.isnan(beyond), -np.inf, beyond), axis=0)
    return [(axis, int(row)) for axis, row in enumerate(rows) if beyond[row, axis] > 0]


@dataclass(frozen=True, eq=False)
class Points:
    """Indicated coordinates of one recording, and all that was recorded beside them."""

    xyz: Floats  # (n, 3) indicated coordinates, mm, in the recorded frame
    # measurement, point, repeat: (n,) what belongs together; see the recording's columns of the same names
    measurement: Ints
    point: Ints
    repeat: Ints
    machine: Machine = field(default_factory=Machine)  # the machine that read them
    # further recorded columns by their name in the recording, each (n,)
    columns: Mapping[str, Floats] = field(default_factory=dict)
    # (n,) line of each point in its file, for messages; 0 where there is no file
    lines: Ints = field(default_factory=lambda: np.zeros(0, dtype=np.int64))
    # (3, 3) or (n, 3, 3) unit vectors of the motions of carriages x, y, z, a row each; ``None`` where they are taken
    # as the axes of the coordinates
    directions: Floats | None = None
    # what ``time_s`` was at the start; by default 0 or, by a clock that began long before, at the first reading
    start_s: float | None = None
    in_seconds: bool = False  # whether ``time_s`` is of this program's own clock, so that its unit is no question

    def __len__(self) -> int:
        return len(self.xyz)

    @cached_property
    def readings(self) -> Mapping[str, Floats]:
        """What each axis of the machine read, (n,), by its name: mm for a carriage."""
        read = self.machine.readings(self.xyz, self.columns)
        return MappingProxyType(dict(zip(self.machine.axes, read.T, strict=True)))

    @cached_property
    def carriages(self) -> Floats:
        """(n, 3) scale readings of the carriages x, y, z, mm: what the errors of three carriages go by."""
        return np.column_stack([self.readings[axis] for axis in AXES])

    @cached_property
    def machine_xyz(self) -> Floats:
        """(n, 3) the place in the frame of the machine's scales, mm: of a Cartesian one coordinates plus its origin."""
        return self.machine.place(self.xyz, self.columns)

    def on_artefact(self, vectors: Floats) -> Floats:
        """Vectors (n, 3, k) along the machine's axes, as they are along those of the coordinates."""
        return self.machine.turned_back(vectors, self.columns)

    @cached_property
    def group(self) -> Ints:
        """(n,) index of the (measurement, repeat) that each point belongs to, in order of first appearance."""
        _, first, inverse = np.unique(
            np.column_stack([self.measurement, self.repeat]), axis=0, return_index=True, return_inverse=True
        )
        rank = np.empty(len(first), dtype=np.int64)
        rank[np.argsort(first)] = np.arange(len(first))
        return rank[inverse.ravel()]

    @cached_property
    def rows_of_groups(self) -> list[Ints]:
        """Rows of each group (see :attr:`group`), ascending."""
        order = np.argsort(self.group, kind="stable")
        return np.split(order, np.cumsum(np.bincount(self.group))[:-1]) if len(self) else []

    @cached_property
    def copies(self) -> Mapping[int, int]:
        """Groups (see :attr:`group`) that repeat another to the last digit, with that other: the first by measurement, repeat.

        The order of their points is no matter. Columns named ``reading_…`` are what an instrument found there, and count.
        Where lengths alone were recorded, no more of them that are equal than rounding makes equal are no copies.
        """
        same: dict[bytes, list[int]] = {}
        found_in = ("reading_", "reference_") if self.machine.commanded else "reading_"
        read = [values for name, values in sorted(self.columns.items()) if name.startswith(found_in)]
        whole = np.column_stack([self.xyz, *read])
        order = np.lexsort(whole.T)
        alike = np.all(whole[order[1:]] == whole[order[:-1]], axis=1)
        again = np.concatenate([order[1:][alike], order[:-1][alike]])
        for group in np.unique(self.group[again]).tolist():
            rows = self.rows_of_groups[group]
            figures = whole[rows] + 0.0  # −0 is 0
            same.setdefault(figures[np.lexsort(figures.T)].tobytes(), []).append(group)
        found: dict[int, int] = {}
        for groups in same.values():
            original, *later = sorted(groups, key=self.run_of)
            found |= dict.fromkeys(later, original)
        by_chance = set() if read or not found else _rounded_alike(self)
        return {later: original for later, original in found.items() if later not in by_chance}

    @cached_property
    def read_as_certified(self) -> int:
        """Distances from the first point of their group that equal their reference to the last digit; 0 where that may be.

        It may be of fewer than nine in ten, and where repeats differ by no more than the digits: else references were made of
        the readings, which then show no error.
        """
        references = [self.columns[name] for name in _REFERENCES if name in self.columns]
        if not references:
            return 0
        both, first = (self.xyz, np.column_stack(references)), np.zeros(len(self), dtype=np.int64)
        for rows in self.rows_of_groups:
            first[rows] = rows[np.argmin(self.point[rows])]
        others = first != np.arange(len(self))
        read, certified = (np.linalg.norm(of - of[first], axis=1)[others] for of in both)
        _, same = np.unique(np.column_stack([self.measurement, self.point])[others], axis=0, return_inverse=True)
        times = np.bincount(same.ravel())
        off = read - (np.bincount(same.ravel(), read) / times)[same.ravel()]
        digit = max(1e-9, *(last_digit(np.unique(of)) for of in both))
        freedoms, equal = int(np.sum(times - 1)), int(np.sum(np.abs(read - certified) <= digit))
        scattered = freedoms > 0 and float(np.sqrt(np.sum(off**2) / freedoms)) > 2 * digit
        return equal if scattered and len(read) >= _SOME and equal >= 0.9 * len(read) else 0

    def run_of(self, group: int) -> tuple[int, int]:
        """Measurement and repeat of a group."""
        row = self.rows_of_groups[group][0]
        return int(self.measurement[row]), int(self.repeat[row])

    def column(self, name: str) -> Floats:
        """A recorded column, (n,); a ``CmmUqError`` where the recording has no such column."""
        if name not in self.columns:
            problem = f"the recording has no column {name!r}, which the model needs"
            raise CmmUqError(problem, where="job.toml [model] effects", fix=f"Record {name}, or leave out the effect")
        return self.columns[name]

    @cached_property
    def start(self) -> float:
        """What ``time_s`` was at the start, s."""
        if self.start_s is not None:
            return self.start_s
        first = float(self.columns["time_s"].min(initial=np.inf)) if "time_s" in self.columns else 0.0
        return first if _NO_START < abs(first) < np.inf else 0.0

    @property
    def own_columns(self) -> Mapping[str, Floats]:
        """Columns of the recording: without those, named with an underscore, that an artefact keeps beside its points."""
        return {name: values for name, values in self.columns.items() if not name.startswith("_")}

    @cached_property
    def hours(self) -> Floats:
        """Time since the start (n,), h; a ``CmmUqError`` where the recording has no time."""
        return np.asarray((self.column("time_s") - self.start) / HOUR)

    def at(self, xyz: Floats) -> Points:
        """The same points at other coordinates (n, 3), mm."""
        return replace(self, xyz=xyz)

    def select(self, rows: NDArray[np.bool_] | Ints) -> Points:
        """Some of the points, by mask or index."""
        return Points(
            *(self.xyz[rows], self.measurement[rows], self.point[rows], self.repeat[rows], self.machine),
            {name: values[rows] for name, values in self.columns.items()},
            self.lines[rows] if len(self.lines) else self.lines,
            self.directions if self.directions is None or self.directions.ndim == 2 else self.directions[rows],
            self.start,
            self.in_seconds,
        )

    def group_means(self, values: Floats) -> Floats:
        """Mean of ``values`` (n,) or (n, k) over each point's (measurement, repeat), given back to every point."""
        sums = np.zeros((self.group.max() + 1, *values.shape[1:])) if len(self) else np.zeros((0, *values.shape[1:]))
        np.add.at(sums, self.group, values)
        counts = np.bincount(self.group).reshape((-1,) + (1,) * (values.ndim - 1))
        return np.asarray((sums / counts)[self.group], dtype=np.float64)


_REFERENCES = ("reference_mm", *(f"reference_{axis}_mm" for axis in AXES))
_SOME = 12  # lengths of which nine in ten equal their reference by chance less often than once in a thousand
_CHANCE = 1e-3  # probability of as many equal lengths, or more, below which they are copies
_PARALLEL = 1e9  # directions of one line agree to its inverse
_MEDIAN = 0.6745  # of the absolute value of a normal distribution, standard deviations
_INCH = 25.4  # mm


def _rounded_alike(points: Points) -> set[int]:
    """Groups of a length alone, of which no more equal those of another repeat than rounding explains.

    Of lengths alone every repeat has the same first point and the same direction: they were laid along a line, and one figure
    of each was measured. Two repeats are compared line by line, and in all.
    """
    lines, lengths = dict[int, bytes](), dict[int, dict[int, tuple[float, int]]]()
    for group, rows in enumerate(points.rows_of_groups):
        measurement, repeat = points.run_of(group)
        first, last = points.xyz[rows[np.argsort(points.point[rows], kind="stable")]][[0, -1]]
        length = float(np.linalg.norm(last - first))
        line = np.concatenate([first, np.round(_PARALLEL * (last - first) / (length or 1.0))]) + 0.0
        bare = len(rows) == 2 and lines.setdefault(measurement, line.tobytes()) == line.tobytes()
        lines[measurement] = lines[measurement] if bare else b""
        lengths.setdefault(measurement, {})[repeat] = length, group
    alone = {measurement: of for measurement, of in lengths.items() if lines[measurement]}
    step = last_digit(np.array([length for of in alone.values() for length, _ in of.values()]))
    apart = np.array([abs(a - b) for of in alone.values() for (a, _), (b, _) in combinations(of.values(), 2)])
    if not np.any(apart > 0.5 * step):
        return set()
    chance = min(1.0, step * _MEDIAN / np.sqrt(2 * np.pi) / float(np.median(apart[apart > 0.5 * step])))
    alike, copies = set[int](), set[int]()
    for together in (*({line} for line in set(lines.values())), set(lines.values())):
        compared = [of for measurement, of in alone.items() if lines[measurement] in together]
        for one, other in combinations(sorted({repeat for of in compared for repeat in of}), 2):
            both = [(of[one], of[other]) for of in compared if one in of and other in of]
            equal = {group for (a, _), (b, group) in both if abs(a - b) < 0.5 * step}
            n, k = len(both), len(equal)
            more = sum(comb(n, i) * chance**i * (1 - chance) ** (n - i) for i in range(k, n + 1))
            (alike if more >= _CHANCE else copies).update(equal)
    return alike - copies


def last_digit(lengths: Floats) -> float:
    """The last digit that lengths (n,), mm, were printed with, mm; of inches as well."""
    for digits in range(9):
        for unit in (1.0, _INCH):
            printed = lengths / unit * 10.0**digits
            if np.all(np.abs(printed - np.round(printed)) < 1e-9 * 10.0**digits + 1e-7):
                return unit * 10.0**-digits
    return 0.0
