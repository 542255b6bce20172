"""A feature measured again and again at the same nominal points: what each measurement gives, all of them together.

A virtual measurement draws errors of the points, a million times. All draws share nominal points, so they share the
inverse of the normal equations; each step takes exact distances and derivatives at where a draw has come to, so that the
steps end at the least-squares feature itself and not at its linearisation. Errors of a thousandth of the feature settle
in three or four steps. Blocks that fit the processor's cache keep the memory at that of the answer.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np
from numpy.typing import ArrayLike

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.points import Floats
from cmm_uq.base.values import dataclass
from cmm_uq.maths.geometry.association import circumscribed, inscribed as largest_inside, least_zone
from cmm_uq.maths.geometry.minimax import SCREENED, held, least_zones
from cmm_uq.maths.geometry.placed import LINE, SIZED, STRAIGHT, FeatureKind, Placed, placed

SETTLED = 1e-9  # steps, mm, below which a draw is at its minimum; what is left is far smaller
# the first steps are with the normal equations of the nominal points. They settle slowly, or not at all, where points are off
# by a large part of the feature: a bore's along its axis by a third of the probed length
SHARED_STEPS, MOST_STEPS = 20, 60
BLOCK = 12_000  # points worked on together: a dozen arrays of them stay in the cache of a core
TOGETHER = 9_000_000  # coordinates of unit displacements held at once, 72 MB: all of a feature of a thousand points
MANY = 500  # points from which on each is not moved alone, which takes the square of their number
CONDITION = 1e7  # of nominal points from which they do not determine the feature with errors of micrometres


def one_by_one(n: int, d: int) -> Iterator[Floats]:
    """Unit displacements (b, n, d) of one coordinate of one point at a time, all n·d of them in blocks of bounded memory."""
    count = n * d
    size = max(1, TOGETHER // count)
    for start in range(0, count, size):
        rows = np.arange(start, min(start + size, count))
        steps = np.zeros((len(rows), count))
        steps[np.arange(len(rows)), rows] = 1.0
        yield steps.reshape(len(rows), n, d)


@dataclass(frozen=True, eq=False)
class Drawn:
    """A feature of N measurements.

    ``position``: (N, d) centre, or point of axis, line or plane over the centroid of the nominal points, mm. ``direction``:
    (N, d) unit direction of the axis, of a plane its normal; None where there is none. ``size``: (N,) diameter, mm, of a cone
    at its position; None where there is none. ``half_angle``: (N,) of a cone, rad; else None. ``form``: (N,) form deviation,
    mm: range of the distances, of a line in space the diameter of the cylinder that holds all.
    """

    position: Floats
    direction: Floats | None
    size: Floats | None
    half_angle: Floats | None
    form: Floats


@dataclass(frozen=True, eq=False)
class Raised:
    heights: Floats  # (N, n) mm
    directions: Floats  # (n, d) of the points
    offset: Floats  # (n, d) errors that all draws have besides, mm

    def __len__(self) -> int:
        return len(self.heights)

    def __getitem__(self, rows: slice) -> Raised:
        return Raised(self.heights[rows], self.directions, self.offset)


class Repeated:
    """A feature and its nominal points, to be measured many times.

    ``kind``: ``"line"``, ``"plane"``, ``"circle"``, ``"sphere"``, ``"cylinder"`` or ``"cone"``. ``points``: (n, 3)
    nominal points on it, mm; (n, 2) of a line or circle in a plane. A circle of points in space is the circle of their
    projections along the normal. Errors of the points, ``displacements``, are (N, n, d) mm, small against the feature.

    Refused are points that do not determine the feature, and displacements so large that a draw does not settle.
    """

    def __init__(self, kind: FeatureKind, points: ArrayLike) -> None:
        self.points = np.asarray(points, dtype=np.float64)
        self.placed: Placed = placed(kind, self.points)
        self._flattened: tuple[Floats, ...] | None = None  # directions, offset, and what :meth:`_flat` makes of them
        if self.placed.condition > CONDITION:
            problem = f"{kind}: the nominal points hardly determine it (condition {self.placed.condition:.1e})"
            raise CmmUqError(problem, fix=f"Cover more of the {kind}")
        self.nominal = self.placed.local(self.points)
        self._units = units = self.placed.units()
        matrix = self.placed.shape.normal_matrix(self.placed.state, self.nominal) / np.outer(units, units)
        self._inverse = np.linalg.inv(matrix) / np.outer(units, units)
        # (n·d, k) by which the state follows each coordinate, by a step of a millionth of the extent: where to begin
        small = 1e-6 * self.placed.extent
        if len(self.points) > MANY:
            self._response = -self._pulls(self.placed.state, self.points, small) @ self._inverse / small
        else:
            steps = np.concatenate(list(one_by_one(*self.points.shape)))
            local = self._local(small * steps, 0)
            self._response = -self._step(np.tile(self.placed.state, (len(steps), 1)), local)[0] / small

    def least_squares(self, displacements: ArrayLike | Raised) -> Drawn:
        """The least-squares feature of each draw, to 1e-9 mm."""
        errors = self._checked(displacements)
        if isinstance(errors, Raised) and (flat := self._flat(errors)) is not None:
            return flat
        state, form = np.empty((len(errors), len(self.placed.state))), np.empty(len(errors))
        begun = self._begun(errors)
        for rows in self._blocks(len(errors)):
            state[rows], d = self._descended(self._local(errors[rows], rows.start), begun(rows), rows.start)
            form[rows] = 2 * d.max(axis=1) if self.placed.shape is LINE else np.ptp(d, axis=1)
        return self._drawn(state, form)

    def _flat(self, errors: Raised) -> Drawn | None:
        """Of a line or a plane whose points move across it: distances are linear then, and one step is enough.

        ``None`` of all else, and where points move along it by as much as shows.
        """
        if self.placed.shape not in STRAIGHT or not len(errors):
            return None
        known, dtype = self._flattened, errors.heights.dtype
        if known is None or known[0] is not errors.directions or known[1] is not errors.offset:
            along = self.placed.frame @ errors.directions.T
            still = self.nominal + self.placed.frame @ errors.offset.T
            design = np.vstack([np.ones(len(self.points)), still[:-1]])  # (k, n)
            known = self._flattened = errors.directions, errors.offset, along, still, design, np.linalg.pinv(design)
        along, still, design, inverse = known[2:]
        state = errors.heights @ (along[-1][:, None] * inverse).astype(dtype) + still[-1] @ inverse
        sideways = np.abs(along[:-1]).max() * max(errors.heights.max(), -errors.heights.min())
        if sideways * np.abs(state[:, 1:]).max() > SETTLED / 100:
            return None
        lines, heights = np.insert(-state, 0, 1.0, axis=1).astype(dtype), np.vstack([still[-1], design]).astype(dtype)
        form = np.empty(len(state))
        for rows in self._blocks(len(errors), 10 * BLOCK):
            d = lines[rows] @ heights
            d += along[-1].astype(dtype) * errors.heights[rows]
            form[rows] = np.ptp(d, axis=1) / np.sqrt(1 + np.sum(state[rows, 1:] ** 2, axis=1))
        return self._drawn(state, form)

    def followed(self, displacements: Floats, step: float) -> tuple[Floats, Floats]:
        """How the least-squares feature of one measurement follows its points: by the implicit function theorem, Jᵀd = 0.

        Each point adds a term of its own to Jᵀd, so that all points are moved at once and not one after the other.
        ``displacements`` are (n, d); ``step``, mm, is that of central differences.

        Returns states (2k, k) where one component after the other is larger by a step, then those where it is smaller; and
        the derivative (n·d, k) of the state by the coordinates of each point, in steps of each component.
        """
        errors, steps = self._checked(displacements[None]), np.diag(step / self._units)
        points = self.points + displacements
        state = self._descended(self._local(errors, 0), self._begun(errors)(slice(None)), 0)[0][0]
        states = np.concatenate([state + steps, state - steps])
        up, down = np.split(np.array([self._each(one, points).sum(axis=0) for one in states]), 2)
        pulled = (self._pulls(state, points, step) - self._pulls(state, points, -step)) / step
        return states, np.asarray(-pulled @ np.linalg.inv(up - down))

    def drawn(self, states: Floats) -> Drawn:
        """Features of states (N, k), whose form nobody asks for."""
        return self._drawn(states, np.zeros(len(states)))

    def minimum_zone(self, displacements: ArrayLike | Raised) -> Drawn:
        """The minimum zone of each draw: straightness in a plane, flatness, roundness, sphericity, cylindricity, conicity.

        Each ends where contact points prove a local minimum. Position and size are those of the middle of the zone. Of a line
        in space it is the narrowest cylinder, found draw by draw, some hundredths of a second each.
        """
        if len(self.points) <= len(self.placed.state) and self.placed.shape is not LINE:
            # the feature goes through as many points as it has parameters
            return self.least_squares(displacements)
        errors = self._checked(displacements)
        state, form = np.empty((len(errors), len(self.placed.state))), np.empty(len(errors))
        begun = self._begun(errors)
        for rows in self._blocks(len(errors), 20 * BLOCK):
            local = self._local(errors[rows], rows.start)
            many = local.shape[2] >= SCREENED and self.placed.shape is not LINE
            state[rows] = begun(rows) if many else self._descended(local, begun(rows), rows.start)[0]
            left = np.arange(local.shape[1])
            if self.placed.shape is not LINE:
                state[rows], form[rows], left = least_zones(self.placed.shape, state[rows], local, self._units)
            for i in left:
                state[rows.start + i] = zone = least_zone(self.placed, local[:, i], state[rows.start + i]).state
                d = self.placed.shape.distances(zone[None], local[:, i, None])[0]
                form[rows.start + i] = 2 * d.max() if self.placed.shape is LINE else np.ptp(d)
        return self._drawn(state, form)

    def one_sided(self, displacements: ArrayLike | Raised, *, inscribed: bool) -> Drawn:
        """The largest circle, sphere or cylinder inside the points of each draw, or the smallest about them.

        Each is held by contact points near the least-squares feature: of several inscribed ones that points hold, as they do
        where errors leave a feature of few points nearly perfect, one may be larger by less than a nanometre. Raises
        :class:`CmmUqError` for a feature without a size too, or points that hold no such one.
        """
        if self.placed.shape not in SIZED:
            raise CmmUqError(
                f"{self.placed.shape.name}: it has no size to be inscribed or circumscribed",
                fix="Ask for circles, spheres and cylinders",
            )
        errors, alone = self._checked(displacements), largest_inside if inscribed else circumscribed
        state, form = np.empty((len(errors), len(self.placed.state))), np.empty(len(errors))
        begun = self._begun(errors)
        for rows in self._blocks(len(errors), 20 * BLOCK):
            local = self._local(errors[rows], rows.start)
            near, _ = self._descended(local, begun(rows), rows.start)
            state[rows], left = held(self.placed.shape, near, local, self._units, -1.0 if inscribed else 1.0)
            for i in left:
                state[rows.start + i] = alone(self.placed, local[:, i]).state
            form[rows] = np.ptp(self.placed.shape.distances(state[rows], local)[0], axis=1)
        return self._drawn(state, form)

    def _checked(self, displacements: ArrayLike | Raised) -> Floats | Raised:
        if isinstance(displacements, Raised):
            return displacements
        errors = np.asarray(displacements, dtype=np.float64)
        if errors.ndim != 3 or errors.shape[1:] != self.points.shape:
            n, d = self.points.shape
            raise CmmUqError(f"displacements have the shape {errors.shape}", fix=f"Give them as (N, {n}, {d}) in mm")
        return errors

    def _blocks(self, draws: int, points: int = BLOCK) -> Iterator[slice]:
        step = max(1, points // len(self.points))
        return (slice(i, min(i + step, draws)) for i in range(0, draws, step))

    def _local(self, errors: Floats | Raised, first: int) -> Floats:
        """(m, B, n) coordinates in the frame."""
        if isinstance(errors, Raised):
            still = self.nominal + self.placed.frame @ errors.offset.T
            local = (self.placed.frame @ errors.directions.T)[:, None] * errors.heights
            local += still[:, None]
        else:
            local = self.nominal[:, None, :] + np.tensordot(self.placed.frame, errors, axes=(1, 2))
        finite = np.isfinite(local).all(axis=(0, 2))
        if not finite.all():
            draw = first + int(np.argmin(finite)) + 1
            raise CmmUqError(f"draw {draw} has a displacement that is no finite number", fix="Correct or leave it out")
        return local

    def _step(self, state: Floats, local: Floats, *, own: bool = False) -> tuple[Floats, Floats, Floats]:
        """Steps (B, k) towards the least-squares features, distances and derivatives before them.

        ``own``: by the normal equations of each draw (Gauss and Newton), in place of those of the nominal points.
        """
        d, J = self.placed.shape.distances(state, local)
        gradient = np.einsum("kbn,bn->bk", J, d)
        if own and self.placed.shape is not LINE and np.isfinite(gradient).all():
            scaled = J.transpose(1, 0, 2) / self._units[:, None]
            # of a draw that is far off the matrix may be singular
            inverse = np.linalg.pinv(scaled @ scaled.transpose(0, 2, 1), hermitian=True)
            return np.einsum("bkl,bl->bk", inverse, gradient / self._units) / self._units, d, J
        return gradient @ self._inverse, d, J

    def _pulls(self, state: Floats, points: Floats, step: float) -> Floats:
        """(n·d, k) by how much Jᵀd, at a state (k,), changes with one coordinate of one point (n, d) moved by a step."""
        still, moved = self._each(state, points), np.empty((*points.shape, len(state)))
        for j, along in enumerate(np.eye(points.shape[1])):
            moved[:, j] = self._each(state, points + step * along) - still
        return moved.reshape(-1, len(state))

    def _each(self, state: Floats, points: Floats) -> Floats:
        """(n, k) what each point adds to Jᵀd at a state."""
        d, J = self.placed.shape.distances(state[None], self.placed.local(points[None]))
        return np.asarray((J[:, 0] * d[0]).T)

    def _begun(self, errors: Floats | Raised) -> Callable[[slice], Floats]:
        """States (B, k) to begin with, of some draws: what follows to first order."""
        if not isinstance(errors, Raised):
            return lambda rows: np.asarray(
                self.placed.state + errors[rows].reshape(-1, len(self._response)) @ self._response
            )
        n, d = errors.directions.shape
        response = np.einsum("nd,ndk->nk", errors.directions, self._response.reshape(n, d, -1))
        still = self.placed.state + errors.offset.ravel() @ self._response
        return lambda rows: np.asarray(still + errors.heights[rows] @ response)

    def _descended(self, local: Floats, state: Floats, first: int) -> tuple[Floats, Floats]:
        """States (B, k) of the least-squares features, from those to begin with, which change, and distances (B, n)."""
        for done in range(MOST_STEPS):
            step, d, J = self._step(state, local, own=done >= SHARED_STEPS)
            state -= step
            largest = np.abs(step * self._units).max(axis=1)
            if largest.max() <= SETTLED:
                for j, derivative in enumerate(J):
                    d -= derivative * step[:, j, None]
                return state, d
            if not np.isfinite(largest).all():
                break
        draw = first + int(np.argmax(np.where(np.isfinite(largest), largest, np.inf))) + 1
        fix = "Draw errors that are small against the feature, or cover more of it"
        raise CmmUqError(f"{self.placed.shape.name}: draw {draw} does not settle", fix=fix)

    def _drawn(self, state: Floats, form: Floats) -> Drawn:
        of = self.placed
        return Drawn(of.position(state), of.direction(state), of.size(state), of.half_angle(state), form)
