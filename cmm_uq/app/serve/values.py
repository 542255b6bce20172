"""Values as certificates state them, in a table: estimate, interval, limit."""

from __future__ import annotations

from collections.abc import Iterable

from cmm_uq.app.serve.page import Cell, Column, Table
from cmm_uq.app.serve.words import shown
from cmm_uq.base.messages import DASH, Text, Verbatim, number, say
from cmm_uq.laboratory.records.facts import Value
from cmm_uq.laboratory.records.listing import Stated
from cmm_uq.maths.uncertainty.rounding import rounded

COLUMNS = (
    Column(say("Quantity")), Column(say("Value"), sort="number"), Column(say("95 % interval"), sort="number"),
    Column(say("Limit"), sort="number"), Column(say("Unit")),
)  # fmt: skip


def values_table(
    caption: Text, rows: Iterable[tuple[str, str, Value | Stated]], empty: Text, *, heard: bool = False
) -> Table:  # fmt: skip
    """A row for each; a value beyond its limit is marked.

    Parameters
    ----------
    rows : quantity and unit as printed, and what is stated of it.
    """
    return Table(caption, COLUMNS, tuple(_row(*row) for row in rows), empty, heard=heard)


def _row(quantity: str, unit: str, one: Value | Stated) -> tuple[Cell, ...]:
    half = 0.5 * (one.upper - one.lower)
    value, lower, upper = (rounded(figure, half)[0] for figure in (one.value, one.lower, one.upper))
    beyond = one.limit is not None and abs(one.value) > one.limit
    return (
        Cell(Verbatim(quantity)), Cell(value, standing="bad" if beyond else None),
        Cell(say("{lower} to {upper}", lower=lower, upper=upper)), Cell(DASH if one.limit is None else number(one.limit, "g")),
        Cell(shown(unit)),
    )  # fmt: skip
