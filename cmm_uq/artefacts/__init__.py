"""The kinds of measurement: all that is particular to a ballbar, a plate, an axis read in shifted places.

This is the registry: the built-in kinds by name, and those of other packages, which name them as entry points of the group
``cmm_uq.kinds``. What a kind observes, plans and states is imported when it is first asked for.
"""

from __future__ import annotations

from functools import cache
from typing import Any

from cmm_uq.artefacts.kinds import BUILT_IN
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.plugins import KINDS, Plugin, named, offered
from cmm_uq.base.points import Points
from cmm_uq.jobs.job import Job
from cmm_uq.jobs.tables.artefact import ArtefactFacts
from cmm_uq.machine.model.artefact import Artefact
from cmm_uq.machine.model.kind import Kind


def names() -> tuple[str, ...]:
    return (*BUILT_IN, *(plugin.name for plugin in offered(KINDS, Plugin) if plugin.name not in BUILT_IN))


@cache
def kind_named(name: str) -> Kind | None:
    """A kind by its name; ``None`` where there is none. A built-in kind cannot be replaced."""
    if name in BUILT_IN:
        return BUILT_IN[name]
    outside = named(offered(KINDS, Plugin), name)
    return None if outside is None else outside.loaded(Kind)


def kind_of(job: Job) -> Kind:
    return _known(job.facts.artefact.kind)


def table_of(name: str) -> type[ArtefactFacts] | None:
    """Keys that ``[artefact]`` of a kind may have; ``None`` where there is no such kind."""
    kind = kind_named(name)
    return None if kind is None else kind.table


def artefact_facts(**keys: Any) -> ArtefactFacts:
    """``[artefact]`` as a job says it, checked by the table of its kind."""
    return _known(keys["kind"]).table.model_validate(keys)


def artefact_of(facts: ArtefactFacts, points: Points, *, where: str | None = None) -> Artefact:
    """The artefact that a job describes, with its recording."""
    return _known(facts.kind).observing("observed as an artefact")(facts, points, where=where)


def _known(name: str) -> Kind:
    kind = kind_named(name)
    if kind is None:
        raise CmmUqError(f"no kind {name!r}", where="job.toml [artefact] kind", fix=f"Known: {', '.join(names())}")
    return kind
