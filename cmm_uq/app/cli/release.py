"""``cmm-uq release CERTIFICATE --by NAME``: a draft released, or a certificate withdrawn or replaced."""

from __future__ import annotations

from typing import Annotated

import typer

from cmm_uq.app.cli.options import Json, Quiet, Records, examples
from cmm_uq.app.cli.terminal import can_answer, put_data, say
from cmm_uq.base.errors import CmmUqError, printable

EXAMPLES = examples(
    "release K-2026-104 --by 'A. Huber' --reason 'checked against the recording'",
    "release K-2026-105 --by 'A. Huber' --despite 'customer informed, to be adjusted'",
    "release K-2026-104 --withdraw --by 'A. Huber' --reason 'wrong artefact'",
    "release K-2026-104 --replaced-by K-2026-118 --by 'A. Huber' --reason 'corrected'",
)


def command(
    certificate: Annotated[
        str, typer.Argument(help="Number, id of the job, or number of its entry.", metavar="CERTIFICATE")
    ],
    by: Annotated[str, typer.Option(help="Who does it.", metavar="NAME")],
    reason: Annotated[str, typer.Option(help="Why; it stays in the records.", metavar="TEXT")] = "",
    despite: Annotated[
        str,
        typer.Option(
            help="Why it is released although a statement of it is no pass; it stays in the records.", metavar="TEXT"
        ),
    ] = "",
    withdraw: Annotated[bool, typer.Option("--withdraw", help="Withdraw it instead.")] = False,
    replaced_by: Annotated[
        str | None,
        typer.Option(help="Released certificate that takes its place.", metavar="CERTIFICATE", show_default="none"),
    ] = None,
    records: Records = None,
    quiet: Quiet = False,
    json: Json = False,
) -> None:
    """Release a certificate: until then it is a draft. By two persons where [laboratory] four_eyes = true.

    Refused for an artefact that was out of date on the day of the measurement, for what was simulated or compensated, and for
    what says DRAFT on its pages, since ISO/IEC 17025:2017, 7.8 asks for something that it does not state. One that states
    fail, undecided or incomplete needs a word why: --despite, or the answer to a question on a terminal.
    """
    if withdraw and replaced_by is not None:
        raise CmmUqError("a certificate is withdrawn or replaced, not both", where="--withdraw", fix="Leave out one")
    from cmm_uq.app.commands.certificates import release as releases
    from cmm_uq.laboratory.records import open_records

    with open_records(records) as opened:
        if withdraw or replaced_by is not None:
            done = releases.withdraw(opened, certificate, by=by, reason=reason, replaced_by=replaced_by)
        else:
            ask = _asked if not (quiet or json) and can_answer() else _nothing
            done = releases.release(opened, certificate, by=by, reason=reason, despite=despite, ask=ask)
        signatures = opened.signatures(done.certificate.entry)
    now = done.certificate
    if json:
        signed = [
            {"what": one.what, "by": one.by, "reason": one.reason, "at": one.at.isoformat()} for one in signatures
        ]
        put_data({
            "certificate": now.number, "job": now.job, "entry": now.entry, "state": now.state, "waiting": done.waiting,
            "signatures": signed,
        })  # fmt: skip
    elif not quiet:
        waits = f"; {done.waiting} more must sign" if done.waiting else ""
        say(printable(f"{now.number} of {now.day} ({now.machine}): {now.state}{waits}"))


def _asked(stated: str) -> str:
    """What the one who releases says of a certificate that states no pass."""
    say(printable(f"{stated}."))
    return str(typer.prompt("Why is it released all the same (nothing: it is not)", default="", show_default=False))


def _nothing(stated: str) -> str:
    return ""
