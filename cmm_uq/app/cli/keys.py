"""``cmm-uq keys new``: a key for trying."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from cmm_uq.app.cli.options import Json, Quiet, ask_secret, examples
from cmm_uq.app.cli.terminal import helped, put_data, say
from cmm_uq.base.errors import printable

app = typer.Typer(
    help="Keys for electronic signatures: a new one for trying. Those that count come from a trust service.",
    epilog=examples("keys new test.p12 --name 'Calibration laboratory'"),
    rich_markup_mode=None,
    invoke_without_command=True,
)


@app.callback()
def _alone(context: typer.Context) -> None:
    helped(context)


@app.command("new", epilog=examples("keys new test.p12 --name 'Calibration laboratory'"))
def new(
    file: Annotated[Path, typer.Argument(help="PKCS#12 file to be made.", metavar="FILE")],
    name: Annotated[str, typer.Option(help="Of whom it is for.", metavar="NAME")] = "cmm-uq",
    quiet: Quiet = False,
    json: Json = False,
) -> None:
    """Make a test key with its certificate, FILE for signing and FILE.pem for whoever is to trust it.

    The passphrase is asked for, or read from CMM_UQ_SIGN_PASSPHRASE_FILE or CMM_UQ_SIGN_PASSPHRASE. Whatever is signed with
    it says that it is a test key.
    """
    from cmm_uq.app.commands.certificates.keys import new_test_key
    from cmm_uq.certificate.sign import TEST_NOTE

    made = new_test_key(file, name, lambda question: ask_secret(question, twice=True))
    if json:
        put_data({"key": str(made.key), "certificate": str(made.certificate), "test_key": True})
    elif not quiet:
        say(printable(f"{made.key} signs until {made.until}; {made.certificate} is for whoever is to trust it."))
        say(f"TEST KEY: whatever it signs says: {TEST_NOTE}")
