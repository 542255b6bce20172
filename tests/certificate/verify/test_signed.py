"""Signed certificates: what was appended, stripped, signed by others, or wrapped is named; digital certificates as well."""

from __future__ import annotations

import datetime as dt
import sys
from pathlib import Path

import pikepdf
import pytest

pytest.importorskip("pyhanko")
pytest.importorskip("signxml")

from cmm_uq.app.commands.certificates.verify import verify
from cmm_uq.base.errors import CmmUqError
from cmm_uq.certificate import sign as signing
from cmm_uq.certificate.sign import sign_pdf, sign_xml, signer_of_file
from cmm_uq.certificate.verify import views
from cmm_uq.certificate.verify.again import Again
from cmm_uq.certificate.verify.given import Inquiry
from tests.certificate.sign.authority import SIGNED, Held, curve_key, issued, root
from tests.certificate.verify.test_forms import spoil
from tests.conftest import ROOT


@pytest.fixture(scope="module")
def anchor() -> Held:
    return root()


@pytest.fixture
def trusted(anchor: Held, tmp_path: Path) -> list[Path]:
    path = tmp_path / "root.pem"
    path.write_bytes(anchor.pem)
    return [path]


@pytest.fixture
def signed(certificate: Path, made: Path, anchor: Held) -> Path:
    """PDF and DCC signed by somebody whom the anchor vouches for."""
    signer = issued("A. Huber", curve_key(), anchor).signer
    pdf = certificate / "certificate.pdf"
    pdf.write_bytes(sign_pdf(pdf.read_bytes(), signer, seal=None, at=SIGNED))
    (certificate / "certificate.xml").write_bytes(sign_xml((made / "certificate.xml").read_bytes(), signer, at=SIGNED))
    return certificate


def inquiry(folder: Path, again: Again, trust: list[Path] | None) -> Inquiry:
    return verify([folder], trust=trust, compute=lambda given, job: again).inquiry


@pytest.mark.long
@pytest.mark.parametrize("mark", [b"", b"\xef\xbb\xbf"], ids=["plain", "BOM"])
def test_a_signed_certificate_is_verified(signed: Path, again: Again, trusted: list[Path], mark: bytes) -> None:
    trusted[0].write_bytes(mark + trusted[0].read_bytes())
    found = inquiry(signed, again, trusted)
    assert found.word == "VERIFIED", found.findings + found.unchecked
    assert sum("by A. Huber, on 2026-03-02 09:30 UTC" in note for note in found.notes) == 2


@pytest.mark.long
def test_without_an_anchor_it_is_said_that_nobody_is_known(signed: Path, again: Again) -> None:
    found = inquiry(signed, again, None)
    assert found.word == "NOT WHOLLY CHECKED"
    assert {one.what for one in found.unchecked} == {"who signed certificate.pdf", "who signed certificate.xml"}


@pytest.mark.long
@pytest.mark.parametrize(("ahead", "word"), [
    (dt.timedelta(days=60), "NOT WHOLLY CHECKED"), (dt.timedelta(minutes=9), "VERIFIED"),
])  # fmt: skip
def test_a_signature_of_the_future_is_neither_verified_nor_altered(
    ahead: dt.timedelta, word: str, certificate: Path, made: Path, again: Again, anchor: Held, trusted: list[Path]
) -> None:
    """More than ten minutes after the clock of this computer; a few minutes are the clocks'."""
    at = (dt.datetime.now(dt.UTC) + ahead).replace(microsecond=0)
    signer = issued("A. Huber", curve_key(), anchor, first=at - dt.timedelta(1), last=at + dt.timedelta(1)).signer
    pdf, xml = certificate / "certificate.pdf", certificate / "certificate.xml"
    pdf.write_bytes(sign_pdf(pdf.read_bytes(), signer, seal=None, at=at))
    xml.write_bytes(sign_xml((made / "certificate.xml").read_bytes(), signer, at=at))
    found = inquiry(certificate, again, trusted)
    assert (found.word, found.findings) == (word, [])
    early = [
        one.what for one in found.unchecked if one.why.startswith(f"it says {at:%Y-%m-%d %H:%M} UTC, and the clock")
    ]
    assert early == [f"when {path.name} was signed" for path in (pdf, xml) if word != "VERIFIED"]


def test_a_time_stamp_of_the_future_beside_a_signature_is_said_to_be_one() -> None:
    at, found = dt.datetime.now(dt.UTC) + dt.timedelta(days=60), Inquiry()
    beside = {"a time stamp by Time": at, "2 certificates": None}
    one = signing.FileSignature("PAdES B-LTA", (), name="A. Huber", time=SIGNED, intact=True, covers_whole_file=True,
                                trusted=True, beside=beside)  # fmt: skip
    views._check_signed(found, "certificate.pdf", [one], signing.Trust(), [])
    assert [one.what for one in found.unchecked] == ["when certificate.pdf was signed"]
    assert found.notes[0].endswith("revocation: not known; beside it a time stamp by Time, 2 certificates.")


@pytest.mark.long
def test_a_stripped_signature_is_missed(signed: Path, made: Path, again: Again, trusted: list[Path]) -> None:
    """The PDF as it was before it was signed is sound in itself."""
    (signed / "certificate.pdf").write_bytes((made / "certificate.pdf").read_bytes())
    found = inquiry(signed, again, trusted)
    assert [one.problem for one in found.findings] == ["carries no signature, and --trust asks for one"]


@pytest.mark.long
def test_a_signature_of_somebody_else_is_named(certificate: Path, again: Again, trusted: list[Path]) -> None:
    pdf = certificate / "certificate.pdf"
    pdf.write_bytes(
        sign_pdf(pdf.read_bytes(), issued("A. Huber", curve_key(), root("Other")).signer, seal=None, at=SIGNED)
    )
    assert inquiry(certificate, again, trusted).word == "NOT VERIFIED"


@pytest.mark.long
def test_a_test_key_is_named(certificate: Path, again: Again, tmp_path: Path, trusted: list[Path]) -> None:
    key = tmp_path / "key.p12"
    key.write_bytes(signing.trial_key("A. Huber", "open", SIGNED - dt.timedelta(days=1)).key)
    pdf = certificate / "certificate.pdf"
    pdf.write_bytes(sign_pdf(pdf.read_bytes(), signer_of_file(key, "open"), seal=None, at=SIGNED))
    assert "test key" in told_of(inquiry(certificate, again, None))
    assert inquiry(certificate, again, trusted).word == "NOT VERIFIED"


def test_without_what_signatures_need_all_else_is_checked(
    signed: Path, again: Again, trusted: list[Path], monkeypatch: pytest.MonkeyPatch
) -> None:  # fmt: skip
    for name in [name for name in sys.modules if name.split(".")[0] in ("pyhanko", "pyhanko_certvalidator", "signxml")]:
        monkeypatch.delitem(sys.modules, name)
    for name in [name for name in sys.modules if name.startswith("cmm_uq.certificate.sign.")]:
        monkeypatch.delitem(sys.modules, name)
    for name in ("pyhanko", "pyhanko_certvalidator", "signxml"):
        monkeypatch.setitem(sys.modules, name, None)
    found = inquiry(signed, again, None)
    assert found.word == "NOT WHOLLY CHECKED"
    assert [one.why for one in found.unchecked if one.what == "electronic signatures"] == [
        "signatures need pyhanko, which is not installed. Install it: pip install 'cmm-uq[sign]'"
    ]
    assert found.done["figures"] > 10


@pytest.mark.long
def test_a_byte_of_what_was_signed_breaks_the_signature(signed: Path, again: Again, trusted: list[Path]) -> None:
    spoil(signed / "certificate.pdf", lambda content: content.replace(b"/Creator", b"/Creatoe", 1))
    assert "signature 1" in "\n".join(one.place for one in inquiry(signed, again, trusted).findings)


@pytest.mark.long
def test_a_revision_after_the_signature_is_named(signed: Path, again: Again, trusted: list[Path]) -> None:
    import io

    from pyhanko.pdf_utils.generic import NameObject, pdf_string
    from pyhanko.pdf_utils.incremental_writer import IncrementalPdfFileWriter

    writer = IncrementalPdfFileWriter(io.BytesIO((signed / "certificate.pdf").read_bytes()))
    writer.root[NameObject("/Lang")] = pdf_string("fr")
    writer.update_root()
    out = io.BytesIO()
    writer.write(out)
    (signed / "certificate.pdf").write_bytes(out.getvalue())
    found = inquiry(signed, again, trusted)
    assert any(one.check == "signatures" and "appended" in one.problem for one in found.findings), found.findings


@pytest.mark.parametrize(("old", "new", "place"), [
    (b"404.2050562", b"404.2060562", "si:"), (rb"\micro\metre", rb"\milli\metre", "si:"),
    (b"DEA Iota 1102", b"DEA Iota 1103", "dcc:"),
    (b"McMaster", b"MacMaster", "dcc:"),
])  # fmt: skip
def test_an_element_of_the_digital_certificate_is_named_by_its_path(
    certificate: Path, made: Path, again: Again, old: bytes, new: bytes, place: str
) -> None:
    (certificate / "certificate.xml").write_bytes((made / "certificate.xml").read_bytes())
    spoil(certificate / "certificate.xml", lambda content: content.replace(old, new, 1))
    found = inquiry(certificate, again, None)
    assert any(one.file == "certificate.xml" and place in one.place for one in found.findings), told_of(found)


def told_of(found: Inquiry) -> str:
    return "\n".join(map(str, (*found.findings, *found.unchecked)))


def test_the_page_inside_the_digital_certificate_is_the_page_that_is_given(
    certificate: Path, made: Path, again: Again
) -> None:
    (certificate / "certificate.xml").write_bytes((made / "certificate.xml").read_bytes())
    spoil(certificate / "certificate.html", lambda content: content.replace(b"404.2051", b"404.2061"))
    found = inquiry(certificate, again, None)
    assert any(one.place.endswith("/dcc:document") for one in found.findings), told_of(found)


@pytest.mark.parametrize("head", [
    b'<!DOCTYPE a [<!ENTITY b "c">]>', b'<!DOCTYPE a [<!ENTITY b SYSTEM "file:///etc/passwd">]>', b'<!DOCTYPE a SYSTEM "http://x">',
])  # fmt: skip
def test_a_document_type_in_xml_is_refused(certificate: Path, made: Path, again: Again, head: bytes) -> None:
    content = (made / "certificate.xml").read_bytes()
    at = content.index(b"<dcc:")
    (certificate / "certificate.xml").write_bytes(content[:at] + head + content[at:])
    with pytest.raises(CmmUqError):
        inquiry(certificate, again, None)


@pytest.mark.long
def test_the_digital_certificate_is_held_to_the_schema_where_one_is_given(made: Path, again: Again) -> None:
    folder = ROOT.parent / "shared" / "schemas"
    if not folder.is_dir():
        pytest.skip("no schemas here")
    found = verify([made], schema=folder, compute=lambda given, job: again).inquiry
    assert found.word == "VERIFIED", told_of(found)


@pytest.mark.long
def test_a_folder_without_schemas_is_refused(made: Path, again: Again, tmp_path: Path) -> None:
    with pytest.raises(CmmUqError, match="no schema of DCC"):
        verify([made], schema=tmp_path, compute=lambda given, job: again)


@pytest.mark.long
def test_a_signed_pdf_that_was_saved_anew_has_no_revisions_of_number_nought(
    signed: Path, again: Again, trusted: list[Path]
) -> None:
    pdf = signed / "certificate.pdf"
    with pikepdf.open(pdf, allow_overwriting_input=True) as opened:
        opened.save(object_stream_mode=pikepdf.ObjectStreamMode.disable)
    said = [str(one) for one in inquiry(signed, again, trusted).findings if one.check == "signatures"]
    assert [one for one in said if "does not fit the file" in one]
    assert not [one for one in said if "0 revisions" in one]
