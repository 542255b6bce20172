"""``cmm-uq plan JOB``: which placings to measure, and what they will tell."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from cmm_uq.cli.options import Force, Json, Quiet, Strict
from cmm_uq.cli.printing import conclude, say, table
from cmm_uq.cli.progress import shown

if TYPE_CHECKING:
    from cmm_uq.commands.written import Written


def command(
    job: Annotated[Path, typer.Argument(help="Job folder; its recording may still be missing.")],
    out: Annotated[Path | None, typer.Option(help="Folder to write to.  [default: reports/<job id>/plan]")] = None,
    power: Annotated[
        bool, typer.Option(help="Predict how large an effect must be for the diagnosis to find it.")
    ] = True,
    seed: Annotated[int, typer.Option(help="Seed of the recordings drawn for that.", min=0)] = 0,
    force: Force = False,
    strict: Strict = False,
    quiet: Quiet = False,
    json: Json = False,
) -> None:
    """Say what placings determine, search for better ones, and write plan.csv, plan.html and results.json."""
    with shown(quiet=quiet or json) as stage:
        from cmm_uq.commands.plan import write_plan

        written = write_plan(job, out, power=power, seed=seed, force=force, stage=stage)
    conclude(written, _summarise, json=json, quiet=quiet, strict=strict)


def _summarise(written: Written) -> None:
    from cmm_uq.commands.plan import plan_of
    from cmm_uq.commands.plan_page import placing_rows
    from cmm_uq.commands.plan_words import STATUS, absorbed, combination, expected, named, pairs, unit_of

    plan = plan_of(written.outcome)
    table(placing_rows(plan), "No.", "Set up", "From → to / mm", "Points", "min")
    for text in plan.free:
        say(f"No reading shows: {text}.")
    found = plan.outlook.identifiability
    if found is not None:
        rows = [(named(p), f"u = {expected(p)} {unit_of(p)}", STATUS[p.status]) for p in found.parameters]
        table(rows, "Parameter", "Expected", "")
        for parts in found.free:
            say(f"Stays free: {combination(parts)}.")
        for text in pairs(found):
            say(f"Could not be told apart: {text}.")
        for text in absorbed(found):
            say(f"Would be taken for what the job names: {text}.")
    for condition in plan.conditions:
        say(f"{'met' if condition.met else 'NOT MET'}: {condition.what}")
    for path in written.files.values():
        say(str(path))
