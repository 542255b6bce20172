"""A certificate's HTML read as what it shows, text in order, and nothing that does not belong.

The page is one file without scripts, forms or references to anything outside it, with the tags and attributes of the
template and no others. Whatever else is in a page is named, since it may show something else than what is read here.
"""

from __future__ import annotations

import re
from base64 import b64decode
from collections.abc import Mapping
from dataclasses import dataclass, field
from html.parser import HTMLParser
from types import MappingProxyType

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.files.content import text_of
from cmm_uq.base.files.limits import HTML_BYTES, HTML_DEPTH

_FIX = "Ask whoever sent it for the file as cmm-uq wrote it"
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
    """Follows the tags of a page."""

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
