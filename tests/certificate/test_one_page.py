"""The first page holds all that is decided, and both views say the same."""

from __future__ import annotations

import io
import re
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import replace
from html.parser import HTMLParser
from typing import Any

import pytest
from pypdf import PdfReader

from cmm_uq.base.languages.translation import LANGUAGES, Code, translated as said_in
from cmm_uq.base.messages import Text, Verbatim, say
from cmm_uq.certificate.clauses import STATEMENTS
from cmm_uq.certificate.document import Document, Facts, Signature, translated
from cmm_uq.certificate.render import fitted, render_html, render_pdf
from cmm_uq.jobs.logo import Logo
from tests.artefacts.simulated import document
from tests.certificate.test_completeness import REPORTED

LOGO = Logo(
    "svg", b'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 120 60"><rect width="120" height="60"/></svg>'
)


def plain(text: str) -> str:
    return "".join(text.split())


def pages(made: Document) -> list[str]:
    return [plain(page.extract_text()) for page in PdfReader(io.BytesIO(render_pdf(made, {}))).pages]


def signed(made: Document, warnings: Sequence[Text] = ()) -> Document:
    """With the letterhead, statements and signature of a laboratory."""
    return replace(
        made, logo=LOGO, statements=STATEMENTS, warnings=(*made.warnings, *warnings),
        issuer=(Verbatim("Musterlabor GmbH"), Verbatim("Musterstr. 1"), Verbatim("12345 Musterstadt")),
        signatures=(Signature(Verbatim("Dr. A. Muster"), Verbatim("Head of the laboratory")),),
    )  # fmt: skip


@pytest.mark.long(but="iota-1102-20C-ja")
@pytest.mark.parametrize("code", ["en", *LANGUAGES])
@pytest.mark.parametrize("name", REPORTED)
def test_verdict_limits_statements_and_signature_stand_on_the_first_page(name: str, code: Code) -> None:
    made = translated(signed(document(name)), code)
    first = pages(made)[0]
    assert plain(made.statements[-1]) in first
    assert "Dr.A.Muster" in first
    if made.overview is not None:
        assert all(plain(text) in first for row in made.overview.rows for text in row)
    method, *_ = (text for label, text in made.particulars[-1].rows)
    assert plain(method)[:40] in first


MANY = (
    *(say("Measurement {m} repeats the coordinates of measurement 1 to the last digit: a copy, not a measurement, and counts "
          "once. It is set aside: not used for the error factors, nor for anything else.", m=m) for m in range(2, 30)),
    say("The artefact was certified on the machine that it now tests: errors that both measurements have in common are not "
        "seen here."),
)  # fmt: skip


@pytest.mark.long
@pytest.mark.parametrize("name", ["iota-1102-20C", "triangle-simulated"])
def test_of_many_warnings_each_sort_is_named_on_the_first_page_and_every_one_stands_in_full_behind_it(
    name: str,
) -> None:
    made = signed(document(name), MANY)
    first, *behind = pages(made)
    assert "Dr.A.Muster" in first
    assert "acopy,notameasurement" in first
    assert "27morebehindthispage" in first
    assert "Theartefactwascertifiedonthemachinethatitnowtests" in first
    assert "Infullbehindthispage." in first
    assert all(
        plain(text) in "".join(behind) for text in ("repeats the coordinates of measurement 1 to the", "Measurement 29")
    )
    html = plain(render_html(made))
    assert html.index("27morebehindthispage") < html.index("Dr.A.Muster") < html.index("Measurement29repeats")


@pytest.mark.long
def test_a_long_remark_begins_on_the_first_page_and_stands_whole_behind_it() -> None:
    remark = Verbatim("The table was cleaned. " * 60)
    made = signed(document("step-gauge-simulated"))
    made = replace(made, particulars=(*made.particulars, Facts(((say("Remarks"), remark),))))
    first, *behind = pages(made)
    assert "Thetablewascleaned." in first
    assert "Infullbehindthispage." in first
    assert "".join(behind).count("Thetablewascleaned.") == 60
    assert [section.title for section in fitted(made).sections].count("Particulars") == 1


def test_what_has_room_is_not_parted() -> None:
    made = document("sphere-simulated")
    assert fitted(made) is made


def test_what_is_said_in_full_behind_the_page_is_said_in_the_language() -> None:
    made = translated(signed(document("iota-1102-20C"), MANY), "de")
    assert fitted(made).warnings[-1] == said_in(say("In full behind this page."), "de") != "In full behind this page."


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


@pytest.mark.long
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
