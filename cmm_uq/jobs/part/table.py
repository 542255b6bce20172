"""A plan as a table (CSV, .xlsx, .ods): a row for each feature and each characteristic, with the keys of a job as its columns.

A row with a ``kind`` describes the feature that it names; one with a ``what`` asks something of it, or of two parted by ``|``.
Besides the keys of both tables there are x_mm, y_mm, z_mm for ``point_mm``, i, j, k for ``direction``, and nominal_mm with
lower_tol_mm and upper_tol_mm for two limits. Nothing is passed over: a column that is none of these is refused.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import Any, get_args

from cmm_uq.base.errors import CmmUqError, suggestion
from cmm_uq.base.files.csv_table import number_problem
from cmm_uq.jobs.importing.cells.encodings import decimal_sign, values_of
from cmm_uq.jobs.importing.format import Cell, ImportKeys, Sheet, format_of
from cmm_uq.jobs.part.drawing import Drawing, Facts, limits, usual_strategy
from cmm_uq.jobs.part.feature import CharacteristicFacts, FeatureFacts, Kind, Strategy

PROGRAM = "table"
NAMES = "feature", "kind", "characteristic", "what"
_PLACE, _DIRECTION = ("x_mm", "y_mm", "z_mm"), ("i", "j", "k")
_TOLERANCES = ("nominal_mm", "lower_tol_mm", "upper_tol_mm")
_OF_STRATEGY = tuple(Strategy.model_fields)
_VECTORS = "along", "normal"
_ELSEWHERE = {"name", "point_mm", "direction", "strategy", "points_mm", "form", "reported_as"}
_OF_FEATURE = {*FeatureFacts.model_fields} - _ELSEWHERE
_OF_CHARACTERISTIC = {*CharacteristicFacts.model_fields} - {"name", "features", "reported_as"}
_TEXTS = {*NAMES, *_VECTORS, "datums", "stylus", "association", "pattern", "inner"}
_OWN = (*NAMES, *_PLACE, *_DIRECTION, *_TOLERANCES)
COLUMNS = tuple(dict.fromkeys((*_OWN, *sorted(_OF_FEATURE | _OF_CHARACTERISTIC), *_OF_STRATEGY)))
_WHOLE = {*_OF_STRATEGY} - {"pattern", "turns", "start_deg", "sweep_deg", "cap_deg", "margin_mm"}
_LIMITS = f"Fill in {', '.join(_TOLERANCES)}, or lower_mm and upper_mm"
_TRUE, _FALSE = ("yes", "true", "1", "x"), ("no", "false", "0", "")


def drawing_of_table(content: bytes, where: str) -> Drawing:
    """Features and characteristics of a table.

    Raises
    ------
    CmmUqError
        It is no table with a column ``feature``, a column or a cell is not understood, or a feature stands twice.
    """
    for sheet in format_of(content, where).read(content, where, ImportKeys()):
        for head, row in enumerate(sheet.rows):
            if row and str(row[0]).strip().lower() == NAMES[0]:
                return _drawing(sheet, head, where)
    fix = f"Give it a row of headings that begins with feature: {', '.join(COLUMNS[:12])}, …; or export QIF or DMIS"
    raise CmmUqError("is neither a QIF plan, nor a DMIS program, nor a table of features", where=where, fix=fix)


def _drawing(sheet: Sheet, head: int, where: str) -> Drawing:
    headings = [str(cell).strip().lower() for cell in sheet.rows[head]]
    for i, heading in enumerate(headings):
        if heading not in COLUMNS or heading in headings[:i]:
            problem = "stands twice" if heading in COLUMNS else "is no column of a plan"
            raise CmmUqError(f"{heading!r} {problem}", where=sheet.at(where, head, i), fix=suggestion(heading, COLUMNS))
    drawing, defined = Drawing(PROGRAM), set[str]()
    for i, facts in _rows(sheet, head, headings, where):
        name, kind, what = (str(facts.pop(key, "")) for key in ("feature", "kind", "what"))
        number, at = str(facts.pop("characteristic", "")) or str(len(drawing.characteristics) + 1), sheet.at(where, i)
        if not name or not (kind or what):
            problem = "names no feature" if not name else f"says of {name!r} neither its kind nor what is asked of it"
            raise CmmUqError(problem, where=at, fix="Fill in feature, and kind or what")
        if kind:
            if name in defined:
                raise CmmUqError(f"describes {name!r} again", where=at, fix="Leave kind empty in this row")
            defined.add(name)
            drawing.features.append(_feature(name, kind, facts, drawing))
        if what:
            drawing.characteristics.append(_characteristic(number, what, name, facts, at))
        if facts:
            of, key = ("characteristic", "what") if kind else ("feature", "kind")
            problem = f"{next(iter(facts))} belongs to a {of}, and the row is none"
            raise CmmUqError(problem, where=at, fix=f"Fill in {key}, or empty it")
    return drawing


def _rows(sheet: Sheet, head: int, headings: Sequence[str], where: str) -> list[tuple[int, Facts]]:
    """What each row with something in it says, by heading; numbers with one decimal sign."""
    rows = [i for i in range(head + 1, len(sheet.rows)) if any(cell != "" for cell in sheet.rows[i])]
    cells: dict[str, list[tuple[int, Cell]]] = {}
    for k, heading in enumerate(headings):
        there = [i for i in rows if k < len(sheet.rows[i]) and sheet.rows[i][k] != ""]
        cells[heading] = [(i, sheet.rows[i][k]) for i in there]
    figures = [heading for heading in headings if heading not in _TEXTS]

    def at(column: int, row: int) -> str:
        return sheet.at(where, cells[figures[column]][row][0], headings.index(figures[column]), figures[column])

    sign = decimal_sign([[cell for _, cell in cells[one]] for one in figures], at, sheet.decimal)
    found: dict[int, Facts] = {i: {} for i in rows}
    for heading, column in cells.items():
        if heading in _TEXTS:
            values: Sequence[Any] = [_text(heading, cell, sheet.at(where, i)) for i, cell in column]
        else:
            each = partial(at, figures.index(heading))
            values = values_of([cell for _, cell in column], sign, each).tolist()
        for (i, _), value in zip(column, values, strict=True):
            found[i][heading] = int(value) if heading in _WHOLE and value == int(value) else value
    return list(found.items())


def _text(heading: str, cell: Cell, where: str) -> str | bool | list[str] | list[float]:
    text = f"{cell:g}" if isinstance(cell, float) else str(cell).strip()
    if heading == "inner":
        if text.lower() not in (*_TRUE, *_FALSE):
            raise CmmUqError(f"inner is yes or no, not {text!r}", where=where, fix="yes of a hole, no of a shaft")
        return text.lower() in _TRUE
    if heading in _VECTORS:
        parts = text.split()
        if len(parts) != 3 or any(number_problem(one) for one in parts):
            raise CmmUqError(f"{text!r} is no direction", where=where, fix="Write three numbers, such as 0 0 1")
        return [float(one) for one in parts]
    return [one.strip() for one in text.split("|")] if heading == "datums" else text


def _feature(name: str, kind: str, facts: Facts, drawing: Drawing) -> Facts:
    made: Facts = {"name": name, "kind": kind}
    for key, columns in (("point_mm", _PLACE), ("direction", _DIRECTION)):
        if values := [facts.pop(column) for column in columns if column in facts]:
            made[key] = values
    if strategy := {key: facts.pop(key) for key in _OF_STRATEGY if key in facts}:
        made["strategy"] = {"pattern": "points", **strategy}
    elif kind != "point":
        made["strategy"] = usual_strategy(kind) if kind in get_args(Kind) else {"pattern": "points", "points": 1}
        drawing.open_keys[name] = ["strategy"]
    return made | {key: facts.pop(key) for key in sorted(_OF_FEATURE & facts.keys())}


def _characteristic(number: str, what: str, feature: str, facts: Facts, where: str) -> Facts:
    made: Facts = {"name": number, "what": what, "features": [one.strip() for one in feature.split("|")]}
    if "nominal_mm" in facts or "upper_tol_mm" in facts:
        nominal, below, above = (facts.pop(key, None) for key in _TOLERANCES)
        if nominal is None or below is None or above is None or {"lower_mm", "upper_mm"} & facts.keys():
            said = "has a nominal value without both tolerances, or limits beside it"
            raise CmmUqError(said, where=where, fix=_LIMITS)
        made |= limits(what, nominal + below, nominal + above)
    return made | {key: facts.pop(key) for key in sorted(_OF_CHARACTERISTIC & facts.keys())}
