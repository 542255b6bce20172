"""From an outcome to the files of a command: rendered, written as one set, and recorded with that."""

from __future__ import annotations

import contextlib
import json
from collections.abc import Callable, Iterator, Mapping
from functools import cache
from hashlib import sha256
from pathlib import Path
from typing import TYPE_CHECKING, Any, Generic, TypeVar

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.languages.translation import translated as said_in
from cmm_uq.base.messages import NOTHING, Text
from cmm_uq.base.output import Ledger, Owner, staged
from cmm_uq.base.values import dataclass, replace
from cmm_uq.certificate.document import NOT_LETTERED, translated as said
from cmm_uq.certificate.origin import as_json, file_name, made_after, marked
from cmm_uq.certificate.plots.style import fonts_of
from cmm_uq.certificate.result import Outcome
from cmm_uq.certificate.wording import Summary
from cmm_uq.jobs.job import Job
from cmm_uq.laboratory.records.content import certificate_content, folder_from, kind_of_entry
from cmm_uq.laboratory.records.facts import BEGINNING, KEY, ChainHead, Heads
from cmm_uq.laboratory.records.opening import open_records
from cmm_uq.laboratory.records.place import NONE, is_url, of_folder, place_of, shown
from cmm_uq.machine.physics.catalogue import every
from cmm_uq.machine.physics.effect import Effect
from cmm_uq.machine.physics.stated import physics_of, with_own_physics

if TYPE_CHECKING:
    from cmm_uq.app.commands.certificates.signing import Signing
    from cmm_uq.jobs.part.job import PartJob
    from cmm_uq.laboratory.records.store import Records

_UNITS_AT_THE_END = ("mm", "um", "arcsec", "ppm", "rad", "deg", "m", "k", "per")


@contextlib.contextmanager
def opened(
    where: str | Path | None, out: Path | None, *, make: bool = True, create: bool = True, read_only: bool = False
) -> Iterator[Records | None]:
    """The records of a command; ``None`` where there are to be none, or are none and none are to be made.

    ``create``: whether a place that has nothing in it is made records.
    """
    place = place_of(where, of_folder(out))
    if place is None or not (make or is_url(place) or Path(place).exists()):
        yield None
        return
    with open_records(place, create=create, read_only=read_only) as records:
        yield records


def ledger_of(
    records: Records, job: Job | PartJob, command: str, folder: Path, files: Mapping[str, bytes], results: str
) -> Ledger:
    hashes = {name: sha256(data).hexdigest() for name, data in files.items()}
    with physics_of(job if isinstance(job, Job) else None):
        content = content_of(records.home, files[results], job, command, folder, hashes)
    return records.ledger(kind_of_entry(content), content)


class LateLedger:
    """A ledger of records that are opened, or begun, when its set is put in place: a signal before leaves no empty ones."""

    def __init__(self, begun: Callable[[], Ledger]) -> None:
        self._begun = cache(begun)

    def intend(self, token: str, folder: Path, manifest: str) -> None:
        self._begun().intend(token, folder, manifest)

    def commit(self, token: str) -> None:
        self._begun().commit(token)

    def forget(self, token: str) -> None:
        self._begun().forget(token)


@dataclass(frozen=True)
class RecordsToKeep:
    """The records that a command keeps what it writes in: ``at`` is ``None`` for none, ``known`` where none are there yet."""

    at: str | Path | None
    known: Records | None
    made: contextlib.ExitStack

    def heads(self, owner: Owner) -> Heads:
        """Where a document that is now made may say that they stand."""
        if self.at is None:
            return NOT_RECORDED
        return (
            Heads(ChainHead(0, BEGINNING, None)) if self.known is None else self.known.heads(owner.command, owner.job)
        )

    def ledger(self, ledger: Callable[[Records], Ledger]) -> Ledger | None:
        if (at := self.at) is None:
            return None
        return LateLedger(lambda: ledger(self.known or self.made.enter_context(open_records(at, create=True))))

    def said(self, how: str = "") -> str:
        return "" if self.at is None else f"Recorded in {shown(self.at)}{how}."


@contextlib.contextmanager
def kept_in(where: str | Path | None, out: Path | None) -> Iterator[RecordsToKeep]:
    with opened(where, out, make=False) as known, contextlib.ExitStack() as made:
        yield RecordsToKeep(place_of(where, of_folder(out)), known, made)


def content_of(
    home: Path | None, results: bytes, job: Job | PartJob | None, command: str, folder: Path, files: Mapping[str, str]
) -> dict[str, Any]:
    """Content of the entry of a results.json; see :func:`cmm_uq.laboratory.records.content.certificate_content`."""
    return certificate_content(
        json.loads(results), None if job is None else job.facts, command=command, folder=folder_from(home, folder),
        results_sha256=sha256(results).hexdigest(), files=files, named=called,
    )  # fmt: skip


def called(name: str) -> str:
    """How a value of results.json is called in the field: by its effect's title, else by its own name in words."""
    return _called(name, every().get(name.partition(".")[0]))


@cache
def _called(name: str, effect: Effect | None) -> str:
    own = name.partition(".")[2]
    if effect is None:
        words = own.split("_")
        while len(words) > 1 and words[-1] in _UNITS_AT_THE_END:
            words.pop()
        said = " ".join(words)
        return said[:1].upper() + said[1:]
    title = str(effect.title)
    what = next((str(one.what) for one in effect.reported if one.name == own and one.what), "")
    return f"{title}, {what}" if what else title


# told what is being done, after a colon what of it is counted, and the part of the whole that is done
Stage = Callable[[str, float], None]
Told = Callable[[Job], None]  # told of the job as it was read, before anything is computed of it
REPORTS, RESULTS = Path("reports"), "results.json"
NOT_RECORDED = Heads()
Finished = Callable[[str, bytes], bytes]  # what becomes of a document that was made, by its name


def unchanged(name: str, content: bytes) -> bytes:
    return content


def silent(what: str, part: float) -> None:
    """Nobody is told."""


Found = TypeVar("Found")


@dataclass(frozen=True, eq=False)
class Written(Generic[Found]):
    """What a command found, contents of results.json, its files by name, and what is said at its end."""

    found: Found
    results: bytes
    files: dict[str, Path]
    summary: Summary
    conforming: bool
    name: str  # id of the job, or of the file that it read
    origin: str = ""  # of the recording
    recorded: str = ""  # where it was recorded, in a sentence; empty where it was not


@dataclass(frozen=True)
class Form:
    """In which files a command writes an outcome, and where.

    documents : their names, in the order in which they are made: a digital certificate (``.xml``) carries the page before it,
        and is attached to the PDF after it; those of a recording that was not measured carry its origin.
    below : folder in ``reports/<job id>`` that is written to by default.
    further : names of files that come with it.
    recorded : whether what it writes is kept in records.
    """

    command: str
    documents: tuple[str, ...]
    below: str = ""
    further: tuple[str, ...] = ()
    recorded: bool = False

    def write(
        self, job: Job, outcome: Callable[[], Outcome], out: Path | None = None, *, force: bool = False,
        stage: Stage = silent, records: str | Path | None = NONE, signing: Signing | None = None,
    ) -> Written[Outcome]:  # fmt: skip
        """Make sure of the folder, then compute, render and write, all or none, and record it with that.

        ``records``: file or URL; ``none`` for none, ``None`` for those of the environment, else ``reports/records.db``.
        """
        fonts_of(job.facts.job.language)  # refused before anything is computed
        owner = self.owner(job)
        folder = out or REPORTS / owner.job / self.below
        expected = (*self.names(job), RESULTS, *self.further)
        where = records if self.recorded else NONE
        with (
            kept_in(where, out) as kept,
            staged(folder, owner, inputs=job.paths, force=force, expected=expected) as place,
        ):
            found = outcome()
            language = job.facts.job.language
            finished: Finished = unchanged
            if signing is not None:
                laboratory = job.facts.laboratory.model_dump()
                finished = signing.finished(laboratory, language=language, said=lambda text: said_in(text, language))
            contents = self.contents(found, stage, finished=finished, heads=kept.heads(owner))
            stage(f"Writing: {len(contents)} files to {folder}", 0.95)
            ledger = kept.ledger(lambda history: ledger_of(history, job, self.command, folder, contents, RESULTS))
            files = place.write(contents, ledger=ledger)
            by_name = "; the machine has no [machine] serial and is known by its name"
            recorded = kept.said("" if job.facts.machine.serial else by_name)
            recorded = " ".join(filter(None, (recorded, NOT_LETTERED.get())))
        stage("Done", 1.0)
        ends = (found.summary, found.conforming, job.facts.job.id, job.origin, recorded)
        return Written(found, contents[RESULTS], files, *ends)

    def owner(self, job: Job) -> Owner:
        return Owner(self.command, job.facts.job.id, job.origin)

    def contents(
        self,
        outcome: Outcome,
        stage: Stage = silent,
        *,
        results_only: bool = False,
        finished: Finished = unchanged,
        heads: Heads = NOT_RECORDED,
    ) -> dict[str, bytes]:
        """Bytes of every file, by name; of ``results.json`` alone where only figures are wanted."""
        data, line = results_at(outcome.results, heads) if self.recorded else (as_json(outcome.results), NOTHING)
        if results_only:
            return {RESULTS: data}
        from cmm_uq.certificate.render import render_html, render_pdf
        from cmm_uq.certificate.results.provenance import FILE, provenance

        job = outcome.found.job
        document = said(replace(marked(outcome.document, job), records=line), job.facts.job.language)
        for name in {*outcome.files, *({FILE} & {*self.further})} & job.inputs.keys():
            raise CmmUqError("has the name of a file that this command writes", where=str(job.folder / name),
                             fix="Rename it, in job.toml too")  # fmt: skip
        rendered: dict[str, bytes] = {}
        further = {RESULTS: data, **outcome.files}
        for name in self.names(job):
            stage(f"Rendering: {name}", 0.8)
            if name.endswith(".html"):
                made = render_html(document).encode()
            elif name.endswith(".xml"):
                made = _digital(job, data, rendered)
            else:
                if FILE in self.further:
                    further[FILE] = finished(FILE, provenance(job, outcome.results, {**rendered, **further}))
                digital = {one: content for one, content in rendered.items() if one.endswith(".xml")}
                made = render_pdf(document, {**job.inputs, **digital, **further})
            rendered[name] = finished(name, made)
        return {**rendered, **further}

    def names(self, job: Job) -> list[str]:
        return [file_name(document, job.origin) for document in self.documents]


def results_at(results: Mapping[str, Any], heads: Heads) -> tuple[bytes, Text]:
    """Contents of results.json with the head at which it is made, or was where it was recorded before; and that in words."""
    for digest, head in {**heads.before, "": heads.now}.items():
        data = as_json({**results, KEY: head and head.data})
        if digest == sha256(data).hexdigest():
            break
    return data, made_after(head)


@with_own_physics
def _digital(job: Job, results: bytes, rendered: Mapping[str, bytes]) -> bytes:
    """The digital certificate, of results.json and the job alone, with the page as its human-readable copy."""
    from cmm_uq.certificate.digital_certificate.certificate import digital_certificate
    from cmm_uq.jobs.dcc import written

    page = next((content for name, content in rendered.items() if name.endswith(".html")), None)
    return written(digital_certificate(json.loads(results), job, html=page, file=results))
