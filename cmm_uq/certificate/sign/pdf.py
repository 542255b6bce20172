"""PDF signed by PAdES, a revision appended that leaves every byte before it as it is; and the signatures of a PDF.

The date of the metadata stays that of the document; the same document, key and time give the same bytes at level B-B. Of each
signature is found which revision it covers, what was appended after it, and its level.
"""

from __future__ import annotations

import datetime as dt
import io
import os
import re
from typing import TYPE_CHECKING, Any, Literal, get_args

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.files.limits import SIGNED_BYTES
from cmm_uq.base.messages import Text, Verbatim, commas, plural, say
from cmm_uq.base.values import dataclass, field, replace
from cmm_uq.certificate.sign.found import BROKEN, STAMP_BROKEN, WEAK, FileSignature, Trust, appending, installed, ran
from cmm_uq.certificate.sign.signer import ONE_DIGEST, Signer

if TYPE_CHECKING:
    from pyhanko.pdf_utils.incremental_writer import IncrementalPdfFileWriter
    from pyhanko.pdf_utils.reader import PdfFileReader
    from pyhanko.sign.signers import PdfSigner
    from pyhanko.sign.validation.pdf_embedded import EmbeddedPdfSignature

    from cmm_uq.certificate.sign.chain import Evidence

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
    server = None if stamping is None or stamping.level == "B-B" else Server(stamping.server)
    pdf_signer = signers.PdfSigner(metadata, Adapted(signer), timestamper=server, stamp_style=NoOpStampStyle())
    return ran(_signed(pdf_signer, writer, signer, stamping if server else None, at))


async def _signed(
    pdf_signer: PdfSigner, writer: IncrementalPdfFileWriter, signer: Signer, stamping: Stamping | None, at: dt.datetime
) -> bytes:
    """Signed with a time stamp, if any, and what else the level asks for, whose proof is fetched before."""
    from pyhanko.sign.signers.pdf_cms import PdfCMSSignedAttributes

    from cmm_uq.certificate.sign.pdf_library import proof_of, stamped, with_proof

    server, lasting = pdf_signer.default_timestamper, stamping is not None and stamping.level in ("B-LT", "B-LTA")
    proof = await proof_of(signer, server, stamping.trust, at) if stamping and lasting else None
    session = pdf_signer.init_signing_session(writer)
    session.system_time = at
    room = await session.estimate_signature_container_size(None)
    document = session.prepare_tbs_document(None, room)
    digest, output = document.digest_tbs_document()
    await document.perform_signature(digest.document_digest, PdfCMSSignedAttributes(signing_time=at))
    if stamping and proof:
        further = with_proof(output.getvalue(), *proof)
        if stamping.level == "B-LTA":
            return await stamped(further, server)
        output = io.BytesIO()
        further.write(output)
    return bytes(output.getvalue())


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


DIGESTS = frozenset({"sha256", "sha384", "sha512"})
MECHANISMS = frozenset({"rsassa_pkcs1v15", "rsassa_pss", "ecdsa"})
PADES = "/ETSI.CAdES.detached"
UNREADABLE = say("the signature cannot be read")
NO_PADES = say("the signature is no PAdES signature")
BEHIND = say("bytes stand behind it that belong to no revision of the file")
STAMP_ELSE = say(
    "what stands behind it is not a time stamp alone that fits, is of somebody trusted and says nothing else"
)
_TOLD = 6  # kinds of objects that a message names


def signatures_of_pdf(data: bytes, trust: Trust, *, where: str = "the PDF") -> tuple[FileSignature, ...]:
    """Every signature in a PDF, in the order in which they were made; time stamps of the document count with these."""
    with installed():
        from pyhanko.pdf_utils.reader import PdfFileReader
    if len(data) > SIGNED_BYTES.most:
        raise CmmUqError(f"is larger than the {SIGNED_BYTES.most} bytes that are read of such a file", where=where,
                         fix="Check that it is the right file")  # fmt: skip
    try:
        reader = PdfFileReader(io.BytesIO(data))
        embedded = reader.embedded_signatures
        evidence = _evidence(reader)
    except Exception as error:  # whatever a hostile file makes the library raise
        raise CmmUqError(
            f"cannot be read as a PDF: {str(error).rstrip('.')}", where=where, fix="Name a PDF that is whole"
        ) from None
    file = _File(data, reader, tuple(embedded), evidence, trust)
    found = []
    for signature in embedded:
        if not _is_stamp(signature):
            try:
                found.append(_judged(file, signature))
            except Exception:  # whatever a hostile file makes the library raise
                found.append(FileSignature("PDF", (UNREADABLE,)))
    return tuple(found)


@dataclass(frozen=True)
class _File:
    data: bytes
    reader: PdfFileReader
    embedded: tuple[EmbeddedPdfSignature, ...]
    evidence: Evidence
    trust: Trust


def _judged(file: _File, embedded: EmbeddedPdfSignature) -> FileSignature:
    from pyhanko.sign.validation.generic_cms import message_imprint_checker

    from cmm_uq.certificate.sign.chain import judged, stamped_time

    signed = [one.signed_data for one in file.embedded]
    tokens = [token for one in file.embedded if (token := _token(one)) is not None]
    certificates = (*file.evidence.certificates, *embedded.other_embedded_certs)
    evidence = replace(file.evidence, certificates=certificates, others=(*signed, *tokens))
    token, imprint = _token(embedded), message_imprint_checker(embedded.signer_info)
    stamped, proven = (None, False) if token is None else stamped_time(token, imprint, evidence, file.trust)
    at = stamped
    if not proven:  # what the signer says; a time without its zone is none
        claimed = embedded.self_reported_timestamp
        at = claimed.astimezone(dt.UTC) if claimed is not None and claimed.tzinfo is not None else None
    intact, problems = _intact(file, embedded)
    if stamped is None and token is not None:
        problems.append(STAMP_BROKEN)
    whole, appended = _whole(file, embedded)
    if embedded.sig_object.get("/SubFilter") != PADES:
        problems.append(NO_PADES)
    revision = file.data[: int(embedded.byte_range[2]) + int(embedded.byte_range[3])]
    own = FileSignature("", (*problems, *appended), time=at, time_proven=proven, intact=intact)
    reason, content = str(embedded.sig_object.get("/Reason", "")), revision if intact else b""
    own = replace(own, covers_whole_file=intact and whole, reason=reason, content=content)
    found = judged(own, embedded.signer_cert, evidence, file.trust)
    return replace(found, level=f"PAdES B-{_level(file, embedded, stamped, known=found.revocation == 'good')}")


def _intact(file: _File, embedded: EmbeddedPdfSignature) -> tuple[bool, list[Text]]:
    """Whether what was signed is what is there, and what is wrong."""
    from pyhanko.sign.validation.errors import SignatureValidationError
    from pyhanko.sign.validation.generic_cms import cms_basic_validation
    from pyhanko.sign.validation.settings import KeyUsageConstraints
    from pyhanko_certvalidator import ValidationContext

    algorithm = embedded.signer_info["signature_algorithm"]
    if embedded.md_algorithm not in DIGESTS or algorithm.signature_algo not in MECHANISMS:
        return False, [WEAK]
    if not _fits(file.data, embedded):
        return False, [BROKEN]
    nobody = ValidationContext(trust_roots=[], allow_fetching=False)  # who signed is judged elsewhere
    try:
        status = ran(
            cms_basic_validation(embedded.signed_data, raw_digest=embedded.compute_digest(), validation_context=nobody,
                                 key_usage_settings=KeyUsageConstraints(key_usage=set()))
        )  # fmt: skip
    except SignatureValidationError:
        return False, [BROKEN]
    good = bool(status["intact"] and status["valid"])
    return good, [] if good else [BROKEN]


def _fits(data: bytes, embedded: EmbeddedPdfSignature) -> bool:
    """Whether all is covered from the first byte on but for the signature itself, and that holds nothing else."""
    first, before, second, after = (int(each) for each in embedded.byte_range)
    gap = data[before:second]
    if first or len(embedded.byte_range) != 4 or second + after > len(data) or gap[:1] != b"<" or gap[-1:] != b">":
        return False
    try:
        held = bytes.fromhex(gap[1:-1].decode("ascii"))
    except ValueError:
        return False
    signature = embedded.signed_data
    alone = held.rstrip(b"\0") == embedded.pkcs7_content.rstrip(b"\0") and not any(held[_length(held) :])
    return alone and bool(signature)


def _length(der: bytes) -> int:
    """Bytes of the first DER value."""
    short = der[1]
    if short < 0x80:
        return 2 + short
    size = short & 0x7F
    return 2 + size + int.from_bytes(der[2 : 2 + size], "big")


def _whole(file: _File, embedded: EmbeddedPdfSignature) -> tuple[bool, list[Text]]:
    """Whether only time stamps, evidence and further signatures were appended, and else what."""
    from pyhanko.sign.diff_analysis import DiffResult, ModificationLevel

    from cmm_uq.certificate.sign import pdf_library as library

    # whether a further signature, whose signer is judged as well, covers what was appended after this one
    later = any(one.signed_revision > embedded.signed_revision for one in file.embedded if not _is_stamp(one))
    most = ModificationLevel.FORM_FILLING if later else ModificationLevel.LTA_UPDATES
    embedded.compute_integrity_info(diff_policy=library.POLICY if later else library.LASTING)
    result, allowed = embedded.diff_result, embedded.summarise_integrity_info()["docmdp_ok"]
    revisions = range(embedded.signed_revision + 1, file.reader.total_revisions)
    end = int(embedded.byte_range[2]) + int(embedded.byte_range[3])
    places = (library.places_of(file.reader, one) for one in revisions)
    if not later and library.unaccounted(file.data, end, places):
        return False, [BEHIND]
    empty = [one for one in revisions if not file.reader.xrefs.explicit_refs_in_revision(one)]
    if isinstance(result, DiffResult) and result.modification_level <= most and allowed and not empty:
        stamps = () if later else [one for one in file.embedded if one.signed_revision in revisions]
        alone = later or library.is_all_of_stamps(file.reader, embedded.signed_revision)
        alone &= all(_fits(file.data, one) and library.is_good_stamp(one, file.evidence, file.trust) for one in stamps)
        return (True, []) if alone else (False, [STAMP_ELSE])
    count = file.reader.total_revisions - 1 - embedded.signed_revision
    if not count:  # what does not fit is the signed revision itself
        return False, []
    changed = commas([Verbatim(name) for name in _changed(file.reader, embedded.signed_revision)])
    return False, [
        plural(count, one=say("{count} revision was appended after it, and changes {what}", count=count, what=changed),
               many=say("{count} revisions were appended after it, and change {what}", count=count, what=changed))
    ]  # fmt: skip


def _is_stamp(embedded: EmbeddedPdfSignature) -> bool:
    return bool(embedded.sig_object.get("/Type") == "/DocTimeStamp")


def _changed(reader: PdfFileReader, signed: int) -> list[str]:
    """What was added or changed after a revision, by the names that PDF gives its objects."""
    found: dict[str, None] = {}
    for revision in range(signed + 1, reader.total_revisions):
        for reference in sorted(reader.xrefs.explicit_refs_in_revision(revision), key=lambda one: one.idnum):
            held = reader.get_object(reference, revision=revision)
            named: Any = held.get("/Subtype", held.get("/Type", "/Object")) if hasattr(held, "get") else "/Object"
            found[str(named).removeprefix("/")] = None
    names = list(found) or ["Trailer"]
    return [*names[:_TOLD], *(["…"] if len(names) > _TOLD else [])]


def _token(embedded: EmbeddedPdfSignature) -> Any:
    """The time stamp of a signature; ``None`` where it has none."""
    from pyhanko.sign.validation.generic_cms import extract_tst_data_iter

    try:
        return next(extract_tst_data_iter(embedded.signer_info, signed=False), None)
    except KeyError:
        return None


def _evidence(reader: PdfFileReader) -> Evidence:
    """What the store of the document holds, and it holds nothing else (ISO 32000-2, 12.8.4.3)."""
    from asn1crypto import crl, ocsp, x509

    from cmm_uq.certificate.sign.chain import Evidence

    def inner(held: Any, key: str, otherwise: Any) -> Any:
        return held[key] if key in held else otherwise  # noqa: SIM401 - get() of the library follows no references

    store = inner(reader.root, "/DSS", {})
    sorts = {"/Certs": x509.Certificate, "/CRLs": crl.CertificateList, "/OCSPs": ocsp.OCSPResponse}
    listed = {key: list(inner(store, key, [])) for key in sorts}
    for entry in (one.get_object() for one in inner(store, "/VRI", {}).values()):
        if not re.fullmatch(r"[0-9DZ:+'-]*", str(inner(entry, "/TU", ""))):
            raise ValueError("a time of the store is none")
        for key in entry.keys() - {"/Type", "/TU"}:
            if not {str(one) for one in entry[key]} <= {str(one) for one in listed.get(f"{key}s", ())}:
                raise ValueError(f"{key} of one signature is not in the store of the document")
    streams = {key: [one.get_object() for one in kept] for key, kept in listed.items()}
    if any(set(one) - {"/Length", "/Filter"} for kept in streams.values() for one in kept):
        raise ValueError("a stream of a certificate says more than the certificate")
    return Evidence(*(tuple(sort.load(one.data, strict=True) for one in streams[key]) for key, sort in sorts.items()))


def _level(file: _File, embedded: EmbeddedPdfSignature, stamped: dt.datetime | None, *, known: bool) -> str:
    """B, T, LT or LTA (ETSI EN 319 142-1), as far as it holds."""
    from cmm_uq.certificate.sign.chain import stamped_time

    if stamped is None:
        return "B"
    if not known or not (file.evidence.revocations or file.evidence.answers):
        return "T"
    later = [one for one in file.embedded if _is_stamp(one) and one.signed_revision > embedded.signed_revision]
    archived = any(stamped_time(one.signed_data, one.compute_digest, file.evidence, file.trust)[1] for one in later)
    return "LTA" if archived else "LT"
