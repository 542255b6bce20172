"""``cmm-uq selftest``: evidence of software validation for a laboratory's file (ISO/IEC 17025:2017, 7.11.2)."""

from __future__ import annotations

from typing import Annotated

import typer

from cmm_uq.cli import NOT_CONFORMING
from cmm_uq.cli.printing import say, table


def command(
    quiet: Annotated[bool, typer.Option("--quiet", "-q", help="Print only what fails, and the count.")] = False,
) -> None:
    """Compute published reference figures and compare: expected, got, source. Exit code 4 when any differs."""
    from cmm_uq import __version__
    from cmm_uq.uncertainty.selftest import HEADINGS, as_text, run

    outcomes = run()
    shown = [row for row, outcome in zip(as_text(outcomes), outcomes, strict=True) if not (quiet and outcome.passed)]
    table(shown, *HEADINGS)
    passed = sum(outcome.passed for outcome in outcomes)
    say(f"cmm-uq {__version__}: {passed} of {len(outcomes)} figures within their tolerance")
    if passed < len(outcomes):
        raise typer.Exit(NOT_CONFORMING)
