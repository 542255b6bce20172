"""What was found of a fleet: for each value the model that was learnt, and who does not belong."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from cmm_uq.base.points import Floats
from cmm_uq.jobs.verdicts import BEYOND
from cmm_uq.laboratory.due.drift import YEAR
from cmm_uq.laboratory.due.fleet import Fleet, Member, belonging


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

    @property
    def compared(self) -> bool:
        """Whether machines could be compared."""
        return comparable(self.members)

    @cached_property
    def median(self) -> Floats:
        """Days after its last certificate by which a machine has as likely as not crossed its limit, (N,).

        0 where it had already; infinite beyond the horizon, and without a limit.
        """
        crossing = self.fleet.estimates.crossing
        return np.full(len(self.members), np.inf) if crossing is None else crossing.quantile(0.5)

    @property
    def crosses(self) -> Floats:
        """Ordinals of these days, (N,)."""
        crossing = self.fleet.estimates.crossing
        return self.median if crossing is None else crossing.last + self.median

    @property
    def beyond(self) -> NDArray[np.bool_]:
        """Whether a machine was beyond its limit at its last certificate, (N,): as that says, or where it says nothing."""
        probably = self.median == 0
        return np.array(
            [one.outcome in BEYOND if one.outcome else bool(probably[i]) for i, one in enumerate(self.members)]
        )

    def crosses_by(self, day: float) -> NDArray[np.bool_]:
        """Whether a machine that was not crosses its limit by an ordinal, (N,)."""
        return np.asarray(~self.beyond & (self.crosses <= day))


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
    def newest(self) -> float:
        """Ordinal of the newest certificate."""
        return max(float(member.history.day[-1]) for value in self.values for member in value.members)

    @property
    def in_a_year(self) -> float:
        """Ordinal, a year after the newest certificate."""
        return self.newest + YEAR

    @property
    def compared(self) -> bool:
        """Whether machines could be compared by any value."""
        return any(value.compared for value in self.values)

    @property
    def converged(self) -> bool:
        """Whether every sampling has."""
        return all(value.fleet.chains.converged for value in self.values)


def comparable(members: Iterable[Member]) -> bool:
    """Whether two machines at least have certificates of two days: a machine seen on one shows no drift of its own."""
    return sum(seen_again(member) for member in members) > 1


def seen_again(member: Member) -> bool:
    """Whether a machine has certificates of two days."""
    return bool(np.ptp(member.history.day) > 0)


def judged(learnt: Iterable[tuple[str, str, str, tuple[Member, ...], Fleet, int]], seed: int) -> FleetFound:
    """Values with who belongs: one procedure over all machines and values, so that many values accuse no more machines.

    Where nothing can be compared, no machine is said not to belong.

    Parameters
    ----------
    learnt : name, quantity, unit, members, fleet and certificates left out, for each value.
    seed : of the sampling.
    """
    all_learnt = list(learnt)
    p = np.concatenate([fleet.estimates.p for *_, fleet, _ in all_learnt])
    weighed = np.concatenate([np.full(len(members), comparable(members)) for *_, members, _, _ in all_learnt])
    belongs = np.ones(len(p), dtype=np.bool_)
    belongs[weighed] = belonging(p[weighed])
    ends = np.cumsum([len(fleet.machines) for *_, fleet, _ in all_learnt])[:-1]
    return FleetFound(
        tuple(
            OfValue(name, quantity, unit, members, fleet, those, left_out)
            for (name, quantity, unit, members, fleet, left_out), those in zip(
                all_learnt, np.split(belongs, ends), strict=True)
        ),
        seed,
    )  # fmt: skip
