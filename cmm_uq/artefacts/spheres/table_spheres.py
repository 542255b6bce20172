"""Spheres on a turning table, whose centres are free but stay where they are on it: observed, planned, stated.

Each point is the centre of a sphere at one position of the table, numbered by ``repeat``. What the coordinates of a sphere do
about their mean while the table turns is what the machine and its table err: along the radius, the tangent and the axis.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from cmm_uq.analysis.planning.set_up import SetUp
from cmm_uq.analysis.planning.setting import Planning, Setting, Start
from cmm_uq.analysis.screening.shape import ArtefactShape, Screening
from cmm_uq.artefacts.kinds import TableSpheresFacts
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.messages import Text, Verbatim, number, say
from cmm_uq.base.points import AXES, Floats, Machine, Points
from cmm_uq.base.rotary import Turntable
from cmm_uq.base.units import MICROMETRE, unit
from cmm_uq.certificate.document import Plot, Section, Table, columns, figure_columns
from cmm_uq.certificate.plots.residuals import deviations_plot
from cmm_uq.certificate.result import Page, Result
from cmm_uq.jobs.tables.artefact import ArtefactFacts
from cmm_uq.machine.model.artefact import Artefact, ArtefactFigure, Placings
from cmm_uq.machine.model.recorded import place
from cmm_uq.maths.inference.linear_model import Freedoms
from cmm_uq.maths.uncertainty.quantity import rounded

FIGURES = ("FR", "FT", "FA")  # ranges along the radius, the tangent and the axis
_DIRECTIONS = (say("radial"), say("tangential"), say("axial"))
_STRAY, _ON_AXIS = 5.0, 1.0  # mm by which no table errs; from the axis within which a sphere has no radius
_TURN, POSITIONS = 720.0, 7  # degrees out and back, and positions of the table in each sense


class TableSpheres(Artefact):
    """Spheres as recorded: three observations (radial, tangential, axial) of each of n centres."""

    kind = "table_spheres"
    title = say("Spheres on a rotary table")

    def __init__(self, facts: TableSpheresFacts, points: Points, *, where: str | None = None) -> None:
        self.points = points
        self.machine = _turning(points.machine)
        self.angle = points.columns.get(self.machine.column)
        if self.angle is None:
            problem, fix = f"no column {self.machine.column!r}: at which angle of the table each centre lay", "Add it"
            raise CmmUqError(problem, where=where or "recording", fix=fix)
        of = np.column_stack([points.measurement, points.point])
        each, index = np.unique(of, axis=0, return_inverse=True)
        self.spheres, self.placings = each, Placings(index.ravel().astype(np.int64), each[:, 0].astype(np.int64))
        self.rows = np.repeat(np.arange(len(points)), 3)[:, None]
        away = self.placings.means(points.xyz) - self.machine.pivot
        self.axial = away[:, self.machine.about].copy()
        away[:, self.machine.about] = 0.0
        self.radius = np.linalg.norm(away, axis=1)
        self._refuse_no_turn(where)
        radial, axis = away / self.radius[:, None], np.eye(3)[self.machine.about]
        self.axes = np.stack([radial, np.cross(axis, radial), np.broadcast_to(axis, radial.shape)], axis=1)

    def fit(self, true_xyz: Floats, sizes: Floats) -> Floats:
        return self.placings.means(true_xyz)

    def project(self, xyz: Floats, displacement: Floats) -> Floats:
        return np.asarray((self.axes @ displacement).reshape(3 * len(xyz), -1), dtype=np.float64)

    def placing(self, xyz: Floats) -> Freedoms:
        return self.placings.columns(self.axes)

    def unread(self) -> NDArray[np.bool_]:
        return self.placings.unread(self.points.xyz, self.axes.transpose(0, 2, 1)).ravel()

    def words_of(self, observation: int) -> Text:
        what = _DIRECTIONS[observation % 3]
        return say("the {direction} coordinate of {what}", direction=what, what=super().words_of(observation))

    def deviations(self) -> Floats:
        """(n, 3) mm of each centre about the mean of its sphere: radial, tangential, axial."""
        about = self.points.xyz - self.placings.means(self.points.xyz)
        return np.asarray(np.einsum("nij,nj->ni", self.axes, about))

    def figures(self, counts: NDArray[np.bool_]) -> Mapping[str, ArtefactFigure]:
        """Range of each sphere's coordinates over all positions of the table, by direction."""
        every = [own for rows in self.placings.rows if len(own := rows[counts[rows]]) > 1]
        if not every:
            return {}
        rows = np.array([np.resize(own, len(self.points)) for own in every])
        names = tuple(sphere_name(int(self.points.point[own[0]])) for own in every)
        lengths, deviations = self.radius[rows[:, 0]], self.deviations()
        return {
            name: ArtefactFigure(np.array([np.ptp(deviations[own, k]) for own in every]), rows, lengths, names=names)
            for k, name in enumerate(FIGURES)
        }

    def _refuse_no_turn(self, where: str | None) -> None:
        points = self.points
        stray = np.linalg.norm(points.xyz - self.placings.means(points.xyz), axis=1)
        if stray.max(initial=0.0) > _STRAY:
            row, other = int(np.argmax(stray)), "table" if self.machine.recorded_in_machine else "machine"
            raise CmmUqError(
                f"sphere {points.point[row]} does not stay where it is on the table: it goes {stray[row]:.4g} mm away",
                where=place(points, np.arange(len(points)) == row, where),
                fix=f'Number the same sphere by the same point, or give coordinates = "{other}", turns or axis_mm in '
                "[machine.table]",
            )
        for load in np.unique(points.measurement).tolist():
            own = [rows for rows, (m, _) in zip(self.placings.rows, self.spheres.tolist(), strict=True) if m == load]
            middles = np.array([points.xyz[rows].mean(axis=0) for rows in own])
            if len(own) > 1 and np.ptp(middles, axis=0).max() < _ON_AXIS:
                raise CmmUqError(
                    f"the spheres of measurement {load} lie in one place",
                    where=where or "recording",
                    fix="Record the centre of each sphere",
                )
        if np.any(rows := self.radius < _ON_AXIS):
            raise CmmUqError(
                f"sphere {points.point[np.argmax(rows)]} lies on the axis of the table, so it has no radius",
                where=place(points, rows, where),
                fix="Mend axis_mm in [machine.table]",
            )


def _turning(machine: Machine) -> Turntable:
    if isinstance(machine, Turntable):
        return machine
    fix = 'Give it in [machine], such as chain = "XYZ|C"'
    raise CmmUqError("the machine has no rotary table in its chain", where="job.toml [machine] chain", fix=fix)


def sphere_name(point: int) -> Text:
    """``sphere A`` is point 1."""
    return say("sphere {name}", name=Verbatim(chr(64 + point) if 1 <= point <= 26 else str(point)))


def shape_of(facts: ArtefactFacts, points: Points) -> ArtefactShape | None:
    of = Placings.of(
        np.unique(np.column_stack([points.measurement, points.point]), axis=0, return_inverse=True)[1].ravel()
    )
    extent = float(np.ptp(points.xyz, axis=0).max(initial=0.0))
    return ArtefactShape(of.rows, _about_median, np.nan, extent, False, (), np.zeros((len(points), 0)))


def _about_median(xyz: Floats, _: Floats, size: float) -> Floats:
    return np.asarray(np.linalg.norm(xyz - np.median(xyz, axis=0), axis=1))


SCREENING = Screening(shape_of, balls=True)


def positions(machine: Turntable) -> tuple[Floats, Floats]:
    """Angles of the table, out from 0 over two turns, or over its travel, and back, °; and the senses of turning."""
    low, high = np.where(np.isnan(machine.travel_deg), [-np.inf, np.inf], machine.travel_deg)
    far = min(max(_TURN, float(low) + _TURN), float(high))
    start = max(far - _TURN, float(low))
    out = np.linspace(start, far, POSITIONS + 1)
    return np.concatenate([out, out[-2::-1]]), np.repeat([0.0, 1.0, -1.0], [1, POSITIONS, POSITIONS])


def two_spheres(setting: Setting, *, radius: float = 1.0, height: float = 1.0, turn: float = 0.0) -> SetUp:
    """A low and a high sphere on opposite sides of the axis, by parts of the radius and height of the job."""
    machine, facts = _turning(setting.machine), cast("TableSpheresFacts", setting.artefact)
    angles, senses = (np.tile(each, setting.plan.repeats) for each in positions(machine))
    about = machine.about
    out = np.roll(np.array([0.0, np.cos(turn), np.sin(turn)]), about) * facts.radius_mm * radius
    low = machine.pivot + np.eye(3)[about] * facts.low_mm
    pair = np.array([low + out, low - out + np.eye(3)[about] * facts.height_mm * height])
    n = len(angles)
    columns = {machine.column: np.repeat(angles, 2), f"{machine.letter}_approach": np.repeat(senses, 2)}
    ones, visit = np.ones(2 * n, dtype=np.int64), np.repeat(np.arange(1, n + 1), 2)
    points = Points(np.tile(pair, (n, 1)), ones, np.tile([1, 2], n), visit, machine, columns)
    box, there = setting.volume.box, points.machine_xyz
    if np.any(beyond := (there < box[:, 0] - 1e-6) | (there > box[:, 1] + 1e-6)):
        axis = AXES[int(np.argmax(beyond.any(axis=0)))]
        raise CmmUqError(
            f"the spheres would leave the volume along {axis.upper()} as the table turns",
            where="job.toml [plan]",
            fix="Make radius_mm or height_mm smaller, or mend axis_mm or low_mm",
        )
    title = say(
        "radius {radius:.0f} mm, height difference {height:.0f} mm, at {turn:.0f}°",
        radius=facts.radius_mm * radius,
        height=facts.height_mm * height,
        turn=np.degrees(turn),
    )
    return SetUp(title, points)


def _candidates(setting: Setting, start: Start | None) -> tuple[SetUp, ...]:
    """The spheres farther in, lower, and a quarter of a turn on."""
    parts = [(r, h, turn) for r in (1.0, 0.5) for h in (1.0, 0.5) for turn in (0.0, 0.5 * np.pi)]
    return tuple(two_spheres(setting, radius=r, height=h, turn=turn) for r, h, turn in parts)


PLANNING = Planning({"ISO 10360-3": lambda setting: (two_spheres(setting),)}, _candidates)


def results(result: Result) -> dict[str, Any]:
    artefact = cast("TableSpheres", result.artefact)
    found, points = artefact.figures(np.ones(len(artefact.points), dtype=bool)), artefact.points
    each = []
    for i, (first, *_) in enumerate(artefact.placings.rows):
        one: dict[str, Any] = {"measurement": int(points.measurement[first]), "point": int(points.point[first])}
        one |= {"radius_mm": float(artefact.radius[first]), "height_mm": float(artefact.axial[first])}
        each.append(one | {f"{name}_um": float(found[name].values[i]) / MICROMETRE for name in FIGURES})
    return {"spheres": each}


def sections(result: Result) -> list[Section]:
    artefact = cast("TableSpheres", result.artefact)
    plots = [_over_positions(result, artefact, k) for k in range(3)]
    return [Section(say("Four-axis errors"), (_table(result), *plots))]


def _table(result: Result) -> Table:
    rows = [
        (
            say("measurement {number}, {sphere}", number=one["measurement"], sphere=sphere_name(one["point"])),
            *(number(one[name], ".1f") for name in ("radius_mm", "height_mm")),
            *(rounded(one[f"{name}_um"], result.noise.expanded / 2)[0] for name in FIGURES),
        )
        for one in results(result)["spheres"]
    ]
    places, ranges = figure_columns(say("Radius"), say("Height"), unit=unit("mm")), map(Verbatim, FIGURES)
    note = say(
        "Range of the coordinate of the centre on the table over all its positions: along the radius (FR), the tangent (FT) "
        "and the axis (FA), as recorded. Radius and height are from the stated point of the axis."
    )
    heads = columns([say("Sphere"), *places, *figure_columns(*ranges, unit=unit("µm"))])
    return Table(say("Ranges"), heads, tuple(rows), (note,))


def _over_positions(result: Result, artefact: TableSpheres, k: int) -> Plot:
    before, direction = artefact.deviations()[:, k] / MICROMETRE, _DIRECTIONS[k]
    caption = say(
        "{direction:capital} coordinate of each centre about the mean of its sphere, with U (k = {k}).",
        direction=direction,
        k=number(result.noise.coverage_factor, ".2f"),
    )
    return deviations_plot(
        result, before, say("{count} centres deviate", count=len(before)),
        say("{direction} from the mean of their sphere", direction=direction), position=artefact.points.repeat,
        after_um=result.residuals[k::3] / MICROMETRE, flagged=result.flagged[k::3], reference=say("mean of the sphere"),
        position_label=say("Position of the table, in order"), caption=caption,
    )  # fmt: skip


PAGE = Page(sections, results)
