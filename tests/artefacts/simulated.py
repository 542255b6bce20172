"""The simulated example jobs, analysed once, with the errors that were put into them.

Their documents are made once for all processes of a run of the tests, in its temporary folder.
"""

from __future__ import annotations

import json
import pickle
from collections.abc import Callable
from functools import cache
from typing import Any

from cmm_uq.app.api.outcomes import Report
from cmm_uq.app.commands.diagnose import diagnose_read, outcome_of as diagnosis_page
from cmm_uq.app.commands.plan import plan_outcome
from cmm_uq.app.commands.reading import read_job
from cmm_uq.app.commands.report import analyse, outcome_of
from cmm_uq.certificate.document import Block, Document, Table
from cmm_uq.certificate.origin import as_json
from cmm_uq.certificate.result import AnalysisResult, Outcome, Result
from cmm_uq.jobs.job import Job
from tests.conftest import ROOT
from tests.shared import shared

SCALE = {"scale_x": 9.0, "scale_y": -6.0, "scale_z": 14.0}
SQUARE = {"squareness_xy": 12.0, "squareness_yz": -7.5, "squareness_zx": 4.0}


def kept(make: Callable[[str], Document]) -> Callable[[str], Document]:
    """Documents by their job, each made once for all processes."""

    @cache
    def found(job: str) -> Document:
        made: Document = pickle.loads(shared(f"{make.__name__}-{job}.pickle", lambda: pickle.dumps(make(job))))
        return made

    return found


@cache
def job_read(job: str) -> Job:
    return read_job(ROOT / "examples" / job)


@cache
def analysed(job: str) -> Result:
    return analyse(ROOT / "examples" / job)


@cache
def outcome(job: str) -> Outcome:
    return outcome_of(analysed(job))


@cache
def reported(job: str) -> Report:
    return Report(outcome(job))


@kept
def document(job: str) -> Document:
    results(job)
    return outcome(job).document


@cache
def results(job: str) -> dict[str, Any]:
    """Data of results.json; whoever makes it makes the document too, lest another process analyse the same again."""

    def make() -> bytes:
        shared(f"document-{job}.pickle", lambda: pickle.dumps(outcome(job).document))
        return as_json(outcome(job).results)

    found: dict[str, Any] = json.loads(shared(f"results-{job}.json", make))
    return found


@cache
def diagnosis_of(job: str) -> AnalysisResult:
    return diagnose_read(job_read(job))


@kept
def diagnosed(job: str) -> Document:
    return diagnosis_page(diagnosis_of(job)).document


@kept
def planned(job: str) -> Document:
    return plan_outcome(read_job(ROOT / "examples" / job, recorded=False), power=False).document


def blocks(job: str) -> list[Block]:
    return [block for section in document(job).sections for block in section.blocks]


def table(job: str, caption: str) -> Table:
    return next(block for block in blocks(job) if isinstance(block, Table) and block.caption == caption)


def recovered(job: str, truth: dict[str, float]) -> None:
    """Every error is found again, within four standard uncertainties."""
    result = analysed(job)
    for effect, value in truth.items():
        quantity = next(iter(result.parameters[effect].values()))
        assert abs(quantity.value - value) < 4 * quantity.u, effect
