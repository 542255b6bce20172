"""``cmm-uq batch FOLDER…``: the reports of many jobs, by processes or a cluster."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from cmm_uq.app.cli.options import Force, Json, Quiet, Records, Seed, Strict, Verbose, examples, job_folders, out
from cmm_uq.app.cli.summary import screen_layout
from cmm_uq.app.cli.terminal import BAD_INPUT, NOT_CONFORMING, progress, put_data, show

if TYPE_CHECKING:
    from cmm_uq.app.commands.laboratory.batch import Batch
    from cmm_uq.certificate.wording import Summary

EXAMPLES = examples(
    "batch jobs/2026",
    "batch jobs --workers 8 --results-only --parquet values.parquet",
    "batch jobs --out /srv/reports --resume --json",
    "batch jobs --scheduler tcp://head:8786",
)
TOLD = 20  # failed jobs that are named where not everything is asked for


def command(
    folders: Annotated[
        list[Path],
        typer.Argument(
            help="Job folders, or folders with job folders anywhere below.",
            metavar="FOLDER...",
            autocompletion=job_folders,
        ),
    ],
    out: Annotated[Path | None, out("reports")] = None,
    workers: Annotated[
        int | None,
        typer.Option(
            help="Processes at once; no byte depends on it.",
            metavar="N",
            show_default="as many as there are processors",
        ),
    ] = None,
    scheduler: Annotated[
        str | None,
        typer.Option(help="Address of a Dask cluster that computes instead.", metavar="tcp://HOST:PORT"),
    ] = None,
    results_only: Annotated[
        bool,
        typer.Option("--results-only", help="Write results.json alone: the same bytes, no document, no picture."),
    ] = False,
    parquet: Annotated[
        Path | None, typer.Option(help="Write a Parquet file, too: a row for each value.", metavar="FILE")
    ] = None,
    resume: Annotated[
        bool,
        typer.Option("--resume", help="Leave jobs alone whose report is there, from the same files by this version."),
    ] = False,
    time_limit: Annotated[
        float, typer.Option(help="Seconds that one job may take before it is stopped.", metavar="S")
    ] = 1800.0,
    tries: Annotated[
        int,
        typer.Option(help="Processes that one job may end (killed, out of memory) before it is given up.", metavar="N"),
    ] = 3,
    seed: Seed = 0,
    force: Force = False,
    strict: Strict = False,
    quiet: Quiet = False,
    verbose: Verbose = False,
    json: Json = False,
    records: Records = None,
) -> None:
    """Write the report of every job as `report` does; one that fails never stops the others. Exit code 2 when one failed."""
    with progress(quiet=quiet or json, verbose=verbose) as stage:
        from cmm_uq.app.commands.laboratory.batch import BatchOptions as Asked, write_batch

        asked = Asked(workers, scheduler, results_only, seed, resume, force, time_limit, tries)
        batch = write_batch(folders, out, asked, parquet=parquet, stage=stage, records=records)
    if json:
        put_data(batch.as_data())
    elif not quiet:
        show(screen_layout(verbose=verbose).screen(_summary(batch, verbose=verbose)))
    if batch.failed:
        raise typer.Exit(BAD_INPUT)
    if strict and batch.not_conforming:
        raise typer.Exit(NOT_CONFORMING)


def _summary(batch: Batch, *, verbose: bool) -> Summary:
    """What came of it, and which jobs failed."""
    from cmm_uq.base.messages import Text, Verbatim, plural, say
    from cmm_uq.certificate.wording import Headline as Verdict, Summary
    from cmm_uq.laboratory.schedule.progress import duration, pace

    counted: list[Text] = [say("{count} written", count=batch.written)]
    for count, told in (
        (batch.already, say("{count} there already", count=batch.already)),
        (batch.planned, say("{count} still to be measured", count=batch.planned)),
        (batch.not_conforming, say("{count} not conforming or inconsistent", count=batch.not_conforming)),
        (len(batch.failed), say("{count} failed", count=len(batch.failed))),
    ):
        counted += [told] if count else []
    jobs = plural(batch.count, one=say("1 job"), many=say("{count} jobs", count=batch.count))
    verdict = Verdict("FAILED" if batch.failed else "DONE", "bad" if batch.failed else "good", jobs, tuple(counted))
    remarks: list[Text] = [say("Reports: {folder}", folder=Verbatim(batch.out))]
    if batch.records:
        remarks.append(say("Recorded in {records}", records=Verbatim(batch.records)))
    if batch.parquet is not None:
        remarks.append(say("Values: {file}", file=Verbatim(batch.parquet)))
    if batch.written and batch.seconds > 0:
        took, rate = Verbatim(duration(batch.seconds)), Verbatim(pace(batch.written / batch.seconds))
        remarks.append(say("{took}, {rate}", took=took, rate=rate))
    if batch.ended:
        remarks.append(plural(
            batch.ended,
            one=say("1 process ended over a job, which was then given to another."),
            many=say("{count} processes ended over a job, which was then given to another.", count=batch.ended),
        ))  # fmt: skip
    named = batch.failed if verbose else batch.failed[:TOLD]
    warnings: list[Text] = [Verbatim(one) for one in named]
    if more := len(batch.failed) - len(named):
        warnings.append(say("{more} more failed; --verbose names them all, --json as data.", more=more))
    return Summary(verdicts=(verdict,), remarks=tuple(remarks), warnings=tuple(warnings))
