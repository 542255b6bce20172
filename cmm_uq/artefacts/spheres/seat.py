"""Seat: a place, free but fixed, that a stylus or a robot reaches again and again, an arm otherwise bent each time.

Each reading of a seat has three observations, its coordinates; where the seat stands is projected out. Where joints were read,
what they must err for all readings of a seat to be one place is estimated: all but the scale of the arm.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from cmm_uq.analysis.screening.shape import ArtefactShape, Screening
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.messages import Text, Verbatim, number, say
from cmm_uq.base.points import AXES, Floats, Points
from cmm_uq.base.units import MICROMETRE, unit
from cmm_uq.certificate.document import Section, Table, columns, figure_columns
from cmm_uq.certificate.plots.residuals import deviations_plot
from cmm_uq.certificate.result import Page, Result
from cmm_uq.jobs.tables.artefact import UncertifiedFacts
from cmm_uq.machine.model.artefact import Artefact, ArtefactFigure, Placings
from cmm_uq.machine.model.recorded import place
from cmm_uq.maths.inference.linear_model import Freedoms
from cmm_uq.maths.uncertainty.quantity import rounded

_STRAY, _LEAST_READINGS = 5.0, 4  # mm by which no arm errs; fewer readings of a seat say little of how they scatter
_AXES = {axis: Verbatim(axis.upper()) for axis in AXES}


class Staying(Artefact):
    """Points that stay where they are, each at a place that is free: 3n observations of n points, along axes of each."""

    def __init__(self, points: Points, placings: Placings) -> None:
        self.points, self.placings = points, placings
        self.rows = np.repeat(np.arange(len(points)), 3)[:, None]
        self.axes = np.tile(
            np.eye(3), (len(points), 1, 1)
        )  # (n, 3, 3) in rows: those of the coordinates, unless others

    def fit(self, true_xyz: Floats, sizes: Floats) -> Floats:
        return self.placings.means(true_xyz)

    def project(self, xyz: Floats, displacement: Floats) -> Floats:
        return np.asarray((self.axes @ displacement).reshape(3 * len(xyz), -1), dtype=np.float64)

    def placing(self, xyz: Floats) -> Freedoms:
        return self.placings.columns(self.axes)

    def unread(self) -> NDArray[np.bool_]:
        return self.placings.unread(self.points.xyz, self.axes.transpose(0, 2, 1)).ravel()

    def deviations(self) -> Floats:
        """(n, 3) mm of each point about the mean of its place, along its axes."""
        about = self.points.xyz - self.placings.means(self.points.xyz)
        return np.asarray(np.einsum("nij,nj->ni", self.axes, about))


class Seat(Staying):
    """3n observations (x, y, z in turn) of n readings."""

    kind = "seat"
    title = say("Seat")

    def __init__(self, facts: UncertifiedFacts, points: Points, *, where: str | None = None) -> None:
        super().__init__(points, Placings.of(points.measurement))
        if (most := max(map(len, self.placings.rows))) < _LEAST_READINGS:
            raise CmmUqError(
                f"no seat has {_LEAST_READINGS} readings; most have {most}", where=where, fix="Read each ten times"
            )
        stray = np.linalg.norm(self.deviations(), axis=1)
        if stray.max(initial=0.0) > _STRAY:
            row = int(np.argmax(stray))
            raise CmmUqError(
                f"a reading lies {stray[row]:.4g} mm from the mean of its seat",
                where=place(points, np.arange(len(points)) == row, where),
                fix="Number each seat by a measurement of its own",
            )

    def words_of(self, observation: int) -> Text:
        axis = _AXES[AXES[observation % 3]]
        return say("the {axis} coordinate of {what}", axis=axis, what=super().words_of(observation))

    def figures(self, counts: NDArray[np.bool_]) -> Mapping[str, ArtefactFigure]:
        """Of each seat twice the standard deviation of its readings, and the largest distance from their mean."""
        each = [own for rows in Placings.of(self.points.measurement).rows if len(own := rows[counts[rows]]) > 1]
        if not each:
            return {}
        away = [np.linalg.norm(self.points.xyz[own] - self.points.xyz[own].mean(axis=0), axis=1) for own in each]
        rows = np.array([np.resize(own, len(self.points)) for own in each])
        values = {
            "SPAT": [2 * np.sqrt(np.sum(one**2) / (len(one) - 1)) for one in away],
            "SPAT maximum": [one.max() for one in away],
        }
        lengths = np.array([np.round(np.linalg.norm(self.points.machine_xyz[own].mean(axis=0)), 1) for own in each])
        return {name: ArtefactFigure(np.array(of), rows, lengths) for name, of in values.items()}


def shape_of(facts: UncertifiedFacts, points: Points) -> ArtefactShape | None:
    return staying(points, Placings.of(points.measurement))


def staying(points: Points, placings: Placings) -> ArtefactShape:
    """Points of one place in one place."""
    extent = float(np.ptp(points.xyz, axis=0).max(initial=0.0))
    return ArtefactShape(placings.rows, _about_median, np.nan, extent, False, (), np.zeros((len(points), 0)))


def _about_median(xyz: Floats, _: Floats, size: float) -> Floats:
    return np.asarray(np.linalg.norm(xyz - np.median(xyz, axis=0), axis=1))


SCREENING = Screening(shape_of, balls=True)


def results(result: Result) -> dict[str, Any]:
    seat = cast("Seat", result.artefact)
    figures, points = seat.figures(np.ones(len(seat.points), dtype=bool)), seat.points
    if not figures:
        return {"seats": []}
    spat, largest = figures["SPAT"], figures["SPAT maximum"]
    return {
        "seats": [
            {
                "measurement": int(points.measurement[rows[0]]),
                "readings": len(np.unique(rows)),
                "distance_mm": float(spat.lengths[i]),
                "SPAT_um": float(spat.values[i]) / MICROMETRE,
                "largest_um": float(largest.values[i]) / MICROMETRE,
            }
            for i, rows in enumerate(spat.rows)
        ]
    }


def sections(result: Result) -> list[Section]:
    seat = cast("Seat", result.artefact)
    return [Section(say("Readings of the seats"), (_table(result), *(_over(result, seat, k) for k in range(3))))]


def _table(result: Result) -> Table:
    rows = [
        (
            number(one["measurement"]),
            number(one["readings"]),
            number(one["distance_mm"], ".0f"),
            *(rounded(one[name], result.noise.expanded / 10)[0] for name in ("SPAT_um", "largest_um")),
        )
        for one in results(result)["seats"]
    ]
    note = say(
        "Of the distances of the readings from their mean, as recorded: twice the standard deviation (n − 1), and the "
        "largest. The distance is that of the seat from the base of the arm."
    )
    heads = columns(
        [
            say("Seat"),
            *figure_columns(say("Readings")),
            *figure_columns(say("Distance"), unit=unit("mm")),
            *figure_columns(say("2 s"), say("Largest"), unit=unit("µm")),
        ]
    )
    return Table(say("Articulation"), heads, tuple(rows), (note,))


def _over(result: Result, seat: Seat, k: int) -> Any:
    before, axis = seat.deviations()[:, k] / MICROMETRE, _AXES[AXES[k]]
    caption = say(
        "{axis} of each reading about the mean of its seat, with U (k = {k}).",
        axis=axis,
        k=number(result.noise.coverage_factor, ".2f"),
    )
    return deviations_plot(
        result,
        before,
        say("{count} readings deviate", count=len(before)),
        say("{axis} from the mean of their seat", axis=axis),
        position=seat.points.repeat,
        after_um=result.residuals[k::3] / MICROMETRE,
        flagged=result.flagged[k::3],
        reference=say("mean of the seat"),
        position_label=say("Reading of the seat, in order"),
        caption=caption,
    )


PAGE = Page(sections, results)
