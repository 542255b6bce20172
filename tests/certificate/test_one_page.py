"""What decides stands on one page of a certificate, whatever letterhead, remarks and warnings it has."""

from __future__ import annotations

import io
from collections.abc import Sequence
from dataclasses import replace

import pytest
from pypdf import PdfReader

from cmm_uq.base.languages.translation import LANGUAGES, Code, translated as said_in
from cmm_uq.base.messages import Text, Verbatim, say
from cmm_uq.certificate.clauses import STATEMENTS
from cmm_uq.certificate.document import Document, Facts, Signature, translated
from cmm_uq.certificate.render.fitting import fitted
from cmm_uq.certificate.render.html import render_html
from cmm_uq.certificate.render.pdf import render_pdf
from cmm_uq.jobs.logo import Logo
from tests.artefacts.simulated import document
from tests.certificate.test_customers_words import REPORTED

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
