"""What a session makes of streams, expectations, soaking, its screen and a watched folder."""

from __future__ import annotations

import os
from math import pi, sin, sqrt
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, strategies as st

from cmm_uq.app.commands.model import recorded_model
from cmm_uq.app.commands.reading import read_job
from cmm_uq.artefacts.ballbar import Ballbar
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.points import Floats, Machine, Points
from cmm_uq.base.units import MICROMETRE
from cmm_uq.laboratory.live.judging import RARE, predicted, scatter
from cmm_uq.laboratory.live.running import WatchedFolder
from cmm_uq.laboratory.live.screen import OperatorInput, Soak, understood
from cmm_uq.laboratory.live.story import Joined, Stream
from cmm_uq.machine.model import RecordingModel
from cmm_uq.machine.physics.catalogue import effects
from tests.conftest import ROOT
from tests.laboratory.live.session import FakeClock
from tests.recordings import bar_facts

S = 1_000_000_000


def fed(times: list[float], value, latency_s: float = 0.0, max_gap_s: float = 10.0) -> Stream:  # type: ignore[no-untyped-def]
    stream = Stream("temp_c", "t", latency_s=latency_s, max_gap_s=max_gap_s)
    for time in times:
        stream.add(round((time + latency_s) * S), value(time))
    return stream


@given(
    st.floats(-5, 5),
    st.floats(0, 0.5),
    st.floats(0.001, 8.999),
    st.lists(st.floats(0.05, 0.9), min_size=20, max_size=20),
)
def test_a_straight_line_is_joined_exactly_whatever_the_latency(
    slope: float, latency: float, moment: float, steps: list[float]
) -> None:
    times, now = [], -2.0
    while now < 12:
        now += steps[len(times) % 20]
        times.append(now)
    found = fed(times, lambda t: 20 + slope * t, latency).at(round(moment * S), 30 * S)
    assert isinstance(found, Joined)
    assert found.value == pytest.approx(20 + slope * moment, abs=1e-6)
    assert found.u == pytest.approx(abs(slope) * latency / sqrt(3), abs=1e-6)


@given(st.floats(2.0, 40.0), st.floats(0, 6.28), st.floats(1.0, 8.0))
def test_the_error_on_a_wave_stays_below_the_bound_that_the_uncertainty_is_made_of(
    period: float, phase: float, moment: float
) -> None:
    """The bound is √3·u; f″ of the last second differences falls behind that of the interval by one step at most."""
    step = 0.1

    def wave(t: float) -> float:
        return sin(2 * pi * t / period + phase)

    found = fed([i * step for i in range(-5, 100)], wave).at(round(moment * S), 30 * S)
    assert isinstance(found, Joined)
    late = (2 * pi / period) ** 3 * 2 * step * step**2 / 8
    assert abs(found.value - wave(moment)) <= sqrt(3) * found.u + late + 1e-9


def test_the_uncertainty_of_a_parabola_is_its_remainder_over_root_three() -> None:
    """f = t² between 0 and 1 s at 0.25 s: ½·2·0.25·0.75 = 0.1875, which is the very error."""
    found = fed([-2.0, -1.0, 0.0, 1.0], lambda t: t * t).at(S // 4, 30 * S)
    assert isinstance(found, Joined)
    assert found.value - 0.0625 == pytest.approx(0.1875)
    assert found.u == pytest.approx(0.1875 / sqrt(3))


def test_at_a_reading_nothing_is_interpolated() -> None:
    assert fed([0.0, 1.0, 2.0], lambda t: t * t).at(S, 30 * S) == Joined(1.0, 0.0)


def test_between_two_readings_alone_the_value_lies_anywhere_between_them() -> None:
    """GUM 4.3.7: a width of 0.4 over √12."""
    found = fed([0.0, 1.0], lambda t: 20 + 0.4 * t).at(S // 2, 30 * S)
    assert isinstance(found, Joined)
    assert found.u == pytest.approx(0.4 / sqrt(12))


def test_while_the_reading_behind_the_point_may_still_come_there_is_no_answer() -> None:
    stream = fed([0.0, 1.0], lambda t: t)
    assert stream.at(2 * S, 11 * S) is None
    assert "gave nothing for 10 s after the point" in str(stream.at(2 * S, 13 * S))


def test_when_the_session_has_ended_nothing_is_waited_for() -> None:
    assert str(fed([0.0, 1.0], lambda t: t).at(2 * S, None)) == "the session ended before t gave another reading"


def test_a_gap_longer_than_stated_gives_no_value() -> None:
    stream = fed([0.0, 1.0, 12.0], lambda t: t)
    assert "11 s about the point" in str(stream.at(5 * S, 30 * S))
    assert isinstance(fed([0.0, 1.0, 12.0], lambda t: t, max_gap_s=11.0).at(5 * S, 30 * S), Joined)


def test_before_the_first_reading_there_is_no_value() -> None:
    assert str(fed([3.0, 4.0], lambda t: t).at(2 * S, 30 * S)) == "t gave nothing before the point"
    assert str(Stream("temp_c", "t").at(2 * S, 30 * S)) == "t gave nothing"


def test_the_memory_of_a_stream_stays_flat_and_its_answers_the_same() -> None:
    stream = Stream("temp_c", "t", max_gap_s=1.0)
    for i in range(20_000):
        stream.add(i * S // 100, 20 + i * 1e-4)
        stream.forget(i * S // 100)
    assert len(stream) < 320
    found = stream.at(19_990 * S // 100 + 3_000_000, 300 * S)
    assert isinstance(found, Joined)
    assert found.value == pytest.approx(20 + 19_990.3e-4, abs=1e-9)


def left_out(model: RecordingModel, row: int, sigma: float) -> tuple[float, float]:
    linear = model.linearised(np.array([unknown.prior_mean for unknown in model.unknowns]))
    place = linear.freedoms.dense()
    whole = np.hstack([linear.design, place]) / linear.noise_scale[:, None]
    y = linear.observed / linear.noise_scale
    keep = np.arange(len(y)) != row
    rows, known = linear.priors
    prior = np.hstack([rows, np.zeros((len(rows), place.shape[1]))]) * sigma
    rest = np.vstack([whole[keep], prior])
    size = np.linalg.norm(rest, axis=0)
    inverse = (
        np.linalg.pinv(rest / size, rcond=1e-10) / size[:, None]
    )  # of the rows: their squares would lose half the digits
    values = inverse @ np.concatenate([y[keep], known * sigma])
    scale = linear.noise_scale[row] / MICROMETRE
    variance = sigma**2 * (1 + np.sum((whole[row] @ inverse) ** 2))
    return float((y[row] - whole[row] @ values) * scale), float(np.sqrt(variance) * scale)


@pytest.mark.parametrize("name", ["iota-1102-20C", "step-gauge-simulated", "plate-simulated", "sphere-simulated"])
def test_it_is_what_a_fit_without_the_observation_leaves(name: str) -> None:
    model, _ = recorded_model(read_job(ROOT / "examples" / name))
    found = predicted(model)
    assert found is not None
    for row in np.linspace(0, len(found.measured) - 1, 4).astype(int):
        if not np.isfinite(found.expected[row]):
            continue
        off, u = left_out(model, row, found.sigma * MICROMETRE)
        assert found.measured[row] - found.expected[row] == pytest.approx(off, rel=1e-4, abs=1e-3)
        assert found.u[row] == pytest.approx(u, rel=1e-4)


def repeated(errors_um: Floats, machine: Machine) -> RecordingModel:
    count, repeats = errors_um.shape
    m, r = (a.ravel() for a in np.meshgrid(np.arange(1, count + 1), np.arange(1, repeats + 1), indexing="ij"))
    first = np.column_stack([100.0 + 0 * m, 100.0 + 10 * m, -300.0 + 0 * m])
    second = first + np.column_stack([400 + errors_um.ravel() * MICROMETRE, 0 * m, 0 * m])
    one = np.ones(len(m), dtype=np.int64)
    points = Points(np.vstack([first, second]), np.tile(m, 2), np.concatenate([one, 2 * one]), np.tile(r, 2), machine)
    return RecordingModel(Ballbar(bar_facts(400.0, 0.5), points), effects(["scale_x"]))


def test_the_scatter_of_repeats_is_judged_against_that_of_the_others_by_f(machine: Machine) -> None:
    """Repeats of ±1 µm everywhere: a coordinate of 1/√2·√2 = 1 µm a length's √2; F(1, 4; 0.01) = 21.198 (tables)."""
    usual = np.array([[1.0, -1.0]] * 4)
    for wild, asked in ((np.array([[4.5, -4.5]]), False), (np.array([[4.7, -4.7]]), True)):
        found = scatter(repeated(np.vstack([usual, wild]), machine), 5)
        assert (found is not None) is asked
    assert found is not None
    assert found.usual == pytest.approx(1.0, rel=1e-3)
    assert found.s == pytest.approx(4.7, rel=1e-3)
    assert found.limit == pytest.approx(np.sqrt(21.198), rel=1e-3)


def test_and_against_the_stated_noise_by_chi_square(machine: Machine) -> None:
    """χ²(1; 0.01) = 6.635 (tables): two repeats that differ by 2·√6.635 σ."""
    from dataclasses import replace

    assert RARE == 0.01
    for half, asked in ((2.5, False), (2.65, True)):
        model = replace(repeated(np.array([[half, -half]]), machine), sigma=MICROMETRE)
        assert (scatter(model, 1) is not None) is asked


def test_without_repeats_or_stated_noise_nothing_is_asked_for(machine: Machine) -> None:
    assert scatter(repeated(np.array([[1.0], [2.0]]), machine), 1) is None
    assert predicted(repeated(np.array([[1.0]]), machine)) is None


def soaked(k_per_h: float, minutes: float, noise: float = 0.0) -> Soak:
    soak, random = Soak("temp_air_c", 0.5, 10.0), np.random.default_rng(1)
    for i in range(int(minutes * 60)):
        soak.add(i * 10**9, 20 + k_per_h * i / 3600 + noise * float(random.standard_normal()))
    return soak


def test_the_change_is_that_of_the_straight_line() -> None:
    change = soaked(0.4, 15).change
    assert change is not None
    assert change[0] == pytest.approx(0.4)
    assert change[1] == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize(("k_per_h", "settled"), [(0.4, True), (-0.4, True), (0.6, False), (-0.6, False)])
def test_the_criterion_counts_both_ways(k_per_h: float, settled: bool) -> None:
    assert soaked(k_per_h, 15).settled is settled


def test_before_the_stated_time_nothing_is_said() -> None:
    assert soaked(0.0, 8).settled is None
    assert "seen for 8 of 10 min" in str(soaked(0.0, 8).words)


def test_noise_that_hides_the_change_does_not_settle_it() -> None:
    """Sixty means of ten readings of 0.1 K: s(slope) = 0.1/√10/√(60·(1/6 h)²/12) = 0.085 K/h, so 0.4 + 2·0.085 > 0.5."""
    soak = soaked(0.4, 15, noise=0.1)
    assert soak.change is not None
    assert soak.change[1] == pytest.approx(0.085, rel=0.25)
    assert soak.settled is False


def test_numbers_words_and_nothing() -> None:
    assert understood("1.5 -2 3e1") == OperatorInput("point", "1.5 -2 3e1", (1.5, -2.0, 30.0))
    assert understood("404.2") == OperatorInput("point", "404.2", (404.2,))
    assert understood("  ") == OperatorInput("take")
    assert understood("u the ball slipped") == OperatorInput("undo", "the ball slipped")
    assert understood("QUIT") == OperatorInput("quit")


@pytest.mark.parametrize(("line", "told"), [
    ("1 2", "2 numbers. Type three coordinates"), ("1,5 2 3", "Write decimals with a point"), ("undo", "undo without a text"),
    ("r", "'r' is no word"), ("jump", "'jump' is no word"), ("1 2 1e9", "more than anything that is measured"),
    ("nan", "'nan' is no word"), ("1 2 3_0", "is not a number"),
])  # fmt: skip
def test_anything_else_is_told_what_it_lacks(line: str, told: str) -> None:
    with pytest.raises(CmmUqError) as error:
        understood(line)
    assert told in str(error.value)


def test_a_growing_file_is_read_when_it_stands_still_and_once(tmp_path: Path) -> None:
    clock = FakeClock()
    watched, path, read = WatchedFolder(tmp_path, clock), tmp_path / "result.txt", []
    for text in ("a", "ab", "abc"):
        path.write_text(text, encoding="utf-8")
        read += watched.look()
        clock.go(0.5)
    assert read == []
    clock.go(1.0)
    assert [one.content for one in watched.look()] == [b"abc"]
    clock.go(5.0)
    assert watched.look() == []
    path.write_text("abcd", encoding="utf-8")
    watched.look()
    clock.go(1.5)
    assert [one.content for one in watched.look()] == [b"abcd"]


def test_files_come_in_the_order_in_which_they_were_written_and_unfinished_ones_do_not(tmp_path: Path) -> None:
    clock, watched = FakeClock(), WatchedFolder(tmp_path, FakeClock())
    watched = WatchedFolder(tmp_path, clock)
    for name, age in (("b.txt", 20), ("a.txt", 10), ("c.txt.part", 30), (".d.txt", 30)):
        (tmp_path / name).write_text(name, encoding="utf-8")
        os.utime(tmp_path / name, (1_000_000 - age, 1_000_000 - age))
    watched.look()
    clock.go(1.0)
    assert [one.path.name for one in watched.look()] == ["b.txt", "a.txt"]


def test_a_folder_that_is_not_there_is_refused(tmp_path: Path) -> None:
    with pytest.raises(CmmUqError, match="is no folder"):
        WatchedFolder(tmp_path / "none", FakeClock())
