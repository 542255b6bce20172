"""The step of several ensembles side by side in one sampler of emcee, each with random numbers of its own, as if alone.

Most steps are independence proposals from an approximation of the density; differential-evolution steps repair what the
approximation misses. (emcee's snooker move is not used: its normalisation is wrong in release 3.1.6.) The density is asked for
the independence proposals of all ensembles at once, which costs little more than for those of one.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cmm_uq.inference.proposals import Proposal
from cmm_uq.points import Floats

SHARES = (0.9, 0.1)
"""How often the step is an independence proposal, and one of differential evolution."""


class SideBySide:
    """A move of emcee's.

    Parameters
    ----------
    proposal : roughly the density.
    randoms : random numbers of each ensemble, of which the walkers follow one another.
    """

    def __init__(self, proposal: Proposal, randoms: Sequence[Any]) -> None:
        from emcee.moves import DEMove, MHMove

        self._proposal, self._randoms = proposal, randoms
        self._independence, self._differences = MHMove(self._proposed), DEMove()

    def propose(self, model: Any, state: Any) -> tuple[Any, NDArray[np.bool_]]:
        """One step of every ensemble: where the walkers are then, and which of them moved."""
        accepted = np.zeros(len(state.coords), dtype=bool)
        of_ensemble = np.arange(len(accepted)).reshape(len(self._randoms), -1)
        chosen = np.array([random.choice(len(SHARES), p=SHARES) for random in self._randoms])
        together = np.flatnonzero(chosen == 0)
        steps = [(self._differences, of_ensemble[i], self._randoms[i]) for i in np.flatnonzero(chosen == 1).tolist()]
        if len(together):
            several = _Together([self._randoms[i] for i in together.tolist()])
            steps.append((self._independence, of_ensemble[together].ravel(), several))
        for move, rows, random in steps:
            part = type(state)(state.coords[rows], log_prob=state.log_prob[rows])
            part, accepted[rows] = move.propose(model._replace(random=random), part)
            state.coords[rows], state.log_prob[rows] = part.coords, part.log_prob
        return state, accepted

    def tune(self, state: Any, accepted: NDArray[np.bool_]) -> None:
        """Nothing: the step stays as it is."""

    def _proposed(self, z: Floats, random: _Together) -> tuple[Floats, Floats]:
        """Proposals that do not depend on where the walkers are, with their Hastings ratio."""
        count = len(z) // len(random.each)
        proposed = np.vstack([self._proposal.draws(count, one) for one in random.each])
        before, after = np.split(self._proposal.log_density(np.vstack([z, proposed])), 2)
        return proposed, before - after


@dataclass(frozen=True, eq=False)
class _Together:
    """Random numbers of some ensembles, those of one after those of another."""

    each: Sequence[Any]

    def rand(self, count: int) -> Floats:
        """Uniform between 0 and 1 (count,)."""
        return np.concatenate([random.rand(count // len(self.each)) for random in self.each])
