"""Reference values joined to a recording: from the file of the artefact's certificate, or from an earlier recording.

What an earlier recording found of the same plate takes the place of a certificate. Errors of the plate and of the machine
that were there on both dates cancel, as long as the plate stands in the same place; what remains is what changed between, and
its noise is that of both recordings.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.points import AXES, Floats, Ints, Points
from cmm_uq.base.units import REFERENCE_TEMPERATURE
from cmm_uq.jobs.columns import LARGEST_NUMBER, OPTIONAL, largest
from cmm_uq.jobs.importing.format import Recognition
from cmm_uq.jobs.importing.header import COVERAGE
from cmm_uq.jobs.importing.recording import imported_references
from cmm_uq.jobs.tables.artefact import ArtefactFacts
from cmm_uq.jobs.tables.length_formula import factor_of

EXPANDED = "reference_U_um"
STANDARD = "reference_u_um"
# columns of the standard uncertainty of certified distances or places
OF_POINTS = (STANDARD, *(f"reference_u_{axis}_um" for axis in AXES))
REFERENCES = ("reference_mm", *(f"reference_{axis}_mm" for axis in AXES), *OF_POINTS, EXPANDED)

_ANOTHER_U = re.compile(
    r"(?!radius|fit|noise).*(?:^|[ _])(?:u|u95|uncertainty|unsicherheit|messunsicherheit|incertitude|incertezza|incertidumbre)"
    r"(?:[ _](?:um|mm|nm|reference|ref|certified|certificate))*(?:\s*[\[(].*)?",
    re.IGNORECASE,
)
"""Name of a column that can only be an uncertainty."""


def reference_file(artefact: ArtefactFacts) -> list[str]:
    """Name of the file of certified values, if a job names one."""
    chain = artefact.certificate
    return [] if chain is None or chain.file is None else [chain.file]


def with_references(
    points: Points, artefact: ArtefactFacts, inputs: Mapping[str, bytes], folder: Path, where: str
) -> tuple[Points, Recognition]:
    """A recording with the certified values of its points, and how their file was read."""
    chain = artefact.certificate
    if chain is None or chain.file is None:
        raise CmmUqError("the certificate names no file", where=where)
    place = str(folder / chain.file)
    if twice := [name for name in REFERENCES if name in points.columns]:
        raise CmmUqError(f"has {twice[0]}, and so has {chain.file}", where=where, fix="Leave one of them out")
    found = imported_references(inputs[chain.file], place, chain)
    if "point" not in found.columns:
        raise CmmUqError("does not number its values", where=place,
                         fix='Say which column is the number of the point: columns = { point = "…" }')  # fmt: skip
    rows = _rows_by_point(found.columns["point"].tolist(), found.lines.tolist(), place)
    missing = next((number for number in points.point.tolist() if number not in rows), None)
    if missing is not None:
        line = points.lines[points.point.tolist().index(missing)] if len(points.lines) else 0
        raise CmmUqError(f"point {missing} is not among the certified values of {chain.file}", where=f"{where} line {line}",
                         fix="Number points as the certificate does, or leave the point out")  # fmt: skip
    index = np.array([rows[number] for number in points.point.tolist()], dtype=np.int64)
    columns = {name: values[index] for name, values in found.columns.items() if name in REFERENCES}
    if EXPANDED in columns and (stated := COVERAGE.search(found.recognised.columns[EXPANDED])):
        k = float(stated[1].replace(",", "."))
        if artefact.k not in (None, k) or not 1 <= k <= 10:
            raise CmmUqError(f"says k = {k:g} in a heading", where=place, fix="Mend it, or [artefact] k")
        columns[STANDARD] = columns.pop(EXPANDED) / k
    for name, values in columns.items():
        if np.any(np.abs(values) > largest(name)):
            raise CmmUqError(f"{name} is more than anything that is measured", where=place, fix="Check its unit")
    return replace(points, columns={**points.columns, **columns}), found.recognised


def with_uncertainties(points: Points, artefact: ArtefactFacts, where: str, unread: Sequence[str] = ()) -> Points:
    """A recording with the standard uncertainty of its certified values in place of the expanded one."""
    columns, factor = points.columns, factor_of(artefact.k, artefact.degrees_of_freedom)
    unread = [*unread, *(name for name in columns if name not in OPTIONAL)]
    if (other := next((name for name in unread if _ANOTHER_U.fullmatch(name)), None)) is not None:
        raise CmmUqError(f"the column {other!r} looks like an uncertainty, and is none that is read", where=where,
                         fix=f"Name it {EXPANDED} (with [artefact] k) or {STANDARD}, or leave it out")  # fmt: skip
    here = [name for name in (*OF_POINTS, EXPANDED) if name in columns]
    if EXPANDED in here:
        if len(here) > 1:
            raise CmmUqError(f"has {EXPANDED} and {here[0]}", where=where, fix="Leave one of them out")
        if factor is None or artefact.U_um is not None:
            fix = "Give k = 2.0 in [artefact], as the certificate states it"
            raise CmmUqError(f"{EXPANDED} needs a coverage factor of its own", where=where,
                             fix=fix if factor is None else "Leave U_um out of [artefact]: the column says it")  # fmt: skip
        columns = {**columns, STANDARD: columns[EXPANDED] / factor}
        columns = {name: values for name, values in columns.items() if name != EXPANDED}
        here = [STANDARD]
    elif artefact.k is not None and artefact.U_um is None and not here:
        raise CmmUqError("k is given without U_um, and no column has expanded uncertainties", where="job.toml [artefact] k",
                         fix=f"Give U_um, or a column {EXPANDED} beside the certified values; or leave k out")  # fmt: skip
    for name in here:
        if np.any(columns[name] < 0):
            line = points.lines[int(np.argmin(columns[name]))] if len(points.lines) else 0
            fix = "Give uncertainties in µm, 0 or more"
            raise CmmUqError(f"{name} is below 0", where=f"{where} line {line}", fix=fix)
    if here and artefact.nominal_only:
        raise CmmUqError(f"has {here[0]}, and nominal = true says that nothing is certified", where=where,
                         fix="Leave nominal or the column out")  # fmt: skip
    return points if columns is points.columns else replace(points, columns=columns)


def _rows_by_point(numbers: list[float], lines: list[int], place: str) -> dict[int, int]:
    rows: dict[int, int] = {}
    for row, number in enumerate(numbers):
        if number != round(number) or abs(number) > LARGEST_NUMBER:
            raise CmmUqError(f"{number:g} is not a whole number", where=f"{place} line {lines[row]}, column point",
                             fix="Number the points 1, 2, …")  # fmt: skip
        if int(number) in rows:
            raise CmmUqError(f"point {int(number)} is there twice", where=f"{place} line {lines[row]}", fix="Keep one")
        rows[int(number)] = row
    return rows


NOISE_RATIO = "noise_ratio"  # column: standard uncertainty of a difference over that of one coordinate


def against_earlier(later: Points, earlier: Points, cte_per_k: float, where: str) -> Points:
    """The later recording, means over repeats, with the earlier one as its reference positions, and :data:`NOISE_RATIO`.

    ``cte_per_k``: of the plate, which brings the earlier positions to 20 °C when their temperature was recorded.
    """
    now, then = _Balls(later), _Balls(earlier)
    known = {key: i for i, key in enumerate(map(tuple, then.keys.tolist()))}
    rows = []
    for (measurement, point), first in zip(now.keys.tolist(), now.first, strict=True):
        if (measurement, point) not in known:
            line = later.lines[first] if len(later.lines) else 0
            raise CmmUqError(f"measurement {measurement}, point {point} is not in the earlier recording",
                             where=f"{where} line {line}",
                             fix="Number placings and balls as on the earlier date, or leave it out")  # fmt: skip
        rows.append(known[measurement, point])
    references = then.means(earlier.xyz)[rows]
    if "temp_artefact_c" in earlier.columns and cte_per_k:
        excess = then.means(earlier.columns["temp_artefact_c"])[rows] - REFERENCE_TEMPERATURE
        references = references / (1 + cte_per_k * excess)[:, None]
    columns = {name: now.means(values) for name, values in later.columns.items()}
    columns |= {f"reference_{axis}_mm": references[:, i] for i, axis in enumerate(AXES)}
    columns[NOISE_RATIO] = np.sqrt(1 / now.counts + 1 / then.counts[rows])
    return Points(
        now.means(later.xyz), now.keys[:, 0], now.keys[:, 1], np.ones(len(now.keys), dtype=np.int64), later.machine,
        columns, later.lines[now.first] if len(later.lines) else later.lines,
    )  # fmt: skip


class _Balls:
    """Rows of a recording by (measurement, point): ``keys`` (b, 2), ``first`` row, ``counts`` of repeats."""

    def __init__(self, points: Points) -> None:
        numbers = np.column_stack([points.measurement, points.point])
        self.keys, first, inverse, counts = np.unique(
            numbers, axis=0, return_index=True, return_inverse=True, return_counts=True
        )
        self.first: Ints = first.astype(np.int64)
        self.counts: Floats = counts.astype(np.float64)
        self._index: Ints = inverse.ravel().astype(np.int64)

    def means(self, values: Floats) -> Floats:
        """Means of ``values`` (n,) or (n, 3) over the repeats of each ball."""
        sums = np.zeros((len(self.keys), *values.shape[1:]))
        np.add.at(sums, self._index, values)
        return np.asarray(sums / self.counts.reshape((-1,) + (1,) * (values.ndim - 1)), dtype=np.float64)
