"""Series of an artefact that is shifted along an axis, and what their readings cannot tell."""

from __future__ import annotations

from typing import cast

import numpy as np

from cmm_uq.analysis.planning.set_up import Pattern, SetUp
from cmm_uq.analysis.planning.setting import Planning, Setting, Start
from cmm_uq.artefacts.gauge_lines import faces_of
from cmm_uq.artefacts.kinds import ShiftFacts
from cmm_uq.artefacts.shift.axis import recorded_series
from cmm_uq.artefacts.shift.series import undetermined
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.messages import Text, say
from cmm_uq.base.points import AXES, Points


def shift_series(setting: Setting) -> tuple[SetUp, ...]:
    """The artefact's points along its axis, once for each shift."""
    facts, plan, volume = _facts(setting), setting.plan, setting.volume
    if facts.axis is None or not facts.shifts_mm:
        raise CmmUqError("axis and shifts_mm are needed", where="job.toml [artefact]",
                         fix='Give axis = "x" and shifts_mm = [0.0, 20.0], one shift a series')  # fmt: skip
    known = facts.known.length_mm if facts.known else plan.length_mm
    if known is None and not plan.lengths_mm:
        raise CmmUqError("the length of the artefact is needed", where="job.toml [plan] length_mm",
                         fix="Give it, with pitch_mm, or all distances as lengths_mm")  # fmt: skip
    faces = faces_of(facts, plan.model_copy(update={"length_mm": known}))
    places = np.concatenate([[0.0], faces])
    i = AXES.index(facts.axis)
    reach = float(places[-1] + np.ptp(facts.shifts_mm))
    if reach > volume.size[i]:
        raise volume.too_small(np.outer([0.0, reach], np.eye(3)[i]), say("with its farthest shift"))
    start = volume.box.mean(axis=1)
    start[i] = volume.box[i, 0] - min(facts.shifts_mm)
    n = len(places)
    body = np.outer(places, np.eye(3)[i])
    pattern = Pattern(body, np.arange(1, n + 1), np.ones(n, dtype=np.int64)).repeated(plan.repeats)
    return tuple(
        pattern.placed(
            setting.machine, np.eye(3), start + shift * np.eye(3)[i], say("shifted by {shift:g} mm", shift=shift)
        )
        for shift in facts.shifts_mm
    )


def candidates(setting: Setting, start: Start | None) -> tuple[SetUp, ...]:
    _facts(setting)
    raise CmmUqError("a shift job has its series, and no other placings to choose from",
                     where="job.toml [plan] criterion", fix="Leave it out; shifts_mm says what is measured")  # fmt: skip


def free(setting: Setting, points: Points, where: str) -> tuple[Text, ...]:
    """What no reading of these series shows."""
    facts = _facts(setting)
    series = recorded_series(facts, points, where)
    left = undetermined(series, scale_known=facts.known is not None)
    found = [
        say(
            "errors that repeat every {period:.4g} mm, or a half, a third … of it: every shift is a multiple of it",
            period=left.period,
        )
    ]
    if facts.known is None:
        found.append(say("the mean scale of the axis: no length of the artefact is known"))
    if left.patterns.shape[1]:
        found.append(
            say(
                "{shape} independent patterns of error at the places read, unless errors are smooth",
                shape=left.patterns.shape[1],
            )
        )
    return tuple(found)


def _facts(setting: Setting) -> ShiftFacts:
    facts = cast("ShiftFacts", setting.artefact)
    if facts.plane is not None:
        problem = "the placings of a plate shifted in a plane are not planned"
        fix = "cmm-uq report says what those of a recording leave open"
        raise CmmUqError(problem, where="job.toml [artefact] plane", fix=fix)
    return facts


PLANNING = Planning({"shift series": shift_series}, candidates, free=free)
