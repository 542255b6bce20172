"""Is the report of a part what it says? Its figures and inputs, the machine's certificate inside, and all computed again."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

from cmm_uq.analysis.parts.reported import measured_of
from cmm_uq.analysis.parts.setup import plan_of
from cmm_uq.app.commands.certificates import verification
from cmm_uq.app.commands.certificates.again import as_attached, compute_machine_again, recomputed
from cmm_uq.app.commands.certificates.further import further_certificates, verify_further
from cmm_uq.app.commands.files import Stage
from cmm_uq.app.commands.parts.drift import FILE as HISTORY
from cmm_uq.app.commands.parts.machine import CALIBRATION, attached_calibration, standing_of, verified, with_history
from cmm_uq.app.commands.parts.part import PartOptions, contents_of, evaluate_part
from cmm_uq.app.commands.reading import in_language
from cmm_uq.base.errors import CmmUqError
from cmm_uq.certificate.origin import PassedTest
from cmm_uq.certificate.part.measurement import standing_data
from cmm_uq.certificate.verify.again import Again, check_results
from cmm_uq.certificate.verify.decisions import check_part_decisions
from cmm_uq.certificate.verify.figures import check_part_figures, check_part_job, check_standing, check_verdicts
from cmm_uq.certificate.verify.given import AGAIN, NOT_ASKED, RESULTS, Given, Inquiry, language_of
from cmm_uq.jobs.part.job import PartJob, part_of
from cmm_uq.jobs.source import sha256
from cmm_uq.laboratory.records.facts import ChainHead, Heads

TRUSTED = "whose signature the machine's certificate has"


def compare_part(inquiry: Inquiry, given: Given, *, rerun: bool, trust: Iterable[Path] | None) -> PartJob | None:
    """Figures, decisions, inputs and the machine's certificate of a part's report; its job, where the inputs are sound."""
    if given.results is None:
        return None
    name, data, _ = given.results
    with inquiry.reading("figures", name):
        check_results(inquiry, given)
        check_part_figures(inquiry, data, name)
        check_part_decisions(inquiry, data, name)
        check_verdicts(inquiry, data, name)
    if (job := verification.job_of_inputs(inquiry, given, part_job, "the machine's certificate")) is None:
        return None
    try:
        _check_job(inquiry, job, data, name)
        _check_machine(inquiry, job, data, name, rerun=rerun, trust=trust)
    except (KeyError, TypeError, AttributeError) as error:
        inquiry.wrong("inputs", name, "", f"has not the parts that cmm-uq writes ({type(error).__name__}: {error})")
        return None
    return job


def part_job(inputs: Mapping[str, bytes], data: Mapping[str, Any]) -> PartJob:
    """The job of the inputs of a part's report, with those of the machine's job where that was analysed."""
    language = language_of(data)
    stated = {name: content for name, content in inputs.items() if name != HISTORY}
    own = {name: content for name, content in stated.items() if not name.startswith(CALIBRATION)}
    job = in_language(part_of(own), language)
    if job.facts.machine_state.job is None:
        job = job if len(own) == len(stated) else in_language(part_of(stated), language)
    else:
        job = replace(job, inputs={**job.inputs, **stated})
    return with_history(job, inputs.get(HISTORY))


def _check_job(inquiry: Inquiry, job: PartJob, data: Mapping[str, Any], file: str) -> None:
    inquiry.looked("inputs")
    if sorted(data["job"]["inputs_sha256"]) != sorted(job.inputs):
        inquiry.wrong("inputs", file, "job.inputs_sha256", "names other files than the job",
                      sorted(data["job"]["inputs_sha256"]), sorted(job.inputs))  # fmt: skip
    try:
        of_part = measured_of(job)
        plan = plan_of(of_part.job)
    except CmmUqError as error:
        inquiry.wrong("inputs", file, "", f"is of a job that cannot be evaluated: {error}")
        return
    check_part_job(inquiry, of_part.job, plan, of_part.values, data, file)


def _check_machine(
    inquiry: Inquiry, job: PartJob, data: Mapping[str, Any], file: str, *, rerun: bool, trust: Iterable[Path] | None
) -> None:
    """The certificate that states the machine, verified as it would be by itself, and whether it held on the day."""
    said, computing = data["machine"], compute_machine_again if rerun else None
    held = bool(said["signatures_held_to_trusted"])
    if job.facts.machine_state.job is not None:
        inquiry.looked("inputs")
        hashes = sha256(attached_calibration(job))
        if said["inputs_sha256"] != hashes:
            inquiry.wrong("inputs", file, "machine.inputs_sha256", "are not the machine's job inside",
                          said["inputs_sha256"], hashes)  # fmt: skip
        inquiry.notes.append("No certificate states the machine: its job was analysed, and is inside.")
        for name, one in verify_further(job, computing, trust=trust if held else None):
            verification.merge(inquiry, one.inquiry, name)
        return
    if held and trust is None:
        inquiry.left(TRUSTED, "it was held to trusted certificates, and none are given (--trust)")
    where = ", ".join(job.stated_by)
    try:
        found = verified(job, rerun=rerun, trust=trust if held else None)
    except CmmUqError as error:
        inquiry.wrong("inputs", where, "", f"is no certificate that states the machine: {error}")
        return
    verification.merge(inquiry, found.inquiry, where)
    further = tuple(verify_further(job, computing, trust=trust if held else None))
    for name, one in further:
        verification.merge(inquiry, one.inquiry, name)
    if found.inquiry.findings or any(one.inquiry.findings for _, one in further):
        return
    inquiry.looked("dates")
    try:
        standing = standing_of(job, found)
        more = further_certificates(job, found.job, further)
    except CmmUqError as error:
        inquiry.wrong("dates", where, "", f"does not hold for this part: {error.problem}")
        return
    passed = tuple(PassedTest(one, 0, 1.0, used=True) for one in job.facts.machine_state.passed)
    should = standing_data(replace(standing, further=tuple(one.certificate for one in more), passed=passed))
    check_standing(inquiry, should, data, file)


def part_again(
    inquiry: Inquiry, given: Given, job: PartJob, data: Mapping[str, Any], *, trust: Iterable[Path] | None, stage: Stage
) -> Again | None:
    """What the inputs of a part's report give; ``None`` where that cannot be known, with the reason kept."""
    said, simulation = data["machine"], data["simulation"]
    held = bool(said["signatures_held_to_trusted"])
    if held and trust is None:
        inquiry.left(AGAIN, "the machine's certificate was held to trusted certificates, and none are given (--trust)")
        return None
    history = job.inputs.get(HISTORY)
    if history is not None:
        changes = "The machine's changes since its calibration follow from its history inside, as records had it."
        inquiry.notes.append(changes)
    options = PartOptions(
        _whole(simulation["seed"], "seed"), _whole(simulation["asked"], "asked"), simulation["digits"], to_rerun(said),
        tuple(trust or ()) if held else None, None, history,
    )  # fmt: skip
    found, kept = evaluate_part(job, options, stage), list[str]()
    finished, heads = partial(as_attached, given, kept), Heads(ChainHead.of_results(data))
    files = contents_of(found, stage, finished=finished, heads=heads)
    return recomputed(given, files, kept, tuple(found.files))


def to_rerun(said: Mapping[str, Any]) -> bool:
    """Whether the machine's certificate was to be computed again, with ``--rerun``; another version may have made it."""
    return {"what": AGAIN, "why": NOT_ASKED} not in said["not_checked"]


def _whole(value: Any, key: str) -> int:
    if not isinstance(value, int) or value < 0:
        raise CmmUqError(f"{value!r} is none", where=f"{RESULTS}: simulation.{key}")
    return value
