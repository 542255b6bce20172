"""What other packages offer by entry points: effects, kinds of measurement, standards, formats of files.

Which there are is read from the packages' metadata; a package is imported when something of it is first needed. What its code
does wrong is said with its name: the user cannot mend the package, but can tell its author, or uninstall it.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from functools import lru_cache
from importlib.metadata import EntryPoint, entry_points
from traceback import walk_tb
from types import MappingProxyType
from typing import Any, TypeVar

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.values import dataclass

EFFECTS, KINDS, STANDARDS, IMPORTS = "cmm_uq.effects", "cmm_uq.kinds", "cmm_uq.standards", "cmm_uq.imports"
# what is offered in each group of entry points
WHAT: Mapping[str, str] = MappingProxyType({EFFECTS: "effect", KINDS: "kind", STANDARDS: "standard", IMPORTS: "format"})

Offered = TypeVar("Offered")
_FIX = "Mend the package, or uninstall it"


class BrokenPluginError(CmmUqError):
    """Something of another package that does not do what it must."""


@dataclass(frozen=True)
class Plugin:
    """Something that a version of another package offers, by an entry point of its name."""

    package: str
    version: str
    entry: EntryPoint

    @property
    def name(self) -> str:
        return self.entry.name

    @property
    def what(self) -> str:
        """It is, and its name."""
        return f"the {WHAT[self.entry.group]} {self.name!r}"

    def loaded(self, of: type[Offered]) -> Offered:
        """What it offers; the package is imported now."""

        def made() -> object:
            loaded = self.entry.load()
            return loaded() if isinstance(loaded, type) else loaded

        offer = self.attempt(made)
        if not isinstance(offer, of):
            raise self.broken(f"is no {of.__name__} but {type(offer).__name__}")
        if (name := getattr(offer, "name", None)) != self.name:
            raise self.broken(f"calls itself {name!r}")
        return offer

    def attempt(self, what: Callable[[], Any]) -> Any:
        """What the package's code returns; errors of its own are said to be its own."""
        try:
            return what()
        except CmmUqError:
            raise
        except Exception as error:
            raise self.broken(f"fails with {type(error).__name__}: {error}") from error

    def broken(self, why: str) -> BrokenPluginError:
        """An error that names the package and what it offers."""
        return _broken((self,), why)


Of = TypeVar("Of", bound=Plugin)


def offered(group: str, of: type[Of]) -> tuple[Of, ...]:
    """What the installed packages offer in a group, by name; nothing is imported."""
    entries = [entry for entry in _installed(tuple(sys.path)) if entry.group == group]
    return tuple(of(*((e.dist.name, e.dist.version) if e.dist else (e.module, "")), e) for e in entries)


# What is installed follows from where packages are looked for, so that is the key; looking takes a hundredth of a second.
@lru_cache(maxsize=3)
def _installed(path: tuple[str, ...]) -> tuple[EntryPoint, ...]:
    every = entry_points()
    own: list[EntryPoint] = [entry for group in WHAT for entry in every.select(group=group)]
    return tuple(sorted(own, key=lambda entry: (entry.name, entry.value)))


def named(plugins: Iterable[Of], name: str) -> Of | None:
    """The one of this name; ``None`` where there is none."""
    found = [plugin for plugin in plugins if plugin.name == name]
    if len(found) > 1:
        given = " and ".join(f"{plugin.package} {plugin.version}" for plugin in found)
        raise CmmUqError(f"{found[0].what} comes from {given}", fix="Uninstall one of them")
    return found[0] if found else None


def versions(names: Mapping[str, Iterable[str]]) -> dict[str, str]:
    """Version of every package that offers one of these names, by group, and was imported for it, by its name."""
    return {
        plugin.package: plugin.version
        for group, wanted in names.items()
        for plugin in offered(group, Plugin)
        if plugin.name in set(wanted) and plugin.entry.module in sys.modules
    }


@contextmanager
def naming_package() -> Iterator[None]:
    """A computation in which other packages take part: where the code of one fails, the error says so."""
    try:
        yield
    except CmmUqError:
        raise
    except Exception as error:
        if (told := told_with_package(error)) is not None:
            raise told from error
        raise


def told_with_package(error: Exception) -> BrokenPluginError | None:
    """An error with the name of the package whose code it came through; ``None`` where it came through none."""
    at_fault = _at_fault(error)
    return _broken(at_fault, f"fails with {type(error).__name__}: {error}") if at_fault else None


def _at_fault(error: Exception) -> tuple[Plugin, ...]:
    """All that is offered by the innermost module among those that the error came through, of other packages."""
    plugins = [plugin for group in WHAT for plugin in offered(group, Plugin)]
    for frame, _ in reversed(list(walk_tb(error.__traceback__))):
        module = str(frame.f_globals.get("__name__", ""))
        package = module.partition(".")[0]
        inside = [plugin for plugin in plugins if plugin.entry.module.partition(".")[0] == package]
        if inside:
            return tuple(plugin for plugin in inside if plugin.entry.module == module) or tuple(inside)
    return ()


def _broken(plugins: tuple[Plugin, ...], why: str) -> BrokenPluginError:
    package = f"{plugins[0].package} {plugins[0].version}".rstrip()
    what = " or ".join(plugin.what for plugin in plugins)
    return BrokenPluginError(f"{what} {why}", where=f"package {package}", fix=_FIX)
