"""From a job still to be measured to its plan: search and compose, then write."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from cmm_uq.analysis.planning.placing import joined
from cmm_uq.app.commands.reading import in_language, read_job
from cmm_uq.app.commands.written import Form, Stage, Written, silent
from cmm_uq.base.languages.language import Code
from cmm_uq.base.plugins import naming_package
from cmm_uq.certificate.lettering import lettered_in
from cmm_uq.certificate.outcome import Outcome
from cmm_uq.jobs.job import Job

if TYPE_CHECKING:
    from cmm_uq.app.commands.planning import Plan

TO_FILL_IN = "plan.csv"
PLAN = Form("plan", ("plan.html",), "plan", (TO_FILL_IN,))


@naming_package()
def plan_outcome(job: Job, *, power: bool = True, seed: int = 0, stage: Stage = silent) -> Outcome:
    """Plan a job that was read, whose recording may be missing; nothing is written.

    Parameters
    ----------
    job : that was read.
    power : whether to predict what the diagnosis would find, which takes most of the time.
    seed : of the recordings drawn for that.
    stage : told of progress.

    Raises
    ------
    CmmUqError : the plan is impossible.
    """
    from cmm_uq.app.commands.planning import make_plan

    plan = make_plan(job, power=power, seed=seed, progress=stage)
    from cmm_uq.app.commands.plan_page import plan_document
    from cmm_uq.app.commands.plan_results import plan_results
    from cmm_uq.app.commands.plan_summary import plan_summary

    stage("Drawing the placings", 0.95)
    with lettered_in(job.facts.job.language):
        document = plan_document(plan)
    return Outcome(
        plan, lambda: document, plan_results(plan), plan_summary(plan), document.warnings,
        {TO_FILL_IN: recording_to_be(plan)} if plan.to_measure else {},
        in_order=all(condition.met for condition in plan.conditions),
    )  # fmt: skip


def write_plan(
    job: Path,
    out: Path | None = None,
    *,
    power: bool = True,
    seed: int = 0,
    force: bool = False,
    stage: Stage | None = None,
    language: Code | None = None,
) -> Written:
    """Plan a job and write ``plan.csv``, ``plan.html`` and ``results.json``, all or none.

    ``plan.csv`` has the columns of a recording of the artefact, at nominal coordinates; it is left out where nothing is left
    to measure.

    Parameters
    ----------
    job : the job folder; its recording may be missing.
    out : where to write; ``reports/<job id>/plan`` by default.
    power : whether to predict what the diagnosis would find, which takes most of the time.
    seed : of the recordings drawn for that.
    force : keep what stands in the way as ``NAME.previous`` instead of refusing.
    stage : told of progress.
    language : of the page, instead of the job's.

    Raises
    ------
    CmmUqError : the plan is impossible, or something in the folder that this command did not write for this job.
    OutputError : the folder cannot be written to.
    """
    read, tell = in_language(read_job(job, recorded=False), language), stage or silent
    return PLAN.write(
        read, lambda: plan_outcome(read, power=power, seed=seed, stage=tell), out, force=force, stage=tell
    )


def recording_to_be(plan: Plan) -> bytes:
    """The placings that are still to be measured, as the CSV of a recording at nominal coordinates."""
    from cmm_uq.app.commands.simulate import to_fill_in

    wishes = plan.setting.plan
    points = joined(
        plan.to_measure, seconds_per_point=wishes.seconds_per_point, minutes_per_placing=wishes.minutes_per_placing,
        first=plan.first,
    )  # fmt: skip
    return to_fill_in(points)
