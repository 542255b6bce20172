"""What produced a document or a file of results: the program, and the packages whose effects took part."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from cmm_uq import __version__
from cmm_uq.physics.catalogue import plugins

NAME = "cmm-uq"


def software(*, effects: bool = True) -> dict[str, Any]:
    """For results.json: name and version, and those of the packages whose effects were candidates, if there are any."""
    taking_part = plugins() if effects else {}
    return {"name": NAME, "version": __version__, **({"plugins": taking_part} if taking_part else {})}


def program(effects: Iterable[str] | None = None) -> str:
    """The same in words: ``cmm-uq 1.0`` or ``cmm-uq 1.0 with outside-effects 0.1``; of the effects named only, if any are."""
    taking_part = " and ".join(f"{package} {version}" for package, version in plugins(effects).items())
    return f"{NAME} {__version__}{f' with {taking_part}' if taking_part else ''}"
