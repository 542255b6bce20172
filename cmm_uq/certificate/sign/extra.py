"""What signatures are made with: the extra ``cmm-uq[sign]``, imported when it is needed, and missed in one line; its ways."""

from __future__ import annotations

import asyncio
import contextlib
import hashlib
import io
import logging
from collections.abc import Coroutine, Iterator
from concurrent.futures import ThreadPoolExecutor
from typing import TYPE_CHECKING, Any, TypeVar

from cmm_uq.base.errors import CmmUqError, NotInstalledError

if TYPE_CHECKING:
    from pyhanko.pdf_utils.incremental_writer import IncrementalPdfFileWriter

_T = TypeVar("_T")
_SILENT = logging.NullHandler()


@contextlib.contextmanager
def installed() -> Iterator[None]:
    """Imports inside that may miss a package of the extra."""
    for name in ("pyhanko", "pyhanko_certvalidator", "signxml"):
        logging.getLogger(name).addHandler(_SILENT)  # what matters is said once, by what is found
    try:
        yield
    except ImportError as error:
        raise NotInstalledError(f"signatures need {(error.name or 'a package').partition('.')[0]}, which is not installed",
                                fix="Install it: pip install 'cmm-uq[sign]'") from None  # fmt: skip


def ran(coroutine: Coroutine[Any, Any, _T]) -> _T:
    """What a coroutine of the library returns, also where a loop runs already, as in a notebook."""
    try:
        asyncio.get_running_loop()
    except RuntimeError:
        return asyncio.run(coroutine)
    with ThreadPoolExecutor(1) as other:
        return other.submit(asyncio.run, coroutine).result()


def appending(pdf: bytes) -> IncrementalPdfFileWriter:
    """A writer that appends a revision, and draws nothing at random."""
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
