"""Artefacts as they are decided on: the whole recording, copies apart, with what was set aside, and a short gauge beside."""

from __future__ import annotations

import contextlib
from collections import Counter
from collections.abc import Collection, Iterator, Mapping, Sequence
from copy import copy

import numpy as np
from numpy.typing import NDArray

from cmm_uq.analysis.conformity.plan_conditions import tip_offsets
from cmm_uq.analysis.conformity.plans import ALIGNED, OFFSET_TOLERANCE_MM, Condition
from cmm_uq.analysis.screening.columns import Finding
from cmm_uq.analysis.screening.screening import REVERSED, with_sound_sensors
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.messages import NOTHING, Message, Text, commas, number, say
from cmm_uq.base.points import Floats, Ints, Points
from cmm_uq.base.values import dataclass, replace
from cmm_uq.jobs.recording.beside import ShortGauge
from cmm_uq.machine.model.artefact import Artefact, ArtefactFigure, Forms, Indications
from cmm_uq.machine.model.kind import Observed
from cmm_uq.maths.geometry.positioning import PositioningRuns
from cmm_uq.maths.uncertainty.quantity import nominal, significant

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
        def rows_of(chosen: Sequence[Finding]) -> NDArray[np.bool_]:
            return np.isin(np.arange(len(recording)), [row for one in chosen for row in one.rows])

        lost, copied = rows_of(findings), np.isin(recording.group, list(recording.copies))
        measured = ~(lost & copied)
        damaged = tuple(f for f in findings if f.kind != REVERSED and any(not copied[row] for row in f.rows))
        points, outside = with_sound_sensors(recording, findings).select(measured), rows_of(damaged)[measured]
        artefact = None
        for xyz in (points.xyz, _of_other_repeats(points, outside)) if np.any(lost & measured) else ():
            if artefact is None and xyz is not None:
                with contextlib.suppress(CmmUqError):  # no artefact, and no value
                    artefact = observe(points.at(xyz))
        return cls(recording, artefact, points.xyz, ~lost[measured], outside, damaged)

    def whole(self, kept: Artefact) -> Artefact:
        """An artefact, corrected or not, with what was left out of it."""
        if self.artefact is None:
            return kept
        same = len(kept.points) == np.sum(self.kept)  # else it has points of its own, and its readings are in columns
        return AsRecorded(kept, self.artefact, self) if same else self.artefact

    def any_of(self, rows: Ints) -> NDArray[np.bool_]:
        """Which of some values (m,), each of several points (m, j), rest on a reading that was left out as outside."""
        return np.zeros(len(rows), dtype=bool) if self.artefact is None else np.asarray(self.outside[rows].any(axis=1))

    @property
    def without_value(self) -> tuple[Text, ...]:
        return () if self.artefact is not None else tuple(f.why for f in self.findings)

    def in_words(self, measurements: Sequence[int | None]) -> list[Text]:
        """Why readings of some measurements, or of all (``None``), were left out."""
        about = [f.why for f in self.findings if None in measurements or set(f.measurements) & set(measurements)]
        words: list[Text] = [say("Outside, and left out of the estimates alone: {why}.", why=w) for w in about[:_NAMED]]
        if (more := len(about) - _NAMED) > 0:
            words.append(say("Outside, too, are the readings of {count} findings more.", count=more))
        return words


class Around(Artefact):
    """An artefact that is as another one but for what its class says otherwise."""

    def __init__(self, inner: Artefact, points: Points | None = None) -> None:
        self.inner, self.points = inner, inner.points if points is None else points
        self.kind, self.title, self.sizes, self.rows = inner.kind, inner.title, inner.sizes, inner.rows
        self.form, self.key_of_u = inner.form, inner.key_of_u  # type: ignore[misc]
        self.noise_scale, self.measurement, self.repeat = inner.noise_scale, inner.measurement, inner.repeat

    def indications(self) -> Indications | None:
        return self.inner.indications()

    def lengths(self) -> Floats | None:
        return self.inner.lengths()

    def forms(self) -> Forms | None:
        return self.inner.forms()

    def positionings(self) -> Mapping[int, PositioningRuns]:
        return self.inner.positionings()

    def figures(self, counts: NDArray[np.bool_]) -> Mapping[str, ArtefactFigure]:
        if self.inner.indications() is not None:
            return super().figures(counts)
        placed = copy(self.inner)
        placed.points = self.points
        return placed.figures(counts)

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
        runs, chosen = (np.column_stack([f.measurement, f.repeat, f.count]).tolist() for f in (raw, own))
        same = [(i, chosen.index(run)) for i, run in enumerate(runs) if run in chosen]
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
    absent = _absent(np.unique(points.measurement).tolist()) if measurements else []
    gaps = [say("measurement {which}: numbered, and not recorded", which=_which(absent))] if absent else []
    gaps += _gaps(points, repeats)
    if not gaps:
        return ()
    shown, more = gaps[:_NAMED], len(gaps) - _NAMED
    shown += [say("{count} gaps more of the numbering", count=more)] if more > 0 else []
    return (Condition(say("measurements, repeats and points numbered without a gap"), tuple(shown)),)


def _gaps(points: Points, repeats: int | None) -> Iterator[Message]:
    runs: dict[int, dict[int, set[int]]] = {}
    for group, rows in enumerate(points.rows_of_groups):
        measurement, repeat = points.run_of(group)
        runs.setdefault(measurement, {})[repeat] = set(points.point[rows].tolist())
    holes = {measurement: _absent(set().union(*own.values())) for measurement, own in runs.items()}
    consecutive = 2 * sum(not each for each in holes.values()) >= len(holes)
    for m, own in runs.items():
        if absent := _absent(own):
            yield say("repeat {which} of measurement {measurement}: numbered, and not recorded", which=_which(absent),
                      measurement=m)  # fmt: skip
        if consecutive and holes[m]:
            yield say("point {which} of measurement {measurement}: numbered, and not recorded",
                      which=_which(holes[m]), measurement=m)  # fmt: skip
        first = sorted(own)[:repeats]
        usual = set().union(*(own[repeat] for repeat in first))
        for repeat in first:
            if absent := sorted(usual - own[repeat]):
                yield say(
                    "point {which} of measurement {measurement}, repeat {repeat}: recorded in its other repeats alone",
                    which=_which(absent),
                    measurement=m,
                    repeat=repeat,
                )


def _absent(numbers: Collection[int]) -> list[int]:
    """What lacks between 1, or a lower first number, and the highest."""
    return sorted(set(range(min(1, *numbers), max(numbers) + 1)) - set(numbers))


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


def _merged(raw: Floats, keys: Ints, own: Floats, own_keys: Ints) -> Floats:
    """Values (m,) of the whole recording, those of the same points as they are without what was left out."""
    of: Mapping[tuple[int, ...], float] = dict(zip(map(tuple, own_keys.tolist()), own.tolist(), strict=True))
    return np.array([of.get(tuple(key), value) for key, value in zip(keys.tolist(), raw.tolist(), strict=True)])


NEAR_MM = 100.0  # of the middle of the short gauge from the line of a length, anywhere along it; this project's figure


class Supplemented(Around):
    """An artefact whose errors of lengths that are not bidirectional have those of a short gauge beside it added."""

    def __init__(self, inner: Artefact, gauge: ShortGauge) -> None:
        super().__init__(inner)
        self.gauge, self._served = gauge, dict[bytes, list[Ints]]()
        self._numbers = gauge.points.measurement[gauge.rows[:, 0]]
        self._copied = np.isin(gauge.points.group[gauge.rows[:, 0]], list(gauge.points.copies))

    def indications(self) -> Indications | None:
        found = self.inner.indications()
        if found is None:
            return None
        served, first = self._measured_by(found.rows), found.rows[:, 0]
        beside = np.where([len(own) > 0 for own in served], self.gauge.u_mm, 0.0)
        measurement, repeat = self.points.measurement[first], self.points.repeat[first]
        repeats_of = {m: np.unique(repeat[measurement == m]) for m in np.unique(measurement)}
        added = np.zeros(len(first))  # mm, error of the short gauge that each length's is taken with
        for i in np.flatnonzero(beside):
            turn, often = np.searchsorted(repeats_of[measurement[i]], repeat[i]), len(repeats_of[measurement[i]])
            of_each = (self.gauge.errors_mm[(self._numbers == own) & ~self._copied] for own in served[i])
            errors = np.concatenate([own[turn::often] if turn < len(own) else own for own in of_each])
            added[i] = errors[np.argmax(np.abs(found.errors[i] + errors))]
        return Indications(found.errors + added, found.lengths, np.hypot(found.u, beside), found.rows, beside)

    def bidirectional(self, rows: Ints) -> NDArray[np.bool_] | None:
        own = self.inner.bidirectional(rows)
        return None if own is None else own | np.array([len(one) > 0 for one in self._measured_by(rows)], dtype=bool)

    def _measured_by(self, rows: Ints) -> list[Ints]:
        """Measurements of the short gauge that lie by each length, (m,): all of those that fit, none left for a better one."""
        key = rows.tobytes()
        if key not in self._served:
            self._served[key] = self._fitting(rows)
        return self._served[key]

    def _fitting(self, rows: Ints) -> list[Ints]:
        gauge, own = self.gauge, self.inner.bidirectional(rows)
        middles, ways = gauge.lines_mm
        found = [np.empty(0, dtype=np.int64)] * len(rows)
        tips, tips_of_gauge = _tips(self.points)[rows].mean(axis=1), _tips(gauge.points)[gauge.rows].mean(axis=1)
        for i in [] if own is None else np.flatnonzero(~own):
            first, line = self.points.xyz[rows[i, 0]], np.diff(self.points.xyz[rows[i]], axis=0)[0]
            # within 10° of the line, either way, and of its distance
            sine = np.linalg.norm(np.cross(ways, line), axis=1) / (np.linalg.norm(ways, axis=1) * np.linalg.norm(line))
            distance = np.linalg.norm(np.cross(middles - first, line / np.linalg.norm(line)), axis=1)
            fits = ~self._copied & (sine <= ALIGNED) & (distance <= NEAR_MM)
            fits &= np.linalg.norm(tips_of_gauge - tips[i], axis=1) <= OFFSET_TOLERANCE_MM
            found[i] = np.unique(self._numbers[fits])
        return found


def supplemented(artefact: Artefact, gauge: ShortGauge | None) -> Artefact:
    return artefact if gauge is None else Supplemented(artefact, gauge)


def repeats_of_gauge(
    gauge: ShortGauge | None, found: Indications, wanted: int, shortest_mm: float
) -> tuple[Condition, ...]:
    """That a short gauge which some lengths rest on is short, and was measured as often as these, each time anew."""
    if gauge is None or found.u_beside is None or not found.u_beside.any():
        return ()
    points, counts = gauge.points, Counter[int]()
    for group, own in enumerate(points.rows_of_groups):
        counts[int(points.measurement[own[0]])] += group not in points.copies
    missing = [
        say("{wanted} repetitions of the short gauge in its measurement {number} ({count})",
            wanted=wanted, number=number, count=count)
        for number, count in counts.items() if count < wanted
    ]  # fmt: skip
    if (length := gauge.facts.length_mm) > shortest_mm:
        most, length_mm = shortest_mm, nominal(length)
        missing.append(say("a short gauge of at most {shortest:g} mm ({length} mm)", shortest=most, length=length_mm))
    return (Condition(say("a short gauge, {wanted} times in each place", wanted=wanted), tuple(missing)),)


def added_in_words(gauge: ShortGauge | None, found: Indications) -> Text:
    """How many errors have that of the short gauge in them; nothing where none has."""
    if gauge is None or found.u_beside is None or not found.u_beside.any():
        return NOTHING
    return say(
        "To {count} of {all} errors of lengths that are not bidirectional by themselves that of the short gauge, "
        "{length} mm, U = {U} µm (k = 2), in the same place and direction is added, repeat by repeat, by a procedure of this "
        "program: the text of the standard was not at hand.",
        count=int(np.count_nonzero(found.u_beside)),
        all=len(found.errors),
        length=nominal(gauge.facts.length_mm),
        U=significant(2 * gauge.facts.u_um),
    )


def _tips(points: Points) -> Floats:
    tips = tip_offsets(points)
    return np.zeros((len(points), 3)) if tips is None else tips
