"""``cmm-uq plan JOB``: which placings to measure, and what they will tell."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from cmm_uq.cli.options import Json, Out, Quiet
from cmm_uq.cli.progress import shown

if TYPE_CHECKING:
    from cmm_uq.commands.planning import Plan


def command(
    job: Annotated[Path, typer.Argument(help="Job folder; its recording may still be missing.")],
    out: Out = None,
    power: Annotated[
        bool, typer.Option(help="Predict how large an effect must be for the diagnosis to find it.")
    ] = True,
    seed: Annotated[int, typer.Option(help="Seed of the recordings drawn for that.", min=0)] = 0,
    quiet: Quiet = False,
    json: Json = False,
) -> None:
    """Say what placings determine, search for better ones, and write plan.csv, plan.html and results.json."""
    with shown(quiet=quiet or json) as stage:
        from cmm_uq.commands.plan import write_plan

        written = write_plan(job, out, power=power, seed=seed, stage=stage)
    if json:
        sys.stdout.write(written.results.decode())
    elif not quiet:
        _summarise(written.plan)
        for path in written.files.values():
            typer.echo(path)


def _summarise(plan: Plan) -> None:
    from cmm_uq.commands.plan_page import placing_rows
    from cmm_uq.commands.plan_words import STATUS, absorbed, combination, expected, named, pairs, unit_of

    _table(("No.", "Set up", "From → to / mm", "Points", "min"), placing_rows(plan))
    for text in plan.free:
        typer.echo(f"No reading shows: {text}.")
    found = plan.outlook.identifiability
    if found is not None:
        rows = [(named(p), f"u = {expected(p)} {unit_of(p)}", STATUS[p.status]) for p in found.parameters]
        _table(("Parameter", "Expected", ""), rows)
        for parts in found.free:
            typer.echo(f"Stays free: {combination(parts)}.")
        for text in pairs(found):
            typer.echo(f"Could not be told apart: {text}.")
        for text in absorbed(found):
            typer.echo(f"Would be taken for what the job names: {text}.")
    for condition in plan.conditions:
        typer.echo(f"{'met' if condition.met else 'NOT MET'}: {condition.what}")


def _table(headings: tuple[str, ...], rows: Sequence[tuple[str, ...]]) -> None:
    """On a terminal with lines, elsewhere separated by tabs."""
    if not rows:
        return
    if sys.stdout.isatty():
        from rich.console import Console
        from rich.markup import escape
        from rich.table import Table

        table = Table(*headings)
        for row in rows:
            table.add_row(*(escape(cell) for cell in row))
        Console().print(table)
    else:
        for row in (headings, *rows):
            typer.echo("\t".join(row))
