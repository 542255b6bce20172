"""Faults of an artefact: what is wrong with it turns and moves with it, and looks like the machine in a single set-up.

In the catalogue they stand for their names and words. What they do follows from an artefact: :meth:`OwnFault.made` gives the
fault of one, with its places and with the size that is plausible for it.
"""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.messages import say
from cmm_uq.base.points import Floats, Points
from cmm_uq.base.units import MICROMETRE, unit
from cmm_uq.machine.physics.effect import OWN, PRIOR_WEIGHT, CommonSize, Effect, Nonparametric, Parameter
from cmm_uq.machine.physics.effects.drives import CURVATURE
from cmm_uq.machine.physics.effects.own_body import Body
from cmm_uq.machine.physics.effects.rigid_body import ROTATION, SCALE, SQUARENESS, STRAIGHTNESS

_FEWEST = 3  # places that were met in two set-ups, for a pattern


@dataclass(frozen=True, eq=False)
class FaultyArtefact:
    """An artefact as its faults know it."""

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
    tier = OWN
    of_artefact = True
    owner: FaultyArtefact | None = None

    @property
    def prior_weight(self) -> float:
        return PRIOR_WEIGHT[OWN] if self.owner is None else self.owner.weight

    def made(self, owner: FaultyArtefact) -> OwnFault:
        found = copy(self)
        found.owner, found.mostly = owner, owner.mostly
        found.coefficients = found.sized(owner)
        return found

    def sized(self, owner: FaultyArtefact) -> tuple[Parameter, ...]:
        return tuple(Parameter(c.name, c.unit, owner.size) for c in self.coefficients)

    def belongs_to(self, points: Points) -> bool:
        return self.owner is not None and self.owner.body.covers(points)

    def whose(self) -> FaultyArtefact:
        if self.owner is None:
            raise CmmUqError(
                f"this kind of artefact has no {self.name}", where="job.toml [model] effects", fix="Leave it out"
            )
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

    def made(self, owner: FaultyArtefact) -> OwnFault:
        found = copy(self)
        found.owner, found.mostly = owner, owner.mostly
        found._lies(owner)
        found.coefficients = found.sized(owner)
        return found

    def basis(self, points: Points, shape: Sequence[float] = ()) -> Floats:
        poses = self.whose().body.poses(points)
        field = self.effect.basis(self._there(points))
        back = np.einsum("nij,kj->nik", poses.rotation, self._rotation)
        return -np.asarray(np.einsum("nij,njk->nik", back, field), dtype=np.float64)

    def course(self, points: Points) -> Floats | None:
        return self.effect.course(self._there(points))

    def _lies(self, owner: FaultyArtefact) -> None:
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

    name = "artefact_pattern"
    title = say("Pattern of the artefact itself")
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

    def made(self, owner: FaultyArtefact) -> OwnFault:
        found = copy(self)
        found.owner, found.coefficients, found.mostly = owner, self.sized(owner), owner.mostly
        found._shown = deformations(owner)
        found.size = Parameter("rms_um", unit("µm"), owner.size)
        return found

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
