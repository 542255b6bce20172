"""Damaged rows of a digitizer's recording are found, named and left out."""

from __future__ import annotations

import numpy as np
import pytest

from cmm_uq.artefacts import artefact_facts
from cmm_uq.artefacts.digitizer import DigitizerArtefact, offset_misfit
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.points import Points
from tests.artefacts.constructions import estimated
from tests.artefacts.digitizer.aligned import OFFSET, RADIUS, SIX, THREE, centres, scans
from tests.recordings import screened

CENTRES = artefact_facts(kind="digitizer")
SPHERES = artefact_facts(kind="digitizer", length_mm=2 * RADIUS, u_um=0.3)
HOW = {"needed": set(), "set_aside": [], "where": "recording.csv"}


def moved(points: Points, row: int, by: float = 3.0) -> Points:
    xyz = points.xyz.copy()
    xyz[row] += by
    return points.at(xyz)


@pytest.mark.parametrize(
    ("facts", "points", "row"),
    [
        (SPHERES, scans(), 17),
        (SPHERES, scans(THREE, 30), 80),
        (CENTRES, centres(THREE, 4), 5),
        (CENTRES, centres(SIX), 3),
    ],
)
def test_a_row_that_is_off_by_millimetres_is_left_out_and_the_offset_stays(
    facts: object, points: Points, row: int
) -> None:
    found = screened(moved(points, row), facts, **HOW)  # type: ignore[arg-type]
    (finding,) = found.findings
    assert finding.lines == (row + 2,)
    assert finding.set_aside
    assert len(found.points) == len(points) - 1
    np.testing.assert_allclose(estimated(facts, found.points, []).value[:3], OFFSET, atol=1e-6)  # type: ignore[arg-type]


def test_two_exchanged_alignments_are_named_as_what_they_are() -> None:
    points = centres(THREE, 4)
    xyz = points.xyz + np.random.default_rng(1).normal(0, 5e-3, points.xyz.shape)
    xyz[[1, 5]] = xyz[[5, 1]]
    (finding,) = screened(points.at(xyz), CENTRES, **HOW).findings
    assert finding.kind == "swapped"
    assert set(finding.lines) == {3, 7}


def test_clean_recordings_are_left_alone() -> None:
    for facts, points in ((SPHERES, scans()), (CENTRES, centres(SIX)), (CENTRES, centres())):
        assert screened(points, facts, **HOW).findings == ()


def test_readings_in_inches_are_refused() -> None:
    points = scans()
    with pytest.raises(CmmUqError, match="inch"):
        screened(points.at(points.xyz / 25.4), SPHERES, **HOW)


def test_a_wrong_sphere_is_refused() -> None:
    facts = artefact_facts(kind="digitizer", length_mm=25.9)
    with pytest.raises(CmmUqError, match=r"diameters of the scanned spheres are 25\.4 mm"):
        DigitizerArtefact(facts, scans())


def test_attitudes_that_tell_nothing_make_no_misfit() -> None:
    """Sampled by threes they are all the same; whoever makes the artefact is told so."""
    points = centres([THREE[0]] * 5)
    assert not offset_misfit(points.xyz, np.tile(np.eye(3).ravel(), (5, 1)), np.nan).any()
    assert not offset_misfit(points.xyz[:2], np.tile(np.eye(3).ravel(), (2, 1)), np.nan).any()
