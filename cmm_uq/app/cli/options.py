"""Options that several subcommands have, each said once."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from cmm_uq.app.cli.completion import job_folders
from cmm_uq.base.languages.language import Code


def examples(*lines: str) -> str:
    """What stands at the end of a help: calls as they are typed, each on a line of its own."""
    return "\n".join(["\b", "Examples:", *(f"  cmm-uq {line}" for line in lines)])


def out(default: str) -> typer.models.OptionInfo:
    """Of ``--out``, where a folder is chosen without it."""
    found: typer.models.OptionInfo = typer.Option(help="Folder to write to.", metavar="DIR", show_default=default)
    return found


Job = Annotated[
    Path,
    typer.Argument(
        help="Job folder: job.toml and the recording that it names.", metavar="JOB", autocompletion=job_folders
    ),
]
Language = Annotated[
    Code | None,
    typer.Option(help="Language of the documents; files for programs stay English.", show_default="the job's, else en"),
]
Seed = Annotated[
    int, typer.Option(help="Seed of everything random; the same seed gives the same bytes.", metavar="N", min=0)
]
Quiet = Annotated[bool, typer.Option("--quiet", "-q", help="Print nothing but errors.")]
Verbose = Annotated[
    bool,
    typer.Option("--verbose", "-v", help="Print everything, whole; without a terminal also the stages."),
]
Json = Annotated[
    bool,
    typer.Option("--json", help="Print one JSON object instead of the summary; an error is one too."),
]
Records = Annotated[
    str | None,
    typer.Option(
        "--records",
        help="Records that it is kept in: a file, a postgresql:// URL, or none.",
        metavar="WHERE",
        envvar="CMM_UQ_RECORDS",
        show_default="records.db beside the reports",
        show_envvar=False,
    ),
]
Force = Annotated[
    bool,
    typer.Option("--force", help="Keep what stands in the way as NAME.previous instead of refusing."),
]
Settled = Annotated[
    bool,
    typer.Option("--strict", help="Exit code 4 unless Monte Carlo is stable to the digits asked for."),
]
Strict = Annotated[
    bool,
    typer.Option("--strict", help="Exit code 4 unless everything conforms and agrees with the model."),
]
