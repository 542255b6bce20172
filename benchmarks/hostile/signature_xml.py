"""Attacks on XML signatures: wrapping, other references and methods, and what is put where no signature covers it."""

from __future__ import annotations

import base64
import hmac
import random
from collections.abc import Callable
from hashlib import sha1, sha256

from asn1crypto import algos, tsp
from cryptography.hazmat.primitives import hashes
from cryptography.hazmat.primitives.asymmetric import ec
from cryptography.hazmat.primitives.asymmetric.utils import decode_dss_signature
from cryptography.hazmat.primitives.serialization import Encoding, PublicFormat
from lxml import etree

from benchmarks.hostile.authorities import STAMPED, World
from tests.certificate.sign.authority import Held, curve_key, issued, root
from tests.certificate.sign.responders import revocations, stamps, status
from tests.certificate.sign.test_xml import ATTACKS as STRUCTURE

DS, XADES = "{http://www.w3.org/2000/09/xmldsig#}", "{http://uri.etsi.org/01903/v1.3.2#}"
QUALIFYING = f"{DS}Object/{XADES}QualifyingProperties"
MORE = "http://www.w3.org/2001/04/xmldsig-more#"
Attack = Callable[[World, random.Random], bytes]


def _element(signed: bytes) -> tuple[etree._Element, etree._Element]:
    found = etree.fromstring(signed)
    return found, found[-1]


def _written(found: etree._Element) -> bytes:
    return bytes(etree.tostring(found.getroottree(), encoding="UTF-8", xml_declaration=True))


def _resigned(
    found: etree._Element, key: ec.EllipticCurvePrivateKey, digest: hashes.HashAlgorithm | None = None
) -> bytes:
    """SignedInfo signed anew, as whoever holds the key does."""
    info = etree.tostring(found[-1].find(f"{DS}SignedInfo"), method="c14n")
    r, s = decode_dss_signature(key.sign(info, ec.ECDSA(digest or hashes.SHA256())))
    size = (key.curve.key_size + 7) // 8
    found[-1].find(f"{DS}SignatureValue").text = base64.b64encode(
        r.to_bytes(size, "big") + s.to_bytes(size, "big")
    ).decode()
    return _written(found)


def _der(held: Held) -> str:
    return base64.b64encode(held.certificate.public_bytes(Encoding.DER)).decode()


def hmac_of_the_public_key(world: World, rng: random.Random) -> bytes:
    """A method of secret keys, with what everybody has for the secret."""
    found, signature = _element(world.signed("xml"))
    found[1][0].text = "53.2"
    signature.find(f"{DS}SignedInfo/{DS}SignatureMethod").set("Algorithm", f"{MORE}hmac-sha256")
    public = world.signer.certificate.public_key()
    secret = rng.choice((public.public_bytes(Encoding.DER, PublicFormat.SubjectPublicKeyInfo),
                         world.signer.certificate.public_bytes(Encoding.DER), world.signer.pem, b""))  # fmt: skip
    info = etree.tostring(signature.find(f"{DS}SignedInfo"), method="c14n")
    signature.find(f"{DS}SignatureValue").text = base64.b64encode(hmac.digest(secret, info, "sha256")).decode()
    return _written(found)


def sha_1_by_the_signer(world: World, rng: random.Random) -> bytes:
    """Method, digest or both of SHA-1, signed by the true key."""
    found, signature = _element(world.signed("xml"))
    which = rng.choice(("method", "digest"))
    if which == "method":
        signature.find(f"{DS}SignedInfo/{DS}SignatureMethod").set("Algorithm", f"{MORE}ecdsa-sha1")
        return _resigned(found, world.signer.key, hashes.SHA1())
    reference = next(one for one in signature.iter(f"{DS}Reference") if one.get("URI") == "")
    reference.find(f"{DS}DigestMethod").set("Algorithm", f"{DS[1:-1]}sha1")
    plain = etree.fromstring(world.signed("xml"))
    plain.remove(plain[-1])
    reference.find(f"{DS}DigestValue").text = base64.b64encode(
        sha1(etree.tostring(plain, method="c14n")).digest()
    ).decode()
    return _resigned(found, world.signer.key)


def a_transform_by_the_signer(world: World, rng: random.Random) -> bytes:
    """Style sheets and filters, also signed by the true key."""
    found, signature = _element(world.signed("xml"))
    kind = rng.choice((
        "http://www.w3.org/TR/1999/REC-xslt-19991116", "http://www.w3.org/TR/1999/REC-xpath-19991116",
        "http://www.w3.org/2002/06/xmldsig-filter2", "http://www.w3.org/2000/09/xmldsig#base64",
        "http://www.w3.org/TR/2001/REC-xml-c14n-20010315#WithComments",
    ))  # fmt: skip
    transforms = next(one for one in signature.iter(f"{DS}Transforms"))
    transforms.insert(rng.randrange(len(transforms) + 1), etree.Element(f"{DS}Transform", Algorithm=kind))
    return _resigned(found, world.signer.key)


def a_reference_elsewhere_by_the_signer(world: World, rng: random.Random) -> bytes:
    found, signature = _element(world.signed("xml"))
    reference = next(one for one in signature.iter(f"{DS}Reference") if one.get("URI") == "")
    uri = rng.choice(
        ("file:///etc/hostname", "http://127.0.0.1:9/a.xml", "#a", "#xpointer(/)", "a.xml", "#xpointer(id('a'))")
    )
    change = rng.choice(("instead", "besides"))
    if change == "instead":
        reference.set("URI", uri)
    else:
        more = etree.fromstring(etree.tostring(reference))
        more.set("URI", uri)
        reference.addnext(more)
    return _resigned(found, world.signer.key)


def the_same_id_twice(world: World, rng: random.Random) -> bytes:
    found, signature = _element(world.signed("xml"))
    name = rng.choice([one.get("Id") for one in signature.iter() if one.get("Id")])
    key = rng.choice(("Id", "ID", "id", "{http://www.w3.org/XML/1998/namespace}id"))
    etree.SubElement(rng.choice((found[0], found[1])), "x").set(key, name)
    return _resigned(found, world.signer.key) if rng.random() < 0.5 else _written(found)


def a_value_altered_and_its_digest(world: World, rng: random.Random) -> bytes:
    """With the digest of the new content; signed by nobody, or by a key of one's own under the true certificate."""
    found, signature = _element(world.signed("xml"))
    found[1][0].text = f"{rng.randrange(10, 99)}.{rng.randrange(10)}"
    plain = etree.fromstring(etree.tostring(found))
    plain.remove(plain[-1])
    reference = next(one for one in signature.iter(f"{DS}Reference") if one.get("URI") == "")
    reference.find(f"{DS}DigestValue").text = base64.b64encode(
        sha256(etree.tostring(plain, method="c14n")).digest()
    ).decode()
    return _resigned(found, curve_key()) if rng.random() < 0.5 else _written(found)


def _stranger(rng: random.Random) -> Held:
    name = f"U = 0.{rng.randrange(1, 10)} µm"
    return rng.choice((root(name), issued(name, curve_key()), issued(name, curve_key(), root("Somebody"))))


def a_certificate_of_no_chain(world: World, rng: random.Random) -> bytes:
    found, signature = _element(world.signed("xml"))
    data = signature.find(f"{DS}KeyInfo/{DS}X509Data")
    more = etree.Element(f"{DS}X509Certificate")
    more.text = _der(_stranger(rng))
    data.insert(rng.randrange(len(data) + 1), more)
    return _written(found) if rng.random() < 0.5 else _again(found, world)


def _again(found: etree._Element, world: World) -> bytes:
    """Where the signature covers it: the digest of what was changed, signed by the true key, who need not have looked."""
    signature = found[-1]
    for reference in signature.iter(f"{DS}Reference"):
        name = str(reference.get("URI"))[1:]
        part = next((one for one in signature.iter() if name and one.get("Id") == name), None)
        if part is not None:
            digest = sha256(etree.tostring(part, method="c14n", with_tail=False)).digest()
            reference.find(f"{DS}DigestValue").text = base64.b64encode(digest).decode()
    return _resigned(found, world.signer.key)


def _stamped(world: World, inside: str, held: Held | None = None) -> bytes:
    found, signature = _element(world.signed("xml"))
    value = etree.tostring(signature.find(f"{DS}SignatureValue"), method="c14n", with_tail=False)
    imprint = {
        "hash_algorithm": algos.DigestAlgorithm({"algorithm": "sha256"}),
        "hashed_message": sha256(value).digest(),
    }
    asked = tsp.TimeStampReq({"version": 1, "message_imprint": imprint, "cert_req": True}).dump()
    _, _, answer = stamps(held or world.stamper, STAMPED)(asked)
    token = base64.b64encode(tsp.TimeStampResp.load(answer)["time_stamp_token"].dump()).decode()
    stamp = f"<SignatureTimeStamp><EncapsulatedTimeStamp>{token}</EncapsulatedTimeStamp></SignatureTimeStamp>"
    signature.find(QUALIFYING).append(etree.fromstring(
        f'<UnsignedProperties xmlns="{XADES[1:-1]}"><UnsignedSignatureProperties>{stamp}{inside}'
        "</UnsignedSignatureProperties></UnsignedProperties>"
    ))  # fmt: skip
    return _written(found)


def _encapsulated(kind: str, *contents: bytes) -> str:
    return "".join(f"<{kind}>{base64.b64encode(one).decode()}</{kind}>" for one in contents)


def a_value_of_no_chain(world: World, rng: random.Random) -> bytes:
    content = _stranger(rng).certificate.public_bytes(Encoding.DER)
    return _stamped(
        world, f"<CertificateValues>{_encapsulated('EncapsulatedX509Certificate', content)}</CertificateValues>"
    )


def a_list_of_nobody(world: World, rng: random.Random) -> bytes:
    """Of an issuer who is unknown, or of the name of one who is known."""
    other = root("Test Root" if rng.random() < 0.5 else f"U = 0.{rng.randrange(1, 10)} µm")
    true = [revocations(world.between)] if rng.random() < 0.5 else []
    lists = [*true, revocations(other)]
    rng.shuffle(lists)
    inside = _encapsulated("EncapsulatedCRLValue", *lists)
    return _stamped(world, f"<RevocationValues><CRLValues>{inside}</CRLValues></RevocationValues>")


def an_answer_of_nobody(world: World, rng: random.Random) -> bytes:
    """Of a responder who is unknown, about the signer or about somebody else."""
    from cryptography.x509 import ocsp

    other = root()
    about = world.signer if rng.random() < 0.5 else issued("B", curve_key(), other)
    builder = ocsp.OCSPRequestBuilder().add_certificate(about.certificate, other.certificate, hashes.SHA1())
    _, _, answer = status(other, about)(builder.build().public_bytes(Encoding.DER))
    inside = _encapsulated("EncapsulatedOCSPValue", answer)
    return _stamped(world, f"<RevocationValues><OCSPValues>{inside}</OCSPValues></RevocationValues>")


def text_somewhere_in_the_signature(world: World, rng: random.Random) -> bytes:
    base = world.signed("xml") if rng.random() < 0.5 else _stamped(world, "")
    found, signature = _element(base)
    signed = {one for part in (f"{DS}SignedInfo", f"{QUALIFYING}/{XADES}SignedProperties", f"{DS}KeyInfo")
              for one in signature.find(part).iter()}  # fmt: skip
    place = rng.choice([one for one in signature.iter() if one not in signed])
    how = rng.choice(("text", "tail", "attribute", "child"))
    if how == "text":
        place.text = (place.text or "") + "U = 0.1 µm"
    elif how == "tail" and place is not signature:
        place.tail = (place.tail or "") + "U = 0.1 µm"
    elif how == "attribute":
        place.set(rng.choice(("U", "{urn:u}U", "title")), "0.1 µm")
    else:
        etree.SubElement(place, rng.choice(("U", f"{DS}Object", f"{DS}KeyName", f"{XADES}Any"))).text = "0.1 µm"
    return _written(found)


def text_within_a_comment_or_an_instruction(world: World, rng: random.Random) -> bytes:
    found = etree.fromstring(world.signed("xml"))
    made = rng.choice((etree.Comment("U = 0.1"), etree.ProcessingInstruction("u", "0.1")))
    place = rng.choice([one for one in found.iter() if isinstance(one.tag, str)])
    place.addprevious(made) if place is found or rng.random() < 0.5 else place.append(made)
    return _written(found)


def more_in_base64(world: World, rng: random.Random) -> bytes:
    found, signature = _element(_stamped(world, ""))
    places = [one for one in signature.iter() if one.text and len(one.text.strip()) > 60 and not len(one)]
    place = rng.choice(places)
    place.text = place.text.strip().rstrip("=") + rng.choice(("==VT0wLjE=", "====", "A", "=VT0w", "\u00a0", "#"))
    return _written(found)


def _of_structure(attack: Callable[[bytes], etree._Element]) -> Attack:
    return lambda world, rng: bytes(etree.tostring(attack(world.signed("xml")).getroottree()))


def an_empty_certificate(world: World, rng: random.Random) -> bytes:
    return _stamped(
        world, f"<CertificateValues>{_encapsulated('EncapsulatedX509Certificate', b'')}</CertificateValues>"
    )


XML_ATTACKS: dict[str, Attack] = {f"structure_{one.__name__}": _of_structure(one) for one in STRUCTURE} | {
    one.__name__: one for one in (
        hmac_of_the_public_key, sha_1_by_the_signer, a_transform_by_the_signer, a_reference_elsewhere_by_the_signer,
        the_same_id_twice, a_value_altered_and_its_digest, a_certificate_of_no_chain, a_value_of_no_chain, a_list_of_nobody,
        an_answer_of_nobody, text_somewhere_in_the_signature, text_within_a_comment_or_an_instruction, more_in_base64,
        an_empty_certificate,
    )
}  # fmt: skip
