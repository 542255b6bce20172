"""The digital certificate (DCC) beside the other forms: made again of ``results.json`` and the inputs, element by element."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING

from cmm_uq.base.errors import CmmUqError
from cmm_uq.certificate.verify.found import Inquiry
from cmm_uq.certificate.verify.given import Given
from cmm_uq.certificate.verify.html_page import read_html

if TYPE_CHECKING:
    from cmm_uq.jobs.dcc.tree import Node
    from cmm_uq.jobs.job import Job

_MOST = 12
Difference = tuple[str, str, str]  # XPath, what stands there, what should


def open_digital(inquiry: Inquiry, given: Given) -> None:
    """Take the certificate out of the PDF where it is not given by itself, and the page out of it; keep where these differ."""
    from cmm_uq.jobs.dcc import read

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
        inquiry.wrong("forms", name, "/dcc:digitalCalibrationCertificate", "carries no copy for reading")
        return
    given.page_inside = document.data
    place = "/dcc:digitalCalibrationCertificate/dcc:document"
    if given.html is None:
        where = f"{document.file_name} in {name}"
        given.html = where, read_html(document.data, where), document.data
    elif given.html[2] != document.data:
        inquiry.wrong("forms", name, place, f"is not {given.html[0]}")


def check_digital(inquiry: Inquiry, given: Given, job: Job) -> None:
    """Keep every element that results.json and the job do not give; of this version of the package."""
    if given.xml is None or given.results is None:
        return
    import json

    from cmm_uq.certificate.digital_certificate.certificate import digital_certificate
    from cmm_uq.jobs.dcc import written

    name, content = given.xml
    try:
        should = written(digital_certificate(json.loads(given.results[2]), job, html=given.page_inside))
    except (KeyError, TypeError, ValueError, AttributeError, IndexError, CmmUqError) as error:
        inquiry.wrong("forms", name, "", f"cannot be made of {given.results[0]} ({type(error).__name__}: {error})")
        return
    _compare(inquiry, name, content, should, given.results[0])


def check_schema(inquiry: Inquiry, given: Given, folder: Path) -> None:
    """Keep what the schema of PTB refuses."""
    from cmm_uq.jobs.dcc.schema import checked_by_schema

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
    from cmm_uq.jobs.dcc.tree import parsed

    return next(differences(parsed(one, where), parsed(other, where)), None) is None


def _compare(inquiry: Inquiry, name: str, content: bytes, should: bytes, source: str) -> None:
    from cmm_uq.jobs.dcc.tree import parsed

    inquiry.looked("forms")
    if content == should:
        return
    root, wished = parsed(content, name), parsed(should, source)
    found = list(islice(differences(root, wished), _MOST))
    for path, stands, wanted in found:
        inquiry.wrong("forms", name, path, f"is not what {source} says", stands, wanted)
    if not found and not any(map(_is_signature, (*root.children, *wished.children))):
        problem = "is written otherwise, though it says the same: it is not the file that was made"
        inquiry.wrong("forms", name, "", problem)


def differences(one: Node, other: Node) -> Iterator[Difference]:
    """Where two trees differ, by XPath; a signature over the root is passed over."""
    if one.tag != other.tag:
        yield one.xpath, one.tag, other.tag
        return
    if one.attributes != other.attributes:
        yield f"{one.xpath}/@*", str(one.attributes), str(other.attributes)
    if " ".join(one.text.split()) != " ".join(other.text.split()):
        yield one.xpath, one.text, other.text
    a, b = ([child for child in node.children if node.parent or not _is_signature(child)] for node in (one, other))
    for mine, theirs in zip(a, b, strict=False):
        yield from differences(mine, theirs)
    yield from ((child.xpath, "there", "") for child in a[len(b) :])
    yield from ((child.xpath, "", "there") for child in b[len(a) :])


def _is_signature(node: Node) -> bool:
    return node.tag.rpartition(":")[2].rpartition("}")[2] == "Signature"
