"""``cmm-uq desk``: the desk in the browser, until Ctrl-C."""

from __future__ import annotations

import ipaddress
import threading
from pathlib import Path

from cmm_uq.app.cli import options as opt
from cmm_uq.app.cli.options import argument, option
from cmm_uq.app.cli.terminal import say_now
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.output.interruption import keeping

LATER_S = 0.7  # s after which the worker is begun


def desk(
    folder: Path = argument(Path(), "Folder that the desk works in.", "FOLDER", "the working folder"),
    port: int = option(0, "Port to listen on.", "N", "a free one", min=0, max=65535),
    bind: str = option("127.0.0.1", "127.0.0.1 alone: any other is refused.", "ADDRESS"),
    open_: bool = option(True, "Open it in a browser.", None, True, "--open/--no-open"),
    quiet: bool = opt.QUIET,
) -> None:
    """Make certificates in a browser: drop an export, choose the artefact, fill in a dozen fields.

    The link is opened once, on this machine, by whoever started the desk. All that is done there lies in FOLDER, as files that
    the other commands read.
    """
    from cmm_uq.app.desk.desk import Desk
    from cmm_uq.app.serve.server import RecordsServer

    if bind != "localhost" and not _loopback(bind):
        raise CmmUqError(
            "the desk writes files and runs commands, and is for this machine alone",
            where=f"--bind {bind}",
            fix="cmm-uq serve --bind shows the records to others, to be read",
        )
    if not folder.is_dir():
        raise CmmUqError("is no folder", where=str(folder), fix="Name a folder that is there")
    place = Desk(folder, say_now)
    with RecordsServer(place.answer, "127.0.0.1", port) as server, keeping(lambda: "the desk is closed"):
        link = place.open_at(server.url, server.server_port)
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


def _loopback(bind: str) -> bool:
    try:
        return ipaddress.ip_address(bind).is_loopback
    except ValueError:
        return False
