"""Components of noise that a recording could show."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from cmm_uq.app.commands.diagnose import screened_model
from cmm_uq.app.commands.reading import read_job
from cmm_uq.artefacts import artefact_facts, artefact_of, kind_of
from cmm_uq.base.points import Floats, Machine, Points
from cmm_uq.machine.model import Noise, RecordingModel
from cmm_uq.machine.model.noise import _step_of_lengths, mean_and_contrasts, noise_of, repeated_quantity
from cmm_uq.machine.model.recorded import display_step
from cmm_uq.maths.inference.noise import AXES, GROWTH, PLACING, SLOW, Sizes
from tests.artefacts.constructions import plate

EXAMPLES = Path(__file__).parents[3] / "examples"


def example(name: str, repeats: int = 1, *, timed: bool = False) -> RecordingModel:
    """The model of an example, each row read so many times, perhaps one a minute."""
    job = read_job(EXAMPLES / name)
    points = job.points
    rows = np.tile(np.arange(len(points)), repeats)
    columns = {key: values[rows] for key, values in points.columns.items()}
    columns |= {"time_s": 60.0 * np.arange(len(rows))} if timed else {}
    repeat = points.repeat[rows] + points.repeat.max() * np.repeat(np.arange(repeats), len(points))
    read = replace(
        points, xyz=points.xyz[rows], measurement=points.measurement[rows], point=points.point[rows], repeat=repeat,
        columns=columns, lines=np.arange(len(rows)),
    )  # fmt: skip
    model, _ = screened_model(job)
    observe = kind_of(job).observing("tested")
    return RecordingModel(observe(job.facts.artefact, read, where="recording"), model.effects)


def seen(model: RecordingModel, noise: Noise, draws: int) -> Floats:
    """Observations (draws, m), mm, of noise drawn at the points."""
    random = np.random.default_rng(8)
    each = np.stack([noise.drawn(model.artefact.points, random) for _ in range(draws)], axis=2)
    return model.artefact.project(model.placed(model.estimate().least_squares.value), each).T


@pytest.mark.long
@pytest.mark.parametrize(
    "name", ["iota-1102-20C", "step-gauge-simulated", "plate-simulated", "sphere-simulated", "digitizer-simulated"]
)
def test_the_covariance_of_observations_is_that_of_noise_at_the_points(name: str) -> None:
    """Readings by axis, twice each, and set-up offsets; over 4000 drawings, in units of each variance."""
    model = example(name, 2)
    drawn = seen(model, Noise((1e-3, 2e-3, 3e-3), placing=1.5e-3), 4000)
    sizes = Sizes(np.array([[1e-3, 2e-3, 3e-3]]), np.array([1.5e-3]), np.zeros(1), np.zeros(1), np.ones(1))
    repeated = noise_of(model).repeated(sizes, 4000, np.random.default_rng(9))[0]
    chosen = np.linspace(0, drawn.shape[1] - 1, 60).astype(int)
    wanted, found = (np.cov(values[:, chosen], rowvar=False) for values in (drawn, repeated))
    scale = np.sqrt(np.diag(wanted))
    assert np.abs((found - wanted) / np.outer(scale, scale)).max() < 0.16  # five standard errors of a difference of two


def test_only_what_can_show_is_reckoned_with() -> None:
    assert noise_of(example("iota-1102-20C")).possible == (AXES,)
    assert noise_of(example("iota-1102-20C", 2)).possible == (AXES, PLACING)
    assert noise_of(example("iota-1102-20C", 2, timed=True)).possible == (AXES, PLACING, SLOW)
    assert GROWTH in noise_of(example("step-gauge-simulated")).possible


def test_the_order_of_the_rows_says_nothing_without_a_time() -> None:
    model = example("plate-simulated", 2)
    assert noise_of(model).slow.shape[1] == 0


def test_the_order_of_runs_says_when_they_were_read() -> None:
    """Each round of a circle by itself, from its first point to its last, however the rows are sorted; a time goes before."""
    model = example("circles-simulated")
    assert noise_of(model).slow.shape[1] == 0
    found = noise_of(model, in_turn=True)
    rounds = np.unique(np.column_stack([model.artefact.measurement, model.artefact.repeat]), axis=0)
    assert SLOW in found.possible
    assert found.slow.shape[1] == 25 * len(rounds)
    own = (model.artefact.measurement == 1) & (model.artefact.repeat == 1)
    order = model.artefact.points.point[model.artefact.rows[own, 0]]
    place = np.argsort(np.argsort(order)) / (own.sum() - 1)
    seen = found.slow[own]
    used = np.flatnonzero(np.any(seen != 0, axis=0))
    for k, column in enumerate(used):
        wave = np.sqrt(2.0 if k else 1.0) * np.cos(np.pi * k * place) * model.artefact.noise_scale[own]
        np.testing.assert_allclose(seen[:, column], wave, atol=1e-12)
    assert np.all(found.slow[~own][:, used] == 0)
    timed = example("circles-simulated", timed=True)
    np.testing.assert_array_equal(noise_of(timed, in_turn=True).slow, noise_of(timed).slow)


@pytest.mark.parametrize(("name", "cosines"), [("plate-simulated", 3 * 73), ("sphere-simulated", 3 * 25)])
def test_observations_along_one_axis_each_see_more_cosines_than_those_along_several(name: str, cosines: int) -> None:
    assert noise_of(example(name, 2, timed=True)).slow.shape[1] == cosines


@pytest.mark.parametrize(("side", "grows"), [(3, False), (4, True)])
def test_the_last_digits_of_a_square_plate_do_not_decide_whether_noise_may_grow(side: int, *, grows: bool) -> None:
    """Its longest distance from a corner is √2 and 1.5 times the median one, whatever noise and order it is read with."""
    points = plate([(0.0, 0.0, 0.0), (0.0, 0.0, 90.0)], side=side)
    twice = replace(
        points, xyz=np.tile(points.xyz, (2, 1)), measurement=np.tile(points.measurement, 2), point=np.tile(points.point, 2),
        repeat=np.repeat([1, 2], len(points)), columns={k: np.tile(v, 2) for k, v in points.columns.items()},
        lines=np.arange(2 * len(points)),
    )  # fmt: skip
    random, facts = np.random.default_rng(3), artefact_facts(kind="plate", nominal=True)
    for sd in (0.0, 1e-6, 1e-3, 1e-2):
        order = random.permutation(len(twice))
        read = replace(
            twice, xyz=(twice.xyz + random.normal(0, sd, twice.xyz.shape))[order], measurement=twice.measurement[order],
            point=twice.point[order], repeat=twice.repeat[order], columns={k: v[order] for k, v in twice.columns.items()},
        )  # fmt: skip
        possible = noise_of(RecordingModel(artefact_of(facts, read), ())).possible
        assert (GROWTH in possible) is grows, sd


def test_turning_keeps_every_length() -> None:
    turn = noise_of(example("plate-simulated", 2)).turn.toarray()
    assert np.allclose(turn @ turn.T, np.eye(len(turn)), atol=1e-12)


@pytest.mark.parametrize("repeats", [1, 2, 7, 100, 101, 137, 1000])
def test_repeats_are_turned_to_their_mean_and_what_is_orthogonal_to_it(repeats: int) -> None:
    turn = mean_and_contrasts(repeats)
    np.testing.assert_allclose((turn @ turn.T).toarray(), np.eye(repeats), atol=1e-12)
    np.testing.assert_allclose(turn[[0]].toarray()[0], 1 / np.sqrt(repeats), atol=1e-14)


def test_ten_thousand_repeats_take_no_square_matrix() -> None:
    assert mean_and_contrasts(10_000).nnz < 3 * 100 * 10_000


@pytest.mark.parametrize(
    ("example", "observations_a_reading"),
    [("bryan-simulated", 1), ("step-gauge-simulated", 1), ("sphere-simulated", 1), ("plate-simulated", 3)],
)
def test_observations_repeat_each_other_when_they_are_one_quantity_of_one_placing(
    example: str, observations_a_reading: int
) -> None:
    model, _ = screened_model(read_job(EXAMPLES / example))
    artefact = model.artefact
    number = repeated_quantity(model, model.used)
    points = artefact.points.point[artefact.rows][model.used]
    assert len(number) == model.used.sum()
    for k in np.unique(number):
        same = number == k
        assert len(np.unique(artefact.measurement[model.used][same])) == 1
        assert len(np.unique(points[same], axis=0)) == 1
        assert len(np.unique(artefact.repeat[model.used][same])) == same.sum()
    readings = np.unique(np.column_stack([artefact.measurement[model.used], points]), axis=0)
    assert len(np.unique(number)) == observations_a_reading * len(readings)


def test_lengths_on_a_diagonal_have_the_step_that_they_are_printed_to() -> None:
    """105 lengths to 0.1 µm from one place: no noise is below what their last digit hides, though no coordinate has a step."""
    length = np.round(100.0 * (1 + np.arange(105) % 5) + np.random.default_rng(5).normal(0, 3e-4, 105), 4)
    way = np.array([0.6337, 0.6337, 0.4436]) / np.linalg.norm([0.6337, 0.6337, 0.4436])
    from_start = np.stack([np.zeros((105, 3)), length[:, None] * way], axis=1).reshape(-1, 3)
    ends = from_start + np.array([120.0, 190.0, 120.0])
    number = np.repeat(np.arange(1, 106), 2)
    points = Points(ends, number, np.tile([1, 2], 105), np.ones_like(number), Machine())
    assert display_step(points.xyz, 1e-4) == 0.0
    assert _step_of_lengths(points, 1e-4) == pytest.approx(1e-4)
    assert _step_of_lengths(points, 3e-2) == 0.0  # beside which a tenth of a micrometre is nothing
    assert _step_of_lengths(replace(points, columns={"reading_um": 0.0 * number}), 1e-4) == 0.0
