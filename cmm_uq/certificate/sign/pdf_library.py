"""What the library of PDF signatures is given: a signer, a field, revisions appended, time stamps and evidence for years.

Its policy takes a further signature of a tagged PDF for a change of its structure. The rule here lets the structure grow by
form controls of signatures, at its end, and by nothing else.
"""

from __future__ import annotations

import datetime as dt
import http.client
import io
import re
import urllib.error
import urllib.request
from collections.abc import Iterable
from typing import Any

from asn1crypto import tsp, x509
from asn1crypto.algos import SignedDigestAlgorithm
from cryptography.hazmat.primitives.serialization import Encoding
from pyhanko.pdf_utils import generic
from pyhanko.pdf_utils.incremental_writer import IncrementalPdfFileWriter
from pyhanko.pdf_utils.reader import PdfFileReader
from pyhanko.sign import signers
from pyhanko.sign.diff_analysis import DEFAULT_DIFF_POLICY, ModificationLevel, StandardDiffPolicy
from pyhanko.sign.diff_analysis.rules.file_structure_rules import CatalogModificationRule
from pyhanko.sign.diff_analysis.rules.form_field_rules import DSSCompareRule
from pyhanko.sign.diff_analysis.rules_api import ReferenceUpdate, WhitelistRule
from pyhanko.sign.fields import enumerate_sig_fields
from pyhanko.sign.signers import PdfTimeStamper
from pyhanko.sign.timestamps import TimeStamper, TimestampRequestError
from pyhanko.sign.validation.dss import DocumentSecurityStore
from pyhanko_certvalidator import CertificateValidator, ValidationContext
from pyhanko_certvalidator.errors import PathBuildingError, PathValidationError
from pyhanko_certvalidator.registry import SimpleCertificateStore

from cmm_uq.base.errors import CmmUqError
from cmm_uq.certificate.sign.chain import Evidence, stamped_time
from cmm_uq.certificate.sign.found import Trust, appending
from cmm_uq.certificate.sign.signer import ONE_DIGEST, Signer

_ROOM = 16  # bytes by which two signatures of an ECDSA key may differ in length, as DER


class Adapted(signers.Signer):  # type: ignore[misc]
    """Signs whatever the library gives it with a :class:`~cmm_uq.certificate.sign.signer.Signer`."""

    def __init__(self, signer: Signer) -> None:
        registry = SimpleCertificateStore()
        registry.register_multiple([translated(one) for one in signer.chain])
        mechanism = {"rsa": f"{ONE_DIGEST}_rsa", "ecdsa": f"{ONE_DIGEST}_ecdsa"}[signer.algorithm]
        super().__init__(
            signing_cert=translated(signer.certificate), cert_registry=registry,
            signature_mechanism=SignedDigestAlgorithm({"algorithm": mechanism}),
        )  # fmt: skip
        self.signer = signer

    async def async_sign_raw(self, data: bytes, digest_algorithm: str, dry_run: bool = False) -> bytes:
        """Signature of data; of a rehearsal only its length counts."""
        if dry_run:
            return bytes((self.signer.bits + 7) // 8 * 2 + _ROOM)
        return self.signer.signed(data)


def translated(certificate: Any) -> x509.Certificate:
    """A certificate as the library knows one."""
    return x509.Certificate.load(certificate.public_bytes(Encoding.DER))


def free_name(writer: IncrementalPdfFileWriter, stem: str) -> tuple[str, int]:
    """A name that no field has, and how many fields of signatures there are."""
    taken = {name for name, _, _ in enumerate_sig_fields(writer)}
    return next(name for name in (f"{stem}{i}" for i in range(1, len(taken) + 2)) if name not in taken), len(taken)


def show(writer: IncrementalPdfFileWriter, field: generic.DictionaryObject, picture: bytes) -> None:
    """The page of a PDF in the place of a field, with the fonts that it has embedded."""
    seen = writer.import_page_as_xobject(PdfFileReader(io.BytesIO(picture)))
    field["/AP"] = generic.DictionaryObject({generic.NameObject("/N"): seen})


def tag(writer: IncrementalPdfFileWriter, reference: generic.IndirectObject, says: str) -> None:
    """Put a field into the structure of a tagged PDF as a form control (ISO 14289-1, 7.18.1 and 7.18.4)."""
    field = reference.get_object()
    field["/Contents"] = generic.pdf_string(says)
    root = writer.root["/StructTreeRoot"] if "/StructTreeRoot" in writer.root else generic.DictionaryObject()
    if "/ParentTree" not in root or "/Nums" not in root["/ParentTree"]:
        return  # not tagged, or by a program that lays its tree out in another way
    top = _top(root)
    key, place = generic.NumberObject(int(root["/ParentTreeNextKey"])), top.container_ref
    element = writer.add_object(generic.DictionaryObject({
        generic.NameObject("/Type"): generic.NameObject("/StructElem"),
        generic.NameObject("/S"): generic.NameObject("/Form"),
        generic.NameObject("/P"): generic.IndirectObject(place.idnum, place.generation, place.get_pdf_handler()),
        generic.NameObject("/Alt"): generic.pdf_string(says),
        generic.NameObject("/Pg"): field.raw_get("/P"),
        generic.NameObject("/K"): generic.DictionaryObject({
            generic.NameObject("/Type"): generic.NameObject("/OBJR"),
            generic.NameObject("/Obj"): reference,
            generic.NameObject("/Pg"): field.raw_get("/P"),
        }),
    }))  # fmt: skip
    field["/StructParent"] = key
    _append(writer, top, "/K", element)
    _append(writer, root["/ParentTree"], "/Nums", key, element)
    root["/ParentTreeNextKey"] = generic.NumberObject(int(key) + 1)
    writer.update_container(root)


def _append(
    writer: IncrementalPdfFileWriter, owner: generic.DictionaryObject, key: str, *values: generic.PdfObject
) -> None:
    """Values at the end of a list, wherever that is kept."""
    held = owner[key]
    if not isinstance(held, generic.ArrayObject):
        owner[generic.NameObject(key)] = held = generic.ArrayObject([owner.raw_get(key)])
    held.extend(values)
    writer.update_container(held)
    writer.update_container(owner)


_ELEMENT = {"/Type", "/S", "/P", "/Alt", "/Pg", "/K"}
_GROWING = {"/K", "/ParentTree", "/ParentTreeNextKey"}


class Tagged(WhitelistRule):  # type: ignore[misc]
    """Approves a structure tree that differs by form controls of signatures at its end."""

    def apply(self, old: Any, new: Any) -> Iterable[ReferenceUpdate]:
        """References of what grew, or none where anything else differs."""
        try:
            return [ReferenceUpdate(one) for one in _grown(old, new)]
        except (KeyError, IndexError, TypeError, AttributeError, ValueError):
            return []


_grown_by = Tagged().as_qualified(ModificationLevel.FORM_FILLING)
POLICY = StandardDiffPolicy([*DEFAULT_DIFF_POLICY.global_rules, _grown_by], DEFAULT_DIFF_POLICY.form_rule)
"""For what a further signature covers, whose signer is judged as well."""

_store = DSSCompareRule().as_qualified(ModificationLevel.LTA_UPDATES)
_catalogue = CatalogModificationRule(frozenset({"/AcroForm", "/DSS"}))
LASTING = StandardDiffPolicy([_catalogue, _store], DEFAULT_DIFF_POLICY.form_rule)
"""For what stands behind the last signature: evidence and time stamps, for which no signer vouches."""

_STAMP = {
    "/Type": r"/DocTimeStamp", "/Filter": r"/Adobe\.PPKLite", "/SubFilter": r"/ETSI\.RFC3161", "/Contents": r".*",
    "/ByteRange": r"\[.*\]", "/M": r"D:[0-9Z+'-]*",
}  # fmt: skip
_WIDGET = {
    "/FT": "/Sig", "/T": r"[A-Za-z]+\d*", "/Type": "/Annot", "/Subtype": "/Widget", "/F": r"\d+", "/Rect": r".*",
    "/P": r".*", "/TU": "Timestamp", "/V": r".*",
}  # fmt: skip
"""What a time stamp of the document and its unseen field state, and nothing that could be read (ISO 32000-2, 12.8.5)."""


def is_good_stamp(embedded: Any, evidence: Evidence, trust: Trust) -> bool:
    """Whether a time stamp of the document fits, is of somebody trusted where anybody is, and says nothing besides."""
    pairs = ((embedded.sig_object, _STAMP), (embedded.sig_field, _WIDGET))
    stated = ((form.get(key), str(value)) for held, form in pairs for key, value in held.items())
    plain = all(form is not None and re.fullmatch(form, value, re.DOTALL) for form, value in stated)
    at, proven = stamped_time(embedded.signed_data, embedded.compute_digest, evidence, trust)
    return plain and (proven or (at is not None and not trust.anchors))


_BLANK = b"\0\t\n\f\r "
_WHITE, _STRING = rb"[\0\t\n\f\r ]", rb"\((?:[^()\\]|\\.|\((?:[^()\\]|\\.)*\))*\)"
_TOKEN = re.compile(
    rb"%b+|<<|>>|[\[\]]|<[0-9A-Fa-f\s]*>|/[^\0\t\n\f\r ()<>\[\]{}/%%]*|[+-]?[0-9.]+|true|false|null|R(?![A-Za-z])|%b"
    % (_WHITE, _STRING),
    re.DOTALL,
)
_BEGIN = re.compile(rb"%b*(\d+) (\d+) obj" % _WHITE)
_ENTRIES = rb"(?:\d+ \d+%b*\n(?:\d{10} \d{5} [nf](?: \r| \n|\r\n))*)*" % _WHITE
_TABLE = re.compile(rb"%b*xref%b+%btrailer(?=%b*<<)" % (_WHITE, _WHITE, _ENTRIES, _WHITE))
_END = re.compile(rb"%b*startxref%b+(\d+)%b+%%%%EOF%b*" % ((_WHITE,) * 4))
_TRAILER = re.compile(
    rb"%b*<<(?:%b*(?:/(?:Size|Prev) \d+|/(?:Root|Info) \d+ \d+ R|/ID%b*\[(?:%b*(?:%b|<[0-9A-Fa-f]*>)){2}%b*\]))*%b*>>"
    % (*(_WHITE,) * 4, _STRING, _WHITE, _WHITE),
    re.DOTALL,
)
_STREAM = re.compile(rb"stream\r?\n")
_ENDSTREAM = re.compile(rb"(?:\r\n|\n|\r)?endstream%b*" % _WHITE)


def unaccounted(data: bytes, begin: int, revisions: Iterable[set[tuple[int, int]]]) -> bool:
    """Whether a byte from ``begin`` on belongs to no object in the table of its revision, no table and no trailer.

    ``revisions``: number and place of each object that a table has, by revision (ISO 32000-2, 7.5.6).
    """
    at = begin
    for listed in revisions:
        seen = set[tuple[int, int]]()
        while head := _BEGIN.match(data, at):
            seen.add((int(head[1]), head.start(1)))
            if (at := _end_of_object(data, head.end())) < 0:
                return True
        table = _TABLE.match(data, at)
        trailer = table and _TRAILER.match(data, table.end())
        end = trailer and _END.match(data, trailer.end())
        if table is None or end is None or seen != listed or int(end[1]) != data.index(b"xref", table.start()):
            return True
        at = end.end()
    return bool(data[at:].strip(_BLANK))


def _end_of_object(data: bytes, at: int) -> int:
    """Behind what an object holds, a stream by its length; -1 where something else stands in it."""
    depth, before, length = 0, b"", 0
    while token := _TOKEN.match(data, at):
        at, text = token.end(), token[0]
        depth += (text in (b"<<", b"[")) - (text in (b">>", b"]"))
        length = int(text) if before == b"/Length" and text.isdigit() and depth == 1 else length
        before = text if text.strip(_BLANK) else before
    if stream := _STREAM.match(data, at):
        end = _ENDSTREAM.match(data, stream.end() + length)
        at = end.end() if end else -1
    return at + 6 if depth == 0 and at >= 0 and data.startswith(b"endobj", at) else -1


def places_of(reader: Any, revision: int) -> set[tuple[int, int]]:
    """Number and place of each object that the table of a revision has; none within other objects."""
    refs = reader.xrefs.explicit_refs_in_revision(revision)
    return {(one.idnum, reader.xrefs.get_historical_ref(one, revision)) for one in refs}


def is_all_of_stamps(reader: Any, signed: int) -> bool:
    """Whether behind a signed revision nothing was added that nothing refers to, and no field but those of time stamps."""
    for revision in range(signed + 1, reader.xrefs.total_revisions):
        held = reader.get_historical_resolver(revision)
        named = held.collect_dependencies(held.trailer_view.raw_get("/Root"))
        if reader.xrefs.explicit_refs_in_revision(revision) - named - {held.root_ref}:
            return False
    before = {name for name, _, _ in enumerate_sig_fields(reader.get_historical_resolver(signed))}
    return all(value is not None or name in before for name, value, _ in enumerate_sig_fields(reader))


def _grown(old: Any, new: Any) -> list[Any]:
    """References of what grew; none where the tree is a part of an object that holds more, or differs otherwise."""
    if not isinstance(new.root.raw_get("/StructTreeRoot"), generic.IndirectObject):
        return []
    before, after = old.root["/StructTreeRoot"], new.root["/StructTreeRoot"]
    top_before, top_after = _top(before), _top(after)
    numbers_before, numbers_after = before["/ParentTree"]["/Nums"], after["/ParentTree"]["/Nums"]
    kids = _added(_list(top_before), _list(top_after))
    numbers = _added(numbers_before, numbers_after)
    elements = [one.reference for one in kids]
    listed = [one.reference for one in numbers[1::2]]
    same = (
        _same(before, after, _GROWING) and _same(top_before, top_after, {"/K"})
        and _same(before["/ParentTree"], after["/ParentTree"], {"/Nums"})
        and _text(before.raw_get("/K")) == _text(after.raw_get("/K"))
        and elements == listed and all(old.is_ref_unassignable(one) and _is_control(new(one)) for one in elements)
    )  # fmt: skip
    if not same or not elements:
        return []
    holders = (after, top_after, after["/ParentTree"], numbers_after, _list(top_after))
    return [*elements, *(one.container_ref for one in holders if one.container_ref is not None)]


def _top(root: Any) -> Any:
    """The element that all others are below."""
    return root["/K"][0] if isinstance(root["/K"], generic.ArrayObject) else root["/K"]


def _list(element: Any) -> Any:
    held = element["/K"]
    return held if isinstance(held, generic.ArrayObject) else generic.ArrayObject([element.raw_get("/K")])


def _added(before: Any, after: Any) -> list[Any]:
    """What stands behind the end of a list that is otherwise the same."""
    if [_text(one) for one in before] != [_text(after.raw_get(i)) for i in range(len(before))]:
        raise ValueError
    return [after.raw_get(i) for i in range(len(before), len(after))]


def _same(before: Any, after: Any, but: set[str]) -> bool:
    keys = set(before) - but
    return set(after) - but == keys and all(_text(before.raw_get(key)) == _text(after.raw_get(key)) for key in keys)


def _is_control(element: Any) -> bool:
    """Whether an element of the structure is that of a signature's field, and of nothing else."""
    target = element["/K"]
    return bool(
        isinstance(element, generic.DictionaryObject) and set(element) <= _ELEMENT and element["/S"] == "/Form"
        and target["/Type"] == "/OBJR" and target["/Obj"]["/FT"] == "/Sig"
    )  # fmt: skip


def _text(held: Any) -> bytes:
    """An object as a file has it, references by their numbers."""
    if isinstance(held, generic.IndirectObject):
        return b"%d %d R" % (held.idnum, held.generation)
    output = io.BytesIO()
    held.write_to_stream(output)
    return output.getvalue()


TIMEOUT_S = 10.0
MOST_BYTES = 1_000_000
_FIX = "Try again, name another server, or sign at level B-B without one"


class Server(TimeStamper):  # type: ignore[misc]
    def __init__(self, url: str) -> None:
        super().__init__()
        self.url = url

    async def async_request_tsa_response(self, req: tsp.TimeStampReq) -> tsp.TimeStampResp:
        headers = {"Content-Type": "application/timestamp-query", "Accept": "application/timestamp-reply"}
        request = urllib.request.Request(self.url, req.dump(), headers)  # noqa: S310 - the scheme was looked at
        try:
            with urllib.request.urlopen(request, timeout=TIMEOUT_S) as answer:  # noqa: S310 - the same
                sort, data = answer.headers.get_content_type(), answer.read(MOST_BYTES + 1)
        except urllib.error.HTTPError as error:
            raise CmmUqError(f"the time stamp server answers {error.code}", where=self.url, fix=_FIX) from None
        except (OSError, http.client.HTTPException) as error:
            why = getattr(error, "reason", error)
            raise CmmUqError(f"the time stamp server does not answer: {why}", where=self.url, fix=_FIX) from None
        if sort != "application/timestamp-reply" or len(data) > MOST_BYTES:
            raise CmmUqError("the server answers something else than a time stamp", where=self.url, fix=_FIX)
        return tsp.TimeStampResp.load(data)

    async def async_timestamp(self, message_digest: bytes, md_algorithm: str) -> Any:
        try:
            token = await super().async_timestamp(message_digest, md_algorithm)
            stated = token["content"]["encap_content_info"]["content"].parsed
            stamped = stated["message_imprint"]["hashed_message"].native
        except TimestampRequestError as error:
            raise CmmUqError(f"the time stamp server refuses: {error}", where=self.url, fix=_FIX) from None
        except (ValueError, KeyError, TypeError, AttributeError):
            raise CmmUqError("the server answers something else than a time stamp", where=self.url, fix=_FIX) from None
        if stamped != message_digest:
            raise CmmUqError("the server stamped something else than it was asked", where=self.url, fix=_FIX)
        return token


STAMP = "TimeStamp"  # name of the field of a document's time stamp, before its number


async def proof_of(
    signer: Signer, server: Server, trust: Trust, at: dt.datetime
) -> tuple[list[Any], ValidationContext]:
    """What proves the certificates of a signature at a time, fetched from those who issued them, before anything is signed."""
    context = ValidationContext(
        trust_roots=[x509.Certificate.load(anchor) for anchor in trust.anchors],
        other_certs=[translated(one) for one in signer.chain], allow_fetching=True, moment=at, revocation_mode="require",
        retroactive_revinfo=True,
    )  # fmt: skip
    validator = CertificateValidator(translated(signer.certificate), validation_context=context)
    try:
        paths = [await validator.async_validate_path(), *[path async for path in server.validation_paths(context)]]
    except (PathBuildingError, PathValidationError) as error:
        raise CmmUqError(f"a certificate cannot be proven: {error}", where=signer.where,
                         fix="Trust its root with --trust, or sign at level B-T") from None  # fmt: skip
    finally:
        await context.aclose()
    return paths, context


def with_proof(pdf: bytes, paths: list[Any], context: ValidationContext) -> IncrementalPdfFileWriter:
    """A writer of a PDF with a further revision that holds the proof."""
    writer = appending(pdf)
    DocumentSecurityStore.supply_dss_in_writer(writer, None, paths=paths, validation_context=context)
    return writer


async def stamped(writer: Any, server: Server) -> bytes:
    """The whole document stamped, with what its revision holds."""
    name, _ = free_name(writer, STAMP)
    output = await PdfTimeStamper(server, field_name=name).async_timestamp_pdf(writer, ONE_DIGEST)
    output.seek(0)
    return bytes(output.read())
