"""What would make the uncertainty of a part's characteristics smaller: each way by virtual measurements, no rule of thumb."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from itertools import product

import numpy as np

from cmm_uq.analysis.parts.causes.machine import NOISE
from cmm_uq.analysis.parts.causes.surroundings import FIXTURE, OPERATOR
from cmm_uq.analysis.parts.placing import PartPose
from cmm_uq.analysis.parts.plan import Plan
from cmm_uq.analysis.parts.virtual import AtPose, MeasurementConditions, Virtual, in_parts
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.messages import Text, Verbatim, say, signed
from cmm_uq.base.points import Floats

DRAWS = 10_000  # of each way; u is then known to 0.7 %.
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
    """A way to measure, and what comes of it."""

    name: Text  # of the way
    u: Floats  # (c,) standard uncertainties, mm and rad
    draws: int  # that they are from

    def known(self, *, inferred: bool) -> float:
        """Relative standard deviation of u; of a zone that is inferred from measured points with that of the pilot.

        Ten runs of two ways of the simulated plate had 0.9 to 1.0 % of a size and a distance, 0.8 to 2.6 % of three zones.
        """
        return float(np.sqrt(0.5 / self.draws + (0.5 / _PILOT if inferred else 0.0)))


def spread(virtual: Virtual, draws: int = DRAWS, seed: int = 0) -> Floats:
    """(c,) root mean square of the errors about their mean."""
    return np.asarray(virtual.errors(np.random.default_rng(seed), draws).std(axis=0))


def mean_of_places(places: Sequence[AtPose], random: np.random.Generator, n: int, *, exact: bool = False) -> Floats:
    """(n, c) errors of the mean of measurements in several places: reversal, or several orientations.

    Noise, and what comes of operators and fixtures, is drawn anew in each (:data:`ANEW`).
    """
    plan = places[0].measured.plan
    return np.concatenate([_means_drawn(places, random, part, exact=exact) for part in in_parts(plan, n)])


def _means_drawn(places: Sequence[AtPose], random: np.random.Generator, n: int, *, exact: bool) -> Floats:
    common = places[0].drawn(random, n)
    found = np.zeros((n, len(places[0].still)))
    for place in places:
        drawn = [
            cause.draw(random, n) if cause.name in ANEW else same
            for cause, same in zip(place.causes, common, strict=True)
        ]
        found += place.errors(drawn, exact=exact) / len(places)
    return found


def ways(
    plan: Plan, given: MeasurementConditions, draws: int = DRAWS, seed: int = 0, *,
    doubled: Doubled | None = None, planned: Virtual | None = None,
) -> list[Way]:  # fmt: skip
    """The measurement as it is planned first, then what changes it, each alone.

    Ways that the travel of the machine does not allow are left out.
    """
    first = Virtual(plan, given) if planned is None else planned
    found = [Way(say("as planned"), spread(first, draws, seed), draws)]
    for name, change in _changes(plan, given, doubled):
        with suppress(CmmUqError):  # beyond the travel
            found.append(Way(name, spread(Virtual(*change(), first.known, _PILOT), draws, seed), draws))
    with suppress(CmmUqError):
        found += _elsewhere(plan, given, first, draws, seed)
    return found + _means(plan, given, first, draws, seed)


def _means(plan: Plan, given: MeasurementConditions, first: Virtual, draws: int, seed: int) -> list[Way]:
    """Means of several measurements, in several orientations or in one place."""
    found, still = list[Way](), np.eye(3)
    places = {still.tobytes(): first.places[0]}
    quarters = [still, _QUARTER_TURN, _HALF_TURN, _HALF_TURN @ _QUARTER_TURN]
    for name, turns in (
        (say("mean of two measurements, the part turned by 180° about Z between them"), quarters[::2]),
        (say("mean of four measurements, the part turned by 90° about Z each time"), quarters),
        (say("mean of four measurements, the part set up anew in its place each time"), [still] * 4),
    ):
        with suppress(CmmUqError):  # beyond the travel
            for turn in turns:
                if turn.tobytes() not in places:
                    pose = _turned(given.poses[0], turn, plan)
                    place = AtPose(plan, given, pose, first.known, _PILOT)
                    places[turn.tobytes()] = place if first.exact else place.condensed()
            several = [places[turn.tobytes()] for turn in turns]
            errors = mean_of_places(several, np.random.default_rng(seed), draws, exact=first.exact)
            found.append(Way(name, errors.std(axis=0), draws))
    return found


def _changes(
    plan: Plan, given: MeasurementConditions, doubled: Doubled | None
) -> Iterator[tuple[Text, Callable[[], tuple[Plan, MeasurementConditions]]]]:
    """Each change of the plan or its circumstances."""
    yield say("each point four times"), lambda: (plan, replace(given, repeats=4 * given.repeats))
    if doubled is not None:
        yield say("twice the points in every feature"), doubled
    styli = tuple(replace(s, u_diameter_um=0.5 * s.u_diameter_um, u_offset_um=0.5 * s.u_offset_um,
                          lobing_um=0.5 * s.lobing_um) for s in plan.styli)  # fmt: skip
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
    return [Way(name, spread(Virtual(plan, best[1], first.known, _PILOT), draws, seed), draws)]


def _quick(place: AtPose, seed: int) -> Floats:
    """(c,) standard deviations of what would be read, to first order, of the same draws in every place."""
    random, parts = np.random.default_rng(seed), in_parts(place.measured.plan, _LOOKED_AT)
    errors = [place.errors(place.drawn(random, n), inferred=False) for n in parts]
    return np.asarray(np.concatenate(errors).std(axis=0))


def _turned(pose: PartPose, turn: Floats, plan: Plan) -> PartPose:
    """The part turned about its middle."""
    middle = pose.of(plan.points.mean(axis=0))
    rotation = turn @ pose.rotation
    return PartPose(rotation, middle - rotation @ plan.points.mean(axis=0))
