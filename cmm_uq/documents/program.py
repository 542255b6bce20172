"""What produced a document or a file of results: the program, and the packages whose effects or kind took part."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

from cmm_uq import __version__
from cmm_uq.messages import Text, Verbatim, say, together
from cmm_uq.physics.catalogue import plugins

NAME = "cmm-uq"


def software(kind: Mapping[str, str], *, effects: bool = True) -> dict[str, Any]:
    """For results.json: name and version of the program, and of every package that took part, if any did.

    Parameters
    ----------
    kind : version of the package that brings the job's kind, by its name.
    effects : whether effects were candidates, and with them those of other packages.
    """
    taking_part = _together(None, kind) if effects else dict(kind)
    return {"name": NAME, "version": __version__, **({"plugins": taking_part} if taking_part else {})}


def program(kind: Mapping[str, str], effects: Iterable[str] | None = None) -> Text:
    """The same in words: ``cmm-uq 1.0`` or ``cmm-uq 1.0 with outside-effects 0.1``; of the effects named only, if any are."""
    parts = [_versioned(package, version) for package, version in _together(effects, kind).items()]
    own = _versioned(NAME, __version__)
    return say("{program} with {plugins}", program=own, plugins=together(parts)) if parts else own


def _together(effects: Iterable[str] | None, kind: Mapping[str, str]) -> dict[str, str]:
    return {**plugins(effects), **kind}


def _versioned(package: str, version: str) -> Text:
    return say("{package} {version}", package=Verbatim(package), version=Verbatim(version))
