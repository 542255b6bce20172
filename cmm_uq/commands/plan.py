"""From a job still to be measured to its written plan."""

from __future__ import annotations

from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path

from cmm_uq.commands.planning import Plan, Progress, make_plan
from cmm_uq.commands.reading import read_job
from cmm_uq.planning.placing import joined
from cmm_uq.writing import staging, write_whole


@dataclass(frozen=True, eq=False)
class WrittenPlan:
    """What was planned, contents of results.json, and what was written, by name."""

    plan: Plan
    results: bytes
    files: dict[str, Path]


def write_plan(
    job: Path, out: Path | None = None, *, power: bool = True, seed: int = 0, stage: Progress | None = None
) -> WrittenPlan:
    """Plan a job and write ``plan.csv``, ``plan.html`` and ``results.json``, all or none.

    ``plan.csv`` has the columns of a recording of the artefact, at nominal coordinates; it is left out where nothing is left
    to measure.

    Parameters
    ----------
    job : the job folder; its recording may be missing.
    out : where to write; ``reports/<job id>`` by default.
    power : whether to predict what the diagnosis would find, which takes most of the time.
    seed : of the recordings drawn for that.
    stage : told of progress.

    Raises
    ------
    CmmUqError : the plan is impossible, or the folder cannot be written to.
    """
    tell = stage or (lambda what, part: None)
    with ExitStack() as stack:
        place = stack.enter_context(staging(out)) if out else None
        plan = make_plan(read_job(job, recorded=False), power=power, seed=seed, progress=tell)
        folder = out or Path("reports") / plan.job.facts.job.id
        place = place or stack.enter_context(staging(folder))
        from cmm_uq.commands.plan_page import plan_document, plan_results
        from cmm_uq.documents.html import render_html
        from cmm_uq.documents.results_file import as_json

        tell("Drawing the placings", 0.95)
        data = as_json(plan_results(plan))
        contents = {"plan.html": render_html(plan_document(plan)).encode(), "results.json": data}
        if plan.to_measure:
            contents["plan.csv"] = _recording_to_be(plan)
        files = write_whole(place, folder, contents)
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
    return b"# planned, nothing is measured yet: nominal coordinates\n" + recording(points)
