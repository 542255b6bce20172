"""Screening of a recording: impossible values, figures that repeat another measurement's, gross outliers.

What is found is reported, never silently dropped. Whether it is used for the estimates is said with each finding.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray
from scipy import linalg, special

from cmm_uq.errors import CmmUqError
from cmm_uq.inference.linear_model import LinearModel
from cmm_uq.points import AXES, Floats, Points

GROSS = 1e-3
"""Probability, over all observations together, that noise alone makes one look like an outlier."""

_TRAVEL_TOLERANCE = 1.0
"""mm that a scale may read beyond its stated travel."""


@dataclass(frozen=True)
class Finding:
    """Something odd in a recording.

    Parameters
    ----------
    kind : ``impossible``, ``duplicate`` or ``outlier``.
    measurements : that it concerns.
    lines : of the file.
    why : in words.
    column : that it concerns, if one.
    set_aside : whether the estimates leave these measurements out.
    """

    kind: str
    measurements: tuple[int, ...]
    lines: tuple[int, ...]
    why: str
    column: str | None = None
    set_aside: bool = False


def _temperature(values: Floats) -> NDArray[np.bool_]:
    return (values < -30) | (values > 80)


IMPOSSIBLE: Mapping[str, tuple[Callable[[Floats], NDArray[np.bool_]], str]] = MappingProxyType(
    {
        "radius_mm": (lambda v: v <= 0, "a radius is positive"),
        "fit_rms_um": (lambda v: v < 0, "an rms is not negative"),
        "n_points": (lambda v: v < 1, "a fit needs points"),
        "humidity_pct": (lambda v: (v < 0) | (v > 100), "relative humidity lies between 0 and 100 %"),
        "pressure_hpa": (lambda v: (v < 500) | (v > 1100), "air pressure lies between 500 and 1100 hPa; is it in hPa?"),
        "speed_mm_s": (lambda v: v < 0, "a speed is not negative"),
        **{
            f"temp_{place}_c": (_temperature, "no measuring room is so cold or hot; is it in °C?")
            for place in (*AXES, "artefact", "table_top", "table_bottom", "air")
        },
    }
)


def screen(points: Points, *, needed: Collection[str], set_aside: Collection[int], where: str) -> tuple[Finding, ...]:
    """All that is odd in a recording before anything is fitted.

    Parameters
    ----------
    points : the recording.
    needed : columns that the model uses.
    set_aside : measurements that the job leaves out of the estimates.
    where : the recording's name, for messages.

    Raises
    ------
    CmmUqError : a value that the model uses cannot be.
    """
    impossible = impossible_values(points)
    for finding in impossible:
        if finding.column in needed:
            raise CmmUqError(finding.why, where=f"{where} line {finding.lines[0]}, column {finding.column}",
                             fix="The model uses this column: mend it, or leave out the effect that needs it")  # fmt: skip
    found = (*impossible, *repeated_figures(points))
    return tuple(replace(f, set_aside=bool(set(f.measurements[-1:]) & set(set_aside))) for f in found)


def impossible_values(points: Points) -> list[Finding]:
    """Values that cannot be: one finding a column, and one an axis whose readings leave the machine's travel."""
    found = []
    for column, (wrong, why) in IMPOSSIBLE.items():
        if column in points.columns and np.any(rows := wrong(points.columns[column])):
            found.append(
                _finding("impossible", points, rows, f"{column} = {_span(points.columns[column][rows])}: {why}", column)
            )
    if all(f"n{a}" in points.columns for a in AXES):
        norm = np.linalg.norm([points.columns[f"n{a}"] for a in AXES], axis=0)
        if np.any(rows := np.abs(norm - 1) > 0.02):
            found.append(_finding("impossible", points, rows, "the normal nx, ny, nz has no unit length", "nx"))
    for i, axis in enumerate(AXES):
        low, high = points.machine.travel_mm[i]
        readings = points.readings[:, i]
        if np.any(rows := (readings < low - _TRAVEL_TOLERANCE) | (readings > high + _TRAVEL_TOLERANCE)):
            why = (
                f"scale readings of {axis.upper()} ({axis}_mm + origin) of {_span(readings[rows])} mm lie outside the "
                f"travel {low:g} to {high:g} mm"
            )
            found.append(_finding("impossible", points, rows, why, f"{axis}_mm"))
    return found


def repeated_figures(points: Points) -> list[Finding]:
    """Measurements whose coordinates repeat, digit for digit, those of another measurement."""
    first: dict[bytes, int] = {}
    found = []
    for group in range(int(points.group.max()) + 1):
        rows = np.flatnonzero(points.group == group)
        figures = points.xyz[rows]
        key = figures[np.lexsort(figures.T)].tobytes()
        if key not in first:
            first[key] = group
            continue
        original = np.flatnonzero(points.group == first[key])
        if points.measurement[original[0]] == points.measurement[rows[0]]:
            continue
        a, b = int(points.measurement[original[0]]), int(points.measurement[rows[0]])
        why = f"measurement {b} repeats the coordinates of measurement {a} to the last digit: a copy, not a measurement"
        both = np.isin(np.arange(len(points)), np.concatenate([original, rows]))
        found.append(_finding("duplicate", points, both, why))
    return found


def gross_outliers(linear: LinearModel, measurement: NDArray[np.int64]) -> list[tuple[int, float]]:
    """Observations (index, times of their standard deviation) that noise would hardly ever put so far off.

    Externally studentised residuals against their t distribution, the probability multiplied by the number of
    observations (Bonferroni; Barnett & Lewis 1994, 8.2); the worst is taken out and the rest tested again, up to a tenth
    of the recording.
    """
    reduced = linear.reduced
    keep = np.ones(len(reduced.observed), dtype=bool)
    found: list[tuple[int, float]] = []
    scale = np.array([u.scale for u in linear.unknowns])
    for _ in range(max(1, len(keep) // 10)):
        U, s, _ = linalg.svd(reduced.design[keep] * scale, full_matrices=False)
        U = U[:, s > 1e-9 * s[0]] if s.size else U
        dof = reduced.count - (~keep).sum() - U.shape[1] - 1
        if dof < 3:
            break
        residual = reduced.observed[keep] - U @ (U.T @ reduced.observed[keep])
        free = np.maximum(1 - np.einsum("ij,ij->i", U, U), 1e-12)
        rest = np.maximum(residual @ residual - residual**2 / free, 0.0)
        with np.errstate(divide="ignore"):
            t = np.where(rest > 0, np.abs(residual) / np.sqrt(free * rest / dof), 0.0)
        worst = int(np.argmax(t))
        if 2 * special.stdtr(dof, -t[worst]) * len(measurement) > GROSS:
            break
        index = int(np.flatnonzero(keep)[worst])
        found.append((index, float(t[worst])))
        keep[index] = False
    return found


def _finding(kind: str, points: Points, rows: NDArray[np.bool_], why: str, column: str | None = None) -> Finding:
    lines = tuple(points.lines[rows].tolist()) if len(points.lines) else ()
    return Finding(kind, tuple(dict.fromkeys(points.measurement[rows].tolist())), lines, why, column)


def _span(values: Floats) -> str:
    low, high = float(values.min()), float(values.max())
    return f"{low:g}" if low == high else f"{low:g} to {high:g}"
