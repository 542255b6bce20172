"""``cmm-uq selftest``: evidence of software validation for a laboratory's file (ISO/IEC 17025:2017, 7.11.2)."""

from __future__ import annotations

import sys
from typing import Annotated

import typer


def command(
    quiet: Annotated[bool, typer.Option("--quiet", "-q", help="Print only what fails, and the count.")] = False,
) -> None:
    """Compute published reference figures and compare: expected, got, source. Exit code 1 when any differs."""
    from cmm_uq import __version__
    from cmm_uq.uncertainty.selftest import HEADINGS, as_text, run

    outcomes = run()
    shown = [row for row, outcome in zip(as_text(outcomes), outcomes, strict=True) if not (quiet and outcome.passed)]
    if sys.stdout.isatty():
        from rich.console import Console
        from rich.markup import escape
        from rich.table import Table

        table = Table(*HEADINGS)
        for row in shown:
            table.add_row(*(escape(cell) for cell in row))
        Console().print(table)
    else:
        for row in (HEADINGS, *shown):
            typer.echo("\t".join(row))
    passed = sum(outcome.passed for outcome in outcomes)
    typer.echo(f"cmm-uq {__version__}: {passed} of {len(outcomes)} figures within their tolerance")
    if passed < len(outcomes):
        raise typer.Exit(1)
