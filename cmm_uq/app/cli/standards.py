"""``cmm-uq standards``: the standards that are decided, clause by clause, and forms to hold them against one's own copy."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from cmm_uq.app.cli.options import examples
from cmm_uq.app.cli.terminal import say
from cmm_uq.base.errors import CmmUqError, printable

EXAMPLES = examples(
    "standards", 'standards "ISO 10360-2:2009"', 'standards "ISO 10360-2:2009" --form iso-10360-2-clauses.toml'
)


def command(
    name: Annotated[str | None, typer.Argument(help="Standard with its edition.", metavar="[NAME]")] = None,
    form: Annotated[
        Path | None, typer.Option(help="File to write its form to.", metavar="FILE", show_default="none")
    ] = None,
) -> None:
    """List the standards that are decided, or what is done of each clause of one.

    With --form a form is written that a laboratory fills in beside its own copy and names in [[conformity]] clauses.
    Nothing is overwritten.
    """
    from cmm_uq.app.commands.certificates.standards import clauses_of, listed_standards, write_form

    if name is None:
        if form is not None:
            raise CmmUqError("a form is of one standard", where="--form", fix="Name it: cmm-uq standards lists them")
        for standard, characteristics in listed_standards():
            say(printable(f"{standard}: {', '.join(characteristics)}" if characteristics else standard))
        return
    if form is not None:
        say(printable(str(write_form(name, form))))
        return
    for one in clauses_of(name):
        say(printable(f"{one.title}: {one.does}"))
        say(printable(f"    {'read' if one.read else 'not read'}; {one.source}"))
