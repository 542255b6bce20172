"""What repeats are worth beside placings: an offset of each set-up is shared by its repeats, and only placings average it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from cmm_uq.analysis.planning.expected import expected
from cmm_uq.analysis.planning.placing import Placing, joined
from cmm_uq.analysis.planning.setting import Setting
from cmm_uq.base.points import Floats, Points
from cmm_uq.maths.inference.linear_model import Unknown

COMPARED = 10
"""Repeats that are compared, or one more than the plan has."""


@dataclass(frozen=True, eq=False)
class Repeated:
    """What placings tell with a number of repeats.

    Parameters
    ----------
    repeats, readings, minutes : of every point; of all placings together.
    u : (p,) expected of each parameter, in its unit, infinite where it stays free.
    readings_more, minutes_more, u_more : with one more placing, which tells as much as they do on average.
    """

    repeats: int
    readings: int
    minutes: float
    u: Floats
    readings_more: float
    minutes_more: float
    u_more: Floats


@dataclass(frozen=True, eq=False)
class Worth:
    """Repeats against placings.

    Parameters
    ----------
    unknowns : p parameters, those without a certificate.
    placings : how many there are.
    rows : for 1, 2, … repeats.
    """

    unknowns: tuple[Unknown, ...]
    placings: int
    rows: tuple[Repeated, ...]

    @property
    def enough(self) -> int | None:
        """Repeats from which on a minute of one more placing lowers every uncertainty more than one of one more repeat.

        ``None`` where that is so for no number of them in the table.
        """
        better = [_placing_is_better(one, following) for one, following in pairwise(self.rows)]
        first = len(better) + 1 - [*reversed(better), False].index(False)
        return first if first <= len(better) else None


def _placing_is_better(one: Repeated, following: Repeated) -> bool:
    """Whether the logarithm of every uncertainty falls more in a minute of one more placing than of the following repeat."""
    there = np.isfinite(one.u)
    by_placing = np.log(one.u[there] / one.u_more[there]) * (following.minutes - one.minutes)
    by_repeat = np.log(one.u[there] / following.u[there]) * (one.minutes_more - one.minutes)
    return bool(np.all(by_placing > by_repeat))


def worth_of_repeats(setting: Setting, placings: Sequence[Placing]) -> Worth | None:
    """Repeats against placings; ``None`` where no parameter is determined or the noise is taken as white.

    Parameters
    ----------
    setting : with the noise.
    placings : of the plan.
    """
    noise, n = setting.noise, len(placings)
    if noise is None or not setting.named:
        return None
    rows = []
    for repeats in range(1, max(COMPARED, setting.plan.repeats + 1) + 1):
        points = _joined(setting, placings, repeats)
        model, minutes = setting.model(points), _minutes(setting, n, len(points))
        sought = [i for i, unknown in enumerate(model.unknowns) if not unknown.known]
        # information of n + 1 placings is to that of n as if variances were n / (n + 1) of what they are
        now, more = (expected(model, each).u[sought] for each in (noise, noise.times(float(np.sqrt(n / (n + 1))))))
        with_one_more = len(points) * (1 + 1 / n)
        rows.append(
            Repeated(
                repeats, len(points), minutes, now, with_one_more, _minutes(setting, n + 1, with_one_more), more,
            )
        )  # fmt: skip
    unknowns = tuple(unknown for unknown in model.unknowns if not unknown.known)
    return Worth(unknowns, n, tuple(rows)) if np.any(np.isfinite(rows[0].u)) else None


def repeated(points: Points, times: int) -> Points:
    """What was read first, that many times over."""
    once = points.select(points.repeat == points.repeat.min())
    n = len(once)
    return replace(
        once, xyz=np.tile(once.xyz, (times, 1)), measurement=np.tile(once.measurement, times),
        point=np.tile(once.point, times), repeat=np.repeat(np.arange(1, times + 1), n), lines=np.zeros(0, dtype=np.int64),
        columns={name: np.tile(values, times) for name, values in once.columns.items()},
    )  # fmt: skip


def _joined(setting: Setting, placings: Sequence[Placing], repeats: int) -> Points:
    plan = setting.plan
    return joined(
        [replace(placing, points=repeated(placing.points, repeats)) for placing in placings],
        seconds_per_point=plan.seconds_per_point, minutes_per_placing=plan.minutes_per_placing, columns=plan.columns,
    )  # fmt: skip


def _minutes(setting: Setting, placings: int, readings: float) -> float:
    return setting.plan.minutes_per_placing * placings + setting.plan.seconds_per_point * readings / 60
