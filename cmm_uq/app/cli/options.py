"""Options that several subcommands have, each said once, and what a shell completes."""

from __future__ import annotations

import datetime as dt
import inspect
import os
import re
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import AbstractContextManager
from functools import wraps
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import typer

from cmm_uq.app.cli.terminal import NOT_CONFORMING, Line, on_terminal, progress, put_data, say, show
from cmm_uq.base.errors import CmmUqError, printable
from cmm_uq.base.languages.translation import Code

if TYPE_CHECKING:
    from cmm_uq.app.commands.certificates.signing import Signing
    from cmm_uq.app.commands.files import Stage

JOB_FILE = "job.toml"
DEEP = 3  # folders below the one that is typed
MOST = 5000  # entries that are looked at: completion must be quick in any folder


def job_folders(incomplete: str) -> list[str]:
    """Folders with a ``job.toml`` that begin as typed; the shell completes any path where there are none."""
    return sorted({folder for folder, name in _files(incomplete) if name == JOB_FILE and folder.startswith(incomplete)})


def toml_files(incomplete: str) -> list[str]:
    """Files in TOML that begin as typed and are no job."""
    found = (os.path.join(folder, name) for folder, name in _files(incomplete) if name.endswith(".toml"))  # noqa: PTH118
    return sorted(path for path in found if path.startswith(incomplete) and not path.endswith(JOB_FILE))


def kinds(incomplete: str) -> list[str]:
    """What a new job can be, those of other packages too."""
    from cmm_uq.app.commands.jobs.new import BUDGET, PART, PLAN, known

    return [name for name in (*known(), PLAN, PART, BUDGET) if name.startswith(incomplete)]


def profiles(incomplete: str) -> list[str]:
    from cmm_uq.laboratory.live.instruments.library import ready

    return [*(name for name in ready() if name.startswith(incomplete)), *toml_files(incomplete)]


def _files(incomplete: str) -> Iterator[tuple[str, str]]:
    """Folder and name of the files below the folder that is typed, each folder as it would be typed."""
    start = os.path.dirname(incomplete)  # noqa: PTH120 - a Path would drop the "./" that was typed
    todo, seen = [(start, 0)], 0
    while todo and seen < MOST:
        folder, depth = todo.pop(0)
        try:
            entries = sorted(os.scandir(folder or "."), key=lambda entry: entry.name)
        except OSError:
            continue
        for entry in entries:
            seen += 1
            if entry.name.startswith("."):
                continue
            if entry.is_file():
                yield folder, entry.name
            elif depth < DEEP and entry.is_dir():
                todo.append((os.path.join(folder, entry.name), depth + 1))  # noqa: PTH118


def option(
    default: Any, text: str, metavar: str | None = None, shown: str | bool = True, *names: str, **more: Any
) -> Any:
    """An option: its default and help, what stands for its value and for its default, and names beside its parameter's."""
    return typer.Option(default, *names, help=text, metavar=metavar, show_default=shown, **more)


def argument(default: Any, text: str, metavar: str, shown: str | bool = True, **more: Any) -> Any:
    return typer.Argument(default, help=text, metavar=metavar, show_default=shown, **more)


def flag(default: bool, name: str, text: str, *names: str) -> Any:
    return typer.Option(default, name, *names, help=text)


def out(default: None, shown: str) -> Any:
    return option(default, "Folder to write to.", "DIR", shown)


def job_folder(default: Any, text: str) -> Any:
    return argument(default, text, "JOB", autocompletion=job_folders)


def of_environment(text: str, metavar: str, name: str, variable: str, shown: str, default: Any = None) -> Any:
    """An option that a variable of the environment gives where nobody else does."""
    return option(default, text, metavar, shown, name, envvar=variable, show_envvar=False)


def seed(default: int = 0) -> Any:
    return option(default, "Seed of everything random; the same seed gives the same bytes.", "N", min=0)


class Ending(NamedTuple):
    """How a command ends, by its options: with nothing but errors, with everything whole, or with one JSON object."""

    quiet: bool = False
    verbose: bool = False
    json: bool = False
    force: bool = False
    strict: bool = False
    language: Code | None = None

    @property
    def silent(self) -> bool:
        return self.quiet or self.json

    def progress(self) -> AbstractContextManager[Stage]:
        return progress(quiet=self.silent, verbose=self.verbose)

    def put(self, data: Mapping[str, Any], lines: Iterable[str | Line], code: int = 0, strict: bool = False) -> None:
        """The data where JSON is asked for, else the lines; then the exit code, or that of what is not to be where strict."""
        if self.json:
            put_data(data)
        for line in () if self.silent else lines:
            if isinstance(line, str):
                say(printable(line))
            else:
                show([line])
        if code or (self.strict and strict):
            raise typer.Exit(code or NOT_CONFORMING)


def ending(
    names: str = "quiet verbose json", strict: str = "unless everything conforms and agrees with the model"
) -> Any:
    """Options of a command's end by name, in place of its parameter ``end``."""
    return {name: flag(False, "--strict", f"Exit code 4 {strict}.") if name == "strict" else ENDS[name]
            for name in names.split()}  # fmt: skip


def with_ending(function: Callable[..., None]) -> Callable[..., None]:
    """A command with the options of its ``end`` spelt out in its place."""
    signature = inspect.signature(function, eval_str=True)
    if "end" not in signature.parameters:
        return function
    options = signature.parameters["end"].default

    @wraps(function)
    def called(**given: Any) -> None:
        end = Ending(**{name: given.pop(name) for name in options})
        function(**given, end=end)

    parameters: list[inspect.Parameter] = []
    for one in signature.parameters.values():
        spelt = [one.replace(name=name, default=option, annotation=Code | None if name == "language" else bool)
                 for name, option in options.items()] if one.name == "end" else [one]  # fmt: skip
        parameters += spelt
    called.__dict__["__signature__"] = signature.replace(parameters=parameters)
    return called


def command(app: typer.Typer, name: str, *calls: str) -> Callable[[Callable[..., None]], Callable[..., None]]:
    """Of a group of commands, with calls of it as they are typed."""

    def add(function: Callable[..., None]) -> Callable[..., None]:
        app.command(name, epilog=examples(*calls))(with_ending(function))
        return function

    return add


def group(text: str, epilog: str) -> typer.Typer:
    """A group of commands; its help where none of them is named."""
    app = typer.Typer(help=text, epilog=epilog, rich_markup_mode=None)

    @app.callback(invoke_without_command=True)
    def alone(context: typer.Context) -> None:
        if context.invoked_subcommand is None:
            say(context.get_help())

    return app


def examples(*lines: str) -> str:
    """What stands at the end of a help: calls as they are typed, each on a line of its own."""
    return "\n".join(["\b", "Examples:", *(f"  cmm-uq {line}" for line in lines)])


JOB = job_folder(..., "Job folder: job.toml and the recording that it names.")
QUIET = flag(False, "--quiet", "Print nothing but errors.", "-q")
VERBOSE = flag(False, "--verbose", "Print everything, whole; without a terminal also the stages.", "-v")
JSON = flag(False, "--json", "Print one JSON object instead of the summary; an error is one too.")
ENDS = {
    "quiet": QUIET, "verbose": VERBOSE, "json": JSON,
    "force": flag(False, "--force", "Keep what stands in the way as NAME.previous instead of refusing."),
    "language": option(None, "Language of the documents; files for programs stay English.", None, "the job's, else en"),
}  # fmt: skip
END, BRIEF, ONLY_JSON, FORCED = map(ending, ("quiet verbose json", "quiet json", "json", "force quiet verbose json"))
_KEPT_IN = "Records that it is kept in: a file, a postgresql:// URL, or none."
RECORDS = of_environment(_KEPT_IN, "WHERE", "--records", "CMM_UQ_RECORDS", "reports/records.db")
_READ = "The records: a file, or the URL of a PostgreSQL database."
READ_RECORDS = option(None, _READ, "WHERE", "CMM_UQ_RECORDS, or reports/records.db", "--records")
HOST = option(None, "Further name by which browsers reach it; repeatable.", "HOST", "this machine's own", "--name")
TLS = option(None, "Certificate for TLS, PEM.", "FILE", "none", "--tls")
TLS_KEY = option(None, "Its key, PEM without a password.", "FILE", "in the file of --tls", "--tls-key")
ACCOUNTS = option(None, "Accounts of those who may sign in; needs --tls.", "FILE", "none", "--accounts")
ADD_ACCOUNT = option(
    None,
    "Ask for a password, write the account into --accounts, and end; ROLE: read or work.",
    "NAME:ROLE",
    "none",
    "--add-account",
)
ON = option(None, "The day asked about; later recordings do not count.", "DATE", "today", "--on")
_PRIOR = "fleet.json of the fleet that the drift model takes as prior."
FLEET = option(None, _PRIOR, "FILE", "a prior without a fleet", "--fleet")
_KEY = "a PKCS#12 file, or pkcs11:token=LABEL;object=LABEL?module-path=FILE"
_SIGN = "CMM_UQ_SIGN_KEY"
SIGN = of_environment(f"Sign with this key: {_KEY}.", "KEY", "--sign", _SIGN, f"{_SIGN}, else nobody signs")
KEY = of_environment(f"The key: {_KEY}.", "KEY", "--key", _SIGN, _SIGN, default=...)
_SERVER, _STAMP = "CMM_UQ_SIGN_TIME_SERVER", "Time stamp server (RFC 3161) for the PDF."
TIME_SERVER = of_environment(_STAMP, "URL", "--time-server", _SERVER, f"{_SERVER}, else none")
_LEVELS, _USUAL = "Of the PDF's signature: B-B, B-T, B-LT or B-LTA.", "B-T with a time stamp server, else B-B"
LEVEL = of_environment(_LEVELS, "LEVEL", "--level", "CMM_UQ_SIGN_LEVEL", _USUAL)
_TRUST = "Certificates that one trusts: PEM file or folder; again for more."
TRUSTED = of_environment(_TRUST, "PATH", "--trust", "CMM_UQ_TRUST", "nobody")

_DAYS = {"d": 1, "w": 7, "m": 30, "y": 365}
_LONGEST = 36_500


def day_of(text: str | None) -> dt.date | None:
    if text is None:
        return None
    try:
        return dt.date.fromisoformat(text)
    except ValueError:
        raise CmmUqError(f"{text!r} is no date", where="--on", fix="Write it as 2026-11-22") from None


def time_of(text: str | None) -> dt.timedelta | None:
    """The time of ``--within``: a number of days, or one with d, w, m (30 days) or y (365 days) behind it."""
    if text is None:
        return None
    found = re.fullmatch(r"(\d{1,5})\s*([dwmy]?)", text.strip(), re.ASCII)
    days = int(found[1]) * _DAYS[found[2] or "d"] if found else _LONGEST + 1
    if days > _LONGEST:
        raise CmmUqError(f"{text!r} is no time", where="--within", fix="Write it as 90d, 12w, 3m or 1y")
    return dt.timedelta(days=days)


def open_key(key: str, server: str | None, level: str | None, trust: list[Path] | None) -> Signing:
    from cmm_uq.app.commands.certificates.signing import signing, stamping_of

    return signing(key, stamping_of(level, server, trust or ()), ask_secret)


def ask_secret(question: str, *, twice: bool = False) -> str:
    """A secret from the keyboard, that is not shown."""
    from cmm_uq.app.commands.certificates.signing import PASSPHRASE_FILE

    if not on_terminal(sys.stdin):
        fix = f"Write it into a file, chmod 600, and name that in {PASSPHRASE_FILE}"
        nobody = f"{question.rstrip(': ')}: nobody is there to be asked"
        raise CmmUqError(nobody, where="standard input", fix=fix)
    found: str = typer.prompt(question.rstrip(": "), hide_input=True, confirmation_prompt=twice, err=True)
    return found


def signatures(signing: Signing, files: Iterable[Path]) -> list[str]:
    """Who signed which files, and whether the key is a test's."""
    from cmm_uq.certificate.sign import TEST_NOTE

    names = ", ".join(path.name for path in files)
    level = "" if signing.stamping is None else f", PAdES {signing.stamping.level}"
    line = f"Signed by {signing.signer.name} on {signing.at:%Y-%m-%d %H:%M UTC}{level}: {names}"
    return [line, *([f"TEST KEY: {TEST_NOTE}"] if signing.signer.test_key else [])]
