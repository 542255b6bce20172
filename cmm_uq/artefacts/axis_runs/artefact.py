"""Runs along axes: an instrument reads how far, or by how much it turned, at positions of the machine.

A laser interferometer reads the displacement of its moving optics along its beam, straightness optics or a straightedge one
across it; angular optics, a level or an autocollimator a rotation. A rotation is the difference of two displacements an arm
apart, so that the machine's kinematics, with the offset of the optics from the ram (Abbe), say what every reading sees.
The zero of a run is free, of a straightness its slope too. Positions are targets; the errors are in the readings.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cmm_uq.artefacts.axis_runs.denied import refuse_denied
from cmm_uq.artefacts.axis_runs.kind import READ, TURN, AxisRunsFacts
from cmm_uq.artefacts.axis_runs.run import (
    ACROSS,
    ALONG,
    CIRCLE,
    END,
    FACE,
    READINGS,
    START,
    TARGET,
    TURNING,
    ZERO,
    Run,
    circle_axes,
    faces_of,
    kinds_of,
    profiles,
    reference_shape,
    reversed_profile,
    roughness,
    runs_of,
    scatter,
    senses_of,
    squares,
    tables_of,
)
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.messages import Text, say
from cmm_uq.base.points import AXES, Floats, Ints, Points
from cmm_uq.base.rotary import RotaryMachine
from cmm_uq.base.units import ARCSECOND, METRE, MICROMETRE, unit
from cmm_uq.machine.model.artefact import Artefact, Placings, Size, without_uncertainty
from cmm_uq.machine.model.recorded import expansion, refuse
from cmm_uq.machine.physics.effects.drives import index_change
from cmm_uq.maths.geometry.positioning import CircularTest, PositioningRuns

_FAR = {False: 2000.0, True: 3600.0}  # µm or ″ beyond which a reading is in another unit
# of the scatter of repeats, and readings off their neighbours, from which on these weigh the kinds of reading against each
# other; and what ratio of the latter may be chance
_LEAST_DOF, _LEAST_ROUGH, _ALIKE = 10, 30, 2.0
_SAME_MM = 1e-6


class AxisRuns(Artefact):
    """One observation a reading.

    ``facts`` what the job says of the instrument; ``points`` the recording, or the points of such an artefact, displaced. Its
    own points are where the machine would stand if the instrument read nothing but targets; a reading of a rotation has a
    second one, the other end of the arm.
    """

    kind = "axis_runs"
    title = say("Runs along axes")
    curves = True

    def __init__(self, facts: AxisRunsFacts, points: Points, *, where: str | None = None) -> None:
        self._facts, self.moving = facts, facts.on_the_fly is not None
        if END not in points.columns:
            points = self._with_ends(points, where)
        self.points, self._ends = points, _ends_of(points)
        end = points.columns[END] > 0
        self.rows = np.flatnonzero(~end)[:, None]
        own = points.select(~end)
        self.runs = runs_of(own, where)
        self.angular = any(run.table for run in self.runs)
        self._zeros, self._own = self._zeros_of(own), own
        self._polygon = tuple(run for run in self.runs if run.table and FACE in own.columns)
        self._kind = kinds_of(self.runs, len(own))
        self._turned, self._ends = np.flatnonzero(self._kind == TURNING), self._ends[self._kind == TURNING]
        self._sense, _ = senses_of(self.runs, len(own))
        self._base, free = np.zeros(len(own)), np.zeros((len(own), 3))
        turned, square = squares(own, self.runs, where)
        for run in self.runs:
            free[run.rows, 0] = float(run.kind != CIRCLE or facts.u_bar_um is None)
            if run.kind == ALONG:
                self._base[run.rows] = run.positions * np.sign(run.sense @ run.travel)
            elif run.kind == CIRCLE:
                self._base[run.rows] = own.columns[TARGET][run.rows]
                free[run.rows, 1:] = run.sense @ circle_axes(run)
            elif run.kind == ACROSS and not turned[run.rows].any():
                free[run.rows, 1] = run.positions / max(float(run.positions.max()), _SAME_MM) - 0.5
        self._base *= expansion(facts, own)
        edges = profiles(own, self.runs)
        edge = np.any(edges != 0, axis=1)
        freedoms = np.hstack([*(self._zeros.columns(each[:, None]).dense() for each in free.T), turned, edges])
        self._freedoms = freedoms[:, np.any(freedoms != 0, axis=0)]
        self.readings = self._base - self._seen(points.xyz[:, :, None])[:, 0]
        zero = own.columns[ZERO] - self._zeros.means(self.readings)
        self.readings += np.where(free[:, 0] > 0, zero, 0.0)
        self._profile, self._u_faces = reversed_profile(own, self.runs, self.readings, where), np.zeros(len(own))
        if self._polygon:
            read, certified = self.readings / self._factor(turns=True), facts.u_polygon_arcsec is not None
            faces, self._u_faces = faces_of(own, self._polygon, read, where, certified=certified)
            self._profile += self._factor(turns=True) * faces
        spans = [np.ptp(self._base[run.rows]) for run in self.runs if run.kind == ALONG]
        self._length: tuple[Size, ...] = ()
        if spans:
            span, stated = float(max(spans)), facts.u_scale_um_per_m
            sd = np.inf if stated is None else MICROMETRE * stated * span / METRE
            title = say("Longest displacement by the instrument")
            self._length = (Size("length_mm", title, unit("mm"), span, sd, title),)
        further = list(self._references(square, edge, where))
        self.exact = tuple(self._taken_as_exact(edge))
        self._shapes = -np.column_stack([shape for _, shape in further]) if further else np.zeros((len(own), 0))
        self.sizes = (*self._length, *(size for size, _ in further))
        self.noise_scale = self._noise_scale()

    def _with_ends(self, points: Points, where: str | None) -> Points:
        n, runs = len(points), runs_of(points, where)
        kind, (sense, arm) = kinds_of(runs, n), senses_of(runs, n)
        turning, table = kind == TURNING, tables_of(runs, n, where)
        turned, (target, start) = np.flatnonzero(turning), np.zeros((2, n))
        for run in runs:
            target[run.rows], start[run.rows] = run.positions, run.radius or run.start
            if run.kind == CIRCLE:
                middle = (points.xyz[run.rows] - run.radius * run.sense).mean(axis=0)
                target[run.rows] = run.radius + run.sense @ middle
        readings = self._in_mm(points, kind, target, where)
        if len(points.lines):
            refuse_denied(points, runs, readings, where)
        for run in runs if len(points.lines) else ():
            low, high = (float(end(run.positions + run.start)) for end in (np.min, np.max))
            outside = [t for t in self._targets(run) if not low - _SAME_MM <= t <= high + _SAME_MM]
            if outside:
                problem = f"target {outside[0]:g} mm lies outside the readings of measurement {run.measurement}"
                fix = f"Name targets from {low:g} to {high:g} mm"
                raise CmmUqError(problem, where=f"job.toml [artefact.on_the_fly] {run.axis}", fix=fix)
        zero = self._zeros_of(points).means(readings)
        if self._facts.u_bar_um is not None:
            zero[kind == CIRCLE] = 0.0
        shift = (readings - zero)[:, None] * sense
        optics = zip(AXES, self._facts.optics_mm, strict=True)
        given = np.column_stack([points.columns.get(f"tip_{a}_mm", np.full(n, at)) for a, at in optics])
        along = self._facts.arm_mm * arm
        tip = np.vstack([given, (given + (1 - table[:, None]) * along)[turned]])
        whole = points.select(np.concatenate([np.arange(n), turned]))
        xyz = whole.xyz.copy()
        xyz[:n][~turning] -= shift[~turning]
        xyz[n:] += (table[:, None] * along - shift)[turned]
        read = np.where(turning[:, None], 0.0, sense)
        about = np.where(turning[:, None], (1 - 2 * table[:, None]) * np.cross(arm, sense), 0.0)
        more = {name: np.append(each, each[turned]) for name, each in ((TARGET, target), (START, start), (ZERO, zero))}
        more |= {END: (np.arange(len(whole)) >= n).astype(np.float64)}
        for names, values in ((READ, read), (TURN, about)):
            more |= dict(zip(names, np.vstack([values, values[turned]]).T, strict=True))
        more |= {f"tip_{a}_mm": tip[:, i] for i, a in enumerate(AXES)}
        columns = {name: values for name, values in whole.columns.items() if name not in READINGS.values()}
        machine = replace(points.machine, tip_on_every_carriage=True)
        if isinstance(machine, RotaryMachine):
            machine = replace(machine, still=bool(table.any()))
        return replace(whole, xyz=xyz, machine=machine, columns={**columns, **more})

    def _zeros_of(self, points: Points) -> Placings:
        """Which readings have one zero."""
        return Placings.of(points.group if self._facts.zero_each_repeat else points.measurement)

    def _in_mm(self, points: Points, kind: NDArray[Any], target: Floats, where: str | None) -> Floats:
        """Readings (n,), mm; of a rotation times the arm."""
        turning, found = kind == TURNING, np.zeros(len(points))
        for turns, rows, what in ((False, ~turning, "displacements"), (True, turning, "rotations")):
            name, other = READINGS[turns], READINGS[not turns]
            if name not in points.columns and rows.any() and len(points.lines):
                problem, fix = (
                    f"no column {name!r}, which readings of {what} need",
                    f"Add the column {name}, 0 in the rows of",
                )
                raise CmmUqError(problem, where=where or "recording", fix=f"{fix} other readings")
            values = points.columns.get(name, np.zeros(len(points)))
            fix = "Convert it: µm of a displacement less its target, ″ of a rotation (1 µm/m is 0.2063″)"
            refuse(points, rows & (np.abs(values) > _FAR[turns]), where, f"{name} beyond what any machine errs by", fix)
            problem, fix = (
                f"{name} is not 0, and something else is read there",
                f"Put it into {other}, or mend read_x … turn_z",
            )
            refuse(points, ~rows & (values != 0), where, problem, fix)
            found[rows] = self._factor(turns=turns) * values[rows]
        if not self._facts.air_corrected:
            found -= np.where(kind == ALONG, index_change(points) * (target + self._facts.dead_path_mm), 0.0)
        return found

    def _factor(self, *, turns: bool) -> float:
        """A reading's unit, mm."""
        return ARCSECOND * self._facts.arm_mm if turns else MICROMETRE

    def _references(self, square: Floats, edge: Any, where: str | None) -> Iterator[tuple[Size, Floats]]:
        """What is stated of what the instrument reads against, and what (n,) of the readings each changes, mm per unit."""
        facts = self._facts
        if square.any():
            if facts.u_square_arcsec is None:
                fix = "State it (k = 1) in [artefact], or leave the column square out"
                raise CmmUqError("runs against a square, and no u_square_arcsec", where=where, fix=fix)
            title, known = say("Square's angle less 90°"), (facts.square_arcsec, facts.u_square_arcsec)
            yield Size("square_arcsec", title, unit("″"), *known, role="set-up"), ARCSECOND * square
        circles = np.where(self._kind == CIRCLE, -MICROMETRE, 0.0)
        if facts.u_bar_um is not None and circles.any():
            title = say("Length of the ballbar less its certified one")
            yield Size("bar_um", title, unit("µm"), 0.0, facts.u_bar_um, role="set-up"), circles
        yield from self._faces()
        for run in self.runs:
            stated = {ACROSS: facts.u_straightness_um, TURNING: facts.u_rotation_arcsec}.get(run.kind)
            if stated is None or edge[run.rows].any() or run in self._polygon:
                continue
            shape, turns = np.zeros(len(square)), run.kind == TURNING
            shape[run.rows] = self._factor(turns=turns) * reference_shape(run, run.positions)
            title = say("Reference of measurement {number}", number=run.measurement)
            name = f"reference_{run.measurement}_{'arcsec' if turns else 'um'}"
            yield Size(name, title, unit("″" if turns else "µm"), 0.0, stated, role="set-up"), shape

    def _faces(self) -> Iterator[tuple[Size, Floats]]:
        """Deviations of a polygon's faces from that of the first, as certified or free."""
        rows = np.concatenate([run.rows for run in self._polygon]) if self._polygon else np.zeros(0, dtype=np.int64)
        face, u = self._own.columns.get(FACE, np.zeros(0)), self._facts.u_polygon_arcsec
        for number in np.unique(face[rows])[1:].tolist() if len(rows) else ():
            own = np.zeros(len(self._own))
            own[rows[face[rows] == number]] = self._factor(turns=True)
            known = self._profile[np.argmax(own > 0)] / self._factor(turns=True) if u is not None else 0.0
            title = say("Face {number} less the first", number=int(number))
            sd = np.inf if u is None else u
            yield Size(f"face_{number:g}_arcsec", title, unit("″"), known, sd, role="set-up"), own

    def _taken_as_exact(self, edge: Any) -> Iterator[tuple[Text, NDArray[np.bool_]]]:
        """References of kinds of reading, each but a straightedge turned over, of which the job states no uncertainty."""
        for kind, stated, title in (
            (ACROSS, self._facts.u_straightness_um, say("The reference of straightnesses")),
            (TURNING, self._facts.u_rotation_arcsec, say("The reference of rotations")),
        ):
            plain = [run for run in self.runs if run not in self._polygon]
            if stated is None and any(run.kind == kind and not edge[run.rows].any() for run in plain):
                yield without_uncertainty(title), self._kind == kind

    def _noise_scale(self) -> Floats:
        """As repeats show that the scatter of the kinds compares; else as readings are off their neighbours.

        Where too few say it, or neighbours say about the same, of a rotation that of two ends of an arm.
        """
        scale = np.where(self._kind == TURNING, np.sqrt(2.0), 1.0)
        found = self._compared(scatter, _LEAST_DOF)
        if by_neighbours := set(found) != {run.kind for run in self.runs}:
            found = self._compared(roughness, _LEAST_ROUGH)
        if len(found) > 1:
            first, own = next(iter(found.items()))
            for kind, each in found.items():
                usual = scale[self._kind == kind][0]
                shown = each / own * scale[self._kind == first][0]
                if not by_neighbours or not 1 / _ALIKE < shown / usual < _ALIKE:
                    scale[self._kind == kind] = shown
        return scale

    def _compared(self, by: Callable[[Run, Floats, Ints], tuple[float, int]], least: int) -> dict[str, float]:
        """Standard deviation of a reading, mm, of each kind of which enough say it."""
        found = {}
        for kind in (ALONG, ACROSS, TURNING, CIRCLE):
            every = [by(run, self.readings[run.rows], self.repeat[run.rows]) for run in self.runs if run.kind == kind]
            squares, count = (sum(each) for each in zip(*every, strict=True)) if every else (0.0, 0)
            if count >= least and squares > 0:
                found[kind] = float(np.sqrt(squares / count))
        return found

    def _seen(self, displacement: Floats) -> Floats:
        """What the instrument sees, (n, k), of displacements (n + ends, 3, k)."""
        moved = displacement[self.rows[:, 0]].copy()
        moved[self._turned] = displacement[self._ends] - moved[self._turned]
        return np.asarray(np.einsum("ni,nik->nk", self._sense, moved))

    def fit(self, true_xyz: Floats, sizes: Floats) -> Floats:
        target = self._base * (sizes[0] / self.sizes[0].nominal if self._length else 1.0)
        target = target + self._shapes @ sizes[len(self._length) :]
        gap = self.about_zero(target - self._seen(true_xyz[:, :, None])[:, 0])
        placed, step, linear = true_xyz.copy(), gap[:, None] * self._sense, self._kind != TURNING
        placed[self.rows[linear, 0]] += step[linear]
        placed[self._ends] += step[self._turned]
        return placed

    def about_zero(self, values: Floats) -> Floats:
        """Values (n,) less the zero of their run, of a straightness less a line."""
        return np.asarray(values - self._freedoms @ np.linalg.lstsq(self._freedoms, values, rcond=None)[0])

    def project(self, xyz: Floats, displacement: Floats) -> Floats:
        return self._seen(displacement)

    def size_change(self) -> Floats:
        whole = self._base[:, None] / self.sizes[0].nominal if self._length else np.zeros((len(self.rows), 0))
        return np.hstack([whole, self._shapes])

    def passes(self) -> Ints:
        """Each repeat of a measurement: its points are numbered as they are read."""
        return np.unique(np.column_stack([self.measurement, self.repeat]), axis=0, return_inverse=True)[1].ravel()

    def placing(self, xyz: Floats) -> Floats:
        return self._freedoms

    def recorded(self, points: Points, xyz: Floats) -> Points:
        """The machine stands at its targets, and the instrument reads what it errs by."""
        read, turning = self._seen((self.points.xyz - xyz)[:, :, None])[:, 0], self._kind == TURNING
        columns = {}
        for turns in (False, True):
            if np.any(rows := turning == turns):
                own = read / self._factor(turns=turns) + points.columns.get(READINGS[turns], 0.0)
                columns[READINGS[turns]] = np.where(rows, own, 0.0)
        return replace(points, columns={**points.columns, **columns})

    def positioning(self, run: Run) -> PositioningRuns:
        """Readings of a run by target, direction and repeat, µm or ″, for ISO 230-2; of a position actual less target."""
        readings = (self.readings - self._profile)[run.rows] / self._factor(turns=run.kind == TURNING)
        if run.kind == ALONG:
            readings = readings * np.sign(run.sense @ run.travel)
        if run.table:  # as the table's own reading grows
            readings = readings * (run.sense @ run.travel) * self._reads(run.table)
        at, repeat = run.positions + run.start, self.repeat[run.rows]
        read = at, run.directions, repeat, readings
        targets, straight = self._targets(run), run.kind == ACROSS
        if len(targets):
            known = self._facts.on_the_fly.u_delay_um if self._facts.on_the_fly and run.kind == ALONG else 0.0
            found = PositioningRuns.interpolated(targets, *read, straight=straight, u_delay=known)
        else:
            found = PositioningRuns.of(*read, straight=straight)
        growth = reference_shape(run, found.targets)
        if run.kind == ALONG:
            size, span = self.sizes[0], float(np.ptp(found.targets))
            sd = size.sd / size.nominal * span / MICROMETRE if size.certified else 0.0
            travel = tuple(run.travel.tolist())
            return replace(found, axis=run.axis, u_reference=sd, growth=growth, length_mm=span, travel=travel)
        if run.kind == CIRCLE:
            known, arrows = self._facts.u_bar_um, found.arrows.replace("↑", "↺").replace("↓", "↻")
            of_bar = CircularTest(found.targets, found.x, arrows, calibrated=known is not None)
            return replace(of_bar, u_reference=known or 0.0, growth=growth, length_mm=run.radius)
        if run in self._polygon:
            u = self._facts.u_polygon_arcsec
            u = float(np.sqrt(np.mean(self._u_faces[run.rows] ** 2))) if u is None else u
            ones = np.ones(len(found.targets))
            return replace(found, axis=run.table, u_reference=u, growth=ones, by_target=True)
        own = [size for size in self.sizes if size.name.startswith(f"reference_{run.measurement}_")]
        return replace(found, axis=run.table, u_reference=own[0].sd if own else 0.0, growth=growth)

    def _reads(self, letter: str) -> float:
        """Whether a table's reading grows by the right hand: 1, or −1."""
        machine = self.points.machine
        clockwise = isinstance(machine, RotaryMachine) and any(
            t.clockwise for t in machine.tables if t.letter == letter
        )
        return -1.0 if clockwise else 1.0

    def _targets(self, run: Run) -> Floats:
        """At which readings of a run that were taken in motion are evaluated; none of one at rest."""
        fly = self._facts.on_the_fly
        return np.array(getattr(fly, run.axis) if fly and run.axis else [], dtype=np.float64)

    def positionings(self) -> Mapping[int, PositioningRuns]:
        return {run.measurement: self.positioning(run) for run in self.runs if run.kind in (ALONG, CIRCLE) or run.table}


def _ends_of(points: Points) -> Ints:
    """(n,) row of the other end of the arm of each reading, its own of one without; ends without their reading stay."""
    whole = np.column_stack([points.measurement, points.point, points.repeat])
    index = np.unique(whole, axis=0, return_inverse=True)[1].ravel()
    end, of = points.columns[END] > 0, np.full(len(points), -1)
    of[index[end]] = np.flatnonzero(end)
    own = np.flatnonzero(~end)
    return np.where(of[index[own]] < 0, own, of[index[own]])
