"""Placings of a step gauge and of gauge blocks: the seven lines of the standard, and anywhere in the volume."""

from __future__ import annotations

from collections.abc import Callable

from cmm_uq.analysis.planning.candidates import PatternFor, RelocatedCandidates, VolumeCandidates, along_lines
from cmm_uq.analysis.planning.set_up import Pattern, SetUp
from cmm_uq.analysis.planning.setting import Planning, Setting
from cmm_uq.artefacts.gauge_lines.observe import block, blocks_of, faces_of, five_of, gauge, seven_lines
from cmm_uq.base.points import Floats
from cmm_uq.jobs.tables.artefact import ArtefactFacts
from cmm_uq.jobs.tables.plan import PlanFacts

Lengths = Callable[[ArtefactFacts, PlanFacts], Floats]


def steps(setting: Setting) -> tuple[SetUp, ...]:
    """Seven lines through the middle of the volume (ISO 10360-2:2009, 6.3), bidirectional unless the job says otherwise."""
    both = setting.plan.model_copy(update={"both_ways": setting.plan.both_ways is not False})
    return seven_lines(setting, faces_of(setting.artefact, setting.plan), lambda fitting: [gauge(fitting, both)])


def blocks(setting: Setting) -> tuple[SetUp, ...]:
    """The same, each length by a block of its own."""
    lengths = blocks_of(setting.artefact, setting.plan)
    return seven_lines(setting, lengths, lambda fitting: [block(float(length), setting.plan) for length in fitting])


def _planning(
    lines: Callable[[Setting], tuple[SetUp, ...]], lengths_of: Lengths, pattern: Callable[[Floats, PlanFacts], Pattern]
) -> Planning:
    def shape(setting: Setting) -> PatternFor:
        lengths = lengths_of(setting.artefact, setting.plan)

        def fitting_pattern(attitude: Floats) -> Pattern | None:
            fitting = five_of(lengths, setting.volume.chord(attitude[:, 0]))
            return pattern(fitting, setting.plan) if len(fitting) else None

        return fitting_pattern

    places = VolumeCandidates(along_lines, shape, RelocatedCandidates(along_lines))
    return Planning({"ISO 10360-2": lines}, places.candidates, places.elsewhere)


STEP_GAUGE = _planning(steps, faces_of, gauge)
GAUGE_BLOCKS = _planning(blocks, blocks_of, lambda fitting, plan: block(float(fitting[-1]), plan))
