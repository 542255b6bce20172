"""Electronic signatures of PDF and XML: intact, over the whole file, of somebody trusted, and not by a key for trying.

Whom one trusts is said by the reader; without, a signature that is intact shows that nothing was changed since, not by whom.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from cmm_uq.base.errors import NotInstalledError
from cmm_uq.certificate.verify.found import Inquiry
from cmm_uq.certificate.verify.given import Given

if TYPE_CHECKING:
    from cmm_uq.certificate.sign import FileSignature, Trust

_OPENING = b"http://www.w3.org/2000/09/xmldsig#"


def check_signatures(inquiry: Inquiry, given: Given, trust: Trust | None) -> None:
    """Keep what is wrong; ``trust``: ``None`` where nobody said whom the reader trusts, and then nothing need be signed."""
    from cmm_uq.certificate import sign

    held = trust or sign.Trust()
    try:
        if given.pdf is not None:
            name, pdf = given.pdf
            if not pdf.signatures and len(pdf.ends) > 1:
                problem = "was changed after it was made, and nobody signed that"
                inquiry.wrong("signatures", name, f"byte {pdf.ends[0]}", problem)
            _all(inquiry, name, sign.signatures_of_pdf(pdf.content, held, where=name) if pdf.signatures else (), trust)
        if given.xml is not None:
            name, content = given.xml
            signed = sign.signatures_of_xml(content, held, where=name) if _OPENING in content else ()
            if signed or not given.digital_inside:  # what is inside a signed PDF is signed with it
                _all(inquiry, name, signed, trust)
    except NotInstalledError as error:
        inquiry.left("electronic signatures", f"{error.problem}. {error.fix}")


def _all(inquiry: Inquiry, name: str, signed: Sequence[FileSignature], trust: Trust | None) -> None:
    inquiry.looked("signatures", len(signed))
    if not signed and trust is not None:
        inquiry.wrong("signatures", name, "", "carries no signature, and --trust asks for one")
    elif not signed:
        inquiry.notes.append(f"{name} carries no electronic signature: who issued it is not shown.")
    for number, signature in enumerate(signed, 1):
        _one(inquiry, name, f"signature {number}", signature, trust)


def _one(inquiry: Inquiry, name: str, place: str, one: FileSignature, trust: Trust | None) -> None:
    from cmm_uq.certificate.sign import TEST_NOTE
    from cmm_uq.certificate.sign.chain import NOBODY

    at = "at no time that it says" if one.time is None else f"on {one.time:%Y-%m-%d %H:%M} UTC"
    who = f"{name}: {one.level} by {one.name or 'nobody'}, {at}{'' if one.time_proven else ' by the signer himself'}"
    inquiry.notes.append(f"{who}; revocation: {one.revocation}.")
    for problem in one.problems:
        if problem == NOBODY and trust is None:
            inquiry.left(f"who signed {name}", "no trust anchors were given (--trust)")
        else:
            inquiry.wrong("signatures", name, place, str.__str__(problem))
    if not one.problems and not (one.intact and one.covers_whole_file and (one.trusted or trust is None)):
        inquiry.wrong("signatures", name, place, "does not hold")
    if one.test_key and trust is None:
        inquiry.left(f"who signed {name}", str.__str__(TEST_NOTE))
    elif one.test_key:
        inquiry.wrong("signatures", name, place, str.__str__(TEST_NOTE))
