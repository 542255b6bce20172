"""The kinds of measurement, a folder each: all that is particular to a ballbar, a plate, an axis read in shifted places.

This is the registry: the built-in kinds by name, and those of other packages, which name them as entry points of the group
``cmm_uq.kinds``. A kind is imported when it is first asked for.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from importlib import import_module
from importlib.metadata import EntryPoint, entry_points
from types import MappingProxyType
from typing import Any

from cmm_uq.errors import CmmUqError
from cmm_uq.jobs.job import ArtefactFacts, Job
from cmm_uq.model.artefact import Artefact
from cmm_uq.model.kind import Kind
from cmm_uq.points import Points

GROUP = "cmm_uq.kinds"
"""Entry points by which other packages offer kinds."""

BUILT_IN: Mapping[str, str] = MappingProxyType({
    "ballbar": "ballbar", "bryan": "bryan", "step_gauge": "step_gauge", "gauge_blocks": "gauge_blocks", "plate": "plate",
    "triangle": "triangle", "sphere": "sphere", "plane": "plane", "shift": "shifting", "error_map": "error_maps",
    "digitizer": "digitizer",
})  # fmt: skip
"""Folder of each built-in kind."""


def names() -> tuple[str, ...]:
    """Of all kinds, those of other packages last."""
    return (*BUILT_IN, *sorted(entry.name for entry in _offered() if entry.name not in BUILT_IN))


@cache
def kind_named(name: str) -> Kind | None:
    """A kind by its name; ``None`` where there is none. A built-in kind cannot be replaced.

    Raises
    ------
    CmmUqError : another package offers it, but cannot be loaded, or two packages do.
    """
    if name in BUILT_IN:
        found: Kind = import_module(f"cmm_uq.kinds.{BUILT_IN[name]}.kind").KIND
        return found
    offers = [entry for entry in _offered() if entry.name == name]
    if len(offers) > 1:
        given = " and ".join(_package(entry) for entry in offers)
        raise CmmUqError(f"the kind {name!r} comes from {given}", fix="Uninstall one of them")
    return _loaded(offers[0]) if offers else None


def kind_of(job: Job) -> Kind:
    """The kind of a job.

    Raises
    ------
    CmmUqError : there is none of this name.
    """
    return _known(job.facts.artefact.kind)


def table_of(name: str) -> type[ArtefactFacts] | None:
    """Keys that ``[artefact]`` of a kind may have; ``None`` where there is no such kind."""
    kind = kind_named(name)
    return None if kind is None else kind.table


def artefact_facts(**keys: Any) -> ArtefactFacts:
    """``[artefact]`` as a job says it, checked by the table of its kind."""
    return _known(keys["kind"]).table.model_validate(keys)


def artefact_of(facts: ArtefactFacts, points: Points, *, where: str | None = None) -> Artefact:
    """The artefact that a job describes, with its recording.

    Raises
    ------
    CmmUqError : this kind is not known, has no artefact, or the recording does not fit it.
    """
    return _known(facts.kind).observing("observed as an artefact")(facts, points, where=where)


def _known(name: str) -> Kind:
    found = kind_named(name)
    if found is None:
        raise CmmUqError(f"no kind {name!r}", where="job.toml [artefact] kind", fix=f"Known: {', '.join(names())}")
    return found


def _offered() -> list[EntryPoint]:
    return list(entry_points(group=GROUP))


def _package(entry: EntryPoint) -> str:
    return f"{entry.dist.name} {entry.dist.version}" if entry.dist else entry.module


def _loaded(entry: EntryPoint) -> Kind:
    """A kind of another package, whose mistakes are said to be its own."""
    try:
        found = entry.load()
    except Exception as error:
        raise CmmUqError(f"the kind {entry.name!r} cannot be loaded: {type(error).__name__}: {error}",
                         where=f"package {_package(entry)}", fix="Mend the package, or uninstall it") from error  # fmt: skip
    if not isinstance(found, Kind) or found.name != entry.name:
        raise CmmUqError(f"{entry.value!r} is no Kind of the name {entry.name!r}", where=f"package {_package(entry)}",
                         fix="Mend the package, or uninstall it")  # fmt: skip
    return found
