"""The recordings of the coverage study: independent of the package, and what they claim to be."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import cmm_uq
from benchmarks.coverage.artefacts import ARTEFACTS, Placed
from benchmarks.coverage.cells import STATED, Cell, cells
from benchmarks.coverage.noises import NOISES, Readings
from benchmarks.coverage.recordings import error, recording
from cmm_uq.app.commands.diagnose import screened_model
from tests.imports import packages_reached

ARCSECOND = np.pi / 648000


def test_no_code_of_the_package_draws_a_recording() -> None:
    assert not {"cmm_uq", "scipy", "pandas"} & packages_reached(
        "benchmarks.coverage.cells", "benchmarks.coverage.recordings"
    )
    assert all(recording(cell, 1, 0).files for cell in cells())


def test_every_artefact_meets_every_noise_in_at_most_a_hundred_cells() -> None:
    every = cells()
    assert len(every) == len({cell.name for cell in every}) == len({cell.key for cell in every}) <= 100
    assert {(c.artefact, c.noise) for c in every if c.stated == "unstated"} == {
        (a, n) for a in ARTEFACTS for n in NOISES
    }
    stated = [cell for cell in every if cell.stated != "unstated"]
    assert {(c.noise, c.stated) for c in stated} >= {
        (n, s) for n in ("white", "set-up 1", "axis × 3") for s in STATED if s != "unstated"
    }


def test_a_recording_is_the_same_whenever_it_is_drawn() -> None:
    cell = Cell("plate", "walk")
    first, again, other = recording(cell, 7, 3), recording(cell, 7, 3), recording(cell, 7, 4)
    assert first.files == again.files
    assert first.truth == again.truth
    assert first.truth != other.truth


def values_of(truth: dict[str, float], key: tuple[str, str]) -> float:
    """Of one unknown of the package; lobes are a cosine and a sine there."""
    if key[0] != "probe_lobing":
        return truth[".".join(key)]
    phase = truth["probe_lobing.phase_rad"]
    return truth["probe_lobing.amplitude_um"] * float(np.cos(phase) if key[1] == "cosine_um" else np.sin(phase))


@pytest.mark.parametrize("artefact", ARTEFACTS)
def test_the_truth_leaves_the_package_nothing_to_explain_and_a_turned_sign_does(
    artefact: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Two programs written apart agree on geometry, signs and units to the nanometre that is written.

    The study's own takes squarenesses as small angles S, which differ from turned axes by S² over the travel.
    """
    monkeypatch.setitem(NOISES, "white", lambda readings, random: np.zeros(readings.shape))
    made = recording(Cell(artefact, "white"), 5, 0)
    model, _ = screened_model(cmm_uq.read(made.write(tmp_path)))
    truth = np.array([values_of(made.truth, u.key) for u in model.unknowns])
    left = np.abs(model.residuals(truth)).max()
    squarenesses = [value / 206265 for name, value in made.truth.items() if name.startswith("squareness")]
    assert left < 3e-6 + 1000.0 * max(np.square(squarenesses), default=0.0)
    for i in range(len(truth) - len(model.artefact.sizes)):
        turned = truth * np.where(np.arange(len(truth)) == i, -1, 1)
        assert np.abs(model.residuals(turned)).max() > 10 * left


def test_the_chain_and_the_tip_give_a_rotation_its_lever() -> None:
    """Chain YXZ: a turn of carriage x about y acts on z and the tip; at x = 400 mm, z = −300 mm and a tip of (0, 50, −80)."""
    one = np.ones(1, dtype=int)
    columns = {"tip_x_mm": np.array([0.0]), "tip_y_mm": np.array([50.0]), "tip_z_mm": np.array([-80.0])}
    p = np.array([[400.0, 200.0, -300.0]])
    placed = Placed("triangle", p, one, one, one, ("rotation_x_y",), "", {}, columns, chain="YXZ")
    assert error(placed, p, {"rotation_x_y": 10.0})[0] == pytest.approx([10 * ARCSECOND * 0.4 * -380, 0, 0], rel=1e-12)


def readings(artefact: str = "plate", axis: int = 1) -> Readings:
    placed = ARTEFACTS[artefact](np.random.default_rng(1))
    return Readings(placed, 1e-3, 20.0 * np.arange(1, len(placed.true) + 1), axis)


def spread(kind: str, artefact: str = "plate") -> np.ndarray:
    """Standard deviations over 400 recordings, (n, 3), in units of the reading noise."""
    read, random = readings(artefact), np.random.default_rng(2)
    return np.std([NOISES[kind](read, random) for _ in range(400)], axis=0) / read.sigma


@pytest.mark.parametrize(
    ("kind", "expected"),
    [("white", (1, 1, 1)), ("axis × 2", (1, 2, 1)), ("axis × 3", (1, 3, 1)), ("set-up 1", np.full(3, 2**0.5)),
     ("set-up 2", np.full(3, 5**0.5)), ("correlated", (1, 1, 1))],
)  # fmt: skip
def test_each_kind_of_noise_has_the_size_it_claims(kind: str, expected: np.ndarray) -> None:
    """Of 400 drawings a standard deviation is known to 3.5 %; over 200 points the mean to far better than 3 %."""
    assert spread(kind).mean(axis=0) == pytest.approx(np.asarray(expected, dtype=float), rel=0.03)


def test_repeats_share_the_offset_of_their_placing() -> None:
    read, random = readings(), np.random.default_rng(3)
    drawn = np.array([NOISES["set-up 1"](read, random) for _ in range(200)]).reshape(200, 4, 2, 25, 3)
    assert np.mean(drawn[:, :, 0] * drawn[:, :, 1]) / read.sigma**2 == pytest.approx(1, rel=0.05)
    assert abs(np.mean(drawn[:, :-1, 0] * drawn[:, 1:, 0])) / read.sigma**2 < 0.05


def test_a_walk_starts_at_nothing_and_ends_at_four_times_the_reading_noise() -> None:
    sd = spread("walk").mean(axis=1)
    assert sd[0] == pytest.approx(1, rel=0.1)
    assert sd[-1] == pytest.approx(17**0.5, rel=0.1)


def test_slow_noise_of_a_bar_changes_its_length_alone() -> None:
    read = readings("ballbar")
    ends = NOISES["correlated"](read, np.random.default_rng(4)).reshape(-1, 2, 3)
    assert ends.sum(axis=1) == pytest.approx(np.zeros((60, 3)), abs=1e-12)
    bars = np.diff(read.placed.true.reshape(-1, 2, 3), axis=1)[:, 0]
    assert np.cross(ends[:, 1], bars) == pytest.approx(np.zeros((60, 3)), abs=1e-9)


def test_tails_have_the_same_standard_deviation_and_are_long() -> None:
    """t3: P(|x| > 3 σ) = 0.0138 (tables: t = 5.196), of a normal one 0.0027."""
    read, random = readings(), np.random.default_rng(5)
    drawn = np.concatenate([NOISES["t3"](read, random).ravel() for _ in range(100)]) / read.sigma
    assert np.mean(np.abs(drawn) > 3) == pytest.approx(0.0138, rel=0.1)


def test_the_display_shows_whole_steps_and_growing_noise_reaches_three_times() -> None:
    made = recording(Cell("step gauge", "resolution"), 1, 0)
    lines = made.files["recording.csv"].splitlines()[1:]
    values = np.array([line.split(",")[3:6] for line in lines], dtype=float)
    assert np.abs(values / 5e-3 - np.round(values / 5e-3)).max() < 1e-6
    gauge = readings("step gauge")
    sd = spread("growing", "step gauge").mean(axis=1)
    assert sd[gauge.placed.reach == 0].mean() == pytest.approx(1, rel=0.03)
    assert sd[gauge.placed.reach == gauge.placed.reach.max()].mean() == pytest.approx(3, rel=0.05)


@pytest.mark.parametrize(("level", "factors"), [("right", (1.0,)), ("20 % off", (0.8, 1.2)), ("half", (0.5,))])
def test_stated_noise_is_off_by_what_the_cell_says(level: str, factors: tuple[float, ...]) -> None:
    seen = set()
    for number in range(12):
        made = recording(Cell("sphere", "white", level), 1, number)
        text = made.files["job.toml"]
        stated = float(text.split("u_coordinate_um = ")[1].split("\n")[0])
        seen.add(round(stated / made.truth["noise.coordinate_um"], 2))
    assert seen == set(factors)


def test_time_is_recorded_where_noise_is_slow_and_every_second_time_else() -> None:
    told = {(noise, n): "time_s" in recording(Cell("plane", noise), 1, n).files["recording.csv"]
            for noise in ("white", "walk", "correlated") for n in (0, 1)}  # fmt: skip
    assert told == {("white", 0): False, ("white", 1): True, ("walk", 0): True, ("walk", 1): True,
                    ("correlated", 0): True, ("correlated", 1): True}  # fmt: skip
