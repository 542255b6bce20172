"""The analysis of shifted artefacts: along an axis, or in a plane."""

from __future__ import annotations

from cmm_uq import __version__
from cmm_uq.artefacts.shift import axis_page as axis_page, plane_page as plane_page
from cmm_uq.artefacts.shift.axis import ShiftResult, analyse_shift, checked_series
from cmm_uq.artefacts.shift.axis_page import shift_results
from cmm_uq.artefacts.shift.plane import PlaneShiftResult, analyse_plane, checked_plate
from cmm_uq.artefacts.shift.plane_page import plane_shift_results
from cmm_uq.artefacts.shift.result import shift_facts, table_file, table_text
from cmm_uq.base.messages import Text, Verbatim, names, say
from cmm_uq.certificate.certificate import certificate_of
from cmm_uq.certificate.clauses import clauses_data, formal_warnings
from cmm_uq.certificate.document import Document
from cmm_uq.certificate.origin import posterior_file
from cmm_uq.certificate.result import Outcome, OwnAnalysis, Recipe
from cmm_uq.certificate.sections.results import as_found_data, as_found_section
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
    if isinstance(found, ShiftResult):
        told, results = axis_page.warnings(found), shift_results(found)
    else:
        told, results = plane_page.warnings(found), plane_shift_results(found)
    told += tuple(found.stating.warnings())
    if found.job.circumstances.uncertainty.of_artefact:
        told += (
            say(
                "What is stated of the artefact's temperature, expansion, alignment and fixturing is in no figure here."
            ),
        )
    warned = (*told, *formal_warnings(found.job))
    short = axis_page.summary(found, warned) if isinstance(found, ShiftResult) else plane_page.summary(found, warned)
    draws, table = posterior_file(found.draws, found.job.origin), table_file(found.job)
    results |= as_found_data(found.job) | clauses_data(found.job) | found.stating.data() | {"posterior": draws.entry}
    files = {table: table_text(found.table), draws.name: draws.content}
    return Outcome(
        found, lambda: _certificate(found, told, tuple(files)), results, short, warned, files,
        draws=found.draws,
    )  # fmt: skip


def _certificate(found: ShiftResult | PlaneShiftResult, told: tuple[Text, ...], files: tuple[str, ...]) -> Document:
    if isinstance(found, ShiftResult):
        sections, left = axis_page.sections(found), axis_page.quantities(found)
    else:
        sections, left = plane_page.sections(found), plane_page.quantities(found)
    sections.insert(1, as_found_section(found.job, left))
    produced_by = say(
        "cmm-uq {version}, {sampler}, seed {seed}",
        version=Verbatim(__version__),
        sampler=Verbatim(found.estimate.chains.sampler),
        seed=found.estimate.seed,
    )
    return certificate_of(found.job, sections, told, produced_by, tuple(names(files)))


OWN = OwnAnalysis(report=Recipe(analyse, outcome))
