"""An error map from a file in either form, told by its content: the project's CSV, or a contractor's text."""

from __future__ import annotations

from cmm_uq.base.errors import CmmUqError
from cmm_uq.machine.physics.error_map import COLUMNS, ErrorMap, parse_error_map
from cmm_uq.machine.physics.error_map_text import parse_error_map_text, tables_of

_FORMS = (
    f"A CSV begins with axis,position_mm,{','.join(COLUMNS)}; a text has a table under  Map Data: X Axis  for each axis"
)


def parse_map_file(content: bytes, where: str, *, temperature: float = 20.0) -> tuple[ErrorMap, bool]:
    """Error map from the content of a file, and whether the file states the squareness.

    Parameters
    ----------
    content : of the file, UTF-8.
    where : its name, for messages.
    temperature : at which the map was taken, °C.

    Raises
    ------
    CmmUqError : it is neither form, or both, or something in it is wrong, with its line.
    """
    text = content.decode("utf-8-sig", errors="replace")
    header = next((line for line in text.splitlines() if line.strip(" ,\t") and not line.lstrip().startswith("#")), "")
    csv, tables = "," in header, tables_of(text)
    if tables and csv:
        raise CmmUqError("begins as a CSV and has tables under “Map Data” as a text", where=where, fix=_FORMS)
    if tables:
        return parse_error_map_text(content, where, temperature=temperature), True
    if text.strip() and not csv:
        raise CmmUqError("is no error map in either form that is read", where=where, fix=_FORMS)
    return parse_error_map(content, where, temperature=temperature), False
