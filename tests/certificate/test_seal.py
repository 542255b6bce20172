"""The seal says who signed, for whom and when, in any script, and that a test key is one."""

from __future__ import annotations

import io
from dataclasses import replace

import pytest

pytest.importorskip("pyhanko")

import pikepdf
from pypdf import PdfReader

from cmm_uq.base.messages import NOTHING, Text, Verbatim, say
from cmm_uq.certificate.render.pdf import HEIGHT_MM, WIDTH_MM, seal
from tests.certificate.sign.authority import SIGNED, Held, curve_key, issued


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
