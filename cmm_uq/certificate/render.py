"""A document as one self-contained HTML page, and as PDF/A-3a and PDF/UA-1 with its files inside.

What it looks like is in ``templates/document.html``, ``.css`` and ``.typ``. The text goes to Typst as data and is never read
as its markup. Only the fonts inside the typst wheel are used, so that the file looks the same from every machine; where they
lack a character (Chinese, Japanese and Korean names), the machine's own fonts are asked, and what these lack too is shown as
□, with a line that says so. What decides is fitted to the first page: of long remarks and warnings it carries the beginnings,
the whole texts stand behind it. Heights are reckoned, in mm, from letters, so that both views say the same on the same page;
the PDF then makes the picture as large as there is room for.
"""

from __future__ import annotations

import datetime as dt
import json
import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from functools import cache
from itertools import chain
from math import ceil
from pathlib import Path, PurePosixPath
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.languages.translation import Code, code_of, translated as said_in
from cmm_uq.base.messages import Message, Plural, Text, Verbatim, commas, say, sentences
from cmm_uq.certificate import document as doc
from cmm_uq.certificate.document import WORDS, Document, Facts, Plot, Section, Table, letters
from cmm_uq.certificate.look import COLOURS, template_folder
from cmm_uq.certificate.plots.style import JAPANESE, fonts_of, japanese_font
from cmm_uq.certificate.sign import TEST_NOTE, Seal, Signer

if TYPE_CHECKING:
    from jinja2 import Environment


def render_html(document: Document) -> str:
    shown, words = fitted(document), doc.view_words(code_of(document.language))
    return _environment().get_template("document.html").render(
        document=shown.as_data(), words=words, colour=COLOURS, picture=picture_share(shown), tight=tightness(shown)
    )  # fmt: skip


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
    return '"' + re.sub(r"[^A-Za-z0-9]", lambda found: f"\\{ord(found[0]):06x} ", text) + '"'


SMALLEST = 0.66  # of a picture's width: its lettering is 5 pt then
_PAGE = 256.0  # height of the text
_BROWSER = 1.3  # times as high as in the PDF is what a browser prints
_MEASURED = 0.85  # of the height that is reckoned from letters, what Typst makes of it
_NAMED = 12  # characters without a font that are shown
_LONG, _NAME = 130, 45  # letters from which a text is given by its beginning, and least letters of that
_CUT = re.compile(r"(?<=[.;:])\s|(?<=[。；：])")
_IN_FULL = say("In full behind this page.")
_REMARKS = ("Remarks", "Deviations from the method", "Results of external providers", "Data from the customer")
"""Particulars that may continue behind the page."""


def fitted(document: Document) -> Document:
    """Remarks, then warnings, without room go behind the first page; of warnings that differ in figures the first stays."""
    if not document.decides or _height(document) <= _PAGE:
        return document
    for shorter in (_remarks_behind, _warnings_behind):
        document = shorter(document)
        if _height(document) <= _PAGE:
            break
    return document


def picture_share(document: Document) -> int:
    """Part of the width that the picture of the first page has room for in print, per cent."""
    tall = sum(_picture(block) for block in _first(document) if isinstance(block, Plot))
    room = 100 * SMALLEST + (100 * (_PAGE / _BROWSER - _height(document)) / tall if tall else 0)
    return max((share for share in (75, 85, 100) if share <= room), default=66)


def tightness(document: Document) -> int:
    """Size of the first page as a browser prints it, per cent; smaller letters make longer lines, too."""
    share = 100 * (_PAGE / (_BROWSER * _height(document))) ** 0.8 if document.decides else 100
    return max((part for part in range(70, 105, 5) if part <= share), default=70)


def _remarks_behind(document: Document) -> Document:
    every = (row for facts in document.particulars for row in facts.rows)
    long = [row for row in every if getattr(row[0], "source", row[0]) in _REMARKS and letters(row[1]) > _LONG]
    if not long:
        return document
    in_full = _said(document, _IN_FULL)
    shown = tuple(
        Facts(tuple((row[0], sentences((_beginning(row[1]), in_full))) if row in long else row for row in facts.rows))
        for facts in document.particulars
    )
    behind = Section(_said(document, WORDS["particulars"]), (Facts(tuple(long)),))
    *others, annex = _around(document)
    return replace(document, particulars=shown, sections=(*chain(*others), behind, *annex))


def _warnings_behind(document: Document) -> Document:
    if sum(map(letters, document.warnings)) <= _LONG:
        return document
    alike: dict[str, list[Text]] = {}
    for text in document.warnings:
        alike.setdefault(_pattern(getattr(text, "source", text)), []).append(text)
    named = [
        _beginning(texts[0]) if len(texts) == 1
        else _said(document, say("{shown}; {count} more behind this page", shown=_beginning(texts[0]), count=len(texts) - 1))
        for texts in alike.values()
    ]  # fmt: skip
    words = WORDS["warning"] if len(document.warnings) == 1 else WORDS["warnings"]
    behind = Section(_said(document, words), tuple(doc.Paragraph(text) for text in document.warnings))
    first, *others = _around(document)
    return replace(document, warnings=(*named, _said(document, _IN_FULL)), sections=(*first, behind, *chain(*others)))


def _pattern(text: Text) -> str:
    """What messages that differ in their figures alone have in common."""
    if isinstance(text, Message) and not isinstance(text, Plural):
        inner = (value for value in text.arguments.values() if isinstance(value, Message))
        return text.pattern + "".join(map(_pattern, inner))
    return str.__str__(text)


def _beginning(text: Text) -> Text:
    whole = str.__str__(text)
    if letters(whole) <= _LONG:
        return text
    ends = [found.start() for found in _CUT.finditer(whole) if letters(whole[: found.start()]) >= _NAME]
    end = max((end for end in ends if letters(whole[:end]) <= _LONG), default=0)
    if not end:
        end = next(i for i in range(len(whole), 0, -1) if letters(whole[:i]) <= _LONG)
        end = whole.rfind(" ", 0, end) if " " in whole[_NAME // 2 : end] else end
    return Verbatim(f"{whole[:end]} …")


def _said(document: Document, text: Text) -> Text:
    return said_in(text, code_of(document.language))


def _around(document: Document) -> tuple[list[Section], ...]:
    """Sections of the first page, those behind it, and those of the annex."""
    ranks = [0 if one.first else 2 if one.opinion else 1 for one in document.sections]
    return tuple([one for one, of in zip(document.sections, ranks, strict=True) if of == rank] for rank in range(3))


def _height(document: Document) -> float:
    address = 5 + 3.7 * max(0, len(document.issuer) - 1) if document.issuer else 0
    head = max(19.0 if document.logo else 0.0, address)
    height = 17 + head + (8 if head else 0) + 4.1 * _lines(document.subject, 170, 10)
    height += _MEASURED * sum(_middle(document))
    if document.statements or document.signatures:
        statements = sum(3 + 3.7 * _lines(text, 170, 9) for text in document.statements)
        height += 9 + statements + 23 * -(-len(document.signatures) // 3)
    return height


def _middle(document: Document) -> Iterator[float]:
    narrow, wide = ((31, 46) if document.language == "en" else (38, 46)), (31, 132)
    yield max((_rows(facts, *narrow) for facts in document.particulars[:2]), default=0) + 6
    if document.overview:
        rows = [max(_lines(name, 50, 10.5), _lines(text, 106, 10)) for name, text in document.overview.rows]
        yield 24 + sum(1.1 + 4.1 * lines for lines in rows)
    yield from (13.0 for section in document.sections if section.first)
    for block in _first(document):
        if isinstance(block, Plot):
            yield 13 + SMALLEST * _picture(block) + 3.7 * _lines(block.caption, 170, 9)
        elif isinstance(block, Table):
            yield 15 + 5.5 * len(block.rows) + sum(1 + 3.7 * _lines(note, 170, 8.5) for note in block.notes)
    yield from (_rows(facts, *wide) + 4 for facts in document.particulars[2:])
    if document.warnings:
        yield 16 + sum(0.1 + 4.4 * _lines(text, 158, 10) for text in document.warnings)


def _first(document: Document) -> Iterable[object]:
    return (block for section in document.sections if section.first for block in section.blocks)


def _rows(facts: Facts, name_mm: float, mm: float) -> float:
    return sum(1.0 + 3.95 * max(_lines(name, name_mm, 9.5), _lines(text, mm, 9.5)) for name, text in facts.rows)


def _lines(text: str, mm: float, size: float) -> int:
    """Of a text in a column: 0.43 of the size to a letter, twice as much to a Japanese character."""
    return sum(max(1, ceil(letters(line) * 0.43 * size * 0.3528 / mm)) for line in text.split("\n"))


def _picture(plot: Plot) -> float:
    _, _, width, height = map(float, re.findall(r'viewBox="([^"]*)"', plot.svg)[0].split())
    return 170 * height / width


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
        "document": fitted(document).as_data(), "smallest": SMALLEST, "words": doc.view_words(language),
        "colour": COLOURS, "date": document.date.isoformat() if document.date else EPOCH,
        "attachments": [_attachment(i, name, language) for i, name in enumerate(attachments)],
        "logo": document.logo and {"format": document.logo.format, "data": list(document.logo.content)}, "missing": "",
    }  # fmt: skip
    with TemporaryDirectory() as root:
        for i, data in enumerate(attachments.values()):
            Path(root, str(i)).write_bytes(data)
        return _with_fallback(content, language, root=root)


def picture(template: str, content: Mapping[str, Any], language: Code = "en") -> bytes:
    """A template alone as a PDF page without tags, to be shown inside another; characters that no font has become □."""
    how = {"template": template, "standards": ("a-3b",), "tagged": False}
    return _with_fallback({"document": content, "colour": COLOURS}, language, **how)


def _attachment(place: int, name: str, language: Code) -> dict[str, Any]:
    suffix = PurePosixPath(name).suffix.lower()
    outcome, title = suffix in {".json", ".npz", ".xml"}, say("Input of this document: {name}", name=Verbatim(name))
    if outcome:
        title = say("Results in machine-readable form: {name}", name=Verbatim(name))
    described, kind = str.__str__(said_in(title, language)), _TYPES.get(suffix, "application/octet-stream")
    relationship = "data" if outcome else "source"
    return {"name": name, "place": str(place), "relationship": relationship, "type": kind, "description": described}


def _with_fallback(content: dict[str, Any], language: Code, **how: Any) -> bytes:
    """Compile with the embedded fonts; with that of Japanese documents too; with the machine's; without what all lack."""
    from typst import TypstError

    folders, missing = [str(file.parent) for file in fonts_of(language)], list[str]()
    doc.NOT_LETTERED.set("")
    content = {**content, "fonts": [FACE, JAPANESE] if language == "ja" else [FACE]}
    for system_fonts in (False, False, True, True):
        try:
            shown = _without(content, missing) if missing else content
            return _compile(shown, folders, system_fonts=system_fonts, **how)
        except TypstError as error:
            # characters that no font had or PDF/A forbids; Typst names all at once, each in quotes or as its code
            texts = re.findall(r'(?:the text|codepoint) `"(.+?)"`', error.diagnostic)
            plain = (re.sub(r"\\u\{([0-9a-f]+)\}", lambda code: chr(int(code[1], 16)), text) for text in texts)
            lacking = sorted({character for text in plain for character in text})
            if not lacking or missing:
                hints = f" ({'; '.join(error.hints)})" if error.hints else ""
                fix = "The HTML view has the same content; please report this with the job that caused it"
                raise CmmUqError(f"the PDF could not be made: {error.message}{hints}", fix=fix) from error
            missing = lacking if system_fonts else []
            with suppress(CmmUqError):
                folders, content["fonts"] = [str(japanese_font().parent)], [FACE, JAPANESE]
    raise AssertionError("unreachable")


def _compile(
    content: Mapping[str, Any], folders: list[str], *, system_fonts: bool, template: str = "document.typ",
    standards: Sequence[Any] = ("a-3a", "ua-1"), tagged: bool = True, root: str | None = None,
) -> bytes:  # fmt: skip
    import typst

    return typst.compile(  # type: ignore[type-var]  # its stub wants a root of bytes beside a text of bytes
        (template_folder() / template).read_bytes(),
        font_paths=typst.Fonts(include_system_fonts=system_fonts, font_paths=folders),
        ignore_system_fonts=not system_fonts, sys_inputs={"input": json.dumps(content)}, pdf_standards=list(standards),
        pdf_tags=tagged, timestamp=0, root=root,
    )  # fmt: skip


_SCRIPTS: tuple[
    tuple[Any, str, str, str], ...
] = (  # letters, what they are called, a font that has them, and its package
    (re.compile("[\u3040-\u30ff]"), "Japanese", "IPAexGothic", "pip install 'cmm-uq[ja]'"),
    (re.compile("[\u1100-\u11ff\uac00-\ud7a3]"), "Korean", "Noto Sans CJK KR", "fonts-noto-cjk"),
    (re.compile("[\u2e80-\u9fff\uff00-\uffef]"), "Chinese", "Noto Sans CJK SC", "fonts-noto-cjk"),
    (re.compile("[\u0590-\u05ff]"), "Hebrew", "Noto Sans Hebrew", "fonts-noto-core"),
    (re.compile("[\u0600-\u06ff]"), "Arabic", "Noto Sans Arabic", "fonts-noto-core"),
    (re.compile("[\u0900-\u0dff]"), "Indic", "Noto Sans", "fonts-noto-core"),
    (re.compile("[\u0e00-\u0e7f]"), "Thai", "Noto Sans Thai", "fonts-noto-core"),
)


def fonts_for(missing: Sequence[str]) -> tuple[str, str]:
    """Names of fonts that have characters which no font here has, and the sentence that says what to install."""
    text = "".join(missing)
    own = [one for one in _SCRIPTS if one[0].search(text)]
    shown = (
        f"The PDF shows □ in place of {text[:_NAMED]}{' …' if len(text) > _NAMED else ''}: no font on this machine has "
    )
    if not own:
        return "", f"{shown}it. The HTML view shows it in the reader's fonts."
    scripts, fonts, packages = (", ".join(dict.fromkeys(one[k] for one in own)) for k in (1, 2, 3))
    return fonts, (
        f"{shown}{scripts} letters. Install {fonts} ({packages}), and make it again; the HTML view shows them in the "
        "reader's fonts."
    )


def _without(content: dict[str, Any], missing: list[str]) -> dict[str, Any]:
    """The content with □ for every missing character, and their codes for the line that says so."""
    table = str.maketrans(dict.fromkeys(missing, "□"))

    def shown(value: Any) -> Any:
        if isinstance(value, dict):
            return {key: shown(item) for key, item in value.items()}
        if isinstance(value, list):
            return [shown(item) for item in value]
        return value.translate(table) if isinstance(value, str) else value

    fonts, told = fonts_for(missing)
    doc.NOT_LETTERED.set(told)
    codes = ", ".join(f"U+{ord(character):04X}" for character in missing)
    return {**content, "document": shown(content["document"]), "missing": f"{codes} ({fonts})" if fonts else codes}


WIDTH_MM, HEIGHT_MM = 84.0, 8.0
LEFT_MM, BOTTOM_MM, GAP_MM = 20.0, 3.5, 2.0
"""Of the first seal on a page A4; a second stands beside it. The text of a page ends 22 mm, its foot 10 mm above the edge."""

SEALS = 2
_POINTS = 72 / 25.4


def seal(
    signer: Signer, at: dt.datetime, laboratory: Text, accreditation: Text, *, language: str = "en",
    said: Callable[[Text], Text] | None = None,
) -> Seal:  # fmt: skip
    time = Verbatim(at.astimezone(dt.UTC).strftime("%Y-%m-%d %H:%M UTC"))
    head = say("Electronically signed by {name}", name=Verbatim(signer.name))
    facts = commas([part for part in (laboratory, accreditation, time) if part])
    mark, said = [say("TEST KEY: {note}.", note=TEST_NOTE)] if signer.test_key else [], said or (lambda text: text)
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
