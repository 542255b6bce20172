"""Planes scanned by a laser digitizer: its attitude, the Euler angles α, β, γ (Harris 2004 section 4.3), by their flatness.

A point u, v of the scan plane lies at D + E·[u v 0], up to the offset of the mount, which shifts all points of an attitude
alike. All points of one scan lie in a plane, free in height and tilt. A scan with the machine moving across the plane in two
directions tells two of the three angles: planes of different directions are needed, each scan a ``measurement``.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any, cast

import numpy as np

from cmm_uq.artefacts.digitizer import ANGLES, SCAN, check_angles
from cmm_uq.artefacts.kinds import DIGITIZER
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.messages import Text, Verbatim, number, say, signed
from cmm_uq.base.points import AXES, Floats, Machine, Points
from cmm_uq.base.units import unit
from cmm_uq.certificate.document import Column, Section, figure_columns, section, table
from cmm_uq.certificate.origin import quantity_data
from cmm_uq.certificate.result import Page, Result
from cmm_uq.certificate.wording import expanded
from cmm_uq.jobs.tables.artefact import ArtefactFacts
from cmm_uq.machine.model.artefact import Artefact, Placings, Size
from cmm_uq.machine.model.kind import Beginning
from cmm_uq.machine.model.recorded import columns_needed, place
from cmm_uq.machine.physics.kinematics import euler_313
from cmm_uq.maths.geometry import fit_plane
from cmm_uq.maths.inference.linear_model import Freedoms

_FEWEST = 6  # points of a plane
_STEP = 1e-3  # °, of the derivative of a rotation
_ROUGH = 0.05  # rms of points about their plane, over their extent, from which on they are of no plane
_TOLD = 0.05  # least singular value of what the planes tell of the angles, over the largest
_LETTERS = ("α", "β", "γ")


class ScannedPlanes(Artefact):
    """Distance of each scanned point from its plane; sought are α, β, γ of every attitude."""

    kind = "scanned_planes"
    title = say("Scanned planes")

    def __init__(self, facts: ArtefactFacts, points: Points, *, where: str | None = None) -> None:
        check_angles(points, where)
        self._uv = np.column_stack([columns_needed(points, SCAN, "scanned plane", where), np.zeros(len(points))])
        angles = columns_needed(points, ANGLES, "digitizer", where)
        self.indexed, attitude = np.unique(angles, axis=0, return_inverse=True)
        self._attitude = attitude.ravel()
        self.points = replace(points, machine=replace(points.machine, tip_on_every_carriage=True))
        self.planes = Placings.of(points.measurement)
        self.rows = np.arange(len(points))[:, None]
        seen = points.xyz + self._seen(self.indexed)
        self._normals = np.empty((len(points), 3))
        for i, rows in enumerate(self.planes.rows):
            whose = f"measurement {self.planes.numbers[i]}"
            if len(rows) < _FEWEST:
                problem = f"{whose} has {len(rows)} points, too few for a plane"
                fix = f"Scan at least {_FEWEST}, the machine moving in two directions across the plane"
                raise CmmUqError(problem, where=_at(points, rows, where), fix=fix)
            plane = fit_plane(seen[rows])
            if plane.rms > _ROUGH * float(np.linalg.norm(np.ptp(seen[rows], axis=0))):
                fix = "Check the units of u_mm, v_mm and the readings, the Euler angles, and that one measurement is one plane"
                raise CmmUqError(f"the points of {whose} lie in no plane", where=_at(points, rows, where), fix=fix)
            self._normals[rows] = plane.normal
        self._along = seen - self.planes.means(seen)
        self.sizes = tuple(
            Size(f"{name}_{i}", _title(letter, i), unit("°"), float(value), np.inf, role="sought")
            for i, each in enumerate(self.indexed, 1)
            for name, letter, value in zip(ANGLES, _LETTERS, each, strict=True)
        )
        change, freedoms = self.size_change(), self._freedoms()
        for rows in self.planes.rows:  # what heights and tilts do not take up
            change[rows] -= freedoms[rows] @ np.linalg.lstsq(freedoms[rows], change[rows], rcond=None)[0]
        told = np.linalg.svd(change, compute_uv=False)
        if told[-1] < _TOLD * told[0]:
            fix = "Scan three planes of different directions in each attitude, the machine moving two ways across each"
            raise CmmUqError("these planes leave part of α, β, γ open", where=where, fix=fix)

    def fit(self, true_xyz: Floats, sizes: Floats) -> Floats:
        seen = true_xyz + self._seen(sizes.reshape(-1, 3))
        about, placed = seen - self.planes.means(seen), true_xyz.copy()
        for rows in self.planes.rows:
            normal = np.linalg.svd(about[rows], full_matrices=False)[2][2]
            placed[rows] -= np.outer(about[rows] @ normal, normal)
        return placed

    def project(self, xyz: Floats, displacement: Floats) -> Floats:
        return np.asarray(np.einsum("ni,nik->nk", self._normals, displacement))

    def size_change(self) -> Floats:
        found = np.zeros((len(self.rows), len(self.sizes)))
        for k in range(len(self.sizes)):
            step = np.zeros(len(self.sizes))
            step[k] = _STEP
            either = [self._seen(self.indexed + sign * step.reshape(-1, 3)) for sign in (1, -1)]
            found[:, k] = -np.einsum("ni,ni->n", self._normals, either[0] - either[1]) / (2 * _STEP)
        return found

    def placing(self, xyz: Floats) -> Freedoms:
        return self.planes.columns(self._freedoms())

    def _freedoms(self) -> Floats:
        """(n, 3) height and two tilts of each plane, of size one."""
        across = np.linalg.svd(self._normals[:, None, :])[2][:, 1:]
        tilts = np.einsum("nij,nj->ni", across, self._along)
        return np.column_stack([np.ones(len(tilts)), tilts / np.abs(tilts).max()])

    def _seen(self, angles_deg: Floats) -> Floats:
        """(n, 3) from the origin of the scan plane to each point, mm, in machine axes."""
        E = np.array([euler_313(*each) for each in np.radians(angles_deg)])
        return np.asarray(np.einsum("nij,nj->ni", E[self._attitude], self._uv))


def _at(points: Points, rows: Any, where: str | None) -> str:
    return place(points, np.isin(np.arange(len(points)), rows), where)


def _title(letter: str, number: int) -> Text:
    return say("{angle} of attitude {number}", angle=Verbatim(letter), number=number)


def results(result: Result) -> dict[str, Any]:
    found = []
    for i, each in enumerate(cast("ScannedPlanes", result.artefact).indexed, 1):
        angles = {name: quantity_data(result.sizes[f"{name}_{i}"]) for name in ANGLES}
        found.append({"pose": i, **angles, "indexed_deg": each.tolist()})
    return {"attitudes": found}


def sections(result: Result) -> list[Section]:
    planes, rows = cast("ScannedPlanes", result.artefact), []
    for i, each in enumerate(planes.indexed, 1):
        for name, letter, indexed in zip(ANGLES, _LETTERS, each.tolist(), strict=True):
            rows.append((number(i), Verbatim(letter), signed(indexed, "g"), *expanded(result.sizes[f"{name}_{i}"])))
    figures = figure_columns(say("As indexed"), say("Estimate"), say("U"), unit=unit("°"))
    note = say("Euler angles 3-1-3 of the digitizer's axes u, v, w in those of the machine (Harris 2004 eq. 7).")
    return [
        section(
            say("Attitudes"),
            table(say("Euler angles"), (Column(say("Attitude")), say("Angle"), *figures, Column(say("k"))), rows, note),
        )
    ]


PAGE = Page(sections, results)

_PLANES = ((0.0, 0.0, 1.0), (1.0, 0.0, 0.0), (0.5, 0.5, 0.7))  # normals of a first recording's planes


def scans(machine: Machine) -> Points:
    """Three planes about the middle of the volume, seen with α = β = 90°, γ = 30°, the machine moving in all directions."""
    angles, parts = (90.0, 90.0, 30.0), []
    middle = np.array([np.mean(machine.travel(axis)) for axis in AXES]) - machine.origin_mm
    u, v = (part.ravel() for part in np.meshgrid(np.linspace(-15, 15, 4), np.linspace(-15, 15, 4)))
    scan = np.column_stack([u, v, np.zeros(16)]) @ euler_313(*np.radians(angles)).T
    for number_, normal in enumerate(np.array(_PLANES), 1):
        across = np.linalg.svd(normal[None])[2][1:]
        for step in (np.array([-20.0, -20.0]), np.array([20.0, -20.0]), np.array([0.0, 20.0])):
            on = step @ across - scan @ normal[:, None] * normal / (normal @ normal)
            parts.append(np.column_stack([np.full(16, number_), middle + on, np.tile(angles, (16, 1)), u, v]))
    rows = np.vstack(parts)
    measurement = rows[:, 0].astype(np.int64)
    point = np.tile(np.arange(1, 49), 3)
    columns = dict(zip((*ANGLES, *SCAN), rows[:, 4:].T, strict=True))
    return Points(rows[:, 1:4], measurement, point, np.ones_like(point), machine, columns)


_OF_SCANS = cast("Beginning", DIGITIZER.begin)
BEGIN = Beginning(
    title="Attitude of a laser digitizer from three scanned planes",
    numbering="One measurement is one plane in one attitude; its points are scanned points.",
    artefact={"name": "Planes"}, effects=(), noise_um=5.0, points=scans,
    columns={**_OF_SCANS.columns, **_OF_SCANS.further},
)  # fmt: skip
