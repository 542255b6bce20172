"""Readings of one uncalibrated plate in several placings in a plane of the machine, checked, repeats averaged.

Neither the plate nor its placings need be known: rigid motions that lay all placings over each other are found first.
"""

from __future__ import annotations

from itertools import combinations

import numpy as np

from cmm_uq.artefacts.shift.series import Means, means_over_repeats
from cmm_uq.artefacts.shift.smooth import Scatter
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.points import AXES, Floats, Ints, Points
from cmm_uq.base.values import dataclass

_ALIKE_MM, _ALIKE_RAD = 1.0, np.radians(1.0)  # placings nearer to each other than this are the same
_STEP = 1e-5  # rad
_MISPLACED = 1.0  # A ball farther than this from where the other placings have it is numbered wrongly or mistaken, mm
_LINE = 0.02  # balls whose width is below this part of their length lie on a line
_TILT = 0.05
_ROUNDS = 50


@dataclass(frozen=True, eq=False)
class PlacedPlate:
    """Means over repeats, one row a ball in a placing."""

    plane: str  # xy, yz or zx
    reading: Floats  # (n, 3) scale readings, mm
    placing: Ints  # placing, ball: (n,) index of the placing and of the ball
    ball: Ints
    noise_scale: Floats  # (n,) standard uncertainty of each mean over that of one ordinary reading
    placings: Ints  # placings, numbers: (s,) and (p,) numbers as recorded
    numbers: Ints
    balls: Floats  # (p, 2) roughly, mm, as they lie in the first placing
    turned: Floats  # (s,) how far each placing is turned against the first, roughly, rad
    moved: Floats  # (s, 2) where the first placing's origin lies in each, roughly, mm
    scatter: Scatter | None  # of repeats, both coordinates; ``None`` without repeats

    @property
    def axes(self) -> tuple[int, int]:
        return AXES.index(self.plane[0]), AXES.index(self.plane[1])

    @property
    def flat(self) -> Floats:
        """(n, 2) readings in the plane, mm."""
        return np.asarray(self.reading[:, self.axes])

    @property
    def counts(self) -> Ints:
        """(s,) balls read in each placing."""
        return np.bincount(self.placing, minlength=len(self.placings)).astype(np.int64)

    @property
    def middle(self) -> Floats:
        """(3,) middle of what was read, mm."""
        return np.asarray((self.reading.min(axis=0) + self.reading.max(axis=0)) / 2)

    @property
    def turned_deg(self) -> Floats:
        """(s,) turn of each placing against the first, −180° … 180°."""
        return np.asarray(np.degrees(np.angle(np.exp(1j * self.turned))))

    @property
    def middles(self) -> Floats:
        """(s, 2) mean reading of each placing, mm."""
        return np.array([self.flat[self.placing == s].mean(axis=0) for s in range(len(self.placings))])

    def span(self, axis: int) -> tuple[float, float]:
        """Lowest and highest reading of an axis, mm."""
        return float(self.reading[:, axis].min()), float(self.reading[:, axis].max())


def rotations(angle: Floats) -> Floats:
    """(s,) rad → (s, 2, 2) rotations in the plane, from its first axis to its second."""
    c, s = np.cos(angle), np.sin(angle)
    return np.moveaxis(np.array([[c, -s], [s, c]]), -1, 0)


def placed_plate(points: Points, plane: str, where: str = "") -> PlacedPlate:
    """Placings from a recording: ``measurement`` numbers them, ``point`` the plate's balls."""
    means = means_over_repeats(points, where)
    placings, placing = np.unique(means.measurement, return_inverse=True)
    numbers, ball = np.unique(means.point, return_inverse=True)
    axes = [AXES.index(a) for a in plane]
    flat = means.readings[:, axes]
    _check_counts(placing, ball, placings, numbers, where)
    _check_plane(means.readings, placing, placings, axes, plane, where)
    balls, turned, moved = _laid_over(flat, placing, ball, placings, where)
    _check_balls(flat, placing, ball, (balls, turned, moved), means, where)
    _check_placings(flat, placing, placings, turned, where)
    left = ((points.carriages - means.readings[means.of])[:, axes] / means.ratio[:, None]).ravel()
    dof = 2 * (len(points) - len(means.point))
    return PlacedPlate(
        plane, means.readings, placing.astype(np.int64), ball.astype(np.int64), means.noise_scale, placings, numbers, balls,
        turned, moved, Scatter(float(left @ left), dof) if dof else None,
    )  # fmt: skip


def rigid_motion(points: Floats, onto: Floats) -> tuple[float, Floats]:
    """Angle and shift (2,) that lay points (m, 2) over others best (least squares)."""
    p, q = points - points.mean(axis=0), onto - onto.mean(axis=0)
    angle = float(np.arctan2(np.sum(p[:, 0] * q[:, 1] - p[:, 1] * q[:, 0]), np.sum(p * q)))
    return angle, onto.mean(axis=0) - rotations(np.array([angle]))[0] @ points.mean(axis=0)


def _laid_over(flat: Floats, placing: Ints, ball: Ints, placings: Ints, where: str) -> tuple[Floats, Floats, Floats]:
    """Balls, turns and shifts: placings join the first one by one through the balls they share, then all are refined."""
    count = len(placings)
    balls = np.full((ball.max() + 1, 2), np.nan)
    balls[ball[placing == 0]] = flat[placing == 0]
    turned, moved = np.zeros(count), np.zeros((count, 2))
    waiting = list(range(1, count))
    while waiting:
        shared = [int(np.isfinite(balls[ball[placing == s], 0]).sum()) for s in waiting]
        if max(shared) < 2:
            problem = f"placing {placings[waiting[0]]} shares fewer than two balls with the placings before it"
            raise CmmUqError(problem, where=where or None, fix="Read at least two balls, best all, in every placing")
        s = waiting.pop(int(np.argmax(shared)))
        rows = np.flatnonzero(placing == s)
        known = rows[np.isfinite(balls[ball[rows], 0])]
        turned[s], moved[s] = rigid_motion(balls[ball[known]], flat[known])
        back = (flat[rows] - moved[s]) @ rotations(turned[s : s + 1])[0]
        new = ~np.isfinite(balls[ball[rows], 0])
        balls[ball[rows[new]]] = back[new]
    for _ in range(_ROUNDS):
        back = np.einsum("ni,nij->nj", flat - moved[placing], rotations(turned)[placing])
        weight = np.bincount(ball)
        balls = np.column_stack([np.bincount(ball, back[:, k]) / weight for k in range(2)])
        for s in range(1, count):
            rows = placing == s
            turned[s], moved[s] = rigid_motion(balls[ball[rows]], flat[rows])
    return balls, turned, moved


def _check_counts(placing: Ints, ball: Ints, placings: Ints, numbers: Ints, where: str) -> None:
    if len(placings) < 2:
        fix = "Shift it along both axes by about the pitch of its balls, turn it by 90°, and read it each time"
        raise CmmUqError("the plate was read in one placing only", where=where or None, fix=fix)
    few = np.flatnonzero(np.bincount(placing) < 3)
    if few.size:
        raise CmmUqError(f"placing {placings[few[0]]} has fewer than three balls", where=where or None,
                         fix="Read more balls in this placing, or leave it out")  # fmt: skip
    alone = np.flatnonzero(np.bincount(ball) < 2)
    if alone.size:
        there = placings[placing[ball == alone[0]][0]]
        fix = f"Read ball {numbers[alone[0]]} in another placing as well, or leave it out of placing {there}"
        raise CmmUqError(f"ball {numbers[alone[0]]} is read in placing {there} only", where=where or None, fix=fix)


def _check_plane(readings: Floats, placing: Ints, placings: Ints, axes: list[int], plane: str, where: str) -> None:
    across = 3 - sum(axes)
    for s, number in enumerate(placings):
        rows = readings[placing == s]
        if np.ptp(rows[:, across]) > _TILT * np.ptp(rows[:, axes], axis=0).max():
            raise CmmUqError(f"placing {number} does not lie in the plane {plane}: {AXES[across]} varies by "
                             f"{np.ptp(rows[:, across]):.3g} mm", where=where or None,
                             fix="Name the plane in which the plate lies, or level it")  # fmt: skip
        length, width = np.linalg.svd(rows[:, axes] - rows[:, axes].mean(axis=0), compute_uv=False)
        if width < _LINE * length:
            raise CmmUqError(f"the balls of placing {number} lie on one line", where=where or None,
                             fix='A line calibrates one axis: axis = "x" and shifts_mm instead of plane')  # fmt: skip


def _away(flat: Floats, placing: Ints, ball: Ints, found: tuple[Floats, Floats, Floats]) -> Floats:
    balls, turned, moved = found
    return np.asarray(flat - moved[placing] - np.einsum("nij,nj->ni", rotations(turned)[placing], balls[ball]))


def _away_on_leaning_axes(flat: Floats, placing: Ints, ball: Ints) -> float:
    """How far a ball lies away at most, mm, where the axes lean as suits all (Gauss–Newton in their angle)."""

    def away(lean: float) -> Floats:
        upright = flat @ np.array([[1.0, 0.0], [-np.sin(lean), np.cos(lean)]])
        return _away(upright, placing, ball, _laid_over(upright, placing, ball, np.unique(placing), "")).ravel()

    lean = 0.0
    for _ in range(_ROUNDS // 5):
        left = away(lean)
        change = (away(lean + _STEP) - left) / _STEP
        lean -= float(change @ left / (change @ change))
    return float(np.linalg.norm(away(lean).reshape(-1, 2), axis=1).max())


def _check_balls(
    flat: Floats, placing: Ints, ball: Ints, found: tuple[Floats, Floats, Floats], means: Means, where: str
) -> None:
    away = np.linalg.norm(_away(flat, placing, ball, found), axis=1)
    if away.max() > _MISPLACED and _away_on_leaning_axes(flat, placing, ball) > _MISPLACED:
        row = int(np.argmax(away))
        line = means.line[row]
        raise CmmUqError(
            f"ball {means.point[row]} of placing {means.measurement[row]} lies {away[row]:.3g} mm from where the other "
            "placings have it",
            where=f"{where} line {line}" if line else where or None,
            fix="Number the balls alike in every placing, do not turn the plate upside down, or read this placing again",
        )


def _check_placings(flat: Floats, placing: Ints, placings: Ints, turned: Floats, where: str) -> None:
    each = [flat[placing == s] for s in range(len(placings))]
    for a, b in combinations(range(len(placings)), 2):
        turn = np.angle(np.exp(1j * (turned[b] - turned[a])))
        if np.linalg.norm(each[b].mean(axis=0) - each[a].mean(axis=0)) < _ALIKE_MM and abs(turn) < _ALIKE_RAD:
            raise CmmUqError(
                f"placings {placings[a]} and {placings[b]} stand in the same place: they show nothing of the machine",
                where=where or None,
                fix=f"Shift placing {placings[b]} by about the pitch of the balls, or turn it by 90°; the same place read "
                "again is a repeat",
            )
    low, high = (np.array([end(balls, axis=0) for balls in each]) for end in (np.min, np.max))
    for s, number in enumerate(placings):
        others = np.arange(len(placings)) != s
        if not np.any(np.all((low[others] < high[s]) & (high[others] > low[s]), axis=1)):
            problem = f"placing {number} covers no area that another placing covers: nothing is read twice"
            fix = "Shift the plate by less than its size, best by the pitch of its balls"
            raise CmmUqError(problem, where=where or None, fix=fix)
