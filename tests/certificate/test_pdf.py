"""A document as PDF, and the seal on it."""

from __future__ import annotations

import io
import re
from dataclasses import replace
from typing import Any

import pikepdf
import pytest
from hypothesis import given, settings, strategies as st
from pypdf import PdfReader

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.messages import NOTHING, Text, Verbatim, say
from cmm_uq.certificate.document import Column, Document, Plot, Section, Table
from cmm_uq.certificate.render import HEIGHT_MM, WIDTH_MM, fonts_for, render_pdf, seal
from tests.certificate.samples import HOSTILE, NUMBER, UNBREAKABLE, document_of, plots
from tests.certificate.sign.authority import SIGNED, Held, curve_key, issued

ATTACHMENTS = {
    "job.toml": '[job]\nid = "µ"\n'.encode(),
    "ballbar.csv": b"\xef\xbb\xbfmeasurement,point\r\n1,1\r\n",
    "results.json": b'{"schema": "cmm-uq/results/1"}',
    "recording.bin": bytes(range(256)) * 8,
}


@pytest.fixture(scope="module")
def pdf(certificate: Document) -> bytes:
    return render_pdf(certificate, ATTACHMENTS)


def pages(pdf: bytes) -> list[str]:
    return [" ".join(page.extract_text().split()) for page in PdfReader(io.BytesIO(pdf)).pages]


def elements(pdf: pikepdf.Pdf) -> list[Any]:
    """Every structure element of a tagged PDF."""
    found: list[Any] = []
    waiting = [pdf.Root.StructTreeRoot.K]
    while waiting:
        node = waiting.pop()
        if isinstance(node, pikepdf.Array):
            waiting.extend(node)
        elif isinstance(node, pikepdf.Dictionary) and "/S" in node:
            found.append(node)
            if "/K" in node:
                waiting.append(node.K)
    return found


def test_it_declares_pdf_a_3a_and_pdf_ua_1(pdf: bytes) -> None:
    """Identification after ISO 19005-3, 6.6.4, and ISO 14289-1, 5 (Typst validates its output while it writes)."""
    with pikepdf.open(io.BytesIO(pdf)) as opened, opened.open_metadata() as metadata:
        assert metadata["pdfaid:part"] == "3"
        assert metadata["pdfaid:conformance"] == "A"
        assert metadata["pdfuaid:part"] == "1"
        assert "pdfaExtension:schemas" in str(
            metadata
        )  # the PDF/UA property is declared, as PDF/A asks of foreign ones
        assert metadata["dc:title"] == f"Calibration certificate {NUMBER}"
        assert metadata["dc:creator"] == ["Laboratory for Dimensional Metrology"]
        assert metadata["dc:language"] == {"en"}
        assert str(metadata["xmp:CreateDate"]).startswith("2004-06-03")
        assert str(opened.docinfo["/CreationDate"]).startswith("D:20040603")


def test_what_an_archive_needs_is_inside(pdf: bytes) -> None:
    """ISO 19005-3: fonts embedded and mapped to Unicode (6.2.11), an output intent or none but sRGB (6.2.4), no script."""
    with pikepdf.open(io.BytesIO(pdf)) as opened:
        fonts = [
            font for font in opened.objects if isinstance(font, pikepdf.Dictionary) and font.get("/Type") == "/Font"
        ]
        assert fonts
        for font in fonts:
            if font.Subtype == "/Type0":
                assert "/ToUnicode" in font
                descriptor = font.DescendantFonts[0].FontDescriptor
                assert {"/FontFile2", "/FontFile3"} & set(descriptor.keys())
        assert not opened.is_encrypted
        assert "/OpenAction" not in opened.Root
        assert opened.check_pdf_syntax() == []
        assert "/OutputIntents" in opened.Root
        assert len(opened.trailer.ID) == 2


def test_the_files_inside_are_the_files_given(pdf: bytes) -> None:
    with pikepdf.open(io.BytesIO(pdf)) as opened:
        assert {name: spec.get_file().read_bytes() for name, spec in opened.attachments.items()} == ATTACHMENTS
        specs = {str(spec.UF): spec for spec in opened.Root.AF}
        relations = {name: str(spec.AFRelationship) for name, spec in specs.items()}
        assert relations == dict.fromkeys(ATTACHMENTS, "/Source") | {"results.json": "/Data"}
        types = {name: str(spec.EF.F.Subtype) for name, spec in specs.items()}
        assert types["ballbar.csv"] == "/text/csv"
        assert types["results.json"] == "/application/json"
        assert types["recording.bin"] == "/application/octet-stream"
        assert all(name in str(spec.Desc) for name, spec in specs.items())


def test_it_is_tagged_for_screen_readers(pdf: bytes, certificate: Document) -> None:
    with pikepdf.open(io.BytesIO(pdf)) as opened:
        assert bool(opened.Root.MarkInfo.Marked)
        assert str(opened.Root.Lang) == "en"
        assert bool(opened.Root.ViewerPreferences.DisplayDocTitle)
        tags = elements(opened)
        alternatives = {str(tag.Alt) for tag in tags if "/Alt" in tag}
        assert {plot.alternative for plot in plots()} <= alternatives
        kinds = [str(tag.S) for tag in tags]
        tables = [block for section in certificate.sections for block in section.blocks if block.kind == "table"]
        assert kinds.count("/Table") == len(tables)
        assert kinds.count("/TH") == sum(len(table.columns) for table in tables)
        assert kinds.count("/H1") == 1


def test_every_page_says_which_it_is(pdf: bytes) -> None:
    texts = pages(pdf)
    assert 4 <= len(texts) <= 6
    for number, text in enumerate(texts, start=1):
        assert NUMBER in text
        assert f"Page {number} of {len(texts)}" in text
    assert [k for k, text in enumerate(texts, 1) if "End of certificate" in text] == [len(texts)]


def test_a_table_over_several_pages_has_its_heading_on_each(certificate: Document) -> None:
    rows = tuple((f"place {k}", f"{404 + k / 1000:.4f}") for k in range(150))
    table = Table("Lengths", (Column("Position", numeric=False), Column("Length", "mm")), rows)
    filled = [text for text in pages(render_pdf(replace(certificate, sections=(Section("One", (table,)),)), {}))
              if "place" in text]  # fmt: skip
    assert len(filled) >= 3
    assert all("Position" in text for text in filled)
    assert re.findall(r"(place \d+) (404\.\d{4})", " ".join(filled)) == list(rows)


def test_the_same_document_gives_the_same_bytes(pdf: bytes, certificate: Document) -> None:
    assert render_pdf(certificate, ATTACHMENTS) == pdf


def test_without_a_date_the_pdf_takes_the_epoch_not_the_clock(certificate: Document) -> None:
    with pikepdf.open(io.BytesIO(render_pdf(replace(certificate, date=None), {}))) as opened:
        assert str(opened.docinfo["/CreationDate"]).startswith("D:19700101")


def test_only_the_fonts_of_the_wheel_are_used(pdf: bytes) -> None:
    with pikepdf.open(io.BytesIO(pdf)) as opened:
        names = {str(font.BaseFont) for font in opened.objects
                 if isinstance(font, pikepdf.Dictionary) and font.get("/Subtype") == "/Type0"}  # fmt: skip
    assert {name.split("+")[1].split("-")[0] for name in names} <= {
        "LibertinusSerif", "NewCM10", "NewCMMath", "DejaVuSansMono"
    }  # fmt: skip


def test_the_characters_of_the_field_are_all_there() -> None:
    text = "µ ″ ′ ° ± − × · ≤ ≥ ≈ √ ∞ → … – σ χ² α β Δ ₂ ⁻⁶ ½ ‰ é ü ł ő ß ñ Ø Привет ✓ □"
    [page] = pages(render_pdf(replace(document_of("x"), sections=(), subject=text), {}))
    assert text in page
    assert "stands for a character" not in page


def test_markup_in_the_data_is_text() -> None:
    text = "".join(pages(render_pdf(document_of(HOSTILE.split("שלום")[0]), {}))).replace(" ", "")
    for piece in (
        "<script>alert('x')</script>",
        "{{7*7}}",
        '#panic("x")',
        "$x^2$",
        "*b*",
        "_i_@ref<label>",
        "//d",
        "`c`",
    ):
        assert text.count(piece) > 10


@pytest.mark.long
def test_a_word_without_a_break_stays_on_the_page() -> None:
    pdf = PdfReader(io.BytesIO(render_pdf(document_of(f"{HOSTILE} {UNBREAKABLE}"), {})))
    edges: list[float] = []
    for page in pdf.pages:
        page.extract_text(
            visitor_text=lambda text, _cm, tm, _font, _size: edges.append(float(tm[4])) if text.strip() else None
        )
    assert max(edges) < 595 - 56 + 1
    assert "".join("".join(pages(render_pdf(document_of(UNBREAKABLE), {}))).split()).count(UNBREAKABLE) > 10


@pytest.mark.parametrize(
    ("text", "fonts", "said"),
    [
        (
            "三坐标",
            "Noto Sans CJK SC",
            "has Chinese letters. Install Noto Sans CJK SC (fonts-noto-cjk)",
        ),
        (
            "測定さ",
            "IPAexGothic, Noto Sans CJK SC",
            "CJK SC (pip install 'cmm-uq[ja]', fonts-noto-cjk)",
        ),
        ("측정", "Noto Sans CJK KR", "in place of 측정: no font on this machine has Korean letters."),
        ("\u0378", "", "no font on this machine has it."),
    ],
)
def test_letters_that_no_font_has_are_told_with_the_font_to_install(text: str, fonts: str, said: str) -> None:
    named, told = fonts_for(sorted({*text}) if text != "측정" else text)
    assert named == fonts
    assert said in told


def test_a_character_that_no_font_has_is_shown_as_a_box_and_named() -> None:
    """U+0378 is not assigned, so no font can have it."""
    text = " ".join(pages(render_pdf(document_of("Maker \u0378"), {})))
    assert "Maker □" in text
    assert "□ stands for a character that the fonts of this file lack: U+0378." in text


def test_a_japanese_name_in_an_english_document_is_set_in_the_font_of_japanese_ones() -> None:
    text = "".join(pages(render_pdf(document_of("東京測定 検査課"), {}))).replace(" ", "")
    assert "東京測定検査課" in text
    assert "□" not in text


def test_a_plot_that_is_no_svg_is_said_clearly(certificate: Document) -> None:
    broken = replace(certificate, sections=(Section("One", (Plot("c", "a", "<svg"),)),))
    with pytest.raises(CmmUqError, match="the PDF could not be made: "):
        render_pdf(broken, {})


@pytest.mark.long
@settings(max_examples=25, deadline=None)
@given(text=st.text(st.characters(), max_size=30))
def test_no_text_is_refused(text: str) -> None:
    assert re.match(rb"%PDF-1\.7", render_pdf(document_of(text), {}))


pytest.importorskip("pyhanko")


@pytest.fixture(scope="module")
def somebody() -> Held:
    return issued("A. Huber", curve_key())


def shown(picture: bytes) -> str:
    return " ".join(PdfReader(io.BytesIO(picture)).pages[0].extract_text().split())


def test_it_shows_signer_laboratory_accreditation_and_time(somebody: Held) -> None:
    made = seal(somebody.signer, SIGNED, Verbatim("Messlabor Müller"), Verbatim("D-K-15123-01-00"))
    told = "Messlabor Müller, D-K-15123-01-00, 2026-03-02 09:30 UTC"
    assert shown(made.picture) == f"Electronically signed by A. Huber {told}"
    assert made.says == f"Electronically signed by A. Huber: {told}."


def test_a_test_key_is_marked() -> None:
    made = seal(issued("TEST KEY – A. Huber", curve_key()).signer, SIGNED, NOTHING, NOTHING)
    assert shown(made.picture).endswith("TEST")
    assert made.says.startswith("TEST KEY: signed with a test key: it proves nothing")


def test_its_place_is_as_large_as_its_picture_and_below_the_text_of_a_page(somebody: Held) -> None:
    made = seal(somebody.signer, SIGNED, NOTHING, NOTHING)
    with pikepdf.open(io.BytesIO(made.picture)) as page:
        _, _, width, height = (float(one) for one in page.pages[0].MediaBox)
    mm = 72 / 25.4
    assert (width, height) == pytest.approx((WIDTH_MM * mm, HEIGHT_MM * mm), abs=0.01)
    for left, bottom, right, top in made.places:
        assert (right - left, top - bottom) == pytest.approx((width, height), abs=0.01)
        assert 0 < left < right < 210 * mm
        assert 0 < bottom < top < 12 * mm
    (_, _, end, _), (begin, _, _, _) = made.places
    assert end < begin


@pytest.mark.parametrize("name", ["山田 太郎", "Ελένη", "x" * 64, "עברית", "a\u202eb"])
def test_any_name_has_a_seal(name: str) -> None:
    made = seal(issued(name, curve_key()).signer, SIGNED, NOTHING, NOTHING)
    assert made.picture.startswith(b"%PDF")
    assert len(PdfReader(io.BytesIO(made.picture)).pages) == 1


def test_it_is_said_in_the_language_of_the_document(somebody: Held) -> None:
    def said(text: Text) -> Text:
        return say("Elektronisch signiert") if "Electronically" in text else text

    made = seal(somebody.signer, SIGNED, NOTHING, NOTHING, language="de", said=said)
    assert shown(made.picture).startswith("Elektronisch signiert")
    assert made.says == "Elektronisch signiert"


def test_signers_of_one_name_have_the_same_seal(somebody: Held) -> None:
    """Nothing is drawn at random."""
    again = replace(somebody.signer, where="elsewhere")
    assert seal(again, SIGNED, NOTHING, NOTHING) == seal(somebody.signer, SIGNED, NOTHING, NOTHING)
