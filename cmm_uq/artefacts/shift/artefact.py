"""A shifted artefact as points of an artefact: for what simulates its readings, and for what searches them for effects.

    reading + e(reading) = shift_s + R_s · X_p + noise,    R_s a turn of the plate, or the cosine of the gauge's angle

Its dimensions X are free but for a known length, and its placings where the job does not know them exactly: only what those
cannot take up is an observation.
"""

from __future__ import annotations

import numpy as np

from cmm_uq.artefacts.kinds import ShiftFacts
from cmm_uq.artefacts.shift.axis import known_points, recorded_series
from cmm_uq.artefacts.shift.placed_plate import placed_plate, rotations
from cmm_uq.base.messages import Text, say
from cmm_uq.base.points import AXES, Floats, Points
from cmm_uq.base.units import MICROMETRE, unit
from cmm_uq.machine.model.artefact import Artefact, Size

_ROUNDS = 8


class ShiftedArtefact(Artefact):
    """One observation of each reading of a gauge along its axis, two of each of a plate in its plane."""

    kind = "shift"
    title = say("Uncalibrated artefact, shifted")
    curves = True

    def __init__(self, facts: ShiftFacts, points: Points, *, where: str | None = None) -> None:
        self.points, file = points, where or "recording"
        numbers, self._point = np.unique(points.point, return_inverse=True)
        placings, self._placing = np.unique(points.measurement, return_inverse=True)
        self._turns = facts.plane is not None
        self._axes: tuple[int, ...]
        self._start: tuple[Floats, Floats, Floats]
        if facts.plane is not None:
            plate = placed_plate(points, facts.plane, file)
            self._axes, free = plate.axes, True
            self._start = plate.balls, plate.moved, plate.turned
        else:
            series = recorded_series(facts, points, file)
            self._axes, free = (AXES.index(series.axis),), series.u_shift > 0
            self._start = np.zeros((len(numbers), 1)), series.shifts[:, None], series.cosine
        n, d = len(points), len(self._axes)
        self._free = np.arange(1, len(placings)) if free else np.zeros(0, dtype=np.int64)
        self.rows = np.repeat(np.arange(n), d)[:, None]
        self.measurement, self.repeat = points.measurement[self.rows[:, 0]], points.repeat[self.rows[:, 0]]
        self.noise_scale = np.repeat(points.columns.get("noise_ratio", np.ones(n)), d)
        self._known, self.sizes = None, ()
        self._start = self._laid(points.carriages, None)
        if facts.known is not None:
            self._known = known_points(facts.known, numbers)
            title = say("Known length")
            sd = facts.known.u_um * MICROMETRE
            self.sizes = (Size("known_mm", title, unit("mm"), facts.known.length_mm, sd, say("length")),)

    @property
    def set_up(self) -> Text:
        return say("Placing of the artefact")

    def fit(self, true_xyz: Floats, sizes: Floats) -> Floats:
        placed = true_xyz.copy()
        readings = true_xyz + self.points.machine.origin_mm
        laid = self._predicted(*self._laid(readings, float(sizes[0]) if len(sizes) else None))
        placed[:, self._axes] += laid - readings[:, self._axes]
        return placed

    def project(self, xyz: Floats, displacement: Floats) -> Floats:
        return np.asarray(displacement[:, self._axes].reshape(len(self.rows), -1))

    def size_change(self) -> Floats:
        tied = self._columns(*self._start)
        return tied @ np.linalg.pinv(self._tie(self._start[0], tied.shape[1]))[:, : len(self.sizes)]

    def placing(self, xyz: Floats) -> Floats:
        columns = self._columns(*self._start)
        return np.asarray(columns @ self._untied(self._tie(self._start[0], columns.shape[1])))

    def _laid(self, readings: Floats, known: float | None) -> tuple[Floats, Floats, Floats]:
        """Dimensions (p, d), places (s, d) and turns, or cosines, (s,) nearest to readings (n, 3), with the known length."""
        body, moved, turned = self._start
        read, p, d = readings[:, self._axes], *body.shape
        for _ in range(_ROUNDS if self._turns else 1):
            columns = self._columns(body, moved, turned)
            tie = self._tie(body, columns.shape[1])
            step: Floats = np.zeros(columns.shape[1])
            if known is not None and self._known is not None:
                one, other = self._known
                length = float(np.linalg.norm(body[other] - body[one]))
                step += np.linalg.pinv(tie)[:, 0] * (known - length)
            missing = (read - self._predicted(body, moved, turned)).ravel() - columns @ step
            untied = self._untied(tie)
            step += np.asarray(untied @ np.linalg.lstsq(columns @ untied, missing, rcond=None)[0], dtype=np.float64)
            body = body + step[: p * d].reshape(p, d)
            change = step[p * d :].reshape(len(self._free), -1)
            moved, turned = moved.copy(), turned.copy()
            moved[self._free] += change[:, :d]
            if self._turns:
                turned[self._free] += change[:, d]
        return body, moved, turned

    def _predicted(self, body: Floats, moved: Floats, turned: Floats) -> Floats:
        turn = rotations(turned) if self._turns else turned[:, None, None]
        return np.asarray(moved[self._placing] + np.einsum("nij,nj->ni", turn[self._placing], body[self._point]))

    def _columns(self, body: Floats, moved: Floats, turned: Floats) -> Floats:
        """(n·d, q) change of the readings for the dimensions, then for place and turn of each placing that is free."""
        (p, d), n = body.shape, len(self.points)
        turn = (rotations(turned) if self._turns else turned[:, None, None])[self._placing]
        each = d + self._turns
        found, rows = np.zeros((n, d, p * d + each * len(self._free))), np.arange(n)
        for k in range(d):
            found[rows, :, d * self._point + k] = turn[:, :, k]
        about = np.einsum("nij,nj->ni", turn, body[self._point])
        for i, s in enumerate(self._free.tolist()):
            own, first = self._placing == s, p * d + each * i
            found[own, :, first : first + d] = np.eye(d)
            if self._turns:
                found[own, :, first + d] = about[own][:, ::-1] * [-1.0, 1.0]
        return found.reshape(n * d, -1)

    def _tie(self, body: Floats, count: int) -> Floats:
        """(1, q) change of the known length; (0, q) without one."""
        if self._known is None:
            return np.zeros((0, count))
        one, other = self._known
        d, step = body.shape[1], body[other] - body[one]
        row = np.zeros((1, count))
        row[0, d * other : d * other + d] = step / np.linalg.norm(step)
        row[0, d * one : d * one + d] = -step / np.linalg.norm(step)
        return row

    @staticmethod
    def _untied(tie: Floats) -> Floats:
        """(q, r) changes that leave the known length as it is."""
        if not len(tie):
            return np.eye(tie.shape[1])
        return np.asarray(np.linalg.svd(tie)[2][1:].T)
