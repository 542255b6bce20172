"""Reports of features (spheres, points, circles): a sheet for each sort, of which the job says which."""

from __future__ import annotations

from collections.abc import Sequence

from cmm_uq.jobs.importing.sheet import Cell, Fact, Sheet

Row = tuple[str, list[Cell], int]
"""Sort of feature, its cells, its line."""


def sheets_of(
    rows: Sequence[Row], headings: Sequence[str], *, unit: str | None, decimal: str | None = None,
    facts: tuple[Fact, ...] = (),
) -> list[Sheet]:  # fmt: skip
    """A sheet for each sort of feature.

    Parameters
    ----------
    rows : of all features.
    headings : of their cells.
    unit, decimal : of their lengths and numbers, where the format says them.
    facts : recognised.
    """
    sheets = []
    for sort in dict.fromkeys(sort for sort, _, _ in rows):
        own = [(cells, line) for of, cells, line in rows if of == sort]
        kept = [i for i in range(len(headings)) if any(cells[i] != "" for cells, _ in own)]
        table: list[list[Cell]] = [[headings[i] for i in kept], *([cells[i] for i in kept] for cells, _ in own)]
        lines = [own[0][1], *(line for _, line in own)]
        name = f"{sort}s" if sort else ""
        sheets.append(Sheet(name, table, lines, listed=True, unit=unit, decimal=decimal, facts=facts))
    return sheets
