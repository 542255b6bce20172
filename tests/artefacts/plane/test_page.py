"""What the certificate of a probed plane says."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import cmm_uq
from cmm_uq.app.commands.jobs.check import check_job
from cmm_uq.base.errors import CmmUqError
from cmm_uq.certificate.document import Facts
from tests.artefacts.simulated import blocks, recovered, table
from tests.conftest import ROOT

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


THREE = """measurement,point,repeat,x_mm,y_mm,z_mm
1,0,1,59.99942,100.00027,-551.99925
1,1,1,60.00026,99.99956,-559.99882
1,2,1,709.99957,599.99977,-559.98465
1,3,1,839.99993,1100.00031,-559.98186
"""


def three_contacts(folder: Path, *, effects: str = "", u_coordinate_um: float | None = 0.5) -> Path:
    text = (ROOT / "examples" / JOB / "job.toml").read_text(encoding="utf-8")
    text = re.sub(r"(?m)^effects = .*$", f"effects = [{effects}]", text)
    if u_coordinate_um is not None:
        text = text.replace('"recording.csv"\n', f'"recording.csv"\nu_coordinate_um = {u_coordinate_um}\n')
    (folder / "job.toml").write_text(text, encoding="utf-8")
    (folder / "recording.csv").write_text(THREE, encoding="utf-8")
    return folder


def test_three_contacts_make_a_plane_whose_points_are_as_uncertain_as_is_stated(tmp_path: Path) -> None:
    """At least three (US 4,866,643, claim 1 b): in their middle u is √(0.5²/3 + 0.3²) µm of points and offset."""
    folder = three_contacts(tmp_path)
    assert not check_job(folder).problems
    (plane,) = cmm_uq.report(folder).results["planes"]
    matrix = np.array(plane["surface"]["covariance"]["matrix"])
    assert np.sqrt(matrix[2, 2]) * 1e3 == pytest.approx(np.hypot(0.5 / np.sqrt(3), 0.3), rel=0.1)


@pytest.mark.parametrize(("how", "told"), [
    ({"u_coordinate_um": None}, "leave nothing to estimate the noise from"),
    ({"effects": '"straightness_x_z"'}, "0 observations cannot determine 1 parameters"),
])  # fmt: skip
def test_what_three_contacts_cannot_tell_is_refused_by_the_check_and_by_the_report(
    tmp_path: Path, how: dict[str, Any], told: str
) -> None:
    folder = three_contacts(tmp_path, **how)
    (problem,) = check_job(folder).problems
    assert told in problem.problem
    with pytest.raises(CmmUqError, match=told):
        cmm_uq.report(folder)
