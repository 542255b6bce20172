"""What produced a document or a file of results: the program, and the packages whose effects took part."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from cmm_uq import __version__
from cmm_uq.messages import Text, Verbatim, say, together
from cmm_uq.physics.catalogue import plugins

NAME = say("cmm-uq")


def software(*, effects: bool = True) -> dict[str, Any]:
    """For results.json: name and version, and those of the packages whose effects were candidates, if there are any."""
    taking_part = plugins() if effects else {}
    return {"name": NAME, "version": __version__, **({"plugins": taking_part} if taking_part else {})}


def program(effects: Iterable[str] | None = None) -> Text:
    """The same in words: ``cmm-uq 1.0`` or ``cmm-uq 1.0 with outside-effects 0.1``; of the effects named only, if any are."""
    parts = [say("{package} {version}", package=Verbatim(p), version=Verbatim(v)) for p, v in plugins(effects).items()]
    own = say("{package} {version}", package=Verbatim(NAME), version=Verbatim(__version__))
    return say("{program} with {plugins}", program=own, plugins=together(parts)) if parts else own
