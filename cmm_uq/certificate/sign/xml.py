"""XML signed by XAdES B-B, over the whole root, enveloped, as a DCC's last element, and the signatures in an XML file.

The same file, key and time give the same bytes. Of a signature every element is accounted for: signed, or of the form below,
with nothing in it but what is verified.
"""

from __future__ import annotations

import base64
import binascii
import datetime as dt
import hashlib
import re
import tomllib
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.files.limits import SIGNED_BYTES
from cmm_uq.base.messages import Text, Verbatim, commas, say
from cmm_uq.certificate.sign.found import BROKEN, STAMP_BROKEN, WEAK, FileSignature, Trust, installed
from cmm_uq.certificate.sign.signer import Signer

if TYPE_CHECKING:
    from asn1crypto import cms, x509
    from lxml.etree import _Element

    from cmm_uq.certificate.sign.chain import Evidence

T = TypeVar("T")
DS, XADES = "{http://www.w3.org/2000/09/xmldsig#}", "{http://uri.etsi.org/01903/v1.3.2#}"
SIGNATURE = f"{DS}Signature"


def root_of(data: bytes, where: str) -> _Element:
    with installed():
        from lxml import etree
    if len(data) > SIGNED_BYTES.most:
        raise CmmUqError(f"is larger than the {SIGNED_BYTES.most} bytes that are read of such a file", where=where,
                         fix="Check that it is the right file")  # fmt: skip
    if b"<!DOCTYPE" in data or b"<!ENTITY" in data:
        raise _typed(where)
    parser = etree.XMLParser(resolve_entities=False, no_network=True, load_dtd=False, huge_tree=False)
    try:
        root = etree.fromstring(data, parser)
    except etree.XMLSyntaxError as error:
        raise CmmUqError(f"is no XML: {error}", where=where, fix="Name an XML file that is whole") from None
    if root.getroottree().docinfo.internalDTD is not None:  # in an encoding that hides it from the search
        raise _typed(where)
    return root


def _typed(where: str) -> CmmUqError:
    return CmmUqError("declares a document type, which a certificate has no need of", where=where,
                      fix="Take it out: entities could change what is read")  # fmt: skip


COMMENT = say("the file has a comment, which no signature covers")
INSTRUCTION = say("the file has a processing instruction, which no signature covers")
_LETTERS = 16  # of a name that is taken from the file's hash, so that no other element has it


def sign_xml(xml: bytes, signer: Signer, *, at: dt.datetime, where: str = "the XML file") -> bytes:
    signer.check(at)
    root = root_of(xml, where)
    if next(root.iter(SIGNATURE), None) is not None:
        raise CmmUqError("is signed already, and a second signature would break the first", where=where,
                         fix="Sign the file as it was written, or the PDF, which takes several")  # fmt: skip
    for uncovered in outside(root):
        raise CmmUqError(str(uncovered), where=where, fix="Take it out")
    with installed():
        from lxml import etree
        from signxml import CanonicalizationMethod, SignatureMethod
        from signxml.xades import XAdESDataObjectFormat, XAdESSigner

    class SignedStatement(XAdESSigner):  # type: ignore[misc]
        """Takes time and names from what is signed, where the library reads the clock and draws them."""

        def add_signing_time(self, signed_signature_properties: _Element, sig_root: Any, signing_settings: Any) -> None:
            element = etree.SubElement(signed_signature_properties, "{http://uri.etsi.org/01903/v1.3.2#}SigningTime")
            element.text = at.astimezone(dt.UTC).strftime("%Y-%m-%dT%H:%M:%SZ")

        def _get_token(self, length: int = 4) -> str:
            count = len(self._tokens_used)
            token = hashlib.sha256(xml + bytes((count,))).hexdigest()[:_LETTERS]
            self._tokens_used[token] = True
            return token

    stated = SignedStatement(
        signature_algorithm={"rsa": SignatureMethod.RSA_SHA256, "ecdsa": SignatureMethod.ECDSA_SHA256}[signer.algorithm],
        c14n_algorithm=CanonicalizationMethod.CANONICAL_XML_1_0,
        data_object_format=XAdESDataObjectFormat("Digital calibration certificate", "text/xml"),
    )  # fmt: skip
    key: Any = _Key(signer)
    signed = stated.sign(root, key=key, cert=[signer.certificate, *signer.chain], always_add_key_value=False)
    return bytes(etree.tostring(signed.getroottree(), encoding="UTF-8", xml_declaration=True)) + b"\n"


def outside(root: _Element) -> list[Text]:
    """What a signature over the root does not cover, though a reader could take it for a part of the file."""
    with installed():
        from lxml import etree
    beside = [*root.itersiblings(preceding=True), *root.itersiblings()]
    found: list[Text] = []
    for sort, said in ((etree.Comment, COMMENT), (etree.ProcessingInstruction, INSTRUCTION)):
        if next(root.iter(sort), None) is not None or any(one.tag is sort for one in beside):
            found.append(said)
    return found


class _Key:
    """A signer in the place of a private key of the library."""

    def __init__(self, signer: Signer) -> None:
        self._signer = signer
        self.key_size = signer.bits

    def sign(self, data: bytes, **_: Any) -> bytes:
        """Signature of data; digest and padding are those of every signer."""
        return self._signer.signed(data)


ENVELOPED = "http://www.w3.org/2000/09/xmldsig#enveloped-signature"
CANONICAL = (
    "http://www.w3.org/TR/2001/REC-xml-c14n-20010315", "http://www.w3.org/2006/12/xml-c14n11",
    "http://www.w3.org/2001/10/xml-exc-c14n#",
)  # fmt: skip
"""Without comments: these are refused."""

DIGESTS = frozenset({"http://www.w3.org/2001/04/xmlenc#sha256", "http://www.w3.org/2001/04/xmldsig-more#sha384",
                     "http://www.w3.org/2001/04/xmlenc#sha512"})  # fmt: skip
METHODS = frozenset(f"http://www.w3.org/2001/04/xmldsig-more#{key}-sha{bits}" for key in ("rsa", "ecdsa")
                    for bits in (256, 384, 512))  # fmt: skip

QUALIFYING = f"{DS}Object/{XADES}QualifyingProperties"
PROPERTIES = f"{QUALIFYING}/{XADES}SignedProperties"
UNSIGNED = f"{QUALIFYING}/{XADES}UnsignedProperties/{XADES}UnsignedSignatureProperties"
STAMP = f"{UNSIGNED}/{XADES}SignatureTimeStamp"
OF_ANOTHER = say("the signed properties are not those of this signature")
NO_XADES = say("the signature has no signed properties, as XAdES asks for")
ELSEWHERE = say("the signature does not stand as the last element of the root")
PARTIAL = say("the signature covers a part of the file, or more than the file: only one over the whole root counts")
NO_CERTIFICATE = say("the signature has no certificate that can be read")
NO_EVIDENCE = say("what was added to the signature about certificates cannot be read")
SEVERAL = say("the file has several signatures, and one covers the other")
_FORMS = {
    f"{{{space}}}{name}": form
    for space, forms in tomllib.loads(Path(__file__).with_name("forms.toml").read_text(encoding="utf-8")).items()
    for name, form in forms.items()
}
"""Of what no signature covers, each element's children, attributes and text (XML Signature 1.1, 4; EN 319 132-1, 5)."""


def signatures_of_xml(data: bytes, trust: Trust, *, where: str = "the XML file") -> tuple[FileSignature, ...]:
    root = root_of(data, where)
    elements = list(root.iter(SIGNATURE))
    return tuple(_found(data, element, several=len(elements) > 1, trust=trust) for element in elements)


def _found(data: bytes, element: _Element, *, several: bool, trust: Trust) -> FileSignature:
    with installed():
        from cmm_uq.certificate.sign.chain import Evidence, judged
    problems = _shape(element)
    certificates = _certificates(element)
    if several:
        problems.append(SEVERAL)
    if not certificates:
        problems.append(NO_CERTIFICATE)
    added = _evidence(element)
    if added is None:
        problems.append(NO_EVIDENCE)
    if problems or added is None:  # nothing is computed of what could not count
        return FileSignature("XML", tuple(problems))
    signer = certificates[0]
    references = [str(one.get("URI")) for one in element.iterfind(f"{DS}SignedInfo/{DS}Reference")]
    content = _verified(data, signer, references)
    evidence = Evidence((*certificates[1:], *added.certificates), added.revocations, added.answers)
    stamped, proven, tokens = _stamp_of_signature(element, evidence, trust)
    evidence = replace(evidence, others=tokens)
    problems = [] if content else [BROKEN]
    if stamped is None and element.find(STAMP) is not None:
        problems.append(STAMP_BROKEN)
    found = FileSignature(
        "", tuple(problems), time=stamped if proven else _time(element), time_proven=proven, intact=bool(content),
        covers_whole_file=bool(content), content=content,
    )  # fmt: skip
    found = judged(found, signer, evidence, trust)
    known = found.revocation == "good" and bool(added.revocations or added.answers)
    return replace(found, level=f"XAdES B-{'B' if stamped is None else 'LT' if known else 'T'}")


def _further(part: _Element, signed: set[str]) -> Iterator[str]:
    """Names of what stands in a part of a signature, though nothing covers it and the forms do not have it."""
    if part.tag == f"{DS}SignedInfo" or part.get("Id") in signed:
        return
    name, children = _name(part), [_name(child) for child in part]
    form, attributes, text = _FORMS.get(str(part.tag), (None, "", ""))
    words = (part.text or "", *((child.tail or "").strip() for child in part))
    if form is None or not re.fullmatch(form, " ".join(children)):
        known = re.findall(r"\w+", form or "")
        yield from [child for child in children if form is not None and child not in known] or [name]
    elif set(part.attrib) - set(attributes.split()) or not re.fullmatch(text, words[0]) or any(words[1:]):
        yield name
    elif set(part.nsmap.values()) - set(part.getparent().nsmap.values()) - {DS[1:-1], XADES[1:-1]}:
        yield name  # a name of a space of names may say anything
    else:
        for child in part:
            yield from _further(child, signed)


def _name(element: _Element) -> str:
    return element.tag.rpartition("}")[2] if isinstance(element.tag, str) else f"{str(element)[:2]} … >"  # a comment


def _shape(element: _Element) -> list[Text]:
    """Why a signature cannot count, whatever it was computed of."""
    found: list[Text] = []
    root = element.getroottree().getroot()
    if element.getparent() is not root or element.getnext() is not None:
        found.append(ELSEWHERE)
    found += outside(root)
    references = element.findall(f"{DS}SignedInfo/{DS}Reference")
    whole = [reference for reference in references if reference.get("URI") == ""]
    if len(whole) != 1 or not _plain(whole[0], ENVELOPED) or not _own(element, references):
        found.append(PARTIAL)
    if element.find(PROPERTIES) is None:
        found.append(NO_XADES)
    elif element.find(QUALIFYING).get("Target") != f"#{element.get('Id')}":
        found.append(OF_ANOTHER)
    digests = {str(one.get("Algorithm")) for one in element.iterfind(f"{DS}SignedInfo/{DS}Reference/{DS}DigestMethod")}
    methods = [str(one.get("Algorithm")) for one in element.iterfind(f"{DS}SignedInfo/{DS}SignatureMethod")]
    if not digests <= DIGESTS or len(methods) != 1 or methods[0] not in METHODS:
        found.append(WEAK)
    further = dict.fromkeys(_further(element, {str(one.get("URI"))[1:] for one in references if one.get("URI")}))
    if further and ELSEWHERE not in found:
        what = commas([Verbatim(name) for name in further])
        found.append(say("the signature holds what nothing covers or verifies: {what}", what=what))
    return found


def _plain(reference: _Element, *further: str) -> bool:
    """Whether nothing is left out of what a reference covers but the signature itself."""
    transforms = [str(one.get("Algorithm")) for one in reference.iterfind(f"{DS}Transforms/{DS}Transform")]
    canonical = [one for one in transforms if one in CANONICAL]
    nested = any(len(one) for one in reference.iterfind(f"{DS}Transforms/{DS}Transform"))  # as an XPath has it
    return sorted(transforms) == sorted([*further, *canonical]) and len(canonical) <= 1 and not nested


def _own(element: _Element, references: list[_Element]) -> bool:
    """Whether all but the root that is referred to are parts of the signature, each by a name that nothing else has."""
    inner = (element.find(f"{DS}KeyInfo"), element.find(PROPERTIES))
    parts = {part.get("Id") for part in inner if part is not None}
    root = element.getroottree().getroot()
    attributes = [(str(key), str(value)) for one in root.iter() for key, value in one.attrib.items()]
    names = [value for key, value in attributes if key.rpartition("}")[2].lower() == "id"]
    named = [str(one.get("URI"))[1:] for one in references if one.get("URI") != ""]
    by_name = all(one.get("URI") is not None for one in references) and len(set(named)) == len(named)
    covered = element.find(PROPERTIES)
    plain = all(_plain(one) for one in references if one.get("URI") != "")
    return (
        by_name and plain and all(name in parts and names.count(name) == 1 for name in named)
        and (covered is None or covered.get("Id") in named)
    )  # fmt: skip


def _values(element: _Element, path: str, load: Callable[[bytes], T]) -> list[T] | None:
    """What base64 of elements gives; ``None`` where one cannot be read."""
    found: list[T] = []
    try:
        for one in element.iterfind(path):
            plain = "".join((one.text or "").split())
            if base64.b64encode(content := base64.b64decode(plain, validate=True)).decode() != plain:
                return None  # more stands there than is decoded
            value = load(content)
            value.native  # type: ignore[attr-defined]  # noqa: B018 - parsed when it is first asked for
            found.append(value)
    except (ValueError, TypeError, KeyError, binascii.Error):
        return None
    return found


def _certificates(element: _Element) -> list[x509.Certificate]:
    """That the signature carries, the signer's first; none where one cannot be read."""
    from asn1crypto import x509

    load: Callable[[bytes], x509.Certificate] = partial(x509.Certificate.load, strict=True)
    return _values(element, f"{DS}KeyInfo/{DS}X509Data/{DS}X509Certificate", load) or []


def _evidence(element: _Element) -> Evidence | None:
    """What was added about certificates and their revocation (EN 319 132-1, 5.4); ``None`` where it cannot be read."""
    from asn1crypto import crl, ocsp, x509

    from cmm_uq.certificate.sign.chain import Evidence

    places = {
        f"{XADES}CertificateValues/{XADES}EncapsulatedX509Certificate": x509.Certificate,
        f"{XADES}RevocationValues/{XADES}CRLValues/{XADES}EncapsulatedCRLValue": crl.CertificateList,
        f"{XADES}RevocationValues/{XADES}OCSPValues/{XADES}EncapsulatedOCSPValue": ocsp.OCSPResponse,
    }
    found: list[Any] = [
        _values(element, f"{UNSIGNED}/{place}", partial(sort.load, strict=True)) for place, sort in places.items()
    ]
    return None if None in found else Evidence(*(tuple(each) for each in found))


def _stamp_of_signature(
    element: _Element, evidence: Evidence, trust: Trust
) -> tuple[dt.datetime | None, bool, tuple[cms.SignedData, ...]]:
    """Time of a time stamp over the canonical SignatureValue (EN 319 132-1, 5.3), whether somebody trusted made it, and it."""
    from asn1crypto import cms
    from lxml import etree

    from cmm_uq.certificate.sign.chain import stamped_time

    tokens = _values(element, f"{STAMP}/{XADES}EncapsulatedTimeStamp", partial(cms.ContentInfo.load, strict=True))
    if not tokens:
        return None, False, ()
    method = element.find(f"{STAMP}/{DS}CanonicalizationMethod")
    algorithm = CANONICAL[0] if method is None else str(method.get("Algorithm"))
    if algorithm not in CANONICAL:
        return None, False, ()
    value = etree.tostring(element.find(f"{DS}SignatureValue"), method="c14n", exclusive=algorithm == CANONICAL[2],
                           with_tail=False)  # fmt: skip
    token = tokens[0]["content"]
    return *stamped_time(token, lambda digest: hashlib.new(digest, value).digest(), evidence, trust), (token,)


def _verified(data: bytes, signer: x509.Certificate, references: list[str]) -> bytes:
    """Canonical form of the root that the signature was made over; nothing where it does not fit."""
    from cryptography.exceptions import InvalidSignature, UnsupportedAlgorithm
    from cryptography.x509 import load_der_x509_certificate
    from lxml.etree import LxmlError
    from signxml import DigestAlgorithm, SignatureMethod
    from signxml.exceptions import SignXMLException
    from signxml.xades import XAdESSignatureConfiguration, XAdESVerifier

    try:
        certificate = load_der_x509_certificate(signer.dump())
        config = XAdESSignatureConfiguration(
            location="./", expect_references=len(references),
            signature_methods=frozenset(one for one in SignatureMethod if one.value in METHODS),
            digest_algorithms=frozenset(one for one in DigestAlgorithm if one.value in DIGESTS),
            verification_time=certificate.not_valid_before_utc,  # whether it was in date is judged with its chain
        )  # fmt: skip
        results = XAdESVerifier().verify(data, x509_cert=certificate, expect_config=config)
    except (SignXMLException, InvalidSignature, UnsupportedAlgorithm, LxmlError, ValueError, TypeError, KeyError):
        return b""
    return bytes(results[references.index("")].signed_data)


def _time(element: _Element) -> dt.datetime | None:
    """When the signer says that it was signed; a time without its zone is none."""
    said = element.findtext(f"{PROPERTIES}/{XADES}SignedSignatureProperties/{XADES}SigningTime", "")
    try:
        time = dt.datetime.fromisoformat(said.strip())
    except ValueError:
        return None
    return time.astimezone(dt.UTC) if time.tzinfo else None
