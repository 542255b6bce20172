"""Which way a job goes: its kind's own, or that of every recording of an artefact."""

from __future__ import annotations

from collections.abc import Callable

from cmm_uq.app.commands.refusals import refuse_unmeasured
from cmm_uq.artefacts import kind_of
from cmm_uq.certificate.outcome import OwnAnalysis, Recipe
from cmm_uq.jobs.job import Job
from cmm_uq.machine.model.kind import Kind


def recipe_of(
    job: Job, own: Callable[[OwnAnalysis], Recipe | None], usual: Callable[[Kind], Recipe], what: str
) -> Recipe:  # fmt: skip
    """How a job is analysed: in its kind's own way, or as observations that named effects explain.

    Parameters
    ----------
    own : what is asked of a kind's own analysis.
    usual : of a kind that observes an artefact.
    what : cannot be done of a kind that does neither, as ``reported``.

    Raises
    ------
    CmmUqError : the kind offers neither, or nothing is measured yet.
    """
    refuse_unmeasured(job)
    kind = kind_of(job)
    offered = kind.offers("own", OwnAnalysis)
    recipe = None if offered is None else own(offered)
    if recipe is not None:
        return recipe
    kind.observing(what)
    return usual(kind)
