"""What would make the uncertainty of a part's characteristics smaller, each way tried by virtual measurements of its own."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from itertools import product

import numpy as np

from cmm_uq.analysis.parts.causes.machine import NOISE
from cmm_uq.analysis.parts.causes.surroundings import FIXTURE, OPERATOR
from cmm_uq.analysis.parts.plan import PartPose, Plan
from cmm_uq.analysis.parts.virtual import AtPose, MeasurementConditions, Virtual, in_parts, thinned
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.messages import Text, Verbatim, say, signed
from cmm_uq.base.points import Floats
from cmm_uq.base.values import dataclass, replace

WAY_DRAWS = 10_000  # of each way; u is then known to 0.7 %.
_THINNED = 0.05  # of u: nine ways of one plan differed by 0 to 7 % from those by all 8000 points of its feature
_LOOKED_AT = 1000  # draws by which places on the table are compared
_PILOT = 2_000  # of those by which a measurement is turned round, the same for every way
# causes that another set-up draws again; machine, styli, temperatures and the part stay what they are
ANEW = (NOISE, OPERATOR, FIXTURE)
_HALF_TURN = np.diag([-1.0, -1.0, 1.0])
_QUARTER_TURN = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
# the plan with twice the points in every feature, and its circumstances
Doubled = Callable[[], tuple[Plan, MeasurementConditions]]


@dataclass(frozen=True, eq=False)
class Way:
    name: Text  # of the way
    u: Floats  # (c,) standard uncertainties, mm and rad
    draws: int  # that they are from
    thinned: bool = False  # whether they are compared by some of the points of large features

    def known(self, *, inferred: bool) -> float:
        """Relative standard deviation of u; of a zone that is inferred from measured points with that of the pilot.

        Ten runs of two ways of the simulated plate had 0.9 to 1.0 % of a size and a distance, 0.8 to 2.6 % of three zones.
        """
        pilot = 0.5 / _PILOT if inferred else 0.0
        return float(np.sqrt(0.5 / self.draws + pilot + (_THINNED**2 if self.thinned else 0.0)))


def spread(virtual: Virtual, draws: int = WAY_DRAWS, seed: int = 0) -> Floats:
    """(c,) root mean square of the errors about their mean."""
    return np.asarray(virtual.errors(np.random.default_rng(seed), draws).std(axis=0))


def mean_of_places(places: Sequence[AtPose], random: np.random.Generator, n: int, *, exact: bool = False) -> Floats:
    """(n, c) errors of the mean of measurements in several places: reversal, or several orientations.

    Noise, and what comes of operators and fixtures, is drawn anew in each (:data:`ANEW`).
    """
    found = []
    for part in in_parts(places[0].measured.plan, n):
        common, mean = places[0].drawn(random, part), np.zeros((part, len(places[0].still)))
        for place in places:
            pairs = zip(place.causes, common, strict=True)
            drawn = [cause.draw(random, part) if cause.name in ANEW else same for cause, same in pairs]
            mean += place.errors(drawn, exact=exact) / len(places)
        found.append(mean)
    return np.concatenate(found)


def ways(
    plan: Plan, given: MeasurementConditions, draws: int = WAY_DRAWS, seed: int = 0, *,
    doubled: Doubled | None = None, planned: Virtual | None = None,
) -> list[Way]:  # fmt: skip
    """The measurement as it is planned first, then what changes it, each alone; what the travel forbids is left out."""
    first = planned or Virtual(plan, given)
    if thinned(plan, given)[0] is not plan:
        return _ways_of_some(plan, given, draws, seed, doubled, first)
    found = [Way(say("as planned"), spread(first, draws, seed), draws)]
    places = {given.poses[0].rotation.tobytes(): first.places[0]}
    for name, change in _changes(plan, given, doubled):
        with suppress(CmmUqError):  # beyond the travel
            changed = Virtual(*change(), pilot=_PILOT, first=first)
            found.append(Way(name, spread(changed, draws, seed), draws))
            places.setdefault(changed.poses[0].rotation.tobytes(), changed.places[0])
    with suppress(CmmUqError):
        found += _elsewhere(plan, given, first, draws, seed)
    return [*found, *_means(given, first, places, draws, seed)]


def _ways_of_some(
    plan: Plan, given: MeasurementConditions, draws: int, seed: int, doubled: Doubled | None, first: Virtual
) -> list[Way]:
    """By what part of u each way is better, as some of thousands of points say.

    Zones are those of the points as they are; what is a mean of points has as much less noise as the mean of all of them.
    """
    fewer = float(np.sqrt(len(thinned(plan, given)[0].points) / len(plan.points)))

    def compared(part: float) -> list[Way]:
        def of_some(plan_: Plan, given_: MeasurementConditions) -> tuple[Plan, MeasurementConditions]:
            few, near = thinned(plan_, given_, like=plan)
            own = near.machine.noise
            placing, growth = (part * np.asarray(one) for one in (own.placing_mm, own.growth_mm))
            less = replace(own, coordinate_mm=part * own.coordinate_mm, placing_mm=placing, growth_mm=growth)
            return few, replace(near, machine=replace(near.machine, noise=less))

        few = of_some(plan, given)
        twice = None if doubled is None else lambda: of_some(*doubled())
        return ways(*few, draws, seed, doubled=twice, planned=Virtual(*few, pilot=_PILOT))

    zones, means = compared(1.0), {str(one.name): one for one in compared(fewer)}
    of_points = np.array([one.of_points for one in first.places[0].measured.evaluations])
    u = [np.where(of_points, one.u, means.get(str(one.name), one).u) for one in zones]
    part = spread(first, draws, seed) / np.maximum(u[0], np.finfo(np.float64).tiny)
    return [replace(one, u=part * each, thinned=True) for one, each in zip(zones, u, strict=True)]


def _means(
    given: MeasurementConditions, first: Virtual, places: dict[bytes, AtPose], draws: int, seed: int
) -> Iterator[Way]:
    """Means of several measurements, in several orientations or in one place; ``places`` of the plan by their rotations."""
    plan, still = first.plan, np.eye(3)
    quarters = [still, _QUARTER_TURN, _HALF_TURN, _HALF_TURN @ _QUARTER_TURN]
    for name, turns in (
        (say("mean of two measurements, the part turned by 180° about Z between them"), quarters[::2]),
        (say("mean of four measurements, the part turned by 90° about Z each time"), quarters),
        (say("mean of four measurements, the part set up anew in its place each time"), [still] * 4),
    ):
        with suppress(CmmUqError):  # beyond the travel
            poses = {pose.rotation.tobytes(): pose for turn in turns for pose in [_turned(given.poses[0], turn, plan)]}
            for key in poses.keys() - places.keys():
                place = AtPose(plan, given, poses[key], first.known, _PILOT)
                places[key] = place if first.exact else place.condensed()
            several = [places[(turn @ given.poses[0].rotation).tobytes()] for turn in turns]
            errors = mean_of_places(several, np.random.default_rng(seed), draws, exact=first.exact)
            yield Way(name, errors.std(axis=0), draws)


def _changes(
    plan: Plan, given: MeasurementConditions, doubled: Doubled | None
) -> Iterator[tuple[Text, Callable[[], tuple[Plan, MeasurementConditions]]]]:
    """Each change of the plan or its circumstances."""
    yield say("each point four times"), lambda: (plan, replace(given, repeats=4 * given.repeats))
    if doubled is not None:
        yield say("twice the points in every feature"), doubled
    styli = tuple(
        replace(s, u_diameter_um=0.5 * s.u_diameter_um, u_offset_um=0.5 * s.u_offset_um, lobing_um=0.5 * s.lobing_um)
        for s in plan.styli
    )
    yield say("styli qualified twice as well"), lambda: (replace(plan, styli=styli), given)
    part = given.surroundings.part
    steadier = replace(given.surroundings, part=replace(part, u_temperature_k=0.5 * part.u_temperature_k))
    yield say("temperature of the part known twice as well"), lambda: (plan, replace(given, surroundings=steadier))
    turned = tuple(_turned(pose, _QUARTER_TURN, plan) for pose in given.poses)
    yield say("part turned by 90° about Z"), lambda: (plan, replace(given, poses=turned))


def _elsewhere(plan: Plan, given: MeasurementConditions, first: Virtual, draws: int, seed: int) -> list[Way]:
    """The best of the corners and the middle of what the travel leaves, at the height where the part is; none without travel.

    Best is the place with the least mean of the uncertainties over those where it was planned.
    """
    travel = given.machine.machine.travel_mm
    if not np.isfinite(travel[:2]).all():
        return []
    read = first.places[0].points.carriages
    room = np.stack([travel[:2, 0] - read[:, :2].min(axis=0), travel[:2, 1] - read[:, :2].max(axis=0)])  # (2, axes)
    planned, best = _quick(first.places[0], seed), (1.0, given, np.zeros(2))
    for part in product((0.0, 0.5, 1.0), repeat=2):
        shift = room[0] + np.array(part) * (room[1] - room[0])
        moved = tuple(replace(p, translation_mm=p.translation_mm + np.append(shift, 0.0)) for p in given.poses)
        there = replace(given, poses=moved)
        with suppress(CmmUqError):
            u = _quick(AtPose(plan, there, moved[0], first.known).condensed(), seed)
            ratio = float(np.mean(u / np.maximum(planned, np.finfo(np.float64).tiny)))
            best = (ratio, there, shift) if ratio < best[0] else best
    if best[1] is given:
        return []
    x, y = (signed(float(mm), "+.0f") for mm in best[2])
    name = say("part moved by {x} mm along {a} and {y} mm along {b}", x=x, y=y, a=Verbatim("X"), b=Verbatim("Y"))
    return [Way(name, spread(Virtual(plan, best[1], pilot=_PILOT, first=first), draws, seed), draws)]


def _quick(place: AtPose, seed: int) -> Floats:
    """(c,) standard deviations of what would be read, to first order, of the same draws in every place."""
    place, random, parts = place.summed or place, np.random.default_rng(seed), in_parts(place.measured.plan, _LOOKED_AT)
    errors = (place.errors(place.drawn(random, n), inferred=False) for n in parts)
    return np.asarray(np.concatenate([*errors]).std(axis=0))


def _turned(pose: PartPose, turn: Floats, plan: Plan) -> PartPose:
    """The part turned about its middle."""
    middle = pose.of(plan.points.mean(axis=0))
    return PartPose(turn @ pose.rotation, middle - turn @ pose.rotation @ plan.points.mean(axis=0))
