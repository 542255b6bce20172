"""Revisions appended to a PDF, so that what was signed before stays as it was."""

from __future__ import annotations

import hashlib
import io
from typing import TYPE_CHECKING, Any

from cmm_uq.base.errors import CmmUqError
from cmm_uq.certificate.sign.extra import installed

if TYPE_CHECKING:
    from pyhanko.pdf_utils.incremental_writer import IncrementalPdfFileWriter


def appending(pdf: bytes) -> IncrementalPdfFileWriter:
    """A writer that appends a revision, and draws nothing at random.

    Raises
    ------
    CmmUqError : it cannot be read as a PDF.
    """
    with installed():
        from pyhanko.pdf_utils import generic
        from pyhanko.pdf_utils.incremental_writer import IncrementalPdfFileWriter
        from pyhanko.pdf_utils.misc import PdfError

    class Appending(IncrementalPdfFileWriter):  # type: ignore[misc]
        def _update_meta(self) -> None:
            """Metadata stay: they are of the document, and PDF/A asks that both its copies agree."""

        @classmethod
        def _handle_id(cls, prev: Any) -> Any:
            drawn = generic.ByteStringObject(hashlib.sha256(pdf).digest()[:16])
            return generic.ArrayObject([prev.trailer["/ID"][0] if "/ID" in prev.trailer else drawn, drawn])

    try:
        return Appending(io.BytesIO(pdf))
    except (PdfError, ValueError, KeyError, TypeError, RecursionError) as error:
        raise CmmUqError(f"cannot be read as a PDF: {error}", fix="Name a PDF that is whole") from None
