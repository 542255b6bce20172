"""A certificate's PDF opened within limits: attached files, revisions, and what does not belong there.

Nothing of the file is run or followed. Every object that can be reached is looked at: streams are unpacked whole, with their
checksum and up to a limit, before anything reads them; what acts, hides, encrypts or comes from outside is named.
"""

from __future__ import annotations

import hashlib
import io
import logging
import re
import zlib
from base64 import b64decode
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from html.parser import HTMLParser
from types import MappingProxyType
from typing import Any

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.files.limits import HTML_BYTES, HTML_DEPTH, PDF_BYTES, PDF_OBJECTS, PDF_PAGES, PDF_UNPACKED, text_of
from cmm_uq.base.values import dataclass, field

_FIX = "Ask whoever sent it for the file as cmm-uq wrote it"

ACTIVE = frozenset({
    "/JavaScript", "/JS", "/Launch", "/OpenAction", "/AA", "/RichMedia", "/RichMediaContent", "/SubmitForm", "/ImportData",
    "/GoToR", "/GoToE", "/XFA", "/Sound", "/Movie", "/Rendition", "/Trans", "/URI",
})  # fmt: skip
"""Names, as keys or as values of a dictionary, of what acts or leads outside."""

HIDING = frozenset({"/OCProperties", "/OCG", "/OCMD", "/OC"})  # the same of what may be shown or not
_END = re.compile(rb"startxref\s+(\d{1,12})\s+%%EOF(?:\r\n|\n|\r)?")
_TRAILER = re.compile(rb"trailer\s*<<(?P<told>(?s:.{0,2000}?))>>\s*(?P<end>startxref)")
_BEFORE = re.compile(rb"/Prev\s+(\d{1,12})")
_UNTOLD = frozenset({"/Type", "/Length", "/Filter"})


@dataclass(frozen=True)
class Attachment:
    name: str
    content: bytes
    relationship: str  # to the document (ISO 19005-3): ``Source`` or ``Data``


@dataclass
class PdfFile:
    content: bytes
    attachments: list[Attachment] = field(default_factory=list)
    information: dict[str, str] = field(default_factory=dict)  # title, dates and the like, as the file says
    ends: list[int] = field(default_factory=list)  # bytes up to the end of each revision
    signatures: int = 0  # fields
    problems: list[tuple[str, str]] = field(default_factory=list)  # what does not belong there, each with its place

    @property
    def files(self) -> Mapping[str, bytes]:
        """Contents of the attached files by name, the first of each."""
        found: dict[str, bytes] = {}
        for one in self.attachments:
            found.setdefault(one.name, one.content)
        return found


def read_pdf(content: bytes, where: str) -> PdfFile:
    if len(content) > PDF_BYTES.most:
        raise CmmUqError(f"is larger than {PDF_BYTES.most} bytes", where=where, fix=_FIX)
    found = PdfFile(content)
    marks = list(_END.finditer(content))
    if not content.startswith(b"%PDF-") or not marks:
        raise CmmUqError("is no whole PDF: its beginning or its end is missing", where=where, fix=_FIX)
    found.ends = _revisions(content, marks, where)
    if rest := len(content) - found.ends[-1]:
        found.problems.append((f"byte {found.ends[-1]}", f"has {rest} bytes after its end"))
    with reading(where):
        _read(found, where)
    _check_ends(found, marks)
    return found


def _revisions(content: bytes, marks: list[re.Match[bytes]], where: str) -> list[int]:
    """Bytes up to the end of each, from the last back; a PDF attached as it is has ends of its own, none of the file."""
    of, ends, at = {mark.start(): mark for mark in marks}, list[int](), int(marks[-1][1])
    place = marks[-1].start()
    while True:
        trailer = _TRAILER.search(content, at) if content.startswith(b"xref", at) else None
        own = None if trailer is None else of.get(trailer.start("end"))
        if b"/Linearized" in content[:1024] or re.match(rb"\d+\s+\d+\s+obj\b", content[at : at + 40]):
            problem = "was saved anew by another program, its table of objects packed or divided"
            raise CmmUqError(problem, where=where, fix=_FIX)
        if trailer is None or own is None or int(own[1]) != at:
            raise CmmUqError("has no table of its objects where it says: it is damaged, or no PDF of cmm-uq",
                             where=f"{where}: byte {place}", fix=_FIX)  # fmt: skip
        ends.append(own.end())
        before = _BEFORE.search(trailer["told"])
        if before is None:
            return ends[::-1]
        place = own.start()
        if int(before[1]) >= at:
            raise CmmUqError("goes round in its revisions: it is damaged", where=f"{where}: byte {place}", fix=_FIX)
        at = int(before[1])


def _check_ends(found: PdfFile, marks: list[re.Match[bytes]]) -> None:
    """Ends that no revision has, and no attached file either."""
    inside = [(at, at + len(one.content)) for one in found.attachments if (at := found.content.find(one.content)) >= 0]
    for mark in marks:
        if mark.end() not in found.ends and not any(begin <= mark.start() < end for begin, end in inside):
            found.problems.append((f"byte {mark.start()}", "has an end of a revision that nothing leads to"))


@contextmanager
def reading(where: str) -> Iterator[None]:
    """Whatever a damaged file makes of the library that reads it, said in one sentence."""
    from pypdf.errors import PyPdfError

    quiet, level = logging.getLogger("pypdf"), logging.getLogger("pypdf").level
    quiet.setLevel(logging.CRITICAL)
    try:
        yield
    except CmmUqError:
        raise
    except (PyPdfError, ValueError, KeyError, TypeError, AttributeError, IndexError, AssertionError, ArithmeticError,
            NotImplementedError, RecursionError, MemoryError, OSError) as error:  # fmt: skip
        what = f"{type(error).__name__}: {error}"
        raise CmmUqError(f"is a damaged PDF ({what})", where=where, fix=_FIX) from error
    finally:
        quiet.setLevel(level)


def _read(found: PdfFile, where: str) -> None:
    from pypdf import PdfReader

    reader = PdfReader(io.BytesIO(found.content), strict=True)
    if reader.is_encrypted or "/Encrypt" in reader.trailer:
        raise CmmUqError("is encrypted, which no PDF of cmm-uq is", where=where, fix=_FIX)
    _Walk(found, where).all(reader.trailer)
    root: Any = reader.trailer["/Root"]
    found.information = {str(key): str(value) for key, value in (reader.metadata or {}).items()}
    found.attachments = list(_attachments(found, root))
    if len(reader.pages) > PDF_PAGES.most:
        raise CmmUqError(f"has more than {PDF_PAGES.most} pages", where=where, fix=_FIX)


class _Walk:
    def __init__(self, found: PdfFile, where: str) -> None:
        self._found, self._where, self._unpacked, self._seen = found, where, 0, set[tuple[int, int]]()

    def all(self, trailer: Any) -> None:
        """Every object that can be reached, once, without recursing."""
        from pypdf.generic import ArrayObject, DictionaryObject, IndirectObject, NameObject, StreamObject

        waiting: list[tuple[str, Any]] = [("trailer", trailer)]
        while waiting:
            place, one = waiting.pop()
            if isinstance(one, IndirectObject):
                key = (one.idnum, one.generation)
                if key in self._seen:
                    continue
                self._seen.add(key)
                if len(self._seen) > PDF_OBJECTS.most:
                    raise CmmUqError(f"has more than {PDF_OBJECTS.most} objects", where=self._where, fix=_FIX)
                place, one = f"object {one.idnum}", one.get_object()
            if isinstance(one, DictionaryObject):
                if isinstance(one, StreamObject):
                    self._unpack(place, one)
                self._name(place, one)
                waiting += [(place, value) for value in dict.values(one) if not isinstance(value, NameObject)]
            elif isinstance(one, ArrayObject):
                waiting += [(place, value) for value in list.__iter__(one)]

    def _name(self, place: str, one: Any) -> None:
        """What acts, hides, or is a note over the page."""
        names = {*dict.keys(one), *(str(value) for value in dict.values(one) if isinstance(value, str))}
        for name in sorted(names & ACTIVE):
            self._problem(place, f"has {name}, which acts or leads out of the file")
        for name in sorted(names & HIDING):
            self._problem(place, f"has {name}, which shows something or not")
        kind, subtype = one.get("/Type"), one.get("/Subtype")
        if kind == "/Annot" and not (subtype == "/Widget" and one.get("/FT") == "/Sig") and subtype != "/Link":
            self._problem(place, f"has a note of the kind {subtype} over the page")
        if kind == "/Sig" or one.get("/FT") == "/Sig":
            self._found.signatures += kind == "/Sig"
        if "/F" in one and "/Filter" in one and kind != "/Filespec":
            self._problem(place, "has a stream that lies in another file")

    def _unpack(self, place: str, one: Any) -> None:
        """A stream whole, up to the limit, with its checksum."""
        names = one.get("/Filter")
        packing = list(map(str, names if isinstance(names, list) else [] if names is None else [names]))
        raw = one._data if isinstance(one._data, bytes) else bytes(one._data)
        if packing not in ([], ["/FlateDecode"]) or one.get("/DecodeParms") is not None:
            raise CmmUqError(f"packs a stream by {' '.join(packing)}, which no PDF of cmm-uq does",
                             where=f"{self._where}: {place}", fix=_FIX)  # fmt: skip
        if packing:
            room = PDF_UNPACKED.most - self._unpacked
            unpacking = zlib.decompressobj()
            try:
                data = unpacking.decompress(raw, room + 1)
            except zlib.error as error:
                raise CmmUqError(f"has a damaged stream ({error})", where=f"{self._where}: {place}", fix=_FIX) from None
            self._unpacked += len(data)
            if self._unpacked > PDF_UNPACKED.most:
                raise CmmUqError(f"unpacks to more than {PDF_UNPACKED.most} bytes", where=self._where, fix=_FIX)
            if not unpacking.eof or unpacking.unused_data.strip():
                raise CmmUqError("has a damaged stream: it does not end where it must",
                                 where=f"{self._where}: {place}", fix=_FIX)  # fmt: skip

    def _problem(self, place: str, what: str) -> None:
        if (place, what) not in self._found.problems:
            self._found.problems.append((place, what))


def _attachments(found: PdfFile, root: Any) -> Iterator[Attachment]:
    """Embedded files; the list of the pages' files and that of names must be one."""
    named: list[tuple[str, Any]] = []
    names = root.get("/Names")
    waiting = [names.get_object()["/EmbeddedFiles"]] if names and "/EmbeddedFiles" in names.get_object() else []
    nodes = 0
    while waiting:
        node, nodes = waiting.pop().get_object(), nodes + 1
        if nodes > 1000:
            raise ValueError("the tree of names does not end")
        pairs = node.get("/Names", [])
        named += [(str(pairs[i]), pairs[i + 1].get_object()) for i in range(0, len(pairs) - 1, 2)]
        waiting += list(reversed(node.get("/Kids", [])))
    beside = [one.get_object() for one in root.get("/AF", [])]
    if len(beside) != len(named) or any(all(one is not spec for one in beside) for _, spec in named):
        found.problems.append(("catalogue", "lists other files in /AF than in /EmbeddedFiles"))
    for key, spec in named:
        name = str(spec.get("/UF", spec.get("/F", key)))
        if not name == key == str(spec.get("/F", name)):
            found.problems.append((f"attachment {key}", f"is called {name!r} as well"))
        files = spec["/EF"].get_object()
        stream = files.get("/F", files.get("/UF")).get_object()
        if "/UF" in files and files["/UF"].get_object() is not stream:
            found.problems.append((f"attachment {name}", "has two contents, one for each form of its name"))
        content = stream.get_data()
        told = _inner(stream, "/Params")
        if "/Size" in told and int(told["/Size"]) != len(content):
            found.problems.append((f"attachment {name}", f"has {len(content)} bytes, and {told['/Size']} are told"))
        checksum = hashlib.md5(content, usedforsecurity=False).digest()
        if "/CheckSum" in told and bytes(told["/CheckSum"].original_bytes) != checksum:
            found.problems.append((f"attachment {name}", "has another checksum than the PDF tells"))
        yield Attachment(name, content, str(spec.get("/AFRelationship", "")).lstrip("/"))


def _inner(one: Any, key: str) -> Any:
    """A part of a dictionary, whatever refers to it; an empty one where there is none."""
    return one[key] if key in one else {}  # noqa: SIM401 - get() of pypdf does not follow references


_NAMES = {"id", "class", "role", "dir", "aria-labelledby", "aria-label", "aria-hidden"}
ALLOWED: Mapping[str, frozenset[str]] = MappingProxyType({
    tag: frozenset(_NAMES | set(more.split())) for tag, more in {
        "html": "lang", "head": "", "meta": "charset name content http-equiv", "link": "rel href", "title": "", "style": "",
        "img": "src alt",
        "body": "", "aside": "", "header": "", "main": "", "footer": "", "section": "", "address": "", "div": "tabindex",
        "h1": "", "h2": "", "h3": "", "p": "", "span": "", "bdi": "", "strong": "", "b": "", "br": "", "ul": "", "li": "",
        "dl": "", "dt": "", "dd": "", "figure": "", "figcaption": "", "table": "style", "thead": "", "tbody": "",
        "tr": "", "th": "scope", "td": "data-label",
        "svg": "font-family stroke-linejoin width height viewbox xmlns", "g": "clip-path", "path": "d style clip-path",
        "text": "style x y transform", "tspan": "style x y", "use": "href x y style clip-path", "rect": "x y width height",
        "clippath": "", "defs": "",
    }.items()
})  # fmt: skip
"""Tags of the template and of its pictures, each with its attributes."""

_VOID = frozenset({"meta", "link", "br", "img"})
_UNSEEN = frozenset({"head", "title", "style"})
_REACHES_OUT = re.compile(r"url\s*\(\s*(?!#)|@import|expression\s*\(|javascript:", re.IGNORECASE)


@dataclass
class HtmlPage:
    """What a page shows, in order."""

    text: str = ""
    title: str = ""  # of the window: title and number of the document
    pictures: list[bytes] = field(default_factory=list)  # that are no drawings: the logo
    problems: list[tuple[str, str]] = field(default_factory=list)  # what does not belong there, each with its place


def read_html(content: bytes, where: str) -> HtmlPage:
    if len(content) > HTML_BYTES.most:
        raise CmmUqError(f"is larger than {HTML_BYTES.most} bytes", where=where, fix=_FIX)
    reader = _Reader(where)
    reader.feed(text_of(content, where, _FIX))
    reader.close()
    reader.end()
    return reader.page


class _Reader(HTMLParser):
    def __init__(self, where: str) -> None:
        super().__init__(convert_charrefs=True)
        self.page, self._where, self._open = HtmlPage(), where, list[str]()
        self._text: list[str] = []
        self._unseen: dict[str, list[str]] = {"title": [], "style": []}

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self._check(tag, attrs)
        self._text.append(" ")
        if tag not in _VOID:
            self._open.append(tag)
            if len(self._open) > HTML_DEPTH.most:
                raise CmmUqError(f"is nested deeper than {HTML_DEPTH.most} tags", where=self._at(), fix=_FIX)

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.handle_starttag(tag, attrs)
        if tag not in _VOID:
            self.handle_endtag(tag)

    def handle_endtag(self, tag: str) -> None:
        if not self._open or self._open[-1] != tag:
            self._problem(f"closes <{tag}>, which is not the last that was opened")
            return
        self._open.pop()
        self._text.append(" ")

    def handle_data(self, data: str) -> None:
        inner = self._open[-1] if self._open else ""
        if inner in self._unseen:
            self._unseen[inner].append(data)
        elif "head" in self._open or "body" not in self._open:
            if data.strip():
                self._problem("has text outside its body")
        else:
            self._text.append(data)

    def handle_comment(self, data: str) -> None:
        self._problem("has a comment, which the template has not")

    def handle_decl(self, decl: str) -> None:
        if decl.lower() != "doctype html":
            self._problem(f"has the declaration {decl[:40]!r}")

    def handle_pi(self, data: str) -> None:
        self._problem("has a processing instruction")

    def unknown_decl(self, data: str) -> None:
        self._problem(f"has the declaration {data[:40]!r}")

    def end(self) -> None:
        for tag in self._open:
            self._problem(f"does not close <{tag}>")
        page = self.page
        page.text, page.title = "".join(self._text), "".join(self._unseen["title"])
        if _REACHES_OUT.search("".join(self._unseen["style"])):
            page.problems.append(("style sheet", "refers to something outside the file"))

    def _check(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        """Tags and attributes that are not those of the template, and what reaches out of the file."""
        allowed = ALLOWED.get(tag)
        if allowed is None:
            self._problem(f"has a <{tag}>, which the template has not")
            return
        names = [name for name, _ in attrs]
        if len(set(names)) < len(names):
            self._problem(f"has an attribute of <{tag}> twice")
        if tag == "img" and "src" not in names:
            self._problem("has an <img> without a picture, which shows words instead")
        for name, value in attrs:
            if name not in allowed:
                self._problem(f"has the attribute {name!r} in <{tag}>, which the template has not")
            elif name == "href" and not (value or "").startswith("#") and value != "data:,":
                self._problem(f"refers to {value!r}")
            elif name == "src" and not self._inside(value or ""):
                self._problem(f"refers to {(value or '')[:60]!r}")
            elif name == "style" and (_REACHES_OUT.search(value or "") or "display" in (value or "")):
                self._problem(f"has the style {value!r} in <{tag}>")

    def _inside(self, source: str) -> bool:
        """Keep a picture that the page carries inside, and say whether it is one."""
        kind, _, content = source.partition(";base64,")
        try:
            self.page.pictures.append(b64decode(content, validate=True))
        except ValueError:
            return False
        return kind in ("data:image/png", "data:image/svg+xml")

    def _problem(self, what: str) -> None:
        line, column = self.getpos()
        self.page.problems.append((f"line {line}, column {column + 1}", what))

    def _at(self) -> str:
        return f"{self._where} line {self.getpos()[0]}"
