"""PDFs signed here are PAdES signatures that openssl and pyHanko confirm, and that say what was changed of a file."""

from __future__ import annotations

import asyncio
import datetime as dt
import io
import re
import shutil
import subprocess
from collections.abc import Callable
from pathlib import Path

import pikepdf
import pytest
from cryptography.hazmat.primitives.serialization import Encoding
from hypothesis import given, settings, strategies as st

from cmm_uq.base.errors import CmmUqError
from cmm_uq.certificate.sign import FileSignature, Trust, sign_pdf, signatures_of_pdf
from tests.certificate.sign.authority import LAST, SIGNED, Held, curve_key, issued, usage

DER = Encoding.DER


def only(found: tuple[FileSignature, ...]) -> FileSignature:
    assert len(found) == 1
    return found[0]


@pytest.fixture(scope="session")
def signed(pdf: bytes, held: Held) -> bytes:
    return sign_pdf(pdf, held.signer, seal=None, at=SIGNED, reason="approval")


def test_a_signature_holds_of_somebody_trusted_over_the_whole_file(signed: bytes, trust: Trust) -> None:
    found = only(signatures_of_pdf(signed, trust))
    assert found.good
    assert (found.name, found.level, found.time, found.time_proven) == ("A. Huber", "PAdES B-B", SIGNED, False)
    assert "Test Issuer" in found.issuer
    assert not found.test_key
    assert found.content == signed


def test_every_byte_of_the_document_stays_as_it_was(pdf: bytes, signed: bytes) -> None:
    assert signed.startswith(pdf)


def test_it_is_made_and_found_where_a_loop_runs_already(pdf: bytes, signed: bytes, held: Held, trust: Trust) -> None:
    """As in a notebook."""

    async def inside() -> tuple[bytes, FileSignature]:
        return sign_pdf(pdf, held.signer, seal=None, at=SIGNED, reason="approval"), only(
            signatures_of_pdf(signed, trust)
        )

    again, found = asyncio.run(inside())
    assert again == signed
    assert found.good


def test_a_certificate_that_comes_with_the_signature_and_that_no_chain_needs_is_held_to_its_issuer(
    signed: bytes, anchor: Held, trust: Trust
) -> None:  # fmt: skip
    """One bit of the root's own signature: the chain ends at the root that is trusted, not at the one in the file."""
    brought = anchor.certificate.public_bytes(DER).hex().encode()
    assert brought in signed.lower()
    at = signed.lower().index(brought) + len(brought) - 1
    spoilt = signed[:at] + (b"1" if signed[at : at + 1] == b"0" else b"0") + signed[at + 1 :]
    assert only(signatures_of_pdf(signed, trust)).problems == ()
    assert "a certificate that comes with the signature was changed" in only(signatures_of_pdf(spoilt, trust)).problems


def test_nobody_is_trusted_by_default(signed: bytes) -> None:
    found = only(signatures_of_pdf(signed, Trust()))
    assert found.intact
    assert not found.trusted
    assert found.problems == ("nobody is trusted: name the certificates that you trust",)


def test_an_authority_that_is_not_trusted_vouches_for_nobody(signed: bytes, curve_held: Held) -> None:
    found = only(signatures_of_pdf(signed, Trust((curve_held.certificate.public_bytes(DER),))))
    assert found.problems == ("no chain of certificates leads from the signer to anybody who is trusted",)


@pytest.mark.parametrize("key", ["held", "curve_held"])
def test_the_same_document_key_and_time_give_the_same_bytes(
    key: str, pdf: bytes, request: pytest.FixtureRequest
) -> None:
    signer = request.getfixturevalue(key).signer
    assert sign_pdf(pdf, signer, seal=None, at=SIGNED) == sign_pdf(pdf, signer, seal=None, at=SIGNED)


def test_openssl_confirms_it(signed: bytes, anchor: Held, tmp_path: Path) -> None:
    """The bytes of /ByteRange and the PKCS#7 between them, taken out by pikepdf."""
    if shutil.which("openssl") is None:
        pytest.skip("no openssl is installed")
    with pikepdf.open(io.BytesIO(signed)) as opened:
        value = opened.Root.AcroForm.Fields[0].V
        first, before, second, after = map(int, value.ByteRange)
        (tmp_path / "signature.der").write_bytes(bytes(value.Contents))
    (tmp_path / "content").write_bytes(signed[first:before] + signed[second : second + after])
    (tmp_path / "ca.pem").write_bytes(anchor.pem)
    command = ["openssl", "cms", "-verify", "-inform", "DER", "-in", "signature.der", "-content", "content", "-binary",
               "-CAfile", "ca.pem", "-purpose", "any", "-attime", str(int(SIGNED.timestamp())), "-cades",
               "-out", "out"]  # fmt: skip
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    (tmp_path / "content").write_bytes(signed[first:before] + signed[second : second + after][:-1] + b" ")
    assert subprocess.run(command, cwd=tmp_path, capture_output=True).returncode != 0


def test_pyhanko_confirms_it(signed: bytes, anchor: Held) -> None:
    from asn1crypto import x509
    from pyhanko.pdf_utils.reader import PdfFileReader
    from pyhanko.sign.validation import validate_pdf_signature
    from pyhanko_certvalidator import ValidationContext

    context = ValidationContext(
        trust_roots=[x509.Certificate.load(anchor.certificate.public_bytes(DER))], moment=SIGNED, allow_fetching=False
    )
    status = validate_pdf_signature(PdfFileReader(io.BytesIO(signed)).embedded_signatures[0], context)
    assert status.bottom_line
    assert status.coverage.name == "ENTIRE_FILE"


def test_a_second_person_signs_the_same_document(signed: bytes, curve_held: Held, trust: Trust) -> None:
    later = SIGNED + dt.timedelta(hours=1)
    twice = sign_pdf(signed, curve_held.signer, seal=None, at=later)
    first, second = signatures_of_pdf(twice, trust)
    assert (first.name, second.name, second.time) == ("A. Huber", "B. Maier", later)
    assert first.good
    assert second.good
    assert first.content == signed


@settings(max_examples=40)
@given(place=st.floats(0, 1, exclude_max=True), bit=st.integers(0, 7))
def test_one_altered_bit_is_found(signed: bytes, trust: Trust, place: float, bit: int) -> None:
    altered = bytearray(signed)
    altered[int(place * len(signed))] ^= 1 << bit
    try:
        found = signatures_of_pdf(bytes(altered), trust)
    except CmmUqError:
        return
    assert not (len(found) == 1 and found[0].good) or _hexadecimal(signed, altered)


def _hexadecimal(signed: bytes, altered: bytearray) -> bool:
    """The signature itself is written in hexadecimal digits: small or capital letters are the same."""
    return signed.lower() == bytes(altered).lower()


def test_a_certificate_must_be_in_date_when_it_is_signed(pdf: bytes, held: Held) -> None:
    with pytest.raises(CmmUqError, match="its certificate expired on 2027-01-31"):
        sign_pdf(pdf, held.signer, seal=None, at=LAST + dt.timedelta(days=1))


def test_a_revision_that_changes_a_page_is_named(signed: bytes, trust: Trust) -> None:
    from pyhanko.pdf_utils.generic import StreamObject
    from pyhanko.pdf_utils.incremental_writer import IncrementalPdfFileWriter

    writer = IncrementalPdfFileWriter(io.BytesIO(signed))
    writer.add_stream_to_page(0, writer.add_object(StreamObject(stream_data=b"0 0 100 100 re f")))
    output = io.BytesIO()
    writer.write(output)
    found = only(signatures_of_pdf(output.getvalue(), trust))
    assert found.intact
    assert not found.covers_whole_file
    assert "1 revision was appended after it, and changes" in found.problems[0]
    assert "Page" in found.problems[0]
    assert found.content == signed


NOTHING = "bytes stand behind it that belong to no revision of the file"


def empty_revision(signed: bytes) -> bytes:
    root, size = (re.findall(rf"/{key} (\d+(?: 0 R)?)".encode(), signed)[-1] for key in ("Root", "Size"))
    place = re.findall(rb"startxref\s+(\d+)", signed)[-1]
    return b"\nxref\n0 0\ntrailer\n<</Size %s/Root %s/Prev %s>>\nstartxref\n%d\n%%%%EOF\n" % (
        size, root, place, len(signed) + 1)  # fmt: skip


@pytest.mark.parametrize(("behind", "problem"), [
    (lambda _: b"U = 0.1", NOTHING), (lambda _: b"U = 0.1 %%EOF\n", NOTHING),
    (lambda signed: b"U = 0.1\nstartxref\n%s\n%%%%EOF" % re.findall(rb"startxref\s+(\d+)", signed)[-1], NOTHING),
    (empty_revision, "1 revision was appended after it, and changes Trailer"),
])  # fmt: skip
def test_what_follows_a_signature_and_changes_nothing_is_named_too(
    behind: Callable[[bytes], bytes], problem: str, signed: bytes, trust: Trust
) -> None:
    found = only(signatures_of_pdf(signed + behind(signed), trust))
    assert (found.intact, found.covers_whole_file, found.good) == (True, False, False)
    assert found.problems == (problem,)
    assert only(signatures_of_pdf(signed + b"\n", trust)).good


def also(writer: object, change: str) -> None:
    """What somebody changes while a further signature is made."""
    from pyhanko.pdf_utils.generic import NameObject, pdf_string

    root = writer.root  # type: ignore[attr-defined]
    tree = root["/StructTreeRoot"]
    top = tree["/K"][0]
    if change == "words":  # what a screen reader says of the first element
        first = top["/K"][0]
        first[NameObject("/ActualText")] = pdf_string("conforms")
        writer.update_container(first)  # type: ignore[attr-defined]
    elif change == "order":
        kids = top["/K"]
        kids[0], kids[1] = kids.raw_get(1), kids.raw_get(0)
        writer.update_container(kids)  # type: ignore[attr-defined]
        writer.update_container(top)  # type: ignore[attr-defined]
    elif change == "roles":
        tree["/RoleMap"][NameObject("/Figure")] = NameObject("/Artifact")
        writer.update_container(tree["/RoleMap"])  # type: ignore[attr-defined]
    elif change == "language":
        root[NameObject("/Lang")] = pdf_string("tlh")
        writer.update_root()  # type: ignore[attr-defined]
    elif change == "a file":
        names = root["/Names"]["/EmbeddedFiles"]["/Names"]
        names[0] = pdf_string("renamed")
        writer.update_container(names)  # type: ignore[attr-defined]


@pytest.mark.parametrize("change", ["words", "order", "roles", "language", "a file"])
def test_a_further_signature_may_change_nothing_else(
    change: str, signed: bytes, curve_held: Held, trust: Trust, monkeypatch: pytest.MonkeyPatch
) -> None:
    from cmm_uq.certificate.sign import pdf_library as tagging

    tag = tagging.tag

    def changed(writer, *arguments):  # type: ignore[no-untyped-def]
        tag(writer, *arguments)
        also(writer, change)

    monkeypatch.setattr(tagging, "tag", changed)
    twice = sign_pdf(signed, curve_held.signer, seal=None, at=SIGNED)
    first, second = signatures_of_pdf(twice, trust)
    assert second.good
    assert first.intact
    assert not first.covers_whole_file
    assert first.problems[0].startswith("1 revision was appended after it, and changes ")


@pytest.mark.parametrize(
    "content", [b"", b"%PDF-1.7\n", b"%PDF-1.7\ntrailer<</Root 1 0 R/Size 9>>\nstartxref\n0\n%%EOF", b"\0" * 4096]
)
def test_what_is_no_pdf_is_refused(content: bytes, held: Held, trust: Trust) -> None:
    with pytest.raises(CmmUqError, match="cannot be read as a PDF"):
        signatures_of_pdf(content, trust)
    with pytest.raises(CmmUqError, match="cannot be read as a PDF"):
        sign_pdf(content, held.signer, seal=None, at=SIGNED)


def test_a_pdf_that_is_encrypted_is_not_signed(pdf: bytes, held: Held) -> None:
    out = io.BytesIO()
    with pikepdf.open(io.BytesIO(pdf)) as opened:
        opened.save(out, encryption=pikepdf.Encryption(owner="a", user="b"))
    with pytest.raises(CmmUqError, match="is encrypted"):
        sign_pdf(out.getvalue(), held.signer, seal=None, at=SIGNED)


def test_a_file_without_a_signature_has_none(pdf: bytes, trust: Trust) -> None:
    assert signatures_of_pdf(pdf, trust) == ()


def test_a_key_that_is_not_for_signatures_does_not_sign(pdf: bytes, anchor: Held) -> None:
    web = issued("web server", curve_key(), anchor, key_usage=usage(key_encipherment=True))
    with pytest.raises(CmmUqError, match="not for signatures"):
        sign_pdf(pdf, web.signer, seal=None, at=SIGNED)
