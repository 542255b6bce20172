"""What is given to be verified: the forms of one certificate, and ``results.json`` read strictly."""

from __future__ import annotations

import json
import math
import os
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, get_args

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.files.content import content_of, text_of
from cmm_uq.base.files.limits import GIVEN, JSON_BYTES, JSON_DEPTH, NUMERAL, PDF_BYTES
from cmm_uq.base.languages.translation import ENGLISH, Code
from cmm_uq.base.output import MANIFEST
from cmm_uq.base.output.manifest import Manifest, parsed, plain_name
from cmm_uq.certificate.verify.found import Inquiry
from cmm_uq.certificate.verify.html_page import HtmlPage, read_html
from cmm_uq.certificate.verify.pdf_file import PdfFile, read_pdf

_FIX = "Ask whoever sent it for the file as cmm-uq wrote it"


def strict_json(content: bytes, where: str) -> dict[str, Any]:
    """The object of a JSON file.

    ``content`` the file's bytes.
    """
    if len(content) > JSON_BYTES.most:
        raise CmmUqError(f"is larger than {JSON_BYTES.most} bytes", where=where, fix=_FIX)
    text = text_of(content, where, _FIX)
    _refuse_depth(text, where)

    def once(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
        found = dict(pairs)
        if len(found) < len(pairs):
            twice = next(key for i, (key, _) in enumerate(pairs) if key in {name for name, _ in pairs[:i]})
            raise CmmUqError(f"has the key {twice!r} twice", where=where, fix=_FIX)
        return found

    def numeral(of: type[int | float], text: str) -> Any:
        number = None if len(text) > NUMERAL.most else of(text)
        if number is None or not math.isfinite(number):
            raise CmmUqError(f"has a number that is none: {text}", where=where, fix=_FIX)
        return number

    try:
        data = json.loads(
            text, object_pairs_hook=once, parse_int=lambda text: numeral(int, text),
            parse_float=lambda text: numeral(float, text), parse_constant=lambda text: numeral(float, text),
        )  # fmt: skip
    except json.JSONDecodeError as error:
        raise CmmUqError(f"is no JSON: {error.msg}", where=f"{where} line {error.lineno}", fix=_FIX) from None
    if not isinstance(data, dict):
        raise CmmUqError("holds no JSON object", where=where, fix=_FIX)
    return data


def canonical(data: Any) -> bytes:
    """The bytes that this program writes of plain data whose numbers are rounded."""
    return (json.dumps(data, indent=2, ensure_ascii=False) + "\n").encode()


def _refuse_depth(text: str, where: str) -> None:
    """Count brackets outside strings, before anything recurses."""
    depth, quoted, escaped = 0, False, False
    for c in text:
        if quoted:
            if escaped:
                escaped = False
            elif c == "\\":
                escaped = True
            elif c == '"':
                quoted = False
        elif c == '"':
            quoted = True
        elif c in "[{":
            depth += 1
            if depth > JSON_DEPTH.most:
                raise CmmUqError(f"is nested deeper than {JSON_DEPTH.most} levels", where=where, fix=_FIX)
        elif c in "]}":
            depth -= 1


RESULTS, JOB = "results.json", "job.toml"
RESULTS_SCHEMA, PART_SCHEMA = "cmm-uq/results/1", "cmm-uq/part/1"
_FIX_of_given = "Give files that cmm-uq report, diagnose or part wrote, or their folder"


@dataclass
class Given:
    """The forms of one certificate.

    ``pdf``, ``html``, ``xml``, ``results`` each with its name; ``None`` where it is not given. ``results`` may be the
    one inside the PDF; ``digital_inside`` whether the XML is the one inside the PDF; ``page_inside`` the page that the
    XML carries; ``others`` further files by name: inputs, draws of the posterior; ``manifest`` of a folder.
    """

    pdf: tuple[str, PdfFile] | None = None
    html: tuple[str, HtmlPage, bytes] | None = None
    xml: tuple[str, bytes] | None = None
    results: tuple[str, dict[str, Any], bytes] | None = None
    digital_inside: bool = False
    page_inside: bytes | None = None
    others: dict[str, bytes] = field(default_factory=dict)
    manifest: Manifest | None = None
    contents: dict[str, bytes] = field(default_factory=dict)

    @property
    def of_part(self) -> bool:
        """Whether it is the report of a part."""
        return self.results is not None and self.results[1].get("schema") == PART_SCHEMA

    @property
    def files(self) -> Mapping[str, bytes]:
        """Whatever belongs to the certificate beside its forms, by name: those inside the PDF, else those given."""
        inside = {} if self.pdf is None else self.pdf[1].files
        return {**self.others, **inside}


def read_given(paths: Iterable[Path]) -> Given:
    """Files and folders, read within limits.

    ``paths`` of files, or of a report's folder.
    """
    read: dict[str, tuple[bytes, str]] = {}
    for name, path in _files(paths):
        if name in read:
            raise CmmUqError(f"there are two files {name!r}, and one certificate is verified at a time", where=str(path),
                             fix=_FIX_of_given)  # fmt: skip
        read[name] = content_of(path, PDF_BYTES, _FIX_of_given), str(path)
    return _given(read)


def given_of(files: Mapping[str, bytes]) -> Given:
    """The same of files that were read already, by name, or by their path in a folder that holds one certificate."""
    return _given({name.rpartition("/")[2]: (content, name) for name, content in files.items()})


def _given(read: Mapping[str, tuple[bytes, str]]) -> Given:
    """Contents of files by name, each with how messages name it."""
    given = Given()
    for name, (content, where) in read.items():
        given.contents[name] = content
        _sort(given, name, content, where)
    if given.results is None and given.pdf is not None and RESULTS in given.pdf[1].files:
        content = given.pdf[1].files[RESULTS]
        where = f"{RESULTS} in {given.pdf[0]}"
        given.results = where, strict_json(content, where), content
    if given.results is None and not (given.pdf or given.html or given.xml):
        told = ", ".join(where for _, where in read.values())
        raise CmmUqError("nothing given is a certificate", where=told, fix=_FIX_of_given)
    return given


def _files(paths: Iterable[Path]) -> list[tuple[str, Path]]:
    """Files with their names, those of a folder in the order of these; links lead elsewhere and are refused.

    Of folders inside a folder those files are read that its manifest names.
    """
    found: list[tuple[str, Path]] = []
    for path in paths:
        if path.is_symlink():
            raise CmmUqError("is a link, which may lead to anything", where=str(path), fix="Give the file itself")
        if not path.is_dir():
            found.append((path.name, path))
            continue
        inside = sorted(
            Path(one.path) for one in os.scandir(path) if not one.name.startswith(".") and not _is_folder(one)
        )
        if not inside:
            raise CmmUqError("holds no files", where=str(path), fix=_FIX_of_given)
        named = [(one.name, one) for one in inside] + _deeper(path)
        if linked := next((one for name, one in named if _is_linked(path, name)), None):
            raise CmmUqError(
                "is a link, which may lead to anything", where=str(linked), fix="Put the file itself there"
            )
        found += named
    if len(found) > GIVEN.most:
        raise CmmUqError(f"{len(found)} files are given, and {GIVEN.most} are read at once", where=str(found[0][1].parent),
                         fix=_FIX_of_given)  # fmt: skip
    return found


def _deeper(folder: Path) -> list[tuple[str, Path]]:
    """Files in folders inside a folder that its manifest names and that are there."""
    if (folder / MANIFEST).is_symlink() or not (folder / MANIFEST).is_file():
        return []
    content = content_of(folder / MANIFEST, PDF_BYTES, _FIX_of_given)
    manifest = parsed(strict_json(content, str(folder / MANIFEST)))
    names = [] if manifest is None else [name for name in manifest.files if "/" in name and plain_name(name)]
    return [(name, folder / name) for name in sorted(names) if (folder / name).is_file()]


def _is_linked(folder: Path, name: str) -> bool:
    """Whether a file in a folder, or a folder on the way to it, is a link."""
    parts = name.split("/")
    return any(folder.joinpath(*parts[: i + 1]).is_symlink() for i in range(len(parts)))


def _is_folder(one: os.DirEntry[str]) -> bool:
    return one.is_dir(follow_symlinks=False)


def _sort(given: Given, name: str, content: bytes, where: str) -> None:
    """Put a file where it belongs, by what it begins with."""
    head = content[:1024].removeprefix(b"\xef\xbb\xbf").lstrip().lower()
    if "/" in name:
        given.others[name] = content
    elif head.startswith(b"%pdf-") or name.lower().endswith(".pdf"):
        _once(given.pdf, "PDF", where)
        given.pdf = name, read_pdf(content, where)
    elif head.startswith((b"<!doctype html", b"<html")) or name.lower().endswith((".html", ".htm")):
        _once(given.html, "HTML", where)
        given.html = name, read_html(content, where), content
    elif head.startswith(b"<") or name.lower().endswith(".xml"):
        _once(given.xml, "XML", where)
        given.xml = name, content
    elif name == MANIFEST:
        given.manifest = parsed(strict_json(content, where))
        if given.manifest is None:
            raise CmmUqError("is no manifest of cmm-uq", where=where, fix=_FIX_of_given)
    elif name == RESULTS or (
        head.startswith(b"{") and any(one in head for one in (b'"cmm-uq/results/', b'"cmm-uq/part/'))
    ):
        _once(given.results, RESULTS, where)
        given.results = name, strict_json(content, where), content
    else:
        given.others[name] = content


def _once(before: object, what: str, where: str) -> None:
    if before is not None:
        raise CmmUqError(
            f"is a second {what}, and one certificate is verified at a time", where=where, fix=_FIX_of_given
        )


def check_files(inquiry: Inquiry, given: Given) -> None:
    """Keep what does not belong in the files, and which of them are not what the folder's manifest says."""
    if given.pdf is not None:
        _check_pdf(inquiry, *given.pdf, deeper=given.of_part)
        inside = given.pdf[1].files
        for name in sorted(given.others.keys() & inside.keys()):
            inquiry.looked("forms")
            if given.others[name] != inside[name]:
                inquiry.wrong("forms", name, "", f"is another file than the one of that name in {given.pdf[0]}")
    if given.html is not None:
        inquiry.looked("files")
        for place, problem in given.html[1].problems:
            inquiry.wrong("files", given.html[0], place, problem)
    if given.manifest is not None:
        _check_manifest(inquiry, given, given.manifest)


def _check_pdf(inquiry: Inquiry, name: str, pdf: PdfFile, *, deeper: bool) -> None:
    """What does not belong in a PDF, and what is wrong with the names of its files, which may lie in folders or not."""
    inquiry.looked("files")
    for place, problem in pdf.problems:
        inquiry.wrong("files", name, place, problem)
    seen: set[str] = set()
    for one in pdf.attachments:
        place = f"attachment {one.name}"
        if one.name in seen:
            inquiry.wrong("files", name, place, "is attached twice: readers may show either")
        seen.add(one.name)
        if not plain_name(one.name) or ("/" in one.name and not deeper):
            inquiry.wrong("files", name, place, "has a name that leads out of its folder")
        should = "Data" if one.name.lower().endswith((".json", ".npz", ".xml")) else "Source"
        if one.relationship != should:
            inquiry.wrong("files", name, place, "has another relationship to the document", one.relationship, should)


def _check_manifest(inquiry: Inquiry, given: Given, manifest: Manifest) -> None:
    from hashlib import sha256

    contents = {name: content for name, content in given.contents.items() if name != MANIFEST}
    inquiry.looked("files", len(manifest.files))
    for name, digest in manifest.files.items():
        if name not in contents:
            inquiry.wrong("files", MANIFEST, f"files.{name}", "names a file that is not there")
        elif (stands := sha256(contents[name]).hexdigest()) != digest:
            inquiry.wrong("files", name, "", f"is not the file whose hash {MANIFEST} has", stands, digest)
    for name in contents.keys() - manifest.files.keys():
        inquiry.wrong("files", MANIFEST, "files", f"does not name {name}")


def language_of(data: Mapping[str, Any]) -> Code:
    """Language of the documents, as results.json names it; English where it names none."""
    language: Code = data["job"].get("language", ENGLISH)
    if language not in get_args(Code):
        raise CmmUqError(f"{language!r} is no language of documents", where=f"{RESULTS}: job.language")
    return language
