"""What the certificate of a probed plane says."""

from __future__ import annotations

import numpy as np
import pytest

from cmm_uq.documents.document import Facts
from tests.conftest import ROOT
from tests.kinds.simulated import blocks, recovered, table

JOB = "plane-simulated"


def test_the_errors_put_into_the_example_are_found() -> None:
    recovered(JOB, {"straightness_x_z": 4.0, "straightness_y_z": -2.5})


def test_flatness_is_that_of_numpys_least_squares() -> None:
    """The plate is level to 20 µm/m, so heights over a fitted plane are its orthogonal distances to a nanometre."""
    rows = np.genfromtxt(ROOT / "examples" / JOB / "recording.csv", delimiter=",", names=True)
    first = rows[(rows["measurement"] == 1) & (rows["point"] > 0)]
    design = np.column_stack([np.ones(len(first)), first["x_mm"], first["y_mm"]])
    rest = first["z_mm"] - design @ np.linalg.lstsq(design, first["z_mm"], rcond=None)[0]
    assert float(table(JOB, "Flatness as recorded").rows[0][2]) == pytest.approx(np.ptp(rest) * 1e3, abs=0.006)


def test_the_surface_lies_one_offset_lower_than_the_probe() -> None:
    """Probe centre at −560 mm + 20 µm/m · 450 mm, offset 1.9986 mm: −561.9896 mm; 0.3 µm of offset dominate U."""
    number, place, normal, U, approach = table(JOB, "Surface, compensated for the probe's offset").rows[0]
    assert number == "1"
    assert float(place.split(", ")[2].replace("−", "-")) == pytest.approx(-560 + 2e-5 * 450 - 1.9986, abs=2e-3)
    assert float(normal.split(", ")[2]) == pytest.approx(1.0)
    assert 0.6 < float(U) < 1.0
    assert approach == "0"


def test_a_plane_has_no_length_to_be_certified() -> None:
    labels = [label for block in blocks(JOB) if isinstance(block, Facts) for label, _ in block.rows]
    assert "Artefact" in labels
    assert "Certified length" not in labels
