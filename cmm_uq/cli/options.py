"""Options that several subcommands have, each said once."""

from __future__ import annotations

from typing import Annotated

import typer

Seed = Annotated[int, typer.Option(help="Seed of everything random; the same seed gives the same bytes.", min=0)]
Quiet = Annotated[bool, typer.Option("--quiet", "-q", help="Print nothing but errors.")]
Json = Annotated[bool, typer.Option("--json", help="Print results.json instead of the summary.")]
Force = Annotated[
    bool, typer.Option("--force", help="Keep what stands in the way as NAME.previous instead of refusing.")
]
Settled = Annotated[
    bool, typer.Option("--strict", help="Exit code 4 unless Monte Carlo is stable to the digits asked for.")
]
Strict = Annotated[
    bool, typer.Option("--strict", help="Exit code 4 unless everything conforms and agrees with the model.")
]
