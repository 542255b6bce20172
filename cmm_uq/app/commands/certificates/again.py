"""What the inputs of certificates give when they are computed again: of one that is verified, of all that corrections touch.

Held against the certificate, figure by figure. The corrections are those of ``corrections.toml`` in the package.
"""

from __future__ import annotations

import json
import re
import tomllib
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import cache, partial
from hashlib import sha256
from importlib.resources import files as package_files
from itertools import takewhile
from math import isclose
from pathlib import Path
from typing import TYPE_CHECKING, Any

from cmm_uq import __version__
from cmm_uq.analysis.diagnosis.diagnosis import FALSE_ALARMS
from cmm_uq.app.commands.certificates.verification import version_of
from cmm_uq.app.commands.diagnose import DIAGNOSE, diagnosis_outcome
from cmm_uq.app.commands.files import Stage, called, silent
from cmm_uq.app.commands.laboratory.records import inputs_of
from cmm_uq.app.commands.reading import in_language, job_of
from cmm_uq.app.commands.report import REPORT, report_outcome
from cmm_uq.base.errors import CmmUqError, NotInstalledError, OutputError
from cmm_uq.base.languages.translation import ENGLISH, code_of
from cmm_uq.base.values import dataclass, replace
from cmm_uq.certificate.origin import as_json
from cmm_uq.certificate.results.provenance import FILE, same_but_for_the_platform
from cmm_uq.certificate.verify import views
from cmm_uq.certificate.verify.again import Again, compare_again, compare_figures, plugins_missing
from cmm_uq.certificate.verify.given import AGAIN, RESULTS, Given, Inquiry
from cmm_uq.jobs.job import Job, Recorded
from cmm_uq.jobs.recording.own import header, is_own
from cmm_uq.jobs.verdicts import Verdicts
from cmm_uq.laboratory.records import content as contents
from cmm_uq.laboratory.records.facts import PART, STANDING, ChainHead, Heads, RecordedCertificate, RecordedValue
from cmm_uq.laboratory.records.place import NONE

if TYPE_CHECKING:
    from cmm_uq.laboratory.records.store import Records

CORRECTIONS, JOB = "corrections.toml", "job.toml"
SAME = 1e-9  # relative difference within which figures are the same: results.json has ten digits
_PART = "a report of a part is computed again by cmm-uq verify, and anew by cmm-uq part"
Figures = tuple[float, float, float, float]  # recordedValue, u, lower and upper end of the interval


@dataclass(frozen=True)
class JobInputs:
    """What of a job's inputs decides whether a correction touches it.

    job : job.toml.
    columns : of its files; ``None`` where a recording is of another format, whose columns have other names.
    """

    job: Mapping[str, Any]
    columns: frozenset[str] | None = frozenset()

    @property
    def effects(self) -> set[str]:
        return set((self.job.get("model") or {}).get("effects") or ())

    @property
    def standards(self) -> tuple[str, ...]:
        return tuple(str(wish.get("standard")) for wish in self.job.get("conformity") or ())

    def has(self, key: str) -> bool:
        table: Any = self.job
        for part in key.split("."):
            if not isinstance(table, Mapping) or part not in table:
                return False
            table = table[part]
        return True

    @classmethod
    def of(cls, files: Mapping[str, bytes]) -> JobInputs:
        """Of the files of a job: a column of any of them counts."""
        job = tomllib.loads(files[JOB].decode("utf-8-sig"))
        recording = job.get("recording") or {}
        recordings = [files[name] for key in ("file", "earlier") if (name := str(recording.get(key))) in files]
        if not set(recording) <= set(Recorded.model_fields) or not all(map(is_own, recordings)):
            return cls(job, None)
        return cls(job, frozenset(name for file, content in files.items() if file != JOB for name in header(content)))


@dataclass(frozen=True)
class Correction:
    """A correction of the version that has it; empty parts are no reason to pass a certificate over."""

    version: str
    what: str
    commands: tuple[str, ...] = ()
    kinds: tuple[str, ...] = ()
    effects: tuple[str, ...] = ()
    standards: tuple[str, ...] = ()
    keys: tuple[str, ...] = ()
    columns: tuple[str, ...] = ()

    def concerns(self, command: str, kind: str, inputs: JobInputs | None) -> bool:
        """Whether it may touch what a command made of a job; inputs that cannot be read, or no kind, pass nothing over."""
        if (self.commands and command not in self.commands) or (self.kinds and kind and kind not in self.kinds):
            return False
        return inputs is None or not (
            (self.effects and not inputs.effects & set(self.effects))
            or (self.standards and not any(name.startswith(self.standards) for name in inputs.standards))
            or (self.keys and not any(map(inputs.has, self.keys)))
            or (self.columns and inputs.columns is not None and not inputs.columns & set(self.columns))
        )


@cache
def corrections() -> tuple[Correction, ...]:
    file = package_files("cmm_uq") / CORRECTIONS
    if not file.is_file():
        whole = "Install cmm-uq again, from a whole wheel"
        raise CmmUqError("the list of corrections is missing", where=str(file), fix=whole)
    try:
        return tuple(
            Correction(row.pop("version"), row.pop("what"), **{key: tuple(names) for key, names in row.items()})
            for row in tomllib.loads(file.read_text(encoding="utf-8"))["correction"]
        )
    except (tomllib.TOMLDecodeError, KeyError, TypeError) as error:
        raise CmmUqError(f"is no list of corrections: {error}", where=str(file)) from error


def between(first: str, last: str) -> tuple[Correction, ...]:
    """Corrections of versions after the first, that a certificate says of itself, up to the last."""
    return tuple(one for one in corrections() if stated_version(first) < order(one.version) <= order(last))


def order(version: str) -> tuple[int, ...]:
    """A version for comparing: its numbers, and no other parts."""
    parts = version.split(".")
    if not all(part.isascii() and part.isdigit() for part in parts):
        raise CmmUqError(f"{version!r} is no version", fix="Give it as 0.5.0")
    return tuple(map(int, parts))


def stated_version(version: str) -> tuple[int, ...]:
    """The version that a certificate says of itself, for comparing: of ``0.5.0rc1`` 0.5, which is before 0.5.0; of none ()."""
    return tuple(map(int, takewhile(lambda part: part.isascii() and part.isdigit(), version.split("."))))


@dataclass(frozen=True)
class FigureChange:
    """One figure that is another one now; ``None`` where there is none before, or after."""

    name: str
    quantity: str
    unit: str
    before: Figures | None
    after: Figures | None


@dataclass(frozen=True)
class AffectedCertificate:
    """One certificate that corrections touch.

    corrections : that touch it.
    changes : of its figures; ``None`` where it was not computed again.
    decision, diagnosis : as they are now.
    problem : why it was not computed again.
    written : folder of the draft that is to replace it.
    """

    certificate: RecordedCertificate
    corrections: tuple[Correction, ...]
    changes: tuple[FigureChange, ...] | None = None
    decision: str = ""
    diagnosis: str = ""
    problem: str = ""
    written: Path | None = None

    @property
    def changed(self) -> bool:
        """Whether a figure, the decision or the verdict is another one now."""
        before = (self.certificate.decision, self.certificate.diagnosis)
        return self.changes is not None and (bool(self.changes) or (self.decision, self.diagnosis) != before)


def affected_certificates(
    records: Records, first: str, last: str, *, recompute: bool = True, out: Path | None = None, where: str | None = NONE,
    stage: Stage = silent,
) -> Iterator[AffectedCertificate]:  # fmt: skip
    """Certificates of versions from the first on that corrections up to the last touch, by day.

    out : folder for drafts that are to replace those that changed; ``None`` to write none.
    """
    if order(last) > order(__version__):
        fix = "Install the version that has the corrections"
        raise CmmUqError(f"this is version {__version__}", where=f"--to {last}", fix=fix)
    if order(first) > order(last):
        raise CmmUqError(f"{last} is before {first}: nothing was corrected between them", where=f"--version {first}",
                         fix="Give the version that the oldest certificates were made by")  # fmt: skip
    if recompute and order(last) < order(__version__):
        raise CmmUqError(f"only version {last} computes as version {last} does, and this is {__version__}",
                         where=f"--to {last}", fix="Leave it out, or give --list")  # fmt: skip
    certificates = [
        one for one in records.certificates(origin=None, states=STANDING, command=None)
        if not stated_version(one.version) or order(first) <= stated_version(one.version) < order(last)
    ]  # fmt: skip
    jobs = Counter((one.command, one.job) for one in certificates)
    for count, certificate in enumerate(certificates):
        stage(f"Computing again: {certificate.job}", count / len(certificates))
        files, problem = _inputs(records, certificate)
        inputs = JobInputs.of(files) if files else None
        touching = tuple(
            one for one in between(certificate.version, last)
            if one.concerns(certificate.command, certificate.kind, inputs)
        )  # fmt: skip
        if touching and certificate.command == PART:
            yield AffectedCertificate(certificate, touching, problem=problem or _PART)
        elif touching and recompute and files:
            one_of_many = jobs[certificate.command, certificate.job] > 1
            name = f"{certificate.job}-{certificate.entry}" if one_of_many else certificate.job
            yield _again(certificate, touching, files, out and out / name, where)
        elif touching:
            yield AffectedCertificate(certificate, touching, problem=problem)


def _inputs(records: Records, certificate: RecordedCertificate) -> tuple[dict[str, bytes], str]:
    """Files of its job as its PDF carries them, or why they are not to be had."""
    try:
        files = inputs_of(Path(certificate.folder))
    except CmmUqError as error:
        return {}, str(error)
    recorded = records.entry(certificate.entry).data.get("inputs")
    if recorded != {name: sha256(content).hexdigest() for name, content in files.items()}:
        return {}, f"{certificate.folder}: holds the report of other inputs by now"
    if JOB not in files:
        return {}, f"{certificate.folder}: its PDF carries no {JOB}"
    return files, ""


def _again(
    certificate: RecordedCertificate, touching: tuple[Correction, ...], files: Mapping[str, bytes], folder: Path | None,
    where: str | None,
) -> AffectedCertificate:  # fmt: skip
    """The certificate computed again, in the language and with the seed of the first time."""
    report = certificate.command == "report"
    try:
        before: Mapping[str, Any] = json.loads((Path(certificate.folder) / RESULTS).read_bytes())
        seed = int((before.get("sampling") or {}).get("seed") or 0)
        job = in_language(job_of(files), code_of(before["job"].get("language", ENGLISH)))
        outcome = report_outcome(job, seed=seed) if report else diagnosis_outcome(job, seed=seed)
        data = json.loads(as_json(outcome.results))
        values = [RecordedValue(*row) for row in contents.values(data, called)]
        verdict = str((data.get("diagnosis") or {}).get("verdict") or "")
        changes, decision = tuple(_changes(certificate.values, values)), Verdicts.of_results(data).overall
        again = AffectedCertificate(certificate, touching, changes, decision, verdict)
        if folder is None or not again.changed:
            return again
        form, folder = (REPORT, folder) if report else (DIAGNOSE, folder / DIAGNOSE.below)
        form.write(job, lambda: outcome, folder, records=where)
        return replace(again, written=folder)
    except CmmUqError as error:
        return AffectedCertificate(certificate, touching, problem=str(error))


def _changes(before: tuple[RecordedValue, ...], after: list[RecordedValue]) -> Iterator[FigureChange]:
    """Figures that differ, or are only there before or after, in the order of those before."""
    old, new = ({value.name: value for value in values} for values in (before, after))
    for name in old | new:
        a, b = old.get(name), new.get(name)
        pair = tuple(None if one is None else (one.value, one.u, one.lower, one.upper) for one in (a, b))
        if a is not None and b is not None and a.unit == b.unit:
            same = partial(isclose, rel_tol=SAME, abs_tol=SAME * max(a.u, b.u))
            if all(map(same, pair[0] or (), pair[1] or ())):
                continue
        either = b or old[name]
        yield FigureChange(name, either.quantity, either.unit, *pair)


Compute = Callable[[Given, Job], Again]  # the second computation: of the job that is inside a certificate


def compute_again(
    inquiry: Inquiry, given: Given, compute: Callable[[], Again | None], command: str, job: Job | None = None
) -> bool:
    """Compute everything from the inputs and keep what differs: whether the documents are the same to the byte.

    By the version that made it everything is compared; of an earlier one figures and decisions, where no correction since
    then touches what a ``command`` makes of a ``job``, whatever it is where none is given.
    """
    if given.results is None or plugins_missing(inquiry, given.results[1]):
        return False
    made = version_of(given)
    if made != __version__ and not _computes_alike(inquiry, made, command, job):
        return False
    try:
        if (computed := compute()) is None:
            return False
        if made == __version__:
            return compare_again(inquiry, given, computed)
        compare_figures(inquiry, given, computed, made)
    except (NotInstalledError, OutputError):  # of this computer, not of the certificate
        raise
    except CmmUqError as error:
        inquiry.wrong("again", given.results[0], "", f"cannot be computed again: {error}")
    return False


def _computes_alike(inquiry: Inquiry, made: str, command: str, job: Job | None) -> bool:
    """Whether this version gives the figures of an earlier one; what was corrected since then is named."""
    of_job = ("", None) if job is None else (job.facts.artefact.kind, JobInputs.of(job.inputs))
    why = ": install that" if stated_version(made) >= order(__version__) else ""
    touching = [one for one in between(made, __version__) if one.concerns(command, *of_job)]
    inquiry.notes += [f"Version {one.version} corrects: {one.what}" for one in touching]
    if touching:
        verb = "correction since then touches" if len(touching) == 1 else "corrections since then touch"
        why = f"; {len(touching)} {verb} this certificate"
    if why:
        inquiry.left(AGAIN, f"made by version {made}, and this is {__version__}{why}")
    return not why


def again(given: Given, job: Job, stage: Stage = lambda what, part: None) -> Again:
    data = given.results[1] if given.results else {}
    seed = (data.get("sampling") or {}).get("seed") or 0
    if not isinstance(seed, int) or seed < 0:
        raise CmmUqError(f"{seed!r} is no seed", where=f"{RESULTS}: sampling.seed")
    if "estimates" in data:
        form, outcome = REPORT, report_outcome(job, seed=seed, stage=stage)
    else:
        alpha = (data.get("diagnosis") or {}).get("false_alarms", FALSE_ALARMS)
        if not isinstance(alpha, float) or not 0.0 < alpha < 1.0:
            raise CmmUqError(f"{alpha!r} is no rate of false alarms", where=f"{RESULTS}: diagnosis.false_alarms")
        form, outcome = DIAGNOSE, diagnosis_outcome(job, seed=seed, alpha=alpha, stage=stage)
    kept: list[str] = []
    heads = Heads(ChainHead.of_results(data))
    written = form.contents(outcome, stage, finished=partial(as_attached, given, kept), heads=heads)
    return recomputed(given, written, kept)


def recomputed(given: Given, written: Mapping[str, bytes], kept: Sequence[str], beside: Sequence[str] = ()) -> Again:
    """Files that were made again, with the PDF where it is set by the program that set the given one."""
    pdf = next((content for name, content in written.items() if name.endswith(".pdf")), None)
    files = {name: content for name, content in written.items() if not name.endswith(".pdf")}
    found = Again(files, None, kept=tuple(kept), beside=tuple(beside))
    if given.pdf is None or pdf is None:
        return found
    creator = re.search(rb"/Creator ?\(([^()]*)\)", pdf)
    made, here = given.pdf[1].information.get("/Creator", ""), creator[1].decode("latin-1") if creator else ""
    if made != here:
        return replace(found, why_no_pdf=f"they were set by {made or 'another program'}, and here is {here}")
    return replace(found, pdf=pdf)


def as_attached(given: Given, kept: list[str], name: str, content: bytes) -> bytes:
    """A file as it is attached where it is the same but for a signature, or for the platform, which is then kept in mind."""
    attached = given.files.get(name)
    if attached is None or attached == content or not (name == FILE or name.endswith(".xml")):
        return content
    try:
        if name.endswith(".xml"):
            return attached if views.same_unsigned(attached, content, name) else content
        if not same_but_for_the_platform(attached, content):
            return content
    except (CmmUqError, ValueError):
        return content
    kept.append(name)
    return attached


def compute_machine_again(
    inquiry: Inquiry, given: Given, job: Job, compute: Compute | None = None, stage: Stage = silent
) -> bool:
    """The certificate of a machine: by ``compute``, by default as ``report`` and ``diagnose`` do."""
    computed = partial(compute, given, job) if compute else partial(again, given, job, stage)
    command = "report" if given.results and "estimates" in given.results[1] else "diagnose"
    return compute_again(inquiry, given, computed, command, job)
