"""Where two PDFs differ: page, attachment or part of the catalogue, whatever numbers and places their objects have."""

from __future__ import annotations

import io
import re
from typing import Any

from cmm_uq.certificate.verify.pdf_file import reading

MOST = 8
"""Differences that are told."""

_PAGE = re.compile(r"^/Root/Pages/Kids\[(\d+)\]")
_NOT_STATED = frozenset({"/ID", "/Prev", "/Size", "/XRefStm", "/Length", "/Filter", "/Parent", "/DecodeParms"})

Part = tuple[str, str, str]
"""Path, what stands there, what should."""


def differing_parts(stands: bytes, should: bytes) -> list[Part]:
    """The first parts that differ; none where only the writing does.

    Parameters
    ----------
    stands, should : two PDFs, of which the second is known to be whole and the first was read before.
    """
    from pypdf import PdfReader

    with reading("the PDF"):
        a, b = (PdfReader(io.BytesIO(content), strict=False).trailer for content in (stands, should))
        return _Pairs().compared(a, b)


class _Pairs:
    """Both files walked together from their trailers, each pair of objects once."""

    def __init__(self) -> None:
        self.found: list[Part] = []
        self._seen: set[tuple[object, object]] = set()

    def compared(self, a: Any, b: Any) -> list[Part]:
        """Differences in the order in which they are reached."""
        from pypdf.generic import ArrayObject, DictionaryObject, StreamObject

        waiting: list[tuple[str, Any, Any]] = [("", a, b)]
        while waiting and len(self.found) < MOST:
            path, one, other = waiting.pop()
            key = _reference(one), _reference(other)
            if all(key):
                if key in self._seen:
                    continue
                self._seen.add(key)
            one, other = one.get_object(), other.get_object()
            if isinstance(one, DictionaryObject) and isinstance(other, DictionaryObject):
                if isinstance(one, StreamObject) and isinstance(other, StreamObject):
                    self._stream(path, one, other)
                waiting += reversed(self._keys(path, one, other))
            elif isinstance(one, ArrayObject) and isinstance(other, ArrayObject):
                if len(one) != len(other):
                    self._tell(path, f"{len(one)} parts", f"{len(other)} parts")
                pairs = zip(list.__iter__(one), list.__iter__(other), strict=False)
                waiting += reversed([(f"{path}[{i}]", x, y) for i, (x, y) in enumerate(pairs)])
            elif one != other:
                self._tell(path, repr(one), repr(other))
        return self.found

    def _keys(self, path: str, one: Any, other: Any) -> list[tuple[str, Any, Any]]:
        keys = [key for key in dict.fromkeys((*dict.keys(one), *dict.keys(other))) if key not in _NOT_STATED]
        for key in keys:
            if key not in one or key not in other:
                self._tell(f"{path}{key}", "" if key not in one else "there", "" if key not in other else "there")
        keys.sort(key=lambda key: key != "/Pages")  # what else leads to a page is told by the page
        raw = dict.__getitem__
        return [(f"{path}{key}", raw(one, key), raw(other, key)) for key in keys if key in one and key in other]

    def _stream(self, path: str, one: Any, other: Any) -> None:
        a, b = one.get_data(), other.get_data()
        if a != b:
            at = next((i for i, (x, y) in enumerate(zip(a, b, strict=False)) if x != y), min(len(a), len(b)))
            self._tell(path, *(data[max(0, at - 20) : at + 20].decode("latin-1") for data in (a, b)))

    def _tell(self, path: str, stands: str, should: str) -> None:
        page = _PAGE.match(path)
        where = f"page {int(page[1]) + 1}: {path[page.end() :]}" if page else path.removeprefix("/Root")
        self.found.append((where or "trailer", stands, should))


def _reference(one: Any) -> object:
    return getattr(one, "idnum", None)
