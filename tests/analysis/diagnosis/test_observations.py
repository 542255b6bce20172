"""Large recordings: which observations candidates are compared on, and that nothing grows with their square."""

from __future__ import annotations

import tracemalloc
from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from cmm_uq.analysis.diagnosis.held_out import LEAST_OF_SET_UP, MOST, improvement, thin_out, with_quantities
from cmm_uq.app.commands.reading import read_job
from cmm_uq.artefacts import artefact_facts, kind_of
from cmm_uq.artefacts.axis_runs.artefact import AxisRuns
from cmm_uq.artefacts.ballbar import Ballbar
from cmm_uq.artefacts.spheres.sphere import SphereArtefact
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.points import Machine, Points
from cmm_uq.machine.model import Noise, RecordingModel
from cmm_uq.machine.physics.catalogue import effects
from tests.artefacts.test_axis_runs import joined, run
from tests.conftest import ROOT
from tests.recordings import TRAVEL, bar_facts, bars

MACHINE = Machine("m", "XYZ", TRAVEL)


def observed(points: Points) -> Ballbar:
    return Ballbar(bar_facts(), points)


def many_bars(count: int, repeats: int = 1) -> RecordingModel:
    points = bars(np.random.default_rng(3), count, 400.0, MACHINE)
    again = Points(
        np.tile(points.xyz, (repeats, 1)), np.tile(points.measurement, repeats), np.tile(points.point, repeats),
        np.repeat(np.arange(1, repeats + 1), len(points)), MACHINE,
    )  # fmt: skip
    model = RecordingModel(observed(again), effects(("scale_x", "squareness_xy")))
    xyz = model.simulate(np.array([8.0, 12.0]), np.array([400.0]), Noise(1e-3), np.random.default_rng(4))
    return replace(model, artefact=observed(again.at(xyz)))


def spheres(placings: int, count: int) -> tuple[RecordingModel, SphereArtefact]:
    z = 1 - np.arange(count) / count
    turn, flat = np.pi * (3 - np.sqrt(5)) * np.arange(count), np.sqrt(1 - z**2)
    normals = np.tile(np.column_stack([flat * np.cos(turn), flat * np.sin(turn), z]), (placings, 1))
    centres = np.random.default_rng(1).uniform(TRAVEL[:, 0] + 50, TRAVEL[:, 1] - 50, (placings, 3))
    numbers = np.repeat(np.arange(1, placings + 1), count)
    points = Points(np.repeat(centres, count, axis=0) + 12.5 * normals, numbers,
                    np.tile(np.arange(1, count + 1), placings), np.ones_like(numbers), MACHINE)  # fmt: skip
    sphere = SphereArtefact(artefact_facts(kind="sphere", length_mm=25.0, u_um=0.1), points)
    return RecordingModel(sphere, effects(("probe_radius",))), sphere


def test_a_recording_of_a_thousand_observations_is_compared_as_it_is() -> None:
    model = many_bars(MOST)
    assert thin_out(model, observed, 0) is model


def test_of_many_bars_some_are_drawn_and_all_repeats_of_each() -> None:
    model = many_bars(900, 3)
    found = thin_out(model, observed, 0)
    counts = np.unique(found.artefact.measurement, return_counts=True)[1]
    assert set(counts.tolist()) == {3}
    assert MOST <= counts.sum() < MOST + 3
    assert np.ptp(found.artefact.measurement) > 850  # from the whole recording
    other = thin_out(model, observed, 1)
    assert set(other.artefact.measurement.tolist()) != set(found.artefact.measurement.tolist())


def test_where_some_points_cannot_be_observed_alone_the_others_are_not_used() -> None:
    model = many_bars(1500)

    def never(points: Points) -> Ballbar:
        raise CmmUqError("a point is missing")

    found, some = thin_out(model, never, 0), thin_out(model, observed, 0)
    assert found.artefact is model.artefact
    assert np.array_equal(found.artefact.measurement[found.used], some.artefact.measurement)


def test_a_point_ahead_of_a_surface_stays_with_its_placing() -> None:
    job = read_job(ROOT / "examples" / "plane-simulated")
    observe = partial(kind_of(job).observing("diagnosed"), job.facts.artefact)
    found = thin_out(RecordingModel(observe(job.points), ()), observe, 0, most=40).artefact
    assert sorted(found.points.measurement[found.points.point == 0].tolist()) == [1, 2]
    assert len(found.measurement) == 2 * LEAST_OF_SET_UP


@pytest.mark.parametrize("moving", [False, True])
def test_runs_at_rest_keep_their_repeats_and_those_in_motion_are_thinned(moving: bool) -> None:
    """Repeats at one place cost a model of the machine nothing; in motion each is a place more."""
    motion = {"on_the_fly": {"x": [100.0, 800.0], "u_delay_um": 0.1}} if moving else {}
    facts = artefact_facts(kind="axis_runs", u_scale_um_per_m=0.1, **motion)
    rows = run(1, np.eye(3)[0], at=np.arange(10.0, 890.0, 4.0), repeats=3)
    rows["reading_um"] = np.sin(rows["xyz"][:, 0] / 100)
    artefact = AxisRuns(facts, joined(rows))
    found = with_quantities(RecordingModel(artefact, ()), partial(AxisRuns, facts), 0, 100)
    assert len(artefact.points) > 3 * 400
    count = int(found.used.sum())
    assert 400 <= count < 403 if moving else 1200 <= count < 1203  # whole quantities, three readings each


def test_what_is_not_used_is_not_drawn() -> None:
    model = many_bars(2000)
    aside = np.arange(2000) % 2 == 0
    found = thin_out(replace(model, used=~aside), observed, 0, most=500)
    assert len(found.artefact.measurement) == 500
    assert not np.isin(found.artefact.measurement, model.artefact.measurement[aside]).any()


@pytest.mark.parametrize(("placings", "count", "each"), [(3, 900, MOST // 3), (50, 40, LEAST_OF_SET_UP)])
def test_points_are_drawn_evenly_from_every_placing_and_where_these_are_many_from_some(
    placings: int, count: int, each: int
) -> None:
    model, _ = spheres(placings, count)
    facts = artefact_facts(kind="sphere", length_mm=25.0, u_um=0.1)
    found = thin_out(model, lambda points: SphereArtefact(facts, points), 0)
    counts = np.unique(found.artefact.measurement, return_counts=True)[1]
    assert counts.max() == each
    assert len(found.artefact.measurement) < MOST + each
    assert len(counts) == min(placings, -(-MOST // LEAST_OF_SET_UP))


def test_the_estimate_from_some_agrees_with_that_from_all_within_its_uncertainty() -> None:
    model = many_bars(4000)
    some, whole = (m.estimate().least_squares for m in (thin_out(model, observed, 0), model))
    u_some, u_whole = (float(np.sqrt(found.covariance[1, 1])) for found in (some, whole))
    assert abs(some.value[1] - whole.value[1]) < 4 * u_some
    assert u_some / u_whole == pytest.approx(np.sqrt(4000 / MOST), rel=0.1)


def test_estimates_and_held_out_placings_of_five_thousand_bars_hold_no_square_matrix() -> None:
    """A square matrix of the observations would be 200 MB, one of a held-out tenth 2 MB; all columns together are 5 MB."""
    model = many_bars(5000)
    before = replace(model, effects=effects(("scale_x",)))
    tracemalloc.start()
    gain = improvement(before, model)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert gain.elpd_gain > 10 * gain.elpd_gain_se
    assert peak < 25e6
