"""Reference pairs: points whose feature is known exactly, and what the engine of parts makes of them.

*Least squares*: deviations orthogonal to every motion and growth of the feature leave it the least-squares feature.
*Minimum zone*: contact points whose motions balance with positive weights, half of the width to either side, all others
inside. Both are constructions without any fit (``reference_sets``); the rest is the engine of parts itself:
plans, features, characteristics. Pairs are turned and carried to a random place.

Run: ``python -m benchmarks.parts.reference_pairs [SETS]``
"""

from __future__ import annotations

import sys
from collections.abc import Iterator

import numpy as np
from scipy.spatial.transform import Rotation

from cmm_uq.analysis.parts.evaluation import Evaluator, characteristics_of
from cmm_uq.analysis.parts.plan import FORMS, Nominal, PartCharacteristic, PartFeature, Plan
from cmm_uq.base.points import Floats
from cmm_uq.jobs.part.feature import DIRECTED, Kind as FeatureKind
from cmm_uq.maths.geometry.association import Association
from tests.maths.geometry.reference_sets import points_with_known_fit, points_with_known_zone, surface

KINDS: tuple[FeatureKind, ...] = ("line", "plane", "circle", "sphere", "cylinder", "cone")
FORM_OF = dict(zip(("line", "plane", "circle", "cylinder", "sphere"), FORMS, strict=True))
SIZED = ("circle", "sphere", "cylinder")
RADIUS, HALF_ANGLE, LENGTH, FORM = 20.0, 0.3, 60.0, 0.02


def pair(kind: FeatureKind, how: Association, seed: int, count: int = 40) -> dict[str, float]:
    """By how much form, size, direction and place are off what they were built to be, mm; angles at the feature's length."""
    where, normals, growth = surface(kind, count, seed)
    if how == "least_squares":
        points = points_with_known_fit(where, normals, growth, FORM, seed)
        off = np.einsum("ni,ni->n", points - where, normals[:, 0])
        form = float(np.ptp(off))
    else:
        points, _ = points_with_known_zone(where, normals, growth, FORM, seed)
        form = FORM
    random = np.random.default_rng(seed)
    turn, shift = Rotation.random(random_state=seed).as_matrix(), random.uniform(-500, 500, 3)
    along = np.array([1.0, 0, 0]) if kind == "line" else np.array([0.0, 0, 1])
    sized = kind in SIZED or kind == "cone"
    nominal = Nominal(
        shift, turn @ along if kind in DIRECTED else None, 2 * RADIUS if sized else None,
        HALF_ANGLE if kind == "cone" else None,
    )  # fmt: skip
    carried = points @ turn.T + shift
    # the plan does not know the answer: it has the feature 0.1 mm and 0.5 mrad elsewhere, of a curve within its plane
    leaned, moved = 5e-4 * random.standard_normal(3), 0.1 * random.standard_normal(3)
    if kind in ("line", "circle"):
        up = turn[:, 2]
        leaned, moved = (leaned @ up) * up, moved - (moved @ up) * up
    lean = Rotation.from_rotvec(leaned).as_matrix() @ turn
    planned = where @ lean.T + shift + moved
    feature = PartFeature("f", kind, planned, normals[:, 0] @ lean.T, "stylus", nominal)
    asked = [PartCharacteristic("form", FORM_OF[kind], ("f",), association=how)] if kind in FORM_OF else []
    asked += [PartCharacteristic("size", "size", ("f",), association=how)] if kind in SIZED else []
    asked += [PartCharacteristic("angle", "angle", ("f",), association=how)] if kind == "cone" else []
    plan = Plan((feature,), tuple(asked))
    found = dict(zip((one.name for one in asked), characteristics_of(plan, carried), strict=True))
    built = {"form": form, "size": 2 * RADIUS, "angle": 2 * HALF_ANGLE}
    off_by = {name: abs(value - built[name]) * (LENGTH if name == "angle" else 1) for name, value in found.items()}
    values = Evaluator(plan, carried - plan.points, []).associated["f", how].base
    if kind in DIRECTED and kind != "circle":
        off_by["direction"] = LENGTH * float(np.linalg.norm(np.cross(values[3:6], turn @ along)))
    off_by["place"] = _apart(kind, values[:3] - shift, turn @ along)
    return off_by


def _apart(kind: FeatureKind, off: Floats, direction: Floats) -> float:
    """Of a place from the feature: along a normal, across an axis, or in all directions."""
    if kind == "plane":
        return float(abs(off @ direction))
    if kind in ("line", "cylinder", "cone"):
        return float(np.linalg.norm(np.cross(off, direction)))
    return float(np.linalg.norm(off))


def every() -> Iterator[tuple[FeatureKind, Association]]:
    """Kinds by both associations."""
    for kind in KINDS:
        yield kind, "least_squares"
        yield kind, "minimum_zone"


def main(sets: int) -> None:
    """The worst of so many sets of each kind."""
    print(f"{sets} sets of 40 points each, form {1e3 * FORM:g} µm; largest difference from what was built, mm")
    for kind, how in every():
        worst: dict[str, float] = {}
        for seed in range(sets):
            for name, value in pair(kind, how, seed).items():
                worst[name] = max(worst.get(name, 0.0), value)
        print(f"{kind:9s} {how:14s} " + ", ".join(f"{name} {value:.1g}" for name, value in worst.items()), flush=True)


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 100)
