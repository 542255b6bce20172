"""What the standards that a job names ask of its placings, and those of a ready plan that would complete a recording."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from cmm_uq.analysis.conformity.plan_conditions import conditions
from cmm_uq.analysis.conformity.plans import READY, Condition
from cmm_uq.analysis.conformity.standards import standard_named
from cmm_uq.analysis.planning.placing import Placing
from cmm_uq.analysis.planning.ready import ready_plan
from cmm_uq.analysis.planning.setting import Setting
from cmm_uq.artefacts import kind_of
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.points import Points
from cmm_uq.jobs.job import Job

_NANOMETRE = 1e-6


def of_standards(job: Job, setting: Setting, name: str, points: Points, recorded: int) -> tuple[Condition, ...]:
    """Conditions of the standard that a ready plan is named after, and of all that the job wishes to be decided.

    Parameters
    ----------
    name : of the plan.
    points : of everything that will have been measured.
    recorded : how many of them were, the first ones; of these copies do not count.
    """
    if setting.observe is None:
        return ()
    points = _no_copies(points, recorded)
    # where the lengths lie counts, not yet what certifies them
    facts = setting.artefact.model_copy(update={"nominal": False})
    artefact = setting.observe(facts, points, where=None)
    found = list(conditions(READY[name], artefact, recorded=recorded > 0)) if name in READY else []
    tested = kind_of(job).tested
    for wish in job.facts.conformity:
        standard = standard_named(wish.standard)
        if standard is None:
            continue
        asked = standard.characteristic(wish.characteristic)
        if asked.observed in tested:
            found += asked.conditions(artefact, recorded=recorded > 0)
    return tuple({condition.what: condition for condition in found}.values())


def completing(
    job: Job, setting: Setting, recorded: Points, after: Callable[[Sequence[Placing]], Points]
) -> tuple[Placing, ...]:  # fmt: skip
    """Placings of the usual ready plan of which each supplies something that the standards' tests still lack.

    Parameters
    ----------
    recorded : what was measured.
    after : the recording with further placings.
    """
    if not job.facts.conformity:
        return ()

    def lacking(points: Points) -> int:
        return sum(len(c.missing) for c in of_standards(job, setting, "", points, len(recorded)))

    least = lacking(recorded)
    if not least:
        return ()
    try:
        _, possible = ready_plan(setting)
    except CmmUqError:
        return ()
    added: list[Placing] = []
    for placing in possible:
        left = lacking(after([*added, placing]))
        if left < least:
            added, least = [*added, placing], left
    return tuple(added)


def _no_copies(points: Points, recorded: int) -> Points:
    """With planned repeats a nanometre apart, as no two readings of a place will be the same."""
    xyz = points.xyz.copy()
    xyz[recorded:] += _NANOMETRE * points.repeat[recorded:, None]
    return points.at(xyz)
