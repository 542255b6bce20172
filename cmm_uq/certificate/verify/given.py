"""What is given to be verified, ``results.json`` read strictly, and what is found: wrong and where, unchecked and why."""

from __future__ import annotations

import json
import os
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from functools import partial
from hashlib import sha256
from pathlib import Path
from typing import Any, Literal, get_args

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.files.limits import GIVEN, PDF_BYTES, content_of
from cmm_uq.base.languages.translation import ENGLISH, Code
from cmm_uq.base.output import MANIFEST
from cmm_uq.base.output.manifest import Manifest, parsed, plain_name
from cmm_uq.base.values import asdict, dataclass, field
from cmm_uq.certificate.results.provenance import FILE as PROVENANCE
from cmm_uq.certificate.verify.opened import HtmlPage, PdfFile, read_html, read_pdf
from cmm_uq.certificate.verify.texts import plain, strict_json, with_ends

RESULTS, JOB = "results.json", "job.toml"
RESULTS_SCHEMA, PART_SCHEMA = "cmm-uq/results/1", "cmm-uq/part/1"
_FIX_OF_GIVEN = "Give files that cmm-uq report, diagnose or part wrote, or their folder"


@dataclass
class Given:
    """The forms of one certificate, each with its name, and ``None`` where it is not given.

    ``results`` may be the one inside the PDF; ``digital_inside`` whether the XML is; ``page_inside`` the page that the XML
    carries; ``others`` further files by name: inputs, draws of the posterior; ``manifest`` of a folder; ``rewritten`` names of
    those that came with other line ends than they were issued with.
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
    rewritten: list[str] = field(default_factory=list)

    @property
    def of_part(self) -> bool:
        """Whether it is the report of a part."""
        return self.results is not None and self.results[1].get("schema") == PART_SCHEMA

    @property
    def files(self) -> Mapping[str, bytes]:
        """Whatever belongs to the certificate beside its forms, by name: those inside the PDF, else those given."""
        return {**self.others, **({} if self.pdf is None else self.pdf[1].files)}


def read_given(paths: Iterable[Path]) -> Given:
    """Files, and those of folders, read within limits."""
    read: dict[str, tuple[bytes, str]] = {}
    for name, path in _files(paths):
        content = content_of(path, PDF_BYTES, _FIX_OF_GIVEN)
        if name in read and read[name][0] != content:
            problem = f"there are two files {name!r}, and one certificate is verified at a time"
            raise CmmUqError(problem, where=str(path), fix=_FIX_OF_GIVEN)
        read[name] = content, str(path)
    return _given(read)


def given_of(files: Mapping[str, bytes]) -> Given:
    """The same of files that were read already, by name, or by their path in a folder that holds one certificate."""
    return _given({name.rpartition("/")[2]: (content, name) for name, content in files.items()})


def _given(read: Mapping[str, tuple[bytes, str]]) -> Given:
    """Contents of files by name, each with how messages name it."""
    given = Given()
    for name, (content, where) in read.items():
        own = name.lower().endswith((".json", ".html", ".htm", ".xml"))
        given.contents[name] = plain(content) if own else content  # as cmm-uq writes them
        _sort(given, name, given.contents[name], where)
    if given.results is None and given.pdf is not None and RESULTS in given.pdf[1].files:
        content = given.pdf[1].files[RESULTS]
        where = f"{RESULTS} in {given.pdf[0]}"
        given.results = where, strict_json(content, where), content
    if given.results is None and not (given.pdf or given.html or given.xml):
        names = ", ".join(where for _, where in read.values())
        packed = any(content.startswith(b"PK\3\4") for content, _ in read.values())
        fix = "Unpack what is in it, and give the folder" if packed else _FIX_OF_GIVEN
        raise CmmUqError("nothing given is a certificate", where=names, fix=fix)
    job = None if given.results is None else given.results[1].get("job")
    wanted = job.get("inputs_sha256") if isinstance(job, dict) else None
    for name, digest in wanted.items() if isinstance(wanted, dict) else ():
        if name in given.others:
            given.contents[name] = given.others[name] = with_ends(given.others[name], digest)
    given.rewritten += [name for name, (content, _) in read.items() if given.contents[name] != content]
    return given


_OF_WINDOWS = frozenset({"thumbs.db", "ehthumbs.db", "desktop.ini"})


def _files(paths: Iterable[Path]) -> list[tuple[str, Path]]:
    """Those of a folder in order, also of folders inside it those that its manifest names; links lead elsewhere: refused.

    What Windows puts into a folder that is looked at is passed over, as names that begin with a dot are.
    """
    files: list[tuple[str, Path]] = []
    link = "is a link, which may lead to anything"
    for path in paths:
        if os.path.islink(path):  # noqa: PTH114 - raises nothing of a name that is too long
            raise CmmUqError(link, where=str(path), fix=f"Give what it leads to: {os.path.realpath(path)}")
        if not os.path.isdir(path):  # noqa: PTH112 - the same
            files.append((path.name, path))
            continue
        inside = sorted(
            entry.name for entry in os.scandir(path)
            if not entry.name.startswith(".") and entry.name.lower() not in _OF_WINDOWS
            and not entry.is_dir(follow_symlinks=False)
        )  # fmt: skip
        if not inside:
            raise CmmUqError("holds no files", where=str(path), fix=_FIX_OF_GIVEN)
        for name in (*inside, *_deeper(path)):
            steps = [path.joinpath(*name.split("/")[: i + 1]) for i in range(name.count("/") + 1)]
            if any(step.is_symlink() for step in steps):
                raise CmmUqError(link, where=str(path / name), fix="Put the file itself there")
            files.append((name, path / name))
    if len(files) > GIVEN.most:
        problem = f"{len(files)} files are given, and {GIVEN.most} are read at once"
        raise CmmUqError(problem, where=str(files[0][1].parent), fix=_FIX_OF_GIVEN)
    return files


def _deeper(folder: Path) -> list[str]:
    """Files in folders inside a folder that its manifest names and that are there."""
    path = folder / MANIFEST
    if path.is_symlink() or not path.is_file():
        return []
    manifest = parsed(strict_json(content_of(path, PDF_BYTES, _FIX_OF_GIVEN), str(path)))
    names = [] if manifest is None else [name for name in manifest.files if "/" in name and plain_name(name)]
    return [name for name in sorted(names) if (folder / name).is_file()]


def _sort(given: Given, name: str, content: bytes, where: str) -> None:
    """Put a file where it belongs, by what it begins with."""

    def once(before: object, what: str) -> None:
        if before is not None:
            problem = f"is a second {what}, and one certificate is verified at a time"
            raise CmmUqError(problem, where=where, fix=_FIX_OF_GIVEN)

    head = content[:1024].removeprefix(b"\xef\xbb\xbf").lstrip().lower()
    schemas = (b'"cmm-uq/results/', b'"cmm-uq/part/')
    if "/" in name:
        given.others[name] = content
    elif head.startswith(b"%pdf-") or name.lower().endswith(".pdf"):
        once(given.pdf, "PDF")
        given.pdf = name, read_pdf(content, where)
    elif head.startswith((b"<!doctype html", b"<html")) or name.lower().endswith((".html", ".htm")):
        once(given.html, "HTML")
        given.html = name, read_html(content, where), content
    elif head.startswith(b"<") or name.lower().endswith(".xml"):
        once(given.xml, "XML")
        given.xml = name, content
    elif name == MANIFEST:
        given.manifest = parsed(strict_json(content, where))
        if given.manifest is None:
            raise CmmUqError("is no manifest of cmm-uq", where=where, fix=_FIX_OF_GIVEN)
    elif name == RESULTS or (head.startswith(b"{") and any(schema in head for schema in schemas)):
        once(given.results, RESULTS)
        given.results = name, strict_json(content, where), content
    else:
        given.others[name] = content


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
    with inquiry.reading("files", PROVENANCE):
        _check_provenance(inquiry, given)


def _check_pdf(inquiry: Inquiry, name: str, pdf: PdfFile, *, deeper: bool) -> None:
    """What does not belong in a PDF, and what is wrong with the names of its files, which may lie in folders or not."""
    inquiry.looked("files")
    wrong = partial(inquiry.wrong, "files", name)
    for place, problem in pdf.problems:
        wrong(place, problem)
    seen: set[str] = set()
    for attachment in pdf.attachments:
        place = f"attachment {attachment.name}"
        if attachment.name in seen:
            wrong(place, "is attached twice: readers may show either")
        seen.add(attachment.name)
        if not plain_name(attachment.name) or ("/" in attachment.name and not deeper):
            wrong(place, "has a name that leads out of its folder")
        should = "Data" if attachment.name.lower().endswith((".json", ".npz", ".xml")) else "Source"
        if attachment.relationship != should:
            wrong(place, "has another relationship to the document", attachment.relationship, should)


def _check_manifest(inquiry: Inquiry, given: Given, manifest: Manifest) -> None:
    contents = {name: content for name, content in given.contents.items() if name != MANIFEST}
    stands = strict_json(given.contents[MANIFEST], MANIFEST)
    inquiry.looked("files", len(manifest.files))
    for name, digest in manifest.files.items():
        if name not in contents:
            inquiry.wrong("files", MANIFEST, f"files.{name}", "names a file that is not there")
        elif (hashed := sha256(contents[name]).hexdigest()) != digest:
            inquiry.wrong("files", name, "", f"is not the file whose hash {MANIFEST} has", hashed, digest)
        elif stands["files"][name] != (should := {"sha256": digest, "bytes": len(contents[name])}):
            there, problem = stands["files"][name], "is not what the file gives"
            inquiry.wrong("files", MANIFEST, f"files.{name}", problem, there, should)
    for name in contents.keys() - manifest.files.keys():
        inquiry.wrong("files", MANIFEST, "files", f"does not name {name}")
    own = json.loads(manifest.as_json(dict.fromkeys(manifest.files, 0)))
    same = ("program", "files")
    for key in stands.keys() ^ own.keys() or {key for key in own if key not in same and own[key] != stands[key]}:
        inquiry.wrong("files", MANIFEST, key, "says otherwise than cmm-uq writes it", stands.get(key), own.get(key))


def _check_provenance(inquiry: Inquiry, given: Given) -> None:
    """Whether the files given are those whose hashes provenance.json, attached or beside them, has."""
    if (content := given.files.get(PROVENANCE)) is None:
        return
    entities, there = strict_json(content, PROVENANCE).get("entity", {}), {**given.contents, **given.files}
    inside = {} if given.pdf is None else given.pdf[1].files
    if (
        given.pdf
        and PROVENANCE in inside
        and RESULTS not in inside
        and any(one.get("prov:label") == RESULTS for one in entities.values())
    ):
        inquiry.wrong("files", given.pdf[0], f"attachment {RESULTS}", f"is missing, and {PROVENANCE} names it")
    for one in entities.values():
        name, digest = one.get("prov:label"), one.get("cmm-uq:sha256")
        if digest is not None and name in there and not name.endswith(".xml"):  # which may be signed since then
            problem = f"is not the file whose hash {PROVENANCE} has"
            inquiry.compare("files", name, "", problem, sha256(there[name]).hexdigest(), digest)


def language_of(data: Mapping[str, Any]) -> Code:
    """Language of the documents, as results.json names it; English where it names none."""
    language: Code = data["job"].get("language", ENGLISH)
    if language not in get_args(Code):
        raise CmmUqError(f"{language!r} is no language of documents", where=f"{RESULTS}: job.language")
    return language


Word = Literal["VERIFIED", "NOT VERIFIED", "NOT WHOLLY CHECKED"]
LONGEST = 160  # characters of what stands somewhere, as it is shown


@dataclass(frozen=True)
class VerificationFinding:
    check: str  # of CHECKS
    file: str
    place: str  # page, JSON path, XPath, attachment, byte; empty for the file as a whole
    problem: str
    stands: str = ""
    should: str = ""

    def __str__(self) -> str:
        where = ": ".join(filter(None, (self.file, self.place)))
        against = f": “{self.stands}” instead of “{self.should}”" if self.stands or self.should else ""
        return f"{where}: {self.problem}{against}"


@dataclass(frozen=True)
class Unchecked:
    what: str
    why: str

    def __str__(self) -> str:
        return f"{self.what}: {self.why}"


AGAIN = "computing again"
NOT_ASKED = "not asked for (--no-rerun)"
CHECKS = {  # what each check makes sure of
    "files": "the files are what cmm-uq writes, with nothing active, hidden or further in them",
    "signatures": "signatures are intact and cover the whole file; whom one must trust for them is trusted, or named above",
    "forms": "results.json, the digital certificate and its page are those of the PDF and the HTML",
    "figures": "the figures of results.json agree with each other",
    "decisions": "decisions follow from figures, uncertainties, limits and rules",
    "inputs": "inputs are those whose hashes results.json has",
    "dates": "artefacts were in date, and dates are in order",
    "records": "the records have the entry that the certificate states, and the certificate",
    "again": "computed again from the inputs, everything is the same",
}


@dataclass
class Inquiry:
    """A verification under way; ``done`` how many things each check compared."""

    findings: list[VerificationFinding] = field(default_factory=list)
    unchecked: list[Unchecked] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    done: dict[str, int] = field(default_factory=dict)

    def wrong(self, check: str, file: str, place: str, problem: str, stands: object = "", should: object = "") -> None:
        """Keep a finding; what stands there is shortened."""
        self.findings.append(VerificationFinding(check, file, place, problem, _shown(stands), _shown(should)))

    def looked(self, check: str, count: int = 1) -> None:
        """Something was compared, and whatever was wrong with it is kept."""
        self.done[check] = self.done.get(check, 0) + count

    def compare(self, check: str, file: str, place: str, problem: str, stands: object, should: object) -> None:
        """Look at a thing, and keep it where it is not what it should be."""
        self.looked(check)
        if stands != should:
            self.wrong(check, file, place, problem, stands, should)

    def left(self, what: str, why: str) -> None:
        """Keep what was not checked, each thing once."""
        if (thing := Unchecked(what, why)) not in self.unchecked:
            self.unchecked.append(thing)

    @contextmanager
    def reading(self, check: str, file: str) -> Iterator[None]:
        """Parts of a file that may be missing, or be of another form: then that is what is wrong."""
        try:
            yield
        except (KeyError, TypeError, ValueError, AttributeError, IndexError, CmmUqError) as error:
            self.wrong(check, file, "", f"has not the parts that cmm-uq writes ({type(error).__name__}: {error})")

    @property
    def word(self) -> Word:
        if self.findings:
            return "NOT VERIFIED"
        return "NOT WHOLLY CHECKED" if self.unchecked else "VERIFIED"

    def as_data(self) -> dict[str, Any]:
        return {
            "verdict": self.word,
            "findings": [{key: text or None for key, text in asdict(finding).items()} for finding in self.findings],
            "not_checked": [asdict(thing) for thing in self.unchecked],
            "notes": self.notes,
            "checked": {name: self.done.get(name, 0) for name in CHECKS},
        }


def _shown(value: object) -> str:
    """What stands somewhere, short enough for a line."""
    text = value if isinstance(value, str) else "" if value is None else repr(value)
    return text if len(text) <= LONGEST else f"{text[: LONGEST - 1]}…"
