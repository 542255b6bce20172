"""Positioning of an axis by ISO 230-2:2014: from readings at targets, in both directions, to A, E, R, B and M.

With x_ij the deviation (actual less target) of repeat j at target i, of n repeats: mean x̄_i of each direction, estimator s_i
of its standard uncertainty (n − 1), B_i = x̄_i↑ − x̄_i↓, and

    R_i↑ = 4·s_i↑,  R_i = max(2s_i↑ + 2s_i↓ + |B_i|, R_i↑, R_i↓),  R = max R_i,  B = max |B_i|,
    E = max x̄_i − min x̄_i over both directions,  M the same of (x̄_i↑ + x̄_i↓)/2,
    A = max(x̄_i + 2s_i) − min(x̄_i − 2s_i) over both directions.

Of readings taken in motion x_ij is interpolated linearly between the two nearest to the target, of the same direction and
repeat. How far the cubic through two on either side is off that says what the interpolation leaves out.

Circular tests by ISO 230-4: from radial deviations along a circle, in either sense of it, to G, H, G(b), F and D.

The actual path of one sense is what was read going round once. G is the least radial separation of two concentric circles
about it (the minimum zone), G(b) of those about the paths of both senses; H the largest radial difference of both paths at
one angle; F the radial deviation from the nominal circle about the path's least-squares centre, its largest and its least
value; D the mean radius of both paths less the nominal. G, H and F are of the edition of 1996, G(b) and D of that of 2005. Of
several rounds the largest value is the figure. Deviations are small beside the radius, so that a shift of the centre by
(a, b) takes a·cos φ + b·sin φ from them.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from cmm_uq.base.points import Floats, Ints
from cmm_uq.base.values import dataclass, replace

UP, DOWN = 0, 1
_SAME_MM = 1e-2  # targets nearer than this are one
_ON_IT = 1e-6  # mm from a target, within which a reading is at it
_ROUNDING = 1e-12  # of figures, by which the order of sums moves them
# of the least distance of targets, that readings in motion may be apart: of the shortest wave that targets resolve, twice
# that distance, a straight line then leaves out (π/20)²/2 of its amplitude at most, 1.2 %
LARGEST_GAP = 0.1


@dataclass(frozen=True, eq=False)
class InMotion:
    """What is uncertain of deviations for being interpolated between readings taken in motion."""

    curvature: Floats  # (d, t, n) deviation interpolated linearly, less that by the cubic
    share: Floats  # (d, t, n) of the noise of one reading in each
    widest_gap: float  # mm between two readings about a target
    u_delay: (
        float | None
    )  # of what a delay between scales and instrument makes, in each direction the other way; if known


@dataclass(frozen=True, eq=False)
class PositioningRuns:
    targets: Floats  # (t,) ascending
    x: Floats  # (d, t, n) deviations by direction, target and repeat; d = 1 where all came from one side
    arrows: str = "↑↓"  # of the directions; "↓" where all came from above
    # that is positioned, a, b or c by angles in ″ at targets in °; empty along a diagonal, or where something else is read
    axis: str = ""
    # standard uncertainty of what the instrument reads against, µm or ″, where it is largest; what part of it acts at each
    # target (t,); over what length temperature and alignment act, mm, 0 where they do not
    u_reference: float = 0.0
    growth: Floats | None = None
    length_mm: float = 0.0
    by_target: bool = False  # whether that is another at each target, as of the faces of a polygon
    travel: tuple[float, ...] = ()  # unit vector
    motion: InMotion | None = None  # where readings were taken in motion

    @classmethod
    def interpolated(
        cls, targets: Floats, positions: Floats, directions: Floats, repeats: Ints, readings: Floats, *,
        straight: bool = False, u_delay: float | None = None,
    ) -> PositioningRuns:  # fmt: skip
        """At targets (t,), ascending, of readings (k,) taken in motion anywhere.

        Raises ``MissingReadingError`` where a target lies outside the readings of a run, or between two too far apart.
        """
        most, rows = LARGEST_GAP * float(np.diff(targets).min()), []
        for way, number in np.unique(np.column_stack([directions, repeats]), axis=0):
            group = (directions == way) & (repeats == number)
            at, index = np.unique(np.round(positions[group] / _ON_IT) * _ON_IT, return_inverse=True)
            read = np.bincount(index.ravel(), readings[group]) / np.bincount(index.ravel())
            for target in targets:
                found = _between(at, read, float(target))
                if not found[-1] <= most:
                    raise MissingReadingError(way, target, int(number), 0, found[-1], most)
                rows.append((target, way, number, *found))
        at, way, number, value, *beside, gap = np.array(rows).T
        own = at, way, number.astype(np.int64)
        curvature, share = (cls.of(*own, each).x for each in beside)
        motion = InMotion(curvature, share, float(gap.max()), u_delay)
        return replace(cls.of(*own, value, straight=straight), motion=motion)

    @classmethod
    def of(
        cls, positions: Floats, directions: Floats, repeats: Ints, readings: Floats, *, straight: bool = False
    ) -> PositioningRuns:
        """Of readings (k,) in any order; ``straight``: less a common straight line.

        Raises ``MissingReadingError`` where one is missing, or is there twice.
        """
        order = np.sort(positions)
        edges = order[np.concatenate([[True], np.diff(order) > _SAME_MM])]
        target = np.searchsorted(edges, positions + _SAME_MM, side="right") - 1
        sides = np.unique(directions)[::-1]
        side, repeat = np.searchsorted(-sides, -directions), np.unique(repeats, return_inverse=True)[1].ravel()
        shape = (len(sides), len(edges), int(repeat.max()) + 1)
        x, count = np.full(shape, np.nan), np.zeros(shape, dtype=np.int64)
        np.add.at(count, (side, target, repeat), 1)
        if np.any(count != 1):
            d, t, n = (int(v[0]) for v in np.nonzero(count != 1))
            raise MissingReadingError(sides[d], edges[t], int(np.unique(repeats)[n]), int(count[d, t, n]))
        if straight:
            readings = readings - np.polyval(np.polyfit(positions, readings, 1), positions)
        x[side, target, repeat] = readings
        return cls(edges, x, "↑↓" if len(sides) == 2 else "↓" if sides[0] < 0 else "↑")

    @property
    def angular(self) -> bool:
        return self.axis in ("a", "b", "c")

    @property
    def both(self) -> bool:
        return len(self.x) == 2

    @property
    def repeats(self) -> int:
        return int(self.x.shape[2])

    @property
    def mean(self) -> Floats:
        """(d, t) x̄_i."""
        return np.asarray(self.x.mean(axis=2))

    @property
    def s(self) -> Floats:
        """(d, t) s_i; ``nan`` of a single repeat."""
        return np.asarray(self.x.std(axis=2, ddof=1)) if self.repeats > 1 else np.full(self.x.shape[:2], np.nan)

    @property
    def reversal(self) -> Floats:
        """(t,) B_i; empty where all came from one side."""
        return self.mean[UP] - self.mean[DOWN] if self.both else np.zeros(0)

    @property
    def drift(self) -> Floats:
        """(n,) mean of each repeat over all targets and directions, less the mean of all."""
        each = self.x.mean(axis=(0, 1))
        return np.asarray(each - each.mean())

    def figures(self) -> Mapping[str, float]:
        return {name: float(value) for name, value in zip(self.names(), self._figures(self.x[None])[0], strict=True)}

    def names(self) -> tuple[str, ...]:
        arrows = self.arrows[: len(self.x)]
        found = (
            [f"{name}{arrow}" for name in "ERA" for arrow in arrows] if self.repeats > 1 else [f"E{a}" for a in arrows]
        )
        if self.both:
            found += [*("BEM" if self.repeats == 1 else "BRMEA"), "mean B"]
        return tuple(found)

    def spread(self, common: Floats, each: Floats) -> Mapping[str, float]:
        """Standard uncertainty of each figure under changes (N, d, t, n) that all readings share, and of each reading.

        Scatter makes ranges larger, and has done so already: a range of nothing but scatter by as much as it grows once four
        times the variance is there, √3 of the scatter being added; others by less. u is the root mean square of this and of
        how the figure varies.
        """
        at = self._figures(self.x[None])
        more, varies = (self._figures(self.x + common + n * each) - at for n in (np.sqrt(3), 1.0))
        added = np.maximum(np.abs(more.mean(axis=0)), np.abs(at[0] - self._without(each)))
        u = np.hypot(added, varies.std(axis=0))
        u[u < _ROUNDING * max(np.abs(part).max() for part in (at, more, varies))] = (
            0.0  # a change that readings share leaves ranges of them as they are
        )
        return dict(zip(self.names(), u.tolist(), strict=True))

    def _without(self, each: Floats) -> Floats:
        """Figures without scatter as large as ``each``, where neighbours say what that is; else as they are."""
        return np.asarray(self._figures(self.x[None])[0])

    def _figures(self, x: Floats) -> Floats:
        return _figures(x)


class MissingReadingError(ValueError):
    """Of a direction, target and repeat that no reading, or more than one, belongs to.

    Of readings in motion: that lies between two that are ``gap`` mm apart and not ``most``, or outside of all (infinite).
    """

    def __init__(
        self, direction: float, target: float, repeat: int, count: int, gap: float = 0.0, most: float = 0.0
    ) -> None:
        what = f"has {count} readings"
        if gap:
            apart = f"between readings {gap:.3g} mm apart, more than {most:.3g} mm,"
            what = f"lies {apart if np.isfinite(gap) else 'outside the readings'}"
        super().__init__(f"target {target:g} mm {what} in direction {direction:+g} of repeat {repeat}")
        self.direction, self.target, self.repeat, self.count = direction, target, repeat, count
        self.gap, self.most = gap, most


def _between(at: Floats, read: Floats, target: float) -> tuple[float, float, float, float]:
    """Of readings at ascending positions: that at a target, less it by the cubic, noise in it, and how far two are apart."""
    after = int(np.searchsorted(at, target - _ON_IT))
    if after < len(at) and at[after] - target <= _ON_IT:
        return float(read[after]), 0.0, 1.0, 0.0
    if after in (0, len(at)):
        return 0.0, 0.0, 1.0, np.inf
    gap = at[after] - at[after - 1]
    part = float((target - at[after - 1]) / gap)
    linear = float((1 - part) * read[after - 1] + part * read[after])
    # the next ones on either side that are not nearer than these two are: no weight is then large
    further = np.searchsorted(at, at[after - 1] - gap, side="right") - 1, np.searchsorted(at, at[after] + gap)
    chosen = np.array([after - 1, after, *(i for i in further if 0 <= i < len(at))])
    others = ~np.eye(len(chosen), dtype=bool)
    off = np.where(others, at[chosen][:, None] - at[chosen], 1.0)
    weight = np.prod(np.where(others, target - at[chosen], 1.0) / off, axis=1)
    return linear, linear - float(weight @ read[chosen]), float(np.hypot(1 - part, part)), float(gap)


def _figures(x: Floats) -> Floats:
    """(N, figures) of deviations (N, d, t, n), in the order of :meth:`PositioningRuns.names`."""
    mean, many = x.mean(axis=3), x.shape[3] > 1
    s = x.std(axis=3, ddof=1) if many else np.zeros_like(mean)
    found = [np.ptp(mean, axis=2)]
    if many:
        found += [4 * s.max(axis=2), (mean + 2 * s).max(axis=2) - (mean - 2 * s).min(axis=2)]
    if x.shape[1] == 2:
        b = mean[:, UP] - mean[:, DOWN]
        R = np.maximum(2 * s.sum(axis=1) + np.abs(b), 4 * s.max(axis=1)).max(axis=1)
        M = np.ptp(mean.mean(axis=1), axis=1)
        E = mean.max(axis=(1, 2)) - mean.min(axis=(1, 2))
        A = (mean + 2 * s).max(axis=(1, 2)) - (mean - 2 * s).min(axis=(1, 2))
        B = np.abs(b).max(axis=1)
        both = [B, R, M, E, A] if many else [B, E, M]
        found += [each[:, None] for each in (*both, b.mean(axis=1))]
    return np.hstack(found)


_FULL = 45.0  # degrees without a target, beyond which a circle is an arc


@dataclass(frozen=True, eq=False)
class CircularTest(PositioningRuns):
    """``targets`` are angles, degrees; ``x`` (d, t, n) radial deviations, µm; counter-clockwise first."""

    calibrated: bool = False  # whether the radius is known

    @property
    def widest_gap(self) -> float:
        """Degrees between neighbouring targets, from the last to the first too."""
        return float(np.max(np.diff(self.targets, append=self.targets[0] + 360)))

    @property
    def full(self) -> bool:
        return self.widest_gap <= _FULL

    def names(self) -> tuple[str, ...]:
        found = [f"G{arrow}" for arrow in self.arrows]
        found += ["H", "G(b)"] if self.both else []
        if self.calibrated and self.full:
            found += ["Fmax", "Fmin", *(["D"] if self.both else [])]
        return tuple(found)

    def figures(self) -> Mapping[str, float]:
        found = dict(super().figures())
        rounds = np.moveaxis(self.x, 2, 0)  # (n, d, t)
        for side, arrow in enumerate(self.arrows):
            found[f"G{arrow}"] = max(self._least_zone(each[side : side + 1]) for each in rounds)
        if self.both:
            found["G(b)"] = max(map(self._least_zone, rounds))
        return found

    def _without(self, each: Floats) -> Floats:
        """Of what a reading is off the median of itself and two neighbours on either side, as much is left as is no scatter.

        A reading far off that makes a figure large hides by that how large scatter has made it, and the largest is one such.
        """
        if not self.full:
            return super()._without(each)
        t = self.x.shape[1]
        near = np.median(np.take(self.x, np.arange(t)[:, None] + np.arange(-2, 3), axis=1, mode="wrap"), axis=2)
        off = self.x - near
        squares = np.maximum(np.mean(off**2, axis=1, keepdims=True), 1e-300)
        kept = np.sqrt(np.maximum(0.0, 1 - np.mean(each**2) / squares))
        return np.asarray(self._figures((near + kept * off)[None])[0])

    def _circle(self) -> Floats:
        angle = np.radians(self.targets)
        return np.column_stack([np.cos(angle), np.sin(angle)])

    def _least_zone(self, paths: Floats) -> float:
        """Of paths (d, t) about one centre: range of x − a·cos φ − b·sin φ, least over a and b, by linear programming."""
        from scipy import optimize  # takes longer to import than most commands run

        circle = np.tile(self._circle(), (len(paths), 1))
        ones, flat = np.ones((len(circle), 1)), paths.ravel()
        outside, inside = np.hstack([-circle, -ones, 0 * ones]), np.hstack([circle, 0 * ones, ones])
        least = optimize.linprog(
            [0.0, 0.0, 1.0, -1.0],
            A_ub=np.vstack([outside, inside]),
            b_ub=np.concatenate([-flat, flat]),
            bounds=(None, None),
        )
        return float(np.asarray(least.x) @ [0.0, 0.0, 1.0, -1.0])

    def _figures(self, x: Floats) -> Floats:
        """(N, figures) of deviations (N, d, t, n), zones about the least-squares centre, in the order of the names."""
        circle = np.column_stack([self._circle(), np.ones(len(self.targets))])

        def apart(paths: Floats) -> Floats:
            """Less the least-squares circle of paths (N, n, q), at q targets."""
            own = np.tile(circle, (paths.shape[2] // len(circle), 1))
            return np.asarray(paths - paths @ np.linalg.pinv(own).T @ own.T)

        paths = np.moveaxis(x, 3, 1)  # (N, n, d, t)
        found = [np.ptp(apart(paths[:, :, side]), axis=2).max(axis=1) for side in range(x.shape[1])]
        if self.both:
            found.append(np.abs(paths[:, :, UP] - paths[:, :, DOWN]).max(axis=(1, 2)))
            found.append(np.ptp(apart(paths.reshape(*paths.shape[:2], -1)), axis=2).max(axis=1))
        if self.calibrated and self.full:
            centre = circle[:, :2] @ np.linalg.pinv(circle)[:2]
            off = paths - paths @ centre.T
            found += [off.max(axis=(1, 2, 3)), off.min(axis=(1, 2, 3))]
            found += [off.mean(axis=(2, 3)).mean(axis=1)] if self.both else []
        return np.column_stack(found)
