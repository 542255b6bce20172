"""Virtual measurements of a part: errors of its characteristics, drawn with every cause at once.

The error is what is measured less what is true: of the nominal part, or, where a form is known on the whole surface, of the
part with the form that was drawn. A characteristic that was measured as y is then y less the errors.

Of measured points what is true is drawn (:meth:`AtPose.errors`), which matters where a characteristic is not linear: a zone
is never negative, and what adds to its width does so whatever its sign.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from cmm_uq.messages import Text
from cmm_uq.parts.causes import Cause, Drawn, Scatter
from cmm_uq.parts.characteristics import is_of_points
from cmm_uq.parts.evaluating import Evaluator, Known, characteristics_of
from cmm_uq.parts.machine import MachineState
from cmm_uq.parts.of_form import FORM, Form, forms, whole_surfaces
from cmm_uq.parts.of_machine import mean_errors, modelled, noise, not_modelled
from cmm_uq.parts.of_operator import Beside
from cmm_uq.parts.of_stylus import styli
from cmm_uq.parts.of_temperature import Surroundings, mean_expansion, temperatures
from cmm_uq.parts.placing import Pose, placed
from cmm_uq.parts.plan import Plan
from cmm_uq.parts.qualifying import Qualified
from cmm_uq.points import Floats
from cmm_uq.uncertainty.monte_carlo import Simulated, Source, from_source, settled_source

CHECKED = 200
"""Draws that are looked at exactly, beside first order."""

FEWEST = 100_000
"""Virtual measurements, after which u is known to a quarter of a percent."""

ROUNDING = 1e-9
"""mm and rad: a spread below which is none."""

THREADED = 2_000
"""Draws of a block that are worth a thread."""

AGREES = 0.01
"""Of u, by which first order may be off before all is taken exactly: what u is good for."""


@dataclass(frozen=True, eq=False)
class Circumstances:
    """How and where a part is measured.

    Parameters
    ----------
    machine : as its certificate states it.
    poses : where the part lies; several where nobody knows, each as likely.
    surroundings : temperatures.
    forms : what is known of the form of its features.
    repeats : of each point, of whose readings the mean is taken.
    further : causes of another kind, of the plan's points.
    measured : (n, 3) points of the part as they were measured, in its frame, mm, about which errors are then drawn: a position
        that is off errs as a distance does. The nominal points without them, and of a part whose
        whole surfaces are drawn.
    """

    machine: MachineState
    poses: tuple[Pose, ...] = (Pose(),)
    surroundings: Surroundings = field(default_factory=Surroundings)
    forms: tuple[Form, ...] = ()
    repeats: int = 1
    further: tuple[Cause, ...] = ()
    measured: Floats | None = None


class AtPose:
    """Virtual measurements of a part in one place.

    Parameters
    ----------
    plan : of the measurement.
    given : its circumstances.
    pose : the place.
    known : features that were looked at in another place (:class:`Evaluator`).

    Raises
    ------
    CmmUqError : see :class:`Evaluator`, and an axis beyond its travel.
    """

    def __init__(self, plan: Plan, given: Circumstances, pose: Pose, known: Known | None = None) -> None:
        surroundings = given.surroundings.since(given.machine.temperature_c)
        self.points = points = placed(plan, pose, given.machine.machine, surroundings.columns)
        qualified = Qualified.on(plan, points, given.machine.machine)
        unmodelled, self.lacking = not_modelled(given.machine, qualified, pose)
        own, on_surface = forms(given.forms, plan)
        self.causes: list[Cause] = [
            modelled(given.machine, qualified, pose),
            *unmodelled,
            *noise(given.machine, points, pose, given.repeats, int(plan.order[0]) if len(plan.order) else 0),
            *styli(plan, pose),
            *temperatures(surroundings, plan, points, pose),
            *given.further,
            *own,
        ]
        base = mean_errors(given.machine, qualified, pose) + mean_expansion(surroundings, plan, points, pose)
        drawn = any(len(feature.surface) for feature in plan.features)
        # what was measured has the mean errors in it: the part itself is without them
        self.part = part = plan.points if drawn or given.measured is None else given.measured - base
        self.still = characteristics_of(plan, part, known)
        self.apart = np.zeros(len(plan.characteristics), dtype=bool)
        if given.measured is not None and not drawn:
            self.apart = np.array([not is_of_points(one, plan) for one in plan.characteristics], dtype=bool)
        self.measured = Evaluator(_some(plan, ~self.apart), base + part - plan.points, self.causes, known)
        self.likely: Evaluator | None = None
        if self.apart.any():
            self.likely = Evaluator(_some(plan, self.apart), part - plan.points, self.causes, known)
            self.found = characteristics_of(self.likely.plan, part + base, known)
        self.true: Evaluator | None = None
        if drawn:
            true = whole_surfaces(plan)
            still: list[Cause | None] = [None] * (len(self.causes) - len(own))
            self.true = Evaluator(true, np.zeros_like(true.points), [*still, *on_surface], known)

    def drawn(self, random: np.random.Generator, n: int) -> list[Drawn]:
        """Coefficients (n, K) of each cause."""
        return [cause.draw(random, n) for cause in self.causes]

    def errors(self, coefficients: Sequence[Drawn], *, exact: bool = False) -> Floats:
        """(n, c) errors of the characteristics.

        Where points were measured as x, mean errors b are taken off: q = x − b. A range of
        points (:func:`is_of_points`) has many freedoms of its own, the form, which errors d only ever enlarge: it errs by
        f(x + d) − f(q). Everything else has few, a direction and a place, of which any is as likely before: it is f(q − s)
        with the errors s that points have in common, less by how much their own errors n enlarge it, f(q − s + n) − f(q − s).
        What is linear is the same by both.
        """
        found = np.zeros((len(coefficients[0]), len(self.apart)))
        if not self.apart.all():
            true = self.still[~self.apart] if self.true is None else self.true(coefficients, exact=exact)
            found[:, ~self.apart] = self.measured(coefficients, exact=exact) - true
        if self.likely is not None:
            found[:, self.apart] = self.found - self._true(self.likely, coefficients, exact=exact)
        for cause, drawn in zip(self.causes, coefficients, strict=True):
            if isinstance(cause, Beside):
                found += np.asarray(drawn) @ cause.adds
        return found

    def _true(self, likely: Evaluator, coefficients: Sequence[Drawn], *, exact: bool) -> Floats:
        """What is true of all but ranges of points, about what was measured."""
        each = [isinstance(cause, Scatter) or cause.name == FORM for cause in self.causes]
        common = [None if own else drawn for drawn, own in zip(coefficients, each, strict=True)]
        alone = [drawn if own else None for drawn, own in zip(coefficients, each, strict=True)]
        less = -likely.displaced(common, exact=exact)
        read = less + likely.displaced(alone, exact=exact)
        return np.asarray(2 * likely.of(less, exact=exact) - likely.of(read, exact=exact))

    def off(self, seed: int = 0, count: int = CHECKED) -> Floats:
        """(c,) root mean square difference of first order from exact errors, of their standard deviation."""
        drawn = self.drawn(np.random.default_rng(seed), count)
        exact = self.errors(drawn, exact=True)
        apart = self.errors(drawn) - exact
        spread = np.maximum(exact.std(axis=0), ROUNDING)
        return np.asarray(np.sqrt(np.mean(apart**2, axis=0)) / spread)


def _some(plan: Plan, chosen: NDArray[np.bool_]) -> Plan:
    """The plan with some of its characteristics."""
    kept = (one for one, own in zip(plan.characteristics, chosen, strict=True) if own)
    return replace(plan, characteristics=tuple(kept))


class Virtual:
    """Virtual measurements of a part in all of its places, to be drawn in blocks.

    Parameters
    ----------
    plan, given : of the measurement, and its circumstances.
    known : features that were looked at before (:class:`Evaluator`).

    Attributes
    ----------
    known : those, and its own.
    places : one a pose.
    exact : whether nothing is taken to first order, because that is off by more than a hundredth of an uncertainty.
    off : (c,) by how much first order is off in the first place, of the standard deviation.
    """

    def __init__(self, plan: Plan, given: Circumstances, known: Known | None = None) -> None:
        self.plan = plan
        self.known: Known = {} if known is None else known
        self.places = [AtPose(plan, given, pose, self.known) for pose in given.poses]
        self.off = self.places[0].off()
        self.exact = bool(np.any(self.off > AGREES))

    @property
    def names(self) -> list[str]:
        """Of the characteristics."""
        return [one.name for one in self.plan.characteristics]

    def errors(self, random: np.random.Generator, n: int) -> Floats:
        """(n, c) errors, each place as often as the others."""
        if n < 2 * THREADED:
            return self._drawn(random, n)
        halves = n // 2, n - n // 2  # of streams of their own: the same numbers on any number of cores
        with ThreadPoolExecutor(len(halves)) as threads:
            return np.concatenate(list(threads.map(self._drawn, random.spawn(len(halves)), halves)))

    def _drawn(self, random: np.random.Generator, n: int) -> Floats:
        counts = np.full(len(self.places), n // len(self.places))
        counts[random.permutation(len(counts))[: n - counts.sum()]] += 1
        found = [
            place.errors(place.drawn(random, int(count)), exact=self.exact)
            for place, count in zip(self.places, counts, strict=True)
            if count
        ]
        return np.concatenate(found)

    @cached_property
    def named(self) -> Mapping[str, Text]:
        """By factor, why it should be told beside the result."""
        return {name: why for cause in self.places[0].causes for name, why in cause.named.items()}

    @property
    def source(self) -> Source:
        """The errors as outputs of a Monte Carlo."""
        return Source(self.names, lambda random, n: np.ascontiguousarray(self.errors(random, n).T))

    def simulated(self, trials: int, coverage: float = 0.95, seed: int = 0) -> Simulated:
        """So many virtual measurements: means, covariance, intervals of the errors."""
        return from_source(self.source, trials, coverage, seed)

    def settled(self, coverage: float = 0.95, digits: int = 2, seed: int = 0) -> Simulated:
        """As many as the digits of u that are asked for need (JCGM 101, 7.9), a hundred thousand at least."""
        return settled_source(self.source, coverage, digits, seed, fewest_trials=FEWEST)
