"""How large an effect must be for the diagnosis to find it, and to call it by its name.

Recordings are drawn on the plan's design, without slow noise and tails, and the search's own statistic decides. *Detected*:
the lack-of-fit test rejects. *Named*: besides, the true effect alone is so much more probable than any other and than none
that no other is said to be as possible. (Baarda 1968, Teunissen 2018: minimal detectable and identifiable bias.)
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from functools import cached_property

import numpy as np
import scipy
from numpy.typing import NDArray

from cmm_uq.analysis.diagnosis.comparison.combinations import CombinationPrior
from cmm_uq.analysis.diagnosis.comparison.evidence import CandidateComparison
from cmm_uq.analysis.diagnosis.comparison.explanations import EFFECT, UNKNOWN, Explanation
from cmm_uq.analysis.diagnosis.comparison.lack_of_fit import DRAWS, draw_nothing, log_prior, statistic_of
from cmm_uq.analysis.diagnosis.comparison.search import NOT_TOLD_APART, model_comparison
from cmm_uq.base.points import Floats, Ints
from cmm_uq.base.units import Unit
from cmm_uq.base.values import dataclass, replace
from cmm_uq.machine.model import Noise, RecordingModel
from cmm_uq.machine.model.kind import Observed
from cmm_uq.machine.physics.effect import Effect
from cmm_uq.maths.inference.noise import Components, Sizes
from cmm_uq.maths.inference.slow import root

POWER = 0.8
# Sizes of an effect that are tried: its rms in all observations together, what is fitted projected out, over the noise
SIZES = np.array([3.0, 3.7, 4.4, 5.1, 6.0, 7.5, 12.0, 30.0])
_LARGER = np.array([1.0, 1.3])  # noise as it looks, over what it is, at which the threshold of the test is found
_TAIL = 0.2
# Log odds of an effect against everything else from which on no other is said to be as possible
CERTAIN = float(np.log(0.95 / 0.05))
_TOGETHER = 5  # effects whose recordings are judged together
_UNASKED = -1e300  # margin at a size that is smaller than what is asked
_ROUNDING = 1e-6  # of a margin
ALLOWED = 3.0  # prior standard deviations up to which an effect is reckoned with


@dataclass(frozen=True, eq=False)
class Power:
    effect: str
    parameter: str  # parameter, unit: its (first) parameter
    unit: Unit
    allowed: float  # largest amplitude that physics allows, in its unit
    per_unit: float  # size, as in SIZES, of an effect of one unit; 0 where nothing of it shows
    # detected_at, named_at: (d,) size from which on each drawn recording is alarmed, and named rightly; may be infinite.
    # Of recordings in which less than the quantile asked for does, at most
    detected_at: Floats
    named_at: Floats

    def detected(self, amplitude: float) -> float:
        """Probability that an effect of this amplitude, in its unit, is detected."""
        return float(np.mean(self.detected_at <= abs(amplitude) * self.per_unit))

    def named(self, amplitude: float) -> float:
        return float(np.mean(self.named_at <= abs(amplitude) * self.per_unit))

    @property
    def detectable(self) -> float | None:
        """Amplitude detected with a probability of 80 %; ``None`` where none that physics allows is."""
        return self._amplitude(self.detected_at)

    @property
    def identifiable(self) -> float | None:
        """Amplitude named rightly with a probability of 80 %."""
        return self._amplitude(self.named_at)

    def _amplitude(self, at: Floats) -> float | None:
        size = float(np.quantile(at, POWER, method="higher"))
        return size / self.per_unit if size <= self.allowed * self.per_unit else None


@dataclass(frozen=True, eq=False)
class DrawnNoise:
    """Noise of the observations of a recording, m of them, in one set of sizes."""

    components: Components  # components, sizes: of the noise
    sizes: Sizes
    noise_scale: Floats  # (m,)

    def draws(self, random: np.random.Generator, count: int) -> Floats:
        """(m, count) over the noise scale and the noise of a reading."""
        drawn = self.components.repeated(self.sizes, count, random)[0]
        return np.asarray(drawn.T / self.noise_scale[:, None] / self.sizes.coordinate[0])

    def covariance(self, column: Floats) -> Floats:
        """The covariance of :meth:`draws` times a column (m, 1)."""
        scale = 1 / self.noise_scale[:, None] / self.sizes.coordinate[0]
        variances = self.components.variances(self.sizes)[0][0] @ self.components.shares.T
        turn = self.components.turn
        return np.asarray(scale * (turn.T @ (variances[:, None] * (turn @ (scale * column)))))


def without_fault(observe: Observed, model: RecordingModel, noise: Noise, seed: int) -> RecordingModel:
    """The same model of a recording drawn with nothing left out, in the set-ups of its own."""
    artefact = model.artefact
    random = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(8,)))
    sizes = np.array([size.nominal for size in artefact.sizes])
    xyz = model.simulate(np.zeros(len(model.unknowns) - len(sizes)), sizes, noise, random)
    return replace(model, artefact=observe(artefact.points.at(xyz)))


def powers(
    model: RecordingModel, effects: Sequence[Effect], *, stated: float | None, sigma: float, alpha: float, seed: int,
    draws: int = 20, noise: DrawnNoise | None = None, quantile: float = POWER,
) -> Iterator[Power]:  # fmt: skip
    """Of the diagnosis for effects that the model does not name; ``stated``, ``sigma`` of a coordinate, claimed, true, mm.

    Sizes are exact from a ``quantile`` of the recordings on, which spares those that a smaller one would need.
    """
    compared = model_comparison(model, stated, 0)
    rule = _Rule(compared.comparison, sigma, alpha, noise, compared.null)
    points = model.artefact.points.at(model.placed(compared.values))
    never = np.full(draws, np.inf)
    for begin in range(0, len(effects), _TOGETHER):
        sizes: list[tuple[str, str, Unit, float, float]] = []
        tried: list[tuple[Floats, Floats, int]] = []
        for effect in effects[begin : begin + _TOGETHER]:
            column = model.seen(effect.basis(points)[:, :, :1], compared.values) / rule.comparison.noise_scale[:, None]
            shown = rule.comparison.rest(column)
            length, first, index = float(np.linalg.norm(shown)), effect.coefficients[0], rule.index(effect.name)
            allowed = ALLOWED * first.prior_sd
            shows = length * allowed >= SIZES[0] * sigma and index is not None
            sizes.append((effect.name, effect.reported[0].name, first.unit, allowed, length / sigma if shows else 0.0))
            if shows and index is not None:
                tried.append((rule.noise(shown / length, seed, draws), shown / length, index))
        found = iter(rule.reached(tried, quantile))
        for each in sizes:
            yield Power(*each, *(next(found) if each[-1] else (never, never)))


def _reached(margin: Floats) -> Floats:
    """Size (d,) from which on the margin (sizes, d) stays positive; linear in the size's square between those tried."""
    squares, found = SIZES**2, np.full(margin.shape[1], np.inf)
    for column, values in enumerate(margin.T):
        below = np.flatnonzero(values <= 0)
        last = int(below[-1]) if len(below) else -1
        if last < 0:
            found[column] = SIZES[0]
        elif last < len(SIZES) - 1:
            part = -values[last] / (values[last + 1] - values[last])
            found[column] = float(np.sqrt(squares[last] + part * (squares[last + 1] - squares[last])))
    return found


@dataclass(frozen=True, eq=False)
class Naming:
    explanations: Sequence[Explanation]

    @cached_property
    def priors(self) -> Floats:
        """(c,) log probability, beforehand, of each explanation alone among combinations; minus infinity for several."""
        prior = CombinationPrior(self.explanations)
        return np.array([prior.log([i]) for i in range(len(self.explanations))])

    def __call__(self, odds: Floats, true: Ints) -> Floats:
        """By how much (b,) the true ones (b,) pass what would let others stand beside them; ``odds`` (c, b) log evidence."""
        weight = odds + self.priors[:, None]
        kinds = np.array([explanation.kind for explanation in self.explanations])
        nothing = np.full((1, odds.shape[1]), CombinationPrior(self.explanations).log([]))
        none = scipy.special.logsumexp(np.vstack([nothing, weight[kinds == UNKNOWN]]), axis=0)
        own = np.take_along_axis(weight, true[None], axis=0)[0]
        np.put_along_axis(weight, true[None], -np.inf, axis=0)
        others = weight[kinds == EFFECT]
        other = others.max(axis=0, initial=-np.inf)
        asserted = own - np.maximum(none, other)
        without_rival = np.minimum(asserted, own - other + np.log(NOT_TOLD_APART))
        all_but_certain = own - scipy.special.logsumexp(np.vstack([none, others]), axis=0) - CERTAIN
        return np.asarray(np.maximum(without_rival, all_but_certain))


@dataclass(frozen=True, eq=False)
class _Rule:
    """The search's rule on data (m, b), mm, of which the baseline has been taken."""

    comparison: CandidateComparison
    sigma: float
    alpha: float
    coloured: DrawnNoise | None
    null: Floats  # (draws,) statistic under nothing, of the draws that the thresholds are of

    @cached_property
    def _thresholds(self) -> Floats:
        """(2,) statistic at which the test rejects when the noise, which a fault enlarges, looks :data:`_LARGER` times it."""
        random = np.random.default_rng(np.random.SeedSequence(0, spawn_key=(2,)))
        draws, found = draw_nothing(self.comparison, random, DRAWS), []
        for statistic in (self.null, statistic_of(self.comparison, _LARGER[1] * draws)[0]):
            start = float(np.quantile(statistic, 1 - _TAIL))
            beyond = float((statistic[statistic > start] - start).mean())
            found.append(start + beyond * float(np.log(_TAIL / self.alpha)))
        return np.array(found)

    def threshold(self, data: Floats) -> Floats:
        """(b,) statistic at which the test rejects for data (m, b)."""
        comparison = self.comparison
        squares = np.append(np.sum(data**2, axis=0), float(comparison.left @ comparison.left))
        log = comparison.log_sigma - comparison.degrees_of_freedom * np.log(comparison.sigma)
        fitting = comparison.sigma[(log - 0.5 * squares[:, None] / comparison.sigma**2).argmax(axis=1)]
        ratio = fitting[:-1] / fitting[-1]
        return np.asarray(np.interp(ratio, _LARGER, self._thresholds), dtype=np.float64)

    def noise(self, direction: Floats, seed: int, draws: int) -> Floats:
        """(m, draws) less what the baseline takes, in units of a reading's; along ``direction`` (m, 1) spread evenly."""
        random = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(9,)))
        drawn, along = random.standard_normal((len(direction), draws)), direction
        if self.coloured is not None:
            drawn, along = self.coloured.draws(random, draws), self.comparison.rest(self.coloured.covariance(direction))
        white = self.comparison.rest(drawn)
        even = scipy.special.ndtri((random.permutation(draws) + 0.5) / draws)
        variance = float((direction.T @ along).item())
        white = white + along / variance * (np.sqrt(variance) * even - direction.T @ white)
        certified = self.comparison.certified
        if certified.size:
            white = white + self.comparison.rest(certified @ random.standard_normal((certified.shape[1], draws)))
        return np.asarray(white, dtype=np.float64)

    def index(self, name: str) -> int | None:
        """Of an effect among the rivals; ``None`` where it is not one, or invisible."""
        visible, rivals = self.comparison.visible, enumerate(self.comparison.explanations)
        return next((i for i, e in rivals if e.name == name and e.kind == EFFECT and i in visible), None)

    def reached(self, tried: Sequence[tuple[Floats, Floats, int]], quantile: float) -> Iterator[tuple[Floats, Floats]]:
        """Sizes (d,) from which on recordings are alarmed, and named, of noise (m, d), a direction (m, 1) and its effect each.

        From the largest size down, to where a recording is not, or no more than a quantile of an effect's are.
        """
        if not tried:
            return
        noise, direction = (np.hstack(each) for each in ([n for n, *_ in tried], [s for _, s, _ in tried]))
        count = tried[0][0].shape[1]
        margins = _Margins(self, noise, np.repeat(direction, count, axis=1), np.repeat([i for *_, i in tried], count))
        alarmed = named = np.ones(len(margins.true), dtype=bool)
        for row in reversed(range(len(SIZES))):
            alarmed, named = (
                np.ravel(passed & (passed.sum(axis=1, keepdims=True) > np.ceil(quantile * (count - 1))))
                for each in margins.passed(row, alarmed, named)
                for passed in [each.reshape(-1, count)]
            )
            named = named & alarmed
            if not np.any(alarmed):
                break
        found = margins.alarm, np.minimum(margins.alarm, margins.name)
        yield from zip(*(np.split(_reached(each), len(tried)) for each in found), strict=True)


class _Margins:
    """By how much recordings (b,) are alarmed and named, (sizes, b) each; exactly where one ends to be.

    The log odds of something are no less than those of some explanations one by one, and a name has no more to pass than
    some others: what does not decide is not looked at.
    """

    def __init__(self, rule: _Rule, noise: Floats, direction: Floats, true: Ints) -> None:
        self.rule, self.noise, self.direction, self.true = rule, noise, direction, true
        explanations, shape = rule.comparison.explanations, (len(SIZES), len(true))
        self.alarm, self.name = np.full((2, *shape), _UNASKED)
        self._bound, self._whole = np.zeros((2, *shape), dtype=bool)  # alarm is a bound; all explanations are known
        # log evidence of nothing, and of explanations (sizes, c, b) as far as it is known
        self._nothing, self._something = np.zeros(shape), np.full((len(SIZES), len(explanations), len(true)), -np.inf)
        self._naming, self._prior = Naming(explanations), log_prior(explanations)

    def passed(self, row: int, alarmed: NDArray[np.bool_], named: NDArray[np.bool_]) -> Iterator[NDArray[np.bool_]]:
        """Which of those that are alarmed at the next larger size are at this one, and which of those that are named."""
        largest, nothing, something = row + 1 == len(SIZES), self._nothing[row], self._something[row]
        for i, rival in self._rivals:
            for one in (i, rival) if largest else (i,):
                self._weigh(row, alarmed & (self.true == i), {one})
        if largest:
            named = self._naming(something - nothing, self.true) > -_ROUNDING
        self._weigh(row, named)
        odds = something - nothing
        self.name[row, named] = self._naming(odds[:, named], self.true[named])
        shown = scipy.special.logsumexp(self._prior[:, None] + odds[:, alarmed], axis=0)
        self.alarm[row, alarmed] = shown - self.rule.threshold(self._data(row, alarmed))
        self._bound[row] = alarmed
        self._settle(row, alarmed & (self.alarm[row] <= _ROUNDING))
        now = alarmed & (self.alarm[row] > 0), named & (np.minimum(self.alarm, self.name)[row] > 0)
        if not largest:
            self._settle(row + 1, (alarmed & ~now[0]) | (named & ~now[1] & (self.alarm < self.name)[row + 1]))
        yield from now

    def _settle(self, row: int, which: NDArray[np.bool_]) -> None:
        """The alarm's margins themselves, where they are bounds."""
        which = which & self._bound[row]
        if np.any(which):
            self._weigh(row, which & ~self._whole[row])
            data, single = self._data(row, which), (self._nothing[row, which], self._something[row][:, which])
            found = statistic_of(self.rule.comparison, data, single)[0] - self.rule.threshold(data)
            self.alarm[row, which], self._bound[row, which] = found, False

    def _weigh(self, row: int, which: NDArray[np.bool_], among: set[int] | None = None) -> None:
        if np.any(which):
            self._nothing[row, which], found = self.rule.comparison.log_evidence(self._data(row, which), (), among)
            self._something[row][:, which] = np.maximum(self._something[row][:, which], found)
            self._whole[row] |= which & (among is None)

    @cached_property
    def _rivals(self) -> list[tuple[int, int]]:
        """Effects that act, each with the effect that looks most like it."""
        true, first = np.unique(self.true, return_index=True)
        like = self.rule.comparison.log_evidence(self.rule.sigma * SIZES[-1] * self.direction[:, first])[1]
        kinds = np.array([one.kind for one in self.rule.comparison.explanations])
        like[kinds != EFFECT] = like[true, np.arange(len(true))] = -np.inf
        return list(zip(true.tolist(), (like + self._prior[:, None]).argmax(axis=0).tolist(), strict=True))

    def _data(self, row: int, which: NDArray[np.bool_]) -> Floats:
        return np.asarray(self.rule.sigma * (self.noise[:, which] + SIZES[row] * self.direction[:, which]))


# Visible lengths within which one is looked for; beyond the last nothing is said to be found
SHORTEST, LONGEST = 1.0, 60.0
_NOISES = 7
_Z = np.linspace(-5.0, 5.0, 101)


@dataclass(frozen=True, eq=False)
class Thresholds:
    """What an effect must pass, in terms of z; see :mod:`cmm_uq.analysis.diagnosis.smallest`."""

    detected: float  # z from which on the test rejects
    named: Floats  # z (r,) from which on it exceeds each of its closest rivals, on average; infinite where never
    cosines: Floats  # (r,) with these
    known: float  # degrees of freedom of what was known of σ beforehand
    left: int  # degrees of freedom of the residuals

    @property
    def noises(self) -> Floats:
        """(q,) s/σ at evenly probable sizes of the residuals at right angles to the effect."""
        count = max(self.left - 1, 1)
        squares = scipy.special.chdtri(count, 1 - (np.arange(_NOISES) + 0.5) / _NOISES)
        return np.asarray(np.sqrt((self.known + squares) / (self.known + count)))

    def detects(self, length: Floats) -> Floats:
        """Probability (d,) that the test rejects, for visible lengths (d,)."""
        gate = self.detected * self.noises[:, None]
        return np.asarray((scipy.special.ndtr(length - gate) + scipy.special.ndtr(-length - gate)).mean(axis=0))

    def names(self, length: Floats) -> Floats:
        """Probability (d,) that it is called by its name."""
        if not np.all(np.isfinite(self.named)):
            return np.zeros(len(length))
        z = length[:, None] + _Z  # (d, z)
        noises = self.noises[:, None, None]
        passed = (np.abs(z) > self.detected * noises).astype(np.float64)
        for named, cosine in zip(self.named, self.cosines, strict=True):
            beside = 1 - cosine**2
            room = z**2 - beside * (named * noises) ** 2  # what is left of it for the rival's own z²
            rival, spread = np.sqrt(np.maximum(room, 0.0)), np.sqrt(beside)
            upper, lower = (scipy.special.ndtr((end - cosine * z) / spread) for end in (rival, -rival))
            passed *= np.where(room > 0, upper - lower, 0.0)
        density = np.exp(-0.5 * _Z**2)
        return np.asarray(passed.mean(axis=0) @ density / density.sum())

    def length_detected(self, power: float) -> float:
        return _length_of(self.detects, power)

    def length_named(self, power: float) -> float:
        """Visible length named with this probability; infinite where none is."""
        return _length_of(self.names, power)


def _length_of(probability: Callable[[Floats], Floats], power: float) -> float:
    """Length at which a probability that grows with it reaches a power; infinite beyond the longest."""

    def short(length: float) -> float:
        return float(probability(np.array([length]))[0]) - power

    if short(LONGEST) < 0:
        return float(np.inf)
    return root(short, SHORTEST, LONGEST, 1e-10) if short(SHORTEST) < 0 else SHORTEST
