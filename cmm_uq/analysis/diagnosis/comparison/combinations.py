"""Which explanations hold together: the posterior over combinations of them, found best first, and how probable each was.

Known effects act by themselves, or a machine is out of adjustment and has several of what every machine has to some degree,
its scales and squarenesses: how readily each of these acts is the same for all of one machine, and unknown. So it is for the
artefact, which was made or calibrated on another machine. Six effects of such a machine are then not six coincidences.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from functools import cached_property

import numpy as np
import scipy

from cmm_uq.analysis.diagnosis.comparison.conditional import AMPLITUDES, Version
from cmm_uq.analysis.diagnosis.comparison.evidence import CandidateComparison
from cmm_uq.analysis.diagnosis.comparison.explanations import EFFECT, UNKNOWN, Explanation
from cmm_uq.base.points import Floats, Ints
from cmm_uq.base.values import dataclass, field
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
        self.counts, weights = counts, [e.weight for e in explanations]
        self._weight = [(e.kind, float(np.log(e.weight))) for e in explanations]
        together = [e.effect if e.together else None for e in explanations]
        machine = {i for i, effect in enumerate(together) if effect is not None and not effect.of_artefact}
        artefact = {i for i, effect in enumerate(together) if effect is not None and effect.of_artefact}
        if len(machine) < sum(effect.everywhere and not effect.of_artefact for effect in every().values()):
            machine = artefact = set()  # the job says what the machine is like
        shown = frozenset(range(len(explanations)) if visible is None else visible)
        self.machine, self._artefact = shown & machine, shown & artefact
        effects = [i for i, e in enumerate(explanations) if e.kind == EFFECT]
        beside = [i for i in effects if i not in self.machine | self._artefact]
        self._alone, self._beside = (_of_counts([weights[i] for i in own], counts) for own in (effects, beside))
        self._unknown = _of_counts([e.weight for e in explanations if e.kind == UNKNOWN], UNKNOWNS)
        self._of_machine = _of_subsets(len(self.machine), 1.0)
        mean = float(np.mean([weights[i] for i in self._artefact] or [1.0]))
        self._of_artefact = _of_subsets(len(self._artefact), mean)

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
    log = scipy.special.betaln(a + size, b + count - size) - scipy.special.betaln(a, b)
    log[1:] += np.log(weight)
    return np.asarray(log - np.log(1 + (weight - 1) * -np.expm1(log[0])), dtype=np.float64)


MOST = 12  # the most known effects that are looked for
WINDOW = 7.0  # a combination less probable than one of its parts by more than this, in logarithm, is not followed
# Part of an effect's squared visible length up to which two others that leave no more of it are tried in its place
LIKE = 0.02
# How many combinations of each size have their evidence computed, and are followed to the next size
SETTLED, FOLLOWED = 24, 8
Key = frozenset[int]


@dataclass(frozen=True)
class Combination:
    """Explanations that hold together, the size of each at its best, the log posterior up to a constant, and its log prior."""

    versions: tuple[Version, ...]
    log_posterior: float
    log_prior: float = 0.0


@dataclass(frozen=True, eq=False)
class Combinations:
    explanations: Sequence[Explanation]
    by_key: Mapping[Key, Combination]  # by the indices of their explanations
    # probability, beforehand, of none, one, two … known effects that act by themselves
    counts: tuple[float, ...] = EFFECTS
    # nonparametric terms that leave next to nothing of an effect in this recording
    imitated: Mapping[int, Key] = field(default_factory=dict)

    @cached_property
    def probability(self) -> dict[Key, float]:
        log = np.array([c.log_posterior for c in self.by_key.values()])
        return dict(zip(self.by_key, np.exp(log - scipy.special.logsumexp(log)).tolist(), strict=True))

    def likeliest(self, keys: Iterable[Key]) -> Key:
        return max(keys, key=lambda key: self.by_key[key].log_posterior)

    def effects_of(self, key: Key) -> Key:
        return frozenset(i for i in key if self.explanations[i].kind == EFFECT)

    @cached_property
    def of_effects(self) -> dict[Key, float]:
        """Probability of each set of known effects, whatever is unknown besides."""
        total: dict[Key, float] = {}
        for key, p in self.probability.items():
            known = self.effects_of(key)
            total[known] = total.get(known, 0.0) + p
        return total

    @property
    def most_probable(self) -> Key:
        return max(self.of_effects, key=lambda key: self.of_effects[key])

    def versions(self, effects: Key) -> tuple[Version, ...]:
        """Of the most probable combination with these known effects, or more; else of most of them, and each other's own."""
        if keys := [key for key in self.by_key if self.effects_of(key) >= effects]:
            return self.by_key[self.likeliest(keys)].versions
        most = max(len(effects & key) for key in self.by_key)
        best = self.likeliest(key for key in self.by_key if len(effects & key) == most)
        own = (self.by_key[self.likeliest(key for key in self.by_key if i in key)] for i in sorted(effects - best))
        more = (v for one in own for v in one.versions)
        return (
            *self.by_key[best].versions,
            *{v.explanation: v for v in more if v.explanation in effects - best}.values(),
        )

    def imitating(self, index: int) -> Key:
        """Nonparametric terms that could pass for an effect: by its form, or in this recording."""
        effect = self.explanations[index]
        by_form = {j for j, function in enumerate(self.explanations) if function.could_be(effect)}
        return frozenset(by_form) | self.imitated.get(index, frozenset())

    def unknown_beside(self, effects: Key) -> float:
        """Probability that something unknown acts besides, given these known effects; 1 of a set that was not compared."""
        beside = sum(p for key, p in self.probability.items() if self.effects_of(key) == effects and key != effects)
        return beside / self.of_effects[effects] if effects in self.of_effects else 1.0

    def of(self, index: int) -> float:
        return self.of_any(frozenset((index,)))

    def of_any(self, explanations: Key) -> float:
        return min(1.0, float(sum(p for key, p in self.probability.items() if explanations & key)))

    def instead(self, effects: Key, index: int) -> dict[int, float]:
        """Odds of each other known effect in the place of one, or of one and more, the rest kept.

        In the place of several it counts where it is more probable than that the one is merely left out: a gauge that had
        another temperature on each of its lines looks like several errors of the machine. Effects that were compared only
        with others that are withheld have no odds.
        """
        rest, whole = self.of_effects.get(effects - {index}, 0.0), self.of_effects.get(effects, 0.0)
        odds: dict[int, float] = {}
        for other, p in self.of_effects.items() if whole else ():
            if len(more := other - effects) == 1 and index not in other and (len(other) == len(effects) or p > rest):
                (it,) = more
                odds[it] = odds.get(it, 0.0) + p / whole
        return odds


def explore(
    comparison: CandidateComparison, before: Combinations | None = None, changed: Key = frozenset()
) -> Combinations:
    """Follow the most probable combinations, level by level, then every exchange of one explanation of the best."""
    counts: tuple[float, ...] = EFFECTS if before is None else before.counts
    while before is None and len(counts) - 1 <= len(effects_of_every_machine(comparison)):
        counts = with_two_more(counts)
    found = _explored(comparison, before, changed, counts)
    # there may be more than were looked for; unknown functions may stand for several of them
    while len(found.counts) - 1 <= min(len(found.likeliest(found.by_key)), MOST - 2):
        found = _explored(comparison, found, frozenset(), with_two_more(found.counts))
    return found


def effects_of_every_machine(comparison: CandidateComparison) -> list[int]:
    """Effects that every machine has to some degree and this recording shows."""
    effects = ((i, comparison.explanations[i].effect) for i in sorted(comparison.visible))
    return [i for i, effect in effects if effect is not None and effect.everywhere and not effect.of_artefact]


def _explored(
    comparison: CandidateComparison, before: Combinations | None, changed: Key, counts: tuple[float, ...]
) -> Combinations:
    # one of more effects than were looked for may be possible now
    known = {} if before is None else before.by_key
    known = {key: one for key, one in known.items() if not key & changed and np.isfinite(one.log_posterior)}
    search, exchanged = _Search(comparison, known, counts), set[Key]()
    search.climb(frozenset())
    # one of many coefficients can explain all of these at once, and then none of them is worth adding by itself
    if together := search.with_more((), effects_of_every_machine(comparison)):
        search.settle(together)
        search.climb(key_of(together))
    while (best := search.best()) not in exchanged:
        exchanged.add(best)
        for i in best:
            fewer = tuple(v for v in search.settled[best].versions if v.explanation != i)
            search.settle(fewer)
            search.expand(key_of(fewer))
            for pair in search.pairs_like(i):
                if not best & frozenset(pair):
                    search.settle(search.with_more(fewer, pair))
        search.settle_best(len(best), SETTLED)
    return Combinations(comparison.explanations, search.settled, counts)


def key_of(versions: Iterable[Version]) -> Key:
    return frozenset(v.explanation for v in versions)


class _Search:
    """Combinations settled so far, and those that wait for it with an estimate of their posterior."""

    def __init__(
        self, comparison: CandidateComparison, known: Mapping[Key, Combination], counts: tuple[float, ...]
    ) -> None:
        self.comparison, self.known = comparison, known
        self.prior = CombinationPrior(comparison.explanations, counts, comparison.visible)
        self.candidates = {i for i, e in enumerate(comparison.explanations) if e.kind in (EFFECT, UNKNOWN)}
        self.settled: dict[Key, Combination] = {}
        self._expanded: set[Key] = set()
        self._waiting: dict[Key, tuple[float, tuple[Version, ...]]] = {}
        self.settle(())

    def climb(self, start: Key) -> None:
        """Follow the most probable combinations from one to those with more, level by level."""
        level = [start]
        while level:
            for key in level:
                self.expand(key)
            level = [key for key in self.settle_best(len(level[0]) + 1, SETTLED, start) if self.worth(key)]
            level = self._first(sorted(level, key=lambda key: -self.settled[key].log_posterior), FOLLOWED)

    def best(self) -> Key:
        return max(self.settled, key=lambda key: self.settled[key].log_posterior)

    def worth(self, key: Key) -> bool:
        """Whether a combination is at least as probable as one of its parts, but for the window."""
        posterior = self.settled[key].log_posterior
        parts = [self.settled[key - {i}].log_posterior for i in key if key - {i} in self.settled]
        return posterior > max(parts, default=-np.inf) - WINDOW

    def expand(self, key: Key) -> None:
        """Put every combination with one more explanation on the list."""
        if key in self._expanded:
            return
        self._expanded.add(key)
        known = self.settled[key]
        base = known.log_posterior - known.log_prior - float(self.comparison.log_evidence_of(known.versions)[0])
        for i, (total, version) in self.comparison.beside(known.versions, self.candidates).items():
            larger, versions = key | {i}, (*known.versions, version)
            if i in key or i not in self.candidates or larger in self.settled:
                continue
            estimate = base + total + self.prior.log(larger, alike=self.alike(versions))
            if estimate > self._waiting.get(larger, (-np.inf, ()))[0]:
                self._waiting[larger] = estimate, versions

    def settle_best(self, size: int, count: int, within: Key = frozenset()) -> list[Key]:
        """Settle the most probable of this size and with ``within`` that wait."""
        waiting = [key for key in self._waiting if len(key) == size and within <= key]
        chosen = self._first(sorted(waiting, key=lambda key: -self._waiting[key][0]), count)
        for key in chosen:
            self.settle(self._waiting.pop(key)[1])
        return chosen

    @cached_property
    def _forms(self) -> tuple[Ints, Floats]:
        """Known effects of one coefficient that are seen, and the form (m, n) of each, of length one."""
        forms: dict[int, Floats] = {}
        for i in sorted(self.candidates & self.comparison.visible):
            explanation, first = self.comparison.explanations[i], self.comparison.explanations[i].members[0]
            if explanation.kind == EFFECT and first.columns.shape[1] == 1 and not first.shape:
                form = self.comparison.rest(first.columns / self.comparison.noise_scale[:, None])[:, 0]
                if (length := float(np.linalg.norm(form))) > 0:
                    forms[i] = form / length
        return np.array(list(forms), dtype=np.intp), np.array(list(forms.values())).T

    def pairs_like(self, index: int) -> list[tuple[int, int]]:
        """Pairs of other known effects that together leave next to nothing of one, and neither of them does alone."""
        numbers, forms = self._forms
        if index not in numbers:
            return []
        own, others = np.flatnonzero(numbers == index)[0], np.flatnonzero(numbers != index)
        cosines, among = forms[:, others].T @ forms[:, own], forms[:, others].T @ forms[:, others]
        a, b = np.triu_indices(len(others), 1)
        apart = 1 - among[a, b] ** 2
        together = cosines[a] ** 2 + cosines[b] ** 2 - 2 * cosines[a] * cosines[b] * among[a, b]
        alone = np.maximum(np.abs(cosines[a]), np.abs(cosines[b])) ** 2
        like = (apart > LIKE) & (1 - alone > LIKE) & (together > (1 - LIKE) * apart)
        return [(int(numbers[others[i]]), int(numbers[others[j]])) for i, j in zip(a[like], b[like], strict=True)]

    def with_more(self, versions: tuple[Version, ...], more: Iterable[int]) -> tuple[Version, ...]:
        """The same with others, the size of each at its best beside those before it."""
        for i in more:
            versions = (*versions, self.comparison.beside(versions, (i,))[i][1])
        return versions

    def settle(self, versions: tuple[Version, ...]) -> None:
        key = key_of(versions)
        if key in self.known and key not in self.settled:
            self.settled[key] = self.known[key]
        if key not in self.settled:
            evidence, settled = log_evidence_together(self.comparison, versions)
            log_prior = self.prior.log(key, alike=self.alike(settled))
            self.settled[key] = Combination(settled, evidence + log_prior, log_prior)

    def alike(self, versions: Iterable[Version]) -> bool:
        """Whether those of a machine out of adjustment show errors of one order of magnitude."""
        shown, scale = [], self.comparison.noise_scale[:, None]
        for version in versions:
            if version.explanation in self.prior.machine:
                columns = self.comparison.explanations[version.explanation].members[0].columns
                shown.append(version.amplitude * float(np.linalg.norm(columns / scale)))
        return len(shown) > 0 and max(shown) <= ALIKE * min(shown)

    def _first(self, order: Sequence[Key], count: int) -> list[Key]:
        """The first of some combinations, half of the places kept for known effects alone."""
        kinds = [explanation.kind for explanation in self.comparison.explanations]
        known = [key for key in order if all(kinds[i] != UNKNOWN for i in key)][: count // 2]
        return known + [key for key in order if key not in known][: count - len(known)]


def log_evidence_together(
    comparison: CandidateComparison, versions: Sequence[Version]
) -> tuple[float, tuple[Version, ...]]:
    """Log evidence of explanations together: exact for one; of several each is summed with the others at their best."""
    best, totals = list(versions), [0.0] * len(versions)
    for _ in range(4):
        before = tuple(best)
        for i, version in enumerate(best):
            others = best[:i] + best[i + 1 :]
            totals[i], best[i] = comparison.beside(others, (version.explanation,))[version.explanation]
        if tuple(best) == before or len(best) == 1:
            break
    fixed = float(comparison.log_evidence_of(best)[0])
    return fixed + sum(total - fixed for total in totals), tuple(best)
