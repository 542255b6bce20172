"""From a job to its certificate, or its diagnosis: analyse and compose, then write."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from cmm_uq.analysis.diagnosis.diagnosis import FALSE_ALARMS
from cmm_uq.app.commands import analysis, diagnose
from cmm_uq.app.commands.certificates.reissue import reissued, with_replaced
from cmm_uq.app.commands.files import Form, Stage, Told, Written, silent
from cmm_uq.app.commands.reading import compared_with, in_language, read_job
from cmm_uq.base.languages.translation import Code
from cmm_uq.base.plugins import naming_package
from cmm_uq.certificate.diagnosis.sections import TO_FILL_IN
from cmm_uq.certificate.origin import DIGITAL
from cmm_uq.certificate.outcome import Outcome
from cmm_uq.certificate.results.provenance import FILE as PROVENANCE
from cmm_uq.jobs.job import Job
from cmm_uq.laboratory.records.place import NONE

if TYPE_CHECKING:
    from cmm_uq.app.commands.signing import Signing

CERTIFICATE = ("certificate.html", DIGITAL, "certificate.pdf")
DIAGNOSIS = ("diagnosis.html", "diagnosis.pdf")
REPORT = Form("report", CERTIFICATE, further=(PROVENANCE,), recorded=True)
DIAGNOSE = Form("diagnose", DIAGNOSIS, "diagnosis", (TO_FILL_IN,), recorded=True)


@naming_package()
def report_outcome(job: Job, *, seed: int = 0, stage: Stage = silent, composed: bool = True) -> Outcome:
    """Analyse a job that was read and compose its certificate; nothing is written.

    Parameters
    ----------
    job : that was read.
    seed : of everything random.
    stage : told of progress.
    composed : whether the certificate is composed, too, so that whatever stops it is said here; figures are the same.

    Raises
    ------
    CmmUqError : the job cannot be analysed.
    """
    found = analysis.analyse_job(
        job, seed=seed, progress=lambda part: stage(_sampled("Sampling the posterior", part), 0.1 + 0.4 * part)
    )
    stage("Composing the certificate", 0.5)
    outcome = reissued(analysis.outcome_of(found, seed))
    if composed:
        outcome.document  # noqa: B018 - composed when it is first asked for
    return outcome


def write_report(
    job: Path, out: Path | None = None, *, seed: int = 0, force: bool = False, stage: Stage | None = None,
    told: Told | None = None, records: str | Path | None = NONE, language: Code | None = None,
    signing: Signing | None = None,
) -> Written:  # fmt: skip
    """Analyse a job and write its certificate (HTML, PDF, DCC), ``results.json`` and ``provenance.json``, all or none.

    A kind may add files of its own. Documents of a recording that was not measured carry its origin in their names.

    Parameters
    ----------
    job : the job folder.
    out : where to write; ``reports/<job id>`` by default.
    seed : of everything random.
    force : keep what stands in the way as ``NAME.previous`` instead of refusing.
    stage : told of progress.
    told : of the job, before anything is computed.
    records : that it is recorded in: file, URL, ``none``, or ``None`` for those of the environment, else beside the folder.
    language : of the documents, instead of the job's.
    signing : who signs the certificate; ``None`` for nobody.

    Raises
    ------
    CmmUqError : the job cannot be analysed, the certificate cannot be signed, or something in the folder that this command did
        not write for this job.
    OutputError : the folder cannot be written to.
    """
    tell = stage or silent
    tell("Reading the job", 0.0)
    read = with_replaced(in_language(read_job(job), language), records, out)
    analysis.report_recipe(read)  # refused before anything is made
    if told is not None:
        told(read)
    return REPORT.write(read, lambda: report_outcome(read, seed=seed, stage=tell), out, force=force, stage=tell,
                        records=records, signing=signing)  # fmt: skip


@naming_package()
def diagnosis_outcome(job: Job, *, seed: int = 0, alpha: float = FALSE_ALARMS, stage: Stage = silent) -> Outcome:
    """Diagnose a job that was read and compose the page; nothing is written.

    Parameters
    ----------
    job : that was read.
    seed : of everything random.
    alpha : rate of false alarms.
    stage : told of progress.

    Raises
    ------
    CmmUqError : the job cannot be diagnosed.
    """
    readings = f": {len(job.points)} readings" if job.facts.artefact.with_recording else ""
    stage(f"Searching for what was left out{readings}", 0.0)
    found = diagnose.diagnose_read(
        job, seed=seed, alpha=alpha, progress=lambda part: stage(_sampled("Sampling", part), 0.7 + 0.2 * part)
    )
    stage("Composing the page", 0.9)
    return diagnose.outcome_of(found, seed)


def write_diagnosis(
    job: Path,
    out: Path | None = None,
    *,
    seed: int = 0,
    alpha: float = FALSE_ALARMS,
    against: Path | None = None,
    force: bool = False,
    stage: Stage | None = None,
    told: Told | None = None,
    records: str | Path | None = NONE,
    language: Code | None = None,
) -> Written:
    """Diagnose a job and write ``diagnosis.html``, ``diagnosis.pdf`` and ``results.json``, all or none.

    Where further set-ups would tell more, ``next_plan.csv`` comes with them.

    Parameters
    ----------
    job : the job folder.
    out : where to write; ``reports/<job id>/diagnosis`` by default.
    seed : of everything random.
    alpha : rate of false alarms.
    against : file of a simulation's prediction that the recording is compared with, whatever the job names.
    force : keep what stands in the way as ``NAME.previous`` instead of refusing.
    stage : told of progress.
    told : of the job, before anything is computed.
    records : that it is recorded in: file, URL, ``none``, or ``None`` for those of the environment, else beside the folder.
    language : of the documents, instead of the job's.

    Raises
    ------
    CmmUqError : the job cannot be diagnosed, or something in the folder that this command did not write for this job.
    OutputError : the folder cannot be written to.
    """
    read, tell = in_language(read_job(job), language), stage or silent
    if against is not None:
        read = compared_with(read, against)
    if told is not None:
        told(read)
    return DIAGNOSE.write(
        read, lambda: diagnosis_outcome(read, seed=seed, alpha=alpha, stage=tell), out, force=force, stage=tell,
        records=records,
    )  # fmt: skip


def _sampled(what: str, part: float) -> str:
    """A stage with how much of the draws that are needed is there."""
    return f"{what}: {part:.0%} of the draws"
