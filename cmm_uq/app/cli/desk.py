"""``cmm-uq desk``: the desk in the browser, until Ctrl-C."""

from __future__ import annotations

import getpass
import ipaddress
import threading
from pathlib import Path

from cmm_uq.app.cli import options as opt
from cmm_uq.app.cli.options import argument, option
from cmm_uq.app.cli.terminal import can_answer, say, say_now
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.output.interruption import keeping

LATER_S = 0.7  # s after which the worker is begun


def desk(
    folder: Path = argument(Path(), "Folder that the desk works in.", "FOLDER", "the working folder"),
    port: int = option(0, "Port to listen on.", "N", "a free one", min=0, max=65535),
    bind: str = option(
        "127.0.0.1", "Address to listen on; for any but 127.0.0.1 give --tls and --accounts.", "ADDRESS"
    ),
    name: list[str] | None = opt.HOST,
    tls: Path | None = opt.TLS,
    tls_key: Path | None = opt.TLS_KEY,
    accounts: Path | None = opt.ACCOUNTS,
    add_account: str | None = opt.ADD_ACCOUNT,
    open_: bool = option(True, "Open it in a browser.", None, True, "--open/--no-open"),
    quiet: bool = opt.QUIET,
) -> None:
    """Make certificates in a browser: drop an export, choose the artefact, fill in a dozen fields.

    The link is opened once, on this machine, by whoever started the desk. All that is done there lies in FOLDER, as files that
    the other commands read. For other machines there are accounts: cmm-uq desk --accounts FILE --add-account anna:work.
    """
    from cmm_uq.app.desk.desk import Desk
    from cmm_uq.app.serve import accounts as own, server as http

    if add_account is not None:
        put_account(accounts, add_account)
        return
    if not folder.is_dir():
        raise CmmUqError("is no folder", where=str(folder), fix="Name a folder that is there")
    context = own.tls_of(tls, tls_key, accounts)
    if accounts is None and bind != "localhost" and not _loopback(bind):
        fix = "Give --tls and --accounts; or cmm-uq serve --bind, which shows the records, to be read"
        problem = "the desk writes files and runs commands: without accounts it is for this machine alone"
        raise CmmUqError(problem, where=f"--bind {bind}", fix=fix)
    place = Desk(folder, say_now)
    address = "127.0.0.1" if bind == "localhost" else bind
    with (
        http.RecordsServer(place.answer, address, port, name or (), context) as server,
        keeping(lambda: "the desk is closed"),
    ):
        link = place.open_at(server.url, server.server_port, accounts)
        if not quiet:
            say_now(f"{place.root} at {link} until Ctrl-C")
        later = threading.Timer(LATER_S, place.begin)  # the first page first
        later.daemon = True
        later.start()
        if open_:
            import webbrowser

            threading.Thread(target=webbrowser.open, args=(link,), daemon=True).start()
        try:
            server.serve_forever()
        finally:
            later.cancel()
            place.close()


def put_account(accounts: Path | None, stated: str) -> None:
    """Ask for a password on the terminal, and write the account."""
    from cmm_uq.app.serve.accounts import add_account

    if accounts is None:
        raise CmmUqError("says no file for the account", where="--add-account", fix="Give it with --accounts FILE")
    add_account(accounts, stated, _password)
    say(f"{accounts}: {stated.replace(':', ', role ')}")


def _password() -> str:
    if not can_answer():
        raise CmmUqError("nobody can type a password here", where="--add-account", fix="Run it in a terminal")
    first, second = getpass.getpass("Password: "), getpass.getpass("The same again: ")
    if first != second:
        raise CmmUqError("both are not the same", where="password", fix="Type it again")
    return first


def _loopback(bind: str) -> bool:
    try:
        return ipaddress.ip_address(bind).is_loopback
    except ValueError:
        return False
