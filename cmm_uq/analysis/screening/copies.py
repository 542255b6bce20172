"""Measurements that repeat another one to the last digit: copies, which count once."""

from __future__ import annotations

from collections.abc import Collection

import numpy as np

from cmm_uq.base.points import Ints, Points


def copied_measurements(points: Points) -> dict[int, int]:
    """Groups that repeat one of another measurement to the last digit, with that other (see :attr:`Points.copies`).

    A repeat that repeats another of its own measurement is none: with a coarse display that happens honestly.
    """
    return {
        later: original
        for later, original in points.copies.items()
        if points.run_of(later)[0] != points.run_of(original)[0]
    }


def counted_with(points: Points, set_aside: Collection[int] = ()) -> Ints:
    """For every point, a row of the group that it counts with: its own, or that of which it is a copy, (n,).

    Parameters
    ----------
    points : the recording.
    set_aside : measurements that the job leaves out; the copy of one counts in its place.
    """
    first = np.unique(points.group, return_index=True)[1]
    counts = np.arange(len(first))
    for later, original in copied_measurements(points).items():
        if points.run_of(original)[0] not in set_aside:
            counts[later] = original
    return first[counts[points.group]]
