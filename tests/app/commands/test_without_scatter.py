"""Bars that show one axis alone, and coordinates without noise: a certificate that says what is open, or a refusal."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

import cmm_uq
from cmm_uq.analysis.diagnosis.comparison.lack_of_fit import tail_probability
from cmm_uq.app.commands.diagnose import diagnose_read
from cmm_uq.app.commands.report import evaluate_job as analyse_job
from cmm_uq.base.errors import CmmUqError
from cmm_uq.certificate.result import Result
from cmm_uq.jobs.job import Job

EFFECTS = ("scale_x", "scale_y", "scale_z", "squareness_xy", "squareness_yz", "squareness_zx")


def bars_along_x(noise_mm: float, origin: str, digits: int = 9) -> Job:
    """Twenty bars of 400 mm along X, all over the volume."""
    random, rows = np.random.default_rng(2), []
    for number in range(1, 21):
        middle = np.array([350.0, 350.0, -350.0]) + random.uniform(-150, 150, 3)
        for point, side in ((1, -200.0), (2, 200.0)):
            xyz = middle + [side, 0, 0] + noise_mm * random.standard_normal(3)
            rows.append((number, point, *np.round(xyz, digits)))
    return cmm_uq.job(
        pd.DataFrame(rows, columns=["measurement", "point", "x_mm", "y_mm", "z_mm"]),
        machine={"name": "M", "chain": "XYZ", "travel_mm": {"x": [0, 700], "y": [0, 700], "z": [-700, 0]}},
        artefact={"kind": "ballbar", "length_mm": 400.0, "u_um": 0.2}, effects=EFFECTS, job={"origin": origin},
    )  # fmt: skip


@pytest.mark.parametrize("run", [analyse_job, diagnose_read])
def test_measured_coordinates_without_any_scatter_are_refused_with_a_remedy(run: object) -> None:
    assert callable(run)
    with pytest.raises(CmmUqError, match=r"the readings have no scatter at all.*Record what the machine indicated"):
        run(bars_along_x(0.0, "measured"))


@pytest.mark.parametrize(("noise_mm", "origin", "digits"), [(0.0, "simulated", 9), (0.0, "measured", 4)])
def test_bars_along_one_axis_determine_its_scale_and_nothing_else(noise_mm: float, origin: str, digits: int) -> None:
    """U of the scale is that of the certificate, 0.4 µm in 400 mm; what the digits leave open is less."""
    found = analyse_job(bars_along_x(noise_mm, origin, digits))
    assert isinstance(found, Result)
    assert found.free == {"scale_y", "scale_z", "squareness_xy", "squareness_yz", "squareness_zx"}
    scale = found.parameters["scale_x"]["ppm"]
    assert abs(scale.value) < 0.1
    assert scale.u == pytest.approx(0.5, rel=0.05)


def test_draws_that_are_all_alike_have_no_tail_but_markov_s() -> None:
    draws = np.full(1000, 2.0)
    assert tail_probability(draws, 2.0) == 1.0
    assert tail_probability(draws, 6.0, 0.9) == pytest.approx(0.1 * np.exp(-4))
