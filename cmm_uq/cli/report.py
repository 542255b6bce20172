"""``cmm-uq report JOB``: the certificate of a recording."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from cmm_uq.cli.importing import show_imported
from cmm_uq.cli.options import Force, Job, Json, Quiet, Records, Seed, Strict, Verbose, examples, out
from cmm_uq.cli.printing import conclude
from cmm_uq.cli.progress import shown

EXAMPLES = examples(
    "report examples/iota-1102-20C", "report JOB --out DIR --seed 3", "report JOB --json --strict > results.json"
)


def command(
    job: Job,
    out: Annotated[Path | None, out("reports/<job id>")] = None,
    seed: Seed = 0,
    force: Force = False,
    strict: Strict = False,
    quiet: Quiet = False,
    verbose: Verbose = False,
    json: Json = False,
    records: Records = None,
) -> None:
    """Estimate, decide, and write certificate.html, certificate.pdf and results.json."""
    with shown(quiet=quiet or json, verbose=verbose) as stage:
        from cmm_uq.commands.report import write_report

        told = None if quiet or json else show_imported
        report = write_report(job, out, seed=seed, force=force, stage=stage, told=told, records=records)
    conclude(report, json=json, quiet=quiet, strict=strict, verbose=verbose)
