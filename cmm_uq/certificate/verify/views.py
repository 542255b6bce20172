"""Whether the digital certificate (DCC) says what results.json and the inputs give, element by element; who signed what.

Pages are compared where they are made again to the byte, and nowhere else.
"""

from __future__ import annotations

import datetime as dt
import io
import json
import re
from collections.abc import Iterator, Sequence
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING, Any

from cmm_uq.base.errors import CmmUqError, NotInstalledError
from cmm_uq.certificate.verify.given import Given, Inquiry
from cmm_uq.certificate.verify.opened import read_html, reading
from cmm_uq.jobs.dcc import read, written
from cmm_uq.jobs.dcc.tree import Node, parsed
from cmm_uq.laboratory.records.facts import ChainHead

if TYPE_CHECKING:
    from cmm_uq.certificate.sign import FileSignature, Trust
    from cmm_uq.jobs.job import Job

Difference = tuple[str, str, str]  # path in a PDF or XPath, what stands there, what should


def first_difference(a: Sequence[object], b: Sequence[object]) -> int:
    return next((i for i, (x, y) in enumerate(zip(a, b, strict=False)) if x != y), min(len(a), len(b)))


MOST = 8  # differences that are told
_PAGE = re.compile(r"^/Root/Pages/Kids\[(\d+)\]")
_NOT_STATED = frozenset({"/ID", "/Prev", "/Size", "/XRefStm", "/Length", "/Filter", "/Parent", "/DecodeParms"})


_OF_SIGNATURES = re.compile(
    r"(?:/Root/(?:AcroForm|DSS|Extensions|StructTreeRoot|Version|Metadata)|/Root/Pages/Kids\[\d+\]/Annots|/Info)(?:[/\[]|$)"
)
_GROWING = re.compile(
    r"/Root/(?:Version|Metadata|StructTreeRoot/ParentTreeNextKey)$|/Root/Metadata/|/Info/(?:ModDate|Producer)"
)


def differing_parts(stands: bytes, should: bytes, *, signed: bool = False) -> list[Difference]:
    """The first parts of two PDFs that differ, what a page has named by the page; none where only the writing does.

    ``signed``: what signatures add to a PDF is no difference.
    """
    if stands == should:
        return []
    with reading("the PDF"):
        a, b = dict(_parts(stands)), dict(_parts(should))
    added = {path for path in a if path not in b and _OF_SIGNATURES.match(path)} if signed else set()
    paths = (path for path in {**a, **b} if a.get(path) != b.get(path) and path not in added)
    found = []
    for path in islice((path for path in paths if not (signed and _GROWING.match(path))), MOST):
        x, y = a.get(path, ""), b.get(path, "")
        begin = max(0, first_difference(x, y) - 20) if x and y else 0
        page = _PAGE.match(path)
        where = f"page {int(page[1]) + 1}: {path[page.end() :]}" if page else path.removeprefix("/Root")
        found.append((where or "trailer", x[begin : begin + 40], y[begin : begin + 40]))
    return found


def _parts(content: bytes) -> Iterator[tuple[str, str]]:
    """Everything that a PDF states by its path from the trailer, each object once, pages before what leads to them."""
    from pypdf import PdfReader
    from pypdf.generic import ArrayObject, DictionaryObject, StreamObject

    seen: set[int] = set()
    waiting: list[tuple[str, Any]] = [("", PdfReader(io.BytesIO(content), strict=False).trailer)]
    while waiting:
        path, part = waiting.pop()
        if (number := getattr(part, "idnum", None)) is not None:
            if number in seen:
                continue
            seen.add(number)
            part = part.get_object()
        if isinstance(part, DictionaryObject):
            if isinstance(part, StreamObject):
                yield path, part.get_data().decode("latin-1")
            keys = sorted(dict.keys(part) - _NOT_STATED, key=lambda key: (key != "/Pages", key))
            waiting += reversed([(f"{path}{key}", dict.__getitem__(part, key)) for key in keys])
        elif isinstance(part, ArrayObject):
            waiting += reversed([(f"{path}[{i}]", inner) for i, inner in enumerate(list.__iter__(part))])
        else:
            yield path, repr(part)


_MOST = 12
_ROOT = "/dcc:digitalCalibrationCertificate"


def open_digital(inquiry: Inquiry, given: Given) -> None:
    """Take the certificate out of the PDF where it is not given by itself, and the page out of it; keep where these differ."""
    # an artefact's certificate is an input
    inputs = given.results[1]["job"]["inputs_sha256"] if given.results is not None else {}
    files = [] if given.pdf is None else given.pdf[1].attachments
    attached = next((file for file in files if file.name.lower().endswith(".xml") and file.name not in inputs), None)
    if attached is not None and given.pdf is not None:
        if given.xml is None:
            given.xml, given.digital_inside = (f"{attached.name} in {given.pdf[0]}", attached.content), True
        elif given.xml[1] != attached.content:
            name = f"attachment {attached.name} of {given.pdf[0]}"
            _compare(inquiry, name, attached.content, given.xml[1], given.xml[0])
    if given.xml is None:
        return
    name, content = given.xml
    inquiry.looked("forms")
    document = read(content, name).document
    if document is None:
        inquiry.wrong("forms", name, _ROOT, "carries no copy for reading")
        return
    given.page_inside = document.data
    if given.html is None:
        where = f"{document.file_name} in {name}"
        given.html = where, read_html(document.data, where), document.data
    elif given.html[2] != document.data:
        inquiry.wrong("forms", name, f"{_ROOT}/dcc:document", f"is not {given.html[0]}")


def check_digital(inquiry: Inquiry, given: Given, job: Job) -> None:
    """Keep every element that results.json and the job do not give; of this version of the package."""
    if given.xml is None or given.results is None:
        return
    from cmm_uq.certificate.digital_certificate.certificate import digital_certificate

    name, content = given.xml
    try:
        should = written(digital_certificate(json.loads(given.results[2]), job, html=given.page_inside))
    except (KeyError, TypeError, ValueError, AttributeError, IndexError, CmmUqError) as error:
        inquiry.wrong("forms", name, "", f"cannot be made of {given.results[0]} ({type(error).__name__}: {error})")
        return
    _compare(inquiry, name, content, should, given.results[0])


def check_schema(inquiry: Inquiry, given: Given, folder: Path) -> None:
    """Keep what the schema of PTB refuses."""
    from cmm_uq.jobs.dcc.xml_file import checked_by_schema

    if given.xml is None:
        raise CmmUqError("there is no digital certificate to be held to a schema", where="--schema", fix="Leave it out")
    inquiry.looked("files")
    try:
        checked_by_schema(given.xml[1], folder, given.xml[0])
    except CmmUqError as error:
        if error.where is None or not error.where.startswith(given.xml[0]):
            raise
        for one in (error, *error.also):
            inquiry.wrong("files", given.xml[0], (one.where or "").removeprefix(f"{given.xml[0]}, "), one.problem)


def same_unsigned(one: bytes, other: bytes, where: str) -> bool:
    """Whether two certificates are the same but for their signatures."""
    return next(differences(parsed(one, where), parsed(other, where)), None) is None


def _compare(inquiry: Inquiry, name: str, content: bytes, should: bytes, source: str) -> None:
    inquiry.looked("forms")
    if content == should:
        return
    root, wished = parsed(content, name), parsed(should, source)
    found = list(islice(differences(root, wished), _MOST))
    for path, stands, wanted in found:
        inquiry.wrong("forms", name, path, f"is not what {source} says", stands, wanted)
    if not found and not any(map(_is_signature, (*root.children, *wished.children))):
        problem = f"is written otherwise than {source} gives it, though it says the same: one of them was changed"
        inquiry.wrong("forms", name, "", problem)


def differences(one: Node, other: Node) -> Iterator[Difference]:
    """Where two trees differ, by XPath; a signature over the root is passed over."""
    if one.tag != other.tag:
        yield one.xpath, one.tag, other.tag
        return
    if one.attributes != other.attributes:
        yield f"{one.xpath}/@*", str(one.attributes), str(other.attributes)
    if one.text.split() != other.text.split():
        yield one.xpath, one.text, other.text
    a, b = ([child for child in node.children if node.parent or not _is_signature(child)] for node in (one, other))
    for mine, theirs in zip(a, b, strict=False):
        yield from differences(mine, theirs)
    yield from ((child.xpath, "there", "") for child in a[len(b) :])
    yield from ((child.xpath, "", "there") for child in b[len(a) :])


def _is_signature(node: Node) -> bool:
    return node.tag.rpartition(":")[2].rpartition("}")[2] == "Signature"


_OPENING = b"http://www.w3.org/2000/09/xmldsig#"


Signed = tuple[str, bytes, "FileSignature"]  # name and content of a file, and a signature of it


def check_signatures(
    inquiry: Inquiry, given: Given, trust: Trust | None, issued: dt.date | None = None
) -> list[Signed]:
    """Keep signatures that are not intact, over the whole file, of somebody trusted, or by a key for trying.

    ``trust``: ``None`` where nobody said whom the reader trusts: then nothing need be signed, and a signature that is intact
    shows that nothing was changed since, not by whom. ``issued``: the day before which there was nothing to sign.
    """
    from cmm_uq.certificate import sign

    held, found, earliest = trust or sign.Trust(), list[Signed](), _earliest(given, issued)
    try:
        if given.pdf is not None:
            name, pdf = given.pdf
            if not pdf.signatures and len(pdf.ends) > 1:
                problem = "was changed after it was made, and nobody signed that"
                inquiry.wrong("signatures", name, f"byte {pdf.ends[0]}", problem)
            for where, stands, should in differing_parts(pdf.content, pdf.content[: pdf.ends[0]], signed=True):
                inquiry.wrong("signatures", name, where, "was changed after it was made", stands, should)
            signed = sign.signatures_of_pdf(pdf.content, held, where=name) if pdf.signatures else ()
            _check_signed(inquiry, name, signed, trust, earliest)
            found += [(name, pdf.content, one) for one in signed]
        if given.xml is not None:
            name, content = given.xml
            signed = sign.signatures_of_xml(content, held, where=name) if _OPENING in content else ()
            if signed or not given.digital_inside:  # what is inside a signed PDF is signed with it
                _check_signed(inquiry, name, signed, trust, earliest)
            found += [(name, content, one) for one in signed]
    except NotInstalledError as error:
        inquiry.left("electronic signatures", f"{error.problem}. {error.fix}")
    return found


AHEAD = dt.timedelta(minutes=10)  # by which clocks may differ
_ZONES = dt.timedelta(hours=14)  # by which a day begins before UTC's, at most


Moment = tuple[dt.datetime, str]  # before which a certificate was not there to be signed, and why


def _earliest(given: Given, issued: dt.date | None) -> list[Moment]:
    found = []
    if issued is not None:
        found.append((dt.datetime.combine(issued, dt.time(), dt.UTC) - _ZONES, f"the certificate is of {issued}"))
    head = None if given.results is None else ChainHead.of_results(given.results[1])
    if head is not None and (moment := head.moment) is not None:
        found.append((moment - AHEAD, f"it states entry {head.entries} of the records, of {head.at}"))
    return found


def _check_time(inquiry: Inquiry, name: str, signature: FileSignature, place: str, earliest: Sequence[Moment]) -> None:
    """Keep a signature that is older than what it signs; one of the future leaves open when it was made."""
    now = dt.datetime.now(dt.UTC)
    for said in filter(None, (signature.time, *signature.beside.values())):
        if said > now + AHEAD:
            why = f"it says {said:%Y-%m-%d %H:%M} UTC, and the clock of this computer {now:%Y-%m-%d %H:%M} UTC"
            inquiry.left(f"when {name} was signed", why)
    for moment, why in earliest:
        if (time := signature.time) is not None and time < moment:
            problem = f"says {time:%Y-%m-%d %H:%M} UTC, before there was anything to sign: {why}"
            inquiry.wrong("signatures", name, place, problem)


def _check_signed(
    inquiry: Inquiry, name: str, signed: Sequence[FileSignature], trust: Trust | None, earliest: Sequence[Moment]
) -> None:
    from cmm_uq.certificate.sign import TEST_NOTE
    from cmm_uq.certificate.sign.found import NOBODY

    inquiry.looked("signatures", len(signed))
    if not signed and trust is not None:
        inquiry.wrong("signatures", name, "", "carries no signature, and --trust asks for one")
    elif not signed:
        inquiry.notes.append(f"{name} carries no electronic signature: who issued it is not shown.")
    for number, one in enumerate(signed, 1):
        at = "at no time that it says" if one.time is None else f"on {one.time:%Y-%m-%d %H:%M} UTC"
        who, by = f"{name}: {one.level} by {one.name or 'nobody'}", "" if one.time_proven else " by the signer himself"
        beside = f"; beside it {', '.join(one.beside)}" if one.beside else ""
        inquiry.notes.append(f"{who}, {at}{by}; revocation: {one.revocation}{beside}.")
        _check_time(inquiry, name, one, f"signature {number}", earliest)
        holds = one.problems or (one.intact and one.covers_whole_file and (one.trusted or trust is None))
        for problem in one.problems if holds else ("does not hold",):
            if problem == NOBODY and trust is None:
                inquiry.left(f"who signed {name}", "no trust anchors were given (--trust)")
            else:
                inquiry.wrong("signatures", name, f"signature {number}", str.__str__(problem))
        if one.test_key and trust is None:
            inquiry.left(f"who signed {name}", str.__str__(TEST_NOTE))
        elif one.test_key:
            inquiry.wrong("signatures", name, f"signature {number}", str.__str__(TEST_NOTE))
