"""Options of commands that sign, how their secrets are asked for, and what is said at the end."""

from __future__ import annotations

import sys
from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from cmm_uq.app.cli.printing import on_terminal, say
from cmm_uq.base.errors import CmmUqError, printable

if TYPE_CHECKING:
    from cmm_uq.app.commands.signing import Signing

_KEY = "a PKCS#12 file, or pkcs11:token=LABEL;object=LABEL?module-path=FILE"

Sign = Annotated[
    str | None,
    typer.Option(
        "--sign", help=f"Sign with this key: {_KEY}.", metavar="KEY", envvar="CMM_UQ_SIGN_KEY", show_envvar=False,
        show_default="CMM_UQ_SIGN_KEY, else nobody signs",
    ),
]  # fmt: skip
Key = Annotated[
    str,
    typer.Option(
        "--key", help=f"The key: {_KEY}.", metavar="KEY", envvar="CMM_UQ_SIGN_KEY", show_envvar=False,
        show_default="CMM_UQ_SIGN_KEY",
    ),
]  # fmt: skip
TimeServer = Annotated[
    str | None,
    typer.Option(
        "--time-server", help="Time stamp server (RFC 3161) for the PDF.", metavar="URL",
        envvar="CMM_UQ_SIGN_TIME_SERVER", show_envvar=False, show_default="CMM_UQ_SIGN_TIME_SERVER, else none",
    ),
]  # fmt: skip
Level = Annotated[
    str | None,
    typer.Option(
        "--level", help="Of the PDF's signature: B-B, B-T, B-LT or B-LTA.", metavar="LEVEL",
        envvar="CMM_UQ_SIGN_LEVEL", show_envvar=False, show_default="B-T with a time stamp server, else B-B",
    ),
]  # fmt: skip
Trusted = Annotated[
    list[Path] | None,
    typer.Option(
        "--trust", help="Certificates that one trusts: PEM file or folder; again for more.", metavar="PATH",
        envvar="CMM_UQ_TRUST", show_envvar=False, show_default="nobody",
    ),
]  # fmt: skip


def asked_signing(key: str, server: str | None, level: str | None, trust: list[Path] | None) -> Signing:
    """The key, opened.

    Raises
    ------
    CmmUqError : it cannot be opened, or must not sign now.
    """
    from cmm_uq.app.commands.signing import Wanted, signing

    return signing(Wanted(key, level, server, tuple(trust or ())), hidden)


def hidden(question: str, *, twice: bool = False) -> str:
    """A secret from the keyboard, that is not shown.

    Raises
    ------
    CmmUqError : nobody is at the keyboard.
    """
    from cmm_uq.app.commands.signing import PASSPHRASE_FILE

    if not on_terminal(sys.stdin):
        raise CmmUqError(f"{question.rstrip(': ')}: nobody is there to be asked", where="standard input",
                         fix=f"Write it into a file, chmod 600, and name that in {PASSPHRASE_FILE}")  # fmt: skip
    found: str = typer.prompt(question.rstrip(": "), hide_input=True, confirmation_prompt=twice, err=True)
    return found


def said_of(signing: Signing, files: Iterable[Path]) -> None:
    """Who signed which files, and whether the key is a test's."""
    from cmm_uq.certificate.sign import TEST_NOTE

    names = ", ".join(path.name for path in files)
    level = "" if signing.stamping is None else f", PAdES {signing.stamping.level}"
    say(printable(f"Signed by {signing.signer.name} on {signing.at:%Y-%m-%d %H:%M UTC}{level}: {names}"))
    if signing.signer.test_key:
        say(f"TEST KEY: {TEST_NOTE}")
