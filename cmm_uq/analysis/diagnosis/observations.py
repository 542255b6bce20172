"""Which observations of a large recording the candidates are compared on, by numbers that follow from places alone.

Thousands of columns stand for what could be missing; with all observations of a large recording they would fill the memory,
and tell no more that matters: of 1000 observations, what is a fifth of their noise is found. What is found is then estimated
from all.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.points import Ints
from cmm_uq.machine.model import RecordingModel
from cmm_uq.machine.model.kind import Observed


def numbered_by_place(model: RecordingModel, group: Ints) -> Ints:
    """Numbers (m,) of groups of observations, from that nearest to the middle: no order, numbering or frame changes them."""
    xyz, rows = model.artefact.points.xyz, model.artefact.rows[model.used]
    away = np.sum((xyz - xyz.mean(axis=0)) ** 2, axis=1)[rows].mean(axis=1)
    _, index = np.unique(group, axis=0, return_inverse=True)
    index = index.ravel()
    rank = np.empty(index.max() + 1, dtype=np.int64)
    rank[np.argsort(np.bincount(index, away) / np.bincount(index), kind="stable")] = np.arange(len(rank))
    return rank[index]


MOST = 1000  # observations that candidates are compared on
LEAST_OF_SET_UP = 30  # observations that a set-up keeps where it has as many: its freedoms cost six of them at most


def thin_out(model: RecordingModel, observe: Observed, seed: int, most: int = MOST) -> RecordingModel:
    """The model of some ``most`` observations: whole quantities, evenly from every set-up, or from some at random."""
    artefact, used = model.artefact, np.flatnonzero(model.used)
    if len(used) <= most:
        return model
    random = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(11,)))
    points, first = artefact.points, artefact.rows[used, 0]
    placing = artefact.measurement[used]
    # observations of several points stay with all others of their set-up, of which they may be differences
    each = max(most // len(np.unique(placing)), LEAST_OF_SET_UP) if artefact.rows.shape[1] == 1 else len(used)
    # numbered by their places: another numbering of the recording draws the same ones
    owner = numbered_by_place(model, placing)
    part = numbered_by_place(model, np.column_stack([placing, points.point[first]]))
    within = _first_of_each(owner, part, each, random)
    whole = _first_of_each(np.zeros_like(owner[within]), owner[within], most, random)
    chosen = used[within][whole]
    rows = np.zeros(len(points), dtype=bool)
    rows[artefact.rows[chosen]] = True
    # points that are no observations, such as one ahead of a surface, stay with their set-up
    bare = ~np.isin(np.arange(len(points)), artefact.rows)
    rows |= bare & np.isin(points.measurement, artefact.measurement[chosen])
    try:
        found = observe(points.select(rows))
    except CmmUqError:  # a kind whose points cannot do without each other: slower, the others stay and are not used
        return replace(model, used=np.isin(np.arange(len(model.used)), chosen))
    return replace(model, artefact=found, used=~found.unread())


def _first_of_each(owner: Ints, part: Ints, most: int, random: np.random.Generator) -> NDArray[np.bool_]:
    """(m,) which of every owner's observations: its parts in random order, each of them whole, until ``most`` are reached."""
    _, part = np.unique(np.column_stack([owner, part]), axis=0, return_inverse=True)
    part = part.ravel()
    order = np.lexsort((random.permutation(part.max() + 1)[part], owner))
    starts = np.flatnonzero(np.diff(owner[order], prepend=owner[order][0] - 1))
    rank = np.arange(len(order)) - np.repeat(starts, np.diff(np.append(starts, len(order))))
    chosen = np.zeros(len(order), dtype=bool)
    # a part is taken whole where its first observation is
    parts = np.flatnonzero(np.diff(part[order], prepend=-1))
    chosen[order] = np.repeat(rank[parts] < most, np.diff(np.append(parts, len(order))))
    return chosen
