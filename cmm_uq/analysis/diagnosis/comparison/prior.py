"""How probable every combination of explanations is beforehand.

Known effects act by themselves, or a machine is out of adjustment and has several of what every machine has to some degree,
its scales and squarenesses: how readily each of these acts is the same for all of one machine, and unknown. So it is for the
artefact, which was made or calibrated on another machine. Six effects of such a machine are then not six coincidences.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Sequence

import numpy as np
from scipy import special

from cmm_uq.analysis.diagnosis.comparison.conditional import AMPLITUDES
from cmm_uq.analysis.diagnosis.comparison.explanations import EFFECT, UNKNOWN, Explanation
from cmm_uq.base.points import Floats
from cmm_uq.machine.physics.catalogue import every

# Probability of none, one, two, three and four known effects that the job does not name
EFFECTS = (0.5, 0.27, 0.14, 0.06, 0.03)
FURTHER = 0.5  # how many times less probable each further effect is where four are found
UNKNOWNS = (0.85, 0.12, 0.03)  # of none, one and two nonparametric terms
# Probability that scales and squarenesses belong together so, where nothing is said of any of them
OUT_OF_ADJUSTMENT = 0.05
# Parameters of the beta distribution of how readily each of them then acts: mostly all of them, or nearly so
READILY = (6.0, 1.0)
ALIKE = 10.0  # ratio within which what is shown of them then lies
# By how much each further one is more probable at its size: three of the sizes that are tried lie so near the first
_NARROWER = float(np.log(AMPLITUDES / 3))


def with_two_more(counts: tuple[float, ...]) -> tuple[float, ...]:
    """Probabilities of none, one, two … known effects, continued by two more."""
    return (*counts, counts[-1] * FURTHER, counts[-1] * FURTHER**2)


class CombinationPrior:
    """Probability, beforehand, of every combination: of how many, and among as many by the product of their weights.

    ``explanations`` of which combinations are made; ``counts`` probability of none, one, two … known effects that act
    by themselves; ``visible`` explanations of which a recording shows anything; all by default. ``machine`` scales and
    squarenesses that may belong together: those that are seen, where the job names none.
    """

    def __init__(
        self,
        explanations: Sequence[Explanation],
        counts: tuple[float, ...] = EFFECTS,
        visible: Collection[int] | None = None,
    ) -> None:
        self.counts = counts
        self._weight = [(e.kind, float(np.log(e.weight))) for e in explanations]
        shown = range(len(explanations)) if visible is None else visible
        self.machine = _everywhere(explanations, shown, of_artefact=False)
        self._artefact = _everywhere(explanations, shown, of_artefact=True)
        if len(_everywhere(explanations, range(len(explanations)), of_artefact=False)) < sum(
            effect.everywhere and not effect.of_artefact for effect in every().values()
        ):
            self.machine = self._artefact = frozenset()  # the job says what the machine is like
        together = self.machine | self._artefact
        effects = [i for i, e in enumerate(explanations) if e.kind == EFFECT]
        weights = [e.weight for e in explanations]
        self._alone = _of_counts([weights[i] for i in effects], counts)
        self._beside = _of_counts([weights[i] for i in effects if i not in together], counts)
        self._unknown = _of_counts([e.weight for e in explanations if e.kind == UNKNOWN], UNKNOWNS)
        self._of_machine = _of_subsets(len(self.machine), 1.0)
        self._of_artefact = _of_subsets(
            len(self._artefact), float(np.mean([weights[i] for i in self._artefact] or [1.0]))
        )

    def log(self, key: Iterable[int], *, alike: bool = False) -> float:
        """Logarithm of the probability; minus infinity for a combination that is not considered."""
        effects, rest, machine, artefact, functions = 0, 0, 0, 0, 0
        of_effects = of_rest = of_functions = 0.0
        for i in key:
            kind, weight = self._weight[i]
            if kind == UNKNOWN:
                functions, of_functions = functions + 1, of_functions + weight
                continue
            if kind != EFFECT:
                return -np.inf
            effects, of_effects = effects + 1, of_effects + weight
            if i in self.machine:
                machine += 1
            elif i in self._artefact:
                artefact += 1
            else:
                rest, of_rest = rest + 1, of_rest + weight
        if functions >= len(self._unknown) or effects >= len(self._alone):
            return -np.inf
        of_functions += float(self._unknown[functions])
        alone = float(self._alone[effects]) + of_effects
        if not self.machine:
            return of_functions + alone
        together = float(self._beside[rest] + self._of_machine[machine] + self._of_artefact[artefact]) + of_rest
        together += max(machine - 1, 0) * _NARROWER * alike
        either = np.logaddexp(np.log(1 - OUT_OF_ADJUSTMENT) + alone, np.log(OUT_OF_ADJUSTMENT) + together)
        return of_functions + float(either)


def _everywhere(explanations: Sequence[Explanation], shown: Iterable[int], *, of_artefact: bool) -> frozenset[int]:
    return frozenset(
        i for i in shown
        if (effect := explanations[i].effect) is not None and explanations[i].together and effect.of_artefact == of_artefact
    )  # fmt: skip


def _of_counts(weights: Sequence[float], counts: Sequence[float]) -> Floats:
    """Log probability of one set (``len(counts)``,) of none, one, two … effects, but for the product of their weights."""
    sums = np.zeros(len(counts))
    sums[0] = 1.0
    for weight in weights:
        sums[1:] += weight * sums[:-1]
    return np.asarray(np.log(counts) - np.log(np.where(sums > 0, sums, 1.0)), dtype=np.float64)


def _of_subsets(count: int, weight: float) -> Floats:
    """Log probability (``count`` + 1,) of one set of none, one, two … of some effects that act as readily as one another."""
    a, b = READILY
    size = np.arange(count + 1)
    log = special.betaln(a + size, b + count - size) - special.betaln(a, b)
    log[1:] += np.log(weight)
    return np.asarray(log - np.log(1 + (weight - 1) * -np.expm1(log[0])), dtype=np.float64)
