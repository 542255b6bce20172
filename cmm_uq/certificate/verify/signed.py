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
    if given.pdf is not None:
        name, pdf = given.pdf
        signed: Sequence[FileSignature] = ()
        if pdf.signatures:
            from cmm_uq.certificate.sign import Trust, signatures_of_pdf

            try:
                signed = signatures_of_pdf(pdf.content, trust or Trust(), where=name)
            except NotInstalledError as error:
                inquiry.left("electronic signatures", f"{error.problem}. {error.fix}")
                return
        elif len(pdf.ends) > 1:
            inquiry.wrong(
                "signatures", name, f"byte {pdf.ends[0]}", "was changed after it was made, and nobody signed that"
            )
        _all(inquiry, name, signed, trust)
    if given.xml is not None:
        name, content = given.xml
        signed = ()
        if _OPENING in content:
            from cmm_uq.certificate.sign import Trust, signatures_of_xml

            try:
                signed = signatures_of_xml(content, trust or Trust(), where=name)
            except NotInstalledError as error:
                inquiry.left("electronic signatures", f"{error.problem}. {error.fix}")
                return
        if signed or not given.digital_inside:  # what is inside a signed PDF is signed with it
            _all(inquiry, name, signed, trust)


def _all(inquiry: Inquiry, name: str, signed: Sequence[FileSignature], trust: Trust | None) -> None:
    inquiry.looked("signatures", len(signed))
    if not signed:
        if trust is not None:
            inquiry.wrong("signatures", name, "", "carries no signature, and --trust asks for one")
        else:
            inquiry.notes.append(f"{name} carries no electronic signature: who issued it is not shown.")
    for number, one in enumerate(signed, 1):
        _one(inquiry, name, f"signature {number}", one, trust)


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
    if one.test_key:
        note = str.__str__(TEST_NOTE)
        if trust is None:
            inquiry.left(f"who signed {name}", note)
        else:
            inquiry.wrong("signatures", name, place, note)
