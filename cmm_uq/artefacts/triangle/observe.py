"""Triangle standard as recorded: the axes of three cylinders in several placings.

In the source's equations a rotation of any carriage acts on the stylus tip offset too, and two tips of different length part
yaw from scale. So ``tip_x_mm, tip_y_mm, tip_z_mm`` count for every carriage here, and not for the ram alone.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from cmm_uq.artefacts.triangle.facts import TriangleFacts
from cmm_uq.artefacts.triangle.standard import (
    DIMENSIONS,
    SIDES_OF_DIMENSIONS,
    TriangleStandard,
    corner_changes,
    corners,
)
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.messages import say
from cmm_uq.base.points import Floats, Points
from cmm_uq.base.units import unit
from cmm_uq.machine.model.artefact import Size
from cmm_uq.machine.model.artefact_doubt import by_certificate, faults
from cmm_uq.machine.model.recorded import check_length, expansion, place
from cmm_uq.machine.model.rigid import Rigid
from cmm_uq.machine.physics.effect import Effect
from cmm_uq.machine.physics.effects.own_body import Body
from cmm_uq.machine.physics.effects.own_errors import AFFINE

_TITLES = (
    say("Block 1–2"), say("Block 2–3"), say("Block 3–1"), say("Cylinder 1"), say("Cylinder 2"), say("Cylinder 3"),
)  # fmt: skip


_WRONG_UM = 5.0
"""By how much a side may be off whose block or cylinder is another than the job says, µm."""


class Triangle(Rigid):
    """A triangle as recorded: points 1, 2, 3 of every (measurement, repeat) are the axes of its cylinders.

    Parameters
    ----------
    facts : what the job says of blocks and cylinders.
    points : the recording.

    Attributes
    ----------
    standard : dimensions of the triangle.

    Raises
    ------
    CmmUqError : the triangle does not close, a corner is missing, or the recording is of another triangle.
    """

    kind = "triangle"
    title = say("Triangle standard")

    def __init__(self, facts: TriangleFacts, points: Points, *, where: str | None = None) -> None:
        super().__init__(replace(points, machine=replace(points.machine, tip_on_every_carriage=True)))
        self._facts = facts
        self.standard = TriangleStandard.of(facts)
        self.expansion = expansion(facts, points)
        _refuse_missing_corners(points, where)
        self._corner = points.point - 1
        self.sizes = tuple(
            Size(f"{name}_mm", title, unit("mm"), float(nominal), float(u))
            for name, title, nominal, u in zip(
                DIMENSIONS, _TITLES, self.standard.dimensions, self.standard.u, strict=True
            )
        )
        self.body = self.shape(self.standard.dimensions)
        nominal, found = self.extents()
        longest = float(self.standard.sides.max())
        check_length(float(found.sum() / nominal.sum()) * longest, longest, "the longest sides", where)
        self.refuse_another_shape("Check the numbering of the cylinders: blocks_mm are 1–2, 2–3, 3–1", where)

    def shape(self, sizes: Floats) -> Floats:
        """See :meth:`Rigid.shape`: corners of the triangle that the dimensions close to."""
        body = corners(SIDES_OF_DIMENSIONS @ sizes)[self._corner] * self.expansion[:, None]
        return np.asarray(body - self.placings.means(body), dtype=np.float64)

    def own_faults(self) -> Iterable[Effect]:
        """See :meth:`Artefact.own_faults`: by the uncertainty of its blocks and cylinders."""
        body = Body.of(self.points, corners(self.standard.sides)[self._corner])
        u_um = float(np.hypot(self._facts.u_blocks_um, self._facts.u_cylinders_um))
        return faults(self._facts, self.points, body, by_certificate(u_um, _WRONG_UM), geometry=AFFINE)

    def size_change(self) -> Floats:
        """See :meth:`Artefact.size_change`."""
        change = corner_changes(self.standard.sides)[self._corner] * self.expansion[:, None, None]
        return np.asarray((change - self.placings.means(change)).reshape(-1, len(DIMENSIONS)), dtype=np.float64)


def _refuse_missing_corners(points: Points, where: str | None) -> None:
    if np.any(other := ~np.isin(points.point, (1, 2, 3))):
        raise CmmUqError(f"there is a point {points.point[np.argmax(other)]}: a triangle has 1, 2, 3",
                         where=place(points, other, where), fix="Number the cylinders as in blocks_mm")  # fmt: skip
    counts = np.bincount(points.group)
    if np.any(short := counts[points.group] < 3):
        row = int(np.argmax(short))
        present = points.point[points.group == points.group[row]]
        missing = sorted({1, 2, 3} - set(present.tolist()))[0]
        raise CmmUqError(
            f"measurement {points.measurement[row]}, repeat {points.repeat[row]} has no point {missing}: the triangle does "
            "not close",
            where=place(points, short, where),
            fix="Record all three cylinders, or leave out the measurement",
        )
