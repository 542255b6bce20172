"""The measurement of a part, written a second time without the package (benchmarks/parts/truth.py), is the engine's.

So the study of hidden machines compares the engine with something else than itself.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.parts import truth
from benchmarks.parts.studied import CHARACTERISTICS, MACHINE, joined, parted, plan
from cmm_uq.analysis.machine.state import MachineState, StatedNoise
from cmm_uq.analysis.parts.evaluation import characteristics_of
from cmm_uq.analysis.parts.plan import PartPose, WithStyli
from cmm_uq.analysis.parts.virtual import AtPose, MeasurementConditions
from cmm_uq.base.points import AXES, Floats, Points
from cmm_uq.machine.physics.catalogue import effects
from cmm_uq.machine.physics.superposition import Superposition

PAIRS = [(a, b) for a in AXES for b in AXES]
NAMES = (
    *truth.SIX, *(f"straightness_{a}_{b}" for a, b in PAIRS if a != b), *(f"rotation_{a}_{b}" for a, b in PAIRS),
    *(f"hysteresis_{a}" for a in AXES), *(f"periodic_scale_{a}" for a in AXES),
)  # fmt: skip
EFFECTS = effects(NAMES)
TURN = np.array([[np.cos(0.7), -np.sin(0.7), 0], [np.sin(0.7), np.cos(0.7), 0], [0, 0, 1]])
POSE = PartPose(TURN, np.array([400.0, 200.0, -300.0]))


def coefficients(of: truth.Truth) -> Floats:
    off = [of.bow[AXES.index(a), AXES.index(b)] for a, b in PAIRS if a != b]
    return np.array([*of.scale, *of.squareness, *off, *of.turn.ravel(), *of.gap, *of.wave.ravel()])


def shapes(of: truth.Truth) -> dict[str, tuple[float, ...]]:
    return {f"periodic_scale_{a}": (float(of.period[i]),) for i, a in enumerate(AXES)}


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_errors_of_points_are_the_same(seed: int) -> None:
    random = np.random.default_rng(seed)
    hidden, n = truth.Truth.drawn(random), 50
    read, approach = random.uniform(*truth.TRAVEL.T, (n, 3)), random.integers(-1, 2, (n, 3)).astype(float)
    columns = {f"tip_{a}_mm": np.full(n, truth.TIP[i]) for i, a in enumerate(AXES)}
    columns |= {f"approach_{a}": approach[:, i] for i, a in enumerate(AXES)}
    ones = np.ones(n, dtype=np.int64)
    points = Points(read + truth.TIP, ones, np.arange(n), ones, WithStyli.of(MACHINE), columns, start_s=0.0)
    found = Superposition(EFFECTS, shapes(hidden)).errors(points, coefficients(hidden))
    np.testing.assert_allclose(found, hidden.true(read, truth.TIP, approach) - read - truth.TIP, rtol=0, atol=1e-11)


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_characteristics_of_a_made_part_are_the_same(seed: int) -> None:
    """To the square of a tilt over a place that the definitions leave open: where on its axis or face a feature is."""
    part = truth.made_part(np.random.default_rng(seed))
    expected = truth.characteristics(part)
    for one, value in zip(CHARACTERISTICS, characteristics_of(plan(), joined(part)), strict=True):
        assert abs(value - expected[one.name]) < 5e-6, one.name


def apart(hidden: truth.Truth, change: Floats, size: float) -> Floats:
    """(c,) by how much errors of one measurement differ, of a machine with so many times its errors and their estimates."""
    less = replace(
        hidden, **{name: size * getattr(hidden, name) for name in ("scale", "squareness", "bow", "turn", "gap", "wave")}
    )
    found = coefficients(less)
    corrected = truth.Truth.of_six(dict(zip(truth.SIX, found[:6] + size * change, strict=True)))
    points = {name: each for name, (each, _) in truth.nominal_part().items()}
    normals = np.concatenate([each for _, each in truth.nominal_part().values()])
    measuring = truth.Measuring(less, corrected, TURN, POSE.translation_mm, 0.0, 0.0, 0.0)
    random = np.random.default_rng(0)
    measured = truth.characteristics(parted(measuring.measured(joined(points), normals, random)))
    still = truth.characteristics(points)
    state = MachineState(
        MACHINE, EFFECTS, found[None], StatedNoise(), shapes(less), corrections=coefficients(corrected)
    )
    at = AtPose(plan(), MeasurementConditions(state), POSE)
    errors = at.errors([np.zeros_like(drawn) for drawn in at.drawn(random, 1)], exact=True)[0]
    return np.array(
        [error - (measured[one.name] - still[one.name]) for one, error in zip(CHARACTERISTICS, errors, strict=True)]
    )


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_a_measurement_without_noise_errs_the_same_to_second_order(seed: int) -> None:
    """The engine takes the qualification of the tip to first order: a tenth of the errors leaves about a hundredth of the
    difference, within a factor of two. The qualification turns nothing: angles are the same to rounding."""
    random = np.random.default_rng(seed)
    hidden, change = truth.Truth.drawn(random), random.standard_normal(6) * [5, 5, 5, 3, 3, 3]
    whole, tenth = apart(hidden, change, 1.0), apart(hidden, change, 0.1)
    lengths = np.array([one.what != "angle" for one in CHARACTERISTICS])
    assert 0.005 < np.linalg.norm(tenth[lengths]) / np.linalg.norm(whole[lengths]) < 0.02
    np.testing.assert_allclose(whole[~lengths], 0.0, atol=1e-11)
