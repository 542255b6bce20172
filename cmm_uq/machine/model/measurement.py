"""Effects, an artefact and a recording, joined into one model.

Forward: an artefact of given sizes stands where the recording says, and the machine's errors turn its true points into
indicated ones. Inverse: the difference between recorded and predicted points, seen along the directions in which the
artefact speaks, is linear in the parameters, and least squares iterates on it (Gauss–Newton). The design is taken at the
points of the *artefact*: with recorded lengths the columns of the three scale errors would add up to the observation
itself; with the artefact's own they add up to the column of its length, and an uncalibrated bar shows its free scale as an
exact null space.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.points import Floats
from cmm_uq.base.units import ARCSECOND, Unit
from cmm_uq.base.values import dataclass, field, replace
from cmm_uq.machine.model.artefact import Artefact
from cmm_uq.machine.model.recorded import Noise
from cmm_uq.machine.physics.effect import Effect
from cmm_uq.machine.physics.kinematics import SQUARENESSES
from cmm_uq.machine.physics.superposition import About, Superposition
from cmm_uq.maths.inference.curvature import bend, bent
from cmm_uq.maths.inference.linear_model import Freedoms, LeastSquares, LinearModel, Unknown, likeliest, solve
from cmm_uq.maths.inference.noise import Components
from cmm_uq.maths.inference.posterior import NoisyPosterior

ARTEFACT = "artefact"  # first part of the key of a size of the artefact
_NO_MACHINE = 1000.0  # mm
_SMALLEST_NOISE = 1e-6  # mm
SMALL_LEAN = 100 * ARCSECOND  # rad: squares and products of angles up to this are 0.25 ppm.
# rad: an axis that leans so is another one; least squares gets there where a recording does not show the angle
_NO_LEAN = 1.0
IMPLAUSIBLE = 4.0  # standard deviations of what was known beforehand from which on an estimate contradicts it
_MOVED = 10 * ARCSECOND  # rad: about an angle this far away a model is as linear
_NO_SQUARENESS = 0.1  # rad: a squareness of which no more is known than this, six degrees, is not determined
# condition up to which a design, in typical sizes of the parameters, is not made of the noise of the placings
_ILL_CONDITIONED = 1e3
_ROUNDS = 20
_SETTLED = 1e-4  # typical sizes of a parameter
_SIZE_SCALE = 0.1  # mm, a typical deviation of an artefact from its nominal size; only scales columns


@dataclass(frozen=True, eq=False)
class Estimate:
    """Least squares at convergence, and the linear model about it."""

    least_squares: LeastSquares  # the estimate
    linear: LinearModel  # the model, linear about ``about``, whose posterior may be sampled
    about: Floats  # (k,) the estimate; or, where the recording leaves an angle to its prior, the likeliest parameters


@dataclass(frozen=True, eq=False)
class RecordingModel:
    """Effects acting on the points of an artefact."""

    artefact: Artefact  # with its recording
    effects: tuple[Effect, ...]  # what acts; a fault of the artefact is taken as that of this one
    # standard uncertainty of one recorded coordinate, mm; ``None`` when it is to be estimated
    sigma: float | None = None
    # (m,) which observations to use; all by default
    used: NDArray[np.bool_] = field(default_factory=lambda: np.zeros(0, dtype=bool))
    # nonlinear parameters, held, of the effects that have some, by the effect's name
    shapes: Mapping[str, Sequence[float]] = field(default_factory=dict)
    # a model of the same recording with effects more, where these turn out to be so large that they bend it: the linear model
    # is then taken about the estimate of that one
    within: RecordingModel | None = None
    # mm, what is not known of a coordinate however little the residuals scatter, as of a prediction that the recording is
    # compared with
    least_noise: float = 0.0
    _abouts: dict[bytes, About] = field(default_factory=dict, init=False)
    _placed: dict[bytes, Floats] = field(default_factory=dict, init=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "effects", tuple(self.artefact.acting(effect) for effect in self.effects))
        if not len(self.used):
            object.__setattr__(self, "used", np.ones(len(self.artefact.noise_scale), dtype=bool))
        for effect in self.effects:
            if effect.shape and effect.name not in self.shapes:
                shape = effect.shape[0].name
                problem = f"{effect.name} has the nonlinear parameter {shape}, which a report does not estimate"
                raise CmmUqError(problem, where="job.toml [model] effects", fix="Leave it out")

    @property
    def unknowns(self) -> tuple[Unknown, ...]:
        coefficients = tuple(
            Unknown((effect.name, c.name), c.unit, 0.0, c.prior_sd, c.prior_sd)
            for effect in self.effects
            for c in effect.coefficients
        )
        sizes = tuple(
            Unknown((ARTEFACT, size.name), size.unit, size.nominal, size.sd, _SIZE_SCALE, size.certified)
            for size in self.artefact.sizes
        )
        return coefficients + sizes

    def reported(
        self, draws: Floats, owners: Collection[str] | None = None
    ) -> dict[tuple[str, str], tuple[Floats, Unit]]:
        """Draws (N,), and unit, of every parameter as it is reported, then of the artefact's sizes, by key.

        ``draws``: (N, k) of the unknowns. ``owners``: effects that are asked for; by default all, and the artefact. What
        shapes an effect is held: neither it nor a phase, which goes with it, is reported.
        """
        found, column = dict[tuple[str, str], tuple[Floats, Unit]](), 0
        for effect in self.effects:
            own = draws[:, column : column + len(effect.coefficients)]
            column += len(effect.coefficients)
            if owners is not None and effect.name not in owners:
                continue
            shape = np.tile(np.array(self.shapes.get(effect.name, ()), dtype=np.float64), (len(own), 1))
            units = {parameter.name: parameter.unit for parameter in effect.reported}
            held = {shaped.name for shaped in effect.shape} | ({"phase_rad"} if effect.shape else set())
            each = effect.to_reported(own, shape).items()
            found |= {(effect.name, name): (values, units[name]) for name, values in each if name not in held}
        sizes = self.artefact.sizes if owners is None or ARTEFACT in owners else ()
        for size, values in zip(sizes, draws[:, column : column + len(sizes)].T, strict=True):
            found[ARTEFACT, size.name] = values, size.unit
        return found

    def using(self, used: NDArray[np.bool_] | None = None) -> RecordingModel:
        """Of some of the observations, by default of all; itself where these are its own, with what is known of it already."""
        used = np.ones_like(self.used) if used is None else used
        return self if np.array_equal(used, self.used) else replace(self, used=used)

    def errors(self, xyz: Floats, coefficients: Floats) -> Floats:
        """Errors e (n, 3), mm, of points indicated at ``xyz``."""
        points = self.artefact.points.at(xyz)
        return points.on_artefact(self._acting.errors(points, coefficients)[:, :, None])[:, :, 0]

    def indicated(self, true_xyz: Floats, coefficients: Floats) -> Floats:
        """What the machine indicates at true points (n, 3): solves indicated + e(indicated) = true to below 0.01 nm."""
        indicated = true_xyz.copy()
        for _ in range(12):
            change = true_xyz - self.errors(indicated, coefficients) - indicated
            indicated += change
            largest = np.abs(change).max(initial=0.0)
            if largest < 1e-8:
                break
            if not largest < _NO_MACHINE:
                raise CmmUqError(
                    f"errors that would explain this recording exceed {_NO_MACHINE:g} mm: they are no machine's",
                    where="the recording",
                    fix="Look for a wrong unit, exchanged columns or points of different places",
                )
        return indicated

    def predicted(self, values: Floats) -> Floats:
        """Indicated points (n, 3) that parameters (k,) predict for this recording's placings, without noise."""
        return self.indicated(self.placed(values), self._split(values)[0])

    def estimate(self) -> Estimate:
        """Iterate least squares until the estimates stand still."""
        return self._estimate

    @cached_property
    def _estimate(self) -> Estimate:
        if self.within is not None:
            whole, keys = self.within.estimate(), [unknown.key for unknown in self.within.unknowns]
            own = [keys.index(unknown.key) for unknown in self.unknowns]
            linear = whole.linear.only(own)
            return Estimate(self._solved(linear), linear, whole.about[own])
        most: int | None = None
        while True:
            try:
                return self._iterated(most)
            except (CmmUqError, np.linalg.LinAlgError):
                first = self._solved(self.linearised(self._beginning), most)
                if first.condition <= _ILL_CONDITIONED or first.rank == 1:
                    raise
                most = first.rank - 1  # what the recording hardly shows led the iteration away from all machines

    @property
    def _beginning(self) -> Floats:
        """Parameters (k,) as known beforehand, on axes that lean as those on which the observations were found."""
        values, open_ = np.array([u.prior_mean for u in self.unknowns]), np.array(self.artefact.leans)
        for column, effect in self._acting.leaning if open_.any() else ():
            lean, plane = effect.lean(self.artefact.points), SQUARENESSES.index(str(effect.plane))
            if np.ndim(lean) == 0:
                values[column], open_[plane] = open_[plane] / lean, 0.0
        return values

    def _iterated(self, most: int | None) -> Estimate:
        values = self._beginning
        for _ in range(10):
            linear = self.linearised(values)
            result = self._solved(linear, most)
            scale = np.array([u.scale for u in self.unknowns])
            change = np.abs(result.value - values) / scale
            values = result.value
            if change.max(initial=0.0) < 1e-9 or self.leans_beyond(values, np.zeros_like(values), _NO_LEAN):
                break  # nothing but noise says how an angle stands: another step would go farther still
        linear = replace(linear, unknowns=self._widened(result))
        about = self._likeliest(linear, values, result)
        return Estimate(result, linear if about is values else self._anew(linear, about), about)

    def _widened(self, found: LeastSquares) -> tuple[Unknown, ...]:
        """The unknowns; a lean that the recording shows far beyond its prior has one as wide as itself instead.

        Three axes that lean by twenty of their normal priors would outweigh a recording of some sixty points: a noise of
        millimetres would be likelier than these angles. What is left is the normal prior whose scale the lean itself sets,
        likeliest of all scales, and it moves the estimate by the square of its relative uncertainty.
        """
        leans = np.append(self._acting.leans, np.zeros(len(self.artefact.sizes), dtype=bool)) & found.determined
        sizes = np.abs(found.value)
        wide = leans & (
            sizes - IMPLAUSIBLE * found.spread > IMPLAUSIBLE * np.array([u.prior_sd for u in self.unknowns])
        )
        return tuple(
            replace(one, prior_sd=float(size)) if far else one
            for one, far, size in zip(self.unknowns, wide, sizes, strict=True)
        )

    def _anew(self, linear: LinearModel, about: Floats) -> LinearModel:
        return replace(self.linearised(about), unknowns=linear.unknowns)

    def _solved(self, linear: LinearModel, most: int | None = None) -> LeastSquares:
        """Least squares, without angles that the recording would show only if its placings were known without noise.

        The squarenesses YZ and ZX of a plate that lies flat move it along its own plane by what the noise of its attitude
        makes of them: their estimates would be radians, about which nothing is linear.
        """
        found, still = solve(linear, most), np.zeros(len(linear.unknowns))
        while found.condition > _ILL_CONDITIONED and found.rank > 1:
            if not self.leans_beyond(still, found.spread, _NO_SQUARENESS):
                break
            found = solve(linear, found.rank - 1)
        known = np.array([unknown.prior_sd for unknown in linear.unknowns])
        while self._acting.bends and found.rank > 1 and np.any(found.spread > IMPLAUSIBLE * known):
            found = solve(linear, found.rank - 1)  # of rows of an arm that the poses tell apart by noise alone
        return found

    def _likeliest(self, linear: LinearModel, values: Floats, found: LeastSquares) -> Floats:
        """Where the posterior is to be linear: the estimate, unless priors know angles much better than the recording does."""
        sigma, still = max(found.sigma_of_residuals, _SMALLEST_NOISE), np.zeros_like(values)
        bends, scale = self._acting.bends, np.array([unknown.scale for unknown in self.unknowns])
        if not (bends or self.leans_beyond(values, still, SMALL_LEAN)):
            return values
        for _ in range(_ROUNDS):
            nearer = likeliest(linear, sigma)
            settled = not bends or np.abs((nearer - values) / scale).max() < _SETTLED
            if settled and not self.leans_beyond(nearer - values, still, _MOVED):
                break
            values, linear = nearer, self._anew(linear, nearer)
        return values

    def linearised(self, values: Floats) -> LinearModel:
        """The model about parameters (k,): ``observed`` is what they leave unexplained plus what they explain."""
        artefact, used = self.artefact, self.used
        true, unexplained = self._unexplained(values)
        change = self._acting.derivatives(self._about(values))
        design = np.hstack([-artefact.project(true, artefact.points.on_artefact(change)), artefact.size_change()])
        return LinearModel(
            (unexplained + design @ values)[used], design[used], self.unknowns,
            Freedoms.of(artefact.placing(true)).at(used), artefact.noise_scale[used], self.sigma,
        )  # fmt: skip

    def remainder(self, about: Estimate, values: Floats) -> Floats:
        """What parameters (k,) explain of the used observations, (m,) mm, beyond the linear model of an estimate."""
        linear = about.linear
        return linear.observed - linear.design @ values - self._unexplained(values)[1][self.used]

    def _unexplained(self, values: Floats) -> tuple[Floats, Floats]:
        """Where the artefact's points are, (n, 3), and what parameters (k,) leave unexplained, (m,), mm."""
        true = self.placed(values)
        missing = self.artefact.points.xyz - self.indicated(true, self._split(values)[0])
        return true, self.artefact.project(true, missing[:, :, None])[:, 0]

    def seen(self, displacement: Floats, values: Floats) -> Floats:
        """What used observations show, (m, k) in mm, of an error e of the points (n, 3, k) that ``values`` do not contain."""
        shown = self.artefact.points.on_artefact(displacement)
        return -self.artefact.project(self.where(values), shown)[self.used]

    def where(self, values: Floats) -> Floats:
        """Points (n, 3), mm, about which the model is linear at ``values``."""
        model, about = (self, values) if self.within is None else (self.within, self.within.estimate().about)
        return model.artefact.without_noise(model.placed(about))

    def columns(self, effect: Effect, shape: Sequence[float], values: Floats) -> Floats:
        """Errors e of the points, (n, 3, j) in mm, for one unit of each coefficient of one effect beside the model's own."""
        return self.about(values).columns(effect, shape)

    def about(self, values: Floats) -> About:
        """Where the model is linear at ``values``, for errors beside its own too."""
        model, about = (self, values) if self.within is None else (self.within, self.within.estimate().about)
        return model._about(about)

    def _about(self, values: Floats) -> About:
        key = values.tobytes()
        if key not in self._abouts:
            self._abouts.clear()
            points = self.artefact.points.at(self.artefact.without_noise(self.placed(values)))
            self._abouts[key] = self._acting.about(points, self._split(values)[0])
        return self._abouts[key]

    def placed(self, values: Floats) -> Floats:
        """Points (n, 3), mm, of the artefact where parameters (k,) say that the recording found it."""
        key = values.tobytes()
        if key not in self._placed:
            (coefficients, sizes), xyz = self._split(values), self.artefact.points.xyz
            self._placed.clear()
            self._placed[key] = self.artefact.fit(xyz + self.errors(xyz, coefficients), sizes)
            self._placed[key].flags.writeable = False
        return self._placed[key]

    def residuals(self, values: Floats) -> Floats:
        """Unexplained part of every observation, used or not, (m,) mm."""
        xyz = self.artefact.points.xyz
        predicted = self.predicted(values)
        return self.artefact.project(predicted, (xyz - predicted)[:, :, None])[:, 0]

    def simulate(self, coefficients: Floats, sizes: Floats, noise: Noise, random: np.random.Generator) -> Floats:
        """Indicated points (n, 3), mm, of a recording with the placings of this one, errors and noise drawn anew.

        ``coefficients``: (k,) of the effects, in order. ``sizes``: (s,) true sizes of the artefact, mm.
        """
        exact = self.predicted(np.concatenate([coefficients, sizes]))
        points = self.artefact.points
        drawn = points.on_artefact(noise.drawn(points, random)[:, :, None])[:, :, 0]
        return noise.displayed(exact + drawn)

    def leans_beyond(self, values: Floats, sd: Floats, limit: float) -> bool:
        """Whether an angle between two axes may differ from 90° by more than ``limit``, rad, within four ``sd`` (k,)."""
        return self._acting.largest_lean(self.artefact.points, self._split(np.abs(values) + 4 * sd)[0]) > limit

    @property
    def _acting(self) -> Superposition:
        return Superposition(self.effects, self.shapes)

    def _split(self, values: Floats) -> tuple[Floats, Floats]:
        k = len(values) - len(self.artefact.sizes)
        return values[:k], values[k:]


def with_curvature(model: RecordingModel, components: Components, posterior: NoisyPosterior) -> NoisyPosterior:
    """The posterior of the model itself; that of the linear model about its estimate where it bends too little."""
    estimate = model.estimate()
    if not model.leans_beyond(estimate.about, posterior.draws.std(axis=0), SMALL_LEAN):
        return posterior
    typical = posterior.sizes.typical
    white = components.white(typical)

    def remainder(values: Floats) -> Floats:
        return white(model.remainder(estimate, values)[:, None])[:, 0]

    return bent(
        posterior, bend(estimate.linear.uncorrelated(white), estimate.about, float(typical.coordinate[0]), remainder)
    )
