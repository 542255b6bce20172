"""Digital calibration certificates (DCC 3, PTB): the quantities of a result, a column each, by the names that it gives."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import groupby
from typing import TYPE_CHECKING

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.files.limits import ROWS
from cmm_uq.base.messages import say
from cmm_uq.base.units import UNITS
from cmm_uq.jobs.importing.encodings import begins_with
from cmm_uq.jobs.importing.format import Format
from cmm_uq.jobs.importing.keys import ImportKeys
from cmm_uq.jobs.importing.sheet import Sheet

if TYPE_CHECKING:
    from cmm_uq.jobs.dcc.figures import QuantityFigures

_BY_DSI = {unit.dsi: str.__str__(unit) for unit in UNITS.values()}
ROOT = "digitalCalibrationCertificate"


class Dcc(Format):
    """A certificate."""

    name = "dcc"
    title = say("digital calibration certificate (DCC)")

    def recognises(self, head: bytes) -> bool:
        return begins_with(head, ROOT)

    def read(self, content: bytes, where: str, keys: ImportKeys) -> Sequence[Sheet]:
        """A sheet for each result that has more than one value of something."""
        from cmm_uq.jobs.dcc import read  # the model of a certificate is made for who has one
        from cmm_uq.jobs.dcc.figures import figures

        sheets = []
        for place, of_result in groupby(figures(read(content, where)), key=lambda one: one.place[:2]):
            columns = [_column(one, where) for one in of_result]
            if any(len(cells) > 1 for _, cells in columns):
                sheets.append(_sheet(place[1], columns, where))
        if not sheets:
            raise CmmUqError("holds no result with lists of values", where=where,
                             fix="Give the certified values as a CSV with the columns point and reference_mm")  # fmt: skip
        return sheets


def heading(quantity: QuantityFigures) -> str:
    """Of the column of a quantity: its name, or what it is by its refType, with its unit."""
    name = quantity.name or " ".join(quantity.ref_types)
    symbol = _BY_DSI.get(quantity.units[0], quantity.units[0]) if quantity.units else ""
    return f"{name} [{symbol}]" if symbol not in ("", "1") else name


def _column(quantity: QuantityFigures, where: str) -> tuple[str, list[str]]:
    units = sorted(set(quantity.units))
    if len(units) > 1:
        raise CmmUqError(f"{quantity.name!r} is in {' and '.join(units)}: the list mixes units", where=where,
                         fix="Ask the laboratory for one unit a list")  # fmt: skip
    return heading(quantity), [str(value) for value in quantity.values] or list(quantity.words)


def _sheet(name: str, columns: Sequence[tuple[str, list[str]]], where: str) -> Sheet:
    count = max(len(values) for _, values in columns)
    odd = next((heading for heading, values in columns if len(values) not in (1, count)), None)
    if odd is not None or count > ROWS.most:
        raise CmmUqError(f"the lists of {name!r} differ in length ({odd!r})", where=where,
                         fix="Ask the laboratory for a certificate whose lists belong together")  # fmt: skip
    full = ([heading, *(values if len(values) == count else values * count)] for heading, values in columns)
    return Sheet(name, list(zip(*full, strict=True)), [1, *range(1, count + 1)], decimal=".")
