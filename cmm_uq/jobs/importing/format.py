"""Formats of files: whether a file is of one, the sheets that it holds, all formats, and files that are never read."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from functools import cache, partial
from importlib import import_module

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.messages import Text
from cmm_uq.base.plugins import IMPORTS, Plugin, offered
from cmm_uq.jobs.importing.keys import ImportKeys
from cmm_uq.jobs.importing.sheet import Sheet

HEAD = 65_536  # bytes of a file by which it is recognised


class Format(ABC):
    """A format; those of other packages are entry points of the group ``cmm_uq.imports``, of the format's name.

    Attributes
    ----------
    name : of the entry point, and in results.json.
    title : as printed.
    """

    name: str
    title: Text

    @abstractmethod
    def recognises(self, head: bytes) -> bool:
        """Whether a file is of this format.

        Parameters
        ----------
        head : its first :data:`HEAD` bytes.
        """

    @abstractmethod
    def read(self, content: bytes, where: str, keys: ImportKeys) -> Sequence[Sheet]:
        """Sheets of a file, at least one.

        Parameters
        ----------
        content : of the file.
        where : its name, for messages.
        keys : what the job says beside.

        Raises
        ------
        CmmUqError : it is damaged, hostile, or holds nothing that can be read.
        """


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
    """Refuse a file of a kind that is never read."""
    for start, what, fix in _FILES:
        if head.startswith(start):
            raise CmmUqError(what, where=where, fix=fix)
    text = head[:512].lstrip().lower()
    if text.startswith((b"<!doctype html", b"<html")):
        raise CmmUqError("is a web page", where=where, fix="Export the table as CSV or .xlsx")


# Asked in this order, after those of other packages; a text that is none of them is a text table.
BUILT_IN = (
    *("workbooks.Excel", "workbooks.OpenDocument", "qif.Qif", "dcc.Dcc"),
    *("reports.Calypso", "reports.Dmis", "reports.PcDmis", "reports.Ipp"),
)


def format_of(content: bytes, where: str) -> Format:
    head = content[:HEAD]
    for plugin in offered(IMPORTS, Plugin):
        outside = plugin.loaded(Format)  # type: ignore[type-abstract]
        if plugin.attempt(partial(outside.recognises, head)):
            return outside
    for name in BUILT_IN:
        if (own := _built_in(name)).recognises(head):
            return own
    refuse_unread(head, where)
    if (text := _built_in("delimited.Delimited")).recognises(head):
        return text
    what = "is empty" if not content.strip() else "is no text, and no format of measurements that is known here"
    raise CmmUqError(what, where=where, fix="Export the recording as CSV, .xlsx or .ods")


@cache
def _built_in(name: str) -> Format:
    module, _, cls = name.partition(".")
    form: Format = getattr(import_module(f"cmm_uq.jobs.importing.{module}"), cls)()
    return form
