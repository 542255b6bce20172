"""The machine as its certificate states it, on the day of a part's measurement.

*Modelled* errors are drawn from the joint posterior of the calibration, whole rows of it, so that what the calibration could
not tell apart stays tied together; what it left to the prior alone is drawn with that prior and named by its share of it. An
error that the calibration did not model is drawn with the smaller of what physics allows and of what the calibration's
recording would have shown. Those are drawn on their own: what is stated together in no certificate cannot be drawn together.

Taken is plain data that somebody else has read and verified: ``results.json`` and the draws beside it. Where records of the
machine say how its errors drift, that is drawn with them; where nothing is known of it, the errors are named and taken as they
were, with the age of the certificate.
"""

from __future__ import annotations

from collections.abc import Callable, Container, Iterable, Mapping, Sequence
from datetime import date
from functools import cached_property
from typing import Any

import numpy as np

from cmm_uq.base.errors import CmmUqError, suggestion
from cmm_uq.base.points import Floats, Machine
from cmm_uq.base.units import MICROMETRE
from cmm_uq.base.values import dataclass, field, replace
from cmm_uq.machine.model.field import ALLOWED, PERIODIC, PLAY, bounded, curves, family_of
from cmm_uq.machine.physics.catalogue import effects, every
from cmm_uq.machine.physics.effect import CONTRACT, Effect
from cmm_uq.machine.physics.effects.rotary import OfRotary
from cmm_uq.maths.inference.family_sizes import FieldSizes

POWER_QUANTILE = 1.6449  # of a normal error one in ten, in size, is larger than so many standard deviations
# mechanisms that are no error of the machine on its own; those of the stylus are drawn from its qualification
OTHERWISE = ("artefact", "probe")
_SURROUNDINGS = "temp_"  # what begins the columns of effects that the temperatures of the part's measurement drive
_TIMES = 200  # draws of a slow wander of which its covariance is the mean
# times as probable as what is stated of an axis, beyond which a recording denies it ("strong"), and below which it supports
# it ("positive": Kass, Raftery 1995, J. Am. Stat. Assoc. 90, 3.2)
_DENIED, _SUPPORTED = 20.0, 1 / 3
FREE = 0.5  # share of the prior in a posterior standard deviation from which on the calibration left an error free


@dataclass(frozen=True, eq=False)
class Unmodelled:
    """An error that the calibration did not model."""

    effect: Effect
    sd: Floats  # (k,) standard deviations of its coefficients, in their units
    # size of its (first) reported parameter that the calibration would have found; ``None`` where it would not have, or does
    # not say
    detected: float | None = None
    # what it is taken for where the statement of it is not regarded; ``None`` where there is none
    unstated: Unmodelled | None = None

    @property
    def bounded(self) -> bool:
        """Whether the calibration bounds it more tightly than physics does."""
        return bool(self.sd[0] < self.effect.coefficients[0].prior_sd)

    @property
    def stated_by(self) -> str:
        """The statement of it: its own name of a bound, else the axis, of which it is stated how it is read."""
        bound = self.effect.stated and not self.effect.of_family
        return self.effect.name if bound else str(getattr(self.effect, "axis", ""))


@dataclass(frozen=True)
class StatementEvidence:
    """What a recording says of what is stated of an axis, or of the bound of an error."""

    of: str  # the axis, or the error's name
    # how probable the recording is without the statement, over that with it; not a number where the recording has nothing by
    # which to tell
    ratio: float

    @property
    def denied(self) -> bool:
        return self.ratio > _DENIED

    @property
    def supported(self) -> bool:
        return self.ratio < _SUPPORTED


@dataclass(frozen=True, eq=False)
class StatedNoise:
    """Noise of one coordinate of one point, as the calibration found it: each size a number, or one for each of M draws."""

    coordinate_mm: Floats = field(default_factory=lambda: np.zeros(3))  # (3,) or (M, 3) of each reading along x, y, z
    placing_mm: Floats | float = 0.0  # of what a set-up adds to each of its points, and its repeats share
    # of a slow wander of each coordinate, and the time over which it forgets: infinite of a random walk
    slow_mm: Floats | float = 0.0
    slow_time_s: Floats | float = 600.0
    # of what grows with the distance from the first point that is probed, at the distance ``longest_mm``; where that is zero
    # it is not known, and all of it acts everywhere
    growth_mm: Floats | float = 0.0
    longest_mm: float = 0.0
    # time after which a random walk has the mean square ``slow_mm²`` from its beginning until then
    walked_s: float = 600.0

    @property
    def usual_mm(self) -> Floats:
        """(3,) root mean square of the standard deviation of a reading."""
        return np.asarray(np.sqrt(np.mean(np.atleast_2d(self.coordinate_mm) ** 2, axis=0)))

    def slow_kernel(self, seconds: Floats) -> Floats:
        """(n, n) covariance, mm², of the slow wander at times (n,), the mean over its draws.

        Of a walk only what it has moved since the first of the times matters; its variance grows by 2·slow²/walked.
        """
        sd, time = np.broadcast_arrays(np.atleast_1d(self.slow_mm), np.atleast_1d(self.slow_time_s))
        apart = np.abs(np.subtract.outer(seconds, seconds))
        walks, count = np.isinf(time), len(sd)
        since = seconds - seconds.min(initial=np.inf)
        kernel = 2 * np.sum(sd[walks] ** 2) / self.walked_s * np.minimum.outer(since, since)
        returning = np.flatnonzero(~walks & (sd > 0))
        few = returning[np.linspace(0, len(returning) - 1, min(len(returning), _TIMES)).astype(np.int64)]
        scale = np.sum(sd[returning] ** 2) / max(float(np.sum(sd[few] ** 2)), np.finfo(np.float64).tiny)
        for i in few:
            kernel += scale * sd[i] ** 2 * np.exp(-apart / time[i])
        return np.asarray(kernel / count)


@dataclass(frozen=True, eq=False)
class GivenSizes:
    """What a machine's draws given its recordings follow from, in their order."""

    before: MachineState  # as its certificate states it, with what its recordings allow of what is stated
    sizes: FieldSizes


@dataclass(frozen=True, eq=False)
class MachineState:
    machine: Machine  # its chain, travel and origin
    effects: tuple[Effect, ...]  # that the calibration modelled, in the order of their coefficients
    draws: Floats  # (M, k) of the coefficients together, in their units
    noise: StatedNoise = field(default_factory=StatedNoise)  # of its readings
    # nonlinear parameters of effects that have some
    shapes: Mapping[str, Sequence[float]] = field(default_factory=dict)
    # by effect, part of its posterior standard deviation that is the prior's own: near 1 where the calibration said nothing
    prior_share: Mapping[str, float] = field(default_factory=dict)
    # by effect, the same of what errors of its family are found to be: near 1 where nothing was seen of it but of others
    family_share: Mapping[str, float] = field(default_factory=dict)
    # (M,) sizes of families of errors over what physics allows, where its recording says how large they are
    scales: Mapping[str, Floats] = field(default_factory=dict)
    unmodelled: tuple[Unmodelled, ...] = ()  # errors that it may have besides
    statements: tuple[StatementEvidence, ...] = ()  # what its recording says of what is stated of it
    # (k,) rms change of each coefficient since the calibration
    drift: Floats = field(default_factory=lambda: np.zeros(0))
    corrected: bool = True  # whether the machine corrects errors that were found, so that what remains is about zero
    # (k,) that it then corrects; their means by default
    corrections: Floats = field(default_factory=lambda: np.zeros(0))
    # days of its certificate
    calibrated: date | None = None
    valid_until: date | None = None
    # at its calibration: the errors of its scales are those of that temperature. ``None`` where they are those of 20 °C, or
    # nobody knows
    temperature_c: float | None = None
    measured: date | None = None  # day of the part's measurement
    drift_unknown: tuple[str, ...] = ()  # effects of which nobody knows how they have changed since the calibration
    given: GivenSizes | None = None  # its recordings' part in its draws; ``None`` where these are not at hand

    def __post_init__(self) -> None:
        k = sum(len(effect.coefficients) for effect in self.effects)
        if self.draws.ndim != 2 or self.draws.shape[1] != k or not len(self.draws):
            said = f"draws {self.draws.shape} do not fit {k} coefficients of the machine's errors"
            raise CmmUqError(said, where="the posterior", fix="Give a row a draw, a column a coefficient")
        if not np.isfinite(self.draws).all():
            raise CmmUqError("a draw is no finite number", where="the posterior")
        coordinate = self.noise.coordinate_mm
        if coordinate.shape not in ((3,), (len(self.draws), 3)):
            raise CmmUqError(f"noise {coordinate.shape} does not fit {len(self.draws)} draws", where="the posterior")
        if not len(self.drift):
            object.__setattr__(self, "drift", np.zeros(k))

    @cached_property
    def mean(self) -> Floats:
        """(k,) mean of the modelled coefficients."""
        return np.asarray(self.draws.mean(axis=0))

    @property
    def corrects(self) -> Floats:
        """(k,) coefficients that it corrects."""
        if not self.corrected:
            return np.zeros(self.draws.shape[1])
        return self.corrections if len(self.corrections) else self.mean

    @property
    def age_days(self) -> int | None:
        """Days from its calibration to the part's measurement; ``None`` where one of them is not known."""
        if self.measured is None or self.calibrated is None:
            return None
        return (self.measured - self.calibrated).days

    @property
    def free(self) -> tuple[str, ...]:
        """Effects that the calibration left to their priors."""
        return tuple(effect.name for effect in self.effects if self.prior_share.get(effect.name, 0.0) > FREE)

    @property
    def as_family(self) -> tuple[str, ...]:
        """Effects of which the calibration shows less than of others of their family, whose size they have."""
        free = self.free
        return tuple(name for name, share in self.family_share.items() if share > FREE and name not in free)


def of_machine(effect: Effect) -> bool:
    """Whether an effect is an error of the machine, and not of an artefact or of a probe."""
    return effect.mechanism not in OTHERWISE and not effect.of_artefact


def coefficients_of(effects: Iterable[Effect], reported: Mapping[str, Floats]) -> Floats:
    """Coefficients (M, k) of effects from draws (M,) of their reported parameters by ``effect.parameter``."""
    columns: list[Floats] = []
    for effect in effects:
        if effect.shape:
            raise CmmUqError(f"{effect.name} has the nonlinear parameter {effect.shape[0].name}, which no certificate draws",
                             where="the posterior", fix="Leave the effect out")  # fmt: skip
        names = [parameter.name for parameter in effect.reported]
        for name in names:
            if f"{effect.name}.{name}" not in reported:
                raise CmmUqError(f"has no draws of {effect.name}.{name}", where="the posterior",
                                 fix=suggestion(f"{effect.name}.{name}", reported))  # fmt: skip
        rows = np.column_stack([reported[f"{effect.name}.{name}"] for name in names]).tolist()
        own = [effect.from_reported(dict(zip(names, row, strict=True)))[0] for row in rows]
        columns.append(np.array(own, dtype=np.float64))
    return np.concatenate(columns, axis=1) if columns else np.zeros((1, 0))


def unmodelled_errors(modelled: Iterable[str], detected: Mapping[str, float | None]) -> tuple[Unmodelled, ...]:
    """Common errors of a machine that its calibration did not model.

    ``detected``: by effect, the smallest size of its (first) parameter that its recording would have shown; ``None`` for
    none. An effect that is not there needs what was not recorded, so that nothing was seen of it.
    """
    known, found = set(modelled), []
    for effect in every().values():
        if effect.name in known or effect.tier != CONTRACT or not of_machine(effect) or isinstance(effect, OfRotary):
            continue  # of three straight axes
        if any(column.startswith(_SURROUNDINGS) for column in effect.columns):
            continue
        allowed = np.array([coefficient.prior_sd for coefficient in effect.coefficients])
        size = detected.get(effect.name)
        seen = np.inf if size is None else size / POWER_QUANTILE
        found.append(Unmodelled(effect, np.asarray(allowed * min(1.0, seen / allowed[0])), size))
    return tuple(found)


def at_points(state: MachineState, columns: Container[str]) -> MachineState:
    """The machine at points of a part that have these columns; an effect that goes by others is one that was not modelled.

    A drift with the time of the calibration's day is none of another day, and cannot be drawn where no time is recorded.
    """
    lost = [effect for effect in state.effects if any(name not in columns for name in effect.columns)]
    lost = [effect for effect in lost if not any(name.startswith(_SURROUNDINGS) for name in effect.columns)]
    if not lost:
        return state
    owner = np.array([i for i, effect in enumerate(state.effects) for _ in effect.coefficients])
    away = np.array([effect in lost for effect in state.effects])
    kept = ~away[owner]
    sizes = [state.draws[:, owner == i].std(axis=0) for i in np.flatnonzero(away)]
    more = tuple(Unmodelled(effect, sd) for effect, sd in zip(lost, sizes, strict=True))
    others = tuple(effect for effect in state.effects if effect not in lost)
    corrections = state.corrections[kept] if len(state.corrections) else state.corrections
    left = replace(state, effects=others, draws=state.draws[:, kept], drift=state.drift[kept], corrections=corrections)
    return replace(left, unmodelled=(*state.unmodelled, *more))


def with_curves(state: MachineState) -> MachineState:
    """With the smooth functions of the axes in place of their simplest forms among the errors that were not modelled."""
    plain = tuple(one for one in state.unmodelled if family_of(one.effect) not in ALLOWED)
    every = (Unmodelled(one, np.array([c.prior_sd for c in one.coefficients])) for one in curves())
    return replace(state, unmodelled=(*plain, *every))


def with_bounds(state: MachineState, largest_um: Mapping[str, float]) -> MachineState:
    """With errors that were not modelled as large as somebody states, by name, µm; what was modelled is known by that."""
    known = {one.effect.name for one in state.unmodelled}
    may = sorted(one.name for one in every().values() if family_of(one) in (PLAY, PERIODIC))
    for name in largest_um:
        if name not in may and name in every():
            said = f"{name} is neither play nor a periodic error"
            raise CmmUqError(said, where=BOUNDS, fix=f"Bound {', '.join(may)}")
        if name not in may:
            raise CmmUqError(f"there is no error {name!r}", where=BOUNDS, fix=suggestion(name, may))
        if name not in known:
            problem = f"the calibration estimates {name}, which no bound says better"
            raise CmmUqError(problem, where=BOUNDS, fix="Leave the bound out")
    found = []
    for one in state.unmodelled:
        if (largest := largest_um.get(one.effect.name)) is not None:
            effect = bounded(one.effect, largest)
            one = replace(one, effect=effect, sd=np.array([c.prior_sd for c in effect.coefficients]), unstated=one)
        found.append(one)
    return replace(state, unmodelled=tuple(found))


def stated_as(one: Unmodelled, effect: Effect) -> Unmodelled:
    """An error as it is stated how its axis is read, in place of what physics allows."""
    stated = np.array([c.prior_sd for c in effect.coefficients])
    return Unmodelled(effect, np.minimum(stated, one.sd) if one.bounded else stated, one.detected, one)


def noise_of_draws(reported: Mapping[str, Floats]) -> StatedNoise:
    """The noise in draws (M,) of a posterior by ``noise.…_um``; along each axis where these were told apart."""
    one = reported.get("noise.coordinate_um")
    if one is None:
        return StatedNoise()
    axes = [np.asarray(reported.get(f"noise.{axis}_um", one)) for axis in "xyz"]
    placing, slow, growth = (
        MICROMETRE * np.asarray(reported.get(f"noise.{name}_um", np.zeros(1))) for name in ("placing", "slow", "growth")
    )
    return StatedNoise(MICROMETRE * np.column_stack(axes), placing, slow, growth_mm=growth)


_WHERE, BOUNDS = "the machine's results.json", "job.toml [[machine_state.bound]]"


def machine_stated(
    results: Mapping[str, Any], draws: Mapping[str, Floats], machine: Machine, *, corrected: bool
) -> MachineState:
    """The machine as a certificate states it.

    ``results``: the data of ``results.json``. ``draws``: (M,) of its posterior, by name. ``corrected``: whether it corrects
    what was found.
    """
    if "estimates" not in results or "identifiability" not in results:
        fix = "Give a certificate whose analysis names errors: of a ballbar, step gauge, plate, sphere, …"
        raise CmmUqError("states no errors of a machine", where=_WHERE, fix=fix)
    modelled = list(results["estimates"])
    # faults of the artefact, and of the probe that calibrated, are not those of this measurement
    found = tuple(effect for effect in effects(modelled, where=_WHERE) if of_machine(effect))
    shares: dict[str, float] = {}
    for name, share in results["identifiability"].get("prior_share", {}).items():
        effect = name.partition(".")[0]
        if effect in modelled and share is not None:
            shares[effect] = max(shares.get(effect, 0.0), float(share))
    detected = {row["effect"]: row["detected"] for row in results.get("diagnosis", {}).get("unseen", [])}
    day = results.get("job", {}).get("date")
    return MachineState(
        machine, found, coefficients_of(found, draws), noise_of_draws(draws), prior_share=shares,
        unmodelled=unmodelled_errors(modelled, detected), corrected=corrected,
        calibrated=date.fromisoformat(day) if day else None,
    )  # fmt: skip


# root mean square change of a reported parameter (``scale_x.ppm``), in its unit, by so many days after the calibration;
# ``None`` where nothing is known of it.
Change = Callable[[str, float], float | None]


def aged(state: MachineState, on: date, change: Change | None = None) -> MachineState:
    """The state of a machine on a day.

    ``state``: as its certificate states it. Errors that it did not model are drawn as large as they may be on any day.
    ``change``: by the records; ``None`` where there are none.
    """
    days = 0 if state.calibrated is None else abs((on - state.calibrated).days)
    sizes, unknown = list[Floats](), list[str]()
    for effect in state.effects:
        found = changes(effect, days, change)
        sizes.append(np.array([0.0 if one is None else one for one in found]))
        if None in found and (days or state.calibrated is None):
            unknown.append(effect.name)
    drift = np.concatenate([np.zeros(0), *sizes])
    return replace(state, drift=drift, drift_unknown=tuple(unknown), measured=on)


def changes(effect: Effect, days: float, change: Change | None) -> list[float | None]:
    """Root mean square change of each coefficient within so many days; of a phase that of its amplitude."""
    if change is None:
        return [None] * len(effect.coefficients)
    reported = [one.name for one in effect.reported]
    own = [one.name if one.name in reported else reported[0] for one in effect.coefficients]
    return [change(f"{effect.name}.{name}", float(days)) for name in own]
