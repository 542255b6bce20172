"""An artefact's own frame: which of its places each recorded point is, and how it lay in each set-up.

What is wrong with an artefact turns and moves with it; what is wrong with a machine stays where it is. So a fault of the
artefact is a function of a point's place on the artefact, and of how that lay.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from cmm_uq.base.points import Floats, Ints, Points
from cmm_uq.maths.geometry.feature import nearest_rotations

_DECIMALS = 3  # of mm, by which one place is told from another


@dataclass(frozen=True, eq=False)
class Poses:
    """How an artefact lay: the place of each point is ``origin`` + ``rotation`` · its place on the artefact."""

    node: Ints  # (n,) which of the body's places each point is
    rotation: Floats  # (n, 3, 3) from the artefact's axes to the machine's
    origin: Floats  # (n, 3) where the zero of the artefact's axes lies, mm


@dataclass(frozen=True, eq=False)
class Body:
    """The places of an artefact: balls, holes, faces."""

    by: tuple[str, ...]  # columns that tell one place from another; empty where the number of a point does
    keys: Floats  # (N, j) their values at each place
    places: Floats  # (N, 3) in the artefact's own axes, mm

    @classmethod
    def of(cls, points: Points, places: Floats, by: tuple[str, ...] = ()) -> Body:
        """From a recording's points and their places (n, 3) on the artefact; each place as it is first met."""
        keys, first = np.unique(_keys(points, by), axis=0, return_index=True)
        return cls(by, keys, places[first])

    @property
    def extent(self) -> float:
        """Largest distance of a place from the middle of all, mm."""
        return float(np.linalg.norm(self.places - self.places.mean(axis=0), axis=1).max())

    def nodes(self, points: Points) -> Ints:
        """(n,) which place each point is; −1 for one that the body does not have."""
        if any(name not in points.columns for name in self.by):
            return np.full(len(points), -1, dtype=np.int64)
        whole = np.vstack([self.keys, _keys(points, self.by)])
        _, index = np.unique(whole, axis=0, return_inverse=True)
        index = index.ravel()
        known = np.full(index.max() + 1, -1, dtype=np.int64)
        known[index[: len(self.keys)]] = np.arange(len(self.keys))
        return np.asarray(known[index[len(self.keys) :]])

    def covers(self, points: Points) -> bool:
        return bool(np.all(self.nodes(points) >= 0))

    def poses(self, points: Points) -> Poses:
        return _poses(self, points)

    def about_middle(self) -> Floats:
        """(N, 3) places about their mean, mm."""
        return np.asarray(self.places - self.places.mean(axis=0), dtype=np.float64)


def _keys(points: Points, by: tuple[str, ...]) -> Floats:
    if not by:
        return points.point[:, None].astype(np.float64)
    return np.asarray(np.round(np.column_stack([points.columns[name] for name in by]), _DECIMALS) + 0.0)


# every fault of an artefact asks for the poses of the same points
@lru_cache(maxsize=4)
def _poses(body: Body, points: Points) -> Poses:
    node = body.nodes(points)
    own = body.places[node]
    _, index = np.unique(points.measurement, return_inverse=True)
    index = index.ravel()
    middle, own_middle = _means(points.xyz, index), _means(own, index)
    moments = _sums(np.einsum("ni,nj->nij", points.xyz - middle, own - own_middle), index)
    rotation = nearest_rotations(moments)[index]
    return Poses(node, rotation, middle - np.einsum("nij,nj->ni", rotation, own_middle))


def _sums(values: Floats, index: Ints) -> Floats:
    total = np.zeros((int(index.max()) + 1, *values.shape[1:]))
    np.add.at(total, index, values)
    return total


def _means(values: Floats, index: Ints) -> Floats:
    return np.asarray((_sums(values, index) / np.bincount(index)[:, None])[index], dtype=np.float64)
