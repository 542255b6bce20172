"""Artefacts turn points into observations: lengths of a bar, faces of a gauge, balls of a plate."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from types import MappingProxyType

from cmm_uq.artefacts.ballbar import Ballbar
from cmm_uq.artefacts.bryan import Bryan
from cmm_uq.artefacts.gauge import GaugeBlocks, StepGauge
from cmm_uq.artefacts.plane import PlaneSurface
from cmm_uq.artefacts.plate import Plate
from cmm_uq.artefacts.sphere import Sphere
from cmm_uq.artefacts.triangle import Triangle
from cmm_uq.errors import CmmUqError
from cmm_uq.jobs.job import ArtefactFacts
from cmm_uq.model.artefact import Artefact
from cmm_uq.points import Points

KINDS: Mapping[str, Callable[..., Artefact]] = MappingProxyType(
    {kind.kind: kind for kind in (Ballbar, Bryan, StepGauge, GaugeBlocks, Plate, Triangle, Sphere, PlaneSurface)}
)
"""Every kind of artefact by its name in ``[artefact] kind``."""


def artefact_of(facts: ArtefactFacts, points: Points, *, where: str | None = None) -> Artefact:
    """The artefact that a job describes, with its recording.

    Raises
    ------
    CmmUqError : this kind of artefact is not known here, or the recording does not fit it.
    """
    if facts.kind not in KINDS:
        raise CmmUqError(f"no artefact of kind {facts.kind!r}", where="job.toml [artefact] kind",
                         fix=f"Known: {', '.join(KINDS)}")  # fmt: skip
    return KINDS[facts.kind](facts, points, where=where)
