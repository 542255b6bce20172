"""A document as PDF/A-3a and PDF/UA-1: for the archive, for screen readers, with its files inside.

What it looks like is in ``templates/document.typ``. The text goes to Typst as data and is never read as its markup. Only
the fonts inside the typst wheel are used, so that the file looks the same from every machine; where they lack a
character (Chinese, Japanese and Korean names), the machine's own fonts are asked, and what these lack too is shown as □,
with a line that says so.
"""

from __future__ import annotations

import datetime as dt
import json
import re
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import PurePosixPath
from typing import Any

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.languages.translation import Code, code_of, translated as said_in
from cmm_uq.base.messages import Text, Verbatim, commas, say, sentences
from cmm_uq.certificate.document import Document, attachment_title, view_words
from cmm_uq.certificate.plots.style import COLOURS, JAPANESE, fonts_of
from cmm_uq.certificate.render.html import SMALLEST, fitted, template_folder
from cmm_uq.certificate.sign import TEST_NOTE, Seal, Signer

FACE = "Libertinus Serif"  # of the text; what it lacks, as Japanese, is set in the font of the language
EPOCH = "1970-01-01"
"""Date of a PDF whose document has none: the clock is never read, so the same document gives the same bytes."""

_TYPES = {
    ".csv": "text/csv", ".html": "text/html", ".json": "application/json", ".npz": "application/zip",
    ".pdf": "application/pdf", ".toml": "application/toml", ".txt": "text/plain", ".xml": "application/xml",
}  # fmt: skip


def render_pdf(document: Document, attachments: Mapping[str, bytes]) -> bytes:
    """The document as PDF, with files embedded.

    ``attachments``: by name, what is embedded byte for byte: ``.json``, ``.npz`` and ``.xml`` files as *data* of the
    document, others as its *source* (the relationships of ISO 19005-3).
    """
    language = code_of(document.language)
    content = {
        "document": fitted(document).as_data(),
        "smallest": SMALLEST,
        "words": view_words(language),
        "fonts": [FACE, JAPANESE] if language == "ja" else [FACE],
        "colour": COLOURS,
        "date": document.date.isoformat() if document.date else EPOCH,
        "attachments": [_attachment(name, data, language) for name, data in attachments.items()],
        "logo": document.logo and {"format": document.logo.format, "data": list(document.logo.content)},
        "missing": "",
    }
    return _with_fallback(content, [str(file.parent) for file in fonts_of(language)])


def picture(template: str, content: Mapping[str, Any], language: Code = "en") -> bytes:
    """A template alone as a PDF page without tags, to be shown inside another; characters that no font has become □."""
    compiled = partial(_compile, template=template, standards=("a-3b",), tagged=False)
    shown = {"document": content, "colour": COLOURS, "fonts": [FACE, JAPANESE] if language == "ja" else [FACE]}
    return _with_fallback(shown, [str(file.parent) for file in fonts_of(language)], compiled)


def _attachment(name: str, data: bytes, language: Code) -> dict[str, Any]:
    suffix = PurePosixPath(name).suffix.lower()
    outcome = suffix in {".json", ".npz", ".xml"}
    try:
        body: str | list[int] = data.decode("utf-8")
    except UnicodeDecodeError:
        body = list(data)
    return {
        "name": name,
        "data": body,
        "relationship": "data" if outcome else "source",
        "type": _TYPES.get(suffix, "application/octet-stream"),
        "description": str.__str__(said_in(attachment_title(name, outcome=outcome), language)),
    }


def _with_fallback(content: dict[str, Any], folders: list[str], compiled: Callable[..., bytes] | None = None) -> bytes:
    """Compile with the embedded fonts; then with the machine's too; then without the characters that both lack."""
    from typst import TypstError

    make, missing = compiled or _compile, list[str]()
    for system_fonts in (False, True, True):
        try:
            return make(_without(content, missing) if missing else content, folders, system_fonts=system_fonts)
        except TypstError as error:
            lacking = _missing(error)
            if not lacking or missing:
                hints = f" ({'; '.join(error.hints)})" if error.hints else ""
                fix = "The HTML view has the same content; please report this with the job that caused it"
                raise CmmUqError(f"the PDF could not be made: {error.message}{hints}", fix=fix) from error
            missing = lacking if system_fonts else []
    raise AssertionError("unreachable")


def _compile(
    content: Mapping[str, Any], folders: list[str], *, system_fonts: bool, template: str = "document.typ",
    standards: Sequence[Any] = ("a-3a", "ua-1"), tagged: bool = True,
) -> bytes:  # fmt: skip
    import typst

    return typst.compile(
        (template_folder() / template).read_bytes(),
        font_paths=typst.Fonts(include_system_fonts=system_fonts, font_paths=folders),
        ignore_system_fonts=not system_fonts,
        sys_inputs={"input": json.dumps(content)},
        pdf_standards=list(standards),
        pdf_tags=tagged,
        timestamp=0,
    )


def _missing(error: Any) -> list[str]:
    """Characters that no font had or PDF/A forbids; Typst names all at once, each in quotes or as its code."""
    texts = re.findall(r'(?:the text|codepoint) `"(.+?)"`', error.diagnostic)
    plain = (re.sub(r"\\u\{([0-9a-f]+)\}", lambda code: chr(int(code[1], 16)), text) for text in texts)
    return sorted({character for text in plain for character in text})


def _without(content: dict[str, Any], missing: list[str]) -> dict[str, Any]:
    """The content with □ for every missing character, and their codes for the line that says so."""
    table = str.maketrans(dict.fromkeys(missing, "□"))

    def shown(value: Any) -> Any:
        if isinstance(value, dict):
            return {key: shown(item) for key, item in value.items()}
        if isinstance(value, list):
            return [shown(item) for item in value]
        return value.translate(table) if isinstance(value, str) else value

    codes = ", ".join(f"U+{ord(character):04X}" for character in missing)
    return {**content, "document": shown(content["document"]), "missing": codes}


WIDTH_MM, HEIGHT_MM = 84.0, 8.0
LEFT_MM, BOTTOM_MM, GAP_MM = 20.0, 3.5, 2.0
"""Of the first seal on a page A4; a second stands beside it. The text of a page ends 22 mm, its foot 10 mm above the edge."""

SEALS = 2
_POINTS = 72 / 25.4


def same(text: Text) -> Text:
    return text


def seal(
    signer: Signer, at: dt.datetime, laboratory: Text, accreditation: Text, *, language: str = "en",
    said: Callable[[Text], Text] = same,
) -> Seal:  # fmt: skip
    time = Verbatim(at.astimezone(dt.UTC).strftime("%Y-%m-%d %H:%M UTC"))
    head = say("Electronically signed by {name}", name=Verbatim(signer.name))
    facts = commas([part for part in (laboratory, accreditation, time) if part])
    mark = [say("TEST KEY: {note}.", note=TEST_NOTE)] if signer.test_key else []
    shown = picture("seal.typ", {
        "width": WIDTH_MM, "height": HEIGHT_MM, "language": language.split("-")[0].lower(),
        "lines": [str.__str__(said(head)), str.__str__(said(facts))],
        "mark": str.__str__(said(say("TEST"))) if signer.test_key else "",
    }, code_of(language))  # fmt: skip
    says = said(sentences([*mark, say("{head}: {facts}.", head=head, facts=facts)]))
    lefts = [LEFT_MM + number * (WIDTH_MM + GAP_MM) for number in range(SEALS)]
    low, high = BOTTOM_MM * _POINTS, (BOTTOM_MM + HEIGHT_MM) * _POINTS
    places = tuple((left * _POINTS, low, (left + WIDTH_MM) * _POINTS, high) for left in lefts)
    return Seal(shown, places, str.__str__(says))
