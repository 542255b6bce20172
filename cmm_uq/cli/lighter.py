"""Libraries without what a command never uses of them: modules that are opened only to be named.

numpy's compiler of Fortran and its test tools are opened by scipy, which asks numpy for everything that it has, and a table
of letters by matplotlib, for TeX. Here such modules are loaded when something of them is first used. Lists that matplotlib
writes into docstrings, and axes in space, which no picture here has, are left out. What is computed or drawn is the same; only
the command's own process does so, never whoever imports the package.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from importlib.abc import MetaPathFinder
from importlib.machinery import ModuleSpec, PathFinder, SourceFileLoader
from importlib.util import LazyLoader
from types import ModuleType

LATER = ("fontTools.agl", "h5py", "numpy.core", "numpy.ctypeslib", "numpy.f2py", "numpy.testing")
"""Modules that are loaded when something of them is first used."""


def lighten() -> None:
    """Have the libraries that are not loaded yet come without what is not used of them."""
    for name, part in _WITHOUT.items():
        empty = ModuleType(name)
        empty.__dict__[part] = None
        sys.modules.setdefault(name, empty)
    sys.meta_path.insert(0, _Lighter())


_WITHOUT = {"emcee.moves.kde": "KDEMove", "mpl_toolkits.mplot3d": "Axes3D"}
"""Modules that nothing is used of, and what is taken from them. The move needs all of scipy.stats, a fifth of a report."""


class _Unexplained(SourceFileLoader):
    """Loads matplotlib's artists without the lists of what can be set, which it writes into the docstring of each."""

    def exec_module(self, module: ModuleType) -> None:
        """See :meth:`importlib.abc.Loader.exec_module`."""
        super().exec_module(module)
        module.__dict__["kwdoc"] = lambda _: ""


class _Lighter(MetaPathFinder):
    """Finds what Python would find, and has it loaded later, or with less."""

    def find_spec(
        self, fullname: str, path: Sequence[str] | None, target: ModuleType | None = None
    ) -> ModuleSpec | None:  # fmt: skip
        if fullname not in LATER and fullname != "matplotlib.artist":
            return None
        spec = PathFinder.find_spec(fullname, path, target)
        if spec is not None and isinstance(spec.loader, SourceFileLoader):
            own = fullname not in LATER
            spec.loader = _Unexplained(fullname, spec.loader.path) if own else LazyLoader(spec.loader)
        return spec
