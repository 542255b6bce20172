"""``cmm-uq sign FILE…``: a certificate that was written before, signed."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from cmm_uq.app.cli.options import (
    Json,
    Key,
    Level,
    Quiet,
    Records,
    TimeServer,
    Trusted,
    examples,
    open_key,
    show_signatures,
)
from cmm_uq.app.cli.terminal import put_data, say
from cmm_uq.base.errors import printable

EXAMPLES = examples(
    "sign reports/K-2026-104/certificate.pdf --key laboratory.p12",
    "sign certificate.pdf certificate.xml --key laboratory.p12 --time-server https://stamps.example/ --out signed",
)


def command(
    files: Annotated[list[Path], typer.Argument(help="certificate.pdf, certificate.xml.", metavar="FILE...")],
    key: Key,
    time_server: TimeServer = None,
    level: Level = None,
    trust: Trusted = None,
    out: Annotated[
        Path | None,
        typer.Option(help="Folder for signed copies.", metavar="DIR", show_default="signed where they are"),
    ] = None,
    records: Records = None,
    quiet: Quiet = False,
    json: Json = False,
) -> None:
    """Sign certificates, so that four eyes may look at them first: PDF by PAdES, XML by XAdES B-B.

    The set in their folder is written anew, all or none, and records that know the certificate are told.
    """
    signing = open_key(key, time_server, level, trust)
    from cmm_uq.app.commands.certificates.sign import sign_files

    done = sign_files(files, signing, out=out, records=records)
    if json:
        put_data({
            "signer": signing.signer.name, "test_key": signing.signer.test_key, "at": signing.at.isoformat(),
            "level": "B-B" if signing.stamping is None else signing.stamping.level,
            "files": [str(path) for path in done.files], "records": done.records,
        })  # fmt: skip
    elif not quiet:
        if done.records:
            say(printable(f"Recorded in {done.records}."))
        show_signatures(signing, done.files)
