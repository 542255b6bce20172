"""What a recording is compared with: certified values of its points, an earlier recording, or what a simulation predicts.

What an earlier recording found of the same plate takes the place of a certificate. Errors of the plate and of the machine that
were there on both dates cancel, as long as the plate stands in the same place; what remains is what changed between, and its
noise is that of both recordings.

``[simulation]`` names error maps of the machine or, of whatever program, a CSV with one row a point: ``measurement, point,
repeat, x_mm, y_mm, z_mm``; or, for lengths, one row a measurement with ``length_mm``. Optional ``u_um``. Cells are separated
by commas, semicolons or tabs; where they are not separated by commas, a number may have a decimal comma. Exponents may be
written with E or D. Further columns are passed over.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field, field_validator

from cmm_uq.base.errors import CmmUqError, suggestion
from cmm_uq.base.files.csv_table import CsvTable, cells_of, numbers
from cmm_uq.base.files.limits import MAPS, text_of
from cmm_uq.base.files.table import AnyFloat, Expansion, JobTable, Length, Names, Uncertainty, key
from cmm_uq.base.points import AXES, Floats, Ints, Points
from cmm_uq.base.units import MICROMETRE, REFERENCE_TEMPERATURE
from cmm_uq.base.values import dataclass, replace
from cmm_uq.jobs.columns import COORDINATES, LARGEST_NUMBER, OPTIONAL, WHOLE, largest
from cmm_uq.jobs.importing.format import Recognition
from cmm_uq.jobs.tables.artefact import ArtefactFacts
from cmm_uq.jobs.tables.length_formula import divisor_of
from cmm_uq.jobs.tables.machine import ErrorMapFile

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
    from cmm_uq.jobs.importing import header, recording  # with all that understands what others wrote

    chain = artefact.certificate
    if chain is None or chain.file is None:
        raise CmmUqError("the certificate names no file", where=where)
    place = str(folder / chain.file)
    if twice := [name for name in REFERENCES if name in points.columns]:
        raise CmmUqError(f"has {twice[0]}, and so has {chain.file}", where=where, fix="Leave one of them out")
    found = recording.imported_references(inputs[chain.file], place, chain)
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
    if EXPANDED in columns and (stated := header.COVERAGE.search(found.recognised.columns[EXPANDED])):
        k = float(stated[1].replace(",", "."))
        if artefact.k not in (None, k) or not 1 <= k <= 10:
            raise CmmUqError(f"says k = {k:g} in a heading", where=place, fix="Mend it, or [artefact] k")
        columns[STANDARD] = columns.pop(EXPANDED) / (k if artefact.degrees_of_freedom else divisor_of(k, None) or k)
    for name, values in columns.items():
        if np.any(np.abs(values) > largest(name)):
            raise CmmUqError(f"{name} is more than anything that is measured", where=place, fix="Check its unit")
    return replace(points, columns={**points.columns, **columns}), found.recognised


def with_uncertainties(points: Points, artefact: ArtefactFacts, where: str, unread: Sequence[str] = ()) -> Points:
    """A recording with the standard uncertainty of its certified values in place of the expanded one."""
    columns, factor = points.columns, divisor_of(artefact.k, artefact.degrees_of_freedom)
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
    elif here and artefact.degrees_of_freedom is not None:
        divisor = divisor_of(1.0, artefact.degrees_of_freedom) or 1.0
        columns = {**columns, **{name: columns[name] / divisor for name in here}}
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


def refuse_copy(points: Points, earlier: Points, planned: bool, where: str) -> None:
    """Refuse an earlier recording that has the same coordinates to the last digit: it says nothing of a change."""
    orders = (np.lexsort((one.repeat, one.point, one.measurement)) for one in (points, earlier))
    every = (np.column_stack([one.measurement, one.point, one.repeat, one.xyz]) for one in (points, earlier))
    now, then = (rows[order] for rows, order in zip(every, orders, strict=True))
    if not planned and np.array_equal(now, then):
        problem = "is the recording itself to the last digit, of which no reading was made again"
        raise CmmUqError(problem, where=where, fix="Name the recording of the earlier date")


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


KEY = "[simulation]"

UNIT_MM = {"mm": 1.0, "m": 1000.0, "cm": 10.0, "um": 1e-3, "inch": 25.4}  # of predicted coordinates and lengths

NOMINAL_C = 20.0  # °C of a map that is named without its temperature


class SimulationFacts(JobTable):
    """``[simulation]``."""

    file: str | None = key(None, "File of predicted coordinates or lengths.")
    map: Annotated[list[ErrorMapFile], Field(max_length=MAPS.most)] = []
    """In place of a file, error maps: the displacements that they give at the recorded positions are the prediction."""
    program: str = key("", "Program that made the prediction, in your words.")
    u_um: Uncertainty = 0.0
    """Standard uncertainty of each predicted coordinate (or length), where the file has no column of it; repeats share it."""
    u_common_um: Uncertainty = key(0.0, "Standard uncertainty of the artefact's size that all predictions share.")
    length_mm: Length | None = None
    """Length of the artefact, as the simulation took it; otherwise that of [artefact]."""
    cte_per_k: Expansion | None = None
    """Coefficient of thermal expansion of the artefact, 1/K, as the simulation took it; otherwise that of [artefact]."""
    temperature_c: AnyFloat | None = None
    """Temperature of the artefact, as the simulation took it; otherwise `temp_artefact_c` as recorded."""
    unit: Literal["mm", "m", "cm", "um", "inch"] = key("mm", "Unit of predicted coordinates and lengths.")
    columns: Annotated[dict[str, str], Field(max_length=10)] = {}
    """Names of the file's columns, where they are others than the recording's."""
    effects: Names = key([], "Effects that the simulation contains.")
    refit: bool = key(False, "Whether these are estimated anew, as corrections to what the simulation contains.")

    @field_validator("map", mode="before")
    @classmethod
    def _one_or_several(cls, given: Any) -> Any:
        if isinstance(given, str):
            given = {"file": given, "temperature_c": NOMINAL_C}
        return [given] if isinstance(given, dict) else given

    def problems(self) -> Iterator[str]:
        if (self.file is None) == (not self.map):
            yield 'give either file = "predicted.csv", or map = "error_map.csv"'
        if self.refit and not self.effects:
            yield "refit = true says nothing of what: name the effects that the simulation contains"
        if any(given.covariance is not None for given in self.map):
            yield "a covariance belongs to a map under [machine], whose corrections are made with it: leave it out"
        for name in ("length_mm", "cte_per_k", "temperature_c", "unit", "columns"):
            if self.map and name in self.model_fields_set:
                yield f"{name} belongs to a file of predictions, not to a map: leave it out"


LENGTH, UNCERTAINTY = "length_mm", "u_um"
KNOWN = (*WHOLE, *COORDINATES, LENGTH, UNCERTAINTY)
_OF_A_MAP = ("axis", "position_mm")
_FIX = "Save it as CSV in UTF-8"
_DECIMAL_COMMA = re.compile(r"[+-]?\d*,\d*([eEdD][+-]?\d+)?")
_FORTRAN = re.compile(r"([+-]?(?:\d+\.?\d*|\.\d+))[dD]([+-]?\d+)")


@dataclass(frozen=True, eq=False)
class Prediction:
    """What a simulation predicts, (r,) rows with their lines: coordinates (r, 3) or lengths (r,), mm; the other has none.

    ``u``: standard uncertainty of a coordinate, or of the length, mm; ``point``: zeros of lengths; ``repeat``: ``None`` where
    the prediction holds for all.
    """

    where: str
    measurement: Ints
    point: Ints
    repeat: Ints | None
    xyz: Floats
    length: Floats
    u: Floats
    lines: Ints

    @property
    def of_lengths(self) -> bool:
        return bool(len(self.length))


def read_prediction(content: bytes, where: str, facts: SimulationFacts) -> Prediction:
    cells = _table(content, where)
    table: dict[str, Floats] = {}
    for column, i in _places(cells, where, facts).items():
        at = partial(cells.at, column=cells.header[i])
        values = numbers([row[i] for row in cells.rows], at)
        table[column] = values * (UNIT_MM[facts.unit] if column in (*COORDINATES, LENGTH) else 1.0)
        _check_size(table[column], column, at)
    whole = {name: table[name].astype(np.int64) for name in WHOLE if name in table}
    count, lengths = len(cells.rows), LENGTH in table
    none = np.zeros(count, dtype=np.int64)
    prediction = Prediction(
        where, whole["measurement"], none if lengths else whole.get("point", none), whole.get("repeat"),
        np.zeros((0, 3)) if lengths else np.column_stack([table[name] for name in COORDINATES]),
        table[LENGTH] if lengths else np.zeros(0), MICROMETRE * table.get(UNCERTAINTY, np.full(count, facts.u_um)),
        np.array(cells.lines, dtype=np.int64),
    )  # fmt: skip
    seen: dict[tuple[float, ...], int] = {}
    keys = np.column_stack([prediction.measurement, prediction.point, table.get("repeat", np.ones(count))]).tolist()
    for (measurement, point, repeat), line in zip(keys, cells.lines, strict=True):
        other = seen.setdefault((measurement, point, repeat), line)
        if other != line:
            of = f"measurement {measurement:g}" + ("" if lengths else f", point {point:g}")
            fix = "Number repeats in a column repeat, as the recording does, or keep one"
            raise CmmUqError(f"{of} is predicted twice", where=f"{where} lines {other} and {line}", fix=fix)
    return prediction


def is_error_map(content: bytes, where: str) -> bool:
    """Whether a file is no prediction but an error map as CSV."""
    return set(_OF_A_MAP) <= {name.strip() for name in _header(text_of(content, where, _FIX)).split(",")}


def _table(content: bytes, where: str) -> CsvTable:
    head = _header(text_of(content, where, _FIX))
    delimiter = ";" if ";" in head else "\t" if "\t" in head else ","
    cells = cells_of(content, where, _FIX, delimiter=delimiter)
    if not cells.rows:
        raise CmmUqError("has no rows", where=where, fix="The first line names the columns, then one row a point")
    width = len(cells.header)
    for row, line in zip(cells.rows, cells.lines, strict=True):
        if len(row) != width and not (len(row) == width + 1 and not row[-1]):
            raise CmmUqError(f"has {len(row)} cells where the header has {width}", where=f"{where} line {line}",
                             fix="Complete the row; a decimal comma needs semicolons between cells")  # fmt: skip
    rows = [[_plain(cell, decimal_comma=delimiter != ",") for cell in row] for row in cells.rows]
    return replace(cells, rows=rows)


def _header(text: str) -> str:
    """The line that names the columns."""
    return next((line for line in text.splitlines() if line.strip() and not line.lstrip().startswith("#")), "")


def _plain(cell: str, *, decimal_comma: bool) -> str:
    """A number as it is written here; anything else as it stands."""
    if decimal_comma and _DECIMAL_COMMA.fullmatch(cell):
        cell = cell.replace(",", ".")
    return _FORTRAN.sub(r"\1e\2", cell) if _FORTRAN.fullmatch(cell) else cell


def _places(cells: CsvTable, where: str, facts: SimulationFacts) -> dict[str, int]:
    """Where in a row the columns stand that are read, by the recording's names."""
    header, at = cells.header, f"{where} line {cells.header_line}"
    if unknown := next((name for name in facts.columns if name not in KNOWN), None):
        raise CmmUqError(f"a prediction has no {unknown!r}", where=f"job.toml {KEY} columns",
                         fix=suggestion(unknown, KNOWN))  # fmt: skip
    if set(_OF_A_MAP) <= set(header):
        raise CmmUqError("is an error map", where=at, fix=f"Name it as map in job.toml {KEY}, not as file")
    places: dict[str, int] = {}
    for name in KNOWN:
        heading = facts.columns.get(name, name)
        if header.count(heading) > 1:
            raise CmmUqError(f"the column {heading!r} is there twice", where=at, fix="Keep one")
        if heading in header:
            places[name] = header.index(heading)
        elif name in facts.columns:
            raise CmmUqError(f"there is no column {heading!r}", where=at,
                             fix=f"{suggestion(heading, header)}, in job.toml {KEY} columns")  # fmt: skip
    needed = ("measurement", LENGTH) if LENGTH in places else ("measurement", "point", *COORDINATES)
    if missing := next((name for name in needed if name not in places), None):
        raise CmmUqError(f"no column {missing!r}", where=at,
                         fix=f'Say which it is in job.toml {KEY}: columns = {{ {missing} = "…" }}, unit = "mm"')  # fmt: skip
    if LENGTH in places and "x_mm" in places:
        raise CmmUqError("predicts coordinates and lengths", where=at, fix="Leave one of them out")
    return places


def _check_size(values: Floats, column: str, at: Callable[[int], str]) -> None:
    bad, why = np.zeros(len(values), dtype=bool), ""
    if column in WHOLE:
        bad, why = values != np.round(values), "is not a whole number"
    elif column == UNCERTAINTY:
        bad, why = values < 0, "is no standard uncertainty"
    elif column == LENGTH:
        bad, why = values <= 0, "is no length"
    beyond = np.abs(values) > largest(column)
    if np.any(bad | beyond):
        i = int(np.argmax(bad | beyond))
        why = "is more than anything that is measured" if beyond[i] else why
        raise CmmUqError(f"{values[i]:g} {why}", where=at(i), fix="Check the column and its unit")
