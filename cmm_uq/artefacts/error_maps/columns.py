"""Error maps of one machine side by side: each error of each carriage in every map, and what is odd among their figures.

A column that is another map's to the last digit, but for a constant, for a few readings, or for having been rounded
further, was measured once, whatever temperature stands above it. A spike leaves the course of what a map differs by from
the others on both sides of it, and comes back; a narrow feature that every map has is none, nor is the place where a map
goes on at another level. The measure is how far the readings of that very map usually lie off their neighbours.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import reduce
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from cmm_uq.analysis.screening.columns import Finding
from cmm_uq.base.messages import Text, Verbatim, commas, listed, number, say, signed
from cmm_uq.base.points import AXES, Floats
from cmm_uq.base.units import ARCSECOND, METRE, MICROMETRE, Unit, unit
from cmm_uq.base.values import dataclass
from cmm_uq.machine.physics.error_map import COLUMNS, ErrorMap

_LAST_DIGIT = 1e-9  # mm

# part of the readings that are the same to the last digit, from which on a column is another one with a few changed
_MOST = 0.8

_FEWEST, _VALUES = 6, 4  # same readings, and different values among them, without which that is coincidence
_DIGITS = range(5)  # after the point, in the column's unit
_EXACT = 1e-6  # of the last digit


def copies(values: Floats, unit: float) -> list[tuple[int, ...]]:
    """Groups of maps (indices into ``values``, ascending) that give one column with the same figures.

    ``values`` (k, p) of one error in k maps, mm; a map that is zero throughout is in no group; ``unit`` size of the
    column's unit in ``values``.
    """
    groups: list[list[int]] = []
    for k in np.flatnonzero(values.any(axis=1)).tolist():
        group = next((group for group in groups if any(_same(values[j], values[k], unit) for j in group)), None)
        if group is None:
            groups.append(group := [])
        group.append(k)
    return [tuple(group) for group in groups if len(group) > 1]


def _same(one: Floats, other: Floats, unit: float) -> bool:
    apart = one - other
    if np.ptp(apart) <= _LAST_DIGIT:
        return True
    same = np.abs(apart - np.median(apart)) <= _LAST_DIGIT
    if same.mean() >= _MOST and _no_coincidence(one[same]):
        return True
    coarse, fine = sorted((one, other), key=lambda course: _digits(course, unit))
    digits = _digits(coarse, unit)
    rounded = np.abs(coarse - fine) <= (0.5 + _EXACT) * 10.0**-digits * unit
    return digits < _digits(fine, unit) and bool(rounded.all()) and _no_coincidence(coarse)


def _no_coincidence(readings: Floats) -> bool:
    return len(readings) >= _FEWEST and len(np.unique(np.round(readings, 9))) >= _VALUES


def _digits(course: Floats, unit: float) -> int:
    figures = course / unit
    enough = (n for n in _DIGITS if np.all(np.abs(figures * 10**n - np.round(figures * 10**n)) < _EXACT * 10**n))
    return next(enough, _DIGITS.stop)


# readings on each side that a reading is judged by: nearly half of the former may be spikes themselves, and the
# latter follow a course that wanders
SIDE, NEAR = 7, 3

WIDEST = 2  # readings in a row that are a spike; more are a part of the travel where the map differs
_FEWEST_of_spikes = 6  # readings of a column

# weight of what the first and the last reading are off: there is no other side on which the course would come back
_AT_AN_END = 0.5

_FAR = 7.0  # of its robust standard deviations, by which a reading off its neighbours is a spike

# part of a spike that shows in the course of one of two maps, and not in that of the other, for it to be that one's
_OWN = 0.5

_SEEN = 3.0  # of the standard deviations between maps, by which a jump of a map's own course is off the others too
_BESIDE = 0.4  # part of a spike by which a reading beside it belongs to it
_ROUNDS = 5

# part of the readings of a map that may be spikes; with more, what is left of the column is not believed
DAMAGED = 0.25

_FINEST = 0.3  # part of the last digit that the standard deviation of no reading is below


def spikes(positions: Floats, values: Floats, unit: float) -> NDArray[np.bool_]:
    """Which readings (k, p) of one error in k maps are spikes.

    ``positions`` (p,) mm, ascending; ``values`` (k, p) mm; ``unit`` size of the column's unit in ``values``.
    """
    found, left = np.zeros(values.shape, dtype=bool), values.copy()
    if values.shape[1] < _FEWEST_of_spikes:
        return found
    beside, steps = (
        (_Beside.of(positions, SIDE), _Beside.of(positions, NEAR)),
        np.diff(np.unique(np.round(values / unit, 6))),
    )
    finest = _FINEST * float(steps.min()) * unit if len(steps) else 0.0
    for _ in range(_ROUNDS):
        off, new = _round(beside, left, finest)
        new &= ~found
        if not new.any():
            break
        found |= new
        left = np.where(new, left - off, left)  # as the others say: maps may begin at different levels
    return found


def _round(beside: tuple[_Beside, _Beside], values: Floats, finest: float) -> tuple[Floats, NDArray[np.bool_]]:
    """How far the readings are off, and which of them are spikes, (k, p) each."""
    off, alike, courses = (np.zeros(values.shape) for _ in range(3))
    shown = np.zeros(values.shape, dtype=bool)
    wide, near = beside
    for k, own in enumerate(values):
        against = own - np.median(np.delete(values, k, axis=0), axis=0)
        off[k], alike[k] = wide.off(against)
        courses[k], jump = wide.off(own)
        closely, beside_it = near.off(against)
        scales = (max(1.4826 * float(np.median(np.abs(some))), finest) for some in (off[k], courses[k], closely))
        between, along, close = scales
        # against the others it is followed best, but where these are the noisy ones, the map's own course says more
        sure = (alike[k] > _FAR * between) | ((beside_it > _FAR * close) & (alike[k] > _OWN * beside_it))
        sure |= (jump > _FAR * along) & (off[k] * np.sign(courses[k]) > np.maximum(_OWN * jump, _SEEN * between))
        alike[k] = np.where(sure, np.maximum(alike[k], _OWN * jump), alike[k])
        shown[k] = sure & _narrow(alike[k] * np.sign(off[k]))
    if len(values) == 2:
        # one of the two: the one whose own course jumps
        apart = np.abs(courses - off)
        return off, shown & (apart + _OWN * np.abs(off) < apart[::-1])
    return off, shown & (np.abs(off) >= np.abs(off).max(axis=0))


@dataclass(frozen=True, eq=False)
class _Beside:
    """The readings beside each of p readings."""

    positions: Floats
    index: NDArray[np.intp]  # (p, 2·side) says which, those before first
    there: NDArray[np.bool_]  # whether they are
    # (p, 2·side) which of the p − 1 steps lie about the reading, ``steps`` whether they are there
    slopes: NDArray[np.intp]
    steps: NDArray[np.bool_]

    @classmethod
    def of(cls, positions: Floats, side: int) -> _Beside:
        p = len(positions)
        about = np.concatenate([np.arange(-side, 0), np.arange(1, side + 1)])
        index = np.arange(p)[:, None] + about
        slopes = np.arange(p)[:, None] + np.arange(-side, side)
        return cls(
            positions, np.clip(index, 0, p - 1), (index >= 0) & (index < p), np.clip(slopes, 0, p - 2),
            (slopes >= 0) & (slopes < p - 1),
        )  # fmt: skip

    def off(self, values: Floats) -> tuple[Floats, Floats]:
        """How far each reading (p,) is off its neighbours, and by how much off those on either side alike; 0 where it is not.

        By medians of what the neighbours say, brought along by the usual slope about the reading.
        """
        slope = _median((np.diff(values) / np.diff(self.positions))[self.slopes], self.steps)
        apart = self.positions[:, None] - self.positions[self.index]
        gap = values[:, None] - values[self.index] - slope[:, None] * apart
        off, alike = _median(gap, self.there), np.full(len(values), np.inf)
        half = self.index.shape[1] // 2
        for side in (slice(None, half), slice(half, None)):
            there = self.there[:, side]
            own = _median(gap[:, side], there) * np.sign(off)
            alike = np.where(there.any(axis=1), np.minimum(alike, np.maximum(own, 0.0)), alike)
        alike = np.minimum(alike, np.abs(off))
        alike[[0, -1]] *= _AT_AN_END
        return off, alike


def _median(values: Floats, there: NDArray[np.bool_]) -> Floats:
    """Of those of each row (p, n) that are there; 0 where none is."""
    ordered, count = np.sort(np.where(there, values, np.inf), axis=1), there.sum(axis=1)
    middle = np.column_stack([np.maximum(count - 1, 0) // 2, count // 2])
    low, high = np.take_along_axis(ordered, middle, axis=1).T
    return np.where(count > 0, 0.5 * (low + high), 0.0)


def _narrow(alike: Floats) -> NDArray[np.bool_]:
    """Which readings (p,) are not part of a longer stretch that lies off in the same direction."""
    kept = np.ones(len(alike), dtype=bool)
    for i in np.flatnonzero(alike):
        beside = alike * np.sign(alike[i]) > _BESIDE * abs(alike[i])
        low = high = int(i)
        while low > 0 and beside[low - 1]:
            low -= 1
        while high < len(alike) - 1 and beside[high + 1]:
            high += 1
        kept[i] = high - low < WIDEST
    return kept


LEAST_POSITIONS = 4  # positions that the maps of a column must share
# Times that a third map of a scale is farther off than its temperature explains, for two others to be copies
_UNMOVED = 5.0
_TURNED = 0.3  # part of the misfit that is left when a column with the wrong sign is turned


@dataclass(frozen=True, eq=False)
class MapColumn:
    """One error of one carriage in k maps, at the p positions that they share."""

    axis: str  # the carriage
    component: int  # 0 … 5: displacements along x, y, z, rotations about x, y, z
    positions: Floats  # (p,) mm
    values: Floats  # (k, p) mm; of rotations the displacement at a lever of one metre
    temperatures: Floats  # (k,) °C

    @property
    def title(self) -> Text:
        return title_of(self.axis, self.component)

    @property
    def is_scale(self) -> bool:
        return AXES[self.component % 3] == self.axis and self.component < 3

    @property
    def is_straightness(self) -> bool:
        """Whether it is a displacement across: measured against a straight line, whose direction is not known."""
        return self.component < 3 and not self.is_scale

    @property
    def unit(self) -> tuple[Unit, float]:
        """Unit as printed, and its size in ``values``."""
        return unit("µm" if self.component < 3 else "″"), _size(self.component)


def title_of(axis: str, component: int) -> Text:
    carriage, along = Verbatim(axis.upper()), Verbatim(AXES[component % 3].upper())
    if component >= 3:
        return say("rotation of {axis} about {along}", axis=carriage, along=along)
    if along == carriage:
        return say("scale error of {along}", along=along)
    return say("straightness of {axis} along {along}", axis=carriage, along=along)


def columns_of(maps: Sequence[ErrorMap]) -> tuple[list[MapColumn], list[Finding]]:
    """Errors that at least two maps give with figures of their own, and all that is odd; spikes are left out.

    Where several maps have one column's figures, they are counted once; of a scale not at all, for at which of the
    temperatures it was measured decides how it expands, and nobody knows.
    """
    columns: list[MapColumn] = []
    findings: list[Finding] = []
    same: dict[tuple[float, ...], list[Text]] = {}
    unmeasured: list[Text] = []
    for axis, carriage in enumerate(AXES):
        shared = reduce(lambda one, other: one[np.isin(one, other)], (m.axes[axis].positions for m in maps))
        for component in range(6):
            title, size = title_of(carriage, component), _size(component)
            values = _values(maps, axis, component, shared)
            copied, measured = copies(values, size), np.flatnonzero(values.any(axis=1)).tolist()
            for group in copied:
                same.setdefault(tuple(maps[k].temperature for k in group), []).append(title)
            unmeasured += [] if measured else [title]
            again = {k for group in copied for k in (group if component == axis else group[1:])}
            own = np.array([k for k in measured if k not in again], dtype=np.int64)
            if len(own) >= 2 and len(shared) >= LEAST_POSITIONS:
                column, odd = _looked_at([maps[k] for k in own], values[own], axis, component, shared)
                columns += [] if column is None else [column]
                findings += [*odd, *([] if column is None else _unmoved(column))]
        if (count := len(shared)) < LEAST_POSITIONS:
            why = say(
                "the maps share {count} positions of axis {carriage}: they are not compared. Map the same positions",
                count=count,
                carriage=Verbatim(carriage),
            )
            findings.append(Finding("positions", (), (), why))
    return columns, [*_alike(same, unmeasured), *findings]


def _size(component: int) -> float:
    """Of a column's unit, mm; of rotations at a lever of one metre."""
    return MICROMETRE if component < 3 else ARCSECOND * METRE


def _values(maps: Sequence[ErrorMap], axis: int, component: int, shared: Floats) -> Floats:
    """(k, p) of one error of one carriage at the positions that the maps share, mm; of rotations at a lever of one metre."""
    lever, axes = 1.0 if component < 3 else METRE, [m.axes[axis] for m in maps]
    shown = [lever * one.errors[np.isin(one.positions, shared), component] for one in axes]
    return np.array(shown).reshape(len(maps), -1)


def _looked_at(
    maps: Sequence[ErrorMap], values: Floats, axis: int, component: int, shared: Floats
) -> tuple[MapColumn | None, list[Finding]]:
    """What of an error can be compared, ``None`` where too little is left, and what is odd."""
    title, size, findings = title_of(AXES[axis], component), _size(component), list[Finding]()
    found = spikes(shared, values, size)
    damaged = found.mean(axis=1) > DAMAGED
    for k in np.flatnonzero(damaged).tolist():
        why = say(
            "the {title} jumps in more than a quarter of its readings in the map at {temperature:g} °C; that map's is left "
            "out. Measure it again",
            title=title,
            temperature=maps[k].temperature,
        )
        findings.append(Finding("outlier", (), (), why, set_aside=True))
    for k, i in zip(*np.nonzero(found & ~damaged[:, None]), strict=True):
        why = say(
            "the {title} at {position} mm in the map at {temperature:g} °C, {value}, jumps off its neighbours and off the "
            "other maps; the position is left out. Measure it again",
            title=title, position=signed(shared[i], "g"), temperature=maps[k].temperature,
            value=signed(values[k, i] / size, ".4g"),
        )  # fmt: skip
        findings.append(Finding("outlier", (), (), why, column=COLUMNS[component], set_aside=True))
    kept, left = ~found[~damaged].any(axis=0), np.flatnonzero(~damaged).tolist()
    if len(left) < 2 or kept.sum() < LEAST_POSITIONS:
        return None, findings
    temperatures = np.array([maps[k].temperature for k in left])
    return MapColumn(AXES[axis], component, shared[kept], values[left][:, kept], temperatures), findings


def turned(column: MapColumn, k: int) -> bool:
    """Whether the figures of map k would agree with the others if their sign were turned."""
    centred = column.values - column.values.mean(axis=1, keepdims=True)
    others = np.delete(centred, k, axis=0).mean(axis=0)
    return bool(np.linalg.norm(centred[k] + others) < _TURNED * np.linalg.norm(centred[k] - others))


def roughness(column: MapColumn) -> float:
    """Standard deviation of a reading about a smooth course, mm, from the second differences between the maps."""
    differences = np.diff(column.values - column.values.mean(axis=0), 2, axis=1)
    freedom = 1 - 1 / len(column.values)
    return float(np.sqrt(np.mean(differences**2) / 6 / freedom)) or MICROMETRE / 100


def _unmoved(column: MapColumn) -> Iterator[Finding]:
    """Two maps of a scale that agree where by their temperatures, and by what a third map shows, they should not."""
    values, warm = column.values, column.temperatures
    for i, j in combinations(range(len(values)), 2) if column.is_scale else ():
        agree, apart = float(np.abs(values[j] - values[i]).max()), abs(warm[i] - warm[j])
        for third in sorted(set(range(len(values))) - {i, j}):
            far = min(float(np.abs(values[k] - values[third]).max()) for k in (i, j))
            gap = max(abs(warm[k] - warm[third]) for k in (i, j))
            if apart and agree * max(1.0, gap / apart) * _UNMOVED < far:
                why = say(
                    "{title}: the maps at {one:g} and {other:g} °C agree to {agree:.2g} µm where that at {third:g} °C is "
                    "{far:.2g} µm off, more than their temperatures explain. One may be a copy of another; say when and how "
                    "warm each was taken", title=column.title, one=warm[i], other=warm[j], third=warm[third],
                    agree=agree / MICROMETRE, far=far / MICROMETRE,
                )  # fmt: skip
                yield Finding("copied", (), (), why)


def _alike(same: dict[tuple[float, ...], list[Text]], unmeasured: list[Text]) -> Iterator[Finding]:
    for temperatures, titles in same.items():
        why = say(
            "{titles}: the maps at {temperatures} °C give the same figures. They were measured once, and say "
            "nothing of how the maps differ; measure them at each temperature",
            titles=listed(titles),
            temperatures=commas(number(t, "g") for t in temperatures),
        )
        yield Finding("copied", (), (), why, set_aside=True)
    if unmeasured:
        why = say("{titles}: zero in every map, so they were not measured", titles=listed(unmeasured))
        yield Finding("not measured", (), (), why, set_aside=True)
