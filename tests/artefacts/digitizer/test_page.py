"""What the certificate, the plan and results.json of a digitizer say."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from cmm_uq.app.commands.plan import write_plan
from cmm_uq.app.commands.reading import read_job
from cmm_uq.artefacts.digitizer import THREE as PLANNED, DigitizerArtefact, scan, words
from cmm_uq.artefacts.digitizer_page import DigitizerFigures, results
from cmm_uq.base.errors import CmmUqError
from cmm_uq.certificate.document import Paragraph
from cmm_uq.certificate.sections.results import summary
from cmm_uq.jobs.reports import digitizer_of
from cmm_uq.jobs.tables.machine import DigitizerFacts
from cmm_uq.machine.physics.digitizer import euler_313
from tests.artefacts.digitizer.aligned import OFFSET, THREE
from tests.artefacts.reading import number
from tests.artefacts.simulated import analysed, blocks, document, table
from tests.conftest import ROOT

JOB = "digitizer-simulated"


def test_the_offset_put_into_the_example_is_found() -> None:
    rows = table(JOB, "Offset of the mount").rows
    for (_, value, U, k, unit, *_), true in zip(rows, OFFSET, strict=True):
        assert abs(number(value) - true) < 2 * number(U)
        assert 1.9 < number(k) < 2.05
        assert unit == "mm"


def test_correlations_are_those_of_the_posterior() -> None:
    draws = analysed(JOB).posterior.draws[:, :3]
    rows = table(JOB, "Offset of the mount").rows
    printed = [[number(cell) for cell in row[5:]] for row in rows]
    np.testing.assert_allclose(printed, np.corrcoef(draws.T), atol=0.0051)


def test_u_says_what_it_contains() -> None:
    (said,) = [b.text for b in blocks(JOB) if isinstance(b, Paragraph) and b.text.startswith("In each attitude")]
    assert said == (
        "In each attitude by itself, U contains: attitude, u = 2″ about each axis; the sphere's centre as a whole, "
        "u = (1, 1, 1) µm along x, y, z."
    )


def test_the_other_ways_agree_within_the_uncertainty() -> None:
    for _, fitted, by_centres, closed, _ in table(JOB, "The offset by other ways").rows:
        assert number(by_centres) == pytest.approx(number(fitted), abs=0.008)
        assert number(closed) == pytest.approx(number(fitted), abs=0.008)


def test_the_closed_form_is_that_of_the_source_by_hand() -> None:
    """Equation 19: U1 = ½ (E1 − E2 + F2 − F1), from the readings that the certificate prints."""
    rows = table(JOB, "Every attitude").rows
    D, E, F = np.array([[number(cell) for cell in row[5:8]] for row in rows]).T
    by_hand = 0.5 * np.array([E[0] - E[1] + F[1] - F[0], E[0] - E[1] - F[1] + F[0], D[0] - D[2] + E[2] - E[0]])
    printed = [number(row[3]) for row in table(JOB, "The offset by other ways").rows]
    np.testing.assert_allclose(printed, by_hand, atol=2e-4)


def test_every_attitude_stands_with_its_angles_its_points_and_how_far_it_is_off() -> None:
    figures = DigitizerFigures(analysed(JOB))
    offset = np.array([one.value for one in figures.offset])
    for row, angles, pose in zip(table(JOB, "Every attitude").rows, THREE, figures.poses, strict=True):
        assert [number(cell) for cell in row[1:4]] == list(angles)
        assert row[4] == "74"
        expected = pose.reading_mm - (np.array(figures.sphere) + euler_313(*np.radians(angles)) @ offset)
        assert [number(cell) for cell in row[8:11]] == pytest.approx((1e3 * expected).tolist(), abs=0.051)
        assert 6 < number(row[11]) < 13  # 9 µm of 74 points


def test_results_hold_offset_covariance_and_poses() -> None:
    found = results(analysed(JOB))["digitizer"]
    covariance = np.array(found["covariance_mm2"])
    u = [found["offset_mm"][name]["u"] for name in ("U1", "V1", "W1")]
    np.testing.assert_allclose(np.sqrt(np.diag(covariance)), u, rtol=1e-9)
    np.testing.assert_allclose(covariance, covariance.T)
    assert [(p["pose"], p["alpha_deg"], p["beta_deg"], p["gamma_deg"]) for p in found["poses"]] == [
        (i, *angles) for i, angles in enumerate(THREE, 1)
    ]
    assert found["sphere_mm"] == pytest.approx([300.0, 480.0, -480.0], abs=0.02)
    json.dumps(found, allow_nan=False)


def test_a_job_reads_offset_covariance_and_attitudes_back_from_what_its_calibration_wrote() -> None:
    written = results(analysed(JOB))
    content = json.dumps({"schema": "cmm-uq/results/1", "job": {"id": JOB, "origin": "simulated"}, **written}).encode()
    facts = DigitizerFacts(calibration="results.json")
    found = digitizer_of(facts, {"results.json": content}, Path("job"), "simulated")
    assert found is not None
    assert [(p.pose, p.alpha_deg, p.beta_deg, p.gamma_deg) for p in found.poses] == [
        (i, *angles) for i, angles in enumerate(THREE, 1)
    ]
    assert found.offset_mm == tuple(written["digitizer"]["offset_mm"][name]["value"] for name in ("U1", "V1", "W1"))
    assert np.array_equal(np.array(found.covariance_mm2), np.array(written["digitizer"]["covariance_mm2"]))


def test_what_is_known_of_a_set_up_is_no_certified_dimension() -> None:
    result = analysed(JOB)
    roles = [size.role for size in result.artefact.sizes]
    assert roles == ["sought"] * 3 + ["dimension"] + ["set-up"] * 18
    traced = next(s for s in document(JOB).sections if s.title == "Artefact and traceability")
    assert "arcsec" not in str(traced)
    assert "auto-calibration" not in str(traced)
    assert [row[0] for row in summary(result, ()).figures] == ["U1", "V1", "W1"]


def test_the_least_determined_direction_is_the_weakest_of_a_monte_carlo() -> None:
    """Second method: centres drawn with unit noise, the offset solved by lstsq; 40 000 draws know u to 0.4 %."""
    figures = DigitizerFigures(analysed(JOB))
    direction, times = figures.times
    design = np.vstack([np.hstack([euler_313(*np.radians(angles)), np.eye(3)]) for angles in THREE])
    drawn = np.linalg.lstsq(design, np.random.default_rng(5).standard_normal((9, 40_000)), rcond=None)[0][:3]
    assert np.std(direction @ drawn) == pytest.approx(times, rel=0.02)
    assert np.sqrt(np.linalg.eigvalsh(np.cov(drawn))[-1]) == pytest.approx(times, rel=0.02)


def test_directions_in_words() -> None:
    assert words(np.array([0.0, 0.001, 1.0])) == "w"
    assert words(np.array([0.6, 0.0, -0.8])) == "0.60 u − 0.80 w"
    assert words(np.array([-0.6, 0.8, 0.0])) == "−0.60 u + 0.80 v"


def planned(folder: Path, **changes: str) -> Path:
    """The example before it is measured: no recording."""
    folder.mkdir()
    text = (ROOT / "examples" / JOB / "job.toml").read_text(encoding="utf-8").replace('origin = "simulated"\n', "")
    for old, new in changes.items():
        assert f"{old} =" in text
        text = "\n".join(new if line.startswith(f"{old} =") else line for line in text.splitlines())
    (folder / "job.toml").write_text(f"{text}\n[plan]\nrepeats = 2\n", encoding="utf-8")
    return folder


def test_the_source_s_three_attitudes_are_planned_with_what_they_will_tell(tmp_path: Path) -> None:
    """Their scans make a recording of this kind that gives the drawing's offset back."""
    plan = write_plan(planned(tmp_path / "job"), tmp_path / "plan", power=False)
    expected = {one["parameter"]: one["u"] for one in json.loads(plan.results)["start"]["determined"]}
    assert list(expected) == ["U1_mm", "V1_mm", "W1_mm"]
    assert all(1e-3 < u < 4e-3 for u in expected.values())
    job = tmp_path / "measured"
    planned(job)
    lines = plan.files["plan.csv"].read_text(encoding="utf-8").splitlines(keepends=True)
    (job / "recording.csv").write_text("".join(line for line in lines if not line.startswith("#")), encoding="utf-8")
    read = read_job(job)
    assert len(read.points) == 3 * 2 * 37
    np.testing.assert_allclose(
        DigitizerArtefact(read.facts.artefact, read.points).start.offset, [1.0, 264.5, 129.6], atol=1e-5
    )  # type: ignore[arg-type]


def test_centres_are_planned_where_no_sphere_is_described(tmp_path: Path) -> None:
    folder = planned(tmp_path / "job", length_mm="", u_um="")
    lines = (
        write_plan(folder, tmp_path / "plan", power=False).files["plan.csv"].read_text(encoding="utf-8").splitlines()
    )
    assert len([line for line in lines if line[:1].isdigit()]) == 3 * 2


@pytest.mark.parametrize(
    ("changes", "told"),
    [
        ({"offset_mm": ""}, "where the mount lies is needed"),
        ({"travel_mm": "travel_mm = { x = [0, 900], y = [0, 300], z = [-600, 0] }"}, "over the three attitudes"),
    ],
)
def test_what_cannot_be_planned_is_refused_in_words(tmp_path: Path, changes: dict[str, str], told: str) -> None:
    with pytest.raises(CmmUqError, match=told):
        write_plan(planned(tmp_path / "job", **changes), tmp_path / "plan", power=False)


def test_no_other_attitudes_are_searched_for(tmp_path: Path) -> None:
    folder = planned(tmp_path / "job")
    path = folder / "job.toml"
    path.write_text(path.read_text(encoding="utf-8") + 'criterion = "D"\n', encoding="utf-8")
    with pytest.raises(CmmUqError, match="those of its wrist"):
        write_plan(folder, tmp_path / "plan", power=False)


def test_a_planned_scan_lies_on_the_sphere_seen_along_v() -> None:
    assert PLANNED == THREE
    attitude = euler_313(0.3, 1.1, -0.4)
    seen, moved = scan(attitude, OFFSET, 12.7)
    point = moved + (np.column_stack([seen, 0 * seen[:, 0]]) - OFFSET) @ attitude.T
    np.testing.assert_allclose(np.linalg.norm(point, axis=1), 12.7)
    assert (point @ attitude[:, 1]).min() > 0
