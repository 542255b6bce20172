"""The analysis of shifted artefacts: along an axis, or in a plane."""

from __future__ import annotations

from typing import Any

from cmm_uq import __version__
from cmm_uq.artefacts.shift import axis_page, plane_page
from cmm_uq.artefacts.shift.axis import ShiftResult, analyse_shift, checked_series
from cmm_uq.artefacts.shift.plane import PlaneShiftResult, analyse_plane, checked_plate
from cmm_uq.artefacts.shift.result import shift_facts, table_file, table_text
from cmm_uq.base.messages import Verbatim, day, names, say
from cmm_uq.certificate.certificate import certificate_of
from cmm_uq.certificate.clauses import clauses_data, formal_warnings
from cmm_uq.certificate.document import Document
from cmm_uq.certificate.origin import posterior_file
from cmm_uq.certificate.result import Outcome, OwnAnalysis, Recipe
from cmm_uq.certificate.sections.results import as_found_data, as_found_section
from cmm_uq.certificate.wording import Summary, figure_row
from cmm_uq.jobs.job import Job
from cmm_uq.maths.inference.ensembles import Progress


def refuse_unfit(job: Job) -> None:
    if shift_facts(job).plane is not None:
        checked_plate(job)
    else:
        checked_series(job)


def analyse(job: Job, *, seed: int = 0, progress: Progress | None = None) -> ShiftResult | PlaneShiftResult:
    if shift_facts(job).plane is not None:
        return analyse_plane(job, seed=seed, progress=progress)
    return analyse_shift(job, seed=seed, progress=progress)


def outcome(found: ShiftResult | PlaneShiftResult, seed: int) -> Outcome:
    page: Any = axis_page if isinstance(found, ShiftResult) else plane_page
    job, left = found.job, page.quantities(found)
    told = [*page.warnings(found), *found.stating.warnings()]
    if job.circumstances.uncertainty.of_artefact:
        told.append(
            say(
                "What is stated of the artefact's temperature, expansion, alignment and fixturing is in no figure here."
            )
        )
    warned = (*told, *formal_warnings(job))
    figures = tuple(figure_row(name, quantity) for _, _, name, quantity in left)
    short = Summary(page.measured(found), day(job.facts.job.date), figures=figures, warnings=warned)
    draws, table = posterior_file(found.draws, job.origin), table_file(job)
    results = page.shift_results(found) | as_found_data(job) | clauses_data(job) | found.stating.data()
    results["posterior"] = draws.entry
    files = {table: table_text(found.table), draws.name: draws.content}

    def certificate() -> Document:
        sections = page.sections(found)
        sections.insert(1, as_found_section(job, left))
        produced_by = say(
            "cmm-uq {version}, {sampler}, seed {seed}",
            version=Verbatim(__version__), sampler=Verbatim(found.estimate.chains.sampler), seed=found.estimate.seed,
        )  # fmt: skip
        return certificate_of(job, sections, tuple(told), produced_by, tuple(names(files)))

    return Outcome(found, certificate, results, short, warned, files, draws=found.draws)


OWN = OwnAnalysis(report=Recipe(analyse, outcome))
