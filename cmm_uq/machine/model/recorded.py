"""What every kind of artefact asks of its recording: columns, temperatures, plausible lengths, and lines for messages."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.points import Floats, Points
from cmm_uq.base.units import METRE, MICROMETRE, REFERENCE_TEMPERATURE
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
    """Recorded columns (n, j) without which this kind of artefact says nothing.

    Raises
    ------
    CmmUqError : the recording lacks one.
    """
    for name in names:
        if name not in points.columns:
            raise CmmUqError(f"no column {name!r}, which the recording of a {of} needs", where=where or "recording",
                             fix=f"Add the column {name}, or mend [artefact] kind in job.toml")  # fmt: skip
    return np.column_stack([points.columns[name] for name in names])


def place(points: Points, rows: NDArray[np.bool_], where: str | None) -> str:
    """File and line of the first of some points, for a message."""
    file = where or "recording"
    return f"{file} line {points.lines[np.flatnonzero(rows)[0]]}" if len(points.lines) else file


def check_length(measured: float, certified: float, what: str, where: str | None) -> None:
    """Refuse lengths that differ by a factor that only a mistaken unit or another artefact explains.

    Parameters
    ----------
    measured, certified : mm.
    what : in the plural, as ``the recorded bars``.

    Raises
    ------
    CmmUqError : they differ so, with the mistake that explains it.
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
            f"{said}: they differ by {abs(ratio - 1) * METRE:.3g} mm/m", where=where,
            fix="Check job.toml [artefact], and that the recording belongs to this artefact",
        )  # fmt: skip
