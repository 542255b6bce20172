"""What was found of a fleet: for each value the model that was learnt, and who does not belong."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cmm_uq.recertification.fleet import Fleet, Member, belonging


@dataclass(frozen=True, eq=False)
class OfValue:
    """One error factor or figure of performance over the fleet.

    Attributes
    ----------
    name, quantity, unit : of the value; the unit as recorded.
    members : machines, in the order of the fleet's estimates.
    fleet : what was learnt.
    belongs : (N,) whether each machine drifts as its fleet lets expect, all values taken together.
    left_out : certificates that state no uncertainty, which cannot be weighed.
    """

    name: str
    quantity: str
    unit: str
    members: tuple[Member, ...]
    fleet: Fleet
    belongs: NDArray[np.bool_]
    left_out: int


@dataclass(frozen=True, eq=False)
class FleetFound:
    """All values that were asked for.

    Attributes
    ----------
    values : by name.
    seed : of the sampling.
    """

    values: tuple[OfValue, ...]
    seed: int

    @property
    def outsiders(self) -> list[tuple[OfValue, int]]:
        """Machines that do not belong, by value: the value, and the machine's place among its members."""
        return [(value, int(i)) for value in self.values for i in np.flatnonzero(~value.belongs)]

    @property
    def converged(self) -> bool:
        """Whether every sampling has."""
        return all(value.fleet.chains.converged for value in self.values)


def judged(learnt: Iterable[tuple[str, str, str, tuple[Member, ...], Fleet, int]], seed: int) -> FleetFound:
    """Values with who belongs: one procedure over all machines and values, so that many values accuse no more machines.

    Parameters
    ----------
    learnt : name, quantity, unit, members, fleet and certificates left out, for each value.
    seed : of the sampling.
    """
    all_learnt = list(learnt)
    belongs = belonging(np.concatenate([fleet.estimates.p for *_, fleet, _ in all_learnt]))
    ends = np.cumsum([len(fleet.machines) for *_, fleet, _ in all_learnt])[:-1]
    return FleetFound(
        tuple(
            OfValue(name, quantity, unit, members, fleet, those, left_out)
            for (name, quantity, unit, members, fleet, left_out), those in zip(
                all_learnt, np.split(belongs, ends), strict=True)
        ),
        seed,
    )  # fmt: skip
