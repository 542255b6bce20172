"""Which readings repeat one quantity: by construction, for artefacts with one, several and three observations a reading."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from cmm_uq.app.commands.diagnose import screened_model
from cmm_uq.app.commands.reading import read_job
from cmm_uq.machine.model.noise import repeated_quantity

EXAMPLES = Path(__file__).parents[3] / "examples"


@pytest.mark.parametrize(
    ("example", "observations_a_reading"),
    [("bryan-simulated", 1), ("step-gauge-simulated", 1), ("sphere-simulated", 1), ("plate-simulated", 3)],
)
def test_observations_repeat_each_other_when_they_are_one_quantity_of_one_placing(
    example: str, observations_a_reading: int
) -> None:
    model, _ = screened_model(read_job(EXAMPLES / example))
    artefact = model.artefact
    number = repeated_quantity(model, model.used)
    points = artefact.points.point[artefact.rows][model.used]
    assert len(number) == model.used.sum()
    for k in np.unique(number):
        same = number == k
        assert len(np.unique(artefact.measurement[model.used][same])) == 1
        assert len(np.unique(points[same], axis=0)) == 1
        assert len(np.unique(artefact.repeat[model.used][same])) == same.sum()
    readings = np.unique(np.column_stack([artefact.measurement[model.used], points]), axis=0)
    assert len(np.unique(number)) == observations_a_reading * len(readings)
