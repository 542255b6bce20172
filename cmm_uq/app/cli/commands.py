"""All subcommands, and how their options are read."""

from __future__ import annotations

import os
import sys
from copy import copy
from typing import Annotated, Any

import typer

from cmm_uq.app.cli import (
    acquire,
    affected,
    batch,
    budget,
    check,
    compensate,
    diagnose,
    due,
    fleet,
    history,
    importing,
    instruments,
    keys,
    new,
    part,
    plan,
    prove,
    qif,
    read,
    records,
    release,
    report,
    schedule,
    schema,
    selftest,
    serve,
    sign,
    simulate,
    standards,
    verify,
)
from cmm_uq.app.cli.options import examples
from cmm_uq.app.cli.terminal import BAD_INPUT, say
from cmm_uq.base.errors import CmmUqError

app = typer.Typer(
    name="cmm-uq",
    help="Uncertainty of coordinate measuring machines, and the certificates that state it.",
    epilog="Exit codes: 0 done; 2 bad input; 3 output impossible; 4 with --strict: done, not conforming or inconsistent; "
    "130, 143 interrupted; 1 with report --scheduled: done, and something needs a person; of verify: 1 not verified, "
    "3 not wholly checked.\n\n" + examples("report examples/iota-1102-20C", "report --help", "--install-completion"),
    pretty_exceptions_enable=False,
    rich_markup_mode=None,  # brackets of TOML stay as they are, and help is there at once
    context_settings={"help_option_names": ["-h", "--help"]},
)
for module, short in {
    new: "A job folder that runs at once, to be filled with your own figures.",
    importing: "What is recognised of a laboratory's export.",
    check: "All that is wrong with jobs, without computing.",
    report: "The certificate of a recording: estimates, figures, decisions.",
    part: "The uncertainty of what is measured on a part, and whether it conforms.",
    batch: "The reports of many jobs, by processes or a cluster.",
    diagnose: "What a recording shows that its model leaves out.",
    plan: "What to measure, and what it will tell.",
    prove: "The diagnosis tried on sealed cases with a job's set-ups.",
    history: "Every value of a machine over time, from the records.",
    due: "What is due for calibration, when and why, from the records.",
    acquire: "A recording taken live, led by the plan.",
    simulate: "A recording drawn from known errors, as a job of its own.",
    compensate: "A recording corrected by its machine's error maps.",
    fleet: "The drift that is usual for all machines of the records, and who differs.",
    budget: "The uncertainty of any measurement model in a file.",
    verify: "A certificate's files against each other, its figures, and its inputs computed again.",
    release: "A certificate released, withdrawn or replaced.",
    qif: "The results of a report as QIF 3.0.",
    read: "A digital calibration certificate (DCC), printed.",
    sign: "A certificate signed electronically: PDF and XML.",
    affected: "Which certificates a correction of the package touches.",
    serve: "The records to look at, in a browser.",
    standards: "The standards that are decided, clause by clause, and forms to check them by.",
    schema: "JSON Schema of a file, for editors that complete and explain.",
    selftest: "Published reference figures, computed here and compared.",
}.items():
    name = "import" if module is importing else module.__name__.rpartition(".")[2]
    app.command(name, short_help=short, epilog=module.EXAMPLES)(module.command)

app.add_typer(instruments.app, name="instruments", short_help="Instruments: ready profiles, tried at a port, new ones.")
app.add_typer(
    schedule.app, name="schedule", short_help="Scheduled runs: what they go by, whom they tell, what starts them."
)
app.add_typer(keys.app, name="keys", short_help="Keys for electronic signatures: a new one for trying.")
app.add_typer(records.app, name="records", short_help="The history: verified, imported, backed up, brought up to date.")

OVERVIEW = """cmm-uq {version}: uncertainty of coordinate measuring machines (CMMs),
and the calibration certificates that state it.

  cmm-uq new KIND FOLDER   a job that runs at once, to be filled with your own
  cmm-uq report JOB        the certificate of a recording
  cmm-uq diagnose JOB      what the recording shows that its model leaves out

KIND is one of those that cmm-uq new lists, JOB a folder with a job.toml.
cmm-uq --help lists all commands, cmm-uq COMMAND --help the options of one."""


@app.callback(invoke_without_command=True)
def _alone(
    context: typer.Context,
    version: Annotated[bool, typer.Option("--version", help="Print the version and stop.")] = False,
) -> None:
    from cmm_uq import __version__

    if version:
        say(f"cmm-uq {__version__}")
        raise typer.Exit
    if context.invoked_subcommand is None:
        say(OVERVIEW.format(version=__version__))


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
        code = _called(sys.argv[1:2])(prog_name="cmm-uq", standalone_mode=False)
    except typer.Abort:
        raise CmmUqError("the answer did not come") from None
    except SystemExit as ended:  # of completion, which has said why
        return BAD_INPUT if ended.code else 0
    except Exception as error:
        if not hasattr(error, "format_message"):
            raise
        raise _misread(error) from None
    return code if isinstance(code, int) else 0


def _called(first: list[str]) -> typer.Typer:
    """The app with no command but the one that is called, so that only its options are made ready; else all of it."""
    alone = [info for info in app.registered_commands if [info.name] == first]
    if not alone:
        return app
    called = copy(app)
    called.registered_commands, called.registered_groups = alone, []
    return called


def _misread(error: Any) -> CmmUqError:
    """An unknown option or a wrong value, as the command-line library says it, with where to read on."""
    problem, asks, hint = str(error.format_message()).partition("Did you mean")
    if not asks:
        problem, listed, hint = problem.partition(" (Possible options: ")
        asks = "Did you mean " if listed else ""
        hint = hint.replace(")", "?").replace(", ", " or ")
    context = getattr(error, "ctx", None)
    where = "cmm-uq" if context is None else context.command_path
    more = f"{where} --help lists {'commands and options' if where == 'cmm-uq' else 'its options'}"
    return CmmUqError(problem.rstrip(" ."), fix=f"{asks}{hint} {more}".strip())
