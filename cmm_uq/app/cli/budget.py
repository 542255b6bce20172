"""``cmm-uq budget FILE``: the uncertainty of any measurement model."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from cmm_uq.app.cli.options import Force, Json, Language, Quiet, Settled, Verbose, examples, out, toml_files
from cmm_uq.app.cli.summary import show_summary
from cmm_uq.app.cli.terminal import NOT_CONFORMING, progress, put_json
from cmm_uq.base.languages.language import ENGLISH

if TYPE_CHECKING:
    from cmm_uq.certificate.in_short import Summary
    from cmm_uq.maths.uncertainty.evaluation import Evaluation

EXAMPLES = examples("budget model.toml", "budget model.toml --seed 2 --out DIR", "budget model.toml --json --strict")


def command(
    file: Annotated[
        Path,
        typer.Argument(
            help="Measurement model: outputs, inputs, correlations, in TOML.", metavar="FILE", autocompletion=toml_files
        ),
    ],
    out: Annotated[Path | None, out("reports/<name of the file>")] = None,
    seed: Annotated[
        int | None, typer.Option(help="Seed of the Monte Carlo.", metavar="N", min=0, show_default="the file's")
    ] = None,
    force: Force = False,
    strict: Settled = False,
    quiet: Quiet = False,
    verbose: Verbose = False,
    json: Json = False,
    language: Language = None,
) -> None:
    """Propagate uncertainty by the GUM and by Monte Carlo, and write budget.html, budget.pdf and results.json."""
    with progress(quiet=quiet or json, verbose=verbose) as stage:
        from cmm_uq.app.commands.budget import write_budget
        from cmm_uq.app.commands.files import silent

        written = write_budget(file, out, seed=seed, force=force, stage=stage or silent, language=language or ENGLISH)
    if json:
        put_json(written.results.decode())
    elif not quiet:
        show_summary(_summary(written.evaluation), written.files, verbose=verbose, name=file.name)
    if strict and not written.evaluation.stable:
        raise typer.Exit(NOT_CONFORMING)


def _summary(evaluation: Evaluation) -> Summary:
    """Each output as a certificate could state it; in full as the row of a table too."""
    from cmm_uq.base.messages import Verbatim, plural, say
    from cmm_uq.certificate.in_short import Summary, Verdict
    from cmm_uq.maths.uncertainty.budget_results import SUMMARY, statement, summary_rows

    names = tuple(evaluation.stated)
    unstable = () if evaluation.stable else tuple(
        Verdict("NOT STABLE", "open", Verbatim(name), (evaluation.stated[name].reason,)) for name in names
    )  # fmt: skip
    one, many = say("one output"), say("{count} outputs", count=len(names))
    return Summary(
        plural(len(names), one=one, many=many), verdicts=unstable,
        remarks=tuple(statement(evaluation, name) for name in names), details=(SUMMARY, *summary_rows(evaluation)),
    )  # fmt: skip
