"""Noise as a sum of named components, of unknown sizes: what each does to the observations, and what is known beforehand.

    covariance = Tᵀ · diag(v) · T + S · diag(s) · Sᵀ,   v = shares · variances

T turns the observations once into coordinates in which all components but slow noise are independent: along the machine's
axes, where a point has several observations, and to the mean and the contrasts of repeats. So many observations have one
variance that sums over them are made once, whatever the sizes.

Each size but the first is a ratio to the reading noise, with a probability that the component is absent. It is a function of
a standard normal number, zero up to the quantile of that probability, so that a sampler in those numbers weighs presence
and absence without changing dimension.

Why the priors: an axis rarely scatters more than three times as much as another; a set-up offset and slow noise are as
large as the reading noise within some factor, but may be ten times as large (a half-Cauchy distribution forgives that, a
half-normal one does not: its intervals hold too seldom, Gelman 2006, Bayesian Analysis 1(3)); slow noise may change within
a few readings or hardly during the recording, and no rate between is preferred; as probably it has no mean that it comes back
to, but walks on from where it was at the first reading.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property

import numpy as np
import scipy

from cmm_uq.base.points import Floats, Ints
from cmm_uq.base.values import dataclass, field, replace

AXES, PLACING, GROWTH, SLOW = "axes", "placing", "growth", "slow"
ABSENT = {AXES: 0.5, PLACING: 0.5, GROWTH: 0.8, SLOW: 0.6}  # probability, beforehand, that a component is absent
# scale (half-normal) of the spread of the logarithms of the axes' noise, where they differ. Two contrasts of them, normal
# with that spread, are then exponentially distributed as far as their distance from zero goes (∫ 2·φ(s)·exp(−r²/2s²) ds =
# exp(−r)), and that distance and a direction are sampled: what is known well of two numbers is no curved ridge in three.
AXES_SPREAD = 0.7
# scale (half-Cauchy) of a component's standard deviation over that of a reading
RATIO = dict.fromkeys((PLACING, GROWTH, SLOW), 1.0)
LARGEST_RATIO = 300.0
# cosines of slow noise that one observation may see, of all axes together, where it is quick and where it is not
FREQUENCIES, FEWER = 72, 24
NEGLIGIBLE = 0.05  # variance of what is faster than the cosines, over that of a reading, that counts as independent
FASTEST = 200.0  # largest rate of slow noise, over the duration of the recording
# probability, beforehand, that slow noise is a random walk; its rate is then zero. A process that returns to its mean within
# the recording, of which a walk of few readings cannot be told, leaves a constant behind that is up to four times too small.
WALK = 0.5
_CONTRASTS = np.array([[2.0, -1.0, -1.0], [0.0, 1.0, -1.0]]).T / np.sqrt([6.0, 2.0])
_FARTHEST = 5.0  # largest logarithm of an axis' noise over the mean of all
_MOST_CLASSES, _STEPS = 48, 20
# columns of ``shares``: reading noise along x, y, z; what repeats share; growing noise; what each observation has alone
_VARIANCES, GROWING = 6, 4


@dataclass(frozen=True, eq=False)
class Sizes:
    """Sizes of the components in each of w draws, mm."""

    reading: Floats  # (w, 3) standard deviation of a reading along each axis
    placing: Floats  # (w,) of a set-up offset
    growth: Floats  # (w,) of the growing part, at the longest length
    slow: Floats  # (w,) of slow noise, root mean square over the recording
    rate: Floats  # (w,) at which it returns to its mean, over one by the recording's duration; 0 of a random walk

    @property
    def coordinate(self) -> Floats:
        """(w,) root mean square of the axes' reading noise."""
        return np.asarray(np.sqrt(np.mean(self.reading**2, axis=1)), dtype=np.float64)

    @property
    def typical(self) -> Sizes:
        """A single draw of median sizes; what is more probably absent than not is absent."""
        return Sizes(*(np.median(part, axis=0, keepdims=True) for part in vars(self).values()))

    @property
    def different(self) -> tuple[Ints, Ints]:
        """The first (u,) of each of the different draws, and which of those each draw (w,) is."""
        table = np.column_stack(list(vars(self).values()))
        _, first, index = np.unique(table, axis=0, return_index=True, return_inverse=True)
        return np.asarray(first), np.asarray(index.ravel())

    def at(self, chosen: Ints | slice) -> Sizes:
        return Sizes(*(part[chosen] for part in vars(self).values()))


@dataclass(frozen=True, eq=False)
class Components:
    turn: scipy.sparse.csr_array  # (m, m) T, orthonormal
    shares: Floats  # (m, 6) of each variance in that of each turned observation
    slow: Floats  # (m, 3·…) columns S of the unturned observations, (m, 0) where no time is recorded
    frequency: Floats  # of each of those columns, in half turns over the recording; 0 is a constant
    possible: tuple[str, ...]  # which components could show here
    stated: float | None = None  # standard uncertainty of a coordinate, mm, as the job states it
    gap: float = 0.0  # typical time between neighbouring readings, over the duration of the recording
    display: float = 0.0  # step in which coordinates are displayed, mm; 0 where it is too fine to matter
    time: Floats = field(
        default_factory=lambda: np.zeros(0)
    )  # (m,) of the unturned observations, 0 to 1; (0,) where unknown
    known: float = 0.0  # what is not known of a coordinate in any case, mm: the reading noise is not taken for less
    names: tuple[str, ...] = field(init=False)

    def __post_init__(self) -> None:
        latent = {AXES: ("spread", "first", "second"), PLACING: (PLACING,), GROWTH: (GROWTH,), SLOW: (SLOW, "rate")}
        names = ["log_sigma", *(name for component in self.possible for name in latent[component])]
        object.__setattr__(self, "names", tuple(names))

    @property
    def _rounding(self) -> float:
        """Standard deviation of what the display rounds off, mm."""
        return self.display / float(np.sqrt(12))

    @property
    def least(self) -> float:
        """Reading noise, mm, below which a smaller one would show no other readings, or is not believed."""
        return max(self.display / 20, self.known)

    @property
    def dimension(self) -> int:
        return len(self.names)

    def sizes(self, latent: Floats) -> Sizes:
        """Sizes in each of w rows of ``latent`` (w, d).

        First ln of how far neighbouring readings scatter about each other, mm, then standard normal numbers. Slow noise that
        changes from reading to reading is then told from reading noise by what the recording knows of it, not by σ.
        """
        column = {name: latent[:, i] for i, name in enumerate(self.names)}
        sigma, nothing = np.exp(column["log_sigma"] - self.log_scatter(latent)), np.zeros(len(latent))
        reading = np.repeat(sigma[:, None], 3, axis=1)
        if AXES in self.possible:
            radius = -AXES_SPREAD * np.log1p(-_present(column["spread"], ABSENT[AXES]))
            way = np.column_stack([column["first"], column["second"]])
            way = way / np.maximum(np.linalg.norm(way, axis=1, keepdims=True), 1e-300)
            apart = radius[:, None] * (way @ _CONTRASTS.T)
            most = np.abs(apart).max(axis=1, keepdims=True)
            each = np.exp(apart * np.minimum(1.0, _FARTHEST / np.maximum(most, 1e-9)))
            reading = reading * each / np.sqrt(np.mean(each**2, axis=1, keepdims=True))
        apparent = np.hypot(sigma, self._rounding)
        placing, growth, slow = (
            apparent * _half_cauchy(column[name], name) if name in self.possible else nothing
            for name in (PLACING, GROWTH, SLOW)
        )
        rate = _rate(column["rate"]) if SLOW in self.possible else 1 + nothing
        return Sizes(reading, placing, growth, slow, rate)

    def log_scatter(self, latent: Floats) -> Floats:
        """Logarithm (w,) of the standard deviation of neighbouring readings about each other, over √2 of that of a reading."""
        column = {name: latent[:, i] for i, name in enumerate(self.names)}
        square = np.ones(len(latent))
        if SLOW in self.possible:
            rate = _rate(column["rate"])
            changed = np.where(rate > 0, -np.expm1(-self.gap * rate), self.gap)
            square += changed * _half_cauchy(column[SLOW], SLOW) ** 2
        if GROWTH in self.possible:
            # typical variance of the growing part over that at the longest length
            typical = float(np.mean(self.shares[:, GROWING] / self.shares[:, :3].sum(axis=1)))
            square += typical * _half_cauchy(column[GROWTH], GROWTH) ** 2
        return np.asarray(0.5 * np.log(square))

    def variances(self, sizes: Sizes) -> tuple[Floats, Floats]:
        """Six variances (w, 6), mm², that ``shares`` refers to, and those of the slow columns (w, c)."""
        slow, fast = slow_variances(sizes.slow, sizes.rate, self.frequency)
        shared = display_shared(sizes.coordinate, self.display)
        alone = self.display**2 / 12 - shared
        each = [*(sizes.reading.T**2), sizes.placing**2 + shared, sizes.growth**2, fast + alone]
        return np.column_stack(each), slow

    @property
    def most(self) -> int:
        """Fastest of the cosines, in half turns over the recording."""
        return int(self.frequency.max(initial=0.0))

    def slowest(self, most: int) -> Components:
        kept = self.frequency <= most
        return replace(self, slow=self.slow[:, kept], frequency=self.frequency[kept])

    @property
    def fewer(self) -> Components:
        """With as many cosines as do where slow noise is not quick."""
        return self.slowest(FEWER * self.most // FREQUENCIES) if self.most > FEWER else self

    @cached_property
    def tied(self) -> Floats:
        """(c, c) what ties the coefficients of a random walk, over the variance that its constants have besides.

        The walk is zero at the first reading: of each axis the constant is −√2 times the sum of the cosines' coefficients.
        """
        c, constant = len(self.frequency), self.frequency == 0
        tie = np.where(constant[:, None], 1.0, np.sqrt(2.0)) * (self._axis[:, None] == np.arange(np.sum(constant)))
        return np.asarray(tie @ tie.T - np.diag(constant.astype(np.float64))) if c else np.zeros((0, 0))

    @cached_property
    def _axis(self) -> Ints:
        """(c,) number of the constant that stands before each cosine."""
        return np.asarray(np.cumsum(self.frequency == 0) - 1)

    @cached_property
    def anchored(self) -> Floats:
        """Columns (m, c) of a random walk: cosines less what they are at the first reading."""
        constants = self.slow[:, self.frequency == 0]
        return np.asarray(self.slow - np.sqrt(2.0) * np.where(self.frequency == 0, 0.0, constants[:, self._axis]))

    def waves(self, sizes: Sizes) -> Floats:
        """Columns (m, c), mm, of slow noise as far as the cosines go, with standard normal coefficients."""
        columns = self.slow if sizes.rate[0] else self.anchored
        return np.asarray(columns * np.sqrt(self.variances(sizes)[1][0]))

    def slow_along(self, weights: Floats, sizes: Sizes) -> Floats:
        """Variance (w,), mm², of slow noise in a weighted sum (m,) of the observations, as far as the cosines go."""
        slow, walks = self.variances(sizes)[1], sizes.rate == 0
        found = slow @ (self.slow.T @ weights) ** 2
        return np.where(walks, slow @ (self.anchored.T @ weights) ** 2, found) if np.any(walks) else found

    def quick(self, sizes: Sizes) -> Floats:
        """(w,) part that is faster than the cosines of what no other reading shares."""
        fast = slow_variances(sizes.slow, sizes.rate, self.frequency)[1]
        return np.asarray(fast / (fast + sizes.coordinate**2 + self._rounding**2))

    def exact(self, sizes: Sizes) -> Floats:
        """Columns (m, c) with standard normal coefficients, mm, whose covariance is all of that of slow noise of one draw."""
        times, index = np.unique(self.time, return_inverse=True)
        rate = sizes.rate[0]
        covariance = np.exp(-rate * np.abs(times[:, None] - times)) if rate else 2 * np.minimum(times[:, None], times)
        factor = sizes.slow[0] * np.linalg.cholesky(covariance + 1e-12 * np.eye(len(times)))
        seen = self.slow[:, self.frequency == 0]
        return np.hstack([each[:, None] * factor[index.ravel()] for each in seen.T])

    def log_prior(self, latent: Floats, sizes: Sizes) -> Floats:
        """(w,) of the standard normal numbers; that of a coordinate has a uniform logarithm, or is near what is stated."""
        known = self.log_prior_of_sigma(np.log(np.hypot(sizes.coordinate, self._rounding)))
        return np.asarray(known - 0.5 * np.sum(latent[:, 1:] ** 2, axis=1))

    def log_prior_of_sigma(self, log_sigma: Floats) -> Floats:
        """A stated value is good to a fifth (as if from a dozen readings), or now and then simply wrong."""
        if self.stated is None:
            return np.zeros_like(log_sigma)
        off = log_sigma - np.log(self.stated)
        near = np.log(0.9 / 0.2) - 0.5 * (off / 0.2) ** 2
        return np.asarray(np.logaddexp(near, np.log(0.1) - 0.5 * off**2))

    def repeated(self, sizes: Sizes, repetitions: int, random: np.random.Generator) -> Floats:
        """Noise (w, repetitions, m), mm, of the recording made anew with these sizes."""
        variances, slow = self.variances(sizes)
        w, m = len(variances), len(self.shares)
        scale = np.sqrt(variances @ self.shares.T)
        found = random.standard_normal((w, repetitions, m))
        found *= scale[:, None, :]
        # T may leave all as it is: every quantity read once, seen along one axis or by several points
        if self.turn.nnz != m or np.any(self.turn.data != 1) or np.any(self.turn.indices != np.arange(m)):
            found = np.asarray((self.turn.T @ found.reshape(-1, m).T).T, dtype=np.float64).reshape(found.shape)
        if self.slow.shape[1] and np.any(slow):
            waves = np.sqrt(slow)[:, None, :] * random.standard_normal((w, repetitions, slow.shape[1]))
            walks = sizes.rate == 0
            for chosen, columns in ((~walks, self.slow), (walks, self.anchored)):
                if np.any(chosen):
                    found[chosen] += waves[chosen] @ columns.T
        return found

    def white(self, sizes: Sizes) -> Callable[[Floats], Floats]:
        """What turns columns (m, r), mm, of such noise into white noise with the standard deviation of a reading."""
        variances, _ = self.variances(sizes)
        scale = float(sizes.coordinate[0]) / np.sqrt((variances @ self.shares.T)[0])[:, None]
        waves = scale * np.asarray(self.turn @ self.waves(sizes)) / float(sizes.coordinate[0])
        U, s, _ = np.linalg.svd(waves, full_matrices=False)

        def whitened(columns: Floats) -> Floats:
            each = scale * np.asarray(self.turn @ columns)
            # (1 + A·Aᵀ) to the power of −½, by the singular values of A
            return np.asarray(each + U @ ((1 / np.sqrt(1 + s**2) - 1)[:, None] * (U.T @ each)))

        return whitened

    @cached_property
    def classes(self) -> tuple[Ints, Floats]:
        """Class of each turned observation (m,), and the shares (c, 6) of each class.

        Where nearly every observation has a direction of its own, those of nearly one direction are a class; its shares are
        the mean of theirs.
        """
        exact = np.round(self.shares, 9)
        _, index, count = np.unique(exact, axis=0, return_inverse=True, return_counts=True)
        if len(count) > _MOST_CLASSES:
            total = self.shares[:, :3].sum(axis=1, keepdims=True)
            rough = np.round(np.hstack([_STEPS * self.shares / total, _STEPS * np.log(total)]))
            _, index, count = np.unique(rough, axis=0, return_inverse=True, return_counts=True)
        index = index.ravel()
        shares = np.zeros((len(count), _VARIANCES))
        np.add.at(shares, index, self.shares)
        return index, shares / count[:, None]


def slow_variances(sd: Floats, rate: Floats, frequency: Floats) -> tuple[Floats, Floats]:
    """Variances (w, c) of the cosines of slow noise, and of what is faster than the fastest of them (w,).

    An Ornstein–Uhlenbeck process of standard deviation ``sd`` (w,) and ``rate`` (w,), over the duration, has the spectral
    density 2·rate·sd²/(rate² + ω²), of which Σ over all half turns is coth(rate) − 1/rate; the constant has the rest of sd².

    A random walk (rate 0) of variance 2·sd²·t at the time t has 2·sd²/ω² (its steps are those of the process at the rate 1,
    its mean square over the recording is sd²). Its constant, beside that which ties it to zero at the first reading
    (:attr:`Components.tied`), has what the cosines left out are there.
    """
    if not len(frequency):
        return np.zeros((len(sd), 0)), np.zeros_like(sd)
    once, every = np.unique(frequency, return_inverse=True)
    rate, constant = rate[:, None], once == 0
    square = (np.pi * once) ** 2
    with np.errstate(divide="ignore", invalid="ignore"):
        cosine = np.where(rate > 0, 2 * rate / (rate**2 + square), 2 / square)
        mean = 1 - 1 / np.tanh(rate) + 1 / rate
    each = np.where(constant, 0.0, cosine)
    walked = 1 / 3 - each.sum(axis=1, keepdims=True)  # Σ 2/(πk)² = 1/3
    each = np.where(constant, np.where(rate > 0, mean, 2 * walked), each)
    fast = np.where(rate > 0, 1 - each.sum(axis=1, keepdims=True), walked)[:, 0]
    return (sd[:, None] ** 2 * each)[:, every.ravel()], sd**2 * np.maximum(fast, 0.0)


def display_shared(sigma: Floats, step: float) -> Floats:
    """Variance (w,), mm², of the rounding to a display's steps that repeats of one quantity share.

    Rounding errs by Σ (−1)ᵏ·step/(π·k)·sin(2π·k·y/step) of the reading y, a Fourier series. Where y lies on the grid is not
    known, and σ is the scatter of y about what repeats have in common: of each wave's variance the share exp(−(2π·k·σ/step)²)
    is common. Together with what is not, all are step²/12 (Widrow, Kollár 2008, Quantization Noise).
    """
    if not step:
        return np.zeros_like(sigma)
    k = np.arange(1.0, 200.0)
    waves = np.exp(-((2 * np.pi * k * sigma[:, None] / step) ** 2)) / (2 * (np.pi * k) ** 2)
    return np.asarray(step**2 * waves.sum(axis=1))


def _rate(latent: Floats) -> Floats:
    """Standard normal numbers as rates, in units of one over the duration: zero, or of uniform logarithm."""
    part = (scipy.special.ndtr(latent) - WALK) / (1 - WALK)
    return np.where(part > 0, np.exp(part * np.log(FASTEST)), 0.0)


def _present(latent: Floats, absent: float) -> Floats:
    """Standard normal numbers as probabilities within what is left when the component is absent, 0 where it is."""
    return np.asarray(np.clip((scipy.special.ndtr(latent) - absent) / (1 - absent), 0.0, 1 - 1e-9))


def _half_cauchy(latent: Floats, name: str) -> Floats:
    ratio = RATIO[name] * np.tan(0.5 * np.pi * _present(latent, ABSENT[name]))
    return np.asarray(np.minimum(ratio, LARGEST_RATIO))
