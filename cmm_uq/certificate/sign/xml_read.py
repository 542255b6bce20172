"""XML from elsewhere, read without entities, document types or a network, up to a size."""

from __future__ import annotations

from typing import TYPE_CHECKING

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.files.limits import SIGNED_BYTES
from cmm_uq.certificate.sign.extra import installed

if TYPE_CHECKING:
    from lxml.etree import _Element

DS, XADES = "{http://www.w3.org/2000/09/xmldsig#}", "{http://uri.etsi.org/01903/v1.3.2#}"
SIGNATURE = f"{DS}Signature"


def root_of(data: bytes, where: str) -> _Element:
    """The root of an XML file.

    Parameters
    ----------
    data : the file.
    where : its name, for messages.

    Raises
    ------
    CmmUqError : it is no XML, declares a document type, or is too large.
    """
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
