"""Modules that libraries import and nothing here comes to: loaded when something of them is called."""

from __future__ import annotations

import sys
from collections.abc import Callable
from functools import partial
from importlib import import_module
from types import ModuleType

UNUSED: tuple[str, ...] = ("emcee.backends.hdf", "emcee.moves.kde", "mpl_toolkits.mplot3d", "numpy.f2py.f2py2e")
UNUSED += ("scipy.linalg._decomp_interpolative", "scipy.optimize._linprog", "scipy.optimize._shgo")
UNUSED += ("matplotlib.dviread", "matplotlib.projections.geo", "matplotlib.projections.polar", "matplotlib.tri")
"""With what they import themselves, a tenth of a report's time."""


def lighten() -> None:
    """Load what is not used only when something of it is called, in the command's own process alone."""
    for name in UNUSED:
        stand_in = ModuleType(name)
        stand_in.__dict__["__getattr__"] = partial(_called_later, stand_in)
        sys.modules.setdefault(name, stand_in)


def _called_later(stand_in: ModuleType, name: str) -> Callable[..., object]:
    if name.startswith("__"):  # what a module says of itself
        raise AttributeError(name)

    def called(*arguments: object, **named: object) -> object:
        if sys.modules.get(stand_in.__name__) is stand_in:
            del sys.modules[stand_in.__name__]
        return getattr(import_module(stand_in.__name__), name)(*arguments, **named)

    called.__dict__["name"] = name  # by which Matplotlib registers a projection
    return called
