"""An axis that leans far beyond what physics allows is seen by the recording, not held back by its prior."""

from __future__ import annotations

import csv
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from cmm_uq.app.commands.report import analyse
from cmm_uq.artefacts import artefact_facts
from cmm_uq.artefacts.triangle import TriangleStandard, placed_triangle
from cmm_uq.base.points import Machine, Points
from cmm_uq.certificate.result import Result
from cmm_uq.certificate.sections.method import warnings
from cmm_uq.jobs.tables.artefact import ArtefactFacts
from cmm_uq.machine.model import RecordingModel
from cmm_uq.machine.physics.catalogue import effects
from cmm_uq.maths.inference.posterior import Density
from tests.artefacts.constructions import FLAT, leaning, model, plate
from tests.conftest import ROOT

LEANS = ("squareness_xy", "squareness_yz", "squareness_zx")
PLACES = np.array([[0.0, 900.0], [0.0, 1200.0], [-600.0, 0.0]])
EXAMPLE = ROOT / "examples" / "triangle-simulated"


def indicated(points: Points, arcsec: Sequence[float], noise_um: float, seed: int = 0) -> Points:
    """What scales on such axes read at the points, with noise."""
    noise = np.random.default_rng(seed).normal(0.0, 1e-3 * noise_um, points.xyz.shape)
    return points.at(points.xyz @ np.linalg.inv(leaning(arcsec)) + noise)


def facts() -> ArtefactFacts:
    return artefact_facts(kind="triangle", blocks_mm=[480.0, 280.0, 380.0], u_blocks_um=0.1,
                          cylinders_mm=[20.0] * 3, u_cylinders_um=0.1)  # fmt: skip


def triangle(arcsec: Sequence[float]) -> RecordingModel:
    sides = TriangleStandard.of(facts()).sides
    points = placed_triangle(Machine("moving table Y", "YXZ", PLACES), sides, repeats=3)
    return model(facts(), indicated(points, arcsec, 1.0), LEANS, None)


def prior_sds(found: RecordingModel) -> dict[str, float]:
    return {one.key[0]: one.prior_sd for one in found.estimate().linear.unknowns if one.key[0] in LEANS}


THREE_DEGREES = (10800.0, -9720.0, 11880.0)


def test_beside_three_degrees_noise_of_micrometres_is_likelier_than_of_millimetres() -> None:
    found = triangle(THREE_DEGREES)
    evidence = {size: Density(found.estimate().linear).conditional(np.log(size))[2] for size in (1e-3, 3.0, 10.0)}
    assert evidence[1e-3] > evidence[3.0] + 100
    assert evidence[1e-3] > evidence[10.0] + 100


def test_a_prior_that_the_recording_contradicts_is_as_wide_as_the_angle_and_changes_nothing_of_it() -> None:
    found = triangle(THREE_DEGREES)
    assert list(prior_sds(found).values()) == pytest.approx(np.abs(THREE_DEGREES), rel=1e-3)
    linear = found.estimate().linear
    mean, covariance, _ = Density(linear).conditional(np.log(1e-3))
    u = np.sqrt(np.diag(covariance))[:3]
    anything = tuple(replace(one, prior_sd=1e9) if one.key[0] in LEANS else one for one in linear.unknowns)
    free, _, _ = Density(replace(linear, unknowns=anything)).conditional(np.log(1e-3))
    assert np.all(u < 5)
    assert np.all(np.abs(mean - free)[:3] < 1e-4 * u)


@pytest.mark.parametrize("arcsec", [(12.0, -7.0, 4.0), (1900.0, -1900.0, 1900.0)])
def test_other_priors_are_those_of_physics(arcsec: Sequence[float]) -> None:
    assert prior_sds(triangle(arcsec)) == dict.fromkeys(LEANS, 500.0)


def test_one_that_leans_far_leaves_the_others_priors() -> None:
    assert prior_sds(triangle((0.0, 4000.0, 0.0))) == pytest.approx(
        {"squareness_xy": 500.0, "squareness_yz": 4000.0, "squareness_zx": 500.0}, rel=1e-3
    )


def test_what_noise_alone_makes_of_an_angle_contradicts_nothing() -> None:
    """A plate that lies flat does not show how the third axis stands, wherever least squares put it."""
    points = plate((FLAT, FLAT))
    random = np.random.default_rng(3).normal(0.0, 1e-3, points.xyz.shape)
    found = model(artefact_facts(kind="plate", name="plate"), points.at(points.xyz + random), LEANS, None)
    assert prior_sds(found) == dict.fromkeys(LEANS, 500.0)


def leaning_job(folder: Path) -> Result:
    rows = [line for line in (EXAMPLE / "recording.csv").read_text().splitlines() if not line.startswith("#")]
    head, *cells = csv.reader(rows)
    columns = [head.index(f"{axis}_mm") for axis in "xyz"]
    sides = TriangleStandard.of(facts()).sides
    points = placed_triangle(Machine("moving table Y", "YXZ", PLACES), sides, repeats=3)
    for row, xyz in zip(cells, indicated(points, THREE_DEGREES, 1.0, seed=1).xyz, strict=True):
        for column, value in zip(columns, xyz, strict=True):
            row[column] = f"{value:.5f}"
    (folder / "job.toml").write_text((EXAMPLE / "job.toml").read_text())
    (folder / "recording.csv").write_text("\n".join(",".join(row) for row in [head, *cells]) + "\n")
    return analyse(folder)


@pytest.mark.long
def test_a_triangle_finds_three_degrees_within_their_uncertainty_and_says_what_was_assumed(tmp_path: Path) -> None:
    result = leaning_job(tmp_path)
    assert result.posterior.converged
    for name, truth in zip(LEANS, THREE_DEGREES, strict=True):
        found = result.parameters[name]["angle_arcsec"]
        assert found.u < 3
        assert found.value == pytest.approx(truth, abs=4 * found.u)
    said = [str(text) for text in warnings(result)]
    assert sum("the recording contradicts what was known beforehand so clearly" in text for text in said) == 3
    assert any("known beforehand (500 ″)" in text for text in said)


def test_leaning_axes_are_the_effects_own_too() -> None:
    """The construction here and the package's effects agree on the sign of every angle."""
    found = triangle((5000.0, -3000.0, 4000.0)).estimate().least_squares.value
    assert found[:3] == pytest.approx([5000.0, -3000.0, 4000.0], abs=10)
    assert [effect.name for effect in effects(LEANS)] == list(LEANS)
