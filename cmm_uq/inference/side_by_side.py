"""The step of several ensembles side by side in one sampler of emcee, each with random numbers of its own, as if alone.

Most steps are independence proposals from an approximation of the density; differential-evolution steps repair what the
approximation misses. (emcee's snooker move is not used: its normalisation is wrong in release 3.1.6.) Independence proposals
do not depend on where the walkers are, so those of all ensembles are drawn ahead, up to each one's next differential-evolution
step, and the density is asked for all of them at once, which costs little more than for those of one step.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cmm_uq.inference.proposals import Proposes
from cmm_uq.points import Floats

SHARES = (0.9, 0.1)
"""How often the step is an independence proposal, and one of differential evolution."""

_AHEAD = 40
"""Most steps that are drawn ahead."""


@dataclass(frozen=True, eq=False)
class _Independent:
    """Independence proposals (w, d), logarithms of what they come from and of the density, and what decides on them, (w,)."""

    proposed: Floats
    log_proposal: Floats
    log_density: Floats
    uniform: Floats

    def rand(self, _: int) -> Floats:
        """What emcee takes from a source of random numbers."""
        return self.uniform

    @classmethod
    def together(cls, steps: Sequence[_Independent]) -> _Independent:
        """Those of several ensembles as those of one."""
        return cls(
            *(
                np.concatenate([getattr(step, name) for step in steps])
                for name in ("proposed", "log_proposal", "log_density", "uniform")
            )
        )


class SideBySide:
    """A move of emcee's.

    Parameters
    ----------
    proposal : roughly the density.
    randoms : random numbers of each ensemble, of which the walkers follow one another.
    """

    def __init__(self, proposal: Proposes, randoms: Sequence[Any]) -> None:
        from emcee.moves import DEMove, MHMove

        self._proposal, self._randoms = proposal, randoms
        self._independence, self._differences = MHMove(self._proposed), DEMove()
        self._ahead: tuple[deque[_Independent | None], ...] = tuple(deque() for _ in randoms)

    def propose(self, model: Any, state: Any) -> tuple[Any, NDArray[np.bool_]]:
        """One step of every ensemble: where the walkers are then, and which of them moved."""
        accepted = np.zeros(len(state.coords), dtype=bool)
        of_ensemble = np.arange(len(accepted)).reshape(len(self._randoms), -1)
        self._draw_ahead(model, of_ensemble.shape[1])
        chosen = [steps.popleft() for steps in self._ahead]
        moves = [
            (self._differences, of_ensemble[i], model._replace(random=self._randoms[i]))
            for i, step in enumerate(chosen)
            if step is None
        ]
        if independent := [step for step in chosen if step is not None]:
            rows = of_ensemble[[step is not None for step in chosen]].ravel()
            several = _Independent.together(independent)
            known = model._replace(random=several, compute_log_prob_fn=lambda _: (several.log_density, None))
            moves.append((self._independence, rows, known))
        for move, rows, own in moves:
            part = type(state)(state.coords[rows], log_prob=state.log_prob[rows])
            part, accepted[rows] = move.propose(own, part)
            state.coords[rows], state.log_prob[rows] = part.coords, part.log_prob
        return state, accepted

    def tune(self, state: Any, accepted: NDArray[np.bool_]) -> None:
        """Nothing: the step stays as it is."""

    def _draw_ahead(self, model: Any, walkers: int) -> None:
        """Next steps of each ensemble that has none: independent ones, and ``None`` for one of differential evolution."""
        drawn: list[tuple[deque[_Independent | None], Floats, Floats]] = []
        differences = []
        for steps, random in zip(self._ahead, self._randoms, strict=True):
            for _ in range(0 if steps else _AHEAD):
                if random.random_sample() >= SHARES[0]:  # its random numbers are the next
                    differences.append(steps)
                    break
                drawn.append((steps, self._proposal.draws(walkers, random), random.rand(walkers)))
        if drawn:
            z = np.concatenate([proposed for _, proposed, _ in drawn])
            log_proposal, log_density = self._proposal.log_density(z), model.compute_log_prob_fn(z)[0]
            for i, (steps, proposed, uniform) in enumerate(drawn):
                own = slice(i * walkers, (i + 1) * walkers)
                steps.append(_Independent(proposed, log_proposal[own], log_density[own], uniform))
        for steps in differences:
            steps.append(None)

    def _proposed(self, z: Floats, drawn: _Independent) -> tuple[Floats, Floats]:
        """Proposals that do not depend on where the walkers are, with their Hastings ratio."""
        return drawn.proposed, self._proposal.log_density(z) - drawn.log_proposal
