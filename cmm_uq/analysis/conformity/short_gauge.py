"""A short gauge beside lengths between centres: what makes these bidirectional for a test that asks for it.

Between the centres of two balls a probe's ball, its hysteresis and its direction-dependent trigger cancel; between two faces
that look away from each other they do not. A short gauge of two such faces, measured in the same place and direction, has
them whole and hardly any error of the machine's geometry beside them: its error is added to that of the length between
centres (docs/standards.md says what of this is verified).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from cmm_uq.analysis.conformity.length_conditions import tip_offsets
from cmm_uq.analysis.conformity.plans import ALIGNED, OFFSET_TOLERANCE_MM, Condition
from cmm_uq.base.messages import NOTHING, Text, say
from cmm_uq.base.points import Floats, Ints, Points
from cmm_uq.jobs.recording.short_gauge import ShortGauge
from cmm_uq.machine.model.artefact import Artefact, Forms, Indications
from cmm_uq.maths.uncertainty.quantity import nominal, significant

NEAR_MM = 100.0
"""How far the middle of the short gauge may lie from the line of a length, anywhere along it; this project's figure."""


class Supplemented(Artefact):
    """An artefact whose errors of lengths that are not bidirectional have those of a short gauge beside it added."""

    def __init__(self, own: Artefact, gauge: ShortGauge) -> None:
        self.own, self.gauge = own, gauge
        self.kind, self.title, self.points, self.sizes = own.kind, own.title, own.points, own.sizes
        self.noise_scale, self.rows = own.noise_scale, own.rows
        self.measurement, self.repeat = own.measurement, own.repeat
        self._served: dict[bytes, Ints] = {}

    def indications(self) -> Indications | None:
        found = self.own.indications()
        if found is None:
            return None
        beside = np.where(self._measured_by(found.rows) >= 0, self.gauge.u_mm, 0.0)
        # Error of the short gauge that each length's is taken with, (m,) mm
        gauge, first = self.gauge, found.rows[:, 0]
        errors, number = gauge.errors_mm, gauge.points.measurement[gauge.rows[:, 0]]
        measurement, repeat = self.points.measurement[first], self.points.repeat[first]
        repeats_of = {m: np.unique(repeat[measurement == m]) for m in np.unique(measurement)}
        added = np.zeros(len(first))
        for i, serving in enumerate(self._measured_by(found.rows)):
            if serving < 0:
                continue
            repeats = errors[(number == serving) & ~_copied(gauge)]
            turn = int(np.searchsorted(repeats_of[measurement[i]], repeat[i]))
            outwards = repeats[np.argmax(np.abs(found.errors[i] + repeats))]
            added[i] = repeats[turn] if turn < len(repeats) else outwards
        return Indications(found.errors + added, found.lengths, np.hypot(found.u, beside), found.rows, beside)

    def bidirectional(self, rows: Ints) -> NDArray[np.bool_] | None:
        own = self.own.bidirectional(rows)
        return None if own is None else np.asarray(own | (self._measured_by(rows) >= 0))

    def lines_of(self, rows: Ints) -> tuple[Floats, Floats]:
        return self.own.lines_of(rows)

    def lengths(self) -> Floats | None:
        return self.own.lengths()

    def forms(self) -> Forms | None:
        return self.own.forms()

    def fit(self, true_xyz: Floats, sizes: Floats) -> Floats:
        return self.own.fit(true_xyz, sizes)

    def project(self, xyz: Floats, displacement: Floats) -> Floats:
        return self.own.project(xyz, displacement)

    def size_change(self) -> Floats:
        return self.own.size_change()

    def _measured_by(self, rows: Ints) -> Ints:
        """Measurement of the short gauge that serves each length, (m,): the nearest of those that fit; −1 for none."""
        key = rows.tobytes()
        if key not in self._served:
            self._served[key] = self._nearest(rows)
        return self._served[key]

    def _nearest(self, rows: Ints) -> Ints:
        gauge, points = self.gauge, self.points
        own = self.own.bidirectional(rows)
        middles, ways = gauge.lines_mm
        numbers = gauge.points.measurement[gauge.rows[:, 0]]
        copied = _copied(gauge)
        found = np.full(len(rows), -1, dtype=np.int64)
        tips, tips_of_gauge = _tips(points)[rows].mean(axis=1), _tips(gauge.points)[gauge.rows].mean(axis=1)
        for i, (first, last) in enumerate(points.xyz[rows]):
            if own is None or own[i]:
                continue
            # Which of some ways (q, 3) go along a line (3,), either way, within 10°
            line = last - first
            sine = np.linalg.norm(np.cross(ways, line), axis=1) / (np.linalg.norm(ways, axis=1) * np.linalg.norm(line))
            fits = ~copied & np.asarray(sine <= ALIGNED) & (_distance(middles, first, last) <= NEAR_MM)
            fits &= np.linalg.norm(tips_of_gauge - tips[i], axis=1) <= OFFSET_TOLERANCE_MM
            if fits.any():
                at = np.flatnonzero(fits)
                found[i] = numbers[at[np.argmin(_distance(middles[at], first, last))]]
        return found


def supplemented(artefact: Artefact, gauge: ShortGauge | None) -> Artefact:
    """The artefact with a short gauge beside it, where one was recorded."""
    return artefact if gauge is None else Supplemented(artefact, gauge)


def repeats_of_gauge(
    gauge: ShortGauge | None, found: Indications, wanted: int, shortest_mm: float
) -> tuple[Condition, ...]:
    """That a short gauge which some lengths rest on is short, and was measured as often as these, each time anew."""
    if gauge is None or found.u_beside is None or not found.u_beside.any():
        return ()
    points = gauge.points
    copies = set(points.copies)
    counts: dict[int, int] = {}
    for group, own in enumerate(points.rows_of_groups):
        counts.setdefault(int(points.measurement[own[0]]), 0)
        counts[int(points.measurement[own[0]])] += group not in copies
    missing = [
        say("{wanted} repetitions of the short gauge in its measurement {number} ({count})",
            wanted=wanted, number=number, count=count)
        for number, count in counts.items() if count < wanted
    ]  # fmt: skip
    if gauge.facts.length_mm > shortest_mm:
        missing.append(
            say("a short gauge of at most {shortest:g} mm ({length} mm)",
                shortest=shortest_mm, length=nominal(gauge.facts.length_mm))
        )  # fmt: skip
    return (Condition(say("a short gauge, {wanted} times in each place", wanted=wanted), tuple(missing)),)


def added_in_words(gauge: ShortGauge | None, found: Indications) -> Text:
    """How many errors have that of the short gauge in them; nothing where none has."""
    if gauge is None or found.u_beside is None or not found.u_beside.any():
        return NOTHING
    return say(
        "To {count} of {all} errors of lengths that are not bidirectional by themselves that of the short gauge, "
        "{length} mm, U = {U} µm (k = 2), in the same place and direction is added, repeat by repeat, by a procedure of this "
        "program: the text of the standard was not at hand.",
        count=int(np.count_nonzero(found.u_beside)), all=len(found.errors), length=nominal(gauge.facts.length_mm),
        U=significant(2 * gauge.facts.u_um),
    )  # fmt: skip


def _copied(gauge: ShortGauge) -> NDArray[np.bool_]:
    return np.isin(gauge.points.group[gauge.rows[:, 0]], list(gauge.points.copies))


def _tips(points: Points) -> Floats:
    tips = tip_offsets(points)
    return np.zeros((len(points), 3)) if tips is None else tips


def _distance(middles: Floats, first: Floats, last: Floats) -> Floats:
    """Of some places (q, 3) from the line through two ends, (q,) mm."""
    way = (last - first) / np.linalg.norm(last - first)
    return np.asarray(np.linalg.norm(np.cross(middles - first, way), axis=1), dtype=np.float64)
