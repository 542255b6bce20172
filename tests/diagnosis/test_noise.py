"""Which readings repeat one quantity: by construction, for artefacts with one, several and three observations a reading."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from cmm_uq.commands.diagnosing import screened_model
from cmm_uq.commands.reading import read_job
from cmm_uq.diagnosis.noise import kinds
from cmm_uq.diagnosis.recorded_noise import repeated_quantity

EXAMPLES = Path(__file__).parents[2] / "examples"


@pytest.mark.parametrize(
    ("example", "observations_a_reading"),
    [("bryan-simulated", 1), ("step-gauge-simulated", 1), ("sphere-simulated", 1), ("plate-simulated", 3)],
)
def test_observations_repeat_each_other_when_they_are_one_quantity_of_one_placing(
    example: str, observations_a_reading: int
) -> None:
    model, _ = screened_model(read_job(EXAMPLES / example))
    artefact, number = model.artefact, repeated_quantity(model)
    points = artefact.points.point[artefact.rows][model.used]
    assert len(number) == model.used.sum()
    for k in np.unique(number):
        same = number == k
        assert len(np.unique(artefact.measurement[model.used][same])) == 1
        assert len(np.unique(points[same], axis=0)) == 1
        assert len(np.unique(artefact.repeat[model.used][same])) == same.sum()
    readings = np.unique(np.column_stack([artefact.measurement[model.used], points]), axis=0)
    assert len(np.unique(number)) == observations_a_reading * len(readings)


@pytest.mark.parametrize("times", [1, 8])
def test_noise_that_follows_itself_is_seen_along_each_direction_also_where_directions_come_again(times: int) -> None:
    """By construction: each coordinate follows itself by φ from reading to reading, and a reading sees it along u."""
    random = np.random.default_rng(1)
    some = random.standard_normal((40, 3))
    u = np.tile(some / np.linalg.norm(some, axis=1, keepdims=True), (times, 1))
    m = len(u)
    lag = np.abs(np.subtract.outer(np.arange(m), np.arange(m)))
    for kind in kinds(np.arange(m), np.arange(m, dtype=np.float64), u):
        if kind.name == "correlated":
            factor = kind.noise(np.eye(m))
            np.testing.assert_allclose(factor @ factor.T, kind.size**lag * (u @ u.T), atol=1e-9)
