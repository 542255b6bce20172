"""Whether a short gauge was measured in as many orientations as a standard wants."""

from __future__ import annotations

import numpy as np

from cmm_uq.analysis.conformity.lengths_decided import short
from cmm_uq.analysis.conformity.plans import Condition, ShortLengthPlan
from cmm_uq.base.messages import Verbatim, say
from cmm_uq.machine.model.artefact import Artefact


def orientations(plan: ShortLengthPlan, artefact: Artefact, *, recorded: bool) -> tuple[Condition, ...]:
    """Orientations that differ, and how often the gauge was measured in each."""
    found = artefact.indications()
    what = say(
        "a length of at most {longest:g} mm in {count} orientations", longest=plan.longest_mm, count=plan.orientations
    )
    if found is None:
        return (Condition(what, (what,)),)
    points, first = artefact.points, found.rows[:, 0]
    copied = np.isin(points.group[first], list(points.copies) if recorded else [])
    rows = np.flatnonzero(short(plan.longest_mm)(artefact, found) & ~copied)
    _, along = artefact.lines_of(found.rows)
    kept: list[tuple[np.ndarray, set[int]]] = []
    for i in rows:
        direction = along[i] / np.linalg.norm(along[i])
        near = next(
            (runs for one, runs in kept if abs(float(one @ direction)) > np.cos(np.radians(plan.apart_deg))), None
        )
        if near is None:
            kept.append((direction, {int(points.group[first[i]])}))
        else:
            near.add(int(points.group[first[i]]))
    lacking = plan.orientations - len(kept)
    told = () if lacking <= 0 else (say("{lacking} of {count} orientations", lacking=lacking, count=plan.orientations),)
    few = sorted((len(runs) for _, runs in kept), reverse=True)[: plan.orientations]
    repeats = say("{repeats} repetitions in each orientation", repeats=plan.repeats)
    least = min(few, default=0)
    lacks = say("{what} ({least})", what=repeats, least=least)
    unknown = say("bidirectional lengths: from which side each end was reached is not recorded")
    sides = Condition(
        say("ends of each length reached from opposite sides"),
        (unknown,) if len(rows) and artefact.bidirectional(found.rows) is None else (),
        Verbatim("columns approach_x, approach_y, approach_z"),
    )
    return (Condition(what, told), Condition(repeats, () if least >= plan.repeats else (lacks,)), sides)
