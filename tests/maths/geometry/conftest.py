from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import pytest

from cmm_uq.base.points import Floats
from tests.maths.geometry.reference_sets import points_with_known_fit


@dataclass(frozen=True, eq=False)
class Placed:
    """Points placed in space, and where the feature's own origin and z axis went."""

    points: Floats
    origin: Floats
    axis: Floats


@pytest.fixture
def place() -> Callable[..., Placed]:
    """Build a reference set about the feature's own frame, then turn it and carry it ``far`` mm away."""

    def build(surface: Floats, normals: Floats, growth: Floats, *, form: float, seed: int, far: float = 0.0) -> Placed:
        rng = np.random.default_rng(seed)
        turn, _ = np.linalg.qr(rng.normal(size=(3, 3)))
        turn *= np.sign(np.linalg.det(turn))
        direction = rng.normal(size=3)
        origin = far * direction / np.linalg.norm(direction)
        points = points_with_known_fit(surface, normals, growth, form, seed)
        return Placed(points @ turn.T + origin, origin, turn[:, 2])

    return build


@pytest.fixture
def arc() -> Callable[..., tuple[Floats, Floats, Floats]]:
    """Outward radial directions (n, 3) over an angle in rad, and heights over a length in mm, both irregular."""

    def build(angle: float, length: float, n: int, seed: int) -> tuple[Floats, Floats]:
        rng = np.random.default_rng(seed)
        turn = rng.uniform(-angle / 2, angle / 2, n)
        return np.column_stack([np.cos(turn), np.sin(turn), np.zeros(n)]), rng.uniform(-length / 2, length / 2, n)

    return build
