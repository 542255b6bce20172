"""XML signed by XAdES B-B: one signature over the whole root, enveloped, in the place where a DCC has it, its last element.

The same file, key and time give the same bytes.
"""

from __future__ import annotations

import datetime as dt
import hashlib
from typing import TYPE_CHECKING, Any

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.messages import Text, say
from cmm_uq.certificate.sign.extra import installed
from cmm_uq.certificate.sign.signer import Signer
from cmm_uq.certificate.sign.xml_read import SIGNATURE, root_of

if TYPE_CHECKING:
    from lxml.etree import _Element

COMMENT = say("the file has a comment, which no signature covers")
INSTRUCTION = say("the file has a processing instruction, which no signature covers")

_LETTERS = 16
"""Of a name that is taken from the file's hash, so that no other element has it."""


def sign_xml(xml: bytes, signer: Signer, *, at: dt.datetime, where: str = "the XML file") -> bytes:
    """An XML file with a signature.

    Parameters
    ----------
    xml : the file; a signature would cover no other beside it, so that it must have none.
    signer : who signs.
    at : time of signing, with its zone.
    where : its name, for messages.

    Raises
    ------
    CmmUqError : it cannot be read, is signed already, has what no signature covers, or the key must not sign at this time.
    """
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

    class Stated(XAdESSigner):  # type: ignore[misc]
        """Takes time and names from what is signed, where the library reads the clock and draws them."""

        def add_signing_time(self, signed_signature_properties: _Element, sig_root: Any, signing_settings: Any) -> None:
            element = etree.SubElement(signed_signature_properties, "{http://uri.etsi.org/01903/v1.3.2#}SigningTime")
            element.text = at.astimezone(dt.UTC).strftime("%Y-%m-%dT%H:%M:%SZ")

        def _get_token(self, length: int = 4) -> str:
            count = len(self._tokens_used)
            token = hashlib.sha256(xml + bytes((count,))).hexdigest()[:_LETTERS]
            self._tokens_used[token] = True
            return token

    stated = Stated(
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
