"""Texts of a DCC in one or several languages, with files and formulas."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated

from cmm_uq.jobs.dcc.fields import Attribute, Child, Choice, Content, Foreign, Many, Part
from cmm_uq.jobs.dcc.simple import BYTES, LANGUAGE, NAME, NAMES, NOT_EMPTY, STRING, STRINGS
from cmm_uq.jobs.dcc.tree import Node

Id = Annotated[str | None, Attribute("id", NAME)]
RefId = Annotated[tuple[str, ...], Attribute("refId", NAMES)]
RefType = Annotated[tuple[str, ...], Attribute("refType", STRINGS)]


class Said(Part, kw_only=False):
    """A text in a language (``stringWithLangType``)."""

    text: Annotated[str, Content(STRING)]
    language: Annotated[str | None, Attribute("lang", LANGUAGE)] = None
    id: Id = None
    ref_id: RefId = ()
    ref_type: RefType = ()


class Words(Part, kw_only=False):
    """The same text in its languages (``textType``)."""

    contents: Annotated[tuple[Said, ...], Many("content")]
    id: Id = None

    def __str__(self) -> str:
        return text_of(self.contents)


class Latex(Part, kw_only=False):
    """A formula (``formulaType``), as LaTeX or MathML."""

    latex: Annotated[str | None, Child("latex", STRING)] = None
    mathml: Annotated[Markup | None, Child("mathml")] = None
    id: Id = None
    ref_id: RefId = ()
    ref_type: RefType = ()


class Markup(Part, kw_only=False):
    """XML of another namespace (``xmlType``)."""

    nodes: Annotated[tuple[Node, ...], Foreign()] = ()
    id: Id = None
    ref_id: RefId = ()
    ref_type: RefType = ()


class Attached(Part):
    """A file (``byteDataType``)."""

    name: Annotated[Words | None, Child("name")] = None
    description: Annotated[Rich | None, Child("description")] = None
    file_name: Annotated[str, Child("fileName", NOT_EMPTY)]
    mime_type: Annotated[str, Child("mimeType", NOT_EMPTY)]
    data: Annotated[bytes, Child("dataBase64", BYTES)]
    id: Id = None
    ref_id: RefId = ()
    ref_type: RefType = ()


class Rich(Part, kw_only=False):
    """A text with what belongs to it (``richContentType``)."""

    name: Annotated[Words | None, Child("name")] = None
    contents: Annotated[tuple[Said | Attached | Latex, ...], Choice(("content", "file", "formula"), many=True)] = ()
    id: Id = None
    ref_id: RefId = ()
    ref_type: RefType = ()

    def __str__(self) -> str:
        return text_of(tuple(part for part in self.contents if isinstance(part, Said)))


def text_of(contents: tuple[Said, ...], language: str = "en") -> str:
    """A text in a language, else without one, else the first; several of one language are paragraphs."""
    for wanted in (language, None, contents[0].language if contents else None):
        found = [part.text for part in contents if part.language == wanted]
        if found:
            return "\n".join(found)
    return ""


def words(texts: str | Mapping[str, str]) -> Words:
    """A text, or a text by language."""
    return Words(_said(texts))


def rich(*texts: str | Mapping[str, str], files: tuple[Attached, ...] = (), formulas: tuple[str, ...] = ()) -> Rich:
    """Paragraphs, each a text or a text by language, with files and formulas (LaTeX)."""
    paragraphs = tuple(part for text in texts for part in _said(text))
    return Rich(contents=(*paragraphs, *files, *(Latex(latex) for latex in formulas)))


def _said(texts: str | Mapping[str, str]) -> tuple[Said, ...]:
    if isinstance(texts, str):
        return (Said(texts),)
    return tuple(Said(text, language) for language, text in texts.items())
