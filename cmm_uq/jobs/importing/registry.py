"""All formats: those of the project, and those of other packages (entry points of the group ``cmm_uq.imports``)."""

from __future__ import annotations

from functools import cache, partial
from importlib import import_module

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.plugins import IMPORTS, Plugin, offered
from cmm_uq.jobs.importing.format import HEAD, Format
from cmm_uq.jobs.importing.unread import refuse_unread

BUILT_IN = (
    "excel.Excel",
    "opendocument.OpenDocument",
    "qif.Qif",
    "dcc.Dcc",
    "calypso.Calypso",
    "dmis.Dmis",
    "pcdmis.PcDmis",
    "ipp.Ipp",
)
"""Asked in this order, after those of other packages; a text that is none of them is a text table."""

TEXT = "delimited.Delimited"


def format_of(content: bytes, where: str) -> Format:
    """The format of a file.

    Raises
    ------
    CmmUqError : it is none that is read.
    """
    head = content[:HEAD]
    for plugin in offered(IMPORTS, Plugin):
        found = plugin.loaded(Format)  # type: ignore[type-abstract]
        if plugin.attempt(partial(found.recognises, head)):
            return found
    for name in BUILT_IN:
        own = _built_in(name)
        if own.recognises(head):
            return own
    refuse_unread(head, where)
    if (text := _built_in(TEXT)).recognises(head):
        return text
    what = "is empty" if not content.strip() else "is no text, and no format of measurements that is known here"
    raise CmmUqError(what, where=where, fix="Export the recording as CSV, .xlsx or .ods")


@cache
def _built_in(name: str) -> Format:
    module, _, own = name.partition(".")
    found: Format = getattr(import_module(f"cmm_uq.jobs.importing.{module}"), own)()
    return found
