"""The customer's certificate prints the uncertainty of the artefact as its own certificate states it."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from cmm_uq.artefacts import artefact_facts
from cmm_uq.base.points import Machine, Points
from cmm_uq.certificate.sections.traceability import stated_uncertainty


def recorded(**columns: Any) -> Points:
    one = np.ones(3, dtype=np.int64)
    return Points(np.zeros((3, 3)), one, np.arange(1, 4), one, Machine(), columns)


@pytest.mark.parametrize(
    ("stated", "printed"),
    [
        ({"U_um": "0.2 + 0.5·L/1000", "k": 2.0}, "U = 0.2 µm + 0.5·10⁻⁶·L, k = 2"),
        ({"U_um": "0,2 + L/2000", "k": 2.0}, "U = 0.2 µm + 0.5·10⁻⁶·L, k = 2"),
        ({"U_um": "Q[0.2; 0.5·L/1000]", "k": 2.0}, "U = Q[0.2 µm; 0.5·10⁻⁶·L], k = 2"),
        ({"U_um": "L/2000", "k": 2.05}, "U = 0.5·10⁻⁶·L, k = 2.05"),
        ({"U_um": 0.4, "k": 2.25, "degrees_of_freedom": 10.0}, "U = 0.4 µm, k = 2.25, 10 degrees of freedom"),
        ({"U_um": 0.4, "degrees_of_freedom": 10.0}, "U = 0.4 µm, k = 2.23, 10 degrees of freedom"),
        ({"u_um": "0.1 + L/4000"}, "u = 0.1 µm + 0.25·10⁻⁶·L"),
        ({"u_um": 0.2}, ""),
        ({}, ""),
    ],
)
def test_as_it_was_issued(stated: dict[str, Any], printed: str) -> None:
    assert stated_uncertainty(artefact_facts(kind="step_gauge", **stated), recorded()) == printed


def test_of_each_point_its_range() -> None:
    facts = artefact_facts(kind="step_gauge")
    points = recorded(reference_u_um=np.array([0.0, 0.12, 0.3456]))
    assert stated_uncertainty(facts, points) == "of each point by itself, u from 0 to 0.346 µm"
