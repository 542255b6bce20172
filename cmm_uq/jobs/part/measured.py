"""Measured points of a part: a CSV with a row a point, which names the feature and the point of its plan."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from cmm_uq.base.errors import CmmUqError, Gathered, suggestion
from cmm_uq.base.files.cells import Cells, cells_of
from cmm_uq.base.files.numbers import numbers
from cmm_uq.base.points import Floats
from cmm_uq.jobs.part.probed import Probed

COLUMNS = ("feature", "point", "x_mm", "y_mm", "z_mm")
FAR_MM = 5.0
"""From the nominal contact point: a measured one farther away is in another frame, unit or order."""

_IN_UNITS = {
    1 / 25.4: "in inches", 1e-3: "in metres", 25.4: "taken for inches once too often", 1e3: "in µm",
}  # fmt: skip
"""By what the factor of points in another unit to those in mm is; a scale that is off by a hundredth is another matter."""

_FIX = "Save it as CSV in UTF-8, with commas between the columns"


def measured_points(content: bytes, where: str, features: Sequence[Probed]) -> Floats:
    """(n, 3) measured points in the order of the plan's, mm.

    Parameters
    ----------
    content : of the file.
    where : its name, for messages.
    features : of the plan, in order.

    Raises
    ------
    CmmUqError : a column is missing, a cell is no number, a point is missing, unknown, there twice or far from its nominal.
    """
    cells = cells_of(content, where, _FIX)
    for name in COLUMNS:
        if name not in cells.header:
            raise CmmUqError(f"has no column {name!r}", where=where,
                             fix=f"Its columns are {', '.join(COLUMNS)}, with commas between them")  # fmt: skip
    short = next((i for i, row in enumerate(cells.rows) if len(row) != len(cells.header)), None)
    if short is not None:
        raise CmmUqError(f"has {len(cells.rows[short])} cells, and the header {len(cells.header)}",
                         where=f"{where} line {cells.lines[short]}", fix="Complete the row")  # fmt: skip
    place = [cells.header.index(name) for name in COLUMNS]
    number = np.column_stack([_column(cells, i, where) for i in place[1:]])
    names = [row[place[0]] for row in cells.rows]
    return in_order(names, number[:, 0], number[:, 1:], cells, where, features)


def _column(cells: Cells, i: int, where: str) -> Floats:
    return numbers(
        [row[i] for row in cells.rows],
        lambda row: f"{where} line {cells.lines[row]}, column {cells.header[i]}",
        "Give a number: every point of the plan is needed",
    )


def in_order(
    names: Sequence[str], point: Floats, xyz: Floats, cells: Cells, where: str, features: Sequence[Probed]
) -> Floats:
    """(n, 3) points in the order of the plan's, of rows that name feature and point.

    Raises
    ------
    CmmUqError : see :func:`measured_points`.
    """
    known = {one.facts.name: one for one in features}
    rows: dict[tuple[str, int], int] = {}
    wrong = Gathered()
    for row, (name, index) in enumerate(zip(names, point.tolist(), strict=True)):
        at = f"{where} line {cells.lines[row]}"
        count = len(known[name].points) if name in known else 0
        if name not in known:
            wrong.add(CmmUqError(f"there is no feature {name!r}", where=at, fix=suggestion(name, known)))
        elif index != int(index) or not 1 <= index <= count:
            wrong.add(CmmUqError(f"{name!r} has no point {index:g}", where=at, fix=f"It has 1 to {count} by its plan"))
        elif (name, int(index)) in rows:
            wrong.add(
                CmmUqError(f"point {index:g} of {name!r} stands there twice", where=at, fix="Leave one of them out")
            )
        else:
            rows[name, int(index)] = row
            away = float(np.linalg.norm(xyz[row] - known[name].points[int(index) - 1]))
            if away > FAR_MM:
                wrong.add(CmmUqError(f"point {index:g} of {name!r} lies {away:.4g} mm from where it is planned", where=at,
                                     fix="Give it in mm in the frame of the part, in the order of the plan"))  # fmt: skip
    if wrong.problems:
        _refuse_another_unit(rows, xyz, known, where)
    wrong.refuse()
    for one in features:
        for index in range(1, len(one.points) + 1):
            if (one.facts.name, index) not in rows:
                raise CmmUqError(f"point {index} of {one.facts.name!r} is missing", where=where,
                                 fix=f"Give all of its {len(one.points)} points")  # fmt: skip
    wanted = [rows[one.facts.name, index] for one in features for index in range(1, len(one.points) + 1)]
    return np.asarray(xyz[wanted])


def _refuse_another_unit(
    rows: Mapping[tuple[str, int], int], xyz: Floats, known: Mapping[str, Probed], where: str
) -> None:
    """Say it once where all points are off by the factor of another unit, about the part's origin."""
    if not rows:
        return
    planned = np.array([known[name].points[index - 1] for name, index in rows])
    found = xyz[list(rows.values())]
    factor = float(np.sum(found * planned)) / (float(np.sum(planned**2)) or 1.0)
    unit = next((words for each, words in _IN_UNITS.items() if abs(factor / each - 1) < 0.01), None)
    if unit and np.linalg.norm(found / factor - planned, axis=1).max() <= FAR_MM:
        raise CmmUqError(f"the points are {factor:.4g} times those of the plan, as if they were {unit}", where=where,
                         fix="Give them in mm in the frame of the part")  # fmt: skip
