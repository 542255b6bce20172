"""XML as a tree of elements with their lines, and back: no DTD, no entities, nothing from elsewhere, within limits.

Names of the namespaces of a DCC carry the prefix they commonly have, ``dcc:name``; others stand as ``{namespace}name``.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from typing import NoReturn
from xml.parsers import expat

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.files.limits import DCC_BYTES, XML_ATTRIBUTES, XML_DEPTH, XML_ELEMENTS

NAMESPACES: Mapping[str, str] = {  # by prefix
    "dcc": "https://ptb.de/dcc",
    "si": "https://ptb.de/si",
    "ds": "http://www.w3.org/2000/09/xmldsig#",
    "xsi": "http://www.w3.org/2001/XMLSchema-instance",
}
_PREFIXES = {uri: prefix for prefix, uri in NAMESPACES.items()}
_ILLEGAL = "[^\t\n\r\u0020-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]"  # characters that no XML 1.0 can hold


class Node:
    """An element, ``prefix:name``, with the line of its start, 0 where it was not read."""

    __slots__ = ("attributes", "children", "line", "parent", "tag", "text")

    def __init__(self, tag: str, attributes: Mapping[str, str], line: int = 0, parent: Node | None = None) -> None:
        self.tag, self.attributes, self.line, self.parent = tag, dict(attributes), line, parent
        self.children: list[Node] = []
        self.text = ""

    def __eq__(self, other: object) -> bool:
        mine = (self.tag, self.attributes, self.text.strip(), self.children)
        return isinstance(other, Node) and mine == (other.tag, other.attributes, other.text.strip(), other.children)

    __hash__ = None  # type: ignore[assignment]

    @property
    def xpath(self) -> str:
        """Where it stands, ``/dcc:a/dcc:b[2]``."""
        if self.parent is None:
            return f"/{self.tag}"
        alike = [child for child in self.parent.children if child.tag == self.tag]
        place = f"[{next(i for i, child in enumerate(alike, 1) if child is self)}]" if len(alike) > 1 else ""
        return f"{self.parent.xpath}/{self.tag}{place}"

    def walk(self) -> Iterator[Node]:
        """Itself and all below it, in the order of the file."""
        yield self
        for child in self.children:
            yield from child.walk()


def parsed(data: bytes, where: str) -> Node:
    if len(data) > DCC_BYTES.most:
        raise CmmUqError(f"is larger than {DCC_BYTES.most} {DCC_BYTES.unit}", where=where, fix="Is it the right file?")
    parser, open_ = expat.ParserCreate(namespace_separator=" "), [Node("", {})]  # whose first is around the root
    count = 0

    def refuse(problem: str) -> NoReturn:
        at = f"{where}, line {parser.CurrentLineNumber}"
        raise CmmUqError(problem, where=at, fix="A certificate is XML without that")

    def start(name: str, attributes: dict[str, str]) -> None:
        nonlocal count
        count += 1
        for number, limit in ((count, XML_ELEMENTS), (len(open_) - 1, XML_DEPTH), (len(attributes), XML_ATTRIBUTES)):
            if number > limit.most:
                refuse(f"has more than {limit.most} {limit.unit}")
        named = {_named(key): value for key, value in attributes.items()}
        node = Node(_named(name), named, parser.CurrentLineNumber, open_[-1] if len(open_) > 1 else None)
        open_[-1].children.append(node)
        open_.append(node)

    def read_text(text: str) -> None:
        open_[-1].text += text

    def doctype(*declared: object) -> None:
        refuse("has a document type (DOCTYPE), which can pull in other files")

    parser.buffer_text = True
    parser.StartElementHandler, parser.EndElementHandler = start, lambda _: open_.pop()
    parser.CharacterDataHandler, parser.StartDoctypeDeclHandler = read_text, doctype
    try:
        parser.Parse(data, True)
    except expat.ExpatError as error:
        problem, where = expat.errors.messages[error.code], f"{where}, line {error.lineno}"
        raise CmmUqError(f"is no XML: {problem}", where=where, fix="Ask for it again") from None
    except (ValueError, LookupError) as error:
        raise CmmUqError(f"is no XML: {error}", where=where, fix="Ask for it again") from None
    return open_[0].children[0]


def _named(name: str) -> str:
    space, _, local = name.rpartition(" ")
    if not space:
        return local
    return f"{_PREFIXES[space]}:{local}" if space in _PREFIXES else f"{{{space}}}{local}"


def serialised(root: Node) -> bytes:
    """A file of a tree: UTF-8, two spaces a level, the same bytes for the same tree."""
    declared = {f"xmlns:{prefix}": uri for prefix, uri in NAMESPACES.items() if prefix != "ds"}
    return "".join(['<?xml version="1.0" encoding="UTF-8"?>\n', *_lines(root, declared, "")]).encode()


def _lines(node: Node, declared: Mapping[str, str], indent: str) -> Iterator[str]:
    tag, further = _spelled(node.tag)
    attributes = [*{**declared, **further}.items()]
    for key, value in node.attributes.items():
        name, more = _spelled(key, "a")
        attributes += [*more.items(), (name, value)]
    start = f"{indent}<{tag}" + "".join(f' {key}="{_quoted(value)}"' for key, value in attributes)
    if not node.children:
        yield f"{start}>{_escaped(node.text)}</{tag}>\n" if node.text else f"{start}/>\n"
        return
    yield f"{start}>\n"
    if node.text.strip():
        yield _escaped(node.text.strip()) + "\n"
    for child in node.children:
        yield from _lines(child, {}, indent + "  ")
    yield f"{indent}</{tag}>\n"


def _spelled(name: str, prefix: str = "o") -> tuple[str, dict[str, str]]:
    """A name with a prefix, and the declaration that the prefix needs here."""
    if name.startswith("{"):
        space, _, local = name[1:].rpartition("}")
        return f"{prefix}:{local}", {f"xmlns:{prefix}": space}
    return name, {"xmlns:ds": NAMESPACES["ds"]} if name.startswith("ds:") else {}


def _escaped(text: str) -> str:
    if illegal := re.search(_ILLEGAL, text):
        problem = f"{illegal[0]!r} is a character that XML cannot hold"
        raise CmmUqError(problem, fix="Take it out of the text it stands in")
    return text.replace("&", "&amp;").replace("<", "&lt;").replace(">", "&gt;").replace("\r", "&#13;")


def _quoted(text: str) -> str:
    return _escaped(text).replace('"', "&quot;").replace("\n", "&#10;").replace("\t", "&#9;")
