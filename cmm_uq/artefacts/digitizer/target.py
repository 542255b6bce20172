"""What the digitizer was aligned on: the reference sphere by its points, or its centre as fitted elsewhere.

Both are held to one place for the whole recording: the ball tower stays where it is while the digitizer is turned.
"""

from __future__ import annotations

from typing import Protocol

import numpy as np

from cmm_uq.base.messages import say
from cmm_uq.base.points import Floats, Ints, Points
from cmm_uq.jobs.tables.artefact import ArtefactFacts
from cmm_uq.machine.model.artefact import Placings, Size
from cmm_uq.machine.model.radial import Radial
from cmm_uq.machine.model.recorded import expansion
from cmm_uq.maths.inference.linear_model import Freedoms


class Target(Protocol):
    """Points (n, 3) of the sphere, or its centre seen n times, as an ``Artefact`` has them."""

    sizes: tuple[Size, ...]
    rows: Ints
    noise_scale: Floats

    def fit(self, true_xyz: Floats, sizes: Floats) -> Floats:
        """Points as near to ``true_xyz`` as the target lets them be."""

    def project(self, xyz: Floats, displacement: Floats) -> Floats:
        """What observations show of a displacement."""

    def size_change(self) -> Floats:
        """Change of the observations for one mm of each size."""

    def placing(self, xyz: Floats) -> Floats | Freedoms:
        """Change of the observations for the three freedoms of its place."""


class ScannedSphere(Radial):
    """Points on one sphere, whose diameter may be certified."""

    kind = "digitizer"
    title = say("Reference sphere")
    per_size = 0.5
    size_title = say("Diameter of the reference sphere")
    size_what = say("diameter")
    plural = "the diameters of the scanned spheres"

    def __init__(self, facts: ArtefactFacts, points: Points, where: str | None) -> None:
        everywhere = Placings.of(np.zeros(len(points), dtype=np.int64))
        super().__init__(facts, points, everywhere, expansion(facts, points), where)


class Centre:
    """The centre of the sphere, found n times: three coordinates each."""

    sizes: tuple[Size, ...] = ()

    def __init__(self, count: int) -> None:
        self.rows: Ints = np.repeat(np.arange(count), 3)[:, None]
        self.noise_scale: Floats = np.ones(3 * count)

    def fit(self, true_xyz: Floats, sizes: Floats) -> Floats:
        """All at their mean."""
        return np.broadcast_to(true_xyz.mean(axis=0), true_xyz.shape).copy()

    def project(self, xyz: Floats, displacement: Floats) -> Floats:
        """Every coordinate."""
        return displacement.reshape(3 * len(xyz), displacement.shape[2])

    def size_change(self) -> Floats:
        """A centre has no size."""
        return np.zeros((len(self.rows), 0))

    def placing(self, xyz: Floats) -> Floats:
        """Three coordinates in common."""
        return np.tile(np.eye(3), (len(xyz), 1))
