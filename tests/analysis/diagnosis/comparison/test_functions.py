"""Functions that nobody knows: that they reach what they should, by construction."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from cmm_uq.analysis.diagnosis.comparison.explanations import (
    UNKNOWN_SD,
    Explanation,
    _functions,
    _one_sided,
    directions,
    unknown_functions,
)
from cmm_uq.app.commands.diagnose import screened_model
from cmm_uq.app.commands.reading import read_job
from cmm_uq.base.points import Floats

EXAMPLES = Path(__file__).parents[4] / "examples"


def reached(explanation: Explanation, what: Floats) -> float:
    """Largest part of a function's sum of squares that a version reaches."""
    parts = []
    for member in explanation.members:
        Q = np.linalg.qr(member.columns)[0]
        parts.append(float(np.sum((Q.T @ what) ** 2) / np.sum(what**2)))
    return max(parts)


@pytest.fixture(scope="module")
def of_sphere() -> tuple[dict[str, Explanation], Floats]:
    model, _ = screened_model(read_job(EXAMPLES / "sphere-simulated"))
    found = unknown_functions(model, model.estimate().least_squares.value)
    return {e.name: e for e in found}, directions(model)


@pytest.mark.parametrize("count", [5, 7, 10])
def test_lobes_of_a_probe_are_among_them_that_no_effect_has(
    of_sphere: tuple[dict[str, Explanation], Floats], count: int
) -> None:
    found, normals = of_sphere
    lobes = np.cos(count * np.arctan2(normals[:, 1], normals[:, 0]) + 0.4)
    assert reached(found["error in lobes about Z"], lobes) == pytest.approx(1.0)


def test_neighbouring_directions_of_probing_may_differ_at_will(
    of_sphere: tuple[dict[str, Explanation], Floats],
) -> None:
    found, normals = of_sphere
    distinct, which = np.unique(np.round(normals, 6), axis=0, return_inverse=True)
    at_will = np.random.default_rng(1).standard_normal(len(distinct))[which.ravel()]
    assert reached(found["error as a function of the probing direction"], at_will) > 0.9


def test_a_scale_may_depend_on_a_column_about_the_middle_of_the_volume() -> None:
    job = read_job(EXAMPLES / "step-gauge-simulated")
    load = 5 + 0.5 * np.arange(len(job.points)) % 37
    model, _ = screened_model(replace(job, points=replace(job.points, columns={**job.points.columns, "load_kg": load})))
    values = model.estimate().least_squares.value
    points = model.artefact.points.at(model.placed(values))
    found = {e.name: e for e in unknown_functions(model, values)}
    middle = 0.5 * (points.carriages.min(axis=0) + points.carriages.max(axis=0))
    u = (load - load.mean()) / np.ptp(load)
    what = model.seen(((1 + u - u**2)[:, None] * (points.carriages - middle))[:, :, None], values)[:, 0]
    assert reached(found["scale of all axes as a function of load at the ram"], what) > 0.999


def test_no_jump_parts_readings_of_one_place() -> None:
    """Repeats of a grid differ by their noise, and a point is placed as its residual says: between them nothing jumps."""
    model, _ = screened_model(read_job(EXAMPLES / "plane-simulated"))
    values = model.estimate().least_squares.value
    along_y = model.artefact.points.at(model.where(values)).readings["y"]
    found = {e.name: e for e in unknown_functions(model, values)}["error along Z as a function of Y"]
    jumps = [member.values[:, 0] for member in found.members if len(np.unique(member.values)) == 2]
    assert len(jumps) == len(np.unique(np.round(along_y))) - 1
    for high in (jump > 0 for jump in jumps):
        assert along_y[high].min() - along_y[~high].max() > 1.0


def test_a_jump_is_sought_between_every_two_readings_in_time() -> None:
    """One reading on its wrong side leaves the whole jump of that reading: nearly the right place is not nearly right."""
    job = read_job(EXAMPLES / "plate-simulated")
    time = 30.0 * np.arange(len(job.points)) ** 1.01
    model, _ = screened_model(replace(job, points=replace(job.points, columns={**job.points.columns, "time_s": time})))
    values = model.estimate().least_squares.value
    points = model.artefact.points.at(model.placed(values))
    scale = {e.name: e for e in unknown_functions(model, values)}["scale of X as a function of time"]
    along_x = points.readings["x"][:, None, None] * np.array([1.0, 0.0, 0.0])[:, None]
    for after in np.unique(time)[1:]:
        what = model.seen(along_x * np.where(time >= after, 1.0, -1.0)[:, None, None], values)[:, 0]
        assert reached(scale, what) == pytest.approx(1.0)


def test_a_jump_from_or_to_zero_is_among_them_where_no_constant_is_free() -> None:
    """A scale that was right until an hour and wrong after it: one version is it, and all weigh as before."""
    hour = np.arange(8.0)
    plain, sided = list(_functions(hour)), list(_one_sided(_functions(hour)))
    assert sum(w for _, w in sided) == pytest.approx(sum(w for _, w in plain))
    jumps = [f[:, 0] / UNKNOWN_SD for f, _ in sided if f.shape[1] == 1]
    for last in range(7):
        for wanted in (
            np.where(hour > last, 1.0, -1.0),
            np.where(hour > last, 1.0, 0.0),
            np.where(hour > last, 0.0, -1.0),
        ):
            assert any(np.allclose(jump, wanted, atol=1e-12) for jump in jumps), (last, wanted)
    assert len(jumps) == 3 * 7
