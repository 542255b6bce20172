"""HTML and PDF are two views of one document: what one says, the other says, to the character."""

from __future__ import annotations

import io
import re
from collections import Counter
from collections.abc import Iterator
from html.parser import HTMLParser
from typing import Any

import pytest
from pypdf import PdfReader

from cmm_uq.certificate.document import Document
from cmm_uq.certificate.render.html import render_html
from cmm_uq.certificate.render.pdf import render_pdf


class Body(HTMLParser):
    """All text of the body, that of the pictures too."""

    def __init__(self, html: str) -> None:
        super().__init__()
        self.text = ""
        self.feed(html[html.index("<body>") :])

    def handle_data(self, data: str) -> None:
        self.text += data


def squeezed(text: str) -> str:
    return "".join(text.split())


@pytest.fixture(scope="module")
def html_text(certificate: Document) -> str:
    return squeezed(Body(render_html(certificate)).text)


@pytest.fixture(scope="module")
def pdf_text(certificate: Document) -> str:
    """The PDF's text without the foot of its pages."""
    sheets = [squeezed(page.extract_text()) for page in PdfReader(io.BytesIO(render_pdf(certificate, {}))).pages]
    foot = squeezed(certificate.title + certificate.number)
    feet = [f"{foot}Page{number}of{len(sheets)}" for number in range(1, len(sheets) + 1)]
    assert all(sheet.count(foot) == 1 for sheet, foot in zip(sheets, feet, strict=True))
    return "".join(sheet.replace(foot, "") for sheet, foot in zip(sheets, feet, strict=True))


def texts(value: Any) -> Iterator[str]:
    """Every text of a document's data, but for what is not shown as such."""
    if isinstance(value, dict):
        for key, item in value.items():
            if key not in {"kind", "tone", "svg", "outcome", "alternative", "date", "language"}:
                yield from texts(item)
    elif isinstance(value, list):
        for item in value:
            yield from texts(item)
    elif isinstance(value, str):
        yield value


def test_both_say_every_text_of_the_document(certificate: Document, html_text: str, pdf_text: str) -> None:
    expected = [squeezed(text) for text in texts(certificate.as_data()) if text]
    assert len(expected) > 200
    assert [text for text in expected if text not in html_text] == []
    assert [text for text in expected if text not in pdf_text] == []


def test_both_keep_the_rows_of_every_table(certificate: Document, html_text: str, pdf_text: str) -> None:
    rows = ["".join(map(squeezed, row)) for section in certificate.sections for block in section.blocks
            if block.kind == "table" for row in block.rows]  # fmt: skip
    assert len(rows) == 43
    assert [row for row in rows if row not in html_text or row not in pdf_text] == []


def test_both_have_the_same_characters_no_more_and_no_fewer(html_text: str, pdf_text: str) -> None:
    """A figure that one view rounds, drops or repeats would change the count of some digit."""
    plain_pdf = pdf_text.replace("•", "")  # the marks of the list of warnings, which CSS draws in HTML
    dashes = 2  # beside the end mark, which CSS draws in HTML
    counted = Counter(html_text)
    counted["—"] += dashes
    heading_again = squeezed("Position Length mm Deviation µm Remark")  # repeated where the long table goes on
    for _ in range(plain_pdf.count(heading_again) - 1):
        counted.update(heading_again)
    assert Counter(plain_pdf) == counted


def test_both_count_tables_and_figures_alike(html_text: str, pdf_text: str) -> None:
    def labels(text: str) -> list[str]:
        return sorted(set(re.findall(r"(?:Table|Figure)\d", text)))

    assert labels(html_text) == labels(pdf_text) == ["Figure1", "Figure2", "Figure3", "Table1", "Table2"]
