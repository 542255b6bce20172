"""Circular tests by ISO 230-4: from radial deviations along a circle, in either sense of it, to G, H, G(b), F and D.

The actual path of one sense is what was read going round once. G is the least radial separation of two concentric circles
about it (the minimum zone), G(b) of those about the paths of both senses; H the largest radial difference of both paths at
one angle; F the radial deviation from the nominal circle about the path's least-squares centre, its largest and its least
value; D the mean radius of both paths less the nominal. G, H and F are of the edition of 1996, G(b) and D of that of 2005. Of
several rounds the largest value is the figure. Deviations are small beside the radius, so that a shift of the centre by
(a, b) takes a·cos φ + b·sin φ from them.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from cmm_uq.base.points import Floats
from cmm_uq.maths.geometry.positioning import DOWN, UP, PositioningRuns

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
