"""Libraries without what a command never uses of them: modules that are opened only to be named, and manuals.

numpy's compiler of Fortran and its test tools are opened by scipy, which asks numpy for everything that it has, and a table
of letters by matplotlib, for TeX; scipy and matplotlib write manuals of their functions and classes anew at every start, for
readers at a prompt. Together this is a tenth of a report. Here such modules are loaded when something of them is first
used, and manuals stay as their authors left them. What is computed or drawn is the same; only the command's own process
does so, never whoever imports the package.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from importlib.abc import Loader, MetaPathFinder
from importlib.machinery import ModuleSpec, PathFinder
from importlib.util import LazyLoader
from types import ModuleType
from typing import Any

LATER = ("fontTools.agl", "h5py", "numpy.core", "numpy.ctypeslib", "numpy.f2py", "numpy.testing")
"""Modules that are loaded when something of them is first used."""


def lighten() -> None:
    """Have the libraries that are not loaded yet come without what is not used of them."""
    kde = ModuleType("emcee.moves.kde")  # the move needs all of scipy.stats, a fifth of a report
    kde.__dict__["KDEMove"] = None
    sys.modules.setdefault(kde.__name__, kde)
    sys.meta_path.insert(0, _Lighter())


class _Lighter(MetaPathFinder):
    """Finds what Python would find, and has it loaded later or changed once it is loaded."""

    def find_spec(
        self, fullname: str, path: Sequence[str] | None, target: ModuleType | None = None
    ) -> ModuleSpec | None:  # fmt: skip
        if fullname not in LATER and fullname not in CHANGED:
            return None
        spec = PathFinder.find_spec(fullname, path, target)
        if spec is not None and spec.loader is not None:
            change = CHANGED.get(fullname)
            spec.loader = LazyLoader(spec.loader) if change is None else _Changing(spec.loader, change)
        return spec


class _Changing(Loader):
    """Loads a module and then changes it."""

    def __init__(self, loader: Loader, change: Callable[[ModuleType], None]) -> None:
        self.loader, self.change = loader, change

    def create_module(self, spec: ModuleSpec) -> ModuleType | None:
        return self.loader.create_module(spec)

    def exec_module(self, module: ModuleType) -> None:
        self.loader.exec_module(module)
        self.change(module)


class _Manual(dict[str, list[Any]]):
    """Sections to which notes are added in vain, and the manual as it was."""

    def __init__(self, function: object, *_: object, **__: object) -> None:
        self.text = getattr(function, "__doc__", None) or ""

    def __missing__(self, section: str) -> list[Any]:
        return self.setdefault(section, [])

    def __str__(self) -> str:
        return f"\n{self.text}"  # whoever asks takes the first line, the signature, away


def _manuals_as_they_are(docscrape: ModuleType) -> None:
    docscrape.__dict__["FunctionDoc"] = _Manual


def _no_lists_of_properties(artist: ModuleType) -> None:
    artist.__dict__["kwdoc"] = lambda _: ""
    artist.Artist._update_set_signature_and_docstring = classmethod(lambda _: None)


CHANGED = {"scipy._lib._docscrape": _manuals_as_they_are, "matplotlib.artist": _no_lists_of_properties}
"""Modules that are changed once they are loaded, and how."""
