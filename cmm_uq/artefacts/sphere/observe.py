"""Sphere: points probed on a ball, whose centre is free in each measurement (ISO 10360-5).

A sphere without a certified diameter cannot tell an error of the effective stylus radius from its own size.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np

from cmm_uq.artefacts.sphere.facts import SphereFacts
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.messages import say
from cmm_uq.base.points import AXES, Floats, Ints, Points
from cmm_uq.base.units import MICROMETRE
from cmm_uq.machine.model.artefact import Forms, Placings
from cmm_uq.machine.model.artefact_doubt import form_faults
from cmm_uq.machine.model.radial import Radial
from cmm_uq.machine.model.recorded import expansion, place
from cmm_uq.machine.physics.effect import Effect
from cmm_uq.maths.geometry import fit_sphere

LARGEST_ANGLE = np.radians(20.0)
"""Between a recorded normal and the direction away from the centre; beyond it the normals belong to something else."""


@dataclass(frozen=True, eq=False)
class ProbedSpheres:
    """Least-squares spheres of a recording, one for each (measurement, repeat).

    Parameters
    ----------
    measurement, repeat : (q,).
    count : (q,) points of each.
    form : (q,) range of the radial distances, mm (ISO 10360-5:2010, P_Form).
    size : (q,) diameter of the least-squares sphere minus the certified one, mm (P_Size); not finite without a certificate.
    centres : (q, 3) of the least-squares spheres, mm.
    """

    measurement: Ints
    repeat: Ints
    count: Ints
    form: Floats
    size: Floats
    centres: Floats


class Sphere(Radial):
    """A probed sphere: ``length_mm`` is its diameter.

    Parameters
    ----------
    facts : what the job says of the sphere.
    points : the recording, with ``nx, ny, nz`` where they are known.

    Attributes
    ----------
    form : form deviation of the ball by its certificate, mm; 0 when it is not given.

    Raises
    ------
    CmmUqError : too few points, points in one plane, normals that do not point away from the centre.
    """

    kind = "sphere"
    title = say("Sphere")
    per_size = 0.5
    size_title = say("Diameter of the sphere")
    size_what = say("diameter")
    plural = "the diameters of the recorded spheres"

    def __init__(self, facts: SphereFacts, points: Points, *, where: str | None = None) -> None:
        super().__init__(facts, points, Placings.of(points.measurement), expansion(facts, points), where)
        self._facts = facts
        self.form = (facts.form_um or 0.0) * MICROMETRE
        if all(f"n{a}" in points.columns for a in AXES):
            self._take_normals(where)

    def own_faults(self) -> Iterable[Effect]:
        """See :meth:`Artefact.own_faults`: its form, by its certificate."""
        return form_faults(self._facts, self._facts.form_um, self.points)

    def probed(self) -> ProbedSpheres:
        """Form and size of each least-squares sphere."""
        runs = Placings.of(self.points.group)
        size = self.sizes[0]
        first, form, diameter, centres = [], [], [], []
        for rows in runs.rows:
            ball = fit_sphere(self.points.xyz[rows], u_point=1.0)
            first.append(rows[0])
            centres.append(ball.centre)
            form.append(ball.form_deviation)
            diameter.append(2 * ball.radius / float(self.expansion[rows].mean()))
        nominal = size.nominal if size.certified else np.nan
        return ProbedSpheres(
            self.points.measurement[first], self.points.repeat[first], runs.sizes, np.array(form),
            np.array(diameter) - nominal, np.array(centres),
        )  # fmt: skip

    def forms(self) -> Forms:
        """See :meth:`Artefact.forms`: ISO 10360-5:2010, P_Form."""
        probed = self.probed()
        directions = self.directions(self.points.xyz)
        size = probed.size if self.sizes[0].certified else None
        return Forms(
            probed.measurement, probed.repeat, probed.count, probed.form, self.form, directions, size, probed.centres
        )  # fmt: skip

    def _take_normals(self, where: str | None) -> None:
        """Normals as recorded, brought to unit length: the probe's errors act along them, and so they are seen exactly."""
        normals = np.column_stack([self.points.columns[f"n{a}"] for a in AXES])
        length = np.linalg.norm(normals, axis=1)
        geometric = self.directions(self.points.xyz)
        wrong = np.einsum("ni,ni->n", normals, geometric) < length * np.cos(LARGEST_ANGLE)
        if np.any(rows := wrong | (length == 0)):
            inward = np.all(np.einsum("ni,ni->n", normals, geometric) < 0)
            raise CmmUqError(
                "nx, ny, nz point into the sphere" if inward else "nx, ny, nz does not point away from the centre",
                where=place(self.points, rows, where),
                fix="Give the outward normal at each probed point" + (": turn all signs round" if inward else ""),
            )  # fmt: skip
        self._normals = normals / length[:, None]
        columns = {f"n{a}": self._normals[:, i] for i, a in enumerate(AXES)}
        self.points = replace(self.points, columns={**self.points.columns, **columns})
