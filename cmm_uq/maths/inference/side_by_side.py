"""The step of several ensembles side by side in one sampler of emcee, each with random numbers of its own, as if alone.

Most steps are independence proposals from an approximation of the density; differential-evolution steps repair what the
approximation misses. (emcee's snooker move is not used: its normalisation is wrong in release 3.1.6.) Independence proposals
do not depend on where the walkers are, so those of all ensembles are drawn ahead, up to each one's next differential-evolution
step, and the density is asked for all of them at once, which costs little more than for those of one step.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cmm_uq.base.points import Floats
from cmm_uq.maths.inference.proposals import Numbers, Proposes

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
    log_before: Floats = field(default_factory=lambda: np.zeros(0))

    def rand(self, _: int) -> Floats:
        """What emcee takes from a source of random numbers."""
        return self.uniform

    @classmethod
    def together(cls, steps: Sequence[_Independent], log_before: Floats) -> _Independent:
        """Those of several ensembles as those of one.

        Parameters
        ----------
        log_before : (w,) of what is proposed, where the walkers are.
        """
        each = ((step.proposed, step.log_proposal, step.log_density, step.uniform) for step in steps)
        proposed, log_proposal, log_density, uniform = (np.concatenate(of) for of in zip(*each, strict=True))
        return cls(proposed, log_proposal, log_density, uniform, log_before)


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
        self._at, self._log_proposal = np.zeros((0, 0)), np.zeros(0)

    def propose(self, model: Any, state: Any) -> tuple[Any, NDArray[np.bool_]]:
        """One step of every ensemble: where the walkers are then, and which of them moved."""
        accepted = np.zeros(len(state.coords), dtype=bool)
        of_ensemble = np.arange(len(accepted)).reshape(len(self._randoms), -1)
        self._draw_ahead(model, of_ensemble.shape[1])
        if not np.array_equal(self._at, state.coords):
            self._log_proposal = self._proposal.log_density(state.coords)
        chosen = [steps.popleft() for steps in self._ahead]
        for i, step in enumerate(chosen):
            if step is None:
                rows = of_ensemble[i]
                self._move(self._differences, model._replace(random=self._randoms[i]), state, rows, accepted)
                moved = rows[accepted[rows]]
                if len(moved):
                    self._log_proposal[moved] = self._proposal.log_density(state.coords[moved])
        if independent := [step for step in chosen if step is not None]:
            rows = of_ensemble[[step is not None for step in chosen]].ravel()
            several = _Independent.together(independent, self._log_proposal[rows])
            known = model._replace(random=several, compute_log_prob_fn=lambda _: (several.log_density, None))
            self._move(self._independence, known, state, rows, accepted)
            self._log_proposal[rows] = np.where(accepted[rows], several.log_proposal, several.log_before)
        self._at = state.coords.copy()
        return state, accepted

    def _move(self, move: Any, model: Any, state: Any, rows: NDArray[np.int64], accepted: NDArray[np.bool_]) -> None:
        """A move of emcee's for some of the walkers, in their place."""
        part = type(state)(state.coords[rows], log_prob=state.log_prob[rows])
        part, accepted[rows] = move.propose(model, part)
        state.coords[rows], state.log_prob[rows] = part.coords, part.log_prob

    def tune(self, state: Any, accepted: NDArray[np.bool_]) -> None:
        """Nothing: the step stays as it is."""

    def _draw_ahead(self, model: Any, walkers: int) -> None:
        """Next steps of each ensemble that has none: independent ones, and ``None`` for one of differential evolution."""
        drawn: list[tuple[deque[_Independent | None], Numbers, Floats]] = []
        differences = []
        for steps, random in zip(self._ahead, self._randoms, strict=True):
            for _ in range(0 if steps else _AHEAD):
                if random.random_sample() >= SHARES[0]:  # its random numbers are the next
                    differences.append(steps)
                    break
                drawn.append((steps, self._proposal.numbers_of(walkers, random), random.rand(walkers)))
        if drawn:
            each = zip(*(numbers for _, numbers, _ in drawn), strict=True)
            z = self._proposal.made(tuple(np.concatenate(column) for column in each))
            log_proposal, log_density = self._proposal.log_density(z), model.compute_log_prob_fn(z)[0]
            for i, (steps, _, uniform) in enumerate(drawn):
                own = slice(i * walkers, (i + 1) * walkers)
                steps.append(_Independent(z[own], log_proposal[own], log_density[own], uniform))
        for steps in differences:
            steps.append(None)

    def _proposed(self, _: Floats, drawn: _Independent) -> tuple[Floats, Floats]:
        """Proposals that do not depend on where the walkers are, with their Hastings ratio."""
        return drawn.proposed, drawn.log_before - drawn.log_proposal
