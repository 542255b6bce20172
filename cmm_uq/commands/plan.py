"""From a job still to be measured to its written plan."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from cmm_uq.commands.planning import Plan, Progress, make_plan
from cmm_uq.commands.reading import read_job
from cmm_uq.commands.report import REPORTS
from cmm_uq.documents.origin import file_name, marked
from cmm_uq.jobs.origin import PLANNED
from cmm_uq.planning.placing import joined
from cmm_uq.writing import Owner, staged


@dataclass(frozen=True, eq=False)
class WrittenPlan:
    """What was planned, contents of results.json, and what was written, by name."""

    plan: Plan
    results: bytes
    files: dict[str, Path]

    @property
    def conforming(self) -> bool:
        """Whether the plan has all that the standard it is named after asks for."""
        return all(condition.met for condition in self.plan.conditions)


def write_plan(
    job: Path,
    out: Path | None = None,
    *,
    power: bool = True,
    seed: int = 0,
    force: bool = False,
    stage: Progress | None = None,
) -> WrittenPlan:
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

    Raises
    ------
    CmmUqError : the plan is impossible, or something in the folder that this command did not write for this job.
    OutputError : the folder cannot be written to.
    """
    tell = stage or (lambda what, part: None)
    read = read_job(job, recorded=False)
    owner = Owner("plan", read.facts.job.id, read.origin)
    page = file_name("plan.html", read.origin)
    folder = out or REPORTS / owner.job / "plan"
    with staged(folder, owner, inputs=read.paths, force=force, expected=(page, "plan.csv", "results.json")) as place:
        plan = make_plan(read, power=power, seed=seed, progress=tell)
        from cmm_uq.commands.plan_page import plan_document, plan_results
        from cmm_uq.documents.html import render_html
        from cmm_uq.documents.results_file import as_json

        tell("Drawing the placings", 0.95)
        data = as_json(plan_results(plan))
        contents = {page: render_html(marked(plan_document(plan), plan.job)).encode(), "results.json": data}
        if plan.to_measure:
            contents["plan.csv"] = _recording_to_be(plan)
        files = place.write(contents)
    tell("Done", 1.0)
    return WrittenPlan(plan, data, files)


def _recording_to_be(plan: Plan) -> bytes:
    """The placings as the CSV of a recording at nominal coordinates."""
    from cmm_uq.commands.simulate import recording

    wishes = plan.setting.plan
    points = joined(
        plan.to_measure, seconds_per_point=wishes.seconds_per_point, minutes_per_placing=wishes.minutes_per_placing,
        first=plan.first,
    )  # fmt: skip
    return PLANNED.encode() + recording(points)
