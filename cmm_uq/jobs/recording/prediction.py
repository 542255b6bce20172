"""``[simulation]``: what a simulation, by whatever program, predicts for a recording, and the reading of it.

It names error maps of the machine or a CSV with one row a point: ``measurement, point, repeat, x_mm, y_mm, z_mm``; or, for
lengths, one row a measurement with ``length_mm``. Optional ``u_um``. Cells are separated by commas, semicolons or tabs; where
they are not separated by commas, a number may have a decimal comma. Exponents may be written with E or D. Further columns are
passed over.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field, field_validator

from cmm_uq.base.errors import CmmUqError, suggestion
from cmm_uq.base.files.content import text_of
from cmm_uq.base.files.csv_table import Cells, cells_of, numbers
from cmm_uq.base.files.limits import MAPS
from cmm_uq.base.files.table import JobTable, Length, Names, Uncertainty, key
from cmm_uq.base.points import Floats, Ints
from cmm_uq.base.units import MICROMETRE
from cmm_uq.jobs.columns import COORDINATES, WHOLE, largest
from cmm_uq.jobs.tables.machine import ErrorMapFile

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
        for name in ("length_mm", "unit", "columns"):
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

    def place(column: int, row: int) -> str:
        return f"{where} line {cells.lines[row]}, column {cells.header[column]}"

    for column, i in _places(cells, where, facts).items():
        at = partial(place, i)
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
    _check_unique(prediction)
    return prediction


def is_error_map(content: bytes, where: str) -> bool:
    """Whether a file is no prediction but an error map as CSV."""
    return set(_OF_A_MAP) <= {name.strip() for name in _header(text_of(content, where, _FIX)).split(",")}


def _table(content: bytes, where: str) -> Cells:
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
    return Cells(cells.header, cells.header_line, rows, cells.lines)


def _header(text: str) -> str:
    """The line that names the columns."""
    return next((line for line in text.splitlines() if line.strip() and not line.lstrip().startswith("#")), "")


def _plain(cell: str, *, decimal_comma: bool) -> str:
    """A number as it is written here; anything else as it stands."""
    if decimal_comma and _DECIMAL_COMMA.fullmatch(cell):
        cell = cell.replace(",", ".")
    return _FORTRAN.sub(r"\1e\2", cell) if _FORTRAN.fullmatch(cell) else cell


def _places(cells: Cells, where: str, facts: SimulationFacts) -> dict[str, int]:
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
        raise CmmUqError(f"{values[i]:g} {'is more than anything that is measured' if beyond[i] else why}", where=at(i),
                         fix="Check the column and its unit")  # fmt: skip


def _check_unique(prediction: Prediction) -> None:
    repeat = np.ones_like(prediction.lines) if prediction.repeat is None else prediction.repeat
    seen: dict[tuple[int, ...], int] = {}
    keys = np.column_stack([prediction.measurement, prediction.point, repeat]).tolist()
    for row, line in zip(map(tuple, keys), prediction.lines.tolist(), strict=True):
        if row in seen:
            point = "" if prediction.of_lengths else f", point {row[1]}"
            raise CmmUqError(f"measurement {row[0]}{point} is predicted twice",
                             where=f"{prediction.where} lines {seen[row]} and {line}",
                             fix="Number repeats in a column repeat, as the recording does, or keep one")  # fmt: skip
        seen[row] = line
