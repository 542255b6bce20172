"""Files that are not read, by what they begin with: each is named, with what to do instead."""

from __future__ import annotations

from cmm_uq.base.errors import CmmUqError

_FILES = (
    (
        b"\xd0\xcf\x11\xe0",
        "is a workbook of the old kind (.xls), or one with a password",
        "Save it as .xlsx without a password",
    ),
    (b"%PDF", "is a PDF, which has no table to be read", "Export the report as text, CSV or .xlsx"),
    (b"{\\rtf", "is a report in rich text (RTF)", "Print the report as plain text (.txt)"),
    (b"\x1f\x8b", "is compressed (gzip)", "Unpack it"),
    (b"7z\xbc\xaf", "is compressed (7z)", "Unpack it"),
    (b"Rar!", "is compressed (RAR)", "Unpack it"),
    (b"\x89PNG", "is a picture", "Export the table itself, as CSV or .xlsx"),
    (b"\xff\xd8\xff", "is a picture", "Export the table itself, as CSV or .xlsx"),
    (b"SQLite format 3", "is a database", "Export the table as CSV or .xlsx"),
)


def refuse_unread(head: bytes, where: str) -> None:
    """Refuse a file of a kind that is never read.

    Raises
    ------
    CmmUqError : it is one.
    """
    for start, what, fix in _FILES:
        if head.startswith(start):
            raise CmmUqError(what, where=where, fix=fix)
    text = head[:512].lstrip().lower()
    if text.startswith((b"<!doctype html", b"<html")):
        raise CmmUqError("is a web page", where=where, fix="Export the table as CSV or .xlsx")
