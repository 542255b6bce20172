"""From a job to the proof of its diagnosis: draw, seal, diagnose and judge, then write."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from cmm_uq.app.commands.files import REPORTS, Form, Stage, Written, silent
from cmm_uq.app.commands.reading import in_language, read_job
from cmm_uq.base.languages.language import Code
from cmm_uq.base.plugins import naming_package
from cmm_uq.certificate.outcome import Outcome
from cmm_uq.jobs.job import Job

if TYPE_CHECKING:
    from cmm_uq.app.commands.proving import Asked, Sealed
    from cmm_uq.laboratory.proving.running import Kept

PROVE = Form("prove", ("validation.html", "validation.pdf"), "prove", ("truth.json", "cases.jsonl"))

UNFINISHED = "cases.unfinished"
"""Folder, inside that of the files, with the truth and the answers of a run that is under way."""


@naming_package()
def prove_outcome(job: Job, asked: Asked, *, stage: Stage = silent) -> Outcome:
    """Prove the diagnosis on the set-ups of a job that was read; nothing is written.

    Parameters
    ----------
    job : that was read; its recording may be missing where its noise is stated.
    asked : how many cases, and the like.
    stage : told of progress.

    Raises
    ------
    CmmUqError : see :func:`cmm_uq.app.commands.proving.prove_job`.
    """
    return _outcome(job, asked, stage)[0]


def _outcome(
    job: Job, asked: Asked, stage: Stage, folder: Path | None = None, sealed: Sealed | None = None
) -> tuple[Outcome, Kept | None]:  # fmt: skip
    from cmm_uq.app.commands.proving import prove_job
    from cmm_uq.certificate.proof.results import proof_outcome

    proof, kept = prove_job(job, asked, folder=folder, stage=stage, sealed=sealed)
    stage("Composing the page", 0.94)
    return proof_outcome(proof), kept


def write_proof(
    job: Path, asked: Asked, out: Path | None = None, *, force: bool = False, stage: Stage | None = None,
    sealed: Sealed | None = None, language: Code | None = None,
) -> Written:  # fmt: skip
    """Prove the diagnosis on a job's set-ups and write page, truth, answers and ``results.json``, all or none.

    Truth and answers are kept in ``cases.unfinished`` while they come; the same call goes on with what an interrupted
    one left.

    Parameters
    ----------
    job : the job folder; its recording may be missing where its noise is stated.
    asked : how many cases, and the like.
    out : where to write; ``reports/<job id>/prove`` by default.
    force : keep what stands in the way as ``NAME.previous`` instead of refusing.
    stage : told of progress.
    sealed : told the hash of the truth before the first diagnosis.
    language : of the page, instead of the job's.

    Raises
    ------
    CmmUqError : see :func:`cmm_uq.app.commands.proving.prove_job`, or something in the folder that this command did not
        write for this job.
    OutputError : the folder cannot be written to.
    """
    tell = stage or silent
    tell("Reading the job", 0.0)
    read = in_language(read_job(job, recorded=False), language)
    folder = (out or REPORTS / read.facts.job.id / PROVE.below) / UNFINISHED
    open_: list[Kept] = []

    @naming_package()
    def outcome() -> Outcome:
        found, kept = _outcome(read, asked, tell, folder, sealed)
        if kept is not None:
            open_.append(kept)
        return found

    try:
        written = PROVE.write(read, outcome, out, force=force, stage=tell)
    except BaseException:
        for kept in open_:
            kept.close()
        raise
    for kept in open_:
        kept.remove()
    return written
