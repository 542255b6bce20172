"""A machine that is out of adjustment, and a job that names nothing of it."""

from __future__ import annotations

from benchmarks.told_nothing import case


def test_a_gauge_on_seven_lines_shows_a_machine_out_of_adjustment_and_not_its_own_temperature() -> None:
    """Drawn by equations written apart from the package: one effect with six coefficients would explain as much."""
    hidden, named, verdict = case(13, of_gauge=True)
    assert len(hidden) == 6
    assert {name for name, _ in named} == set(hidden)
    assert verdict == "explained"
