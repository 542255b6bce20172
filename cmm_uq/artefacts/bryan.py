"""Bryan gauge: one ball fixed to the table, the other swept through the volume; observed, planned, stated.

The observation is the distance of the swept ball from the fixed one, whose place is free for the whole job, and the bar's
length too when no certificate gives it (US 4,437,151, equations 108 and 110, solved together instead of one after the
other).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from cmm_uq.analysis.planning.set_up import SetUp, direction_words, planned_length
from cmm_uq.analysis.planning.setting import Planning, Setting, Start, Volume
from cmm_uq.analysis.screening.shape import ArtefactShape, Screening, ball_misfit, no_references
from cmm_uq.artefacts import adjustment
from cmm_uq.artefacts.adjustment import Lengths, lengths_of
from cmm_uq.artefacts.distance_equations import (
    FACTORS,
    POORLY_POSED,
    UNKNOWNS,
    DistanceSolution,
    quadratic_terms,
    solve_distances,
)
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.messages import Text, number, say
from cmm_uq.base.points import Floats, Points
from cmm_uq.certificate.document import Section
from cmm_uq.certificate.plots.residuals import deviations_plot, residual_volume
from cmm_uq.certificate.result import Page, Result
from cmm_uq.certificate.wording import refusal
from cmm_uq.jobs.tables.artefact import ArtefactFacts
from cmm_uq.machine.model.artefact import Artefact, ArtefactFigure, Placings, ranges_of_repeats
from cmm_uq.machine.model.placed import Radial
from cmm_uq.machine.model.recorded import expansion, refuse
from cmm_uq.maths.geometry import fit_sphere

_STEPS, _CLOSE = 30, 1e-12
_SCALES = np.array([0, 0, 0, 1, 0, 0, 1, 0, 1]) / np.sqrt(3.0)  # three scales alike, beside the centre


class Bryan(Radial):
    """A swept bar: n distances of n points, one a measurement.

    ``facts`` what the job says of the bar; its length may be missing; ``points`` the recording; point 1 is the swept ball.
    """

    kind = "bryan"
    title = say("Bryan gauge")
    per_size = 1.0
    size_title = say("Length of the bar")
    size_what = say("length")
    plural = "the recorded bars"

    def __init__(self, facts: ArtefactFacts, points: Points, *, where: str | None = None) -> None:
        other = points.point != 1
        first = int(np.argmax(other))
        refuse(
            points, other, where,
            f"measurement {points.measurement[first]} has a point {points.point[first]}: only the swept ball is recorded, as "
            "point 1; the fixed ball's centre is estimated", "Leave the fixed ball out, or mend [artefact] kind in job.toml",
        )  # fmt: skip
        whole_job = np.zeros(len(points), dtype=np.int64)
        super().__init__(facts, points, Placings(whole_job, np.array([0])), expansion(facts, points), where)

    def in_two_steps(self, xyz: Floats | None = None) -> tuple[DistanceSolution, Floats]:
        """The patent's way: centre, and the length if it is not certified, from the sphere (108); then e1 … e6 from (110).

        The sphere is fitted as if the machine had no errors, and bends to them: unless the swept positions surround the
        fixed ball evenly, its centre takes up part of every scale and squareness error, and e1 … e6 lack that part.

        ``xyz`` (n, 3) readings, mm; by default those recorded. Gives solution, and the centre (3,) of the first step, mm.
        """
        certified = self.sizes[0].certified
        readings = self.points.xyz if xyz is None else xyz
        centre = self.centres(readings, self.sizes[0].nominal if certified else None)[0]
        return solve_distances(readings - centre, self.sizes[0].nominal * self.expansion), centre

    def figures(self, counts: NDArray[np.bool_]) -> Mapping[str, ArtefactFigure]:
        """As programs for such gauges print them; of the six corrected, too, where the positions determine these."""
        rows = np.flatnonzero(counts)
        xyz, expansion, size = self.points.xyz[rows], self.expansion[rows], self.sizes[0]
        certified = size.nominal if size.certified else None
        centre, radii, freedom = swept_about(xyz, expansion, certified, six=False)
        length = np.full(len(rows), size.nominal)
        found = {"repeatability": ranges_of_repeats(radii, rows[:, None], length, self.measurement[rows])}
        if certified is not None:
            found["error"] = ArtefactFigure(radii - certified, rows[:, None], length, np.full(len(rows), size.sd))

        def whole(value: float) -> ArtefactFigure:
            return ArtefactFigure(np.array([value]), rows[None], length[:1])

        def spread(radii: Floats, freedom: int, what: str) -> dict[str, ArtefactFigure]:
            about = radii - radii.mean()
            return {
                f"span{what}": whole(float(np.ptp(radii))),
                f"standard deviation{what}": whole(float(np.sqrt(about @ about / freedom))),
            }

        if freedom > 0:
            found |= spread(radii, freedom, "")
            corrected = swept_about(xyz, expansion, certified, six=True)
            if corrected[2] > 0:
                found |= spread(*corrected[1:], " corrected")
                found["pivot offset"] = whole(float(np.linalg.norm(corrected[0] - centre)))
        return {name: figure for name, figure in found.items() if figure is not None}


def swept_about(xyz: Floats, expansion: Floats, length: float | None, *, six: bool) -> tuple[Floats, Floats, int]:
    """Centre (3,) and radii (n,) at 20 °C, mm, by least squares about ``length`` or, where it is ``None``, about their mean.

    With the six factors of equation 110 beside the centre, and radii after these, or without. Also the degrees of freedom of
    the radii about their mean: none where the positions leave something open.
    """
    unknown = np.concatenate([fit_sphere(xyz).centre, np.zeros(UNKNOWNS)])
    free = np.eye(3 + UNKNOWNS)[:, : None if six else 3]
    if six and length is None:
        free = free - _SCALES[:, None] * _SCALES  # nothing says a common part of the scales
    for _ in range(_STEPS):
        e1, e2, e3, e4, e5, e6 = unknown[3:]
        away = xyz - unknown[:3]
        turned = away @ (np.eye(3) + np.array([[e1, e2, e3], [e2, e4, e5], [e3, e5, e6]]))
        distance = np.sqrt(np.einsum("ni,ni->n", turned, away))
        radii, size = distance / expansion, float((distance / expansion).mean())
        # the factors times the bar's length, so that all unknowns are of one size
        slopes = np.column_stack([-turned, quadratic_terms(away) / (2 * size)]) @ free / (expansion * distance)[:, None]
        about = size if length is None else length
        slopes -= slopes.mean(axis=0) if length is None else 0.0
        step, _, rank, _ = np.linalg.lstsq(slopes, about - radii, rcond=POORLY_POSED)
        step = free @ step
        step[3:] /= size
        unknown += step
        if np.abs(step[:3]).max() < _CLOSE * size:
            break
    wanted = int(np.linalg.matrix_rank(free))
    return unknown[:3], radii, len(xyz) - 1 - wanted if rank == wanted else 0


def shape_of(facts: ArtefactFacts, points: Points) -> ArtefactShape | None:
    """One sphere; ``None`` with few points, or others than the swept ball."""
    if len(points) < 8 or np.any(points.point != 1):
        return None
    about = points.xyz - np.median(points.xyz, axis=0)
    extent = facts.length_mm or float(np.median(np.linalg.norm(about, axis=1)))
    return ArtefactShape(
        (np.arange(len(points)),), ball_misfit, facts.length_mm or np.nan, extent, False, (), no_references(points)
    )


SCREENING = Screening(shape_of, balls=True)


LEAST = 4  # positions from which on a centre can be found
_TRIED = 4000


def swept(volume: Volume, length: float, count: int, repeats: int, centre: Floats | None = None) -> tuple[SetUp, ...]:
    """Positions of the swept ball, spread evenly over all directions that stay inside the volume and are held.

    ``length`` of the bar, mm; ``centre`` (3,) of the fixed ball in scale readings; the middle of the volume by default.
    """
    middle = volume.box.mean(axis=1) if centre is None else centre
    # directions (count, 3) spread evenly over the sphere (Fibonacci lattice)
    i = np.arange(_TRIED) + 0.5
    z = 1 - 2 * i / _TRIED
    azimuth = np.pi * (1 + np.sqrt(5)) * i
    r = np.sqrt(1 - z**2)
    spiral = np.column_stack([r * np.cos(azimuth), r * np.sin(azimuth), z])
    held = np.array([volume.allows(direction) for direction in spiral])
    places = middle + length * spiral
    inside = np.all((places >= volume.box[:, 0] - 1e-6) & (places <= volume.box[:, 1] + 1e-6), axis=1)
    high = (places[:, 2] >= volume.heights[0]) & (places[:, 2] <= volume.heights[1])
    fitting = np.flatnonzero(held & inside & high)
    if len(fitting) < LEAST:
        problem = f"a bar of {length:g} mm about ({', '.join(f'{v:.0f}' for v in middle)}) mm has hardly any position"
        raise CmmUqError(problem, where="job.toml [plan]", fix="Use a shorter bar, a larger volume or more fixtures")
    chosen = _spread(places[fitting], min(count, len(fitting)))
    found = []
    for i in fitting[chosen]:
        xyz = volume.machine.coordinates(np.tile(places[i], (repeats, 1)))
        one = np.ones(repeats, dtype=np.int64)
        points = Points(xyz, one, one, np.arange(1, repeats + 1), volume.machine)
        found.append(SetUp(direction_words(spiral[i]), points))
    return tuple(found)


def _spread(places: Floats, count: int) -> list[int]:
    """Indices of places, each as far as possible from those taken before it."""
    chosen = [int(np.argmax(places[:, 2]))]
    distance = np.linalg.norm(places - places[chosen[0]], axis=1)
    while len(chosen) < count:
        chosen.append(int(np.argmax(distance)))
        distance = np.minimum(distance, np.linalg.norm(places - places[chosen[-1]], axis=1))
    return chosen


def swept_bar(setting: Setting) -> tuple[SetUp, ...]:
    count = setting.plan.number or setting.plan.grid[0] * setting.plan.grid[1]
    return swept(setting.volume, planned_length(setting.artefact, setting.plan), count, setting.plan.repeats)


def candidates(setting: Setting, start: Start | None) -> tuple[SetUp, ...]:
    plan, centre = setting.plan, None if start is None else _centre(start.artefact)
    return swept(setting.volume, planned_length(setting.artefact, plan), plan.candidates, plan.repeats, centre)


def elsewhere(artefact: Artefact, volume: Volume, count: int) -> tuple[SetUp, ...]:
    """About the recorded fixed ball; what else was recorded is at its mean there."""
    places = swept(volume, artefact.sizes[0].nominal, count, 1, _centre(artefact))
    means = {name: np.full(1, float(values.mean())) for name, values in artefact.points.columns.items()}
    return tuple(replace(place, points=replace(place.points, columns=means)) for place in places)


def _centre(artefact: Artefact) -> Floats:
    """Of the fixed ball (3,), in scale readings, mm."""
    bar = cast("Bryan", artefact)
    return np.asarray(bar.centres(bar.points.machine_xyz, bar.sizes[0].nominal)[0], dtype=np.float64)


PLANNING = Planning({"swept bar": swept_bar}, candidates, elsewhere, shared=True)


def _distances(result: Result, bar: Bryan) -> Lengths:
    """Distances of the swept ball from the best centre against their mean."""
    distances = bar.distances(bar.points.xyz, None) / bar.expansion
    return lengths_of(result, distances, float(distances.mean()))


def _second_way(result: Result, bar: Bryan) -> DistanceSolution | Text:
    """The patent's way; its bias is what it makes of readings without noise on the machine that the model finds."""
    found = result.values.mean(axis=0)
    try:
        solution, exact = (bar.in_two_steps(xyz=xyz)[0] for xyz in (None, result.model.predicted(found)))
    except CmmUqError as error:
        return refusal(error)
    model = result.model.reported(found[None])
    true = np.array([model[key][0][0] if key in model else 0.0 for key in FACTORS])
    size = bar.sizes[0]
    return replace(
        solution,
        bias=exact.factors - true,
        open_scales=not size.certified,
        relative_length_u=float(np.hypot(size.sd / size.nominal, result.relative_doubt)) if size.certified else 0.0,
    )


def results(result: Result) -> dict[str, Any]:
    bar = cast("Bryan", result.artefact)
    return adjustment.distances_data(result, _distances(result, bar), _second_way(result, bar))


IN_TWO_STEPS = say(
    "The fixed ball is found first, as if the machine had no errors, and its centre takes up part of them: what this makes of "
    "readings without noise is in U. The fitted model finds all at once and is the better."
)


def sections(result: Result) -> list[Section]:
    bar = cast("Bryan", result.artefact)
    lengths = _distances(result, bar)
    caption = say(
        "Distance of the swept ball from the fixed one, as recorded and after the fitted model, with U (k = {k}).",
        k=number(lengths.coverage_factor, ".2f"),
    )
    plot = deviations_plot(
        result, lengths.deviation_um,
        say("{count} positions: about the best centre the distances deviate", count=len(lengths.length)),
        expanded_um=lengths.expanded_um, reference=say("mean distance from the best centre"),
        position_label=say("Position of the swept ball"), caption=caption,
    )  # fmt: skip
    return [
        Section(say("Distances"), (plot, residual_volume(result, say("swept positions")))),
        adjustment.section(result, _second_way(result, bar), IN_TWO_STEPS),
    ]


PAGE = Page(sections, results)
