"""Distances of a DMIS output: nominal ``T(D1)=TOL/DISTB,NOMINL,100,…``, measured ``TA(D1)=TOL/DISTB,100.0004,…``."""

from __future__ import annotations

import re
from collections.abc import Iterable

from cmm_uq.base.files.csv_table import number_problem
from cmm_uq.jobs.importing.format import Cell, Fact, NotReadError, Sheet

_TOLERANCE = re.compile(r"^T(?P<actual>A)?\s*\((?P<name>[^)]*)\)\s*=\s*TOL\s*/\s*DISTB\s*,(?P<rest>.*)$", re.IGNORECASE)
_ALONG = ("XAXIS", "YAXIS", "ZAXIS")
_NEAR = 0.1  # in the unit of the file, within which what was measured is of a nominal distance of another name
_TEXT = re.compile(r"^TEXT\s*/\s*OUTFIL\s*,\s*'(?P<text>[^']*)'", re.IGNORECASE)


def distances_in(
    statements: Iterable[tuple[int, str]], unit: str | None, facts: tuple[Fact, ...], where: str
) -> list[Sheet]:
    """A sheet of nominal and measured distances below the texts that stand ahead of them; none where there are none."""
    rows: list[list[Cell]] = [["name", "axis", "nominal", "measured"]]
    lines, nominal, found = [0], dict[str, str](), list[int]()
    for line, statement in statements:
        if (text := _TEXT.match(statement)) and text["text"].strip():
            rows.append([text["text"].strip()])
            lines.append(line)
        if (match := _TOLERANCE.match(statement)) is None:
            continue
        words = [word.strip() for word in match["rest"].split(",")]
        figures = [word for word in words if not word[:1].isalpha()]
        if not figures or number_problem(figures[0]):
            raise NotReadError("has no figure", where=f"{where} line {line}", fix="Export it again")
        if not match["actual"]:
            if words[0].upper() == "NOMINL" and not number_problem(figures[0]):
                nominal[match["name"]] = figures[0]
            continue
        near = [own for own, value in nominal.items() if abs(float(value) - float(figures[0])) < _NEAR]
        name = match["name"] if match["name"] in nominal else near[0] if len(near) == 1 else ""
        if not name:  # of several lengths, one nominal distance each
            what = f"TA({match['name']}) has no nominal distance: T({match['name']})=TOL/DISTB,NOMINL,…"
            raise NotReadError(what, where=f"{where} line {line}", fix="Put the tolerances out with what is measured")
        found.append(len(rows))
        axis = next((word[0].upper() for word in words if word.upper() in _ALONG), "")
        rows.append([match["name"], axis, nominal[name], figures[0]])
        lines.append(line)
    if not found:
        return []
    lines[0] = lines[found[0]]
    if any(rows[k][1] == "" for k in found):  # one along no axis: names tell the lines of all
        rows = [[row[0], *row[2:]] if k in (0, *found) else row for k, row in enumerate(rows)]
    return [Sheet("", rows, lines, unit=unit, decimal=".", facts=facts)]
