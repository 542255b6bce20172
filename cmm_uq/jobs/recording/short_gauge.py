"""``[short_gauge]``: a short gauge met from both sides, recorded beside lengths that are not bidirectional by themselves."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from pydantic import field_validator, model_validator

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.files.table import AnyFloat, JobTable, Length, Limit, key, required
from cmm_uq.base.points import AXES, Floats, Ints, Machine, Points
from cmm_uq.base.units import MICROMETRE, REFERENCE_TEMPERATURE
from cmm_uq.jobs.importing.recording import read_recording
from cmm_uq.jobs.tables.artefact import Traceability
from cmm_uq.jobs.tables.length_formula import Factor, Freedom, with_standard_uncertainty

KEY = "[short_gauge]"

FARTHEST_MM = 1.0
"""From the certified length, or from the first repeat: a gauge farther off is another one, or in another place."""


class ShortGaugeFacts(JobTable):
    """``[short_gauge]``: a gauge block, or another gauge of two opposite faces, and the recording of it."""

    file: str
    """Its recording: points 1 and 2, the middles of its two faces, in every measurement and repeat."""
    length_mm: Length = required("Certified length at 20 °C.")
    u_um: Limit
    """Standard uncertainty (k = 1) of that length as it was met: of the certificate and of the gauge's temperature;
    `U_um` with `k` may stand for it."""
    U_um: Limit | None = None
    """Expanded uncertainty, as a certificate states it, in place of `u_um`; needs `k` or `degrees_of_freedom`."""
    k: Factor | None = key(None, "Coverage factor of `U_um`.")
    degrees_of_freedom: Freedom | None = None
    """Effective degrees of freedom by the certificate; without `k` the factor is Student's t for 95 % by them."""
    cte_per_k: AnyFloat = key(0.0, "Coefficient of thermal expansion of the gauge, 1/K.")
    name: str = key("", "Name of the gauge on the certificate.")
    serial: str = key("", "Serial number of the gauge.")
    certificate: Traceability | None = key(None, "The gauge's own certificate.")

    @model_validator(mode="before")
    @classmethod
    def _expanded(cls, data: Any) -> Any:
        return with_standard_uncertainty(data)

    @field_validator("cte_per_k")
    @classmethod
    def _an_expansion(cls, cte: float) -> float:
        if abs(cte) > 1e-3:
            raise ValueError(f"cte_per_k = {cte:g} is no expansion coefficient: steel has 11.5e-6 per kelvin")
        return cte


@dataclass(frozen=True, eq=False)
class ShortGauge:
    """A short gauge as recorded: rows (q, 2) of points 1 and 2 of each (measurement, repeat)."""

    facts: ShortGaugeFacts
    points: Points
    rows: Ints

    @property
    def errors_mm(self) -> Floats:
        """Measured minus certified length at 20 °C, (q,) mm."""
        found = np.linalg.norm(self.lines_mm[1], axis=1)
        recorded = self.points.columns.get("temp_artefact_c")
        if recorded is not None:
            found = found / (1 + self.facts.cte_per_k * (recorded[self.rows].mean(axis=1) - REFERENCE_TEMPERATURE))
        return np.asarray(found - self.facts.length_mm, dtype=np.float64)

    @property
    def u_mm(self) -> float:
        """Standard uncertainty of the certified length."""
        return self.facts.u_um * MICROMETRE

    @property
    def lines_mm(self) -> tuple[Floats, Floats]:
        """Middle of each, and the way from its first face to its second, (q, 3) mm."""
        first, last = self.points.xyz[self.rows[:, 0]], self.points.xyz[self.rows[:, 1]]
        return 0.5 * (first + last), last - first


def short_gauge_of(facts: ShortGaugeFacts, content: bytes, where: str, machine: Machine) -> ShortGauge:
    points = read_recording(content, where, machine)
    for own in points.rows_of_groups:
        if sorted(points.point[own].tolist()) != [1, 2]:
            number, repeat = points.measurement[own[0]], points.repeat[own[0]]
            raise CmmUqError(f"measurement {number}, repeat {repeat} does not have points 1 and 2 alone",
                             where=f"{where} line {points.lines[own[0]]}",
                             fix="Record the middle of either face of the short gauge as points 1 and 2")  # fmt: skip
    ordered = sorted(points.rows_of_groups, key=lambda own: (points.measurement[own[0]], points.repeat[own[0]]))
    gauge = ShortGauge(facts, points, np.array([own[np.argsort(points.point[own])] for own in ordered], dtype=np.int64))
    errors = gauge.errors_mm
    off = int(np.argmax(np.abs(errors)))
    if abs(errors[off]) > FARTHEST_MM:
        problem = f"a length of {errors[off] + facts.length_mm:.5g} mm, where {KEY} length_mm is {facts.length_mm:g}"
        raise CmmUqError(problem, where=f"{where} line {points.lines[gauge.rows[off, 0]]}",
                         fix="Give the length of the gauge that was recorded, in mm")  # fmt: skip
    _refuse_another_place(gauge, where)
    _refuse_one_side(gauge, where)
    return gauge


def _refuse_another_place(gauge: ShortGauge, where: str) -> None:
    """A measurement is one place: its repeats stand for each other."""
    points, first = gauge.points, gauge.rows[:, 0]
    for number in np.unique(points.measurement[first]):
        own = gauge.rows[points.measurement[first] == number]
        apart = np.linalg.norm(points.xyz[own] - points.xyz[own[0]], axis=2).max(axis=1)
        off = int(np.argmax(apart))
        if apart[off] > FARTHEST_MM:
            raise CmmUqError(f"measurement {number} has the short gauge in two places, {apart[off]:.3g} mm apart",
                             where=f"{where} line {points.lines[own[off, 0]]}",
                             fix="Number each place as a measurement of its own, and its repeats in it")  # fmt: skip


def _refuse_one_side(gauge: ShortGauge, where: str) -> None:
    """Where the senses of travel are recorded they must tell a length that was met from both sides."""
    columns, points = gauge.points.columns, gauge.points
    if not all(f"approach_{axis}" in columns for axis in AXES):
        return
    approach = np.column_stack([columns[f"approach_{axis}"] for axis in AXES])
    along = np.einsum("qji,qi->qj", approach[gauge.rows], gauge.lines_mm[1])
    same = np.flatnonzero(along[:, 0] * along[:, 1] >= 0)
    if same.size:
        raise CmmUqError("both faces of the short gauge were reached from the same side",
                         where=f"{where} line {points.lines[gauge.rows[same[0], 0]]}",
                         fix="Record a gauge whose faces are met from opposite sides, or mend approach_x, …")  # fmt: skip
