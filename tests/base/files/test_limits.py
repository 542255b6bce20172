"""docs/limits.md prints the limits that the code holds."""

from __future__ import annotations

import re

from cmm_uq.base.files import csv_table as numbers, limits, table
from cmm_uq.jobs import columns
from cmm_uq.jobs.recording import own
from cmm_uq.jobs.tables.machine import SHORTEST_TRAVEL_MM
from tests.conftest import ROOT

PAGE = (ROOT / "docs" / "limits.md").read_text(encoding="utf-8")


def plain(number: float) -> str:
    """As the page writes it: 1e7, not 1e+07."""
    return re.sub(r"e\+?(-?)0*", r"e\1", f"{number:g}")


def test_the_table_of_the_page_is_that_of_the_module() -> None:
    rows = [
        tuple(cell.strip() for cell in line.strip("|").split("|")) for line in PAGE.splitlines() if line[:2] == "| "
    ]
    sizes = rows[rows.index(("of", "at most", "why")) + 2 :][: len(limits.LIMITS)]
    assert sizes == [(limit.what, f"{limit.most} {limit.unit}", limit.why) for limit in limits.LIMITS]


def test_every_limit_is_in_the_table() -> None:
    assert {id(v) for v in vars(limits).values() if isinstance(v, limits.Limit)} == {id(v) for v in limits.LIMITS}


def test_the_ranges_of_the_page_are_those_of_the_code() -> None:
    for text in (
        f"between {plain(numbers.SMALLEST)} and {plain(numbers.LARGEST)} in size",
        f"| {plain(columns.LARGEST_NUMBER)} | whole numbers",
        *(f"{ending}`" for ending in columns.LARGEST_OF),
        f"| `…_mm` | {plain(columns.LARGEST_OF['_mm'])} |",
        f"| `…_um` | {plain(columns.LARGEST_OF['_um'])} |",
        f"| `…_c` | {plain(columns.LARGEST_OF['_c'])} |",
        f"`…_deg` | {plain(columns.LARGEST_OF['_deg'])} |",
        f"between {plain(own.SHORTEST_NORMAL)} and {plain(own.LONGEST_NORMAL)} is refused",
        f"−{plain(table.LONGEST_MM)} … {plain(table.LONGEST_MM)}; a travel of at least {plain(SHORTEST_TRAVEL_MM)}",
        f"| `u_coordinate_um`, limits, µm | {plain(table.SMALLEST_UM)} … {plain(table.LARGEST_UM)} |",
        f"0, or {plain(table.SMALLEST_UM)} … {plain(table.LARGEST_UM)} |",
    ):
        assert text in PAGE
