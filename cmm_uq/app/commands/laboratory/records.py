"""The records themselves: reports that were written before, kept in them; old files removed; inputs read back."""

from __future__ import annotations

import contextlib
import datetime as dt
import json
from collections.abc import Iterable, Iterator, Mapping
from hashlib import sha256
from pathlib import Path
from typing import TYPE_CHECKING, Any

from cmm_uq.app.commands.files import content_of
from cmm_uq.app.commands.reading import job_of
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.files.limits import TABLE_BYTES, check_permitted, content_of as whole_file
from cmm_uq.base.output import MANIFEST, finish_interrupted, interruption, read_manifest, sha256_of
from cmm_uq.base.values import dataclass
from cmm_uq.jobs.job import Job
from cmm_uq.jobs.part.job import PartJob, part_of
from cmm_uq.jobs.source import RESULTS
from cmm_uq.laboratory.records import open_records
from cmm_uq.laboratory.records.facts import PART, RecordedCertificate

if TYPE_CHECKING:
    from cmm_uq.laboratory.records.store import Records

COMMANDS = ("report", "diagnose", PART)


@dataclass(frozen=True)
class ImportedReports:
    """Folders whose reports were recorded, or were before, or were not, and why; ``bare``: only results.json was left."""

    added: tuple[Path, ...]
    known: tuple[Path, ...]
    refused: tuple[tuple[Path, CmmUqError], ...]
    bare: tuple[Path, ...]


def import_reports(records: Records | Path, folders: Iterable[Path]) -> ImportedReports:
    """Record reports, diagnoses and reports of parts that were written before, oldest first, all in one transaction.

    ``records``: opened, or the file in which they are begun where something is to be recorded.
    """
    opened, home = (None, records.absolute().parent) if isinstance(records, Path) else (records, records.home)
    found = reports_in(folders)
    contents: dict[str, tuple[Path, dict[str, Any]]] = {}
    known, refused, bare = [], [], []
    for path in found:
        try:
            digest = sha256_of(path / RESULTS) or ""
            if digest in contents or (opened is not None and opened.has_results(digest) is not None):
                known.append(path)
                continue
            job: Job | PartJob | None = None
            with contextlib.suppress(CmmUqError):  # its PDF is gone, or its inputs are not read any more
                files, manifest = inputs_of(path), read_manifest(path)
                of_part = manifest is not None and manifest.owner.command == PART
                job = part_of(files, machine=False) if of_part else job_of(files)
            contents[digest] = path, _content(home, path, job)
            if job is None:
                bare.append(path)
        except CmmUqError as error:
            refused.append((path, error))
    ordered = sorted(contents.values(), key=lambda one: (one[1]["day"], one[1]["job"], one[1]["command"]))
    if ordered:
        with (
            interruption.placing(records if isinstance(records, Path) else records.shown),
            open_records(records, create=True)
            if isinstance(records, Path)
            else contextlib.nullcontext(records) as history,
        ):
            history.append_all(("imported", content, None) for _, content in ordered)
    return ImportedReports(tuple(path for path, _ in ordered), tuple(known), tuple(refused), tuple(bare))


def reports_in(folders: Iterable[Path]) -> list[Path]:
    """Folders with a report, of a part too, or a diagnosis, each once."""
    asked = tuple(folders)
    found = {path.resolve(): path for folder in asked for path in report_folders(folder)}
    if not found:
        raise CmmUqError("holds no report", where=", ".join(map(str, asked)),
                         fix="Name folders that cmm-uq report, diagnose or part wrote")  # fmt: skip
    return list(found.values())


def report_folders(folder: Path) -> Iterator[Path]:
    """Folders with a set of files that a report or a diagnosis wrote, sorted; none is passed over since it is closed."""
    if not folder.is_dir():
        raise CmmUqError("no such folder", where=str(folder), fix="Name folders that hold reports")
    for place in (folder, *folder.glob("*/**")):
        if not place.name.startswith(".") and place.is_dir():
            check_permitted(place, "Mend its permissions, or name the folders beside it")
    for manifest in sorted((folder / MANIFEST, *folder.glob(f"*/**/{MANIFEST}"))):
        if manifest.parent.name.startswith("."):
            continue
        finish_interrupted(manifest.parent)
        check_permitted(manifest, "Mend its permissions")
        written = read_manifest(manifest.parent)
        if written is not None and written.owner.command in COMMANDS and RESULTS in written.files:
            yield manifest.parent


def inputs_of(folder: Path) -> dict[str, bytes]:
    """Inputs of the job of a report by their names, as its PDF carries them, each with the hash that results.json says."""
    from pypdf import PdfReader
    from pypdf.errors import PyPdfError

    wanted = _results(folder)["job"].get("inputs_sha256") or {}
    pdf = next(iter(sorted(folder.glob("*.pdf"))), None)
    if pdf is None:
        raise CmmUqError("holds no PDF with the inputs of its job", where=str(folder))
    try:
        attached = {name: parts[-1] for name, parts in PdfReader(pdf).attachments.items()}
    except (PyPdfError, OSError, ValueError, KeyError, RecursionError) as error:
        raise CmmUqError(f"cannot be read: {error}", where=str(pdf)) from error
    for name, digest in wanted.items():
        if name not in attached or sha256(attached[name]).hexdigest() != digest:
            raise CmmUqError(f"does not carry the input {name} that its results were made from", where=str(pdf))
    return {name: attached[name] for name in wanted}


def _content(home: Path | None, folder: Path, job: Job | PartJob | None) -> dict[str, Any]:
    """Content of the entry of a folder whose files are as they were written."""
    manifest = read_manifest(folder)
    if manifest is None:
        raise CmmUqError("its manifest.json is gone", where=str(folder))
    for name, digest in manifest.files.items():
        if sha256_of(folder / name) != digest:
            raise CmmUqError("was altered or removed after it was written", where=str(folder / name),
                             fix="Only reports as they were written are recorded")  # fmt: skip
    results = whole_file(folder / RESULTS, TABLE_BYTES, "Name a folder with a report")
    return content_of(home, results, job, manifest.owner.command, folder, manifest.files)


def _results(folder: Path) -> Mapping[str, Any]:
    try:
        data = json.loads(whole_file(folder / RESULTS, TABLE_BYTES, "Name a folder with a report"))
        data["job"].get("id")
    except (ValueError, RecursionError, KeyError, TypeError, AttributeError) as error:
        raise CmmUqError("is no results.json", where=str(folder / RESULTS)) from error
    found: Mapping[str, Any] = data
    return found


@dataclass(frozen=True)
class Retained:
    """What a retention removes: certificates that are older, in whose folders nothing newer is, and their files."""

    certificates: tuple[RecordedCertificate, ...]
    files: tuple[Path, ...]


def retention(records: Records, keep_years: int, today: dt.date) -> Retained:
    """Certificates and diagnoses that are older, with the files of them that are as they were written."""
    try:
        before = today.replace(year=today.year - keep_years)
    except ValueError:
        before = today.replace(year=today.year - keep_years, day=28)
    all_of_them = records.certificates(origin=None, command=None, values=False)
    newest = {one.folder: one for one in sorted(all_of_them, key=lambda one: one.entry) if one.folder}
    old = [one for one in newest.values() if one.day < before]
    found, files = [], []
    for one in sorted(old, key=lambda each: each.entry):
        inside = list(_own_files(Path(one.folder), one.results_sha256))
        if inside:
            found.append(one)
            files += inside
    return Retained(tuple(found), tuple(files))


def remove_retained(records: Records, retained: Retained, keep_years: int) -> None:
    """Say in the records what is removed, then remove it; what a kill leaves of it is removed by the next retention."""
    if not retained.certificates:
        return
    records.append("retained", {
        "certificates": [one.entry for one in retained.certificates], "keep_years": keep_years,
        "files": [str(path) for path in retained.files],
    })  # fmt: skip
    for path in retained.files:
        with contextlib.suppress(FileNotFoundError):
            path.unlink()
    for folder in {path.parent for path in retained.files}:
        with contextlib.suppress(OSError):
            folder.rmdir()


def _own_files(folder: Path, results: str) -> Iterator[Path]:
    """The set's files, results.json and the manifest last, so that what is left of a kill is known as a set still."""
    manifest = read_manifest(folder)
    if manifest is None or sha256_of(folder / RESULTS) != results:
        return
    for name, digest in sorted(manifest.files.items()):
        if name != RESULTS and sha256_of(folder / name) == digest:
            yield folder / name
    yield folder / RESULTS
    yield folder / MANIFEST
