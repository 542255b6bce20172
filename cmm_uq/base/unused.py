"""What a command's own process does without: modules that nothing here comes to, and pages given back and asked for again."""

from __future__ import annotations

import ctypes
import sys
from collections.abc import Callable
from functools import partial
from importlib import import_module
from types import ModuleType

UNUSED: tuple[str, ...] = ("emcee.backends.hdf", "emcee.moves.kde", "mpl_toolkits.mplot3d", "numpy.f2py.f2py2e")
UNUSED += ("scipy.linalg._decomp_interpolative", "scipy.optimize._linprog", "scipy.optimize._shgo")
UNUSED += ("matplotlib.dviread", "matplotlib.projections.geo", "matplotlib.projections.polar", "matplotlib.tri")
"""With what they import themselves, a tenth of a report's time."""
KEPT = {-3: 2**25, -1: 2**26}
"""M_MMAP_THRESHOLD and M_TRIM_THRESHOLD, bytes: those that glibc comes to by itself as larger and larger arrays are freed."""


def lighten() -> None:
    """Load what is not used only when something of it is called, and keep memory that is freed at hand for what comes next."""
    for name in UNUSED:
        stand_in = ModuleType(name)
        stand_in.__dict__["__getattr__"] = partial(_called_later, stand_in)
        sys.modules.setdefault(name, stand_in)
    if sys.platform == "linux" and hasattr(library := ctypes.CDLL(None), "mallopt"):
        for option, size in KEPT.items():
            library.mallopt(option, size)


def _called_later(stand_in: ModuleType, name: str) -> Callable[..., object]:
    if name.startswith("__"):  # what a module says of itself
        raise AttributeError(name)

    def called(*arguments: object, **named: object) -> object:
        if sys.modules.get(stand_in.__name__) is stand_in:
            del sys.modules[stand_in.__name__]
        return getattr(import_module(stand_in.__name__), name)(*arguments, **named)

    called.__dict__["name"] = name  # by which Matplotlib registers a projection
    return called
