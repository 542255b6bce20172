"""``cmm-uq report``, ``diagnose``, ``effects``, ``plan``, ``prove``, ``part``, ``budget``, ``selftest``: what is evaluated."""

from __future__ import annotations

import sys
from dataclasses import asdict
from functools import partial
from pathlib import Path

import typer

from cmm_uq import __version__
from cmm_uq.app.cli import options as opt
from cmm_uq.app.cli.options import Ending, argument, flag, job_folder, option
from cmm_uq.app.cli.summary import conclude, screen_layout, show_imported
from cmm_uq.app.cli.terminal import NOT_CONFORMING, put_data, say, show
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.languages.translation import ENGLISH

DOCUMENTS = "force strict quiet verbose json language"
OF_CASES = "Rate of false alarms that the diagnosis is asked for."


def report(
    job: list[Path] = job_folder(
        ..., "Job folder: job.toml and the recording that it names; with --scheduled folders that hold job folders."
    ),
    out: Path | None = opt.out(None, "reports/<job id>"),
    seed: int = opt.seed(),
    end: Ending = opt.ending(
        DOCUMENTS,
        "unless everything conforms and agrees with the model; with --scheduled 1 while anything needs a person",
    ),
    records: str | None = opt.RECORDS,
    sign: str | None = opt.SIGN,
    time_server: str | None = opt.TIME_SERVER,
    level: str | None = opt.LEVEL,
    trust: list[Path] | None = opt.TRUSTED,
    scheduled: bool = flag(
        False, "--scheduled", "Every job that is new or changed; a line of JSON for each; DIR holds them all."
    ),
    schedule: Path | None = option(
        None, "With --scheduled: what the run goes by.", "FILE", "schedule.toml in the first JOB"
    ),
    lines: Path | None = option(None, "With --scheduled: file that the lines are added to.", "FILE", "printed"),
    dry_run: bool = flag(False, "--dry-run", "With --scheduled: say what would happen, and do nothing."),
) -> None:
    """Estimate, decide, and write certificate.html, certificate.pdf, certificate.xml and results.json."""
    alone = {**{f"--{name}": getattr(end, name) for name in ("force", "verbose", "language")}, "--sign": sign}
    many = {"--schedule": schedule, "--lines": lines, "--dry-run": dry_run}
    if name := next((name for name, value in (alone if scheduled else many).items() if value), ""):
        wrong, fix = ("without", "Leave it out") if scheduled else ("with", "Add --scheduled")
        raise CmmUqError(f"goes {wrong} --scheduled", where=name, fix=fix)
    if scheduled:
        from cmm_uq.app.cli.records import STANDARD_OUTPUT, run
        from cmm_uq.app.commands.laboratory.schedule import ScheduledOptions

        options = ScheduledOptions(tuple(job), out, schedule, records, seed or None, dry_run, end.strict)
        raise typer.Exit(run(options, None if end.quiet and lines is None else lines or STANDARD_OUTPUT))
    if len(job) > 1:
        raise CmmUqError(f"{len(job)} jobs are named, and a report is of one", where=str(job[1]),
                         fix="Report them one after the other, or with --scheduled")  # fmt: skip
    signing = None if sign is None else opt.open_key(sign, time_server, level, trust)
    with end.progress() as stage:
        from cmm_uq.app.commands.report import write_report

        told = partial(show_imported, silent=end.silent)
        written = write_report(job[0], out, seed=seed, force=end.force, stage=stage, told=told, records=records,
                               language=end.language, signing=signing)  # fmt: skip
    try:
        conclude(written, end)
    finally:
        if signing is not None:
            signed = [path for path in written.files.values() if path.suffix in (".pdf", ".xml")]
            Ending(end.silent).put({}, opt.signatures(signing, signed))


def diagnose(
    job: Path = opt.JOB,
    out: Path | None = opt.out(None, "reports/<job id>/diagnosis"),
    seed: int = opt.seed(),
    alpha: float = option(0.01, "Rate of false alarms, a probability from 0.000001 to 0.5.", "P"),
    against: Path | None = option(
        None, "Coordinates or lengths that a simulation predicts, or an error map.", "FILE", "the job's model"
    ),
    end: Ending = opt.ending(DOCUMENTS),
    records: str | None = opt.RECORDS,
) -> None:
    """Locate a mismatch, name the physics that was left out, and show what modelling it improves."""
    with end.progress() as stage:
        from cmm_uq.app.commands.diagnose import write_diagnosis

        told = partial(show_imported, silent=end.silent)
        written = write_diagnosis(job, out, seed=seed, alpha=alpha, against=against, force=end.force, stage=stage, told=told,
                                  language=end.language, records=records)  # fmt: skip
    conclude(written, end)


def effects(
    word: str = argument("", "Only those that have it in name, title, formula, mechanism or remedy.", "[WORD]", "all"),
    job: Path | None = option(None, "Job whose own effects are listed too.", "JOB", "none"),
    end: Ending = opt.ONLY_JSON,
) -> None:
    """List the effects that a job can name and a diagnosis looks for: of the program, of packages, of the job itself.

    With WORD also formula, prior, needed columns and what each points to.
    """
    from cmm_uq.app.commands.forms import listed_effects

    found = listed_effects(word, job)
    said = {"parameters": "prior", "columns": "needs", "mechanism": "lies in", "points_to": "points to"}
    rows: list[tuple[str, str]] = []
    for each in found:
        rows.append((each["name"], each["title"]))
        further = {key: text for key, text in each.items() if text and key not in ("name", "title")} if word else {}
        rows += [("", f"{said.get(key, key)}: {text}") for key, text in further.items()]
    end.put({"effects": found}, screen_layout(verbose=True).table(rows))


def plan(
    job: Path = job_folder(..., "Job folder; its recording may still be missing."),
    out: Path | None = opt.out(None, "reports/<job id>/plan"),
    power: bool = option(
        True, "Predict how large an effect must be for the diagnosis to find it; takes most of the time."
    ),
    seed: int = option(0, "Seed of the recordings drawn for that.", "N", min=0),
    for_part: Path | None = option(None, "Part's job: what the plan does to its uncertainty.", "PART", "none"),
    end: Ending = opt.ending(DOCUMENTS),
) -> None:
    """Say what placings determine, search for better ones, and write plan.csv, plan.html and results.json."""
    with end.progress() as stage:
        from cmm_uq.app.commands.plan import write_plan

        written = write_plan(
            job, out, power=power, seed=seed, force=end.force, stage=stage, language=end.language, for_part=for_part
        )
    conclude(written, end)


def prove(
    job: Path = job_folder(..., "Job folder; its recording may still be missing where its noise is stated."),
    out: Path | None = opt.out(None, "reports/<job id>/prove"),
    cases: int = option(200, "How many sealed cases to draw.", "N"),
    workers: int | None = option(
        None, "Processes at once; the figures do not depend on it.", "N", "as many as there are processors"
    ),
    seed: int = option(0, "Seed of the cases; the same seed gives the same bytes.", "N", min=0),
    alpha: float = option(0.01, OF_CASES, "P"),
    end: Ending = opt.ending(DOCUMENTS, "where the cases show that an acceptance figure is missed"),
) -> None:
    """Draw cases with known truth on a job's set-ups, diagnose them, and write what a laboratory files as validation."""

    def sealed(sha256: str) -> None:
        """Before the first diagnosis, so that nobody can say the truth was made to fit."""
        say(f"Truth sealed: sha256 {sha256}")
        sys.stdout.flush()

    with end.progress() as stage:
        from cmm_uq.app.commands.prove import ProofOptions, write_proof
        from cmm_uq.laboratory.schedule.processes import processes

        options = ProofOptions(cases, processes() if workers is None else workers, seed, alpha)
        tell = None if end.silent else sealed
        written = write_proof(job, options, out, force=end.force, stage=stage, sealed=tell, language=end.language)
    conclude(written, end)


def part(
    job: Path = job_folder(
        ..., "Job folder of a part: job.toml, the machine's certificate, and the measured points if there are some."),
    out: Path | None = opt.out(None, "reports/<job id>"),
    seed: int = opt.seed(),
    trials: int | None = option(None, "Virtual measurements.", "N", "200000", min=1000),
    digits: int | None = option(
        None, "Digits of u that are to be known: as many virtual measurements as they need.", "N", "none", min=1, max=3),
    rerun: bool = flag(False, "--rerun", "Compute the machine's certificate again from its inputs, and compare."),
    trust: list[Path] | None = option(
        None, "Certificates that you trust, PEM or DER: the machine's certificate must then be signed.", "FILE|DIR",
        "nobody"),
    records: str | None = option(
        None, "Records that the report is kept in, a file, a postgresql:// URL, or none; once named, the machine's drift is "
        "known from its history in them.", "WHERE", "$CMM_UQ_RECORDS, else reports/records.db, without drift"),
    end: Ending = opt.ending(DOCUMENTS, "unless every characteristic conforms"),
) -> None:  # fmt: skip
    """Verify the machine's certificate, measure the part virtually, and write part.html, part.pdf and results.json."""
    with end.progress() as stage:
        from cmm_uq.app.commands.parts.part import PartOptions, write_part

        options = PartOptions(seed, trials, digits, rerun, None if trust is None else tuple(trust), records)
        written = write_part(
            job, out, options=options, force=end.force, stage=stage, language=end.language, records=records
        )
    conclude(written, end)


def budget(
    file: Path = argument(
        ..., "Measurement model: outputs, inputs, correlations, in TOML.", "FILE", autocompletion=opt.toml_files
    ),
    out: Path | None = opt.out(None, "reports/<name of the file>"),
    seed: int | None = option(None, "Seed of the Monte Carlo.", "N", "the file's", min=0),
    end: Ending = opt.ending(DOCUMENTS, "unless Monte Carlo is stable to the digits asked for"),
) -> None:
    """Propagate uncertainty by the GUM and by Monte Carlo, and write budget.html, budget.pdf and results.json."""
    with end.progress() as stage:
        from cmm_uq.app.commands.budget import write_budget

        written = write_budget(file, out, seed=seed, force=end.force, stage=stage, language=end.language or ENGLISH)
    conclude(written, end)


def selftest(
    quiet: bool = flag(False, "--quiet", "Print only what fails, and the count.", "-q"),
    verbose: bool = opt.VERBOSE,
    json: bool = opt.JSON,
) -> None:
    """Compute published reference figures and compare: expected, got, source. Exit code 4 when any differs."""
    from cmm_uq.base.messages import NOTHING, Text, Verbatim, say
    from cmm_uq.certificate.wording import Headline, Summary
    from cmm_uq.maths.uncertainty.reference.selftest import as_text, run

    outcomes = run()
    passed = int(sum(outcome.passed for outcome in outcomes))
    if json:
        figures = [{**asdict(one), "got": float(one.got), "passed": bool(one.passed)} for one in outcomes]
        program = f"cmm-uq {__version__}"
        put_data({"schema": "cmm-uq/selftest/1", "program": program, "passed": passed, "figures": figures})
    else:

        def verdict(what: Text, good: bool, *remarks: Text) -> Headline:
            return Headline("PASS" if good else "FAIL", "good" if good else "bad", what, remarks)

        count = say(
            "cmm-uq {version}: {passed} of {total} figures within their tolerance", version=Verbatim(__version__),
            passed=passed, total=len(outcomes),
        )  # fmt: skip
        verdicts = [verdict(count, passed == len(outcomes))]
        for (case, expected, tolerance, got, source, _), outcome in zip(as_text(outcomes), outcomes, strict=True):
            if not outcome.passed or (verbose and not quiet):
                text = Verbatim(f"{got}, expected {expected} within {tolerance} ({source})")
                verdicts.append(verdict(Verbatim(case), outcome.passed, text))
        sources: dict[str, list[bool]] = {}  # how many there are of each, where not each is told
        for outcome in () if quiet or verbose else outcomes:
            sources.setdefault(outcome.source, []).append(outcome.passed)
        rows = [(Verbatim(source), say("{passed} of {total}", passed=sum(each), total=len(each)), NOTHING)
                for source, each in sources.items()]  # fmt: skip
        show(screen_layout(verbose=verbose).screen(Summary(verdicts=tuple(verdicts), figures=tuple(rows))))
    if passed < len(outcomes):
        raise typer.Exit(NOT_CONFORMING)
