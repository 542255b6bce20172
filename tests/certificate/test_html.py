"""A document as data and as HTML, and where its templates lie."""

from __future__ import annotations

import itertools
import json
import re
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path

import jinja2
import pytest
from hypothesis import given, settings, strategies as st

from cmm_uq.base.errors import CmmUqError
from cmm_uq.certificate import look as templates
from cmm_uq.certificate.document import Column, Document, Section, Table
from cmm_uq.certificate.render import render_html
from tests.certificate.samples import HOSTILE, document_of, plots

VOID = {"meta", "link", "br"}


class Page(HTMLParser):
    """Elements with their attributes, and text by the element that holds it; complains of tags that do not match."""

    def __init__(self, html: str) -> None:
        super().__init__()
        self.elements: list[tuple[str, dict[str, str]]] = []
        self.texts: list[tuple[str, str]] = []
        self.stack: list[str] = []
        self.feed(html)
        self.close()
        assert self.stack == []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.elements.append((tag, {name: value or "" for name, value in attrs}))
        if tag not in VOID:
            self.stack.append(tag)

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.elements.append((tag, {name: value or "" for name, value in attrs}))

    def handle_endtag(self, tag: str) -> None:
        assert self.stack.pop() == tag

    def handle_data(self, data: str) -> None:
        self.texts.append((self.stack[-1] if self.stack else "", data))

    def all(self, tag: str) -> list[dict[str, str]]:
        return [attributes for name, attributes in self.elements if name == tag]

    def text(self, tag: str) -> list[str]:
        return [data for name, data in self.texts if name == tag]


def test_it_is_one_file_that_asks_for_nothing(certificate: Document) -> None:
    html = render_html(certificate)
    page = Page(html)
    assert page.all("script") == page.all("img") == page.all("iframe") == []
    addresses = [a[name] for _, a in page.elements for name in ("src", "href") if name in a]
    assert all(address.startswith(("#", "data:")) for address in addresses)
    assert not re.search(r"@import|url\((?!#)", html)
    assert not [a for _, a in page.elements if any(name.startswith("on") for name in a)]
    [policy] = [a["content"] for a in page.all("meta") if a.get("http-equiv") == "Content-Security-Policy"]
    assert policy.startswith("default-src 'none'")


def test_it_is_readable_without_seeing_it(certificate: Document) -> None:
    page = Page(render_html(certificate))
    assert page.all("html") == [{"lang": "en"}]
    assert len(page.all("main")) == len(page.all("h1")) == 1
    assert all(heading["scope"] == "col" for heading in page.all("th"))
    pictures = [a for a in page.all("svg") if a.get("role") == "img"]
    assert [a["aria-label"] for a in pictures] == [plot.alternative for plot in plots()]
    levels = [int(tag[1]) for tag, _ in page.elements if tag in {"h1", "h2", "h3"}]
    assert all(later <= earlier + 1 for earlier, later in itertools.pairwise(levels))


def test_every_reference_inside_the_page_has_one_target(certificate: Document) -> None:
    section = certificate.sections[1]
    twice = replace(certificate, sections=(*certificate.sections, Section("The same again", section.blocks)))
    html = render_html(twice)
    identities = [a["id"] for _, a in Page(html).elements if "id" in a]
    assert len(identities) == len(set(identities))
    wanted = set(re.findall(r'(?:url\(|href="|aria-labelledby=")#?([^)"]+)', html)) - {"data:,"}
    assert wanted
    assert wanted <= set(identities)


def test_units_stand_in_the_headings(certificate: Document) -> None:
    units = [text for text in Page(render_html(certificate)).text("span") if text.strip()]
    assert "mm" in units
    assert "µm" in units


def test_outcomes_are_words_not_only_colours(certificate: Document) -> None:
    html = render_html(certificate)
    for word in ("Pass", "Fail", "Undecided"):
        assert re.search(rf'class="outcome"><span aria-hidden="true">.</span> {word}</p>', html)


def test_markup_in_the_data_is_text() -> None:
    page = Page(render_html(document_of(HOSTILE)))
    assert page.all("script") == page.all("label") == []
    assert HOSTILE in page.text("h1")[0]
    assert page.text("dd").count(HOSTILE) == 6


def test_a_number_cannot_leave_the_margin_box() -> None:
    html = render_html(document_of('"; } </style><script>x</script> \\" µ'))
    [style] = re.findall(r"<style>(.*?)</style>", html, flags=re.DOTALL)
    [content] = re.findall(r"@bottom-left \{ content: (.*?); font:", style)
    assert re.fullmatch(r'"(?:[A-Za-z0-9]|\\[0-9a-f]{6} )*"', content)


def test_markup_in_a_plot_is_text(certificate: Document) -> None:
    from cmm_uq.certificate.plots.residuals import budget_bars

    plot = budget_bars(["</svg><script>x</script>", "a&b"], [0.5, 0.5], caption="c", alternative='"><script>')
    page = Page(render_html(replace(certificate, sections=(Section("One", (plot,)),))))
    assert page.all("script") == []
    assert "</svg><script>x</script>" in page.text("text")


@settings(max_examples=50, deadline=None)
@given(text=st.text(st.characters(), max_size=40))
def test_no_text_changes_the_structure(text: str) -> None:
    def structure(words: str) -> list[str]:
        return [tag for tag, _ in Page(render_html(document_of(words))).elements]

    assert structure(f"x{text}") == structure("plain")


def test_what_is_empty_leaves_no_trace(certificate: Document) -> None:
    bare = replace(
        certificate,
        issuer=(),
        particulars=(),
        warnings=(),
        statements=(),
        signatures=(),
        attachments=(),
        produced_by="",
    )
    page = Page(render_html(bare))
    assert page.all("address") == []
    assert "Warnings" not in page.text("h2")
    assert not [text for text in page.text("p") if text.startswith("Files that belong")]
    assert "End of certificate" in page.text("span")


def test_a_block_that_lacks_something_is_an_error_not_a_gap(
    certificate: Document, monkeypatch: pytest.MonkeyPatch
) -> None:
    data = certificate.as_data()
    del data["sections"][0]["blocks"][0]["limit"]
    monkeypatch.setattr(Document, "as_data", lambda self: data)
    with pytest.raises(jinja2.UndefinedError):
        render_html(certificate)


def test_the_folder_holds_both_views() -> None:
    names = {path.name for path in templates.template_folder().iterdir()}
    assert {"document.html", "document.css", "document.typ"} <= names


def test_an_installed_package_has_its_own(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "cmm_uq" / "templates").mkdir(parents=True)
    (tmp_path / "cmm_uq" / "templates" / "document.html").touch()
    monkeypatch.setattr(templates, "__file__", str(tmp_path / "cmm_uq" / "certificate" / "render" / "html.py"))
    assert templates.template_folder() == tmp_path / "cmm_uq" / "templates"


def test_a_package_without_them_says_what_to_do(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(templates, "__file__", str(tmp_path / "cmm_uq" / "certificate" / "render" / "html.py"))
    with pytest.raises(CmmUqError, match="Install cmm-uq again"):
        templates.template_folder()


def test_every_document_is_json(certificate: Document) -> None:
    assert json.loads(json.dumps(certificate.as_data()))["date"] == "2004-06-03"


@given(text=st.text(st.characters()))
def test_no_control_character_surrogate_or_private_character_reaches_a_view(text: str) -> None:
    shown = document_of(text).as_data()["title"]
    shown.encode("utf-8")
    assert all(character == "\n" or character.isprintable() or ord(character) > 0x9F for character in shown)
    assert not any("\ue000" <= character <= "\uf8ff" for character in shown)


def test_marks_that_turn_figures_round_are_left_out() -> None:
    assert document_of("\u202e1.25\u202c").as_data()["title"] == "1.25"


def test_text_without_such_characters_is_kept_as_it_is() -> None:
    text = "Müller & Söhne <GmbH>\n中文 שלום µ ″ ± − ×"
    assert document_of(text).as_data()["title"] == text


def test_tables_and_figures_are_counted_through_the_document(certificate: Document) -> None:
    blocks = [block for section in certificate.as_data()["sections"] for block in section["blocks"]]
    assert [block["label"] for block in blocks if "label" in block] == [
        "Table 1", "Figure 1", "Figure 2", "Table 2", "Figure 3"
    ]  # fmt: skip


def test_a_row_has_as_many_cells_as_the_table_has_columns() -> None:
    with pytest.raises(ValueError, match="2 cells under 1 headings"):
        Table("Lengths", (Column("Length", "mm"),), (("404.2", "1.0"),))


def test_what_is_longer_than_any_figure_is_set_as_text() -> None:
    document = document_of("a sentence that is much longer than any figure")
    table = next(b for b in document.as_data()["sections"][0]["blocks"] if b["kind"] == "table")
    assert [column["numeric"] for column in table["columns"]] == [False, True]
    assert table["columns"][0]["need"] == 46
