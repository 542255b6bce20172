"""Whether PDF, HTML and digital certificate (DCC) say the same, to the character and to the element; where two PDFs differ.

What a PDF has more than a page is taken off first: the foot of every page, the banner at its head, the head of a table that
goes on over pages, signs of lists. White space tells nothing: lines break elsewhere. The digital certificate is made again of
``results.json`` and the inputs.
"""

from __future__ import annotations

import html
import io
import re
import unicodedata
from collections.abc import Iterator, Sequence
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING, Any

from cmm_uq.base.errors import CmmUqError
from cmm_uq.certificate.verify.found import Inquiry
from cmm_uq.certificate.verify.given import Given
from cmm_uq.certificate.verify.html_page import HtmlPage, read_html
from cmm_uq.certificate.verify.pdf_file import PdfFile, reading

if TYPE_CHECKING:
    from cmm_uq.jobs.dcc.tree import Node
    from cmm_uq.jobs.job import Job

_NO_TEXT = re.compile(r"[\s\u00ad\u200b-\u200d\u2060\ufeff•—]+")
"""What a view may have and the other not: white space, marks where words break, signs of lists and about the end."""

MISSING = "□"  # in place of a character that a PDF's fonts lack
_ANCHOR = 24  # characters by which the views are brought together again behind a difference
_MOST_SHOWN = 20
_CONTEXT = 24


def compare_views(inquiry: Inquiry, pdf: PdfFile, page: HtmlPage, *, files: tuple[str, str]) -> None:
    """Keep every difference between the text of a PDF and that of a page."""
    name, beside = files
    banner = squashed(page.banner)
    whole, count = squashed(page.text).removeprefix(banner), 0
    replaced = any(MISSING in text for text in pdf.pages) and MISSING not in page.text
    heads = sorted({squashed("".join(table.headings)) for table in page.tables} - {""}, key=len, reverse=True)
    at = 0
    for number, text in enumerate(pdf.pages, 1):
        shown, foot = without_foot(squashed(text), squashed(page.title), number, len(pdf.pages))
        if not foot:
            inquiry.wrong("forms", name, f"page {number}", "has no foot with title, number and count of pages",
                          text[-60:].strip(), page.title)  # fmt: skip
        if not shown.startswith(banner):
            inquiry.wrong("forms", name, f"page {number}", "does not begin with the banner", shown[:60], page.banner)
        shown = shown.removeprefix(banner)
        found, at = _differences(shown, whole, at, heads, replaced=replaced)
        for stands, should in found:
            count += 1
            if count <= _MOST_SHOWN:
                inquiry.wrong("forms", name, f"page {number}", f"says something else than {beside}", stands, should)
    if at < len(whole):
        inquiry.wrong("forms", name, f"page {len(pdf.pages)}", f"ends before {beside} does", "", whole[at:])
    inquiry.looked("forms", len(pdf.pages))
    _compare_information(inquiry, pdf, page, name)


def check_style(inquiry: Inquiry, page: HtmlPage, name: str) -> None:
    """Keep a style sheet that is not the template's: it could hide what a page says, or say something else."""
    from cmm_uq.certificate.render.html import style_sheet

    inquiry.looked("files")
    should = style_sheet(page.title, page.banner, page.language)
    if page.style.strip() != should.strip():
        inquiry.wrong("files", name, "style sheet", "is not that of the template")


def squashed(text: str) -> str:
    """Text without what tells nothing; letters composed of two are one."""
    return _NO_TEXT.sub("", unicodedata.normalize("NFC", text))


def without_foot(text: str, title: str, number: int, pages: int) -> tuple[str, bool]:
    """Text of a page without its foot: title and number of the document, number of the page and count of pages."""
    at = text.rfind(title)
    rest = text[at + len(title) :] if at >= 0 else ""
    if at < 0 or sorted(re.findall(r"\d+", rest)) != sorted((str(number), str(pages))) or len(rest) > 40:
        return text, False
    return text[:at], True


def _differences(
    text: str, whole: str, at: int, heads: Sequence[str], *, replaced: bool
) -> tuple[list[tuple[str, str]], int]:  # fmt: skip
    """What stands on a page and what should, and the place in the whole up to which they were compared."""
    here, found = 0, list[tuple[str, str]]()
    while here < len(text):
        length = _alike(text, here, whole, at, replaced=replaced)
        here, at = here + length, at + length
        if here == len(text):
            break
        if head := next((one for one in heads if text.startswith(one, here) and here == 0), ""):
            here += len(head)
            continue
        skipped, on = _together(text, here, whole, at)
        before = text[max(0, here - _CONTEXT) : here]
        found.append((before + text[here : here + skipped], before + whole[at:on]))
        here, at = here + skipped, on
    return found, at


def _alike(text: str, here: int, whole: str, at: int, *, replaced: bool) -> int:
    """Characters that are the same from two places on."""
    length, most = 0, min(len(text) - here, len(whole) - at)
    step = most
    while step:
        if (
            length + step <= most
            and text[here + length : here + length + step] == whole[at + length : at + length + step]
        ):
            length += step
        elif replaced and length < most and text[here + length] == MISSING:
            length += 1
        else:
            step //= 2
    return length


def _together(text: str, here: int, whole: str, at: int) -> tuple[int, int]:
    """How much of the page is passed over, and the place in the whole where both go on alike."""
    for skipped in range(min(2000, len(text) - here)):
        piece = text[here + skipped : here + skipped + _ANCHOR]
        found = whole.find(piece, at, at + 4000) if len(piece) >= min(_ANCHOR, len(text) - here) else -1
        if found >= 0:
            return skipped, found
    return len(text) - here, at


def _compare_information(inquiry: Inquiry, pdf: PdfFile, page: HtmlPage, name: str) -> None:
    """Title, language, subject and author in the file's own information, which a reader's window shows."""
    subject = page.metas.get("description", "")
    for key, should in (
        ("/Title", page.title), ("/Author", page.metas.get("author", "")),
        ("/Subject", f"{page.banner}. {subject}" if page.banner else subject),
    ):  # fmt: skip
        stands = pdf.information.get(key, "")
        if " ".join(stands.split()) != " ".join(should.split()):
            inquiry.wrong("forms", name, f"information {key}", "is not that of the document", stands, should)
    for key, value in pdf.information.items():
        words = "".join(value.split())
        if not key.endswith("Date") and words not in "".join(html.unescape(pdf.xmp).split()):
            inquiry.wrong("forms", name, f"information {key}", "does not stand in the metadata", "", value)
    if pdf.language.lower() != page.language.lower():
        inquiry.wrong("forms", name, "language", "is not that of the document", pdf.language, page.language)
    inquiry.looked("forms", 4)


MOST = 8  # differences that are told
_PAGE = re.compile(r"^/Root/Pages/Kids\[(\d+)\]")
_NOT_STATED = frozenset({"/ID", "/Prev", "/Size", "/XRefStm", "/Length", "/Filter", "/Parent", "/DecodeParms"})
Part = tuple[str, str, str]  # path, what stands there, what should


def differing_parts(stands: bytes, should: bytes) -> list[Part]:
    """The first parts that differ; none where only the writing does."""
    from pypdf import PdfReader

    with reading("the PDF"):
        a, b = (PdfReader(io.BytesIO(content), strict=False).trailer for content in (stands, should))
        return _Pairs().compared(a, b)


class _Pairs:
    def __init__(self) -> None:
        self.found: list[Part] = []

    def compared(self, a: Any, b: Any) -> list[Part]:
        """Both files walked together from their trailers, each pair of objects once."""
        from pypdf.generic import ArrayObject, DictionaryObject, StreamObject

        seen: set[tuple[object, object]] = set()
        waiting: list[tuple[str, Any, Any]] = [("", a, b)]
        while waiting and len(self.found) < MOST:
            path, one, other = waiting.pop()
            key = getattr(one, "idnum", None), getattr(other, "idnum", None)
            if all(key):
                if key in seen:
                    continue
                seen.add(key)
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
            at = first_difference(a, b)
            self._tell(path, *(data[max(0, at - 20) : at + 20].decode("latin-1") for data in (a, b)))

    def _tell(self, path: str, stands: str, should: str) -> None:
        page = _PAGE.match(path)
        where = f"page {int(page[1]) + 1}: {path[page.end() :]}" if page else path.removeprefix("/Root")
        self.found.append((where or "trailer", stands, should))


def first_difference(a: Sequence[object], b: Sequence[object]) -> int:
    """Where two sequences begin to differ."""
    return next((i for i, (x, y) in enumerate(zip(a, b, strict=False)) if x != y), min(len(a), len(b)))


_MOST = 12
Difference = tuple[str, str, str]  # XPath, what stands there, what should


def open_digital(inquiry: Inquiry, given: Given) -> None:
    """Take the certificate out of the PDF where it is not given by itself, and the page out of it; keep where these differ."""
    from cmm_uq.jobs.dcc import read

    # an artefact's certificate is an input
    inputs = given.results[1]["job"]["inputs_sha256"] if given.results is not None else {}
    files = [] if given.pdf is None else given.pdf[1].attachments
    attached = next((file for file in files if file.name.lower().endswith(".xml") and file.name not in inputs), None)
    if attached is not None and given.pdf is not None:
        if given.xml is None:
            given.xml, given.digital_inside = (f"{attached.name} in {given.pdf[0]}", attached.content), True
        elif given.xml[1] != attached.content:
            name = f"attachment {attached.name} of {given.pdf[0]}"
            _compare(inquiry, name, attached.content, given.xml[1], given.xml[0])
    if given.xml is None:
        return
    name, content = given.xml
    inquiry.looked("forms")
    document = read(content, name).document
    if document is None:
        inquiry.wrong("forms", name, "/dcc:digitalCalibrationCertificate", "carries no copy for reading")
        return
    given.page_inside = document.data
    place = "/dcc:digitalCalibrationCertificate/dcc:document"
    if given.html is None:
        where = f"{document.file_name} in {name}"
        given.html = where, read_html(document.data, where), document.data
    elif given.html[2] != document.data:
        inquiry.wrong("forms", name, place, f"is not {given.html[0]}")


def check_digital(inquiry: Inquiry, given: Given, job: Job) -> None:
    """Keep every element that results.json and the job do not give; of this version of the package."""
    if given.xml is None or given.results is None:
        return
    import json

    from cmm_uq.certificate.digital_certificate.certificate import digital_certificate
    from cmm_uq.jobs.dcc import written

    name, content = given.xml
    try:
        should = written(digital_certificate(json.loads(given.results[2]), job, html=given.page_inside))
    except (KeyError, TypeError, ValueError, AttributeError, IndexError, CmmUqError) as error:
        inquiry.wrong("forms", name, "", f"cannot be made of {given.results[0]} ({type(error).__name__}: {error})")
        return
    _compare(inquiry, name, content, should, given.results[0])


def check_schema(inquiry: Inquiry, given: Given, folder: Path) -> None:
    """Keep what the schema of PTB refuses."""
    from cmm_uq.jobs.dcc.schema import checked_by_schema

    if given.xml is None:
        raise CmmUqError("there is no digital certificate to be held to a schema", where="--schema", fix="Leave it out")
    inquiry.looked("files")
    try:
        checked_by_schema(given.xml[1], folder, given.xml[0])
    except CmmUqError as error:
        if error.where is None or not error.where.startswith(given.xml[0]):
            raise
        for one in (error, *error.also):
            inquiry.wrong("files", given.xml[0], (one.where or "").removeprefix(f"{given.xml[0]}, "), one.problem)


def same_unsigned(one: bytes, other: bytes, where: str) -> bool:
    """Whether two certificates are the same but for their signatures."""
    from cmm_uq.jobs.dcc.tree import parsed

    return next(differences(parsed(one, where), parsed(other, where)), None) is None


def _compare(inquiry: Inquiry, name: str, content: bytes, should: bytes, source: str) -> None:
    from cmm_uq.jobs.dcc.tree import parsed

    inquiry.looked("forms")
    if content == should:
        return
    root, wished = parsed(content, name), parsed(should, source)
    found = list(islice(differences(root, wished), _MOST))
    for path, stands, wanted in found:
        inquiry.wrong("forms", name, path, f"is not what {source} says", stands, wanted)
    if not found and not any(map(_is_signature, (*root.children, *wished.children))):
        problem = "is written otherwise, though it says the same: it is not the file that was made"
        inquiry.wrong("forms", name, "", problem)


def differences(one: Node, other: Node) -> Iterator[Difference]:
    """Where two trees differ, by XPath; a signature over the root is passed over."""
    if one.tag != other.tag:
        yield one.xpath, one.tag, other.tag
        return
    if one.attributes != other.attributes:
        yield f"{one.xpath}/@*", str(one.attributes), str(other.attributes)
    if " ".join(one.text.split()) != " ".join(other.text.split()):
        yield one.xpath, one.text, other.text
    a, b = ([child for child in node.children if node.parent or not _is_signature(child)] for node in (one, other))
    for mine, theirs in zip(a, b, strict=False):
        yield from differences(mine, theirs)
    yield from ((child.xpath, "there", "") for child in a[len(b) :])
    yield from ((child.xpath, "", "there") for child in b[len(a) :])


def _is_signature(node: Node) -> bool:
    return node.tag.rpartition(":")[2].rpartition("}")[2] == "Signature"
