"""The command ``cmm-uq``: one subcommand a file, heavy imports only where they are used."""

from __future__ import annotations

import os
import signal
import sys
from types import FrameType

import typer

from cmm_uq.cli import budget, compensate, diagnose, plan, report, selftest, simulate
from cmm_uq.errors import CmmUqError

BAD_INPUT = 2
"""Exit code of everything that the user can mend."""

THREADS = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS")
"""Matrices here are small: more threads cost more than they gain, and how many there are would show in the last digits."""

app = typer.Typer(
    name="cmm-uq",
    help="Uncertainty of coordinate measuring machines, and the certificates that state it.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)
app.command("report")(report.command)
app.command("diagnose")(diagnose.command)
app.command("plan")(plan.command)
app.command("simulate")(simulate.command)
app.command("compensate")(compensate.command)
app.command("budget")(budget.command)
app.command("selftest")(selftest.command)


@app.callback(invoke_without_command=True)
def _version(version: bool = typer.Option(False, "--version", help="Print the version and stop.")) -> None:
    if version:
        from cmm_uq import __version__

        typer.echo(f"cmm-uq {__version__}")
        raise typer.Exit


def main() -> None:
    """Run the command; bad input ends with its message and exit code 2, an interruption without half a report."""
    for variable in THREADS:
        os.environ.setdefault(variable, "1")
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, _stop)
    try:
        app(prog_name="cmm-uq")
    except CmmUqError as error:
        typer.echo(f"cmm-uq: {error}", err=True)
        sys.exit(BAD_INPUT)


def _stop(number: int, frame: FrameType | None) -> None:
    """Ctrl-C and SIGTERM unwind the stack, so that unfinished files are removed."""
    typer.echo("cmm-uq: interrupted; nothing was written", err=True)
    sys.exit(128 + number)
