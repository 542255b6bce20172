"""``cmm-uq serve``: the records to look at, in a browser on this machine."""

from __future__ import annotations

import threading
from typing import Annotated

import typer

from cmm_uq.app.cli.options import Quiet, ReadRecords, examples
from cmm_uq.app.cli.terminal import say_now
from cmm_uq.base.output.interruption import keeping

EXAMPLES = examples("serve", "serve --records lab.db --open", "serve --records postgresql://lab@db/records --port 9000")


def command(
    records: ReadRecords = None,
    port: Annotated[
        int, typer.Option(help="Port to listen on; 0 takes a free one.", metavar="N", min=0, max=65535)
    ] = 8765,
    bind: Annotated[
        str,
        typer.Option(
            help="Address to listen on; 0.0.0.0 is every network of this machine. Whoever reaches it can read the records.",
            metavar="ADDRESS",
        ),
    ] = "127.0.0.1",
    name: Annotated[
        list[str] | None,
        typer.Option(
            help="Further name by which browsers reach this machine; repeatable.",
            metavar="HOST",
            show_default="this machine's own",
        ),
    ] = None,
    open_: Annotated[bool, typer.Option("--open", help="Open the page in a browser.")] = False,
    quiet: Quiet = False,
) -> None:
    """Show the records in a browser: what is due or fails, trends, certificates, artefacts. Nothing can be changed there."""
    from cmm_uq.app.serve.server import RecordsServer
    from cmm_uq.app.serve.site import Site

    site = Site(records)
    with (
        RecordsServer(site.answer, bind=bind, port=port, names=name or ()) as server,
        keeping(lambda: "the page is closed"),
    ):
        if not quiet:
            say_now(f"{site.place} at {server.url} until Ctrl-C")
            if not server.alone:
                say_now("Whoever reaches this address can read the records: there are no passwords")
        threading.Thread(target=site.warm, daemon=True).start()
        if open_:
            import webbrowser

            threading.Thread(target=webbrowser.open, args=(server.url,), daemon=True).start()
        server.serve_forever()
