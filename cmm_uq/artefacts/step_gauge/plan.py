"""Placings of a step gauge: the seven lines of the standard, and anywhere in the volume."""

from __future__ import annotations

from cmm_uq.analysis.planning.candidates import PatternFor, RelocatedCandidates, VolumeCandidates, along_lines
from cmm_uq.analysis.planning.set_up import Pattern, SetUp
from cmm_uq.analysis.planning.setting import Planning, Setting
from cmm_uq.artefacts.gauge_lines.observe import faces_of, five_of, gauge, seven_lines
from cmm_uq.base.points import Floats


def iso_lines(setting: Setting) -> tuple[SetUp, ...]:
    """Seven lines through the middle of the volume (ISO 10360-2:2009, 6.3), bidirectional unless the job says otherwise."""
    both = setting.plan.model_copy(update={"both_ways": setting.plan.both_ways is not False})

    def shapes(fitting: Floats) -> list[Pattern]:
        return [gauge(fitting, both)]

    return seven_lines(setting, faces_of(setting.artefact, setting.plan), shapes)


def _shape(setting: Setting) -> PatternFor:
    lengths = faces_of(setting.artefact, setting.plan)

    def fitting_pattern(attitude: Floats) -> Pattern | None:
        fitting = five_of(lengths, setting.volume.chord(attitude[:, 0]))
        return gauge(fitting, setting.plan) if len(fitting) else None

    return fitting_pattern


_PLACES = VolumeCandidates(along_lines, _shape, RelocatedCandidates(along_lines))
PLANNING = Planning({"ISO 10360-2": iso_lines}, _PLACES.candidates, _PLACES.elsewhere)
