"""What the inputs of a certificate give when they are computed again, held against it."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial

from cmm_uq import __version__
from cmm_uq.analysis.diagnosis.diagnosis import FALSE_ALARMS
from cmm_uq.app.commands.certificates.affected import JobInputs, between, order, stated_version
from cmm_uq.app.commands.certificates.verification import Computing, version_of
from cmm_uq.app.commands.diagnose import DIAGNOSE, diagnosis_outcome
from cmm_uq.app.commands.files import Stage, silent
from cmm_uq.app.commands.report import REPORT, report_outcome
from cmm_uq.base.errors import CmmUqError
from cmm_uq.certificate.results.provenance import FILE, same_but_for_the_platform
from cmm_uq.certificate.verify import views
from cmm_uq.certificate.verify.again import Again, compare_again, compare_figures, plugins_missing
from cmm_uq.certificate.verify.given import AGAIN, RESULTS, Given, Inquiry
from cmm_uq.jobs.job import Job
from cmm_uq.laboratory.records.facts import ChainHead, Heads

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


def of_a_machine(compute: Compute | None = None, stage: Stage = silent) -> Computing:
    """What computes the certificate of a machine again: by ``compute``, by default as ``report`` and ``diagnose`` do."""

    def computing(inquiry: Inquiry, given: Given, job: Job) -> bool:
        computed = partial(compute, given, job) if compute else partial(again, given, job, stage)
        command = "report" if given.results and "estimates" in given.results[1] else "diagnose"
        return compute_again(inquiry, given, computed, command, job)

    return computing
