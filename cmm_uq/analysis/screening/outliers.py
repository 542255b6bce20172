"""Gross outliers of one cause, each told once: something moved during one repeat, or one point is off wherever it stands."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from cmm_uq.base.messages import Text, say
from cmm_uq.base.points import Ints, Points

LEAST = 3  # points that follow one another; two may be neighbours by chance
_SHARE = 2 / 3  # of the points from the first to the last outlier of a repeat, from which on they are one stretch


def moved_stretches(points: Points, outliers: Ints) -> list[Ints]:
    """Outliers of one repeat that are most of the points from the first to the last of them."""
    found = []
    for group in np.unique(points.group[outliers]):
        run = np.flatnonzero(points.group == group)
        run = run[np.argsort(points.point[run], kind="stable")]
        (places,) = np.nonzero(np.isin(run, outliers))
        whole = len(places) == len(run)
        if len(places) >= LEAST and not whole and len(places) >= _SHARE * (places[-1] - places[0] + 1):
            found.append(run[places])
    return found


def stretch_words(points: Points, stretch: Ints, times: Sequence[float]) -> Text:
    measurement, repeat = points.run_of(int(points.group[stretch[0]]))
    return say(
        "points {first} to {last} of measurement {measurement}, repeat {repeat} are {low:.1f} to {high:.1f} of their "
        "standard deviations off what the others say, one after the other: the artefact, the probe or its stylus moved "
        "during this repeat; measure it again",
        first=int(points.point[stretch[0]]), last=int(points.point[stretch[-1]]), measurement=measurement,
        repeat=repeat, low=min(times), high=max(times),
    )  # fmt: skip


def recurring_points(points: Points, outliers: Ints) -> list[Ints]:
    """Outliers of points that are off in most of their readings, and in several set-ups."""
    found = []
    for point in np.unique(points.point[outliers]):
        rows = outliers[points.point[outliers] == point]
        set_ups, readings = len(np.unique(points.measurement[rows])), np.count_nonzero(points.point == point)
        if set_ups >= LEAST and len(rows) >= _SHARE * readings:
            found.append(rows)
    return found


def point_words(points: Points, rows: Ints, times: Sequence[float]) -> Text:
    point = int(points.point[rows[0]])
    return say(
        "point {point} is {low:.1f} to {high:.1f} of its standard deviations off what the others say in {count} of its "
        "{all} readings, in set-ups of different places: no gross error, but something that belongs to this point; on an "
        "artefact, look whether it is where its reference says",
        point=point, low=min(times), high=max(times), count=len(rows), all=int(np.count_nonzero(points.point == point)),
    )  # fmt: skip
