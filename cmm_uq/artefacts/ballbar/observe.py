"""Ballbar: two balls a fixed distance apart, in many places.

The observation is the distance of the two ball centres; placing and direction cancel, and a bar without a certificate
leaves one scale common to all axes undetermined.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.messages import Text, say
from cmm_uq.base.points import Floats, Ints, Points
from cmm_uq.base.units import unit
from cmm_uq.jobs.tables.artefact import ArtefactFacts
from cmm_uq.machine.model.artefact import Artefact, Indications, Size
from cmm_uq.machine.model.artefact_doubt import temperature_of
from cmm_uq.machine.model.recorded import check_length, expansion, stated_sd
from cmm_uq.machine.physics.effect import Effect


class Ballbar(Artefact):
    """A ballbar as recorded: m lengths of 2m points.

    Parameters
    ----------
    facts : what the job says of the bar.
    points : the recording; points 1 and 2 of every (measurement, repeat).

    Raises
    ------
    CmmUqError : a bar lacks an end or has both in one place, or its length is off by a factor that a unit explains.
    """

    kind = "ballbar"
    title = say("Ballbar")

    def __init__(self, facts: ArtefactFacts, points: Points, *, where: str | None = None) -> None:
        self.points = points
        self._facts = facts
        self.rows = _ends(points, where)
        first = self.rows[:, 0]
        self.measurement, self.repeat = points.measurement[first], points.repeat[first]
        self.noise_scale = np.full(len(first), np.sqrt(2.0))
        self.expansion = expansion(facts, points)[self.rows].mean(axis=1)
        self._known = (np.zeros((0, 3)), np.zeros((0, 3)))
        lengths = self.lengths()
        if np.any(lengths == 0):
            line = points.lines[first[np.argmin(lengths)]] if len(points.lines) else 0
            raise CmmUqError("both ends of the bar lie in one place", where=f"{where or 'recording'} line {line}",
                             fix="Record the centres of two different balls")  # fmt: skip
        mean = float(lengths.mean())
        if facts.length_mm is None:
            self.sizes = (Size("length_mm", say("Length of the bar"), unit("mm"), mean, np.inf, say("length")),)
        else:
            check_length(mean, facts.length_mm, "the recorded bars", where)
            self.sizes = (
                Size(
                    "length_mm",
                    say("Length of the bar"),
                    unit("mm"),
                    facts.length_mm,
                    stated_sd(facts, facts.length_mm),
                    say("length"),
                ),
            )

    @property
    def set_up(self) -> Text:
        """See :attr:`Artefact.set_up`."""
        return say("Position of the bar")

    def own_faults(self) -> Iterable[Effect]:
        """See :meth:`Artefact.own_faults`: a bar has one length; that of each set-up by itself is the set-up's offset."""
        return (temperature_of(self._facts, self.points),)

    def lengths(self) -> Floats:
        """Indicated lengths brought to 20 °C with the bar's stated expansion, (m,) mm."""
        bars = self._bars(self.points.xyz)
        return np.asarray(np.linalg.norm(bars, axis=1) / self.expansion, dtype=np.float64)

    def indications(self) -> Indications | None:
        """See :meth:`Artefact.indications`."""
        size = self.sizes[0]
        if not size.certified:
            return None
        every = np.full(len(self.rows), 1.0)
        return Indications(self.lengths() - size.nominal, size.nominal * every, size.sd * every, self.rows)

    def ends(self) -> Floats:
        """Both ends of each bar, (m, 2, 3) mm, in the recorded frame."""
        return np.asarray(self.points.xyz[self.rows], dtype=np.float64)

    def bidirectional(self, rows: Ints) -> NDArray[np.bool_]:
        """See :meth:`Artefact.bidirectional`: distances of centres never are."""
        return np.zeros(len(rows), dtype=bool)

    def fit(self, true_xyz: Floats, sizes: Floats) -> Floats:
        """See :meth:`Artefact.fit`: same middle, same direction, the bar's length."""
        bars = self._bars(true_xyz)
        half = 0.5 * bars / np.linalg.norm(bars, axis=1, keepdims=True) * (sizes[0] * self.expansion)[:, None]
        middle = true_xyz[self.rows].mean(axis=1)
        placed = true_xyz.copy()
        placed[self.rows[:, 0]], placed[self.rows[:, 1]] = middle - half, middle + half
        return placed

    def project(self, xyz: Floats, displacement: Floats) -> Floats:
        """See :meth:`Artefact.project`: relative displacement of the ends along the bar."""
        relative = displacement[self.rows[:, 1]] - displacement[self.rows[:, 0]]
        return np.asarray(np.einsum("mi,mik->mk", self._directions(xyz), relative), dtype=np.float64)

    def _directions(self, xyz: Floats) -> Floats:
        """From one end to the other, (m, 3), kept for points that nobody can change: a diagnosis asks thousands of times."""
        if self._known[0] is not xyz:
            bars = self._bars(xyz)
            bars /= np.linalg.norm(bars, axis=1, keepdims=True)
            if xyz.flags.writeable:
                return bars
            self._known = xyz, bars
        return self._known[1]

    def size_change(self) -> Floats:
        """See :meth:`Artefact.size_change`."""
        return np.asarray(self.expansion[:, None], dtype=np.float64)

    def _bars(self, xyz: Floats) -> Floats:
        return np.asarray(xyz[self.rows[:, 1]] - xyz[self.rows[:, 0]], dtype=np.float64)


def _ends(points: Points, where: str | None) -> np.ndarray[tuple[int, int], np.dtype[np.int64]]:
    """Rows of points 1 and 2 of every bar, (m, 2)."""
    ends = []
    for rows in points.rows_of_groups:
        numbers = points.point[rows]
        if sorted(numbers.tolist()) != [1, 2]:
            measurement, repeat = points.measurement[rows[0]], points.repeat[rows[0]]
            line = points.lines[rows[0]] if len(points.lines) else 0
            missing = sorted({1, 2} - set(numbers.tolist()))
            problem = (
                f"measurement {measurement}, repeat {repeat} has no point {missing[0]}: a bar with one end"
                if missing
                else f"measurement {measurement}, repeat {repeat} has points {sorted(numbers.tolist())}, a bar has 1 and 2"
            )
            raise CmmUqError(problem, where=f"{where or 'recording'} line {line}",
                             fix="Record both balls, as points 1 and 2, or leave out the measurement")  # fmt: skip
        ends.append(rows[np.argsort(numbers)])
    return np.array(ends, dtype=np.int64)
