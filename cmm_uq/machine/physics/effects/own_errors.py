"""Faults of an artefact: what is wrong with it turns and moves with it, and looks like the machine in a single set-up.

So a fault is a function of a point's place on the artefact, and of how that lay. In the catalogue faults stand for their names
and words; :meth:`OwnFault.made` gives the fault of one artefact, with its places and with the size that is plausible for it.
"""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy
from functools import lru_cache
from types import MappingProxyType

import numpy as np

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.messages import say
from cmm_uq.base.points import Floats, Ints, Points
from cmm_uq.base.units import MICROMETRE, unit
from cmm_uq.base.values import dataclass
from cmm_uq.machine.physics.effect import OWN, PRIOR_WEIGHT, CommonSize, Effect, Nonparametric, Parameter
from cmm_uq.machine.physics.effects.drives import CURVATURE
from cmm_uq.machine.physics.effects.rigid_body import ROTATION, SCALE, SQUARENESS, STRAIGHTNESS
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
        return float(np.linalg.norm(self.about_middle(), axis=1).max())

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
    middle, own_middle = means_of(points.xyz, index), means_of(own, index)
    moments = _sums(np.einsum("ni,nj->nij", points.xyz - middle, own - own_middle), index)
    rotation = nearest_rotations(moments)[index]
    return Poses(node, rotation, middle - np.einsum("nij,nj->ni", rotation, own_middle))


def _sums(values: Floats, index: Ints) -> Floats:
    total = np.zeros((int(index.max()) + 1, *values.shape[1:]))
    np.add.at(total, index, values)
    return total


def means_of(values: Floats, index: Ints) -> Floats:
    """(n, …) mean of those of one ``index`` (n,), given back to each."""
    return np.asarray((_sums(values, index) / np.bincount(index)[:, None])[index], dtype=np.float64)


_FEWEST = 3  # places that were met in two set-ups, for a pattern


@dataclass(frozen=True, eq=False)
class FaultyArtefact:
    body: Body  # its places
    points: Points  # as recorded
    size: float  # plausible standard deviation of what a fault does, in the unit of the fault
    weight: float  # how readily the fault is thought of, beside effects of the machine
    axes: int = 3  # how many of its own axes are seen: all three, or the first, along which its faces lie
    cte: float = 0.0  # its coefficient of thermal expansion, 1/K
    mostly: float = 1.0  # part of that size that it mostly keeps to (see :attr:`Effect.mostly`).


class OwnFault(Effect):
    """A fault of the artefact itself; ``owner`` is that artefact, ``None`` in the catalogue."""

    mechanism = "artefact"
    tier, of_artefact = OWN, True
    owner: FaultyArtefact | None = None

    @property
    def prior_weight(self) -> float:
        return PRIOR_WEIGHT[OWN] if self.owner is None else self.owner.weight

    def made(self, owner: FaultyArtefact) -> OwnFault:
        fault = copy(self)
        fault.owner, fault.mostly = owner, owner.mostly
        fault.fit(owner)
        fault.coefficients = fault.sized(owner)
        return fault

    def fit(self, owner: FaultyArtefact) -> None:
        """Take from its artefact what follows from that alone."""

    def sized(self, owner: FaultyArtefact) -> tuple[Parameter, ...]:
        return tuple(Parameter(c.name, c.unit, owner.size) for c in self.coefficients)

    def belongs_to(self, points: Points) -> bool:
        return self.owner is not None and self.owner.body.covers(points)

    def whose(self) -> FaultyArtefact:
        if self.owner is None:
            problem = f"this kind of artefact has no {self.name}"
            raise CmmUqError(problem, where="job.toml [model] effects", fix="Leave it out")
        return self.owner


class OwnGeometry(OwnFault):
    """The artefact deviates as an ideal one would seem to on a machine with this error, and takes that with it when it turns.

    Its field is the error of the machine where the artefact lay in one of its set-ups; the artefact's places deviate by it.
    """

    def __init__(self, effect: Effect) -> None:
        self.effect = effect
        self.name = f"artefact_{effect.name}"
        self.title = say("Error of the artefact itself that looks like: {effect:small}", effect=effect.title)
        self.formula = f"e = −(e of {effect.name} at the artefact's reference set-up, turned with the artefact)"
        self.points_to = say(
            "the artefact itself deviates, as if it had been made or calibrated on a machine with this error "
            "({effect:small}): have it calibrated, or measure it turned",
            effect=effect.title,
        )
        self.coefficients = effect.coefficients
        self.idealised_over = effect.idealised_over
        self.everywhere = effect.everywhere

    def sized(self, owner: FaultyArtefact) -> tuple[Parameter, ...]:
        (c,) = self.coefficients
        _, rows = np.unique(owner.body.poses(owner.points).node, return_index=True)
        field = self.effect.basis(self._there(owner.points))[rows, :, 0] @ self._rotation
        shapes = deformations(owner)
        deformed = shapes @ (shapes.T @ field[:, : owner.axes].ravel())
        largest = float(np.linalg.norm(deformed.reshape(-1, owner.axes), axis=1).max()) / MICROMETRE
        sd = min(c.prior_sd, owner.size / largest) if largest > 0 else c.prior_sd
        return (Parameter(c.name, c.unit, sd),)

    def basis(self, points: Points, shape: Sequence[float] = ()) -> Floats:
        poses = self.whose().body.poses(points)
        field = self.effect.basis(self._there(points))
        back = np.einsum("nij,kj->nik", poses.rotation, self._rotation)
        return -np.asarray(np.einsum("nij,njk->nik", back, field), dtype=np.float64)

    def course(self, points: Points) -> Floats | None:
        return self.effect.course(self._there(points))

    def fit(self, owner: FaultyArtefact) -> None:
        # where it is like the machine's error: in the set-up least turned against its own axes, however numbered
        poses = owner.body.poses(owner.points)
        middle = owner.body.places.mean(axis=0)
        _, first = np.unique(owner.points.measurement, return_index=True)
        turned = np.round(np.einsum("qii->qi", poses.rotation[first])[:, : owner.axes].sum(axis=1), 2)
        centres = poses.origin[first] + poses.rotation[first] @ middle
        order = np.lexsort((*np.round(centres.T, 0), -turned))
        row = first[order[0]]
        self._rotation, self._origin = poses.rotation[row], poses.origin[row]

    def _there(self, points: Points) -> Points:
        body = self.whose().body
        places = body.places[body.poses(points).node]
        return points.at(self._origin + places @ self._rotation.T)


class OwnPattern(OwnFault, CommonSize):
    """Every place of the artefact has an error of its own, the same in all set-ups and repeats."""

    name, title = "artefact_pattern", say("Pattern of the artefact itself")
    formula = (
        "e = −(deviation of each ball, hole or face from its certified place, less a shift, a turn and a scale of all)"
    )
    points_to = say(
        "balls, holes or faces of the artefact are not where its certificate or its drawing says: have it calibrated, or "
        "estimate its deviations from turned set-ups"
    )
    coefficients: tuple[Parameter, ...] = (Parameter("um", unit("µm"), 10.0),)
    size = Parameter("rms_um", unit("µm"), 10.0)
    stands_for = tuple(Nonparametric(f"reference_{name}mm") for name in ("", "x_", "y_", "z_"))
    _shown: Floats

    def sized(self, owner: FaultyArtefact) -> tuple[Parameter, ...]:
        return tuple(Parameter(f"c{i + 1}_um", unit("µm"), owner.size) for i in range(deformations(owner).shape[1]))

    def fit(self, owner: FaultyArtefact) -> None:
        self._shown, self.size = deformations(owner), Parameter("rms_um", unit("µm"), owner.size)

    def shown_in(self, points: Points) -> bool:
        node = self.whose().body.nodes(points)
        pairs = np.unique(np.column_stack([node, points.measurement]), axis=0)
        again = int(np.sum(np.bincount(pairs[:, 0]) > 1))
        return again >= max(_FEWEST, 0.5 * len(np.unique(node)))

    def errors(self, coefficients: Floats) -> Floats:
        self.whose()
        return np.asarray(coefficients @ self._shown.T, dtype=np.float64)

    def basis(self, points: Points, shape: Sequence[float] = ()) -> Floats:
        owner = self.whose()
        poses = owner.body.poses(points)
        own = self._shown.reshape(-1, owner.axes, len(self.coefficients))[poses.node]
        return -MICROMETRE * np.asarray(np.einsum("nij,njk->nik", poses.rotation[:, :, : owner.axes], own))


def deformations(owner: FaultyArtefact) -> Floats:
    """Orthonormal deviations (N·a, r) of N places along a axes that contain no shift, turn or scale of the whole."""
    places = owner.body.about_middle()[:, : owner.axes]
    count, a = places.shape
    columns = [np.tile(np.eye(a), (count, 1)), places.reshape(-1, 1)]
    for i in range(a):
        for j in range(i):
            turn = np.zeros((count, a))
            turn[:, i], turn[:, j] = places[:, j], -places[:, i]
            columns.append(turn.reshape(-1, 1))
    whole = np.hstack(columns)
    U, s, _ = np.linalg.svd(whole / np.linalg.norm(whole, axis=0).clip(1e-12), full_matrices=True)
    return np.asarray(U[:, int(np.sum(s > 1e-9 * s[0])) :], dtype=np.float64)


# by the name of the machine's error that it looks like
GEOMETRY = MappingProxyType(
    {
        effect.name: OwnGeometry(effect)
        for family in (SCALE.values(), SQUARENESS.values(), STRAIGHTNESS.values(), ROTATION.values(), CURVATURE)
        for effect in family
    }
)
# what faces along one line can look like, and that is no scale; and what three corners can look like
ALONG_A_LINE: tuple[OwnGeometry, ...] = tuple(GEOMETRY[effect.name] for effect in CURVATURE)
AFFINE: tuple[OwnGeometry, ...] = tuple(GEOMETRY[e.name] for e in (*SCALE.values(), *SQUARENESS.values()))
PATTERN = OwnPattern()
EFFECTS: tuple[OwnFault, ...] = (PATTERN, *GEOMETRY.values())
