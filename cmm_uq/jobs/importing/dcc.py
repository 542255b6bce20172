"""Digital calibration certificates (DCC 3, PTB): the lists of a result, a column each, by the names that it gives them."""

from __future__ import annotations

from collections.abc import Sequence
from xml.etree.ElementTree import Element

from cmm_uq.errors import CmmUqError
from cmm_uq.files.limits import ROWS
from cmm_uq.jobs.importing.format import Format
from cmm_uq.jobs.importing.keys import ImportKeys
from cmm_uq.jobs.importing.sheet import Cell, Sheet
from cmm_uq.jobs.importing.xml_files import begins_with, local, root_of
from cmm_uq.messages import say
from cmm_uq.units import UNITS

_BY_DSI = {unit.dsi: symbol for symbol, unit in UNITS.items()}
_LISTS = ("realListXMLList", "realList")


class Dcc(Format):
    """A certificate."""

    name = "dcc"
    title = say("digital calibration certificate (DCC)")

    def recognises(self, head: bytes) -> bool:
        """See :meth:`Format.recognises`."""
        return begins_with(head, "digitalCalibrationCertificate")

    def read(self, content: bytes, where: str, keys: ImportKeys) -> Sequence[Sheet]:
        """See :meth:`Format.read`: a sheet for each result."""
        root = root_of(content, where)
        sheets = []
        for i, result in enumerate((e for e in root.iter() if local(e) == "result"), 1):
            columns = [found for e in result.iter() if local(e) == "quantity" and (found := _column(e, where))]
            if columns:
                sheets.append(_sheet(_name(result) or f"result {i}", columns, where))
        if not sheets:
            raise CmmUqError("holds no result with lists of values", where=where,
                             fix="Give the certified values as a CSV with the columns point and reference_mm")  # fmt: skip
        return sheets


def _sheet(name: str, columns: Sequence[tuple[str, list[str]]], where: str) -> Sheet:
    count = max(len(values) for _, values in columns)
    odd = next((heading for heading, values in columns if len(values) not in (1, count)), None)
    if odd is not None or count > ROWS.most:
        raise CmmUqError(f"the lists of {name!r} differ in length ({odd!r})", where=where,
                         fix="Ask the laboratory for a certificate whose lists belong together")  # fmt: skip
    full = [(heading, values if len(values) == count else values * count) for heading, values in columns]
    rows: list[list[Cell]] = [[heading for heading, _ in full]]
    rows += [[values[i] for _, values in full] for i in range(count)]
    return Sheet(name, rows, [1, *range(1, count + 1)], decimal=".")


def _column(quantity: Element, where: str) -> tuple[str, list[str]] | None:
    """Heading with its unit, and values, of a quantity that is a list."""
    found = next((e for e in quantity.iter() if local(e) in _LISTS), None)
    text = next((e.text or "" for e in quantity.iter() if local(e) == "textXMLList"), None)
    heading = _name(quantity) or quantity.get("refType", "")
    if found is None:
        return None if text is None else (heading, text.split())
    values = next((e.text or "" for e in found if local(e) == "valueXMLList"), "").split()
    units = set(next((e.text or "" for e in found if local(e) == "unitXMLList"), "").split())
    if len(units) > 1:
        raise CmmUqError(f"{heading!r} is in {' and '.join(sorted(units))}: the list mixes units", where=where,
                         fix="Ask the laboratory for one unit a list")  # fmt: skip
    dsi = next(iter(units), "")
    symbol = _BY_DSI.get(dsi, dsi)
    return f"{heading} [{symbol}]" if symbol not in ("", "1") else heading, values


def _name(element: Element) -> str:
    """In English where it is given in English, else in the first language."""
    names = next((e for e in element if local(e) == "name"), None)
    contents = [] if names is None else [e for e in names if local(e) == "content"]
    english = [e for e in contents if e.get("lang") == "en"]
    return next(((e.text or "").strip() for e in (*english, *contents)), "")
