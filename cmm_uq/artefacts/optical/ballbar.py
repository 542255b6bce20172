"""Ballbar seen by a laser digitizer: the cloud of each ball gives its centre, and the bars where the digitizer is mounted.

With the mount at true coordinates D, the centre of a ball lies at D + c − E·[U1 V1 W1] (Harris 2004 eq. 14–25), c as the fit
of a sphere to the cloud has it. Both ends seen in one attitude, the offset [U1 V1 W1] cancels in their distance; seen in
several it is sought with the errors of the machine. While a ball is scanned the machine moves, by as much as the ball is
large, and its errors distort the cloud. What they do to a centre is linear in their gradient there: a ball is its mean
reading, which observes, and six readings about it, of which differences are taken.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any, cast

import numpy as np

from cmm_uq.analysis.planning.set_up import SetUp
from cmm_uq.analysis.planning.setting import Planning, Setting, Start, Volume
from cmm_uq.analysis.screening import shape
from cmm_uq.analysis.screening.shape import ArtefactShape, Screening
from cmm_uq.artefacts import ballbar
from cmm_uq.artefacts.ballbar import Ballbar
from cmm_uq.artefacts.digitizer import ANGLES, SCAN, THREE, offset_sizes, scan, scan_misfit, scan_of
from cmm_uq.artefacts.digitizer_page import OffsetFigures
from cmm_uq.artefacts.kinds import BallbarFacts
from cmm_uq.artefacts.optical.balls import BALL, FEWEST, ScannedBall, ball_table, balls_of, carried, scanned_ball
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.messages import say
from cmm_uq.base.points import AXES, Floats, Ints, Points
from cmm_uq.base.units import unit
from cmm_uq.certificate.document import Section
from cmm_uq.certificate.result import Result
from cmm_uq.machine.model.artefact import Artefact, Placings, Size
from cmm_uq.machine.model.recorded import expansion, length_of
from cmm_uq.machine.physics.digitizer import THREE_ATTITUDES
from cmm_uq.machine.physics.effects.probing import attitudes
from cmm_uq.machine.physics.kinematics import euler_313
from cmm_uq.maths.geometry.feature import BallForm
from cmm_uq.maths.inference.posterior import symmetric_root

_TOLD = 0.05  # least singular value of what the bars tell of the offset, over the root of their number
_AROUND = np.vstack([np.zeros(3), np.eye(3), -np.eye(3)])  # the readings of a ball, in units of its radius


_APART, _GRADIENT = "_apart", tuple(f"_gradient_{i}" for i in range(27))


def reduced(facts: BallbarFacts, points: Points, where: str | None) -> tuple[tuple[ScannedBall, ...], Points, Ints]:
    """The balls of scans; seven points for each of them, with what is known of it in columns; which ball each point is of."""
    if facts.offset_mm is None:
        fix = "Give [U1, V1, W1] by the drawing or by an earlier calibration, mm"
        raise CmmUqError("where the digitizer is mounted is needed", where="job.toml [artefact] offset_mm", fix=fix)
    of_scan, first = balls_of(points, where)
    placings, offset = Placings.of(of_scan), np.array(facts.offset_mm)
    balls = tuple(scanned_ball(points.select(rows), offset, facts.ball_form_um, where) for rows in placings.rows)
    q, count = len(_AROUND), len(balls)
    reading, apart = np.array([one.reading for one in balls]), np.array([one.sphere.radius for one in balls])
    tip = np.array([one.sphere.centre for one in balls]) - reading
    gradient = np.array([one.gradient.ravel() for one in balls]) / (2 * apart[:, None])
    names = (_APART, *(f"tip_{axis}_mm" for axis in AXES), *_GRADIENT)
    own = np.repeat(first, q)
    columns = {name: placings.means(v)[own] for name, v in points.columns.items() if name not in (BALL, *SCAN)}
    columns |= dict(zip(names, np.repeat(np.column_stack([apart, tip, gradient]), q, axis=0).T, strict=True))
    number = np.repeat([one.ball for one in balls], q) * (np.arange(q * count) % q == 0)
    xyz = (reading[:, None] + apart[:, None, None] * _AROUND).reshape(-1, 3)
    return balls, replace(points.select(own), xyz=xyz, point=number.astype(np.int64), columns=columns), of_scan


class ScannedBallbar(Ballbar):
    """m lengths of 2m scanned balls; each is seven points, of which the first observes.

    ``points``: the scans, or what this made of such.
    """

    title = say("Ballbar of scanned balls")

    def __init__(self, facts: BallbarFacts, points: Points, *, where: str | None = None) -> None:
        self._facts, self._ball_form_um = facts, facts.ball_form_um
        self.balls: tuple[ScannedBall, ...] = ()
        self._of_scan: Ints | None = None
        if _APART not in points.columns:
            self._scan = points
            self.balls, points, self._of_scan = reduced(facts, points, where)
        self.points = replace(points, machine=replace(points.machine, tip_on_every_carriage=True))
        first, columns = np.flatnonzero(points.point), points.columns
        self.rows = first.reshape(-1, 2)
        self._offset = np.array(facts.offset_mm)
        self._attitude = attitudes(points)[first]
        self._apart = columns[_APART][first]
        self._gradient = np.column_stack([columns[name][first] for name in _GRADIENT]).reshape(-1, 3, 3, 3)
        tip = np.column_stack([columns[f"tip_{axis}_mm"][first] for axis in AXES])
        nominal = (points.xyz[first][:, None] + self._apart[:, None, None] * _AROUND).reshape(-1, 3)
        self._centre = points.xyz[first] + tip + self._moved((points.xyz - nominal)[:, :, None])[:, :, 0]
        self.noise_scale = np.full(len(self.rows), np.sqrt(2.0))
        self.expansion = expansion(facts, points)[self.rows].mean(axis=1)
        lengths = self.lengths()
        length, sd = length_of(facts, float(lengths.mean()), "the scanned bars", where)
        dimension = Size("length_mm", say("Length of the bar"), unit("mm"), length, sd, say("length"))
        if not facts.ball_form_um:
            self.exact = ((say("The form of the balls is not stated"), np.ones(len(self.rows), dtype=bool)),)
        self.sizes = (dimension, *(offset_sizes(self._offset) if self._tells_offset(where) else ()))

    def form_changes(self, form: float) -> Floats:
        """What the form of each ball does to its centre, the same in the frame of the digitizer wherever it is seen alike."""
        if not self._ball_form_um or not self.balls:
            return np.zeros((len(self.rows), 0))
        moved = np.zeros((len(self.balls), 3, 6))
        for i, one in enumerate(self.balls):
            covariance = BallForm(one.form_mm).covariance(one.directions)[:3, :3]
            start = 3 * (i % 2)
            moved[i, :, start : start + 3] = one.attitude @ symmetric_root(one.attitude.T @ covariance @ one.attitude)
        return self._along(moved)

    def ends(self) -> Floats:
        return self._centre.reshape(-1, 2, 3)

    def lengths(self) -> Floats:
        return np.asarray(np.linalg.norm(np.diff(self.ends(), axis=1)[:, 0], axis=1) / self.expansion, dtype=np.float64)

    def lines_of(self, rows: Ints) -> tuple[Floats, Floats]:
        ends = self._centre[rows // len(_AROUND)]
        return ends.mean(axis=1), ends[:, 1] - ends[:, 0]

    def fit(self, true_xyz: Floats, sizes: Floats) -> Floats:
        centres = self._centre + self._moved((true_xyz - self.points.xyz)[:, :, None])[:, :, 0]
        if len(sizes) > 1:
            centres = centres - self._attitude @ (sizes[1:] - self._offset)
        bars = centres[1::2] - centres[::2]
        missing = (sizes[0] * self.expansion / np.linalg.norm(bars, axis=1) - 1)[:, None] * bars
        shift = np.stack([-0.5 * missing, 0.5 * missing], axis=1).reshape(-1, 3)
        return np.asarray(true_xyz + np.repeat(shift, len(_AROUND), axis=0), dtype=np.float64)

    def project(self, xyz: Floats, displacement: Floats) -> Floats:
        return self._along(self._moved(displacement))

    def size_change(self) -> Floats:
        offset = self._along(self._attitude)[:, : 3 * (len(self.sizes) > 1)]
        return np.hstack([self.expansion[:, None], offset])

    def recorded(self, points: Points, xyz: Floats) -> Points:
        """The scans with the readings moved as those of their balls are: together, and by the gradient across them."""
        if self._of_scan is None:
            return points.at(xyz)
        moved = (xyz - self.points.xyz).reshape(-1, len(_AROUND), 3)
        slope = (moved[:, 1:4] - moved[:, 4:]) / (2 * self._apart[:, None, None])
        across = points.xyz - np.array([ball.reading for ball in self.balls])[self._of_scan]
        turned = np.einsum("na,nai->ni", across, slope[self._of_scan])
        return points.at(points.xyz + moved[self._of_scan, 0] + turned)

    def tips(self) -> Mapping[str, Floats]:
        scanned = carried(self._scan, self._offset)
        return {f"tip_{axis}_mm": scanned[:, i] for i, axis in enumerate(AXES)}

    def further_sections(self, result: Result) -> list[Section]:
        found = [Section(say("Scanned balls"), (ball_table(self.balls, self._ball_form_um),))]
        if len(self.sizes) > 1:
            found.insert(0, Section(say("Offset of the mount"), (OffsetFigures(result).table(),)))
        return found

    def further_results(self, result: Result) -> dict[str, Any]:
        poses = [dict(zip(("pose", *ANGLES), (i, *each), strict=True)) for i, each in enumerate(self.attitudes, 1)]
        offset = {"digitizer": {**OffsetFigures(result).as_data(), "poses": poses}} if len(self.sizes) > 1 else {}
        return {**offset, "balls": [one.as_data() for one in self.balls]}

    @property
    def attitudes(self) -> tuple[tuple[float, ...], ...]:
        """Euler angles α, β, γ of every attitude, °, in the order in which they come."""
        return tuple(dict.fromkeys(ball.angles_deg for ball in self.balls))

    def _moved(self, displacement: Floats) -> Floats:
        """(2m, 3, k) what displacements (n, 3, k) of the readings make of the centres of the balls, mm."""
        q = len(_AROUND)
        each = displacement.reshape(len(displacement) // q, q, *displacement.shape[1:])
        slope = each[:, 1:4] - each[:, 4:]
        return np.asarray(each[:, 0] + np.einsum("baij,bajk->bik", self._gradient, slope), dtype=np.float64)

    def _along(self, moved: Floats) -> Floats:
        """(m, k) relative displacement along the bars of ends (2m, 3, k)."""
        bars = self._centre[1::2] - self._centre[::2]
        directions = bars / np.linalg.norm(bars, axis=1, keepdims=True)
        return np.asarray(np.einsum("mi,mik->mk", directions, moved[1::2] - moved[::2]), dtype=np.float64)

    def _tells_offset(self, where: str | None) -> bool:
        """Whether the bars tell the offset; refused where they need it, and tell part of it."""
        told = np.linalg.svd(self._along(self._attitude), compute_uv=False)
        if np.abs(np.diff(self._attitude.reshape(-1, 2, 3, 3), axis=1)).max() < 1e-9:
            return False
        planned = not (len(self.points.lines) or np.ptp(self.measurement))  # bar by bar, of which none tells it alone
        if planned or (len(told) == 3 and told[-1] > _TOLD * np.sqrt(len(self.rows))):
            return True
        problem = "the attitudes in which the two ends of the bars are seen leave part of [U1 V1 W1] open"
        both = "one end of a bar in one of them and the other in another, on bars along all axes"
        fix = f"See both ends of each bar in one attitude. To find the offset: {THREE_ATTITUDES}, {both}"
        raise CmmUqError(problem, where=where, fix=fix)


def observe(facts: BallbarFacts, points: Points, *, where: str | None = None) -> Ballbar:
    """A bar whose balls were scanned, or whose centres were recorded."""
    scanned = scan_of(points) is not None or _APART in points.columns
    return (ScannedBallbar if scanned else Ballbar)(facts, points, where=where)


def shape_of(facts: BallbarFacts, points: Points) -> ArtefactShape | None:
    if (uv := scan_of(points)) is None:
        return ballbar.shape_of(facts, points)
    if BALL not in points.columns or any(name not in points.columns for name in ANGLES):
        return None
    rows = shape.rows_by(balls_of(points, None)[0])
    if any(len(one) < FEWEST for one in rows):
        return None
    seen = np.einsum("nij,nj->ni", attitudes(points)[:, :, :2], uv)
    extent = 0.5 * float(np.median([shape.spread((points.xyz + seen)[one]) for one in rows]))
    return ArtefactShape(rows, scan_misfit, np.nan, extent, reference=seen)


SCREENING = Screening(shape_of, balls=True)


_PLANNED_RADIUS = 38.1  # mm, of balls that are not scanned yet
_WAYS = 6  # in which two ends are seen in two of three attitudes


def positions(setting: Setting) -> tuple[SetUp, ...]:
    """Those of a bar; where a digitizer scans it, each end in an attitude of its own, all readings within the volume."""
    if cast("BallbarFacts", setting.artefact).offset_mm is None:
        return ballbar.ballbar_positions(setting)
    scans, within = _scans(setting)
    return tuple(_scanned(placing, scans, i) for i, placing in enumerate(ballbar.ballbar_positions(within)))


def _scans(setting: Setting) -> tuple[list[tuple[Floats, Floats]], Setting]:
    """A ball as each attitude scans it, and the room that its centre has so that all readings are within the volume."""
    offset, volume = np.array(cast("BallbarFacts", setting.artefact).offset_mm), setting.volume
    scans = [scan(euler_313(*np.radians(each)), offset, _PLANNED_RADIUS) for each in THREE]
    reach = np.vstack([moved for _, moved in scans])
    box = volume.box - np.column_stack([reach.min(axis=0), reach.max(axis=0)])
    if np.any(box[:, 0] >= box[:, 1]):
        raise volume.too_small(reach, say("over the three attitudes"))
    return scans, replace(setting, volume=replace(volume, box=box))


def _scanned(placing: SetUp, scans: Sequence[tuple[Floats, Floats]], number: int) -> SetUp:
    """A set-up with both ends scanned, the second in another attitude than the first."""
    ends, parts = placing.points, []
    for row in range(len(ends)):
        which = (number + int(ends.point[row]) * (1 + number // 3 % 2)) % len(THREE)
        uv, moved = scans[which]
        same = np.tile([ends.repeat[row], ends.point[row], *THREE[which]], (len(uv), 1))
        parts.append(np.hstack([ends.xyz[row] + moved, same, uv]))
    rows = np.vstack(parts)
    columns = dict(zip((BALL, *ANGLES, *SCAN), rows[:, 4:].T, strict=True))
    one, repeat = np.ones(len(rows), dtype=np.int64), rows[:, 3].astype(np.int64)
    return replace(placing, points=Points(rows[:, :3], one, np.arange(1, len(rows) + 1), repeat, ends.machine, columns))


def candidates(setting: Setting, start: Start | None) -> tuple[SetUp, ...]:
    """Those of a bar; of one that is scanned each with its ends in two of the three attitudes, in every way."""
    if cast("BallbarFacts", setting.artefact).offset_mm is None:
        return ballbar.PLANNING.candidates(setting, start)
    scans, within = _scans(setting)
    fewer = within.plan.model_copy(update={"candidates": max(1, within.plan.candidates // _WAYS)})
    placings = ballbar.PLANNING.candidates(replace(within, plan=fewer), None)
    return tuple(_scanned(placing, scans, i) for placing in placings for i in range(_WAYS))


def elsewhere(artefact: Artefact, volume: Volume, most: int) -> tuple[SetUp, ...]:
    bar = ballbar.PLANNING.elsewhere
    return () if bar is None or isinstance(artefact, ScannedBallbar) else bar(artefact, volume, most)


PLANNING = Planning(dict.fromkeys(ballbar.PLANNING.ready, positions), candidates, elsewhere)
