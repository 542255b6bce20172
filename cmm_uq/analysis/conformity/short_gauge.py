"""A short gauge beside lengths between centres: what makes these bidirectional for a test that asks for it.

Between the centres of two balls a probe's ball, its hysteresis and its direction-dependent trigger cancel; between two faces
that look away from each other they do not. A short gauge of two such faces, measured in the same place and direction, has
them whole and hardly any error of the machine's geometry beside them: its error is added to that of the length between
centres (docs/standards.md says what of this is verified).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from cmm_uq.analysis.conformity.as_recorded import Around
from cmm_uq.analysis.conformity.length_conditions import tip_offsets
from cmm_uq.analysis.conformity.plans import ALIGNED, OFFSET_TOLERANCE_MM, Condition
from cmm_uq.base.messages import NOTHING, Text, say
from cmm_uq.base.points import Floats, Ints, Points
from cmm_uq.jobs.recording.short_gauge import ShortGauge
from cmm_uq.machine.model.artefact import Artefact, Indications
from cmm_uq.maths.uncertainty.quantity import nominal, significant

NEAR_MM = 100.0  # of the middle of the short gauge from the line of a length, anywhere along it; this project's figure


class Supplemented(Around):
    """An artefact whose errors of lengths that are not bidirectional have those of a short gauge beside it added."""

    def __init__(self, inner: Artefact, gauge: ShortGauge) -> None:
        super().__init__(inner)
        self.gauge, self._served = gauge, dict[bytes, Ints]()
        self._numbers = gauge.points.measurement[gauge.rows[:, 0]]
        self._copied = np.isin(gauge.points.group[gauge.rows[:, 0]], list(gauge.points.copies))

    def indications(self) -> Indications | None:
        found = self.inner.indications()
        if found is None:
            return None
        served, first = self._measured_by(found.rows), found.rows[:, 0]
        beside = np.where(served >= 0, self.gauge.u_mm, 0.0)
        measurement, repeat = self.points.measurement[first], self.points.repeat[first]
        repeats_of = {m: np.unique(repeat[measurement == m]) for m in np.unique(measurement)}
        added = np.zeros(len(first))  # mm, error of the short gauge that each length's is taken with
        for i in np.flatnonzero(served >= 0):
            repeats = self.gauge.errors_mm[(self._numbers == served[i]) & ~self._copied]
            turn = int(np.searchsorted(repeats_of[measurement[i]], repeat[i]))
            outwards = repeats[np.argmax(np.abs(found.errors[i] + repeats))]
            added[i] = repeats[turn] if turn < len(repeats) else outwards
        return Indications(found.errors + added, found.lengths, np.hypot(found.u, beside), found.rows, beside)

    def bidirectional(self, rows: Ints) -> NDArray[np.bool_] | None:
        own = self.inner.bidirectional(rows)
        return None if own is None else np.asarray(own | (self._measured_by(rows) >= 0))

    def _measured_by(self, rows: Ints) -> Ints:
        """Measurement of the short gauge that serves each length, (m,): the nearest of those that fit; −1 for none."""
        key = rows.tobytes()
        if key not in self._served:
            self._served[key] = self._nearest(rows)
        return self._served[key]

    def _nearest(self, rows: Ints) -> Ints:
        gauge, own = self.gauge, self.inner.bidirectional(rows)
        middles, ways = gauge.lines_mm
        found = np.full(len(rows), -1, dtype=np.int64)
        tips, tips_of_gauge = _tips(self.points)[rows].mean(axis=1), _tips(gauge.points)[gauge.rows].mean(axis=1)
        for i in [] if own is None else np.flatnonzero(~own):
            first, line = self.points.xyz[rows[i, 0]], np.diff(self.points.xyz[rows[i]], axis=0)[0]
            # within 10° of the line, either way, and of its distance
            sine = np.linalg.norm(np.cross(ways, line), axis=1) / (np.linalg.norm(ways, axis=1) * np.linalg.norm(line))
            distance = np.linalg.norm(np.cross(middles - first, line / np.linalg.norm(line)), axis=1)
            fits = ~self._copied & (sine <= ALIGNED) & (distance <= NEAR_MM)
            fits &= np.linalg.norm(tips_of_gauge - tips[i], axis=1) <= OFFSET_TOLERANCE_MM
            if fits.any():
                at = np.flatnonzero(fits)
                found[i] = self._numbers[at[np.argmin(distance[at])]]
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
    counts: dict[int, int] = {}
    for group, own in enumerate(points.rows_of_groups):
        number = int(points.measurement[own[0]])
        counts[number] = counts.get(number, 0) + (group not in points.copies)
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


def _tips(points: Points) -> Floats:
    tips = tip_offsets(points)
    return np.zeros((len(points), 3)) if tips is None else tips
