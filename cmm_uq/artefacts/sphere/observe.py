"""What a recording of a test sphere observes and is asked for, and where it is placed.

Sphere: points probed on a ball, whose centre is free in each measurement (ISO 10360-5).

A sphere without a certified diameter cannot tell an error of the effective stylus radius from its own size.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np

from cmm_uq.analysis.planning.candidates import MIDDLE, PatternFor, RelocatedCandidates, VolumeCandidates, upright
from cmm_uq.analysis.planning.set_up import Pattern, SetUp, planned_length
from cmm_uq.analysis.planning.setting import Planning, Setting
from cmm_uq.analysis.screening.shape import (
    ArtefactShape,
    Screening,
    ball_misfit,
    no_references,
    recentred,
    rows_by,
    samples_of,
    spread,
)
from cmm_uq.artefacts.sphere.kind import SphereFacts
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.messages import say
from cmm_uq.base.points import AXES, Floats, Ints, Points
from cmm_uq.base.units import MICROMETRE
from cmm_uq.jobs.tables.artefact import ArtefactFacts
from cmm_uq.jobs.tables.plan import PlanFacts
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
    """Least-squares spheres of a recording, one for each (measurement, repeat)."""

    measurement: Ints  # measurement, repeat: (q,)
    repeat: Ints
    count: Ints  # (q,) points of each
    form: Floats  # (q,) range of the radial distances, mm (ISO 10360-5:2010, P_Form)
    # (q,) diameter of the least-squares sphere minus the certified one, mm (P_Size); not finite without a
    # certificate
    size: Floats
    centres: Floats  # (q, 3) of the least-squares spheres, mm


class SphereArtefact(Radial):
    """A probed sphere: ``length_mm`` is its diameter.

    ``facts`` what the job says of the sphere; ``points`` the recording, with ``nx, ny, nz`` where they are known.
    ``form`` form deviation of the ball by its certificate, mm; 0 when it is not given.
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
        return form_faults(self._facts, self._facts.form_um, self.points)

    def probed(self) -> ProbedSpheres:
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


_NORMAL = 0.4  # part of the radius by which a recorded normal may miss the point: normals may be nominal, 20° off
_NORMALS = tuple(f"n{a}" for a in AXES)


def shape_of(facts: ArtefactFacts, points: Points) -> ArtefactShape | None:
    """Spheres, with normals where they are recorded; ``None`` where one has too few points."""
    rows, radius = rows_by(points.measurement), (facts.length_mm or np.nan) / 2
    if any(len(r) < 5 for r in rows):
        return None
    extent = radius if np.isfinite(radius) else 0.5 * float(np.median([spread(points.xyz[r]) for r in rows]))
    if not all(name in points.columns for name in _NORMALS):
        return ArtefactShape(rows, ball_misfit, radius, extent, False, (), no_references(points))
    normals = np.column_stack([points.columns[name] for name in _NORMALS])
    return ArtefactShape(rows, _ball_with_normals, radius, extent, False, _NORMALS, normals)


def _ball_with_normals(xyz: Floats, normals: Floats, radius: float) -> Floats:
    """Each normal says where the centre lies; their median does not follow a few."""
    if np.isnan(radius):
        i, j = samples_of(len(xyz), 2).T
        steps = normals[j] - normals[i]
        squares = np.sum(steps**2, axis=1)
        if not np.any(wide := squares > 0.5 * squares.max()):
            return np.zeros(len(xyz))
        radius = float(np.median(np.sum((xyz[j] - xyz[i]) * steps, axis=1)[wide] / squares[wide]))
    away = xyz - np.median(xyz - radius * normals, axis=0)
    away, radius = recentred(away, radius, free=False)  # nominal normals put it astray
    misses = np.linalg.norm(away - radius * normals, axis=1) - _NORMAL * abs(radius)
    return np.asarray(np.maximum(np.abs(np.linalg.norm(away, axis=1) - radius), misses), dtype=np.float64)


SCREENING = Screening(shape_of)


RINGS = ((0.0, 1, 0.0), (22.5, 4, 0.0), (45.0, 8, 22.5), (67.5, 4, 0.0), (90.0, 8, 22.5))
"""Points over a hemisphere: degrees from the pole, how many, degrees turned. The usual twenty-five of ISO 10360-5."""


def sphere(facts: ArtefactFacts, plan: PlanFacts) -> Pattern:
    """Twenty-five points over the upper hemisphere, each probed along its normal."""
    normals = []
    for down, count, turn in RINGS:
        polar = np.radians(down)
        azimuth = np.radians(turn) + 2 * np.pi * np.arange(count) / count
        ring = [np.sin(polar) * np.cos(azimuth), np.sin(polar) * np.sin(azimuth), np.full(count, np.cos(polar))]
        normals.append(np.column_stack(ring))
    n = np.vstack(normals)
    one = Pattern(
        0.5 * planned_length(facts, plan) * n, np.arange(1, len(n) + 1), np.ones(len(n), dtype=np.int64), {},
        {"normal": n, "approach": -np.where(np.abs(n) > 1e-9, n, 0.0)},
    )  # fmt: skip
    return one.repeated(plan.repeats)


def sphere_places(setting: Setting) -> tuple[SetUp, ...]:
    """Once in the middle of the volume."""
    pattern = sphere(setting.artefact, setting.plan)
    return (setting.volume.set_up(pattern, np.eye(3), MIDDLE, say("in the middle")),)


def _shape(setting: Setting) -> PatternFor:
    pattern = sphere(setting.artefact, setting.plan)
    return lambda _: pattern


_PLACES = VolumeCandidates(upright, _shape, RelocatedCandidates(lambda volume: []))
PLANNING = Planning({"ISO 10360-5": sphere_places}, _PLACES.candidates, _PLACES.elsewhere)
