"""The simulated example jobs, analysed once, with the errors that were put into them."""

from __future__ import annotations

from functools import cache

from cmm_uq.commands.analysis import Result, analyse, outcome_of
from cmm_uq.commands.plan import plan_outcome
from cmm_uq.commands.reading import read_job
from cmm_uq.commands.report import diagnosis_outcome
from cmm_uq.documents.document import Block, Document, Table
from cmm_uq.documents.outcome import Outcome
from tests.conftest import ROOT

SCALE = {"scale_x": 9.0, "scale_y": -6.0, "scale_z": 14.0}
SQUARE = {"squareness_xy": 12.0, "squareness_yz": -7.5, "squareness_zx": 4.0}


@cache
def analysed(job: str) -> Result:
    return analyse(ROOT / "examples" / job)


@cache
def outcome(job: str) -> Outcome:
    return outcome_of(analysed(job))


def document(job: str) -> Document:
    return outcome(job).document


@cache
def diagnosed(job: str) -> Document:
    return diagnosis_outcome(read_job(ROOT / "examples" / job)).document


@cache
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
