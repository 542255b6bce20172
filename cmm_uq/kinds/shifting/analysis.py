"""The analysis of shifted artefacts: along an axis, or in a plane."""

from __future__ import annotations

from cmm_uq import __version__
from cmm_uq.documents.as_found_section import as_found_data, as_found_section
from cmm_uq.documents.certificate import certificate_of
from cmm_uq.documents.outcome import Outcome, OwnAnalysis, Recipe
from cmm_uq.documents.posterior_file import posterior_file
from cmm_uq.inference.posterior import Progress
from cmm_uq.jobs.job import Job
from cmm_uq.kinds.shift_axis import page as axis_page
from cmm_uq.kinds.shift_axis.analysis import ShiftResult, analyse_shift
from cmm_uq.kinds.shift_axis.results import shift_results
from cmm_uq.kinds.shift_plate import page as plane_page
from cmm_uq.kinds.shift_plate.analysis import PlaneShiftResult, analyse_plane
from cmm_uq.kinds.shift_plate.results import plane_shift_results
from cmm_uq.kinds.shifting.correction_table import table_text
from cmm_uq.kinds.shifting.facts import shift_facts
from cmm_uq.kinds.shifting.page import table_file
from cmm_uq.messages import Verbatim, say


def analyse(job: Job, *, seed: int = 0, progress: Progress | None = None) -> ShiftResult | PlaneShiftResult:
    """Analyse a shift job.

    Raises
    ------
    CmmUqError : the job cannot be analysed as it stands.
    """
    if shift_facts(job).plane is not None:
        return analyse_plane(job, seed=seed, progress=progress)
    return analyse_shift(job, seed=seed, progress=progress)


def outcome(found: ShiftResult | PlaneShiftResult, seed: int) -> Outcome:
    """The certificate of a shift job, with the correction table beside it."""
    if isinstance(found, ShiftResult):
        sections, told, results = axis_page.sections(found), axis_page.warnings(found), shift_results(found)
        left = axis_page.quantities(found)
    else:
        sections, told, results = plane_page.sections(found), plane_page.warnings(found), plane_shift_results(found)
        left = plane_page.quantities(found)
    sections.insert(1, as_found_section(found.job, left))
    told += tuple(found.stating.warnings())
    results |= as_found_data(found.job) | found.stating.data()
    chains, table = found.estimate.chains, table_file(found.job)
    draws = posterior_file(found.draws, found.job.origin)
    produced_by = say(
        "cmm-uq {version}, {sampler}, seed {seed}",
        version=Verbatim(__version__),
        sampler=Verbatim(chains.sampler),
        seed=found.estimate.seed,
    )
    document = certificate_of(found.job, sections, told, produced_by, (Verbatim(table), Verbatim(draws.name)))
    told = document.warnings
    short = axis_page.summary(found, told) if isinstance(found, ShiftResult) else plane_page.summary(found, told)
    files = {table: table_text(found.table), draws.name: draws.content}
    results["posterior"] = draws.entry
    return Outcome(found, document, results, short, told, files, draws=found.draws)


OWN = OwnAnalysis(report=Recipe(analyse, outcome))
