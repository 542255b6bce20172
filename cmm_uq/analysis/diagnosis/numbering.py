"""Numbers of set-ups and points that follow from where they are, so that no number given decides what is drawn or held out."""

from __future__ import annotations

import numpy as np

from cmm_uq.base.points import Ints
from cmm_uq.machine.model import MeasurementModel


def numbered_by_place(model: MeasurementModel, group: Ints) -> Ints:
    """Numbers (m,) of groups of used observations, from that nearest to the middle of the recording.

    No order of rows, numbering or frame changes how far the groups are from it.

    Parameters
    ----------
    model : with its recording.
    group : (m,) or (m, j), equal for the observations of one group.
    """
    xyz, rows = model.artefact.points.xyz, model.artefact.rows[model.used]
    away = np.sum((xyz - xyz.mean(axis=0)) ** 2, axis=1)[rows].mean(axis=1)
    _, index = np.unique(group, axis=0, return_inverse=True)
    index = index.ravel()
    rank = np.empty(index.max() + 1, dtype=np.int64)
    rank[np.argsort(np.bincount(index, away) / np.bincount(index), kind="stable")] = np.arange(len(rank))
    return rank[index]
