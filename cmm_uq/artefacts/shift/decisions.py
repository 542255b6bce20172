"""Errors of a shifted axis, or of the two axes of a plane, against the limits of a laboratory."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from cmm_uq.analysis.conformity.standards import decidable, statement
from cmm_uq.analysis.conformity.statement import Statement
from cmm_uq.artefacts.kinds import SHIFT
from cmm_uq.artefacts.shift.result import shift_facts
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.messages import Text, Verbatim
from cmm_uq.base.points import Floats, Points
from cmm_uq.jobs.job import Job
from cmm_uq.machine.model.artefact import Artefact, ArtefactFigure
from cmm_uq.maths.uncertainty.quantity import Quantity

OF_AN_AXIS = "linearity"


class ShiftedReadings(Artefact):
    """The recording with what its curves and angles come to, for decisions: no list of effects moves its points."""

    kind = "shift"
    title = Verbatim("shift")

    def __init__(self, points: Points, figures: Mapping[str, ArtefactFigure]) -> None:
        self.points, self._figures, self.rows = points, figures, np.arange(len(points))[:, None]

    def fit(self, true_xyz: Floats, sizes: Floats) -> Floats:
        return true_xyz

    def project(self, xyz: Floats, displacement: Floats) -> Floats:
        return np.zeros((len(xyz), displacement.shape[2]))

    def figures(self, counts: NDArray[np.bool_]) -> Mapping[str, ArtefactFigure]:
        return self._figures


def figure_of(
    points: Points, each: Sequence[tuple[Quantity, float, Text]], lengths_mm: Sequence[float]
) -> ArtefactFigure:
    """Some quantities, each with its unit in mm and what it is of: u is half the longer side of its interval."""
    size = np.array([mm for _, mm, _ in each])
    value = np.array([found.value for found, _, _ in each])
    ends = np.array([found.interval95 for found, _, _ in each]).reshape(-1, 2)
    u = 0.5 * np.maximum(value - ends[:, 0], ends[:, 1] - value)
    rows = np.tile(np.arange(len(points)), (len(each), 1))
    return ArtefactFigure(size * value, rows, np.array(lengths_mm), size * u, tuple(name for _, _, name in each))


def decided(job: Job, figures: Mapping[str, ArtefactFigure]) -> tuple[Statement, ...]:
    """What the job wishes of these figures."""
    readings = ShiftedReadings(job.points, figures)
    return tuple(
        statement(wish, readings, {}, f"[[conformity]] {i}", SHIFT.tested, None, job.circumstances)
        for i, wish in enumerate(job.facts.conformity, 1)
    )


def refuse_undecidable(job: Job) -> None:
    for i, wish in enumerate(job.facts.conformity, 1):
        _, characteristic = decidable(wish, SHIFT.name, f"[[conformity]] {i}", SHIFT.tested, job.circumstances)
        if shift_facts(job).plane is None and characteristic.name != OF_AN_AXIS:
            raise CmmUqError(
                f"the {characteristic.name} is none of an axis by itself", where=f"job.toml [[conformity]] {i} characteristic",
                fix=f'Decide "{OF_AN_AXIS}", or shift a plate in a plane',
            )  # fmt: skip
