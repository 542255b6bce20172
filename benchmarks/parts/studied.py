"""The study's part as a plan of the package, and recordings of its calibrations as the package reads them."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from benchmarks.parts import truth
from cmm_uq.analysis.parts.plan import Nominal, PartCharacteristic, PartFeature, Plan, Stylus
from cmm_uq.base.points import Floats, Machine, Points
from cmm_uq.jobs.part.feature import Kind as FeatureKind

KINDS: Mapping[str, FeatureKind] = {
    "A": "plane", "B": "plane", "C": "plane", "D": "plane", "h1": "cylinder", "h2": "cylinder", "S": "sphere",
}  # fmt: skip
MACHINE = Machine("hidden", travel_mm=truth.TRAVEL)
U_TIP_UM = 0.6
_ABC = ("A", "B", "C")

CHARACTERISTICS = (
    PartCharacteristic("d1", "size", ("h1",)),
    PartCharacteristic("d2", "size", ("h2",)),
    PartCharacteristic("ball", "size", ("S",)),
    PartCharacteristic("apart", "distance", ("h1", "h2")),
    PartCharacteristic("x1", "x", ("h1",), _ABC),
    PartCharacteristic("y2", "y", ("h2",), _ABC),
    PartCharacteristic("z ball", "z", ("S",), _ABC),
    PartCharacteristic("length", "distance", ("C", "D")),
    PartCharacteristic("upright", "perpendicularity", ("h1",), ("A",)),
    PartCharacteristic("corner", "angle", ("B", "C")),
    PartCharacteristic("parallel", "parallelism", ("D",), ("C",)),
    PartCharacteristic("flat", "flatness", ("A",)),
    PartCharacteristic("round", "cylindricity", ("h1",)),
    PartCharacteristic("position 1", "position", ("h1",), _ABC),
    PartCharacteristic("position 2", "position", ("h2",), _ABC),
)
WORDS = {
    "d1": "diameter of a bore of 20 mm", "d2": "diameter of a bore of 30 mm", "ball": "diameter of a ball of 25 mm",
    "apart": "distance of the axes, 141 mm", "x1": "x of a bore", "y2": "y of a bore", "z ball": "z of the ball",
    "length": "length over two faces, 200 mm", "upright": "perpendicularity of a bore", "corner": "angle of two faces",
    "parallel": "parallelism of two faces", "flat": "flatness", "round": "cylindricity", "position 1": "position of a bore",
    "position 2": "position of the other bore",
}  # fmt: skip


def plan() -> Plan:
    """Of the part of :mod:`benchmarks.parts.truth`."""
    features = []
    for name, (points, normals) in truth.nominal_part().items():
        kind = KINDS[name]
        if kind == "plane":
            nominal = Nominal(points[0], normals[0])
        elif kind == "cylinder":
            nominal = Nominal(np.array([*truth.CENTRES[name], 0.0]), np.array([0.0, 0, 1]), 2 * truth.RADII[name])
        else:
            nominal = Nominal(truth.BALL, None, 2 * truth.SPHERE_RADIUS)
        features.append(PartFeature(name, kind, points, normals, "stylus", nominal))
    tip = Stylus("stylus", truth.TIP, 2 * truth.RADIUS, U_TIP_UM, qualified_at_mm=truth.SPHERE_AT)
    return Plan(tuple(features), CHARACTERISTICS, (tip,))


def as_points(recording: truth.Recording) -> Points:
    """A recording as the package reads it."""
    return Points(
        recording.xyz, recording.measurement, recording.point, recording.repeat, MACHINE, recording.columns, start_s=0.0
    )


def joined(features: Mapping[str, Floats]) -> Floats:
    """(n, 3) points of all features in the plan's order."""
    return np.concatenate([features[name] for name in KINDS])


def parted(points: Floats) -> dict[str, Floats]:
    """The other way round."""
    counts = [len(each) for each, _ in truth.nominal_part().values()]
    return dict(zip(KINDS, np.split(points, np.cumsum(counts)[:-1]), strict=True))
