"""Effects from other packages, found by their entry points of the group ``cmm_uq.effects``.

The entry point has the name of the effect and gives an :class:`~cmm_uq.physics.effect.Effect`, or a class of one that is made
without arguments. Which there are is read from the packages' metadata; a package is imported when its effect is first needed.
"""

from __future__ import annotations

from collections.abc import Callable, Container, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from importlib.metadata import EntryPoint, entry_points
from typing import Any

import numpy as np

from cmm_uq.errors import CmmUqError
from cmm_uq.messages import foreign
from cmm_uq.physics.effect import Effect, Parameter, Shape
from cmm_uq.points import Floats, Points

GROUP = "cmm_uq.effects"

OWN = "cmm-uq"
"""The package that the built-in effects belong to."""


class BrokenPluginError(CmmUqError):
    """An effect of another package that does not do what an effect must."""


@dataclass(frozen=True)
class Plugin:
    """An effect that another package offers.

    Parameters
    ----------
    package, version : of the package.
    entry : its entry point.
    """

    package: str
    version: str
    entry: EntryPoint

    @cached_property
    def effect(self) -> Effect:
        """The effect itself; its package is imported now.

        Raises
        ------
        BrokenPluginError : it cannot be imported, or is no effect of this name.
        """
        made = self.attempt(self._made)
        if not isinstance(made, Effect):
            raise self.broken(f"is no Effect but {type(made).__name__}")
        for field in ("name", "title", "formula", "mechanism", "points_to", "coefficients"):
            if not getattr(made, field, None):
                raise self.broken(f"says no {field}")
        if made.name != self.entry.name:
            raise self.broken(f"calls itself {made.name!r}")
        return _Outside(made, self)

    def _made(self) -> object:
        loaded = self.entry.load()
        return loaded() if isinstance(loaded, type) else loaded

    def attempt(self, what: Callable[[], Any]) -> Any:
        """What the package's code returns; errors of its own are said to be its own.

        Raises
        ------
        BrokenPluginError : the code fails. An error that is meant for the user, such as a missing column, is passed on.
        """
        try:
            return what()
        except CmmUqError:
            raise
        except Exception as error:
            raise self.broken(f"fails with {type(error).__name__}: {error}") from error

    def broken(self, why: str) -> BrokenPluginError:
        """An error that names package and effect."""
        return BrokenPluginError(
            f"the effect {self.entry.name!r} {why}",
            where=f"package {self.package} {self.version}",
            fix="Mend the package, or uninstall it",
        )


class _Outside(Effect):
    """An effect of another package: the same, but what its code does wrong is said with its package's name."""

    def __init__(self, effect: Effect, plugin: Plugin) -> None:
        self._effect, self._plugin = effect, plugin
        self.name, self.title, self.formula = effect.name, foreign(effect.title), effect.formula
        self.mechanism, self.points_to = effect.mechanism, foreign(effect.points_to)
        self.coefficients, self.shape, self.columns = effect.coefficients, effect.shape, effect.columns
        self.tier, self.idealised_over, self.imitated_by = effect.tier, effect.idealised_over, effect.imitated_by

    def basis(self, points: Points, shape: Sequence[float] = ()) -> Floats:
        """See :meth:`Effect.basis`."""
        found = np.asarray(self._plugin.attempt(lambda: self._effect.basis(points, shape)))
        wanted = (len(points), 3, len(self.coefficients))
        if found.shape != wanted or found.dtype != np.float64 or not np.isfinite(found).all():
            raise self._plugin.broken(f"gives a basis {found.shape} {found.dtype}, not one {wanted} of finite float64")
        return found

    def trials(self) -> Iterator[tuple[float, ...]]:
        """See :meth:`Effect.trials`."""
        return self._effect.trials()

    @property
    def prior_weight(self) -> float:
        """See :attr:`Effect.prior_weight`."""
        return self._effect.prior_weight

    @property
    def reported(self) -> tuple[Parameter | Shape, ...]:
        """See :attr:`Effect.reported`."""
        return self._effect.reported

    def to_reported(self, coefficients: Floats, shape: Floats) -> dict[str, Floats]:
        """See :meth:`Effect.to_reported`."""
        return self._effect.to_reported(coefficients, shape)

    def from_reported(self, parameters: Mapping[str, float]) -> tuple[Floats, tuple[float, ...]]:
        """See :meth:`Effect.from_reported`."""
        return self._effect.from_reported(parameters)


def offered(own: Container[str]) -> dict[str, Plugin]:
    """Effects that the installed packages offer, by name; none is imported.

    Parameters
    ----------
    own : names of the built-in effects.

    Raises
    ------
    CmmUqError : two packages offer an effect of the same name.
    """
    found: dict[str, Plugin] = {}
    for entry in sorted(entry_points(group=GROUP), key=lambda entry: (entry.name, entry.value)):
        package, version = (entry.dist.name, entry.dist.version) if entry.dist else (entry.module, "")
        other = OWN if entry.name in own else found[entry.name].package if entry.name in found else None
        if other is not None:
            raise CmmUqError(
                f"the effect {entry.name!r} comes from {other} and from {package}",
                fix=f"Uninstall {package}, or rename it",
            )
        found[entry.name] = Plugin(package, version, entry)
    return found
