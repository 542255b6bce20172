"""Whether a sphere was probed at as many points, and as far round, as a standard wants."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from cmm_uq.analysis.conformity.plans import Condition, SpherePlan
from cmm_uq.base.messages import say
from cmm_uq.base.points import Floats, Points

_DIRECTIONS = 400
"""On a hemisphere, at which the reach of its points is looked at."""


def sphere_points(
    plan: SpherePlan, points: Points, directions: Floats, copies: Mapping[int, int]
) -> tuple[Condition, ...]:  # fmt: skip
    """How many points on each sphere, and whether they cover it.

    Parameters
    ----------
    plan : of the standard.
    points, directions : that were probed, and the outward direction (n, 3) of each from the middle of its sphere.
    copies : groups that do not count.
    """
    lacking, bare = [], []
    for group, rows in enumerate(points.rows_of_groups):
        if group in copies:
            continue
        count = len(np.unique(points.xyz[rows] + 0.0, axis=0))
        name = say("measurement {number}", number=points.run_of(group)[0])
        if count < plan.points:
            lacking.append(
                say(
                    "{points} points on the sphere of {name} ({recorded} recorded, {different} different)",
                    points=plan.points,
                    name=name,
                    recorded=len(rows),
                    different=count,
                )
            )
        elif (gap := _farthest(directions[rows])) > plan.reach_deg:
            bare.append(
                say(
                    "points over a hemisphere on the sphere of {name} (part of it {gap:.0f}° from the nearest point)",
                    name=name,
                    gap=gap,
                )
            )
    return (
        Condition(say("{points} points over the sphere", points=plan.points), tuple(lacking)),
        Condition(
            say("every direction of a hemisphere within {reach_deg:g}° of a point", reach_deg=plan.reach_deg),
            tuple(bare),
        ),
    )


def _farthest(normals: Floats) -> float:
    """Largest angle, °, of a direction of the hemisphere about the mean of some normals (n, 3) to the nearest of them."""
    pole = normals.mean(axis=0)
    pole = pole / np.linalg.norm(pole) if np.linalg.norm(pole) > 1e-9 else np.array([0.0, 0.0, 1.0])
    height = (np.arange(_DIRECTIONS) + 0.5) / _DIRECTIONS
    turn = np.pi * (1 + np.sqrt(5)) * np.arange(_DIRECTIONS)
    radius = np.sqrt(1 - height**2)
    across = np.linalg.svd(pole[None])[2][1:]
    grid = np.column_stack([radius * np.cos(turn), radius * np.sin(turn), height]) @ np.vstack([across, pole])
    return float(np.degrees(np.arccos(np.clip((grid @ normals.T).max(axis=1), -1.0, 1.0)).max()))
