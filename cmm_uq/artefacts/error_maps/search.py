"""The rivals for how the maps of a column differ, and the kinds of noise along an axis.

Error maps of one machine against each other: what changes with temperature, and which map contradicts the others.

Every error of every carriage is a free function of position, the same in all maps; what is left is how the maps differ. Each
map starts anywhere, and a straightness points anywhere. The rivals for what is left: the scale expands; the function changes
in proportion to the temperature; one map differs, by a smooth function of position.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy import linalg, sparse

from cmm_uq.analysis.diagnosis.comparison.combinations import Combinations, Key, explore
from cmm_uq.analysis.diagnosis.comparison.conditional import Version
from cmm_uq.analysis.diagnosis.comparison.evidence import CandidateComparison
from cmm_uq.analysis.diagnosis.comparison.explanations import EFFECT, UNKNOWN, Explanation, Member, smooth_functions
from cmm_uq.analysis.diagnosis.comparison.lack_of_fit import lack_of_fit
from cmm_uq.analysis.diagnosis.noise import TAILS, NoiseKind, heavy_tails
from cmm_uq.artefacts.error_maps.columns import MapColumn, roughness
from cmm_uq.base.messages import Text, Verbatim, say
from cmm_uq.base.points import Floats, Ints
from cmm_uq.base.units import REFERENCE_TEMPERATURE
from cmm_uq.machine.physics.effects.thermal import EXPANSION, SCALE_EXPANSION

WHITE = "white"


def kinds_along(chain: Ints, white: float, correlations: Sequence[float]) -> list[NoiseKind]:
    """Kinds of noise of readings (m,) in the order of their positions.

    ``chain`` (m,) readings with one number follow each other.
    """
    identity = sparse.csr_array(sparse.eye_array(len(chain)))
    share = (1 - white) / len(correlations)
    return [NoiseKind(WHITE, identity, 0.0, white - TAILS), *(_correlated(phi, chain, share) for phi in correlations)]


def _correlated(phi: float, chain: Ints, probability: float) -> NoiseKind:
    """First-order autoregression along each chain."""
    m, innovation = len(chain), np.sqrt(1 - phi**2)
    follows = np.append(False, chain[1:] == chain[:-1])
    diagonal = np.where(follows, 1 / innovation, 1.0)
    after = np.flatnonzero(follows)
    rows, columns = np.append(np.arange(m), after), np.append(np.arange(m), after - 1)
    values = np.append(diagonal, np.full(len(after), -phi / innovation))
    whitening = sparse.csr_array((values, (rows, columns)), shape=(m, m))
    return NoiseKind("correlated", whitening, float(np.log(diagonal).sum()), probability)


_SIGMAS = 300
_ASSERTED = 0.8  # probability from which an effect is asserted: what one map that is off can imitate is not

# noise of a map: its readings are taken one after the other in one run, while interferometer and air drift
_WHITE, _CORRELATIONS = 0.5, (0.4, 0.6, 0.8, 0.9)


@dataclass(frozen=True, eq=False)
class CandidateCause:
    """An explanation of how the maps of a column differ: over the maps (k,), and over position (p, r) mm."""

    name: Text
    short: Text  # its name beside the column's
    over_maps: Floats
    functions: tuple[Floats, ...]
    map: int | None = None  # is the one that differs, if one does
    effect: str | None = None  # the effect's name, if it is one


@dataclass(frozen=True, eq=False)
class ColumnComparison:
    """One column with the rivals for how its maps differ.

    The observations are the k − 1 orthonormal contrasts between the maps at each position: the function that they share is
    gone, and white noise is white still.
    """

    column: MapColumn  # what is compared
    rivals: tuple[CandidateCause, ...]  # that compete for how the maps differ
    given: tuple[CandidateCause, ...]  # what the job knows of how they differ; of any size
    seed: int  # of the null distribution and the draws

    @cached_property
    def contrasts(self) -> Floats:
        """(k − 1, k) orthonormal."""
        k = len(self.column.values)
        return np.asarray(linalg.null_space(np.ones((1, k))).T, dtype=np.float64)

    @cached_property
    def observed(self) -> Floats:
        """((k − 1)·p,) mm."""
        return np.asarray(self.contrasts @ self.column.values, dtype=np.float64).ravel()

    def seen(self, over_maps: Floats, function: Floats) -> Floats:
        """What the observations show (m, r) of a function (p, r) that counts in each map as ``over_maps`` (k,) says."""
        return np.asarray(np.kron((self.contrasts @ over_maps)[:, None], function), dtype=np.float64)

    @cached_property
    def baseline(self) -> Floats:
        """Where each map starts, where a straightness points, and the expansion that the job names (m, b)."""
        place, maps = self.column.positions - self.column.positions.mean(), np.eye(len(self.column.values))
        columns = [self.seen(one, np.ones((len(place), 1))) for one in maps]
        if self.column.is_straightness:
            columns += [self.seen(one, place[:, None]) for one in maps]
        return np.hstack([*columns, *(self.seen(rival.over_maps, rival.functions[0]) for rival in self.given)])

    @cached_property
    def comparison(self) -> CandidateComparison:
        m, p = len(self.observed), len(self.column.positions)
        rough = roughness(self.column)
        Q = linalg.orth(self.baseline / np.linalg.norm(self.baseline, axis=0).clip(1e-300))
        left = self.observed - Q @ (Q.T @ self.observed)
        sigma = np.geomspace(rough / 10, 4 * max(rough, float(left.std())), _SIGMAS)
        contrast = np.repeat(np.arange(m // p), p)
        noises = kinds_along(contrast, _WHITE, _CORRELATIONS)
        explanations = [
            Explanation(
                rival.name, EFFECT if rival.effect else UNKNOWN,
                tuple(Member(self.seen(rival.over_maps, f), values=f) for f in rival.functions),
            )
            for rival in self.rivals
        ]  # fmt: skip
        # no heavy tails in what is drawn: p-values are corrected for all columns, and few draws do not tell that far a tail
        return CandidateComparison(
            self.observed, self.baseline, [*noises, heavy_tails(left)], sigma, np.full(_SIGMAS, -np.log(_SIGMAS)),
            explanations, np.ones(m), rough, often_heavy=0.0,
        )  # fmt: skip

    @cached_property
    def p_value(self) -> float:
        return lack_of_fit(self.comparison, self.seed)[0]

    @cached_property
    def combinations(self) -> Combinations:
        return explore(self.comparison)

    @cached_property
    def best(self) -> Key:
        probability = self.combinations.probability
        return max(probability, key=lambda key: probability[key])

    @cached_property
    def versions(self) -> tuple[Version, ...]:
        return self.combinations.by_key[self.best].versions

    @cached_property
    def effect(self) -> int | None:
        """Which of the rivals is a probable effect."""
        return next(
            (i for i, rival in enumerate(self.rivals) if rival.effect and self.combinations.of(i) >= _ASSERTED), None
        )

    @cached_property
    def unknown(self) -> tuple[int, ...]:
        """Rivals in the most probable combination that are no effect."""
        return tuple(sorted(i for i in self.best if not self.rivals[i].effect))

    def instead(self, least: float) -> tuple[int, ...]:
        """Rivals at least as probable as this that are not in the most probable combination, the most probable first."""
        others = [i for i in range(len(self.rivals)) if i not in self.best and self.combinations.of(i) >= least]
        return tuple(sorted(others, key=lambda i: -self.combinations.of(i)))

    def columns_of(self, versions: Sequence[Version]) -> tuple[Floats, Floats]:
        """Columns (m, r) of some versions, and the standard deviation of each coefficient over the noise (r,)."""
        explanations = self.comparison.explanations
        columns = [explanations[v.explanation].members[v.member].columns for v in versions]
        spread = [np.full(c.shape[1], v.amplitude) for c, v in zip(columns, versions, strict=True)]
        return np.hstack([np.zeros((len(self.observed), 0)), *columns]), np.concatenate([np.zeros(0), *spread])


def column_comparison(column: MapColumn, named: Sequence[str], seed: int) -> ColumnComparison:
    rivals: list[CandidateCause] = []
    given: list[CandidateCause] = []
    place, temperatures = column.positions, column.temperatures
    functions = tuple(smooth_functions(place))
    changes = float(np.ptp(temperatures)) > 0
    if column.is_scale and changes:
        effect, short = (
            SCALE_EXPANSION[column.axis].name,
            say("{title:small}", title=SCALE_EXPANSION[column.axis].title),
        )
        excess = temperatures - REFERENCE_TEMPERATURE
        expansion = CandidateCause(
            Verbatim(effect), short, excess, (EXPANSION.prior_sd * place[:, None],), effect=effect
        )
        (given if effect in named else rivals).append(expansion)
    if len(temperatures) == 2:
        short = say("difference of the two maps")
        name = say("{error}, difference of the two maps", error=column.title)
        rivals.append(CandidateCause(name, short, np.array([-0.5, 0.5]), functions))
    else:
        if changes:
            share = (temperatures - temperatures.mean()) / np.ptp(temperatures)
            short = say("in proportion to the temperature")
            name = say("{error}, in proportion to the temperature", error=column.title)
            rivals.append(CandidateCause(name, short, share, functions))
        for k, one in enumerate(np.eye(len(temperatures))):
            short = say("in the map at {temperature:g} °C", temperature=temperatures[k])
            name = say("{error} in the map at {temperature:g} °C", error=column.title, temperature=temperatures[k])
            rivals.append(CandidateCause(name, short, one, functions, map=k))
    return ColumnComparison(column, tuple(rivals), tuple(given), seed)
