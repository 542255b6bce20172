"""All subcommands, and how their options are read."""

from __future__ import annotations

import os

import typer

from cmm_uq.cli import budget, check, compensate, diagnose, importing, new, plan, report, schema, selftest, simulate
from cmm_uq.cli.printing import say
from cmm_uq.errors import CmmUqError

app = typer.Typer(
    name="cmm-uq",
    help="Uncertainty of coordinate measuring machines, and the certificates that state it.",
    epilog="Exit codes: 0 done; 2 bad input; 3 output impossible; 4 with --strict: done, not conforming or inconsistent; "
    "130, 143 interrupted.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)
app.command("new")(new.command)
app.command("import")(importing.command)
app.command("check")(check.command)
app.command("report")(report.command)
app.command("diagnose")(diagnose.command)
app.command("plan")(plan.command)
app.command("simulate")(simulate.command)
app.command("compensate")(compensate.command)
app.command("budget")(budget.command)
app.command("schema")(schema.command)
app.command("selftest")(selftest.command)


@app.callback(invoke_without_command=True)
def _version(version: bool = typer.Option(False, "--version", help="Print the version and stop.")) -> None:
    if version:
        from cmm_uq import __version__

        say(f"cmm-uq {__version__}")
        raise typer.Exit


def run() -> int:
    """Run the subcommand that the command line names; its exit code.

    Raises
    ------
    CmmUqError : bad input, among them unknown options; its subclass OutputError where nothing can be written.
    """
    try:
        os.getcwd()  # noqa: PTH109 - Path.cwd() asks the same
    except OSError:
        raise CmmUqError("the working folder is gone", fix="Change to a folder that exists") from None
    try:
        code = app(prog_name="cmm-uq", standalone_mode=False)
    except typer.Abort:
        raise CmmUqError("the answer did not come") from None
    except Exception as error:
        told = getattr(
            error, "format_message", None
        )  # an unknown option or a wrong value, from the command-line library
        if told is None:
            raise
        if type(error).__name__ == "NoArgsIsHelpError":
            say(told())
            return 0
        raise CmmUqError(told().rstrip("."), fix="cmm-uq --help lists commands and options") from None
    return code if isinstance(code, int) else 0
