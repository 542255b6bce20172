"""PDF signed by PAdES: a revision appended that leaves every byte before it as it is, tagged and fit for the archive.

The date of the metadata stays that of the document. The same document, key and time give the same bytes at level B-B.
"""

from __future__ import annotations

import datetime as dt
import io
import os
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Literal, get_args

from cmm_uq.base.errors import CmmUqError
from cmm_uq.certificate.sign.found import Trust, appending, installed, ran
from cmm_uq.certificate.sign.signer import ONE_DIGEST, Signer

if TYPE_CHECKING:
    from pyhanko.pdf_utils.incremental_writer import IncrementalPdfFileWriter
    from pyhanko.sign.signers import PdfSigner

FIELD = "Signature"  # names of the fields: Signature1, Signature2, …


@dataclass(frozen=True)
class Seal:
    """What is seen of a signature on the first page."""

    picture: bytes  # a PDF of one page
    places: tuple[tuple[float, float, float, float], ...]  # left, bottom, right, top of each, pt; unseen without
    says: str  # the picture in words, for those who cannot see it


Level = Literal["B-B", "B-T", "B-LT", "B-LTA"]
"""Of ETSI EN 319 142-1: signed; and stamped by a server; with what proves the certificates; and that stamped, too."""

LEVELS: tuple[Level, ...] = get_args(Level)


@dataclass(frozen=True)
class Stamping:
    """What a level above B-B needs."""

    server: str  # address of a time stamp server
    level: Level = "B-T"  # B-T, B-LT or B-LTA
    trust: Trust = field(default_factory=Trust)  # whom the chains of signer and server must lead to, for B-LT and B-LTA

    def __post_init__(self) -> None:
        if not self.server.startswith(("http://", "https://")):
            raise CmmUqError("is no address of a time stamp server", where=self.server,
                             fix="Give one that begins with https://")  # fmt: skip


def sign_pdf(
    pdf: bytes, signer: Signer, *, seal: Seal | None, at: dt.datetime, stamping: Stamping | None = None, reason: str = ""
) -> bytes:  # fmt: skip
    """``seal``: what is seen of the signature, if anything; ``stamping``: of a level above B-B."""
    signer.check(at)
    with installed():
        from pyhanko.sign import fields, signers
        from pyhanko.stamp.noop import NoOpStampStyle

        from cmm_uq.certificate.sign.pdf_library import Adapted, Server, free_name, show, tag
    writer = appending(pdf)
    name, count = free_name(writer, FIELD)
    if seal is not None and count >= len(seal.places):
        seal = None
    said = seal.says if seal else signer.name
    box = seal.places[count] if seal else None
    fields.append_signature_field(writer, fields.SigFieldSpec(name, box=box, readable_field_name=said))
    field = next(reference for _, _, reference in fields.enumerate_sig_fields(writer, with_name=name))
    if seal is not None:
        show(writer, field.get_object(), seal.picture)
    tag(writer, field, said)
    metadata = signers.PdfSignatureMetadata(
        field_name=name, md_algorithm=ONE_DIGEST, subfilter=fields.SigSeedSubFilter.PADES, name=signer.name,
        reason=reason or None,
    )  # fmt: skip
    adapted, style = Adapted(signer), NoOpStampStyle()
    if stamping is None or stamping.level == "B-B":
        return ran(_signed(signers.PdfSigner(metadata, adapted, stamp_style=style), writer, at))
    pdf_signer = signers.PdfSigner(metadata, adapted, timestamper=Server(stamping.server), stamp_style=style)
    return ran(_stamped(pdf_signer, writer, signer, stamping, at))


async def _signed(pdf_signer: PdfSigner, writer: IncrementalPdfFileWriter, at: dt.datetime) -> bytes:
    from pyhanko.sign.signers.pdf_cms import PdfCMSSignedAttributes

    session = pdf_signer.init_signing_session(writer)
    session.system_time = at
    room = await session.estimate_signature_container_size(None)
    document = session.prepare_tbs_document(None, room)
    digest, output = document.digest_tbs_document()
    await document.perform_signature(digest.document_digest, PdfCMSSignedAttributes(signing_time=at))
    output.seek(0)
    return bytes(output.read())


async def _stamped(
    pdf_signer: PdfSigner, writer: IncrementalPdfFileWriter, signer: Signer, stamping: Stamping, at: dt.datetime
) -> bytes:  # fmt: skip
    """Signed with a time stamp, and what else the level asks for."""
    from cmm_uq.certificate.sign.pdf_library import Proof, stamped

    server = pdf_signer.default_timestamper
    if stamping.level == "B-T":
        return await _signed(pdf_signer, writer, at)
    proof = Proof(signer, server, stamping.trust, at)
    await proof.gather()
    kept = proof.kept(await _signed(pdf_signer, writer, at))
    if stamping.level == "B-LTA":
        return await stamped(kept, server)
    output = io.BytesIO()
    kept.write(output)
    return output.getvalue()


EPOCH = "SOURCE_DATE_EPOCH"


def signing_time() -> dt.datetime:
    """Whole seconds, in UTC."""
    given = os.environ.get(EPOCH, "")
    if not given:
        return dt.datetime.now(dt.UTC).replace(microsecond=0)
    try:
        return dt.datetime.fromtimestamp(int(given), dt.UTC)
    except (ValueError, OverflowError, OSError):
        raise CmmUqError(f"{given!r} is no number of seconds since 1970", where=EPOCH, fix="Mend or unset it") from None
