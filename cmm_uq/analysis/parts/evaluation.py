"""From drawn coefficients of causes to characteristics: what is linear in one product, everything else on the points.

Features of which only values are asked follow to first order, by the exact derivative of their association; forms, zones,
minimum zones and what is of points follow from the points that were drawn. Frames and characteristics are exact functions of
features in both: a position is not linear where it is small.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from functools import cached_property, partial

import numpy as np

from cmm_uq.analysis.parts.association import VALUES, Features, ProbedFeature
from cmm_uq.analysis.parts.causes.cause import HEIGHTS, CommonCause, Drawn, PartCause, Rows
from cmm_uq.analysis.parts.characteristics import CharacteristicEvaluation, Key, MeasuredFeatures
from cmm_uq.analysis.parts.datums import BEST_FIT, BestFit, DatumSystem, ProbedCommon
from cmm_uq.analysis.parts.plan import FORMS, PartFeature, Plan
from cmm_uq.base.points import Floats, Ints
from cmm_uq.base.values import dataclass, replace
from cmm_uq.maths.geometry.association import Association

Known = dict[tuple[str, Association, bytes], ProbedFeature]  # features by name, association and points
EXACT: Association = "least_squares"  # the association whose values have a derivative everywhere
_WORTH = 3  # A block of a third as many draws as a table has rows is worth following the whole table once
Coefficients = Sequence[Drawn | None]  # (N, K) of each cause; ``None`` of one that does not act


@dataclass(frozen=True, eq=False)
class Movement:
    """What N draws of causes move, beyond the base of an :class:`Evaluator`."""

    change: Floats  # (N, …) of what is taken to first order
    # by feature that is taken on its points, (N, m, 3) of these, mm; (N, m) along their normals
    points: Mapping[str, Floats]
    whole: Floats | None = None  # (N, n, 3) of all points for an exact best fit, or none

    def plus(self, other: Movement) -> Movement:
        """With another; one of a single row moves all."""
        return Movement(
            self.change + other.change,
            {name: moved + other.points[name] for name, moved in self.points.items()},
            None if self.whole is None or other.whole is None else self.whole + other.whole,
        )

    def times(self, factors: float | Floats) -> Movement:
        """So many times; (N,) each draw a number of its own."""
        return self._each(lambda moved: moved * np.reshape(factors, (-1, *[1] * (moved.ndim - 1))))

    def rows(self, which: Ints) -> Movement:
        """Some of its draws, again where they are named again."""
        return self._each(lambda moved: moved[which])

    def _each(self, become: Callable[[Floats], Floats]) -> Movement:
        points = {name: become(moved) for name, moved in self.points.items()}
        return Movement(become(self.change), points, None if self.whole is None else become(self.whole))


class Evaluator:
    """Characteristics of a plan as functions of the coefficients of its causes.

    ``plan``: with nominal points. ``base``: (n, 3) displacements without any draw, mm. ``causes``: that move the points
    besides; ``None`` for one that does not. ``known``: features that were looked at before, to be looked up and added to:
    they are the same wherever the part lies. ``along``: names of features whose points are moved along their normals alone.
    """

    def __init__(
        self, plan: Plan, base: Floats, causes: Sequence[PartCause | None], known: Known | None = None,
        along: Collection[str] = (),
    ) -> None:  # fmt: skip
        self.plan, self.base, self.causes, self.along = plan, base, causes, along
        self._known: Known = {} if known is None else known
        self._followed: dict[object, tuple[Floats, Floats]] = {}
        self._raising: dict[object, tuple[tuple[Floats, ...], Floats]] = {}
        asked = [name for one in plan.characteristics for name in (*one.features, *one.datums)]
        self.nominal = {
            name: self._probed(name, EXACT, plan.feature(name).points).undisturbed
            for name in dict.fromkeys((*asked, *plan.alignment.datums))
        }
        self.evaluations = [CharacteristicEvaluation(one, plan, self.nominal) for one in plan.characteristics]
        self.keys = list(dict.fromkeys(key for one in self.evaluations for key in (*one.keys, *one.datums)))
        self.of_points = {one.keys[0] for one in self.evaluations if one.of_points}
        self.seen = {one.keys[0] for one in self.evaluations if one.of_points and one.characteristic.what not in FORMS}
        # features that are taken to first order
        self.linear = [key for key in self.keys if key[1] == EXACT and key not in self.of_points]
        for one in self.evaluations:
            one.refuse_unfit()
        self.associated = {
            (name, how): self._probed(name, how, plan.feature(name).points + base[plan.rows_of(name)])
            for name, how in self.keys
        }
        framed = dict.fromkeys(one.frame_of for one in self.evaluations if one.frame_of)
        self.frames = {
            names: DatumSystem([plan.feature(name) for name in names], [self.nominal[name] for name in names])
            for names in framed
            if names != BEST_FIT
        }
        self.best_fit = BestFit(plan.points, plan.normals) if BEST_FIT in framed else None

    def _probed(self, name: str, how: Association, points: Floats) -> ProbedFeature:
        feature = self.plan.feature(name)
        first, key = (name, EXACT, feature.points.tobytes()), (name, how, points.tobytes())
        if first not in self._known:
            self._known[first] = self._made(feature, feature.points, EXACT)
        if key not in self._known:
            self._known[key] = self._made(feature, points, how, self._known[first])
        return self._known[key]

    @staticmethod
    def _made(
        feature: PartFeature, points: Floats, how: Association, looked_at: ProbedFeature | None = None
    ) -> ProbedFeature:
        return ProbedCommon(feature, points) if feature.members else ProbedFeature(feature, points, how, looked_at)

    @cached_property
    def transfers(self) -> list[Floats | None]:
        """(K, 8f) of each cause: change of the values of ``linear`` features for one unit of each coefficient.

        Six columns more are of the motion of a best fit, where one is asked for.
        """
        whole = self.derivative()
        return [None if cause is None else cause.through(whole) for cause in self.causes]

    def derivative(self) -> Floats:
        """(8f, n, 3) of the values of ``linear`` features by all points; six rows more of a best fit."""
        whole = np.zeros((VALUES * len(self.linear), len(self.plan.points), 3))
        for i, key in enumerate(self.linear):
            whole[VALUES * i : VALUES * (i + 1), self.plan.rows_of(key[0])] = self.associated[key].derivative
        return whole if self.best_fit is None else np.concatenate([whole, self.best_fit.derivative])

    def on_points(self, *, exact: bool = False) -> list[str]:
        """Names of the features and common datums that are taken on their points."""
        return list(dict.fromkeys(key[0] for key in self.keys if exact or key not in self.linear))

    def __call__(self, coefficients: Coefficients, *, exact: bool = False) -> Floats:
        """Characteristics (N, c), mm and rad, for coefficients (N, K) of each cause; one row where there is none."""
        return self.of(self.movement(coefficients, exact=exact), exact=exact)

    def of(self, movement: Movement, *, exact: bool = False, only: int | None = None) -> Floats:
        """Characteristics (N, c) of a :meth:`movement`, mm and rad; of ``only`` one, (N, 1)."""
        change, asked = movement.change, self.evaluations if only is None else [self.evaluations[only]]
        keys = {key for one in asked for key in (*one.keys, *one.datums)}
        features: dict[Key, Features] = {}
        for i, key in enumerate([] if exact else self.linear):
            if key in keys:
                features[key] = self.associated[key].to_first_order(change[:, VALUES * i : VALUES * (i + 1)])
        for key in self.keys:
            if key in keys and key not in features:
                features[key] = self.associated[key].of(movement.points[key[0]], with_points=key in self.seen)
        frames = {
            names: self.frames[names].frames([features[name, self.plan.feature(name).association] for name in names])
            for names in {one.frame_of for one in asked if one.frame_of in self.frames}
        }
        if self.best_fit is not None and any(one.frame_of == BEST_FIT for one in asked):
            if movement.whole is None:
                motion = self.best_fit.motion(self.base[None])[0] + change[:, VALUES * len(self.linear) :]
            else:
                motion = self.best_fit.motion(self.base + movement.whole)
            frames[BEST_FIT] = self.best_fit.frame(motion)
        measured = MeasuredFeatures(features, frames)
        return np.column_stack([one(measured) for one in asked])

    def needed(self, movement: Movement, only: int) -> Movement:
        """What of a :meth:`movement` one characteristic is of."""
        one = self.evaluations[only]
        names = {name for name, _ in (*one.keys, *one.datums)}
        points = {name: moved for name, moved in movement.points.items() if name in names}
        return replace(movement, points=points, whole=movement.whole if one.frame_of == BEST_FIT else None)

    def movement(self, coefficients: Coefficients, *, exact: bool = False) -> Movement:
        """What coefficients move of all that the characteristics are of."""
        return Movement(
            np.zeros((_count(coefficients), 0)) if exact else self._changes(coefficients),
            {name: self._moved_of(coefficients, name) for name in self.on_points(exact=exact)},
            self.moved(coefficients, slice(None)) if exact and self.best_fit is not None else None,
        )

    def _moved_of(self, coefficients: Coefficients, name: str) -> Floats:
        """(N, m, 3) displacements of the points of a feature or common datum; (N, m) along their normals."""
        if name not in self.along:
            moved = [self.moved(coefficients, self.plan.rows[member]) for member in self.plan.members(name)]
            return moved[0] if len(moved) == 1 else np.concatenate(moved, axis=1)
        rows = self.plan.rows[name]
        normals = self.plan.normals[rows]
        found = np.zeros((_count(coefficients), len(normals)), dtype=HEIGHTS)
        pairs = enumerate(zip(self.causes, coefficients, strict=True))
        acting = [(k, one, np.asarray(drawn)) for k, (one, drawn) in pairs if one is not None and drawn is not None]
        if common := [(k, c, drawn) for k, c, drawn in acting if isinstance(c, CommonCause)]:
            key = name, tuple(k for k, *_ in common)  # all in one product
            if key not in self._raising:
                lefts, rights = zip(*(one.raising(rows, normals) for _, one, _ in common), strict=True)
                self._raising[key] = lefts, np.concatenate(rights)
            lefts, right = self._raising[key]
            each = [drawn @ left for (*_, drawn), left in zip(common, lefts, strict=True)]
            found = np.hstack(each).astype(HEIGHTS) @ right
        for _, one, drawn in acting:
            found += 0 if isinstance(one, CommonCause) else one.raised(drawn, rows, normals)
        return found

    def _changes(self, coefficients: Coefficients) -> Floats:
        """(N, …) changes of what is taken to first order."""
        columns = VALUES * len(self.linear) + (0 if self.best_fit is None else len(self.best_fit.derivative))
        change = np.zeros((_count(coefficients), columns))
        for i, (drawn, transfer) in enumerate(zip(coefficients, self.transfers, strict=True)):
            if transfer is not None and drawn is not None:
                change += self._follow(i, drawn, partial(np.dot, b=transfer))
        return change

    def moved(self, coefficients: Coefficients, rows: slice) -> Floats:
        """(N, m, 3) displacements of some points by all causes, beyond ``base``, mm."""
        found = np.zeros((_count(coefficients), len(self.plan.points[rows]), 3))
        for i, (cause, drawn) in enumerate(zip(self.causes, coefficients, strict=True)):
            if cause is not None and drawn is not None:
                key = i, rows.start, rows.stop
                found += self._follow(key, drawn, partial(cause.moved, rows=rows))
        return found

    def _follow(self, key: object, drawn: Drawn, follow: Callable[[Floats], Floats]) -> Floats:
        """What follows linearly from coefficients; of many rows of a table, from the whole table once."""
        if not isinstance(drawn, Rows) or _WORTH * len(drawn) < len(drawn.table):
            return follow(np.asarray(drawn))
        table, followed = self._followed.get(key, (None, None))
        if followed is None or table is not drawn.table:
            followed = np.concatenate([follow(part) for part in drawn.parts()])
            self._followed[key] = drawn.table, followed
        return np.asarray(followed[drawn.rows])


def characteristics_of(plan: Plan, points: Floats, known: Known | None = None) -> Floats:
    """Characteristics (c,) of points (n, 3) in the frame of the part, mm."""
    return np.asarray(Evaluator(plan, points - plan.points, [], known)([], exact=True)[0])


def _count(coefficients: Coefficients) -> int:
    """Of draws; one where nothing is drawn."""
    return next((len(drawn) for drawn in coefficients if drawn is not None), 1)
