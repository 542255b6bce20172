"""``cmm-uq verify FILE…``: is a certificate what it says, in all its forms, and what its inputs give."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from cmm_uq.app.cli.options import Json, Quiet, Verbose, examples
from cmm_uq.app.cli.terminal import NOT_VERIFIED, NOT_WHOLLY_CHECKED, progress, put_data, say
from cmm_uq.base.errors import printable

if TYPE_CHECKING:
    from cmm_uq.app.commands.certificates.verification import Verification

EXAMPLES = examples(
    "verify certificate.pdf", "verify reports/iota-1102-20C", "verify certificate.pdf certificate.html --no-rerun",
    "verify certificate.pdf --trust roots --json",
)  # fmt: skip
SHOWN = 20  # findings that are told one by one


def command(
    files: Annotated[
        list[Path],
        typer.Argument(
            help="PDF, XML, HTML, results.json of one certificate, in any choice, or the folder of its report.",
            metavar="FILE…",
        ),
    ],
    rerun: Annotated[
        bool, typer.Option("--rerun/--no-rerun", help="Compute everything again from the inputs, and compare.")
    ] = True,
    trust: Annotated[
        list[Path] | None,
        typer.Option(
            help="Certificates that you trust, PEM or DER: a file or a folder; again for more.",
            metavar="FILE|DIR",
            show_default="nobody",
        ),
    ] = None,
    schema: Annotated[
        Path | None,
        typer.Option(
            help="Folder with PTB's schemas of the DCC, that the XML is held to.", metavar="DIR", show_default="none"
        ),
    ] = None,
    quiet: Quiet = False,
    verbose: Verbose = False,
    json: Json = False,
) -> None:
    """Compare the forms of a certificate with each other, its figures, decisions and inputs, and compute it again.

    Exit code 0 where it is verified, 1 where something is wrong, 3 where nothing is but not all could be checked, 2 where a
    file cannot be read.
    """
    with progress(quiet=quiet or json, verbose=verbose) as stage:
        from cmm_uq.app.commands.certificates.verify import verify

        found = verify(files, rerun=rerun, trust=trust or None, schema=schema, stage=stage or (lambda what, part: None))
    inquiry = found.inquiry
    if json:
        put_data({"schema": "cmm-uq/verification/1", "subject": found.subject, **inquiry.as_data()})
    elif not quiet:
        _tell(found, verbose=verbose)
    if inquiry.findings:
        raise typer.Exit(NOT_VERIFIED)
    if inquiry.unchecked:
        raise typer.Exit(NOT_WHOLLY_CHECKED)


def _tell(found: Verification, *, verbose: bool) -> None:
    from cmm_uq.certificate.verify.found import CHECKS

    inquiry = found.inquiry
    say(printable(f"{inquiry.word}  {found.subject}"))
    told = inquiry.findings if verbose else inquiry.findings[:SHOWN]
    for one in told:
        say(printable(f"  {one}"))
    if len(told) < len(inquiry.findings):
        say(f"  and {len(inquiry.findings) - len(told)} more: --verbose shows all")
    for left in inquiry.unchecked:
        say(printable(f"  not checked: {left}"))
    for name, what in CHECKS.items():
        wrong = sum(one.check == name for one in inquiry.findings)
        count = inquiry.done.get(name, 0)
        if wrong or count:
            say(f"  {name:<10}  {'✗' if wrong else '✓'}  {what} ({count})")
    for note in inquiry.notes:
        say(printable(f"  {note}"))
