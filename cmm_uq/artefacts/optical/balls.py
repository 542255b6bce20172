"""Balls as a laser digitizer scans them: centres with their uncertainty, what of each is seen, and what its form does."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from typing import Any, cast

import numpy as np

from cmm_uq.artefacts.digitizer import ANGLES, scan_of
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.messages import Text, Verbatim, number, say, signed
from cmm_uq.base.points import AXES, Floats, Ints, Points
from cmm_uq.base.units import MICROMETRE, unit
from cmm_uq.base.values import dataclass
from cmm_uq.certificate.document import Column, Table, figure_columns
from cmm_uq.certificate.wording import numbered
from cmm_uq.machine.model.recorded import columns_needed, place
from cmm_uq.machine.physics.effects.probing import attitudes
from cmm_uq.maths.geometry import Sphere, fit_sphere
from cmm_uq.maths.geometry.feature import BallForm

BALL = "ball"  # column that says which ball of its bar a scanned point is of
FEWEST = 10  # points of a ball
_ROUGH = 0.01  # rms of points about their sphere, over its radius, from which on they are of no sphere
_LEAST_SEEN = 15.0  # degrees from the middle of what is seen of a ball to its edge


@dataclass(frozen=True, eq=False)
class ScannedBall:
    """One ball as one scan found it; its centre with the offset by the job, in the frame of the readings."""

    measurement: int
    repeat: int
    ball: int
    angles_deg: tuple[float, ...]
    attitude: Floats  # (3, 3) columns u, v, w in machine axes
    sphere: Sphere
    directions: Floats  # (n, 3) from the centre to the points
    reading: Floats  # (3,) mean of the scale readings, mm
    gradient: Floats  # (3, 3, 3) shift of the centre for a gradient of the error along axis a: K[a] @ ∂e/∂a
    form_mm: float  # largest less smallest diameter, as stated

    @cached_property
    def middle(self) -> Floats:
        """(3,) direction of the middle of what is seen."""
        middle = self.directions.mean(axis=0)
        return np.asarray(middle / np.linalg.norm(middle))

    @property
    def seen_deg(self) -> float:
        """From there to the edge."""
        return float(np.degrees(np.arccos(np.clip((self.directions @ self.middle).min(), -1.0, 1.0))))

    @property
    def view_deg(self) -> float:
        """Angle between the line of sight and that middle."""
        return float(np.degrees(np.arccos(np.clip(self.middle @ self.attitude[:, 1], -1.0, 1.0))))

    @property
    def figures_um(self) -> dict[str, float]:
        """Uncertainty of the centre by the scatter of the points, what these leave; and what the stated form makes of it.

        Uncertainties are of the least certain direction; the shift is towards the digitizer, of a ball that is prolate along
        the middle of what is seen.
        """
        n, form = self.directions, BallForm(self.form_mm)
        u, by_form = (
            float(np.sqrt(np.linalg.eigvalsh(each[:3, :3])[-1]))
            for each in (self.sphere.covariance, form.covariance(n))
        )
        found = {"u": u, "rms": self.sphere.rms, "form": self.sphere.form_deviation}
        if self.form_mm:
            found |= {"u_by_form": by_form, "shift": float(form.shift(n, self.middle)[:3] @ self.middle)}
        return {name: value / MICROMETRE for name, value in found.items()}

    def as_data(self) -> dict[str, Any]:
        numbers = {name: getattr(self, name) for name in ("measurement", "repeat", "ball", "seen_deg", "view_deg")}
        angles, sphere = dict(zip(ANGLES, self.angles_deg, strict=True)), self.sphere
        found = {"points": len(self.directions), "centre_mm": sphere.centre.tolist(), "radius_mm": sphere.radius}
        covariance = {"covariance_xyzr_mm2": sphere.covariance.tolist()}
        return {**numbers, **angles, **found, **covariance, **{f"{k}_um": v for k, v in self.figures_um.items()}}


def carried(points: Points, offset: Floats) -> Floats:
    """(n, 3) from the mount to each scanned point, mm, in machine axes."""
    seen = np.column_stack([cast("Floats", scan_of(points)), np.zeros(len(points))]) - offset
    return np.asarray(np.einsum("nij,nj->ni", attitudes(points), seen), dtype=np.float64)


def scanned_ball(points: Points, offset: Floats, form_um: float, where: str | None) -> ScannedBall:
    numbers = int(points.measurement[0]), int(points.repeat[0]), int(points.columns[BALL][0])
    whose, here = f"measurement {numbers[0]}, ball {numbers[2]}", place(points, np.ones(len(points), dtype=bool), where)
    angles = columns_needed(points, ANGLES, "digitizer", where)
    if np.ptp(angles, axis=0).any():
        raise CmmUqError(f"{whose} is seen in several attitudes", where=here, fix="Scan each ball in one attitude")
    if len(points) < FEWEST:
        fix = f"Scan at least {FEWEST} of each ball, over as much of it as the digitizer sees"
        raise CmmUqError(f"{whose} has {len(points)} points, too few for a sphere", where=here, fix=fix)
    fix = (
        "Check the units of u_mm, v_mm and the readings, the Euler angles, and which points are of which ball; scan as much "
        "of it as the digitizer sees, moving the machine across it"
    )
    seen, reading = points.xyz + carried(points, offset), points.xyz.mean(axis=0)
    try:
        sphere = fit_sphere(seen)
    except CmmUqError as error:
        raise CmmUqError(f"{whose}: {error.problem}", where=here, fix=fix) from error
    n = (seen - sphere.centre) / np.linalg.norm(seen - sphere.centre, axis=1, keepdims=True)
    P = np.linalg.pinv(np.column_stack([n, np.ones(len(n))]))[:3]
    gradient = np.einsum("ik,kj,ka->aij", P, n, points.xyz - reading)
    E, form_mm = attitudes(points)[0], form_um * MICROMETRE
    ball = ScannedBall(*numbers, tuple(angles[0].tolist()), E, sphere, n, reading, gradient, form_mm)
    if sphere.rms > _ROUGH * sphere.radius:
        problem = f"the points of {whose} lie on no sphere: {sphere.rms:.3g} mm rms about the nearest one"
        raise CmmUqError(problem, where=here, fix=fix)
    if ball.seen_deg < _LEAST_SEEN:
        problem = f"{whose} is seen to {ball.seen_deg:.0f}° from the middle of its points, too little for a centre"
        raise CmmUqError(problem, where=here, fix=fix)
    return ball


_ROWS_SHOWN = 60


def ball_table(balls: Sequence[ScannedBall], form_um: float) -> Table:
    """Centres with what their points say, and what the form of the balls makes of them."""
    rows = []
    for one in balls[:_ROWS_SHOWN]:
        name = numbered(one.measurement, one.repeat if one.repeat > 1 else None), number(one.ball)
        places = (*(signed(value, ".4f") for value in one.sphere.centre), number(one.sphere.radius, ".4f"))
        figures = (signed(value, ".1f") for value in one.figures_um.values())
        rows.append((*name, *places, *figures, number(one.view_deg, ".0f"), number(one.seen_deg, ".0f")))
    coordinates = (Column(Verbatim(axis), unit("mm")) for axis in AXES)
    heads = (Column(say("Position"), numeric=False), Column(say("Ball")), *coordinates)
    of_form = figure_columns(say("u by form"), say("Shift"), unit=unit("µm")) if form_um else ()
    scatter = figure_columns(say("u"), say("Rms"), say("Form"), unit=unit("µm"))
    angles = figure_columns(say("View"), say("Seen"), unit=unit("°"))
    columns = (*heads, Column(say("Radius"), unit("mm")), *scatter, *of_form, *angles)
    meaning = say(
        "u: standard uncertainty of the centre in its least certain direction, by the scatter of its points alone. Rms and "
        "form: of the points about their sphere, root mean square and range. View: angle between the line of sight and the "
        "middle of what is seen. Seen: from there to the edge."
    )
    notes: list[Text] = [meaning]
    if form_um:
        by_form = say(
            "Balls whose diameters differ by {form:g} µm: u by form, the standard uncertainty of the centre if the axis of "
            "such a ball may point anywhere; shift, of the centre towards the digitizer if the ball is that much longer along "
            "the line to the middle of what is seen, and as much away from it if it is shorter. What changes from scan to "
            "scan is in the scatter of the lengths, and so in U.",
            form=form_um,
        )
        notes.append(by_form)
    if (left := len(balls) - _ROWS_SHOWN) > 0:
        notes.append(say("{left} more balls are in results.json.", left=left))
    return Table(say("Centres of the balls"), columns, tuple(rows), tuple(notes))


def balls_of(points: Points, where: str | None) -> tuple[Ints, Ints]:
    """Which ball each scanned point is of, both of a bar in turn, and the first point of each ball."""
    ball = columns_needed(points, (BALL,), "scanned bar", where)[:, 0]
    if (wrong := ~np.isin(ball, (1, 2))).any():
        problem, fix = f"ball is {ball[wrong][0]:g}, and a bar has 1 and 2", "Number the balls of each bar 1 and 2"
        raise CmmUqError(problem, where=place(points, wrong, where), fix=fix)
    key = np.column_stack([points.measurement, points.repeat, ball])
    known, first, index = np.unique(key, axis=0, return_index=True, return_inverse=True)
    bars, counts = np.unique(known[:, :2], axis=0, return_counts=True)
    if (counts < 2).any():
        measurement, repeat = bars[counts < 2][0].astype(int)
        rows = (points.measurement == measurement) & (points.repeat == repeat)
        problem = f"measurement {measurement}, repeat {repeat} has one ball, a bar has 1 and 2"
        raise CmmUqError(problem, where=place(points, rows, where), fix="Scan both balls, or leave out the measurement")
    return index.ravel().astype(np.int64), first.astype(np.int64)
