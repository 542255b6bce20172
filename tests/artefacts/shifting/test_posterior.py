"""The posterior of shifted artefacts by name: the draws that every figure of their certificates comes from."""

from __future__ import annotations

import hashlib
import io
import re
from typing import Any

import numpy as np
import pytest

import cmm_uq
from cmm_uq.artefacts.shift.axis import ShiftResult
from cmm_uq.artefacts.shift.result import listed_draws
from cmm_uq.artefacts.shift.smooth import DRAWS
from cmm_uq.maths.inference.ensembles import ENSEMBLES
from tests.conftest import ROOT

AXIS, PLANE = "shift-simulated", "shift-plate-simulated"


@pytest.fixture(scope="module", params=[AXIS, PLANE])
def found(request: pytest.FixtureRequest) -> Any:
    return cmm_uq.report(ROOT / "examples" / request.param)


def listed_in(results: Any, place: str) -> float:
    """What stands in results.json at a place such as ``curves.linearity_x.error_um[3]``."""
    for key in re.findall(r"[A-Za-z_]\w*|\d+", place):
        results = results[int(key) if key.isdigit() else key]
    return float(results["value"] if isinstance(results, dict) else results)


def test_the_covariance_has_the_variances_of_all_estimates_first(found: Any) -> None:
    names = list(found.estimates.index)
    assert list(found.covariance.index)[: len(names)] == list(found.covariance.columns)[: len(names)] == names
    u = np.sqrt(np.diag(found.covariance))[: len(names)]
    assert u == pytest.approx(found.estimates["u"].to_numpy(), rel=1e-9)


def test_it_agrees_with_the_covariance_of_results_json(found: Any) -> None:
    said = found.results["covariance"]
    ours = found.covariance.loc[said["parameters"], said["parameters"]].to_numpy()
    np.testing.assert_allclose(ours, said["matrix"], rtol=1e-9)
    assert [found.posterior.units[name] for name in said["parameters"]] == said["units"]


def test_what_is_listed_is_named_by_its_place_in_results_json(found: Any) -> None:
    listed = [name for name in found.posterior if name.endswith("]")]
    assert len(listed) > 60
    for name in listed:
        draws = found.posterior[name]
        assert draws.mean() == pytest.approx(listed_in(found.results, name), rel=1e-6, abs=1e-9)


def test_the_spread_of_a_curve_is_its_uncertainty(found: Any) -> None:
    for name, curve in found.results["curves"].items():
        (unit,) = (key.removeprefix("u_") for key in curve if key.startswith("u_"))
        for i, u in enumerate(curve[f"u_{unit}"]):
            place = f"curves.{name}.error_{unit}[{i}]"
            assert (place in found.posterior) == (u > 1e-9)
            if place in found.posterior:
                assert found.posterior[place].std(ddof=1) == pytest.approx(u, rel=1e-6)


def test_a_chain_is_an_ensemble(found: Any) -> None:
    assert found.posterior.array.shape[:2] == (ENSEMBLES, DRAWS // ENSEMBLES)
    assert found.results["posterior"]["rhat_max"] == pytest.approx(found.posterior.rhat_max, rel=1e-12)
    assert np.isfinite(found.posterior.rhat_max)


def test_the_file_has_the_draws_that_results_json_speaks_of(found: Any) -> None:
    said = found.results["posterior"]
    content = found.outcome.files[said["file"]]
    assert hashlib.sha256(content).hexdigest() == said["sha256"]
    with np.load(io.BytesIO(content)) as file:
        assert list(file["names"]) == said["parameters"] == list(found.posterior)
        kept = file["centre"] + file["draws"]
    assert kept.shape == (said["chains"], said["draws"], len(found.posterior))
    spread = found.posterior.array.std(axis=(0, 1))
    np.testing.assert_allclose((kept - found.posterior.array[:, :: said["every"]]) / spread, 0, atol=1e-5)


def test_in_every_draw_the_curve_ends_where_the_scale_leads() -> None:
    """Between the ends of the first series the curve rises by the mean sensitivity error times the way."""
    found = cmm_uq.report(ROOT / "examples" / AXIS)
    result = found.outcome.found
    assert isinstance(result, ShiftResult)
    series = result.estimate.series
    first, last = series.reading[series.series == 0][[0, -1]]
    place = int(np.argmin(np.abs(series.positions - last)))
    assert series.positions[place] == pytest.approx(last, abs=0.5)
    rise = found.posterior["scale_x.ppm"] * 1e-3 * (last - first)  # ppm of mm, µm
    curve = found.posterior[f"curves.linearity_x.error_um[{place}]"]
    assert np.corrcoef(rise.ravel(), curve.ravel())[0, 1] > 0.999
    np.testing.assert_allclose(curve, rise, atol=0.02)


def test_what_is_zero_by_definition_has_no_draws() -> None:
    draws = np.array([[0.0, 1.0, 1e-17], [0.0, 3.0, -1e-17]])
    found = listed_draws("curve", draws, "µm")
    assert list(found) == ["curve[1]"]
    values, unit = found["curve[1]"]
    assert (values.tolist(), unit) == ([1.0, 3.0], "µm")
    assert listed_draws("curve", np.zeros((2, 3)), "µm") == {}
