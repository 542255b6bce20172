"""``cmm-uq selftest``: evidence of software validation for a laboratory's file (ISO/IEC 17025:2017, 7.11.2)."""

from __future__ import annotations

from dataclasses import asdict
from typing import TYPE_CHECKING, Annotated

import typer

from cmm_uq.app.cli.options import Json, Verbose, examples
from cmm_uq.app.cli.summary import screen_layout
from cmm_uq.app.cli.terminal import NOT_CONFORMING, put_data, show

if TYPE_CHECKING:
    from collections.abc import Sequence

    from cmm_uq.base.messages import Text
    from cmm_uq.certificate.in_short import Summary, Verdict
    from cmm_uq.maths.uncertainty.selftest import Outcome

EXAMPLES = examples("selftest", "selftest --verbose > selftest.txt", "selftest --json")
SCHEMA = "cmm-uq/selftest/1"


def command(
    quiet: Annotated[bool, typer.Option("--quiet", "-q", help="Print only what fails, and the count.")] = False,
    verbose: Verbose = False,
    json: Json = False,
) -> None:
    """Compute published reference figures and compare: expected, got, source. Exit code 4 when any differs."""
    from cmm_uq import __version__
    from cmm_uq.maths.uncertainty.selftest import run

    outcomes = run()
    passed = int(sum(outcome.passed for outcome in outcomes))
    if json:
        figures = [{**asdict(one), "got": float(one.got), "passed": bool(one.passed)} for one in outcomes]
        put_data({"schema": SCHEMA, "program": f"cmm-uq {__version__}", "passed": passed, "figures": figures})
    else:
        show(screen_layout(verbose=verbose).screen(_summary(outcomes, quiet=quiet, verbose=verbose)))
    if passed < len(outcomes):
        raise typer.Exit(NOT_CONFORMING)


def _summary(outcomes: Sequence[Outcome], *, quiet: bool, verbose: bool) -> Summary:
    """The count, what fails or all figures, and how many there are of each source."""
    from cmm_uq import __version__
    from cmm_uq.base.messages import NOTHING, Verbatim, say
    from cmm_uq.certificate.in_short import Summary
    from cmm_uq.maths.uncertainty.selftest import as_text

    passed = sum(outcome.passed for outcome in outcomes)
    count = say(
        "cmm-uq {version}: {passed} of {total} figures within their tolerance", version=Verbatim(__version__),
        passed=passed, total=len(outcomes),
    )  # fmt: skip
    shown = [_verdict(count, passed == len(outcomes))]
    for (case, expected, tolerance, got, source, _), outcome in zip(as_text(outcomes), outcomes, strict=True):
        if not outcome.passed or (verbose and not quiet):
            told = Verbatim(f"{got}, expected {expected} within {tolerance} ({source})")
            shown.append(_verdict(Verbatim(case), outcome.passed, (told,)))
    sources = dict.fromkeys(outcome.source for outcome in outcomes)
    rows = [(source, [o.passed for o in outcomes if o.source == source]) for source in sources]
    figures = tuple(
        (Verbatim(source), say("{passed} of {total}", passed=sum(each), total=len(each)), NOTHING)
        for source, each in rows
    )
    return Summary(verdicts=tuple(shown), figures=() if quiet or verbose else figures)


def _verdict(what: Text, passed: bool, remarks: tuple[Text, ...] = ()) -> Verdict:
    from cmm_uq.certificate.in_short import Verdict

    return Verdict("PASS", "good", what, remarks) if passed else Verdict("FAIL", "bad", what, remarks)
