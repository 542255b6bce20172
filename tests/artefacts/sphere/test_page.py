"""What the certificate of a probed sphere says."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import least_squares

from tests.artefacts.simulated import analysed, recovered, table
from tests.conftest import ROOT

JOB = "sphere-simulated"


def test_the_errors_put_into_the_example_are_found() -> None:
    """Lobing 0.9 µm · cos φ and 0.4 µm · sin φ: amplitude 0.985 µm."""
    recovered(JOB, {"probe_radius": 0.8, "probe_lobing": float(np.hypot(0.9, 0.4))})


def test_form_and_size_are_those_of_a_sphere_fitted_by_scipy() -> None:
    rows = np.genfromtxt(ROOT / "examples" / JOB / "recording.csv", delimiter=",", names=True)
    first = rows[rows["measurement"] == 1]
    xyz = np.column_stack([first["x_mm"], first["y_mm"], first["z_mm"]])
    fit = least_squares(lambda p: np.linalg.norm(xyz - p[:3], axis=1) - p[3], [*xyz.mean(axis=0), 12.0], xtol=1e-15)
    number, points, form, size = table(JOB, "Probing errors").rows[0]
    assert (number, points) == ("1", "25")
    assert float(form) == pytest.approx(np.ptp(fit.fun) * 1e3, abs=0.006)
    assert float(size.replace("−", "-")) == pytest.approx((2 * fit.x[3] - 25.0012) * 1e3, abs=0.006)


def test_iso_10360_5_decides_on_the_largest_form_error_with_half_the_form_of_the_ball() -> None:
    """The ball's certificate says 0.1 µm of form: u = 0.05 µm (ISO/TS 23165)."""
    (statement,) = analysed(JOB).statements
    printed = [float(row[2]) for row in table(JOB, "Probing errors").rows]
    assert round(statement.value_um, 2) == max(printed)
    assert statement.u_um == pytest.approx(0.05)
    assert statement.decision.outcome == "pass"
    assert any("largest of 3 spheres" in remark for remark in statement.remarks)
