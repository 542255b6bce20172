"""Values at the moment of a point: exact on a straight line, within the stated uncertainty on a wave, never made up."""

from __future__ import annotations

from math import pi, sin, sqrt

import pytest
from hypothesis import given, strategies as st

from cmm_uq.laboratory.live.story import Joined, Stream

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
