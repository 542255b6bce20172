"""Candidates are placings that the machine and the fixtures allow, all of them and nothing else.

Ready plans have the positions that their standards ask for, and stay inside the machine.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from cmm_uq.analysis.planning.candidates import candidates, ready_plan
from cmm_uq.analysis.planning.set_up import direction_words, join, lines
from cmm_uq.analysis.planning.setting import Start
from cmm_uq.app.commands.reading import read_job
from cmm_uq.artefacts import artefact_of
from cmm_uq.artefacts.triangle import TriangleStandard, placed_triangle
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.points import Machine
from tests.analysis.planning.plans import BALLBAR, EVERY_KIND, GAUGE, MACHINE, setting
from tests.conftest import ROOT

KINDS = [kind for kind in EVERY_KIND if kind != "shift"]


@pytest.mark.parametrize("kind", KINDS)
def test_candidates_lie_inside_and_can_be_recorded(kind: str) -> None:
    facts, wishes = EVERY_KIND[kind]
    chosen = setting(facts, candidates=60, fixtures={"heights_mm": [-450.0, -150.0]}, **wishes)
    found = candidates(chosen)
    assert 10 < len(found) <= 60
    for placing in found:
        assert np.all(placing.points.machine_xyz >= chosen.volume.box[:, 0] - 1e-6)
        assert np.all(placing.points.machine_xyz <= chosen.volume.box[:, 1] + 1e-6)
        if kind != "sphere":  # of a hemisphere the ball is held, not the middle of its points
            assert -450.0 - 1e-6 <= placing.middle[2] <= -150.0 + 1e-6
    assert len(artefact_of(facts, join(found)).noise_scale) >= len(found)


def test_a_bar_is_laid_only_where_a_fixture_holds_it() -> None:
    found = candidates(setting(BALLBAR, fixtures={"directions": [[1.0, 0.0, 0.0], [0.0, 1.0, 1.0]]}))
    bars = {tuple(np.abs(p.points.xyz[1] - p.points.xyz[0]).round(1).tolist()) for p in found}
    assert bars == {(400.0, 0.0, 0.0), (0.0, 282.8, 282.8)}


def test_an_artefact_that_fits_nowhere_is_refused() -> None:
    with pytest.raises(CmmUqError, match="no placing is possible"):
        candidates(setting(BALLBAR.model_copy(update={"length_mm": 3000.0})))


def test_a_direction_in_which_nothing_fits_is_refused() -> None:
    upright = setting(BALLBAR.model_copy(update={"length_mm": 700.0}), fixtures={"directions": [[0.0, 0.0, 1.0]]})
    with pytest.raises(CmmUqError, match="no placing is possible"):
        candidates(upright)


def test_a_shift_job_has_nothing_to_choose_from() -> None:
    facts, _ = EVERY_KIND["shift"]
    with pytest.raises(CmmUqError, match="no other placings"):
        candidates(setting(facts, named=()))


def test_a_recorded_placing_is_tried_elsewhere_as_it_was_recorded() -> None:
    chosen = setting(GAUGE, length_mm=400.0)
    recorded = candidates(chosen)[40]
    found = candidates(chosen, Start(chosen.observed(recorded.points), recorded))
    assert "attitude as recorded" in {placing.title for placing in found}
    lengths = {round(float(np.linalg.norm(p.points.xyz[-1] - p.points.xyz[0])), 6) for p in found}
    assert len(lengths) == 1


def test_directions_are_named_as_an_operator_says_them() -> None:
    assert direction_words(np.array([-1.0, 0.0, 0.0])) == "along X"
    assert direction_words(np.array([-1.0, 1.0, 0.0])) == "along +X −Y"
    assert direction_words(np.array([0.0, 1.0, 1.0])) == "along +Y +Z, inclined 45°"


def test_the_diagonals_of_a_cube_are_those_of_its_directions() -> None:
    assert len(lines(np.full(3, 500.0))) == 13
    assert len(lines(np.array([900.0, 500.0, 300.0]))) > 13


@pytest.mark.parametrize("kind", EVERY_KIND)
def test_every_artefact_has_a_plan_inside_the_volume_that_can_be_recorded(kind: str) -> None:
    facts, wishes = EVERY_KIND[kind]
    chosen = setting(facts, **wishes)
    name, placings = ready_plan(chosen)
    assert name == next(iter(chosen.planning.ready))
    box = chosen.volume.box
    for placing in placings:
        assert np.all(placing.points.machine_xyz >= box[:, 0] - 1e-6)
        assert np.all(placing.points.machine_xyz <= box[:, 1] + 1e-6)
    if kind != "shift":
        assert len(artefact_of(facts, join(placings)).noise_scale) > 0


def test_the_twenty_positions_point_as_in_the_recording_that_followed_the_standard() -> None:
    """Harris 2004, figures C 1 and C 2, measured by figure 26 of ASME B89.4.1-1997; his row 18 repeats row 14."""
    recorded = read_job(ROOT / "examples" / "iota-1102-20C").points
    _, placings = ready_plan(setting(BALLBAR))
    assert len(placings) == 20
    for number, placing in enumerate(placings, 1):
        if number == 18:
            continue
        ends = recorded.xyz[recorded.measurement == number]
        measured = ends[1] - ends[0]
        planned = placing.points.xyz[1] - placing.points.xyz[0]
        cosine = abs(measured @ planned) / np.linalg.norm(measured) / np.linalg.norm(planned)
        # a bar stand is set by eye: the recorded diagonals are up to twelve degrees off those of a cube
        assert np.degrees(np.arccos(min(cosine, 1.0))) < 12.0, number


def test_a_long_machine_gets_ten_diagonals_more_for_each_further_cube() -> None:
    long = Machine("long", "XYZ", np.array([[0.0, 2400.0], [0.0, 800.0], [-700.0, 0.0]]))
    _, placings = ready_plan(setting(BALLBAR, machine=long))
    assert len(placings) == 30
    middles = np.array([placing.middle[0] for placing in placings])
    assert middles.min() < 800
    assert middles.max() > 1600


def test_seven_lines_of_five_lengths_three_times_are_a_hundred_and_five_lengths() -> None:
    """ISO 10360-2:2009, 6.3: four space diagonals, three axes."""
    _, placings = ready_plan(setting(GAUGE, length_mm=1000.0))
    assert len(placings) == 7
    lengths = 0
    for placing in placings:
        reference = placing.points.columns["reference_mm"]
        assert len(np.unique(reference[reference > 0])) == 5
        assert int(np.sum(reference > 0)) == 2 * 3 * 5  # there, and back
        lengths += int(np.sum(reference > 0)) // 2
    assert lengths == 105
    for axis, placing in enumerate(placings[4:]):
        moved = np.ptp(placing.points.xyz, axis=0)
        assert np.flatnonzero(moved > 1e-6).tolist() == [axis]
    diagonals = [np.sign(p.points.xyz[1] - p.points.xyz[0]) for p in placings[:4]]
    assert len({tuple(d * d[2]) for d in diagonals}) == 4


def test_the_triangle_stands_in_the_seven_placings_of_its_source() -> None:
    facts, _ = EVERY_KIND["triangle"]
    chosen = setting(facts, repeats=1)
    _, placings = ready_plan(chosen)
    wanted = placed_triangle(replace(MACHINE, travel_mm=chosen.volume.box), TriangleStandard.of(facts).sides)
    np.testing.assert_allclose(np.vstack([p.points.xyz for p in placings]), wanted.xyz)
    assert all(placing.points.machine is MACHINE for placing in placings)


def test_twenty_five_points_cover_the_hemisphere_with_normals_away_from_the_middle() -> None:
    facts, _ = EVERY_KIND["sphere"]
    _, (placing,) = ready_plan(setting(facts, repeats=1))
    normals = np.column_stack([placing.points.columns[f"n{a}"] for a in "xyz"])
    assert len(normals) == 25
    np.testing.assert_allclose(np.linalg.norm(normals, axis=1), 1.0)
    assert np.all(normals[:, 2] > -1e-12)
    centre = placing.points.xyz - 12.5 * normals
    np.testing.assert_allclose(centre, centre[:1].repeat(25, axis=0), atol=1e-9)


def test_shift_series_are_the_same_places_moved_by_each_shift() -> None:
    facts, _ = EVERY_KIND["shift"]
    _, placings = ready_plan(setting(facts, named=(), repeats=1))
    first = placings[0].points.machine_xyz
    assert len(first) == 23
    np.testing.assert_allclose(np.diff(first[:, 0]), 20.0)
    for placing, shift in zip(placings, (0.0, 20.0, 50.0), strict=True):
        np.testing.assert_allclose(placing.points.machine_xyz - first, [[shift, 0, 0]] * 23, atol=1e-9)


def test_a_swept_bar_keeps_its_length_from_one_centre() -> None:
    facts, wishes = EVERY_KIND["bryan"]
    chosen = setting(facts, **wishes)
    _, placings = ready_plan(chosen)
    assert len(placings) == 25
    centre = chosen.volume.box.mean(axis=1)
    reach = [np.linalg.norm(placing.points.machine_xyz - centre, axis=1) for placing in placings]
    np.testing.assert_allclose(reach, 300.0)


def test_a_plan_for_another_artefact_is_refused() -> None:
    with pytest.raises(CmmUqError, match=r"no plan for a job of kind 'ballbar'.*'ASME B89\.4\.1'"):
        ready_plan(setting(BALLBAR, ready="ISO 10360-2"))


def test_a_bar_that_does_not_fit_is_refused() -> None:
    with pytest.raises(CmmUqError, match="long along Z"):
        ready_plan(setting(BALLBAR.model_copy(update={"length_mm": 700.0})))


def test_a_direction_that_no_fixture_holds_is_refused() -> None:
    with pytest.raises(CmmUqError, match="no fixture holds the artefact along"):
        ready_plan(setting(BALLBAR, fixtures={"directions": [[1.0, 0.0, 0.0]]}))


def test_a_gauge_of_unknown_length_is_asked_for_it() -> None:
    with pytest.raises(CmmUqError, match="length of the artefact is needed"):
        ready_plan(setting(GAUGE))
