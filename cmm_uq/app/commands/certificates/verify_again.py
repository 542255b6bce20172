"""A certificate computed again from its inputs, by the version and packages that made it, and compared with what is given."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from importlib.metadata import PackageNotFoundError, version
from typing import TYPE_CHECKING, Any

from cmm_uq import __version__
from cmm_uq.base.errors import CmmUqError
from cmm_uq.certificate.verify.found import AGAIN, Inquiry
from cmm_uq.certificate.verify.given import RESULTS, Given

if TYPE_CHECKING:
    from cmm_uq.app.commands.files import Stage
    from cmm_uq.certificate.verify.again import Again
    from cmm_uq.jobs.job import Job

Compute = Callable[["Given", "Job"], "Again"]  # the second computation: of the job that is inside a certificate


def compute_again(inquiry: Inquiry, given: Given, job: Job, compute: Compute) -> bool:
    """Compute everything from the inputs, by this version, and keep what differs.

    Gives whether the documents are the same to the byte.
    """
    if given.results is None:
        return False
    data = given.results[1]
    made, here = str(data["software"]["version"]), __version__
    if plugins_missing(inquiry, data):
        return False
    if made != here:
        _by_another_version(inquiry, given, job, made)
        return False
    from cmm_uq.certificate.verify.again import compare_again

    try:
        return compare_again(inquiry, given, compute(given, job))
    except CmmUqError as error:
        inquiry.wrong("again", given.results[0], "", f"cannot be computed again: {error}")
        return False


def again(given: Given, job: Job, stage: Stage = lambda what, part: None) -> Again:
    """What the inputs of a certificate give."""
    from cmm_uq.analysis.diagnosis.diagnosis import FALSE_ALARMS
    from cmm_uq.app.commands.diagnose import DIAGNOSE, diagnosis_outcome
    from cmm_uq.app.commands.report import REPORT, report_outcome

    data = given.results[1] if given.results else {}
    seed = _seed(data)
    if "estimates" in data:
        form, outcome = REPORT, report_outcome(job, seed=seed, stage=stage)
    else:
        alpha = _alpha(data, FALSE_ALARMS)
        form, outcome = DIAGNOSE, diagnosis_outcome(job, seed=seed, alpha=alpha, stage=stage)
    kept: list[str] = []
    written = form.contents(outcome, stage, finished=partial(as_attached, given, kept))
    return recomputed(given, written, kept)


def recomputed(given: Given, written: Mapping[str, bytes], kept: Sequence[str], beside: Sequence[str] = ()) -> Again:
    """Files that were made again, with the PDF where it is set by the program that set the given one."""
    from cmm_uq.certificate.verify.again import Again

    pdf = next((content for name, content in written.items() if name.endswith(".pdf")), None)
    files = {name: content for name, content in written.items() if not name.endswith(".pdf")}
    found = Again(files, None, kept=tuple(kept), beside=tuple(beside))
    if given.pdf is None or pdf is None:
        return found
    made, here = given.pdf[1].information.get("/Creator", ""), _creator(pdf)
    if made != here:
        return replace(found, why_no_pdf=f"they were set by {made or 'another program'}, and here is {here}")
    return replace(found, pdf=pdf)


def as_attached(given: Given, kept: list[str], name: str, content: bytes) -> bytes:
    """A file as it is attached where it is the same but for a signature, or for the platform, which is then kept in mind."""
    from cmm_uq.certificate.results.provenance import FILE, same_but_for_the_platform
    from cmm_uq.certificate.verify.views import same_unsigned

    attached = given.files.get(name)
    if attached is None or attached == content or not (name == FILE or name.endswith(".xml")):
        return content
    try:
        if name.endswith(".xml"):
            return attached if same_unsigned(attached, content, name) else content
        if not same_but_for_the_platform(attached, content):
            return content
    except (CmmUqError, ValueError):
        return content
    kept.append(name)
    return attached


def _seed(data: Mapping[str, Any]) -> int:
    seed = (data.get("sampling") or {}).get("seed") or 0
    if not isinstance(seed, int) or seed < 0:
        raise CmmUqError(f"{seed!r} is no seed", where=f"{RESULTS}: sampling.seed")
    return seed


def _alpha(data: Mapping[str, Any], usual: float) -> float:
    alpha = (data.get("diagnosis") or {}).get("false_alarms", usual)
    if not isinstance(alpha, float) or not 0.0 < alpha < 1.0:
        raise CmmUqError(f"{alpha!r} is no rate of false alarms", where=f"{RESULTS}: diagnosis.false_alarms")
    return alpha


def _creator(pdf: bytes) -> str:
    found = re.search(rb"/Creator ?\(([^()]*)\)", pdf)
    return found[1].decode("latin-1") if found else ""


def plugins_missing(inquiry: Inquiry, data: Mapping[str, Any]) -> bool:
    """Packages that took part and are not here as they were then."""
    missing = False
    for package, wanted in (data["software"].get("plugins") or {}).items():
        try:
            here = version(str(package))
        except PackageNotFoundError:
            here = ""
        if here != wanted:
            missing = True
            told = f"version {here} is installed" if here else "it is not installed"
            inquiry.left(AGAIN, f"{package} {wanted} took part, and {told}")
    return missing


def _by_another_version(inquiry: Inquiry, given: Given, job: Job, made: str) -> None:
    """Say which corrections touch a certificate of another version, and compute its figures as they are now."""
    from cmm_uq.app.commands.certificates.affected import JobInputs as Inputs, between, order, stated_version as said

    if said(made) >= order(__version__):
        inquiry.left(AGAIN, f"made by version {made}, and this is {__version__}: install that")
        return
    command = "report" if given.results and "estimates" in given.results[1] else "diagnose"
    kind = job.facts.artefact.kind
    inputs = Inputs.of(job.inputs)
    touching = [one for one in between(made, __version__) if one.concerns(command, kind, inputs)]
    for one in touching:
        inquiry.notes.append(f"Version {one.version} corrects: {one.what}")
    told = "1 correction since then touches" if len(touching) == 1 else f"{len(touching)} corrections since then touch"
    inquiry.left(AGAIN, f"made by version {made}, and this is {__version__}; {told} this certificate")
