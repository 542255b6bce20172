"""Readings that the screening left out of the estimates, as they were recorded: a decision is made of the whole recording.

A reading that misses the artefact by more than any machine's error spoils an estimate and is left out of it. For a decision it
is a value outside: the machine, or whoever worked at it, indicated it. Copies of a whole (measurement, repeat) alone are no
measurements.
"""

from __future__ import annotations

import contextlib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from cmm_uq.analysis.conformity.plans import Condition
from cmm_uq.analysis.screening.finding import Finding
from cmm_uq.analysis.screening.screening import REVERSED, with_sound_sensors
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.messages import Message, Text, commas, number, say
from cmm_uq.base.points import Floats, Ints, Points
from cmm_uq.machine.model.artefact import Artefact, Forms, Indications
from cmm_uq.machine.model.kind import Observed

_NAMED = 5  # Findings, or gaps of a numbering, that are named one by one


@dataclass(frozen=True, eq=False)
class OutsideReadings:
    """What of a recording the estimates do not hold."""

    recording: Points
    # made of all but copies, or with their places in other repeats for points that no artefact can be made with, None
    # where that cannot be either, or nothing was left out
    artefact: Artefact | None
    xyz: Floats  # (n, 3) the points of artefact as they were recorded, mm
    kept: NDArray[np.bool_]  # (n,) rows of artefact.points that the estimates hold
    outside: NDArray[np.bool_]  # (n,) those that they do not, because they miss the artefact
    findings: tuple[Finding, ...]

    @classmethod
    def of(cls, recording: Points, findings: Sequence[Finding], observe: Observed) -> OutsideReadings:
        lost, copied = _rows(recording, findings), np.isin(recording.group, list(recording.copies))
        measured = ~(lost & copied)
        damaged = tuple(f for f in findings if f.kind != REVERSED and any(not copied[row] for row in f.rows))
        points, outside = with_sound_sensors(recording, findings).select(measured), _rows(recording, damaged)[measured]
        artefact = None
        for xyz in (points.xyz, _of_other_repeats(points, outside)) if np.any(lost & measured) else ():
            if artefact is None and xyz is not None:
                with contextlib.suppress(CmmUqError):  # no artefact, and no value
                    artefact = observe(points.at(xyz))
        return cls(recording, artefact, points.xyz, ~lost[measured], outside, damaged)

    def whole(self, kept: Artefact) -> Artefact:
        """An artefact, corrected or not, with what was left out of it."""
        return kept if self.artefact is None else AsRecorded(kept, self.artefact, self)

    def any_of(self, rows: Ints) -> NDArray[np.bool_]:
        """Which of some values (m,), each of several points (m, j), rest on a reading that was left out as outside."""
        return np.zeros(len(rows), dtype=bool) if self.artefact is None else np.asarray(self.outside[rows].any(axis=1))

    @property
    def without_value(self) -> tuple[Text, ...]:
        return () if self.artefact is not None else tuple(f.why for f in self.findings)

    def in_words(self, measurements: Sequence[int | None]) -> list[Text]:
        """Why readings of some measurements, or of all (``None``), were left out."""
        about = [f.why for f in self.findings if None in measurements or set(f.measurements) & set(measurements)]
        words: list[Text] = [
            say("Outside, and left out of the estimates alone: {why}.", why=why) for why in about[:_NAMED]
        ]
        if len(about) > _NAMED:
            words.append(say("Outside, too, are the readings of {count} findings more.", count=len(about) - _NAMED))
        return words


class Around(Artefact):
    """An artefact that is as another one but for what its class says otherwise."""

    def __init__(self, inner: Artefact, points: Points | None = None) -> None:
        self.inner = inner
        self.kind, self.title, self.points, self.sizes = (
            inner.kind,
            inner.title,
            inner.points if points is None else points,
            inner.sizes,
        )
        self.noise_scale, self.rows = inner.noise_scale, inner.rows
        self.measurement, self.repeat = inner.measurement, inner.repeat

    def indications(self) -> Indications | None:
        return self.inner.indications()

    def lengths(self) -> Floats | None:
        return self.inner.lengths()

    def forms(self) -> Forms | None:
        return self.inner.forms()

    def lines_of(self, rows: Ints) -> tuple[Floats, Floats]:
        return self.inner.lines_of(rows)

    def bidirectional(self, rows: Ints) -> NDArray[np.bool_] | None:
        return self.inner.bidirectional(rows)

    def fit(self, true_xyz: Floats, sizes: Floats) -> Floats:
        return self.inner.fit(true_xyz, sizes)

    def project(self, xyz: Floats, displacement: Floats) -> Floats:
        return self.inner.project(xyz, displacement)

    def size_change(self) -> Floats:
        return self.inner.size_change()


class AsRecorded(Around):
    """An artefact with the readings that were left out of it: what rests on others is as these alone have it."""

    def __init__(self, own: Artefact, raw: Artefact, left_out: OutsideReadings) -> None:
        xyz = left_out.xyz.copy()
        xyz[left_out.kept] = own.points.xyz
        super().__init__(raw, raw.points.at(xyz))
        self.own, self.sizes, self._kept, self._xyz = own, own.sizes, left_out.kept, left_out.xyz
        self._at, self._back = np.flatnonzero(self._kept), np.cumsum(self._kept) - 1

    def indications(self) -> Indications | None:
        own, raw = self.own.indications(), self.inner.indications()
        if own is None or raw is None:
            return raw
        ends = (xyz[raw.rows[:, 1]] - xyz[raw.rows[:, 0]] for xyz in (self._xyz, self.inner.points.xyz))
        recorded, placed = (np.asarray(np.linalg.norm(each, axis=1), dtype=np.float64) for each in ends)
        return replace(raw, errors=_merged(raw.errors + (recorded - placed), raw.rows, own.errors, self._at[own.rows]))

    def lengths(self) -> Floats | None:
        own, raw = self.own.lengths(), self.inner.lengths()
        return raw if own is None or raw is None else _merged(raw, self.rows, own, self._at[self.own.rows])

    def forms(self) -> Forms | None:
        own, raw = self.own.forms(), self.inner.forms()
        if own is None or raw is None:
            return raw
        runs, counts = (np.column_stack([f.measurement, f.repeat, f.count]).tolist() for f in (raw, own))
        chosen = {tuple(run): i for i, run in enumerate(counts)}
        same = [(i, chosen[tuple(run)]) for i, run in enumerate(runs) if tuple(run) in chosen]
        to, of = np.array(same, dtype=np.int64).reshape(-1, 2).T
        mixed = {}
        for name in ("form", "size", "centres"):
            whole, part = getattr(raw, name), getattr(own, name)
            if whole is not None and part is not None:
                mixed[name] = whole.copy()
                mixed[name][to] = part[of]
        return replace(raw, **mixed)

    def lines_of(self, rows: Ints) -> tuple[Floats, Floats]:
        middles, along = (each.copy() for each in self.inner.lines_of(rows))
        known = self._kept[rows].all(axis=1)
        if known.any():
            middles[known], along[known] = self.own.lines_of(self._back[rows[known]])
        return middles, along

    def bidirectional(self, rows: Ints) -> NDArray[np.bool_] | None:
        both, known = self.inner.bidirectional(rows), self._kept[rows].all(axis=1)
        own = self.own.bidirectional(self._back[rows[known]]) if known.any() else None
        if both is not None and own is not None:
            both = both.copy()
            both[known] = own
        return both


def numbered(points: Points, repeats: int | None = None, *, measurements: bool = True) -> tuple[Condition, ...]:
    """That nothing is missing from the numbering of measurements, of their repeats and of the points in each.

    Whoever numbers consecutively and takes a row out leaves a gap: what stood there is not known. ``repeats``: up to which a
    repeat has every point of its measurement; ``measurements``: whether these are numbered consecutively by themselves.
    """
    absent = _absent(np.unique(points.measurement)) if measurements else []
    gaps = [say("measurement {which}: numbered, and not recorded", which=_which(absent))] if absent else []
    gaps += _gaps(points, repeats)
    if not gaps:
        return ()
    shown = gaps[:_NAMED]
    if len(gaps) > _NAMED:
        shown.append(say("{count} gaps more of the numbering", count=len(gaps) - _NAMED))
    return (Condition(say("measurements, repeats and points numbered without a gap"), tuple(shown)),)


def _gaps(points: Points, repeats: int | None) -> Iterator[Message]:
    runs: dict[int, dict[int, set[int]]] = {}
    for group, rows in enumerate(points.rows_of_groups):
        measurement, repeat = points.run_of(group)
        runs.setdefault(measurement, {})[repeat] = set(points.point[rows].tolist())
    lines = {measurement: set().union(*own.values()) for measurement, own in runs.items()}
    holes = {measurement: _absent(np.array(sorted(numbers))) for measurement, numbers in lines.items()}
    consecutive = 2 * sum(not each for each in holes.values()) > len(holes)
    for measurement, own in runs.items():
        if absent := _absent(np.array(sorted(own))):
            yield say("repeat {which} of measurement {measurement}: numbered, and not recorded", which=_which(absent),
                      measurement=measurement)  # fmt: skip
        if consecutive and holes[measurement]:
            yield say("point {which} of measurement {measurement}: numbered, and not recorded",
                      which=_which(holes[measurement]), measurement=measurement)  # fmt: skip
        asked = sorted(own)[:repeats]
        usual = set().union(*(own[repeat] for repeat in asked))
        for repeat in asked:
            if absent := sorted(usual - own[repeat]):
                yield say(
                    "point {which} of measurement {measurement}, repeat {repeat}: recorded in its other repeats alone",
                    which=_which(absent), measurement=measurement, repeat=repeat,
                )  # fmt: skip


def _absent(numbers: Ints) -> list[int]:
    """What lacks between 1, or a lower first number, and the highest."""
    return sorted(set(range(min(1, int(numbers[0])), int(numbers[-1]) + 1)) - set(numbers.tolist()))


def _which(numbers: Sequence[int]) -> Text:
    shown = [number(n) for n in numbers[:_NAMED]]
    if len(numbers) > _NAMED:
        return say("{shown} and {count} more", shown=commas(shown), count=len(numbers) - _NAMED)
    return commas(shown)


def _of_other_repeats(points: Points, outside: NDArray[np.bool_]) -> Floats | None:
    """Coordinates (n, 3) with those of another repeat for points that are outside; ``None`` where one has no other."""
    xyz = points.xyz.copy()
    for row in np.flatnonzero(outside):
        same = (points.measurement == points.measurement[row]) & (points.point == points.point[row]) & ~outside
        if not same.any():
            return None
        xyz[row] = points.xyz[np.argmax(same)]
    return xyz


def _rows(points: Points, findings: Sequence[Finding]) -> NDArray[np.bool_]:
    chosen = np.zeros(len(points), dtype=bool)
    chosen[[row for found in findings for row in found.rows]] = True
    return chosen


def _merged(raw: Floats, keys: Ints, own: Floats, own_keys: Ints) -> Floats:
    """Values (m,) of the whole recording, those of the same points as they are without what was left out."""
    of: Mapping[tuple[int, ...], float] = dict(zip(map(tuple, own_keys.tolist()), own.tolist(), strict=True))
    return np.array([of.get(tuple(key), value) for key, value in zip(keys.tolist(), raw.tolist(), strict=True)])
