"""XML signed here is XAdES that xmlsec1 and signxml confirm; what was wrapped, cut out or added to is refused."""

from __future__ import annotations

import base64
import datetime as dt
import shutil
import subprocess
from collections.abc import Callable
from hashlib import sha256
from pathlib import Path

import pytest
from cryptography.hazmat.primitives.asymmetric import rsa
from cryptography.hazmat.primitives.serialization import Encoding, NoEncryption, PrivateFormat
from cryptography.x509 import ExtendedKeyUsage
from cryptography.x509.oid import ExtendedKeyUsageOID
from hypothesis import given, settings, strategies as st
from lxml import etree

from cmm_uq.base.errors import CmmUqError
from cmm_uq.certificate.sign import FileSignature, Trust, sign_xml, signatures_of_xml
from tests.certificate.sign.authority import FIRST, LAST, SIGNED, Held, curve_key, issued, root, usage
from tests.certificate.sign.responders import revocations, stamps
from tests.conftest import ROOT

DS = "{http://www.w3.org/2000/09/xmldsig#}"
XADES = "{http://uri.etsi.org/01903/v1.3.2#}"


def only(found: tuple[FileSignature, ...]) -> FileSignature:
    assert len(found) == 1
    return found[0]


@pytest.fixture(scope="session")
def signed(xml: bytes, held: Held) -> bytes:
    return sign_xml(xml, held.signer, at=SIGNED)


def test_a_signature_holds_of_somebody_trusted_over_the_whole_root(signed: bytes, trust: Trust) -> None:
    found = only(signatures_of_xml(signed, trust))
    assert found.good
    assert (found.name, found.level, found.time) == ("A. Huber", "XAdES B-B", SIGNED)


def test_what_was_verified_is_the_root_without_its_signature(xml: bytes, signed: bytes, trust: Trust) -> None:
    found = only(signatures_of_xml(signed, trust))
    assert found.content == etree.tostring(etree.fromstring(xml), method="c14n")


def test_properties_that_are_of_another_signature_by_their_target_do_not_count(signed: bytes, trust: Trust) -> None:
    """No signature covers its own name; what is signed says whose properties it is (XAdES, EN 319 132-1, 5.1)."""
    (name,) = {one.get("Id") for one in etree.fromstring(signed).iter(f"{DS}Signature")}
    other = signed.replace(f'Id="{name}"'.encode(), f'Id="{name}9"'.encode(), 1)
    assert only(signatures_of_xml(other, trust)).problems == ("the signed properties are not those of this signature",)


@pytest.mark.parametrize("key", ["held", "curve_held"])
def test_the_same_file_key_and_time_give_the_same_bytes(key: str, xml: bytes, request: pytest.FixtureRequest) -> None:
    signer = request.getfixturevalue(key).signer
    assert sign_xml(xml, signer, at=SIGNED) == sign_xml(xml, signer, at=SIGNED)


@pytest.mark.parametrize("key", ["held", "curve_held"])
def test_xmlsec1_confirms_it(
    key: str, xml: bytes, anchor: Held, tmp_path: Path, request: pytest.FixtureRequest
) -> None:
    if shutil.which("xmlsec1") is None:
        pytest.skip("no xmlsec1 is installed")
    (tmp_path / "signed.xml").write_bytes(sign_xml(xml, request.getfixturevalue(key).signer, at=SIGNED))
    (tmp_path / "ca.pem").write_bytes(anchor.pem)
    command = ["xmlsec1", "--verify", "--enabled-key-data", "x509", "--trusted-pem", "ca.pem",
               "--verification-gmt-time", f"{SIGNED:%Y-%m-%d %H:%M:%S}",
               "--id-attr:Id", "http://www.w3.org/2000/09/xmldsig#:KeyInfo",
               "--id-attr:Id", "http://uri.etsi.org/01903/v1.3.2#:SignedProperties", "signed.xml"]  # fmt: skip
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    altered = (tmp_path / "signed.xml").read_bytes().replace(b"73.2", b"73.1")
    (tmp_path / "signed.xml").write_bytes(altered)
    assert subprocess.run(command, cwd=tmp_path, capture_output=True).returncode != 0


def test_signxml_confirms_it(signed: bytes, anchor: Held, tmp_path: Path) -> None:
    from signxml.xades import XAdESSignatureConfiguration, XAdESVerifier

    (tmp_path / "ca.pem").write_bytes(anchor.pem)
    results = XAdESVerifier().verify(
        signed, ca_pem_file=str(tmp_path / "ca.pem"), ee_policy=_any_use(), ca_policy=_any_use(),
        expect_config=XAdESSignatureConfiguration(verification_time=SIGNED),
    )  # fmt: skip
    assert len(results) == 3


def _any_use():  # type: ignore[no-untyped-def]
    from cryptography.x509 import BasicConstraints
    from cryptography.x509.verification import Criticality, ExtensionPolicy

    return ExtensionPolicy.permit_all().require_present(BasicConstraints, Criticality.AGNOSTIC, None)


def test_the_signature_stands_where_the_schema_of_the_dcc_has_it() -> None:
    schema = ROOT.parent / "shared" / "schemas" / "dcc-3.2.1.xsd"
    if not schema.exists():
        pytest.skip("the schema of the DCC is not there")
    xs = "{http://www.w3.org/2001/XMLSchema}"
    own = f"{xs}element[@name='digitalCalibrationCertificate']"
    sequence = etree.parse(schema).find(f"{own}/{xs}complexType/{xs}sequence")
    if sequence is None:
        sequence = etree.parse(schema).find(f"{xs}complexType[@name='digitalCalibrationCertificateType']/{xs}sequence")
    assert [one.get("ref") for one in sequence.iterchildren(f"{xs}element")][-1] == "ds:Signature"


@pytest.mark.long
@settings(max_examples=40)
@given(place=st.floats(0, 1, exclude_max=True), bit=st.integers(0, 7))
def test_one_altered_bit_is_found_or_changes_nothing(signed: bytes, trust: Trust, place: float, bit: int) -> None:
    altered = bytearray(signed)
    altered[int(place * len(signed))] ^= 1 << bit
    before = only(signatures_of_xml(signed, trust))
    try:
        found = signatures_of_xml(bytes(altered), trust)
    except CmmUqError:
        return
    good = [one for one in found if one.good]
    assert all(one.content == before.content and one.time == before.time for one in good)


def forged(signed: bytes) -> etree._Element:
    return etree.fromstring(signed.replace(b"73.2", b"53.2"))


def wrapped(signed: bytes) -> etree._Element:
    """The signed root inside a forged one."""
    outer = forged(signed)
    outer.remove(outer[-1])
    outer.append(etree.fromstring(signed))
    return outer


def inside_an_object(signed: bytes) -> etree._Element:
    """The forged root outside, the signed one inside the signature."""
    outer = forged(signed)
    etree.SubElement(outer[-1], f"{DS}Object").append(etree.fromstring(signed))
    return outer


def behind_it(signed: bytes) -> etree._Element:
    outer = etree.fromstring(signed)
    etree.SubElement(outer, "more").text = "12.5"
    return outer


def not_last(signed: bytes) -> etree._Element:
    outer = etree.fromstring(signed)
    outer.insert(0, outer[-1])
    return outer


def twice(signed: bytes) -> etree._Element:
    outer = etree.fromstring(signed)
    outer.append(etree.fromstring(etree.tostring(outer[-1])))
    return outer


def a_part(signed: bytes) -> etree._Element:
    outer = etree.fromstring(signed)
    outer[-1].find(f"{DS}SignedInfo/{DS}Reference").set("URI", "#a")
    return outer


def the_web(signed: bytes) -> etree._Element:
    outer = etree.fromstring(signed)
    outer[-1].find(f"{DS}SignedInfo/{DS}Reference").set("URI", "http://127.0.0.1:9/a.xml")
    return outer


def a_filter(signed: bytes) -> etree._Element:
    outer = etree.fromstring(signed)
    transforms = outer[-1].find(f"{DS}SignedInfo/{DS}Reference/{DS}Transforms")
    added = etree.SubElement(transforms, f"{DS}Transform", Algorithm="http://www.w3.org/TR/1999/REC-xpath-19991116")
    etree.SubElement(added, f"{DS}XPath").text = "not(ancestor-or-self::value)"
    return outer


def a_stylesheet(signed: bytes) -> etree._Element:
    outer = etree.fromstring(signed)
    transforms = outer[-1].find(f"{DS}SignedInfo/{DS}Reference/{DS}Transforms")
    etree.SubElement(transforms, f"{DS}Transform", Algorithm="http://www.w3.org/TR/1999/REC-xslt-19991116")
    return outer


def the_same_name(signed: bytes) -> etree._Element:
    outer = etree.fromstring(signed)
    etree.SubElement(outer[0], "x").set("Id", str(outer[-1].find(f"{DS}KeyInfo").get("Id")))
    return outer


def a_comment(signed: bytes) -> etree._Element:
    """A reader that takes an element's first text reads 7 in place of 73.2; the signature still fits."""
    return etree.fromstring(signed.replace(b"73.2", b"7<!-- -->3.2"))


def an_instruction_before(signed: bytes) -> etree._Element:
    outer = etree.fromstring(signed)
    outer.addprevious(etree.ProcessingInstruction("xml-stylesheet", 'href="a.xsl"'))
    return outer


ATTACKS = (wrapped, inside_an_object, behind_it, not_last, twice, a_part, the_web, a_filter, a_stylesheet, the_same_name,
           a_comment, an_instruction_before)  # fmt: skip
"""On where a signature looks and what it covers (McIntosh and Austel 2005; Somorovsky et al. 2012)."""


@pytest.mark.parametrize("attack", ATTACKS, ids=lambda attack: attack.__name__)
def test_a_signature_that_covers_something_else_does_not_count(
    attack: Callable[[bytes], etree._Element], signed: bytes, trust: Trust
) -> None:
    found = signatures_of_xml(etree.tostring(attack(signed).getroottree()), trust)
    assert found
    assert not any(one.good or one.content for one in found)
    assert all(one.problems for one in found)


def with_further(place: str, further: str) -> Callable[[etree._Element], None]:
    def add(signature: etree._Element) -> None:
        (signature.find(place) if place else signature).append(etree.fromstring(further))

    return add


def with_text(place: str, text: str, *, tail: bool = False) -> Callable[[etree._Element], None]:
    return lambda signature: setattr(signature.find(place), "tail" if tail else "text", text)


def with_attribute(signature: etree._Element) -> None:
    signature.find(f"{DS}SignatureValue").set("U", "0.1 µm")


def with_a_space_of_names(signature: etree._Element) -> None:
    value = signature.find(f"{DS}SignatureValue")
    named = etree.Element(value.tag, value.attrib, nsmap={**value.nsmap, "U": "urn:0.1-um"})
    named.text, named.tail = value.text, value.tail
    signature.replace(value, named)


OBJECT = f'<Object xmlns="{DS[1:-1]}">U = 0.1 µm</Object>'
PROPERTIES = f"{DS}Object/{XADES}QualifyingProperties"
UNSIGNED = f'<UnsignedProperties xmlns="{XADES[1:-1]}"/>'
STAMPLESS = UNSIGNED.replace("/>", "><UnsignedSignatureProperties><SignatureTimeStamp/></UnsignedSignatureProperties>")


@pytest.mark.parametrize(("change", "what"), [
    (with_further("", OBJECT), "Signature"), (with_further("", "<note>U = 0.1 µm</note>"), "note"),
    (with_further(f"{DS}KeyInfo/{DS}X509Data", "<note/>"), None), (with_further(f"{DS}Object", OBJECT), "Object"),
    (with_further(PROPERTIES, UNSIGNED), "UnsignedProperties"), (with_further(PROPERTIES, "<U>0.1</U>"), "U"),
    (with_further(PROPERTIES, f"{STAMPLESS}</UnsignedProperties>"), "SignatureTimeStamp"),
    (with_text(f"{DS}Object", "U = 0.1 µm"), "Object"), (with_attribute, "SignatureValue"),
    (with_a_space_of_names, "SignatureValue"),
    (with_text(f"{DS}SignatureValue", "U = 0.1 µm", tail=True), "Signature"),
])  # fmt: skip
def test_what_a_signature_holds_besides_its_own_form_is_named(
    change: Callable[[etree._Element], None], what: str | None, signed: bytes, trust: Trust
) -> None:
    """``None``: in what the signature covers, so that it breaks it."""
    root = etree.fromstring(signed)
    change(root[-1])
    found = only(signatures_of_xml(etree.tostring(root), trust))
    assert not found.good
    assert found.problems == (
        (f"the signature holds what nothing covers or verifies: {what}",) if what else found.problems[:1]
    )


@pytest.mark.parametrize(("further", "what"), [("<!-- U = 0.1 µm -->", "<! … >"), ("<?U 0.1?>", "<? … >")])
def test_a_comment_or_an_instruction_in_a_signature_is_named_as_one(
    further: str, what: str, signed: bytes, trust: Trust
) -> None:
    root = signed.replace(b"</ds:Signature>", f"{further}</ds:Signature>".encode())
    assert root != signed
    found = only(signatures_of_xml(root, trust))
    assert [one.rpartition(": ")[2] for one in map(str, found.problems)][-1] == what


def stamped(signed: bytes, held: Held, of: bytes | None = None) -> etree._Element:
    """With a time stamp over the canonical signature value, by another program (RFC 3161; EN 319 132-1, 5.3)."""
    from asn1crypto import algos, tsp

    root = etree.fromstring(signed)
    value = of or etree.tostring(root[-1].find(f"{DS}SignatureValue"), method="c14n", with_tail=False)
    imprint = {
        "hash_algorithm": algos.DigestAlgorithm({"algorithm": "sha256"}),
        "hashed_message": sha256(value).digest(),
    }
    _, _, answer = stamps(held, STAMPED)(
        tsp.TimeStampReq({"version": 1, "message_imprint": imprint, "cert_req": True}).dump()
    )
    token = base64.b64encode(tsp.TimeStampResp.load(answer)["time_stamp_token"].dump()).decode()
    inside = f"<SignatureTimeStamp><EncapsulatedTimeStamp>{token}</EncapsulatedTimeStamp></SignatureTimeStamp>"
    root[-1].find(PROPERTIES).append(etree.fromstring(
        f'<UnsignedProperties xmlns="{XADES[1:-1]}"><UnsignedSignatureProperties>{inside}'
        "</UnsignedSignatureProperties></UnsignedProperties>"
    ))  # fmt: skip
    return root


STAMPED = SIGNED + dt.timedelta(seconds=7)


@pytest.fixture(scope="module")
def stamper(anchor: Held, rsa_key: rsa.RSAPrivateKey) -> Held:
    return issued("Time", rsa_key, anchor, key_usage=usage(digital_signature=True),
                  further=((ExtendedKeyUsage([ExtendedKeyUsageOID.TIME_STAMPING]), True),))  # fmt: skip


def test_a_time_stamp_that_fits_proves_the_time_and_one_of_another_signature_is_named(
    signed: bytes, stamper: Held, anchor: Held, trust: Trust
) -> None:
    found = only(signatures_of_xml(etree.tostring(stamped(signed, stamper)), trust))
    assert found.good
    assert (found.level, found.time, found.time_proven) == ("XAdES B-T", STAMPED, True)
    other = only(signatures_of_xml(etree.tostring(stamped(signed, stamper, b"another value")), trust))
    assert (other.good, other.level) == (False, "XAdES B-B")
    assert other.problems == ("the time stamp does not fit the signature",)


@pytest.mark.parametrize(("listed", "good", "revocation", "level"), [
    ("nobody", True, "good", "XAdES B-LT"), ("the signer", False, "revoked", "XAdES B-T"),
    ("U = 0.1 µm", False, "not known", "XML"),
])  # fmt: skip
def test_a_list_of_revocations_beside_a_time_stamp_counts(
    listed: str, good: bool, revocation: str, level: str, xml: bytes, stamper: Held, curve_held: Held, anchor: Held,
    trust: Trust,
) -> None:  # fmt: skip
    root = stamped(sign_xml(xml, curve_held.signer, at=SIGNED), stamper)
    entry = (curve_held.certificate.serial_number, SIGNED - dt.timedelta(hours=1))
    data = {"nobody": revocations(anchor), "the signer": revocations(anchor, entry)}.get(listed, listed.encode())
    root[-1].find(f"{PROPERTIES}/{XADES}UnsignedProperties/{XADES}UnsignedSignatureProperties").append(etree.fromstring(
        f'<RevocationValues xmlns="{XADES[1:-1]}"><CRLValues><EncapsulatedCRLValue>{base64.b64encode(data).decode()}'
        "</EncapsulatedCRLValue></CRLValues></RevocationValues>"
    ))  # fmt: skip
    found = only(signatures_of_xml(etree.tostring(root), trust))
    assert (found.good, found.revocation, found.level) == (good, revocation, level)


@pytest.mark.parametrize("further", ["VT0wLjE=", "====", "A"])
def test_more_behind_what_is_decoded_of_a_time_stamp_or_a_certificate_counts_against_it(
    further: str, signed: bytes, stamper: Held, trust: Trust
) -> None:
    root = stamped(signed, stamper)
    token = root[-1].find(f".//{XADES}EncapsulatedTimeStamp")
    token.text = token.text.rstrip("=") + "==" + further
    assert not only(signatures_of_xml(etree.tostring(root), trust)).good


def test_nothing_counts_but_what_covers_the_whole_root(xml: bytes, held: Held, trust: Trust) -> None:
    """A valid signature over one element, by signxml itself."""
    from signxml.xades import XAdESSigner

    part = XAdESSigner(c14n_algorithm="http://www.w3.org/2001/10/xml-exc-c14n#").sign(
        etree.fromstring(xml), key=held.key, cert=[held.certificate, *held.chain], reference_uri="#a",
        always_add_key_value=False,
    )  # fmt: skip
    found = only(signatures_of_xml(etree.tostring(part), trust))
    assert not found.intact
    assert "only one over the whole root counts" in found.problems[0]


@pytest.mark.parametrize(("algorithm", "weak"), [
    ("http://www.w3.org/2000/09/xmldsig#rsa-sha1", True), ("http://www.w3.org/2001/04/xmldsig-more#rsa-md5", True),
    ("http://www.w3.org/2000/09/xmldsig#hmac-sha1", True), ("http://www.w3.org/2001/04/xmldsig-more#rsa-sha512", False),
])  # fmt: skip
def test_weak_algorithms_are_named(algorithm: str, weak: bool, signed: bytes, trust: Trust) -> None:
    strong = b"http://www.w3.org/2001/04/xmldsig-more#rsa-sha256"
    found = only(signatures_of_xml(signed.replace(strong, algorithm.encode()), trust))
    assert not found.good
    assert any("weak or unknown" in problem for problem in found.problems) == weak


def short_key(anchor: Held) -> Held:
    return issued("short", rsa.generate_private_key(public_exponent=65537, key_size=1024), anchor)


def test_a_short_key_does_not_sign_and_does_not_count(xml: bytes, anchor: Held, trust: Trust) -> None:
    from signxml.xades import XAdESSigner

    held = short_key(anchor)
    with pytest.raises(CmmUqError, match="1024 bits is too short"):
        sign_xml(xml, held.signer, at=SIGNED)
    by_another = XAdESSigner().sign(
        etree.fromstring(xml), key=held.key, cert=[held.certificate], always_add_key_value=False
    )
    found = only(signatures_of_xml(etree.tostring(by_another), trust))
    assert any("1024 bits is too short" in problem for problem in found.problems)


def test_a_chain_that_is_signed_with_sha_1_does_not_hold(xml: bytes, held: Held, tmp_path: Path) -> None:
    """Its certificate made by openssl: what makes the others here refuses to."""
    from cryptography.x509 import load_pem_x509_certificate

    if shutil.which("openssl") is None:
        pytest.skip("no openssl is installed")
    anchor, plain = root("Old Root"), (Encoding.PEM, PrivateFormat.PKCS8, NoEncryption())
    (tmp_path / "root.pem").write_bytes(anchor.pem + anchor.key.private_bytes(*plain))
    (tmp_path / "key.pem").write_bytes(held.key.private_bytes(*plain))
    for command in (
        "req -new -key key.pem -subj /CN=old -out asked.pem",
        "x509 -req -in asked.pem -CA root.pem -CAkey root.pem -sha1 -days 36500 -set_serial 5 -out made.pem",
    ):
        subprocess.run(["openssl", *command.split()], cwd=tmp_path, check=True, capture_output=True)
    certificate = load_pem_x509_certificate((tmp_path / "made.pem").read_bytes())
    trusting = Trust((anchor.certificate.public_bytes(Encoding.DER),))
    at = certificate.not_valid_before_utc + dt.timedelta(seconds=1)
    found = only(signatures_of_xml(sign_xml(xml, Held(held.key, certificate).signer, at=at), trusting))
    assert found.intact
    assert not found.trusted
    assert "sha1" in found.problems[0].lower()


@pytest.mark.parametrize("at", [FIRST - dt.timedelta(days=1), LAST + dt.timedelta(days=1)])
def test_a_certificate_must_be_in_date_when_it_was_signed(
    at: dt.datetime, xml: bytes, held: Held, trust: Trust
) -> None:
    """Signed by a program that does not look."""
    from signxml.xades import XAdESSigner

    class Dated(XAdESSigner):
        def add_signing_time(self, signed_signature_properties, sig_root, signing_settings):  # type: ignore[no-untyped-def]
            etree.SubElement(signed_signature_properties, f"{XADES}SigningTime").text = at.isoformat()

    by_another = Dated().sign(
        etree.fromstring(xml), key=held.key, cert=[held.certificate, *held.chain], always_add_key_value=False
    )
    found = only(signatures_of_xml(etree.tostring(by_another), trust))
    assert found.intact
    assert found.problems[0].startswith(f"the certificate was not valid on {at.date()}")
    assert not found.good


@pytest.mark.parametrize("authority", [False, True])
def test_a_certificate_that_signed_itself_leads_to_nobody_but_itself(authority: bool, xml: bytes, trust: Trust) -> None:
    alone = issued("C. Wolf", curve_key(), authority=authority)
    signed = sign_xml(xml, alone.signer, at=SIGNED)
    found = only(signatures_of_xml(signed, trust))
    assert (found.intact, found.trusted) == (True, False)
    assert found.problems == ("no chain of certificates leads from the signer to anybody who is trusted",)
    assert only(signatures_of_xml(signed, Trust((alone.certificate.public_bytes(Encoding.DER),)))).good


def test_a_web_servers_certificate_does_not_count(xml: bytes, anchor: Held, trust: Trust) -> None:
    from signxml.xades import XAdESSigner

    held = issued("web", curve_key(), anchor, key_usage=usage(key_agreement=True))
    by_another = XAdESSigner(signature_algorithm="ecdsa-sha256").sign(
        etree.fromstring(xml), key=held.key, cert=[held.certificate], always_add_key_value=False
    )
    found = only(signatures_of_xml(etree.tostring(by_another), trust))
    assert "the certificate is not for signatures (its key usage)" in found.problems


@pytest.mark.parametrize(("content", "why"), [
    (b"<a", "is no XML"), (b"", "is no XML"),
    (b'<!DOCTYPE a [<!ENTITY b "c">]><a>&b;</a>', "declares a document type"),
    (b'<!DOCTYPE a SYSTEM "http://127.0.0.1:9/a.dtd"><a/>', "declares a document type"),
    ('<?xml version="1.0" encoding="UTF-16"?><!DOCTYPE a [<!ENTITY b "c">]><a/>'.encode("utf-16"), "declares a document type"),
    (b"<a>" * 300 + b"</a>" * 300, "is no XML"),
])  # fmt: skip
def test_what_is_no_certificate_is_refused(content: bytes, why: str, trust: Trust, held: Held) -> None:
    with pytest.raises(CmmUqError, match=why):
        signatures_of_xml(content, trust)
    with pytest.raises(CmmUqError, match=why):
        sign_xml(content, held.signer, at=SIGNED)


def test_a_file_is_signed_once(signed: bytes, curve_held: Held) -> None:
    with pytest.raises(CmmUqError, match="is signed already"):
        sign_xml(signed, curve_held.signer, at=SIGNED)


@pytest.mark.parametrize("content", [b"<a><!-- b --></a>", b"<a/><?b?>", b"<!-- b --><a/>"])
def test_what_no_signature_covers_is_not_signed(content: bytes, held: Held) -> None:
    with pytest.raises(CmmUqError, match="which no signature covers"):
        sign_xml(content, held.signer, at=SIGNED)
