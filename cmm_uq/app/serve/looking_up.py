"""Whether the records know a file: by its SHA-256 alone, and where that is unknown by what the file says it is.

This is all that is said of a dropped file: whether its bytes are those that were recorded, and how their certificate
stands. It checks no signature and computes nothing anew; a check that does takes the place of :func:`look_up` and gives a
:class:`Known` too.
"""

from __future__ import annotations

import html
import json
import re
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from cmm_uq.app.serve.recorded_files import files_of
from cmm_uq.app.serve.uploaded import Dropped
from cmm_uq.laboratory.records.facts import Certificate
from cmm_uq.laboratory.records.listing import entry_of
from cmm_uq.laboratory.records.store import Records

MOST = 50
"""Certificates of one number that are compared: it is issued once, and drafted a few times."""

_OF_PAGE = re.compile(rb'class="number">[^<]{0,40}<bdi>([^<]{1,300})</bdi>')
_OF_PDF = re.compile(rb"<pdf:Keywords>([^<]{1,300})</pdf:Keywords>")


@dataclass(frozen=True)
class Known:
    """What the records know of a file.

    Parameters
    ----------
    how : recorded, the very bytes; altered, other bytes that say they are a certificate of the records; unknown.
    certificate : that it is of, or says that it is of.
    name : under which it was recorded.
    says : the number that an altered or unknown file says it has; empty where it says none that can be read.
    """

    how: Literal["recorded", "altered", "unknown"]
    certificate: Certificate | None = None
    name: str = ""
    says: str = ""


def look_up(records: Records, dropped: Dropped) -> Known:
    """Look a file up.

    Raises
    ------
    CmmUqError : the records are damaged or locked.
    """
    entry = records.has_results(dropped.sha256)
    if entry is not None:
        return Known("recorded", records.certificate(entry), "results.json")
    says = number_in(dropped.content or b"")
    candidates = records.named(says)[-MOST:] if says else []
    for certificate in reversed(candidates):
        found = entry_of(records, certificate.entry)
        folder, signed = Path(certificate.folder), records.signed(certificate.entry)
        known = (*files_of(found, folder), *files_of(found, folder, signed)) if found is not None else ()
        for file in known:  # as it was written, and as it was signed since
            if file.sha256 == dropped.sha256:
                return Known("recorded", certificate, file.name, says)
    if candidates:
        return Known("altered", candidates[-1], says=says)
    return Known("unknown", says=says)


def number_in(content: bytes) -> str:
    """The number that a certificate (PDF or HTML) or a results.json says it has; empty where none can be read."""
    if content.startswith(b"%PDF"):
        found = _OF_PDF.search(content)
    elif content.lstrip()[:1] == b"{":
        return _of_results(content)
    else:
        found = _OF_PAGE.search(content)
    return html.unescape(found[1].decode("utf-8", "replace")).strip() if found else ""


def _of_results(content: bytes) -> str:
    try:
        data = json.loads(content)
        if str(data["schema"]).startswith("cmm-uq/results/"):
            return str(data["job"]["id"])
    except (ValueError, KeyError, TypeError, RecursionError):
        pass
    return ""
