"""What would make the uncertainty of a part's characteristics smaller: each way by virtual measurements, no rule of thumb."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from cmm_uq.errors import CmmUqError
from cmm_uq.parts.of_machine import NOISE
from cmm_uq.parts.placing import Pose
from cmm_uq.parts.plan import Plan
from cmm_uq.parts.virtual import AtPose, Circumstances, Virtual
from cmm_uq.points import Floats

DRAWS = 20_000
"""Of each way; u is then known to half a percent."""

_HALF_TURN = np.diag([-1.0, -1.0, 1.0])
_QUARTER_TURN = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])


@dataclass(frozen=True, eq=False)
class Way:
    """A way to measure, and what comes of it.

    Attributes
    ----------
    name : of the way.
    u : (c,) standard uncertainties, mm and rad.
    """

    name: str
    u: Floats


def spread(virtual: Virtual, draws: int = DRAWS, seed: int = 0) -> Floats:
    """(c,) root mean square of the errors about their mean."""
    return np.asarray(virtual.errors(np.random.default_rng(seed), draws).std(axis=0))


def mean_of_places(places: Sequence[AtPose], random: np.random.Generator, n: int, *, exact: bool = False) -> Floats:
    """(n, c) errors of the mean of measurements in several places: reversal, or several orientations.

    Noise is drawn anew in each; machine, styli, temperatures and the part stay what they are.
    """
    common = places[0].drawn(random, n)
    found = np.zeros((n, len(places[0].measured.evaluations)))
    for place in places:
        drawn = [
            cause.draw(random, n) if cause.name == NOISE else same
            for cause, same in zip(place.causes, common, strict=True)
        ]
        found += place.errors(drawn, exact=exact) / len(places)
    return found


def ways(plan: Plan, given: Circumstances, draws: int = DRAWS, seed: int = 0) -> list[Way]:
    """The measurement as it is planned first, then what changes it, each alone.

    Ways that the travel of the machine does not allow are left out.
    """
    found = [Way("as planned", spread(Virtual(plan, given), draws, seed))]
    styli = tuple(replace(s, u_diameter_um=0.5 * s.u_diameter_um, u_offset_um=0.5 * s.u_offset_um,
                          lobing_um=0.5 * s.lobing_um) for s in plan.styli)  # fmt: skip
    part = given.surroundings.part
    steadier = replace(part, u_temperature_k=0.5 * part.u_temperature_k)
    turned = tuple(_turned(pose, _QUARTER_TURN, plan) for pose in given.poses)
    changed: Mapping[str, tuple[Plan, Circumstances]] = {
        "each point four times": (plan, replace(given, repeats=4 * given.repeats)),
        "styli qualified twice as well": (replace(plan, styli=styli), given),
        "temperature of the part known twice as well":
            (plan, replace(given, surroundings=replace(given.surroundings, part=steadier))),
        "part turned by 90° about Z": (plan, replace(given, poses=turned)),
    }  # fmt: skip
    for name, (other, circumstances) in changed.items():
        try:
            found.append(Way(name, spread(Virtual(other, circumstances), draws, seed)))
        except CmmUqError:  # beyond the travel
            continue
    try:
        pose = given.poses[0]
        places = [AtPose(plan, given, pose), AtPose(plan, given, _turned(pose, _HALF_TURN, plan))]
        errors = mean_of_places(places, np.random.default_rng(seed), draws)
        found.append(Way("mean of two measurements, the part turned by 180° about Z between them", errors.std(axis=0)))
    except CmmUqError:
        pass
    return found


def _turned(pose: Pose, turn: Floats, plan: Plan) -> Pose:
    """The part turned about its middle."""
    middle = pose.of(plan.points.mean(axis=0))
    rotation = turn @ pose.rotation
    return Pose(rotation, middle - rotation @ plan.points.mean(axis=0))
