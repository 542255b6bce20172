"""The linearity error of a shifted axis against the limits of a laboratory."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from cmm_uq.analysis.conformity.standards import decidable, statement
from cmm_uq.analysis.conformity.statement import Statement
from cmm_uq.artefacts.kinds import SHIFT
from cmm_uq.artefacts.shift.result import shift_facts
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.messages import Verbatim
from cmm_uq.base.points import Floats, Points
from cmm_uq.base.units import MICROMETRE
from cmm_uq.jobs.job import Job
from cmm_uq.machine.model.artefact import Artefact, ArtefactFigure
from cmm_uq.maths.uncertainty.quantity import Quantity


class ShiftedReadings(Artefact):
    """The recording of an axis with what its curve comes to, for decisions: no list of effects moves its points."""

    kind = "shift"
    title = Verbatim("shift")

    def __init__(self, points: Points, linearity: ArtefactFigure) -> None:
        self.points, self._linearity = points, linearity
        self.sizes, self.noise_scale, self.rows = (), np.ones(len(points)), np.arange(len(points))[:, None]
        self.measurement, self.repeat = points.measurement, points.repeat

    def fit(self, true_xyz: Floats, sizes: Floats) -> Floats:
        return true_xyz

    def project(self, xyz: Floats, displacement: Floats) -> Floats:
        return np.zeros((len(xyz), displacement.shape[2]))

    def size_change(self) -> Floats:
        return np.zeros((len(self.rows), 0))

    def figures(self, counts: NDArray[np.bool_]) -> dict[str, ArtefactFigure]:
        return {"linearity": self._linearity}


def decided(job: Job, linearity: Quantity, span_mm: float) -> tuple[Statement, ...]:
    """What the job wishes of a linearity error, µm: u is half the longer side of its interval."""
    low, high = linearity.interval95
    value = MICROMETRE * np.array([linearity.value])
    u = MICROMETRE * np.array([0.5 * max(linearity.value - low, high - linearity.value)])
    figure = ArtefactFigure(value, np.arange(len(job.points))[None], np.array([span_mm]), u)
    readings = ShiftedReadings(job.points, figure)
    return tuple(
        statement(wish, readings, {}, f"[[conformity]] {i}", SHIFT.tested, None, job.circumstances)
        for i, wish in enumerate(job.facts.conformity, 1)
    )


def refuse_undecidable(job: Job) -> None:
    if job.facts.conformity and shift_facts(job).plane is not None:
        raise CmmUqError("no rule here decides on errors of a plane", where="job.toml [[conformity]]",
                         fix="Leave it out; the certificate states the errors with their uncertainty")  # fmt: skip
    for i, wish in enumerate(job.facts.conformity, 1):
        decidable(wish, SHIFT.name, f"[[conformity]] {i}", SHIFT.tested, job.circumstances)
