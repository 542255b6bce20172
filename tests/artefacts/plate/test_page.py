"""What the certificate of a plate says."""

from __future__ import annotations

import re

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from cmm_uq.certificate.document import Facts, Paragraph, Plot
from tests.artefacts.simulated import SCALE, blocks, recovered, table
from tests.conftest import ROOT

JOB = "plate-simulated"


def test_the_errors_put_into_the_example_are_found() -> None:
    recovered(JOB, {**SCALE, "squareness_xy": 12.0, "squareness_zx": 4.0, "straightness_x_y": 3.5})


def test_deviations_before_the_model_are_those_of_scipys_alignment() -> None:
    rows = np.genfromtxt(ROOT / "examples" / JOB / "recording.csv", delimiter=",", names=True)
    first = rows[rows["measurement"] == 1]
    found = np.column_stack([first[f"{a}_mm"] for a in "xyz"])
    body = np.column_stack([first[f"reference_{a}_mm"] for a in "xyz"])
    found, body = found - found.mean(axis=0), body - body.mean(axis=0)
    turn, rssd = Rotation.align_vectors(found, body)
    _, balls, rms, largest, after, _ = table(JOB, "Deviation of a coordinate").rows[0]
    assert balls == "25"
    assert float(rms) == pytest.approx(rssd / np.sqrt(75) * 1e3, abs=0.006)
    in_plate = turn.inv().apply(found) - body
    assert float(largest) == pytest.approx(np.abs(in_plate).max() * 1e3, abs=0.006)
    assert float(after) < 0.3 * float(rms)


def test_every_placing_is_drawn_as_arrows() -> None:
    arrows = [
        block for block in blocks(JOB) if isinstance(block, Plot) and "displacement of each ball" in block.caption
    ]
    assert len(arrows) == 2
    assert "Plate x / mm" in arrows[0].svg
    assert "Arrows at 25 balls" in arrows[0].alternative


def test_a_comparison_of_two_dates_says_what_changed_and_what_looks_alike() -> None:
    """Scale X changed by 5 ppm, squareness by −3″, Y and the bow of 30 µm not at all; 11.5 ppm is one kelvin of steel."""
    job = "plate-two-dates-simulated"
    recovered(job, {"scale_x": 5.0, "scale_y": 0.0, "squareness_xy": -3.0, "straightness_x_y": 0.0})
    (text,) = [b.text for b in blocks(job) if isinstance(b, Paragraph) and "looks the same" in b.text]
    assert "2025-01-01" in text
    said = re.search(r"changed by (\S+) ppm.*colder by (\S+) K", text)
    assert said is not None
    assert float(said[2]) == pytest.approx(float(said[1]) / 11.5, abs=0.01)
    labels = {label: value for b in blocks(job) if isinstance(b, Facts) for label, value in b.rows}
    assert labels["References"] == "the earlier recording earlier.csv"
    assert "Certified length at 20 °C" not in labels
