"""Positions of a bar swept about a fixed ball."""

from __future__ import annotations

from dataclasses import replace
from typing import cast

import numpy as np

from cmm_uq.analysis.planning.set_up import SetUp, planned_length
from cmm_uq.analysis.planning.setting import Planning, Setting, Start
from cmm_uq.analysis.planning.volume import Volume
from cmm_uq.artefacts.bryan.observe import Bryan
from cmm_uq.artefacts.bryan.swept import swept
from cmm_uq.base.points import Floats
from cmm_uq.machine.model.artefact import Artefact


def swept_bar(setting: Setting) -> tuple[SetUp, ...]:
    """As many swept positions as the plan's grid has points, all around the fixed ball."""
    count = setting.plan.number or setting.plan.grid[0] * setting.plan.grid[1]
    return swept(setting.volume, planned_length(setting.artefact, setting.plan), count, setting.plan.repeats)


def candidates(setting: Setting, start: Start | None) -> tuple[SetUp, ...]:
    """About the fixed ball of the start, or about the middle of the volume."""
    plan, centre = setting.plan, None if start is None else _centre(start.artefact)
    return swept(setting.volume, planned_length(setting.artefact, plan), plan.candidates, plan.repeats, centre)


def elsewhere(artefact: Artefact, volume: Volume, count: int) -> tuple[SetUp, ...]:
    """About the recorded fixed ball; what else was recorded is at its mean there."""
    places = swept(volume, artefact.sizes[0].nominal, count, 1, _centre(artefact))
    means = {name: np.full(1, float(values.mean())) for name, values in artefact.points.columns.items()}
    return tuple(replace(place, points=replace(place.points, columns=means)) for place in places)


def _centre(artefact: Artefact) -> Floats:
    """Of the fixed ball (3,), in scale readings, mm."""
    bar = cast("Bryan", artefact)
    return np.asarray(bar.centres(bar.points.machine_xyz, bar.sizes[0].nominal)[0], dtype=np.float64)


PLANNING = Planning({"swept bar": swept_bar}, candidates, elsewhere, shared=True)
