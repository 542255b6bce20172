"""``cmm-uq affected --version A``: which issued certificates a correction of the package touches."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from cmm_uq.app.cli.options import Json, Quiet, Records, Verbose, examples
from cmm_uq.app.cli.terminal import NOT_CONFORMING, progress, put_data, say
from cmm_uq.base.errors import CmmUqError, printable

if TYPE_CHECKING:
    from cmm_uq.app.commands.certificates.affected import Affected, Change

EXAMPLES = examples(
    "affected --version 0.4.0",
    "affected --version 0.4.0 --list --json",
    "affected --version 0.4.0 --write replacements",
)


def command(
    version: Annotated[
        str,
        typer.Option("--version", help="Oldest version of the package whose certificates are looked at.", metavar="A"),
    ],
    to: Annotated[
        str | None,
        typer.Option("--to", help="Version that has the corrections.", metavar="B", show_default="the installed one"),
    ] = None,
    only_list: Annotated[bool, typer.Option("--list", help="Only list them; compute nothing again.")] = False,
    write: Annotated[
        Path | None,
        typer.Option(help="Folder for a draft in place of each that changed.", metavar="DIR", show_default="none"),
    ] = None,
    records: Records = None,
    quiet: Quiet = False,
    verbose: Verbose = False,
    json: Json = False,
) -> None:
    """Find the certificates that corrections touch, compute them again from the inputs in their PDF, compare figure by figure.

    Exit code 4 where a figure, a decision or a verdict is another one now, or a certificate could not be computed again.
    """
    if only_list and write is not None:
        raise CmmUqError("nothing is written of what is only listed", where="--list", fix="Leave out --list or --write")
    with progress(quiet=quiet or json, verbose=verbose) as stage:
        from cmm_uq import __version__
        from cmm_uq.app.commands.certificates.affected import affected
        from cmm_uq.app.commands.files import silent
        from cmm_uq.laboratory.records import open_records

        last = __version__ if to is None else to
        with open_records(records, read_only=write is None) as opened:
            where = str(opened.place)
            found = list(
                affected(
                    opened,
                    version,
                    last,
                    recompute=not only_list,
                    out=write,
                    where=where,
                    stage=stage or silent,
                )
            )
    if json:
        put_data({"from": version, "to": last, "certificates": [_data(one) for one in found]})
    elif not quiet:
        for one in found:
            _tell(one)
        changed = sum(one.changed for one in found)
        touched = "1 certificate touched" if len(found) == 1 else f"{len(found)} certificates touched"
        say(touched if only_list else f"{touched}, {changed} changed")
    if any(one.changed or (one.problem and not only_list) for one in found):
        raise typer.Exit(NOT_CONFORMING)


def _tell(one: Affected) -> None:
    c = one.certificate
    say(printable(f"{c.number} of {c.day}, {c.machine}, version {c.version}, {c.state}"))
    for correction in one.corrections:
        say(printable(f"  {correction.version}: {correction.what}"))
    if one.problem:
        say(printable(f"  not computed again: {one.problem}"))
    for change in one.changes or ():
        say(printable(f"  {change.quantity}: {_changed(change)}"))
    if one.changed and one.decision != c.decision:
        say(f"  decision: {c.decision} -> {one.decision}")
    if one.changed and one.diagnosis != c.diagnosis:
        say(f"  diagnosis: {c.diagnosis or 'none'} -> {one.diagnosis or 'none'}")
    if one.changes is not None and not one.changed:
        say("  no figure changes")
    if one.written is not None:
        say(printable(f"  draft in {one.written}"))


def _changed(change: Change) -> str:
    before, after = (_figure(change, figures) for figures in (change.before, change.after))
    if before == after and change.before is not None and change.after is not None:
        before, after = (
            f"95 % interval {figures[2]:.10g} to {figures[3]:.10g} {change.unit}"
            for figures in (change.before, change.after)
        )
    return f"{before} -> {after}"


def _figure(change: Change, figures: tuple[float, float, float, float] | None) -> str:
    """With the ten digits of results.json: fewer would print a small change as none."""
    return "none" if figures is None else f"{figures[0]:.10g} (u {figures[1]:.10g}) {change.unit}"


def _data(one: Affected) -> dict[str, Any]:
    c = one.certificate
    return {
        "certificate": c.number, "job": c.job, "entry": c.entry, "machine": c.machine, "day": c.day.isoformat(),
        "version": c.version, "state": c.state, "command": c.command,
        "corrections": [{"version": each.version, "what": each.what} for each in one.corrections],
        "computed": one.changes is not None, "changed": one.changed, "problem": one.problem or None,
        "decision": {"before": c.decision, "after": one.decision or None},
        "diagnosis": {"before": c.diagnosis, "after": one.diagnosis or None},
        "changes": [
            {"name": each.name, "unit": each.unit, "before": each.before, "after": each.after} for each in one.changes or ()
        ],
        "draft": None if one.written is None else str(one.written),
    }  # fmt: skip
