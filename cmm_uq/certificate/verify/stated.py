"""Whether a document states the figures of its ``results.json``, each in its row, rounded as the package rounds, in its unit.

Whatever the language, a quantity is a row with its value, U and k in cells side by side; rows of one table follow each other
as the quantities do in the file; names of rows are compared between the views.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from hashlib import sha256
from typing import Any

from cmm_uq.base.units import UNITS
from cmm_uq.certificate.verify.figures import quantities
from cmm_uq.certificate.verify.found import Inquiry
from cmm_uq.certificate.verify.html_page import HtmlPage, HtmlTable
from cmm_uq.laboratory.records.content import unit_of
from cmm_uq.maths.uncertainty.quantity import Quantity, limit_in_full, rounded

GROUPS = ("accuracy_uncertainty", "estimates", "differences")
"""Parts of results.json whose quantities a certificate states, all of them that are determined."""

_ONE_HILL = 1.6
_NO_FACTOR = "–"
Stated = tuple[str, str, str]  # value, U and k as printed


def check_stated(inquiry: Inquiry, data: Mapping[str, Any], page: HtmlPage, *, files: tuple[str, str]) -> None:
    """Keep every quantity and every decision that a page states otherwise, or not at all."""
    name, source = files
    known = set((data["job"].get("inputs_sha256") or {}).values())
    for picture in page.pictures:
        if sha256(picture).hexdigest() not in known:
            inquiry.wrong("figures", name, "logo", f"is no input of {source}")
    if "estimates" in data:
        free = _undetermined(data)
        for group in GROUPS:
            asked = [
                (path, as_stated(one), unit_of(path.rpartition(".")[2]))
                for path, one in quantities(data.get(group) or {}, group)
                if path.removeprefix(f"{group}.") not in free and one["value"] is not None and not _one_sided(one)
            ]
            _check_group(inquiry, asked, page.tables, name, source)
    _check_decisions(inquiry, data, page, name, source)


def _one_sided(quantity: Mapping[str, Any]) -> bool:
    """Whether it is stated by its interval, in words of the page's language."""
    return Quantity(quantity["value"], quantity["u"], (*quantity["interval95"],), UNITS["1"]).one_sided


def as_stated(quantity: Mapping[str, Any]) -> Stated:
    """Value, U and k as a certificate prints them."""
    value, expanded = rounded(quantity["value"], quantity["U"])
    k = quantity["k"]
    return value, expanded, _NO_FACTOR if k is None or k < _ONE_HILL else f"{k:.2f}"


def _undetermined(data: Mapping[str, Any]) -> set[str]:
    """Parameters of which a certificate says that they are not determined."""
    combinations = (data.get("identifiability") or {}).get("undetermined") or ()
    return {name for combination in combinations for name in combination}


def _check_group(
    inquiry: Inquiry, asked: Sequence[tuple[str, Stated, str]], tables: Sequence[HtmlTable], name: str, source: str
) -> None:
    """A group of quantities in the table that has most of them."""
    if not asked:
        return
    inquiry.looked("figures", len(asked))
    rows_of = [[row for row in map(_statement, table.rows) if row is not None] for table in tables]
    wanted = [stated for _, stated, _ in asked]
    best = max(rows_of, key=lambda rows: sum(stated in [row for row, _ in rows] for stated in wanted), default=[])
    everywhere = [row for rows in rows_of for row in rows]
    left = list(best)
    for path, stated, unit in asked:
        at = next((i for i, (row, _) in enumerate(left) if row == stated), None)
        if at is not None:
            cells = left[at][1]
            left = left[at + 1 :]
        else:
            found = next(((row, cells) for row, cells in everywhere if row == stated), None)
            if found is None or _in_one_table(asked, rows_of):
                inquiry.wrong("figures", name, f"table row of {path}", f"does not state the figure of {source} in its place",
                              _nearest(stated, best), " ± ".join(stated[:2]) + f" (k = {stated[2]})")  # fmt: skip
                continue
            cells = found[1]
        if unit != "1" and not any(_unit_is(unit, cell) for cell in cells):
            inquiry.wrong("figures", name, f"table row of {path}", "states it in another unit", cells[-1], unit)


def _in_one_table(asked: Sequence[tuple[str, Stated, str]], rows_of: list[list[tuple[Stated, list[str]]]]) -> bool:
    """Whether all quantities of the group stand in one table, in whatever order."""
    return any(all(any(row == stated for row, _ in rows) for _, stated, _ in asked) for rows in rows_of)


def _statement(row: list[str]) -> tuple[Stated, list[str]] | None:
    """The first three cells side by side that are a value, U and k."""
    for i in range(len(row) - 2):
        value, expanded, k = (cell.replace(",", ".") for cell in row[i : i + 3])
        if _is_number(value) and _is_number(expanded) and (k == _NO_FACTOR or _is_number(k)):
            return (value, expanded, k), row
    return None


def _is_number(text: str) -> bool:
    plain = text.replace("−", "-").replace("×10", "e").translate(str.maketrans("⁻⁰¹²³⁴⁵⁶⁷⁸⁹", "-0123456789"))
    try:
        float(plain)
    except ValueError:
        return text == "∞"
    return True


def _unit_is(unit: str, cell: str) -> bool:
    return unit == cell.strip() or {unit, cell.strip()} <= {"″", "arcsec", "″ "}


def _nearest(stated: Stated, rows: Sequence[tuple[Stated, list[str]]]) -> str:
    """The row that shares most with what should stand there."""
    best = max(rows, key=lambda row: sum(a == b for a, b in zip(row[0], stated, strict=True)), default=None)
    return "" if best is None else " ".join(best[1])


def _check_decisions(inquiry: Inquiry, data: Mapping[str, Any], page: HtmlPage, name: str, source: str) -> None:
    """Each statement of conformity as a whole: its outcome, its value and its limit."""
    entries = data.get("conformity") or []
    if "estimates" not in data:
        return
    count = len(page.decisions)
    if len(entries) > count:
        inquiry.wrong("figures", name, "statements of conformity", f"are fewer than in {source}", count, len(entries))
        return
    for number, (entry, shown) in enumerate(zip(entries, page.decisions, strict=False), 1):
        place, problem = f"statement of conformity {number}", f"is another decision than in {source}"
        inquiry.compare("figures", name, place, problem, shown.outcome, entry["decision"])
        text = shown.text.replace(",", ".")
        # before 0.15.0 a decision had u instead of U, a value to the digits of it, and a limit to four
        for what, figures in (
            ("value", [_measured(entry, 2), _measured(entry, 1), *_from_zero(entry)]),
            ("limit", [str.__str__(limit_in_full(entry["limit_um"])), f"{entry['limit_um']:.4g}"]),
            ("standard", [entry["standard"].replace(",", ".")]),
        ):
            if not any(re.search(".{1,14}".join(map(re.escape, figure.split(" ± "))), text) for figure in figures):
                problem = f"does not state the {what} of {source}"
                inquiry.wrong("figures", name, place, problem, " ".join(shown.text.split()), figures[0])


def _from_zero(entry: Mapping[str, Any]) -> list[str]:
    """A size that may be zero, by its interval."""
    U = 2 * entry["u_um"]
    return [" ± ".join((rounded(0.0, U)[0], rounded(entry["value_um"] + U, U)[0]))] if entry["value_um"] < U else []


def _measured(entry: Mapping[str, Any], k: int) -> str:
    """Value ± U, or u with k = 1; the value alone where neither is known."""
    if entry["u_um"] > 0:
        return " ± ".join(rounded(entry["value_um"], k * entry["u_um"]))
    return f"{entry['value_um']:.4g}"
