"""What produced a document or a file of results: the program, and the packages that took part."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from cmm_uq import __version__
from cmm_uq.base.messages import Text, Verbatim, say, together
from cmm_uq.base.plugins import KINDS, STANDARDS, versions
from cmm_uq.jobs.job import Job
from cmm_uq.machine.physics.catalogue import plugins

NAME = "cmm-uq"


def software(job: Job, *, effects: bool = True) -> dict[str, Any]:
    """For results.json: name and version, and those of other packages that took part, if there are any.

    These are the packages whose effects were candidates, where ``effects`` says that there were candidates, and those of the
    job's kind and standards.
    """
    taking_part = (plugins() if effects else {}) | _of_the_job(job)
    return {"name": NAME, "version": __version__, **({"plugins": taking_part} if taking_part else {})}


def program(job: Job, effects: Iterable[str] | None = None) -> Text:
    """The same in words: ``cmm-uq 1.0`` or ``cmm-uq 1.0 with outside-effects 0.1``; of the effects named only, if any are."""
    parts = [_versioned(package, version) for package, version in (plugins(effects) | _of_the_job(job)).items()]
    own = _versioned(NAME, __version__)
    return say("{program} with {plugins}", program=own, plugins=together(parts)) if parts else own


def _of_the_job(job: Job) -> dict[str, str]:
    return versions({KINDS: [job.facts.artefact.kind], STANDARDS: [wish.standard for wish in job.facts.conformity]})


def _versioned(package: str, version: str) -> Text:
    return say("{package} {version}", package=Verbatim(package), version=Verbatim(version))
