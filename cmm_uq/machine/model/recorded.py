"""What every kind asks of its recording, how fine its coordinates are, and noise for a simulated one."""

from __future__ import annotations

from functools import cached_property

import numpy as np
import scipy
from numpy.typing import NDArray

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.points import Floats, Ints, Points
from cmm_uq.base.units import METRE, MICROMETRE, REFERENCE_TEMPERATURE
from cmm_uq.base.values import dataclass
from cmm_uq.jobs.tables.artefact import ArtefactFacts

UNIT_MISTAKES = {
    1e-3: "metres", 1e3: "micrometres", 1 / 25.4: "inches", 25.4: "inches converted twice", 0.1: "centimetres",
}  # fmt: skip


def expansion(facts: ArtefactFacts, points: Points) -> Floats:
    """Size of the artefact over its size at 20 °C at each point, (n,), from its stated coefficient of expansion.

    One where the job states none, or the recording has no ``temp_artefact_c``.
    """
    if not (facts.cte_per_k and "temp_artefact_c" in points.columns):
        return np.ones(len(points))
    return np.asarray(1 + facts.cte_per_k * (points.columns["temp_artefact_c"] - REFERENCE_TEMPERATURE))


def stated_sd(facts: ArtefactFacts, length_mm: float) -> float:
    """Standard uncertainty, mm, of a length of the artefact as the job states it; 0 where it states none."""
    return float(facts.u_of(length_mm)) * MICROMETRE


def columns_needed(points: Points, names: tuple[str, ...], of: str, where: str | None) -> Floats:
    """Recorded columns (n, j) without which this kind of artefact says nothing."""
    for name in names:
        if name not in points.columns:
            fix = f"Add the column {name}, or mend [artefact] kind in job.toml"
            if name.startswith("reference_"):
                fix = f"Give its certificate, a DCC or a table of its points, as [artefact.certificate] file. Or a{fix[1:]}"
            raise CmmUqError(
                f"no column {name!r}, which the recording of a {of} needs", where=where or "recording", fix=fix
            )
    return np.column_stack([points.columns[name] for name in names])


def place(points: Points, rows: NDArray[np.bool_], where: str | None) -> str:
    file = where or "recording"
    return f"{file} line {points.lines[np.flatnonzero(rows)[0]]}" if len(points.lines) else file


def refuse(points: Points, rows: NDArray[np.bool_], where: str | None, problem: str, fix: str) -> None:
    """Refuse a recording for rows (n,) of it, where any are."""
    if np.any(rows):
        raise CmmUqError(problem, where=place(points, rows, where), fix=fix)


def check_length(measured: float, certified: float, what: str, where: str | None) -> None:
    """Refuse lengths that differ by a factor that only a mistaken unit or another artefact explains.

    ``measured, certified``: mm. ``what``: in the plural, as ``the recorded bars``.
    """
    if not certified > 0:
        raise CmmUqError(f"{what} are {measured:.6g} mm long on average, and their references lie all in one place",
                         where=where, fix="Give each point its own reference")  # fmt: skip
    ratio = measured / certified
    said = f"{what} are {measured:.6g} mm long on average, by the certificate {certified:.6g} mm"
    for factor, unit in UNIT_MISTAKES.items():
        if abs(ratio / factor - 1) < 0.02:
            raise CmmUqError(f"{said}: the coordinates look like {unit}, not mm", where=where,
                             fix="Give x_mm, y_mm, z_mm and the certified lengths in mm")  # fmt: skip
    if abs(ratio - 1) > 0.01:
        raise CmmUqError(
            f"{said}: they differ by {abs(ratio - 1) * METRE:.3g} mm/m",
            where=where,
            fix="Check job.toml [artefact], and that the recording belongs to this artefact",
        )


def length_of(facts: ArtefactFacts, measured: float, what: str, where: str | None) -> tuple[float, float]:
    """An artefact's length and its standard uncertainty, mm: as certified, or as measured and not known at all."""
    if facts.length_mm is None:
        return measured, np.inf
    check_length(measured, facts.length_mm, what, where)
    return facts.length_mm, stated_sd(facts, facts.length_mm)


INCH = 25.4
NANOMETRE = 1e-6  # mm
_EXACT = 1e-5  # part of a step by which a coordinate on the grid may be off, as from a unit's conversion
_LEAST_VALUES = 12  # different coordinates from which on a grid is no coincidence
_LEAST_SHARE = 0.01  # part of the variance of a coordinate from which on the steps matter


def display_step(xyz: Floats, scatter: float) -> float:
    """Largest step, mm, of which all coordinates are multiples; 0 where it is too fine to matter, or there is none.

    ``xyz``: (n, 3) mm as recorded. ``scatter``: of a coordinate, mm, as the residuals show it: a step s has the variance
    s²/12.
    """
    values = np.unique(xyz[np.isfinite(xyz)])
    steps = [f * unit * 10.0**-k for unit in (1.0, INCH) for k in range(1, 6) for f in (5.0, 2.0, 1.0)]
    if len(values) < _LEAST_VALUES:
        return 0.0
    for step in sorted(steps, reverse=True):
        if step**2 / 12 < _LEAST_SHARE * scatter**2:
            return 0.0
        if np.abs(values / step - np.round(values / step)).max() < _EXACT:
            return step
    return 0.0


def of_last_digit(xyz: Floats, scatter: float) -> float:
    """Standard deviation, mm, that the last digit of figures leaves open, or a nanometre; 0 where residuals show more.

    ``xyz``: (n, 3) mm as recorded. ``scatter``: of a coordinate, mm, as the residuals show it: of figures without noise, of
    copies and of their differences, less than the digits can tell.
    """
    least = max(display_step(xyz, scatter) / float(np.sqrt(12)), NANOMETRE)
    return least if scatter < least else 0.0


@dataclass(frozen=True, eq=False)
class Display:
    """Rounding to steps that are not small beside the noise: it follows the coordinates, and so looks like physics."""

    step: float  # mm
    xyz: Floats  # (n, 3) coordinates as a model has them, mm, without noise and not rounded
    rows: Ints  # (m, j) points of each observation
    sensitivity: Floats  # (m, j, 3) of the observations to their points

    @classmethod
    def of(cls, step: float, recorded: Floats, rows: Ints, sensitivity: Floats, residual: Floats) -> Display:
        """Coordinates that differ from recorded ones (n, 3) as the residuals (m,) say, and no more."""
        found = cls(step, recorded, rows, sensitivity)
        return cls(step, recorded - found.moved(residual[:, None])[:, :, 0], rows, sensitivity)

    @cached_property
    def _all(self) -> scipy.sparse.csr_array:
        m, slots = self.rows.shape
        row = np.repeat(np.arange(m), 3 * slots)
        column = (3 * self.rows[:, :, None] + np.arange(3)).ravel()
        return scipy.sparse.csr_array((self.sensitivity.ravel(), (row, column)), shape=(m, self.xyz.size))

    def moved(self, changed: Floats) -> Floats:
        """Least displacement of the points (n, 3, b) that changes the observations by (m, b), mm."""
        J = self._all
        least = scipy.sparse.eye_array(J.shape[0]) * 1e-12
        solved = scipy.sparse.linalg.splu(scipy.sparse.csc_array(J @ J.T + least)).solve(changed)
        return np.asarray((J.T @ solved).reshape(len(self.xyz), 3, -1), dtype=np.float64)

    def rounded(self, noise: Floats) -> Floats:
        """What rounding adds to observations (m, b) with such noise, mm."""
        shown = self.xyz[:, :, None] + self.moved(noise)
        error = np.round(shown / self.step) * self.step - shown
        return np.asarray(self._all @ error.reshape(self.xyz.size, -1), dtype=np.float64)


@dataclass(frozen=True)
class Noise:
    """Standard deviations, mm, of the components of a coordinate's noise."""

    coordinate: float | tuple[float, float, float] = 0.0  # of each reading, of every coordinate or along x, y, z
    placing: float = 0.0  # of each point of each placing, which its repeats share
    growth: float = 0.0  # of what grows with the distance from the first point of the placing, at the longest
    # slow, slow_time_s: of an Ornstein–Uhlenbeck process of each coordinate, and the time over which it forgets; what never
    # does (infinity) is a random walk from the first reading on, whose root mean square over the recording ``slow`` is
    slow: float = 0.0
    slow_time_s: float = 600.0
    # degrees of freedom of Student's t for the readings, above 2 (their standard deviation stays); 0 for a normal
    tails: float = 0.0
    resolution: float = 0.0  # steps in which coordinates are displayed; 0 for none

    def drawn(self, points: Points, random: np.random.Generator) -> Floats:
        """Noise (n, 3), mm, of points; the display's steps are left to :meth:`displayed`."""
        _, placing = np.unique(np.column_stack([points.measurement, points.point]), axis=0, return_inverse=True)
        offsets = self.placing * random.standard_normal((placing.max() + 1, 3))
        found = offsets[placing.ravel()] + np.asarray(self.coordinate) * self._readings(points.xyz.shape, random)
        if self.growth:
            away = distances_in_placing(points.xyz, points)
            part = away / max(float(away.max()), 1e-9)
            found = found + self.growth * part[:, None] * random.standard_normal(points.xyz.shape)
        if self.slow:
            if "time_s" not in points.columns:
                raise CmmUqError("slow noise needs the column time_s, which the recording has not", where="truth.toml [noise]",
                                 fix="Record time_s, or leave slow_um out")  # fmt: skip
            path, time = _random_walk, points.columns["time_s"]
            if np.isfinite(self.slow_time_s):
                path, time = _ornstein_uhlenbeck, time / self.slow_time_s
            found = found + self.slow * path(time, random)
        return np.asarray(found, dtype=np.float64)

    def displayed(self, xyz: Floats) -> Floats:
        return np.asarray(np.round(xyz / self.resolution) * self.resolution) if self.resolution else xyz

    def _readings(self, shape: tuple[int, ...], random: np.random.Generator) -> Floats:
        if not self.tails:
            return random.standard_normal(shape)
        return np.asarray(random.standard_t(self.tails, shape) / np.sqrt(self.tails / (self.tails - 2)))


def distances_in_placing(xyz: Floats, points: Points) -> Floats:
    """Distance (n,), mm, of each point from the first of its placing."""
    order = np.lexsort((points.repeat, points.point, points.measurement))
    _, starts, index = np.unique(points.measurement[order], return_index=True, return_inverse=True)
    first = np.empty(len(order), dtype=np.int64)
    first[order] = order[starts][index.ravel()]
    return np.asarray(np.linalg.norm(xyz - xyz[first], axis=1))


def _random_walk(time: Floats, random: np.random.Generator) -> Floats:
    """(n, 3) from zero at the first of times (n,), with the root mean square one over all their duration."""
    order = np.argsort(time, kind="stable")
    steps = np.diff(time[order], prepend=time[order[0]]) / max(float(np.ptp(time)), 1e-9)
    found = np.empty((len(time), 3))
    found[order] = np.cumsum(np.sqrt(2 * steps)[:, None] * random.standard_normal((len(time), 3)), axis=0)
    return found


def _ornstein_uhlenbeck(time: Floats, random: np.random.Generator) -> Floats:
    """(n, 3) of standard deviation one, at times (n,) in units of the time over which it forgets."""
    order = np.argsort(time, kind="stable")
    normal, found = random.standard_normal((len(time), 3)), np.empty((len(time), 3))
    kept = np.exp(-np.diff(time[order], prepend=-np.inf))
    last = np.zeros(3)
    for row, part, new in zip(order, kept, normal, strict=True):
        last = part * last + np.sqrt(1 - part**2) * new
        found[row] = last
    return found
