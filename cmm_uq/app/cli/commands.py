"""All subcommands, and how their options are read."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable
from copy import copy
from typing import Any

import typer
from typer.core import TyperGroup

from cmm_uq import __version__
from cmm_uq.app.cli import certificates, evaluations, instruments, jobs, laboratory, records
from cmm_uq.app.cli.options import examples, flag, with_ending
from cmm_uq.app.cli.terminal import BAD_INPUT, say
from cmm_uq.base.errors import CmmUqError

GROUPS = {
    "First": ("new", "import", "check", "report", "diagnose", "part"),
    "Make": ("desk", "plan", "simulate", "compensate", "budget", "batch", "sign", "keys", "qif", "schema"),
    "Decide": ("standards", "effects", "prove"),
    "Records": ("release", "history", "due", "fleet", "affected", "records", "schedule", "serve"),
    "Check": ("verify", "read", "selftest"),
    "Instruments": ("acquire", "instruments"),
}
"""Of the list of commands, each in one."""


class CommandGroups(TyperGroup):
    """Commands listed by what they are for."""

    def format_commands(self, ctx: Any, formatter: Any) -> None:
        listed = {name for names in GROUPS.values() for name in names}
        further = {"Further": [name for name in self.list_commands(ctx) if name not in listed]}
        for title, names in (GROUPS | further).items():
            found = ((name, self.get_command(ctx, name)) for name in names)
            rows = [(name, command.get_short_help_str()) for name, command in found if command is not None]
            if rows:
                with formatter.section(title):
                    formatter.write_dl(rows, col_max=12)


app = typer.Typer(
    name="cmm-uq",
    cls=CommandGroups,
    help="Uncertainty of coordinate measuring machines, and the certificates that state it.",
    epilog="Exit codes: 0 done; 2 bad input; 3 output impossible; 4 with --strict: done, not conforming or inconsistent; "
    "130, 143 interrupted; 1 with report --scheduled: done, and something needs a person; of verify: 1 not verified, "
    "3 not wholly checked.\n\n" + examples("report examples/iota-1102-20C", "report --help", "--install-completion"),
    pretty_exceptions_enable=False,
    rich_markup_mode=None,  # brackets of TOML stay as they are, and help is there at once
    context_settings={"help_option_names": ["-h", "--help"]},
)

COMMANDS: dict[str, tuple[Callable[..., None], str, *tuple[str, ...]]] = {
    "desk": (laboratory.desk, "Certificates made in a browser, on this machine.", "desk", "desk jobs --no-open"),
    "new": (jobs.new, "A job folder that runs at once, to be filled with your own figures.", "new", "new step_gauge my-gauge",
        "new ballbar --machine 'CMM 3' --set artefact.length_mm=500"),
    "import": (jobs.import_export, "What is recognised of a laboratory's export.", "import export.xlsx",
        "import export.csv --key unit=inch --out recording.csv",
        "new ballbar my-job --from export.xlsx --machine 'CMM 3' --set job.date=2026-05-31"),
    "check": (jobs.check, "All that is wrong with jobs, without computing.", "check JOB", "check jobs/a jobs/b",
        "check JOB --clauses", "check JOB --json"),
    "report": (evaluations.report, "The certificate of a recording: estimates, figures, decisions.",
        "report examples/iota-1102-20C", "report JOB --out DIR --seed 3", "report JOB --json --strict > results.json",
        "report JOB --sign laboratory.p12", "report --scheduled jobs --dry-run"),
    "part": (evaluations.part, "The uncertainty of what is measured on a part, and whether it conforms.",
        "part examples/part-plate-simulated", "part JOB --digits 2 --rerun", "part JOB --json --strict > results.json"),
    "batch": (laboratory.batch, "The reports of many jobs, by processes or a cluster.", "batch jobs/2026",
        "batch jobs --workers 8 --results-only --parquet values.parquet", "batch jobs --out /srv/reports --resume --json",
        "batch jobs --scheduler tcp://head:8786"),
    "diagnose": (evaluations.diagnose, "What a recording shows that its model leaves out.", "diagnose examples/iota-1102-20C",
        "diagnose JOB --against predicted.csv", "diagnose JOB --strict --quiet"),
    "effects": (evaluations.effects, "The effects that jobs name and the diagnosis looks for.", "effects", "effects guideway",
        "effects periodic --json", "effects --job JOB"),
    "plan": (evaluations.plan, "What to measure, and what it will tell.", "plan examples/plan-ballbar", "plan JOB --no-power",
        "plan JOB --verbose"),
    "prove": (evaluations.prove, "The diagnosis tried on sealed cases with a job's set-ups.", "prove examples/iota-1102-20C",
        "prove JOB --cases 400 --workers 8", "prove examples/plan-ballbar --strict"),
    "history": (laboratory.history, "Every value of a machine over time, from the records.", "history 1102",
        "history 1102 --out DIR", "history 'CMM of hall 3' --on 2026-12-31 --json"),
    "due": (laboratory.due, "What is due for calibration, when and why, from the records.", "due", "due --within 90d",
        "due 1102 --on 2026-12-31 --json", "due --strict --out DIR"),
    "acquire": (laboratory.acquire, "A recording taken live, led by the plan.", "acquire JOB",
        "acquire examples/plan-ballbar --simulate --out trial", "acquire JOB --plain"),
    "simulate": (jobs.simulate, "A recording drawn from known errors, as a job of its own.",
        "simulate JOB --truth truth.toml --out DIR", "simulate JOB --truth truth.toml --out DIR --seed 7"),
    "compensate": (jobs.compensate, "A recording corrected by its machine's error maps.", "compensate JOB --out DIR",
        "compensate JOB --out DIR --map-text 20", "compensate JOB --cloud scan.csv --out DIR"),
    "fleet": (laboratory.fleet, "The drift that is usual for all machines of the records, and who differs.", "fleet",
        "fleet --name scale_x.ppm --out DIR", "fleet --records lab.db --json"),
    "budget": (evaluations.budget, "The uncertainty of any measurement model in a file.", "budget model.toml",
        "budget model.toml --seed 2 --out DIR", "budget model.toml --json --strict"),
    "verify": (certificates.verify, "A certificate's files against each other, its figures, and its inputs computed again.",
        "verify certificate.pdf", "verify reports/iota-1102-20C", "verify certificate.pdf certificate.html --no-rerun",
        "verify certificate.pdf --trust roots --json"),
    "release": (certificates.release, "A certificate released, withdrawn or replaced.",
        "release K-2026-104 --by 'A. Huber' --reason 'checked against the recording'",
        "release K-2026-105 --by 'A. Huber' --despite 'customer informed, to be adjusted'",
        "release K-2026-104 --withdraw --by 'A. Huber' --reason 'wrong artefact'",
        "release K-2026-104 --replaced-by K-2026-118 --by 'A. Huber' --reason 'corrected'"),
    "qif": (certificates.qif, "The results of a report as QIF 3.0.", "qif reports/iota-1102-20C",
        "qif reports/iota-1102-20C/results.json --out iota.qif"),
    "read": (certificates.read, "A digital calibration certificate (DCC), printed.", "read certificate.xml",
        "read ball-plate.xml --json", "read certificate.xml --schema schemas"),
    "sign": (certificates.sign, "A certificate signed electronically: PDF and XML.",
        "sign reports/K-2026-104/certificate.pdf --key laboratory.p12",
        "sign certificate.pdf certificate.xml --key laboratory.p12 --time-server https://stamps.example/ --out signed"),
    "affected": (certificates.affected, "Which certificates a correction of the package touches.", "affected --version 0.4.0",
        "affected --version 0.4.0 --list --json", "affected --version 0.4.0 --write replacements"),
    "serve": (laboratory.serve, "The records to look at, in a browser.", "serve", "serve --records lab.db --open",
        "serve --records postgresql://lab@db/records --port 9000"),
    "standards": (certificates.standards, "The standards that are decided, clause by clause, and forms to check them by.",
        "standards", 'standards "ISO 10360-2:2009"', 'standards "ISO 10360-2:2009" --form iso-10360-2-clauses.toml'),
    "schema": (certificates.schema, "JSON Schema of a file, for editors that complete and explain.",
        "schema job > job.schema.json", "schema budget", "schema truth"),
    "selftest": (evaluations.selftest, "Published reference figures, computed here and compared.", "selftest",
        "selftest --verbose > selftest.txt", "selftest --json"),
}  # fmt: skip
"""By name: the function, what the list of commands says of it, and calls as they are typed."""

for name, (function, short, *calls) in COMMANDS.items():
    app.command(name, short_help=short, epilog=examples(*calls))(with_ending(function))
for name, group, short in (
    ("instruments", instruments.app, "Instruments: ready profiles, tried at a port, new ones."),
    ("schedule", records.schedule_app, "Scheduled runs: what they go by, whom they tell, what starts them."),
    ("keys", certificates.keys, "Keys for electronic signatures: a new one for trying."),
    ("records", records.app, "The history: verified, imported, backed up, brought up to date."),
):
    app.add_typer(group, name=name, short_help=short)

OVERVIEW = """cmm-uq {version}: uncertainty of coordinate measuring machines (CMMs),
and the calibration certificates that state it.

  cmm-uq new KIND FOLDER   a job that runs at once, to be filled with your own
  cmm-uq report JOB        the certificate of a recording
  cmm-uq diagnose JOB      what the recording shows that its model leaves out

KIND is one of those that cmm-uq new lists, JOB a folder with a job.toml.
cmm-uq --help lists all commands, cmm-uq COMMAND --help the options of one."""


@app.callback(invoke_without_command=True)
def _alone(context: typer.Context, version: bool = flag(False, "--version", "Print the version and stop.")) -> None:
    if version:
        say(f"cmm-uq {__version__}")
        raise typer.Exit
    if context.invoked_subcommand is None:
        say(OVERVIEW.format(version=__version__))


def run() -> int:
    """Run the subcommand that the command line names; its exit code. Unknown options are a CmmUqError too."""
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
    """The app with no command or group but the one that is called, so that only its options are made ready; else all of it."""
    called = copy(app)
    called.registered_commands = [info for info in app.registered_commands if [info.name] == first]
    called.registered_groups = [info for info in app.registered_groups if [info.name] == first]
    return called if called.registered_commands or called.registered_groups else app


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
