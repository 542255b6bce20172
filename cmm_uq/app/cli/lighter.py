"""The sampler without a move that nothing here makes: its module loads all of ``scipy.stats``, a fourth of a report's time."""

from __future__ import annotations

import sys
from types import ModuleType

UNUSED = "emcee.moves.kde"


def lighten() -> None:
    """Put an empty module in its place, in the command's own process alone, unless it is loaded already."""
    empty = ModuleType(UNUSED)
    empty.__dict__["KDEMove"] = None
    sys.modules.setdefault(UNUSED, empty)
