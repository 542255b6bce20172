"""A certificate verified, of a machine or of a part: what both have in common, and the certificate of a machine.

Its files are compared with each other, and with what is computed again from its inputs. What is verified, a machine's
certificate or a part's report, is examined by a function, so that the evaluation of a part can verify the certificate of its
machine. Nothing of a given file is run. Inputs are read from memory as the PDF has them, so that a path in them leads nowhere;
what takes part in the computation is installed here.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from cmm_uq import __version__
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.values import dataclass
from cmm_uq.certificate.document import WORDS
from cmm_uq.certificate.verify import given as files, sources, views
from cmm_uq.certificate.verify.given import AGAIN, NOT_ASKED, RESULTS, Given, Inquiry
from cmm_uq.jobs.tables.identification import MEASURED
from cmm_uq.laboratory.records.opening import open_records

if TYPE_CHECKING:
    from cmm_uq.app.commands.files import Stage
    from cmm_uq.jobs.job import Job


@dataclass(frozen=True)
class Verification:
    """The forms of a certificate, what was found, and the job of the inputs where these are sound; of a part's report none."""

    given: Given
    inquiry: Inquiry
    job: Job | None = None

    @property
    def subject(self) -> str:
        """The document that was verified, by title and number; the job where there is none."""
        if self.given.html is not None:
            return " ".join(self.given.html[1].title.split())
        if self.given.pdf is not None and (title := self.given.pdf[1].information.get("/Title")):
            return " ".join(title.split())
        return str(self.given.results[1]["job"]["id"]) if self.given.results is not None else ""

    @property
    def said(self) -> str:
        """In one line who says what of which machine, and what it rests on: what the certificate claims."""
        verdicts = ((self.given.results[1].get("verdicts") or {}) if self.given.results is not None else {}) or {}
        decided = str.__str__(WORDS[word]).lower() if (word := str(verdicts.get("overall"))) in WORDS else ""
        if self.job is None:
            return f"{self.subject}: {decided or 'no conformity is stated'}"
        facts, artefact, chain = self.job.facts, self.job.facts.artefact, self.job.facts.artefact.certificate
        who = facts.laboratory.name or "A laboratory that is not named"
        machine = f"{facts.machine.name}{f' ({facts.machine.serial})' if facts.machine.serial else ''}"
        when = f"{'measured' if facts.job.origin == MEASURED else facts.job.origin}, {facts.job.date}"
        standards = f" by {', '.join(dict.fromkeys(one.standard for one in facts.conformity))}" if decided else ""
        rests = f"{artefact.name or artefact.kind}{f' {artefact.serial}' if artefact.serial else ''}"
        issued = f" by {chain.laboratory}" if chain is not None and chain.laboratory else ""
        by = (
            f"certificate {chain.number}{issued}"
            if chain is not None and chain.number
            else "whose certificate is not named"
        )
        outcome = f"{decided}{standards}" if decided else "states figures, and no conformity"
        return f"{who} says of {machine} ({when}): {outcome}. It rests on {rests}, {by}."


# the job of the inputs, and what computes all again: whether documents are the same to the byte; ``None`` without sound inputs
Examined = tuple["Job | None", Callable[[], bool] | None] | None
# computes all of a certificate's job again: whether its documents are the same to the byte
Computing = Callable[[Inquiry, Given, "Job"], bool]
Examine = Callable[[Inquiry, Given], Examined]  # compares figures, decisions and inputs


def verify_given(
    given: Given, examine: Examine, *, rerun: bool = True, trust: Iterable[Path] | None = None,
    schema: Path | None = None, records: str | Path | None = None, stage: Stage = lambda what, part: None,
) -> Verification:  # fmt: skip
    """Verify files that were read.

    ``trust``: ``None`` for nobody, and then nothing need be signed. ``records``: those that the certificate's head is looked
    for in; ``None`` for none.
    """
    inquiry = Inquiry()
    _check_schema(inquiry, given)
    views.open_digital(inquiry, given)
    files.check_files(inquiry, given)
    if given.rewritten:
        why = (
            "line ends, or a mark at the beginning, are others than they were issued with; nothing else was passed over"
        )
        inquiry.left(f"{', '.join(given.rewritten)} to the byte", why)
    stage("Comparing the forms", 0.1)
    trusted = None
    if trust is not None:
        from cmm_uq.certificate.sign import trust_of

        trusted = trust_of(tuple(trust))
    job, again = examine(inquiry, given) or (None, None)
    issued = None if job is None else job.facts.job.issued or job.facts.job.date
    signed = views.check_signatures(inquiry, given, trusted, issued)
    if records is not None:
        with open_records(records, read_only=True) as history:
            sources.check_records(inquiry, given, history, signed)
    if schema is not None:
        views.check_schema(inquiry, given, schema)
    alike = False
    if not rerun:
        inquiry.left(AGAIN, NOT_ASKED)
    elif again is not None:
        alike = again()
    forms = " and ".join(form[0] for form in (given.pdf, given.html) if form is not None)
    if forms and not alike:
        why = "they are compared where they are made again to the byte"
        if rerun and (made := version_of(given)) not in ("", __version__):
            why = f"made by version {made}, which alone makes them again to the byte, and this is {__version__}"
        inquiry.left(f"texts and layout of {forms}", why)
    stage("Done", 1.0)
    return Verification(given, inquiry, job)


def version_of(given: Given) -> str:
    """Of the package that made a certificate; empty where nothing says it."""
    return "" if given.results is None else str(given.results[1]["software"]["version"])


def _check_schema(inquiry: Inquiry, given: Given) -> None:
    """Refuse what is no results.json of a job before anything takes it for one."""
    if given.results is None:
        inquiry.left("figures", f"no {RESULTS} is given, and no PDF that has it inside")
        return
    name, data, _ = given.results
    job = data.get("job")
    hashes = job.get("inputs_sha256") if isinstance(job, dict) else None
    software = data.get("software")
    if (
        data.get("schema") not in (files.RESULTS_SCHEMA, files.PART_SCHEMA)
        or not isinstance(hashes, dict)
        or not all(isinstance(one, str) for one in hashes.values())
        or not isinstance(software, dict)
        or not isinstance(software.get("version"), str)
    ):
        known = f"neither {files.RESULTS_SCHEMA} nor {files.PART_SCHEMA}"
        raise CmmUqError(f"is {known}, with a job, the hashes of its inputs and the program", where=name,
                         fix="Give the results.json of cmm-uq report, diagnose or part")  # fmt: skip


def examine_certificate(inquiry: Inquiry, given: Given, computing: Computing | None = None) -> Examined:
    """The certificate of a machine: its job, computed again by ``compute``, by default as ``report`` and ``diagnose`` do."""
    if (job := _compare(inquiry, given)) is None:
        return None
    return job, None if computing is None else partial(computing, inquiry, given, job)


def _compare(inquiry: Inquiry, given: Given) -> Job | None:
    """The forms with each other, and figures, decisions, inputs and dates; the job, where its inputs are sound."""
    if given.results is None:
        return None
    from cmm_uq.certificate.verify import again, decisions, figures
    from cmm_uq.machine.physics.stated import physics_of

    name, data, _ = given.results
    with inquiry.reading("figures", name):
        again.check_results(inquiry, given)
        figures.check_figures(inquiry, data, name)
        decisions.check_decisions(inquiry, data, name)
        figures.check_verdicts(inquiry, data, name)
    job = job_of_inputs(inquiry, given, _job, "dates")
    if job is not None:
        sources.check_job(inquiry, job, data, name)
        sources.check_dates(inquiry, job)
        if given.xml is not None and (made := version_of(given)) != __version__:
            inquiry.left(f"{given.xml[0]} element by element", f"made by version {made}, and this is {__version__}")
        else:
            with physics_of(job):
                views.check_digital(inquiry, given, job)
    return job


def merge(inquiry: Inquiry, inner: Inquiry, where: str) -> None:
    """What was found of the certificate inside, named as such; itself by the name that it has among the inputs."""
    for one in inner.findings:
        file = where if where.rpartition("/")[2] == one.file else f"{where}: {one.file}"
        inquiry.findings.append(
            files.VerificationFinding(one.check, file, one.place, one.problem, one.stands, one.should)
        )
    for left in inner.unchecked:
        if (left.what, left.why) != (AGAIN, NOT_ASKED):
            inquiry.left(f"{where}: {left.what}", left.why)
    inquiry.notes += [f"{where}: {note}" for note in inner.notes]
    for check, count in inner.done.items():
        inquiry.looked(check, count)


_T = TypeVar("_T")


def job_of_inputs(
    inquiry: Inquiry, given: Given, read: Callable[[Mapping[str, bytes], Mapping[str, Any]], _T], further: str
) -> _T | None:
    """The job of sound inputs, read with results.json; ``further``: what besides computing again needs them."""
    inputs = sources.inputs_of(inquiry, given)
    if inputs is None or given.results is None:
        inquiry.left(f"{further} and {AGAIN}", "the inputs are not there as results.json names them")
        return None
    try:
        return read(inputs, given.results[1])
    except CmmUqError as error:
        inquiry.wrong("inputs", "inputs", "", f"are no job that this version reads: {error}")
        return None


def _job(inputs: Mapping[str, bytes], data: Mapping[str, Any]) -> Job:
    """The job of the inputs; a prediction that the job itself does not name was given with the command."""
    from cmm_uq.app.commands.reading import in_language, job_of

    job = in_language(job_of(inputs), files.language_of(data))
    beside = [name for name in inputs if name not in job.inputs]
    if len(beside) == 1 and (data.get("diagnosis") or {}).get("simulation"):
        from cmm_uq.jobs.derived_job import against

        return against(job, inputs[beside[0]], beside[0])
    return job
