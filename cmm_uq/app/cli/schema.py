"""``cmm-uq schema NAME``: JSON Schema of a file, for editors that complete and explain."""

from __future__ import annotations

from typing import Annotated

import typer

from cmm_uq.app.cli.options import examples
from cmm_uq.app.cli.terminal import put_json

EXAMPLES = examples("schema job > job.schema.json", "schema budget", "schema truth")


def command(
    name: Annotated[
        str, typer.Argument(help="job (with its plan), part, budget, truth, instrument or schedule.", metavar="NAME")
    ] = "job",
) -> None:
    """Print the JSON Schema of a file, with the kinds, effects and standards that are installed."""
    from cmm_uq.app.commands.jobs.schemas import as_text, schema_named

    put_json(as_text(schema_named(name)))
