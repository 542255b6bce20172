"""``cmm-uq part JOB``: the uncertainty of what is measured on a part, and whether it conforms."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from cmm_uq.app.cli.options import Force, Json, Language, Quiet, Seed, Verbose, examples, job_folders, out
from cmm_uq.app.cli.summary import conclude
from cmm_uq.app.cli.terminal import progress

EXAMPLES = examples(
    "part examples/part-plate-simulated", "part JOB --digits 2 --rerun", "part JOB --json --strict > results.json"
)


def command(
    job: Annotated[
        Path,
        typer.Argument(
            help="Job folder of a part: job.toml, the machine's certificate, and the measured points if there are some.",
            metavar="JOB",
            autocompletion=job_folders,
        ),
    ],
    out: Annotated[Path | None, out("reports/<job id>")] = None,
    seed: Seed = 0,
    trials: Annotated[
        int | None, typer.Option(help="Virtual measurements.", metavar="N", min=1000, show_default="200000")
    ] = None,
    digits: Annotated[
        int | None,
        typer.Option(
            help="Digits of u that are to be known: as many virtual measurements as they need.",
            metavar="N",
            min=1,
            max=3,
            show_default="none",
        ),
    ] = None,
    rerun: Annotated[
        bool, typer.Option("--rerun", help="Compute the machine's certificate again from its inputs, and compare.")
    ] = False,
    trust: Annotated[
        list[Path] | None,
        typer.Option(
            help="Certificates that you trust, PEM or DER: the machine's certificate must then be signed.",
            metavar="FILE|DIR",
            show_default="nobody",
        ),
    ] = None,
    records: Annotated[
        str | None,
        typer.Option(
            help="Records of the machine's history, from which its drift is known: a file, a postgresql:// URL, or none.",
            metavar="WHERE",
            show_default="none",
        ),
    ] = None,
    force: Force = False,
    strict: Annotated[bool, typer.Option("--strict", help="Exit code 4 unless every characteristic conforms.")] = False,
    quiet: Quiet = False,
    verbose: Verbose = False,
    json: Json = False,
    language: Language = None,
) -> None:
    """Verify the machine's certificate, measure the part virtually, and write part.html, part.pdf and results.json."""
    with progress(quiet=quiet or json, verbose=verbose) as stage:
        from cmm_uq.app.commands.files import silent
        from cmm_uq.app.commands.parts.documents import write_part
        from cmm_uq.app.commands.parts.part import PartOptions

        options = PartOptions(seed, trials, digits, rerun, None if trust is None else tuple(trust), records)
        written = write_part(job, out, options=options, force=force, stage=stage or silent, language=language)
    conclude(written, json=json, quiet=quiet, strict=strict, verbose=verbose)
