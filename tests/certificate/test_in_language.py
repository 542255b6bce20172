"""A certificate in another language: the same figures in both views, every word said, pictures lettered in it."""

from __future__ import annotations

import html
import io
import re
import shutil
from collections.abc import Iterator
from dataclasses import fields, is_dataclass, replace
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING

import pikepdf
import pytest
from pypdf import PdfReader

from cmm_uq.app.commands.reading import in_language, read_job
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.languages.translation import LANGUAGES, Code, Translation as Said, translated as said_in
from cmm_uq.base.messages import Day, Message, Number, Text, Verbatim, commas, say
from cmm_uq.certificate import render as fitting
from cmm_uq.certificate.document import Document, Paragraph, Plot, Section, translated
from cmm_uq.certificate.plots import style as fonts
from cmm_uq.certificate.plots.residuals import budget_bars
from cmm_uq.certificate.plots.style import NAMES_MM, SMALL, TINY, lettered_in, width_mm
from cmm_uq.certificate.plots.volume import _edge, _size, _title
from cmm_uq.certificate.render import render_html, render_pdf
from cmm_uq.certificate.results.contents import head
from tests.artefacts.simulated import outcome
from tests.certificate.saying import figures, lettering, messages
from tests.certificate.test_every_layout import CUT_LABELS, HEADS_RUN_TOGETHER, HIDDEN_COLUMNS
from tests.certificate.test_html_layout import LABELS_COLLIDING, OVERLAPS, WIDER_THAN_PAPER
from tests.conftest import ROOT

if TYPE_CHECKING:
    from playwright.sync_api import Browser

EXAMPLE = "iota-1102-20C"
CODES: list[Code] = ["de", "fr", "ja"]


@cache
def certificate(code: Code) -> Document:
    """Of the example, composed and said in a language."""
    with lettered_in(code):
        return translated(outcome(EXAMPLE).composed(), code)


@cache
def pdf(code: Code) -> bytes:
    return render_pdf(certificate(code), {})


def needs_font(code: Code) -> None:
    try:
        fonts.fonts_of(code)
    except CmmUqError:
        pytest.skip("no Japanese font is installed")


def shown(code: Code) -> str:
    """Texts of the HTML, each on a line."""
    page = render_html(certificate(code))
    return "\n".join(html.unescape(text) for text in re.findall(r">([^<>]+)<", page[page.index("<body") :]))


def printed_once(data: bytes) -> str:
    """Without the lines that stand on every page, head and foot: of longer words there may be a page more."""
    pages = [page.extract_text().splitlines() for page in PdfReader(io.BytesIO(data)).pages]
    running = set.intersection(*({re.sub(r"\d+", "#", line) for line in lines} for lines in pages))
    return "\n".join(line for lines in pages for line in lines if re.sub(r"\d+", "#", line) not in running)


def printed(data: bytes) -> str:
    return "\n".join(page.extract_text() for page in PdfReader(io.BytesIO(data)).pages)


@pytest.mark.parametrize("code", CODES)
def test_every_message_is_said_and_what_the_user_wrote_stands_as_it_is(code: Code) -> None:
    needs_font(code)
    pairs = list(zip(texts(certificate("en")), texts(certificate(code)), strict=True))
    assert sum(isinstance(text, Message) for text, _ in pairs) > 150
    for english, now in pairs:
        assert isinstance(now, Said) == isinstance(english, Message | Number | Day), english
        assert now == (now.source and said_in(english, code) if isinstance(now, Said) else english)
    same = {text for text, now in pairs if text == now and isinstance(text, Message) and len(text.split()) > 2}
    assert {text for text in same if re.search("[a-z]{4}", text) and not quoted(text)} == set()


def quoted(text: Text | float) -> bool:
    """Whether words of the user, or a name, stand in a message."""
    return isinstance(text, Verbatim) or any(map(quoted, getattr(text, "arguments", {}).values()))


def texts(value: object) -> Iterator[Text]:
    """Every text of a document, but for those in pictures."""
    if isinstance(value, Text):
        yield value
    elif isinstance(value, tuple):
        for item in value:
            yield from texts(item)
    elif is_dataclass(value) and not isinstance(value, Plot):
        for field in fields(value):
            yield from texts(getattr(value, field.name))


@pytest.mark.long
@pytest.mark.parametrize("code", CODES)
def test_html_and_pdf_say_in_which_language_they_are(code: Code) -> None:
    needs_font(code)
    assert f'<html lang="{code}">' in render_html(certificate(code))
    with pikepdf.open(io.BytesIO(pdf(code))) as opened:
        assert str(opened.Root.Lang) == code
        assert b"pdfaid:part" in opened.Root.Metadata.read_bytes()


@pytest.mark.long
@pytest.mark.parametrize("code", ["de", "fr"])
def test_both_views_have_the_figures_of_the_english_ones(code: Code, monkeypatch: pytest.MonkeyPatch) -> None:
    """Read back by the locale, of every text, title, picture and foot: no figure is lost, added or another.

    On a first page that is long enough: of longer words more stands behind it, and its beginning twice.
    """
    monkeypatch.setattr(fitting, "_PAGE", 1e4)
    page = figures(shown(code))
    assert page == figures(shown("en"))
    assert sum(page.values()) > 400
    paper, english = (printed_once(render_pdf(certificate(each), {})) for each in (code, "en"))
    assert figures(paper) == figures(english)


@pytest.mark.parametrize("code", CODES)
def test_a_picture_is_lettered_in_the_language_with_its_decimal_sign(code: Code) -> None:
    needs_font(code)
    plots = [block for section in certificate(code).sections for block in section.blocks if isinstance(block, Plot)]
    assert len(plots) > 3
    for plot in plots:
        drawn = [
            html.unescape(re.sub("<[^>]*>", "", text))
            for text in re.findall(r"<text[^>]*>(.*?)</text>", plot.svg, re.DOTALL)
        ]
        sources = {str.__str__(text): text.source for text in plot.lettering if isinstance(text, Said)}
        for text in drawn:
            source = sources.get(text)
            assert source is not None or not re.search(r"[^\W\d_]{2}", text), text
            if source is not None and any(message.pattern for message in messages(source)):
                assert text.removesuffix("…") in said_in(source, code)
            point = re.search(r"\d[.,]\d", text)
            assert point is None or LANGUAGES[code].decimal in point[0]


def test_english_letters_no_picture_again() -> None:
    assert [text for text in lettering(certificate("en")) if isinstance(text, Said)] == []


@pytest.mark.parametrize("language", ["de", "ja"])
def test_a_long_name_beside_a_bar_has_two_lines_and_is_cut_after_them(language: Code) -> None:
    name = say("Coordinate of a ball, along the bar, twice")
    whole, letters = str.__str__(said_in(name, language)), say("Lengths")
    for names, cut in (([name], False), ([commas([name] * 6)], True)):
        with lettered_in(language):
            plot = budget_bars(names, [1.0], caption=letters, alternative=letters)
            lines = list(dict.fromkeys(str.__str__(text) for text in plot.lettering if not text.endswith("%")))
            assert max(width_mm(line, SMALL) for line in lines) <= NAMES_MM
        assert len(lines) <= 2
        assert lines[-1].endswith("…") is cut
        assert cut or "".join(lines).replace(" ", "") == whole.replace(" ", "")


def test_a_title_of_a_placing_that_would_be_too_small_has_two_lines() -> None:
    title = commas([say("along {direction}", direction=Verbatim("+X −Y +Z"))] * 3)
    with lettered_in("de"):
        assert _size(title) < TINY
        lines = _title(title)
        assert len(lines) == 2
        assert min(map(_size, lines)) >= TINY
        assert " ".join(map(str.__str__, lines)) == str.__str__(said_in(title, "de"))


def test_a_long_title_of_a_placing_is_set_smaller_and_a_long_tick_has_room() -> None:
    """English letters keep their size where they have room, and the axis its end."""
    title, never = say("along {direction}", direction=Verbatim("+X" * 20)), say("not at all")
    with lettered_in("de"):
        twice = say("along {direction}", direction=Verbatim("+X" * 40))
        assert _size(twice) < _size(title) < SMALL
        assert _edge(never) > 1.38
    assert _size(title) < SMALL
    short = say("along {direction}", direction=Verbatim("+X"))
    assert (_size(short), _edge(never)) == (SMALL, 1.38)


def test_a_japanese_pdf_has_every_character_and_breaks_no_line_before_a_full_stop() -> None:
    needs_font("ja")
    text = printed(pdf("ja"))
    assert "校正証明書" in text
    assert "□" not in text
    assert not re.search(r"\n[、。）」]", text)


def test_a_long_word_of_german_is_not_taken_apart_as_a_hash_is() -> None:
    word, digest = "Längenausdehnungskoeffizienten", "0123456789abcdef" * 6
    page = replace(certificate("de"), sections=(Section(say("Results"), (Paragraph(Verbatim(f"{word} {digest}")),)),))
    text = printed(render_pdf(page, {}))
    assert word in text
    assert digest in text.replace("\n", "")


def test_without_its_font_japanese_is_refused_with_the_fix(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(fonts, "find_spec", lambda name: None)
    with pytest.raises(CmmUqError, match=r"pip install 'cmm-uq\[ja\]'"):
        fonts.fonts_of("ja")
    assert fonts.fonts_of("de") == []


def test_the_results_are_the_same_but_for_the_name_of_the_language() -> None:
    job = read_job(ROOT / "examples" / EXAMPLE)
    told, english = head(in_language(job, "de")), head(job)
    assert told["job"].pop("language") == "de"
    assert told == english
    assert in_language(job, None) is job


def test_a_job_asks_for_its_language(tmp_path: Path) -> None:
    folder = Path(shutil.copytree(ROOT / "examples" / EXAMPLE, tmp_path / "job"))
    file = folder / "job.toml"
    text = file.read_text(encoding="utf-8")
    file.write_text(text.replace("[job]\n", '[job]\nlanguage = "fr"\n', 1), encoding="utf-8")
    assert read_job(folder).facts.job.language == "fr"
    file.write_text(text.replace("[job]\n", '[job]\nlanguage = "it"\n', 1), encoding="utf-8")
    with pytest.raises(CmmUqError, match="language"):
        read_job(folder)


@pytest.mark.long(but="de")
@pytest.mark.parametrize("code", CODES)
def test_nothing_is_cut_hidden_or_runs_together(browser: Browser, code: Code, tmp_path: Path) -> None:
    needs_font(code)
    page = browser.new_page()
    (tmp_path / "document.html").write_text(render_html(certificate(code)), encoding="utf-8")
    page.goto((tmp_path / "document.html").as_uri())
    for width in (360, 1280):
        page.set_viewport_size({"width": width, "height": 800})
        assert page.evaluate("document.documentElement.scrollWidth") <= width
        for rule in (HIDDEN_COLUMNS, HEADS_RUN_TOGETHER, CUT_LABELS, LABELS_COLLIDING, OVERLAPS):
            assert page.evaluate(rule) == []
    page.set_viewport_size({"width": 643, "height": 900})
    page.emulate_media(media="print")
    assert page.evaluate(WIDER_THAN_PAPER) == page.evaluate(HEADS_RUN_TOGETHER) == []
    page.close()


def test_the_words_of_the_templates_are_messages() -> None:
    """What a template shows by itself comes from ``words``; only marks and punctuation stand there."""
    page = (ROOT / "templates" / "document.html").read_text(encoding="utf-8")
    page = re.sub(
        r"\{#.*?#\}|\{%.*?%\}|\{\{.*?\}\}|<style>.*?</style>", "", page[page.index("<body") :], flags=re.DOTALL
    )
    assert re.findall(r"[A-Za-z]{2,}", re.sub(r"<[^>]*>", "", page)) == []
    paper = (ROOT / "templates" / "document.typ").read_text(encoding="utf-8")
    paper = re.sub(r"//.*|regex\(.*?\)", "", paper)
    shown = re.findall(r"(?<![#\w.)])\[([^\[\]#]*[A-Za-z]{3,}[^\[\]#]*)\]", paper)
    assert shown == []
