"""A document as one self-contained HTML page, by ``templates/document.html`` and ``.css``."""

from __future__ import annotations

import re
from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.languages.translation import code_of
from cmm_uq.certificate.document import Document, view_words
from cmm_uq.certificate.plots.style import COLOURS
from cmm_uq.certificate.render.fitting import fitted, picture_share, tightness

if TYPE_CHECKING:
    from jinja2 import Environment


def template_folder() -> Path:
    package = Path(__file__).resolve().parents[2]
    for folder in (package / "templates", package.parent / "templates"):
        if (folder / "document.html").is_file():
            return folder
    raise CmmUqError("the templates of the certificate are missing", where=str(package),
                     fix="Install cmm-uq again, from a whole wheel")  # fmt: skip


def render_html(document: Document) -> str:
    shown, words = fitted(document), view_words(code_of(document.language))
    return _environment().get_template("document.html").render(
        document=shown.as_data(), words=words, colour=COLOURS, picture=picture_share(shown), tight=tightness(shown)
    )  # fmt: skip


def style_sheet(heading: str, banner: str, language: str) -> str:
    """The style sheet of a page, which says what stands at head and foot of its printed pages."""
    title, _, number = heading.partition(" ")
    document = {"title": title, "number": number, "banner": banner, "language": language}
    words = view_words(code_of(language))
    return _environment().get_template("document.css").render(document=document, words=words, colour=COLOURS)


@cache
def _environment() -> Environment:
    from jinja2 import Environment, FileSystemLoader, StrictUndefined

    environment = Environment(loader=FileSystemLoader(template_folder()), autoescape=True, undefined=StrictUndefined)
    environment.filters["inline_svg"] = _inline_svg
    environment.filters["css_string"] = _css_string
    return environment


_TAG = re.compile(r"<[^>]*>")
_REFERENCE = re.compile(r' id="|href="#|url\(#')


def _inline_svg(plot: Mapping[str, Any], prefix: str) -> str:
    """A plot's SVG as an image with its alternative text, its ids made unique in the page by a prefix."""
    from markupsafe import escape

    svg = _TAG.sub(lambda tag: _REFERENCE.sub(lambda found: f"{found[0]}{prefix}-", tag[0]), plot["svg"])
    return svg.replace("<svg ", f'<svg role="img" aria-label="{escape(plot["alternative"])}" ', 1)


def _css_string(text: str) -> str:
    """A CSS string literal that no text can break out of: everything but letters and digits is escaped."""
    escaped = re.sub(r"[^A-Za-z0-9]", lambda found: f"\\{ord(found[0]):06x} ", text)
    return f'"{escaped}"'
